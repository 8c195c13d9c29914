//! Clips read and written in parts: the same frames as at once, joined without encoding again.

use std::path::{Path, PathBuf};

use plumbline::media::{
    Codec, FrameSpan, MediaError, PassthroughStreams, ReadOptions, VideoReader, VideoWriter, WriteOptions, frame_times,
};

use crate::support::clips::{
    fast, input, make, output, packet_sums, pattern, picture_sums, probe, times, transcode, workshop,
};

const THREADS: ReadOptions =
    ReadOptions { threads: 1, deinterlace: plumbline::media::Deinterlace::Auto, strict: false };

/// Time and samples of every frame of a reader.
fn frames(mut reader: VideoReader) -> Result<Vec<(i64, Vec<u8>)>, MediaError> {
    let mut found = Vec::new();
    while let Some(frame) = reader.next_frame()? {
        let (samples, stride) = frame.buffer().plane(0);
        let rows = samples.chunks(stride).take(frame.height).flat_map(|row| &row[..frame.width]);
        found.push((frame.pts.0, rows.copied().collect()));
    }
    Ok(found)
}

/// The frames of `clip` in `parts` parts.
fn spans(clip: &Path, parts: usize) -> Vec<FrameSpan> {
    let times = frame_times(&input(clip)).expect("times");
    let span = |k: usize| FrameSpan::of(&times, k * times.len() / parts..(k + 1) * times.len() / parts);
    (0..parts).map(|k| span(k).expect("frames of the clip")).collect()
}

/// Encodes a part of `clip`, which is to be a part of `result`.
fn encode(clip: &Path, span: &FrameSpan, part: &Path, result: &Path, options: &WriteOptions) -> Result<(), MediaError> {
    let mut reader = VideoReader::open_span(&input(clip), &THREADS, span)?;
    let mut writer = VideoWriter::create_part(part, &output(result), reader.info(), options)?;
    while let Some(frame) = reader.next_frame()? {
        writer.write(frame)?;
    }
    writer.finish().map(|_| ())
}

/// Joins `parts` of `clip`.
fn join(clip: &Path, parts: &[(PathBuf, FrameSpan)], result: &Path, options: &WriteOptions) -> Result<u64, MediaError> {
    let source = input(clip);
    let reader = VideoReader::open(&source, &THREADS)?;
    let mut writer = VideoWriter::create(&output(result), &source, reader.info(), options)?;
    parts.iter().try_for_each(|(part, span)| writer.append(part, span))?;
    Ok(writer.finish()?.frames)
}

fn encoded(
    folder: &Path,
    clip: &Path,
    count: usize,
    result: &Path,
    options: &WriteOptions,
) -> Vec<(PathBuf, FrameSpan)> {
    let part = |(k, span): (usize, FrameSpan)| {
        let part = folder.join(format!("{k}.part"));
        encode(clip, &span, &part, result, options).expect("encodes");
        (part, span)
    };
    spans(clip, count).into_iter().enumerate().map(part).collect()
}

#[test]
fn frames_read_from_the_middle_are_those_of_the_clip() {
    let Some(folder) = workshop() else { return };
    let vfr = "-vf setpts=(N+floor(mod(N*N\\,7)/2))/25/TB -fps_mode vfr -video_track_timescale 90000";
    for (name, args) in [
        ("closed.mp4", "-c:v libx264 -g 12 -bf 3"),
        ("open.mkv", "-c:v libx264 -g 12 -bf 3 -x264-params open-gop=1"),
        ("vfr.mp4", &*format!("{vfr} -c:v libx264 -g 10 -bf 2")),
        ("late.mp4", "-output_ts_offset 1.48 -c:v libx264 -g 20"),
        ("broadcast.ts", "-c:v mpeg2video -bf 2 -g 15"),
        ("old.avi", "-c:v mpeg4 -bf 0 -g 30"),
        ("one-key.mp4", "-c:v libx264 -g 999"),
    ] {
        let clip = make(folder.path(), name, &format!("{} {args}", pattern(75)));
        let whole = frames(VideoReader::open(&input(&clip), &THREADS).expect(name)).expect(name);
        let times: Vec<i64> = frame_times(&input(&clip)).expect(name).iter().map(|t| t.0).collect();
        assert_eq!(times, whole.iter().map(|(time, _)| *time).collect::<Vec<_>>(), "{name}");
        for span in [spans(&clip, 4), spans(&clip, 25)].concat() {
            let read = VideoReader::open_span(&input(&clip), &THREADS, &span).and_then(frames);
            assert!(read.expect(name) == whole[span.frames.clone()], "{name}: {span:?}");
        }
    }
}

#[test]
fn frames_at_other_times_than_expected_are_refused() {
    let Some(folder) = workshop() else { return };
    let clip = make(folder.path(), "clip.mp4", &format!("{} -c:v libx264 -g 12", pattern(50)));
    let span = spans(&clip, 5).remove(2);
    for (wrong, end) in [
        (FrameSpan { start: span.start + 1, ..span.clone() }, false),
        (FrameSpan { last: span.last - 1, ..span.clone() }, true),
        (FrameSpan { frames: 20..29, ..span.clone() }, true),
    ] {
        let opened = VideoReader::open_span(&input(&clip), &THREADS, &wrong);
        assert_eq!(opened.is_ok(), end, "{wrong:?}");
        let error = opened.and_then(frames).expect_err("refused").to_string();
        assert!(error.contains("work on the clip as a whole"), "{error}");
    }
    assert!(VideoReader::open_span(&input(&clip), &THREADS, &span).and_then(frames).is_ok());
}

#[test]
fn parts_are_joined_without_encoding_again() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let vfr = "-vf setpts=(N+floor(mod(N*N\\,7)/2))/25/TB -fps_mode vfr -video_track_timescale 90000";
    let sound = "-f lavfi -i sine=frequency=440:duration=3";
    for (name, args, codec, into) in [
        ("cfr", "-c:v libx264 -g 12 -bf 3", Codec::H264, "mp4"),
        ("vfr", vfr, Codec::H264, "mp4"),
        ("matroska", "-c:v libx264", Codec::H264, "mkv"),
        ("lossless", "-c:v libx264", Codec::Ffv1, "mkv"),
        ("hevc", "-c:v libx264", Codec::Hevc, "mp4"),
    ] {
        let clip = make(folder, &format!("{name}.mp4"), &format!("{} {sound} {args} -c:a aac -shortest", pattern(75)));
        let preset = (codec != Codec::Ffv1).then(|| "veryfast".to_owned());
        let options = WriteOptions { codec, preset, threads: 1, overwrite: true, ..WriteOptions::default() };
        let (result, at_once) =
            (folder.join(format!("parts-{name}.{into}")), folder.join(format!("whole-{name}.{into}")));
        let parts = encoded(folder, &clip, 4, &result, &options);
        let starts: Vec<usize> = parts.iter().map(|(_, span)| span.frames.start).collect();
        let (read, _) = transcode(&input(&clip), &at_once, &options).expect(name);
        assert_eq!(join(&clip, &parts, &result, &options).expect(name), read.frames, "{name}");
        assert_eq!(times(&result), times(&at_once), "{name}");
        assert_eq!(packet_sums(&result, "a"), packet_sums(&at_once, "a"), "{name}");
        let entries = ["-show_entries", "stream=codec_name,codec_tag_string,width,height,pix_fmt,time_base,index"];
        assert_eq!(probe(&result, &entries), probe(&at_once, &entries), "{name}");
        let flags = probe(&result, &["-select_streams", "v:0", "-show_entries", "frame=key_frame", "-of", "csv=p=0"]);
        let keys: Vec<bool> =
            flags.lines().filter(|line| line.starts_with(['0', '1'])).map(|line| line.starts_with('1')).collect();
        assert!(starts.iter().all(|start| keys[*start]), "{name}: {keys:?}");
        if codec == Codec::Ffv1 {
            assert_eq!(picture_sums(&result, "yuv420p"), picture_sums(&at_once, "yuv420p"));
        }
    }
}

#[test]
fn every_seam_is_compared() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = make(folder, "clip.mp4", &format!("{} -c:v libx264", pattern(40)));
    let (result, options) = (folder.join("out.mp4"), WriteOptions { overwrite: true, ..fast() });
    let good = encoded(folder, &clip, 3, &result, &options);
    let refused = |parts: &[(PathBuf, FrameSpan)]| {
        let error = join(&clip, parts, &result, &options).expect_err("refused").to_string();
        assert!(!result.exists(), "{error}");
        error
    };
    let mut swapped = good.clone();
    (swapped[1].0, swapped[2].0) = (good[2].0.clone(), good[1].0.clone());
    assert!(refused(&swapped).contains("does not fit its seams"), "{}", refused(&swapped));
    let twice = [good[0].clone(), good[0].clone()];
    assert!(refused(&twice).contains("and the one before ends at"), "{}", refused(&twice));
    let mut longer = good.clone();
    longer[1].1.frames.end += 1;
    assert!(refused(&longer).contains("does not fit its seams"));

    let path = &good[1].0;
    let bytes = std::fs::read(path).expect("a part");
    let body = bytes.iter().position(|b| *b == b'\n').expect("a line") + 1;
    for end in [0, 10, body, body + 20, bytes.len() / 2, bytes.len() - 40, bytes.len() - 1] {
        std::fs::write(path, &bytes[..end]).expect("written");
        let error = refused(&good);
        assert!(error.contains("encoded part"), "{end}: {error}");
    }
    let other = WriteOptions { crf: Some(30.0), preset: Some("slow".into()), ..options.clone() };
    let settings = other.preset.clone();
    encode(&clip, &good[1].1, path, &result, &other).expect("encodes");
    assert!(refused(&good).contains("made with other settings"), "{settings:?}");
    let source = PassthroughStreams::None;
    encode(&clip, &good[1].1, path, &result, &WriteOptions { passthrough: source, ..options.clone() })
        .expect("encodes");
    assert_eq!(join(&clip, &good, &result, &options).expect("whole again"), 40);
}
