//! Bad input and bad targets get a clear error, damage is concealed and counted, and nothing is lost.

use std::path::Path;

use plumbline::media::{
    Codec, Deinterlace, Fault, Input, MediaError, ReadOptions, VideoReader, VideoWriter, WriteOptions, probe,
};

use crate::support::clips::{fast, input, make, output, pattern, times, transcode, video_field, workshop};

fn open_error(path: &Path) -> MediaError {
    let text = path.to_str().expect("UTF-8");
    let opened = Input::parse(text).and_then(|input| VideoReader::open(&input, &ReadOptions::default()));
    opened.err().unwrap_or_else(|| panic!("{text} was accepted"))
}

/// The error's words without the folder's name.
fn words(error: &MediaError, folder: &Path) -> String {
    error.to_string().replace(&format!("{}/", folder.display()), "")
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("folder");
    let mut names: Vec<_> = entries.map(|e| e.expect("entry").file_name().into_string().expect("UTF-8")).collect();
    names.sort();
    names
}

#[test]
fn inputs_that_are_no_video_are_refused_by_name() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    std::fs::write(folder.join("empty.mp4"), b"").expect("write");
    std::fs::write(folder.join("noise.mp4"), [7; 4096]).expect("write");
    let clip = make(folder, "whole.mp4", &format!("{} -c:v libx264", pattern(10)));
    let bytes = std::fs::read(&clip).expect("read");
    std::fs::write(folder.join("cut.mp4"), &bytes[..bytes.len() / 2]).expect("write");
    make(folder, "sound.mp4", "-f lavfi -i sine=duration=0.2 -c:a aac");
    make(folder, "photo.png", "-f lavfi -i color=red:size=32x32 -frames:v 1");
    std::fs::rename(folder.join("photo.png"), folder.join("photo.mp4")).expect("rename");
    for (name, expected, fault) in [
        ("missing.mp4", "missing.mp4: no such file; check the name", Fault::Input),
        ("missing-%03d.png", "missing-%03d.png: no such file; check the name", Fault::Input),
        ("empty.mp4", "empty.mp4: the file is empty (0 bytes)", Fault::Input),
        ("noise.mp4", "noise.mp4: not a video that FFmpeg can read, or cut short: Invalid data found", Fault::Input),
        ("cut.mp4", "cut.mp4: not a video that FFmpeg can read, or cut short: Invalid data found", Fault::Input),
        ("sound.mp4", "sound.mp4: has no video stream (only audio)", Fault::Input),
        ("photo.mp4", "photo.mp4: is a still picture (png), not a video; a sequence is given", Fault::Input),
    ] {
        let error = open_error(&folder.join(name));
        assert!(words(&error, folder).starts_with(expected), "{error}");
        assert_eq!(error.fault(), fault);
    }
    let error = open_error(folder);
    assert!(error.to_string().ends_with("cannot be read: it is a folder"), "{error}");
    assert_eq!(probe(&input(&folder.join("sound.mp4"))).expect("sound can be probed").video, None);
}

#[test]
fn a_clip_without_frames_and_a_clip_of_one() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let none = make(folder, "none.mkv", &format!("{} -c:v libx264 -frames:v 0", pattern(3)));
    let error = open_error(&none);
    assert!(
        matches!(error, MediaError::NoFrames { .. } | MediaError::NotMedia { .. } | MediaError::NoVideo { .. }),
        "{error}"
    );
    let one = make(folder, "one.mp4", &format!("{} -c:v libx264 -frames:v 1", pattern(3)));
    let result = folder.join("out.mp4");
    let (read, written) = transcode(&input(&one), &result, &fast()).expect("one frame is a clip");
    assert_eq!((read.frames, written.frames, times(&result).len()), (1, 1, 1));
}

#[test]
fn spans_outside_the_clip_are_refused_with_its_length() {
    let Some(folder) = workshop() else { return };
    let clip = make(folder.path(), "a.mp4", &format!("{} -c:v libx264", pattern(25)));
    let late = input(&clip).trimmed(Some(5.0), Some(6.0)).expect("a span");
    let error = VideoReader::open(&late, &ReadOptions::default()).expect_err("refused");
    let expected = "a.mp4: the span from 5 s to 6 s is empty or lies outside the clip (1 s long)";
    assert_eq!(words(&error, folder.path()), expected);
    assert_eq!(error.fault(), Fault::Usage);
}

#[test]
fn targets_that_would_destroy_something_are_refused() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = make(folder, "a.mp4", &format!("{} -c:v libx264", pattern(3)));
    let before = std::fs::read(&clip).expect("read");
    std::os::unix::fs::symlink(&clip, folder.join("link.mp4")).expect("link");
    std::fs::write(folder.join("there.mp4"), b"precious").expect("write");
    for (name, overwrite, expected) in [
        ("a.mp4", true, "a.mp4: is the input itself; give the result another name"),
        ("link.mp4", true, "link.mp4: is the input itself; give the result another name"),
        ("there.mp4", false, "there.mp4: exists already; choose another name or allow overwriting"),
        ("nowhere/b.mp4", false, "nowhere/b.mp4: cannot be written: No such file or directory"),
        ("b.xyz", false, "b.xyz: no container is known for this name; end it in .mp4"),
    ] {
        let options = WriteOptions { overwrite, ..fast() };
        let error = transcode(&input(&clip), &folder.join(name), &options).expect_err(name);
        assert!(words(&error, folder).starts_with(expected), "{error}");
    }
    assert_eq!(std::fs::read(&clip).expect("read"), before);
    assert_eq!(std::fs::read(folder.join("there.mp4")).expect("read"), b"precious");
    assert_eq!(names(folder), ["a.mp4", "link.mp4", "there.mp4"], "nothing is left behind");
    transcode(&input(&clip), &folder.join("there.mp4"), &WriteOptions { overwrite: true, ..fast() }).expect("allowed");
    assert_eq!(times(&folder.join("there.mp4")).len(), 3);
}

#[test]
fn a_writer_that_is_dropped_leaves_nothing() {
    let Some(folder) = workshop() else { return };
    let clip = make(folder.path(), "a.mp4", &format!("{} -c:v libx264", pattern(20)));
    let mut reader = VideoReader::open(&input(&clip), &ReadOptions::default()).expect("opens");
    let target = output(&folder.path().join("out.mp4"));
    let mut writer = VideoWriter::create(&target, &input(&clip), reader.info(), &fast()).expect("creates");
    for _ in 0..10 {
        writer.write(reader.next_frame().expect("decodes").expect("a frame")).expect("writes");
        assert!(!target.path().exists(), "nothing stands under the final name before the end");
    }
    drop(writer);
    assert_eq!(names(folder.path()), ["a.mp4"]);
}

#[test]
fn damaged_packets_are_concealed_counted_and_survived() {
    let Some(folder) = workshop() else { return };
    let clip = make(folder.path(), "a.ts", &format!("{} -c:v libx264 -bf 2 -g 10", pattern(60)));
    let mut bytes = std::fs::read(&clip).expect("read");
    let mut random = fastrand::Rng::with_seed(3);
    let from = bytes.len() / 4;
    for _ in 0..60 {
        let at = random.usize(from..bytes.len() * 3 / 4);
        bytes[at] ^= 1 << random.u8(0..8);
    }
    let bad = folder.path().join("bad.ts");
    std::fs::write(&bad, bytes).expect("write");
    let result = folder.path().join("out.mp4");
    let (read, written) = transcode(&input(&bad), &result, &fast()).expect("carries on");
    assert!(read.corrupt > 0 || read.bad_packets > 0, "{read:?}");
    assert_eq!(read.frames, written.frames);
    assert!(read.frames + read.lost >= 58, "{read:?}");
    assert_eq!(times(&result).len() as u64, written.frames);
}

#[test]
fn a_file_that_ends_early_is_read_as_far_as_it_goes_and_reported() {
    let Some(folder) = workshop() else { return };
    let args = format!("{} -c:v libx264 -movflags +faststart", pattern(50));
    let clip = make(folder.path(), "a.mp4", &args);
    let bytes = std::fs::read(&clip).expect("read");
    let cut = folder.path().join("cut.mp4");
    std::fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).expect("write");
    let (read, _) = transcode(&input(&cut), &folder.path().join("out.mp4"), &fast()).expect("carries on");
    assert!(read.truncated && read.frames > 10 && read.frames < 50, "{read:?}");
    let (whole, _) = transcode(&input(&clip), &folder.path().join("whole.mp4"), &fast()).expect("transcodes");
    assert!(!whole.truncated);
}

#[test]
fn a_change_of_size_names_the_frame_and_both_sizes() {
    let Some(folder) = workshop() else { return };
    let small = make(folder.path(), "small.ts", &format!("{} -c:v libx264 -bf 0", pattern(5)));
    let large = "-f lavfi -i testsrc2=size=320x240:rate=25:duration=0.2 -c:v libx264 -bf 0 -output_ts_offset 0.2";
    let large = make(folder.path(), "large.ts", large);
    let both = folder.path().join("both.ts");
    let joined = [std::fs::read(small).expect("read"), std::fs::read(large).expect("read")].concat();
    std::fs::write(&both, joined).expect("write");
    let error = transcode(&input(&both), &folder.path().join("out.mp4"), &fast()).expect_err("refused");
    let expected = "both.ts: frame 5 is 320×240 px yuv420p, all before it are 160×120 px yuv420p; cut the clip there or \
                    bring it to one size first";
    assert_eq!(words(&error, folder.path()), expected);
    assert!(!folder.path().join("out.mp4").exists());
}

#[test]
fn odd_sizes_stay_exact_or_are_refused() {
    let Some(folder) = workshop() else { return };
    let odd = "-f lavfi -i testsrc=size=161x121:rate=25:duration=0.2 -c:v ffv1 -pix_fmt";
    let clip = make(folder.path(), "odd.mkv", &format!("{odd} yuv420p"));
    let size = |path: &Path| video_field(path, "width,height");
    let lossless = folder.path().join("a.mkv");
    transcode(&input(&clip), &lossless, &WriteOptions { codec: Codec::Ffv1, strict: true, ..WriteOptions::default() })
        .expect("ffv1 keeps odd sizes");
    assert_eq!(size(&lossless), "161,121");
    let full = folder.path().join("b.mp4");
    let (_, written) = transcode(&input(&clip), &full, &fast()).expect("4:4:4");
    assert_eq!((size(&full).as_str(), written.pixel_format.as_str()), ("161,121", "yuv444p"));
    assert_eq!(written.warnings, ["161×121 px is odd: libx264 encodes yuv444p instead of yuv420p to keep the size"]);
    let error = transcode(&input(&clip), &folder.path().join("c.mp4"), &WriteOptions { strict: true, ..fast() });
    let error = error.expect_err("strict").to_string();
    assert!(error.starts_with("161×121 px is odd, which libx264 cannot hold in yuv420p (even sizes only)"), "{error}");
}

#[test]
fn losses_are_reported_and_with_strict_refused() {
    let Some(folder) = workshop() else { return };
    let deep = make(folder.path(), "deep.mkv", &format!("{} -pix_fmt yuv420p12le -c:v ffv1", pattern(3)));
    let target = folder.path().join("out.mp4");
    let (_, written) = transcode(&input(&deep), &target, &fast()).expect("with a warning");
    assert_eq!(written.warnings, ["libx264 encodes yuv420p10le: depth falls from 12 to 10 bit"]);
    let strict = WriteOptions { strict: true, overwrite: true, ..fast() };
    let error = transcode(&input(&deep), &target, &strict).expect_err("refused");
    let expected = "libx264 encodes yuv420p10le: depth falls from 12 to 10 bit (refused because of strict)";
    assert_eq!(error.to_string(), expected);
    let tone = "-f lavfi -i sine=duration=0.1";
    let sound = make(folder.path(), "pcm.mkv", &format!("{} {tone} -c:v libx264 -c:a pcm_s24le", pattern(3)));
    let (_, written) = transcode(&input(&sound), &folder.path().join("s.mp4"), &fast()).expect("with a warning");
    assert_eq!(written.warnings, ["stream 1 (audio, pcm_s24le) is left out: mp4 cannot hold it"]);
    let error = transcode(&input(&sound), &target, &strict).expect_err("refused");
    assert_eq!(error.fault(), Fault::Usage);
}

#[test]
fn interlaced_video_is_detected_and_rebuilt_or_refused() {
    let Some(folder) = workshop() else { return };
    let filter = "-vf tinterlace=interleave_top,fieldorder=tff";
    let source = "-f lavfi -i testsrc2=size=160x120:rate=50:duration=1";
    let clip = make(folder.path(), "tff.mpg", &format!("{source} {filter} -c:v mpeg2video -flags +ildct+ilme"));
    let result = folder.path().join("out.mp4");
    let (read, _) = transcode(&input(&clip), &result, &fast()).expect("deinterlaces");
    assert_eq!((read.frames, read.deinterlaced), (25, 25));
    assert_eq!(video_field(&result, "field_order"), "progressive");
    let refuse = ReadOptions { deinterlace: Deinterlace::Refuse, ..ReadOptions::default() };
    let error = VideoReader::open(&input(&clip), &refuse).expect_err("refused");
    let expected = "tff.mpg: frame 0 is interlaced; allow deinterlacing, or convert it to progressive video first";
    assert_eq!(words(&error, folder.path()), expected);
}

#[test]
fn settings_that_an_encoder_cannot_follow_are_refused_with_the_range() {
    let Some(folder) = workshop() else { return };
    let clip = make(folder.path(), "a.mp4", &format!("{} -c:v libx264", pattern(3)));
    let target = folder.path().join("out.mkv");
    for (options, expected) in [
        (WriteOptions { crf: Some(99.0), ..fast() }, "encoder libx264 refused crf 99: expected 0 to 51"),
        (
            WriteOptions { preset: Some("fastest".into()), ..WriteOptions::default() },
            "encoder libx264 refused preset \"fastest\": one of ultrafast, superfast, veryfast, faster, fast, medium, \
             slow, slower, veryslow",
        ),
        (
            WriteOptions { crf: Some(20.0), bitrate: Some(1_000_000), ..fast() },
            "encoder libx264 refused both crf and bitrate: give one of them",
        ),
        (
            WriteOptions { codec: Codec::Ffv1, crf: Some(20.0), ..WriteOptions::default() },
            "encoder ffv1 refused crf: it has no constant-quality setting",
        ),
    ] {
        let error = transcode(&input(&clip), &target, &options).expect_err(expected);
        assert_eq!(error.to_string(), expected);
        assert_eq!(error.fault(), Fault::Usage);
    }
    let webm = folder.path().join("out.webm");
    let error = transcode(&input(&clip), &webm, &fast()).expect_err("WebM holds no H.264");
    assert_eq!(error.to_string(), "webm holds no h264 (it holds av1); take another codec or container");
    assert_eq!(names(folder.path()), ["a.mp4"]);
}
