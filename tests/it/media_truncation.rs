//! A clip whose end is missing is reported, whatever its container; a whole one is not.

use std::path::Path;

use plumbline::media::{Input, MediaError, ReadOptions, ReadReport, VideoReader};

use crate::support::clips::{input, make, pattern, workshop};
use crate::support::program::plumbline_in;

/// What a cut at any byte shows.
#[derive(Clone, Copy, PartialEq)]
enum Seen {
    /// Always, or the file cannot be opened any more.
    Always,
    /// Unless the cut falls between two parts of the container, such as packets of 188 bytes or fragments.
    InsideParts,
    /// Never: nothing in the file says how long it is.
    Never,
}

/// Every container that is read, the options that make one, and which cuts can be seen.
#[rustfmt::skip]
const CONTAINERS: [(&str, &str, Seen); 24] = [
    ("back.mp4", "-c:v libx264 -c:a aac", Seen::Always), // the index is behind the pictures: cut, it cannot be opened
    ("front.mp4", "-c:v libx264 -c:a aac -movflags +faststart", Seen::Always),
    ("fragments.mp4", "-c:v libx264 -c:a aac -g 10 -movflags +frag_keyframe+empty_moov", Seen::InsideParts),
    ("front.mov", "-c:v mjpeg -c:a pcm_s16le -movflags +faststart", Seen::Always),
    ("a.mkv", "-c:v libx264 -c:a aac -g 10", Seen::Always),
    ("live.mkv", "-c:v libx264 -c:a aac -g 10 -live 1 -f matroska", Seen::InsideParts),
    ("a.webm", "-c:v libvpx -deadline realtime -cpu-used 8 -c:a libopus -g 10", Seen::Always),
    ("a.avi", "-c:v mpeg4 -c:a pcm_s16le", Seen::Always),
    ("a.flv", "-c:v flv1 -an", Seen::Always),
    ("a.asf", "-c:v mpeg4 -an", Seen::Always),
    ("a.wmv", "-c:v wmv2 -c:a wmav2", Seen::Always),
    ("a.mxf", "-c:v mpeg2video -an", Seen::Always),
    ("a.ogv", "-c:v libtheora -c:a libopus", Seen::Always),
    ("a.ts", "-c:v libx264 -c:a aac", Seen::InsideParts),
    ("a.m2ts", "-c:v libx264 -c:a aac", Seen::InsideParts),
    ("a.mpg", "-c:v mpeg2video -c:a mp2", Seen::InsideParts),
    ("a.vob", "-c:v mpeg2video -c:a mp2 -f vob", Seen::InsideParts),
    ("a.y4m", "-pix_fmt yuv420p", Seen::InsideParts),
    ("a.ivf", "-c:v libvpx -deadline realtime -cpu-used 8", Seen::InsideParts),
    ("a.gif", "", Seen::Always),
    ("a.apng", "-f apng", Seen::Always),
    ("a.rm", "-c:v rv10 -s 176x144 -an", Seen::Always),
    ("a.h264", "-c:v libx264", Seen::Never),
    ("a.m2v", "-c:v mpeg2video", Seen::Never),
];

fn read(path: &Path, options: ReadOptions) -> Result<ReadReport, MediaError> {
    let mut reader = VideoReader::open(&Input::parse(path)?, &ReadOptions { threads: 1, ..options })?;
    while reader.next_frame()?.is_some() {}
    Ok(reader.report())
}

#[test]
fn every_container_shows_that_its_end_is_missing_and_none_that_is_whole() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    for (name, args, seen) in CONTAINERS {
        let sound = if args.contains("-an") || !args.contains("-c:a") { "" } else { "-f lavfi -i sine=duration=2" };
        let clip = make(folder, name, &format!("{} {sound} {args}", pattern(50)));
        let whole = read(&clip, ReadOptions::default()).expect(name);
        assert!(!whole.truncated && whole.frames >= 49, "{name}: {whole:?}");
        let strict = ReadOptions { strict: true, ..ReadOptions::default() };
        assert!(read(&clip, strict).is_ok(), "{name}: whole, and strict");
        let bytes = std::fs::read(&clip).expect("read");
        let cut = folder.join(format!("cut-{name}"));
        // Five bytes into a packet of 188, and never past what is to be left.
        let inside_packet = |length: usize| (length - 5) / 188 * 188 + 5;
        for length in [bytes.len() / 3, bytes.len() / 2, bytes.len() * 9 / 10, bytes.len() - 3].map(inside_packet) {
            std::fs::write(&cut, &bytes[..length]).expect("write");
            let Ok(report) = read(&cut, ReadOptions::default()) else { continue };
            let at = format!("{name} cut at {length} of {}: {report:?}", bytes.len());
            assert!(report.frames <= whole.frames, "{at}");
            match seen {
                Seen::Always => assert!(report.truncated, "{at}"),
                // Bytes 0 to 3 of a part are the least that can be seen; these cuts are not at a seam by chance.
                Seen::InsideParts => assert!(report.truncated || report.frames == whole.frames, "{at}"),
                Seen::Never => continue,
            }
            if report.truncated {
                let error = read(&cut, strict).expect_err("strict").to_string();
                assert!(error.contains("the file is cut short") && error.contains("strict"), "{error}");
            }
        }
    }
}

#[test]
fn a_shortfall_is_told_with_both_counts_and_only_where_it_was_asked_for() {
    let Some(folder) = workshop() else { return };
    let clip = make(folder.path(), "a.mkv", &format!("{} -c:v libx264 -g 5", pattern(50)));
    let bytes = std::fs::read(&clip).expect("read");
    let cut = folder.path().join("cut.mkv");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).expect("write");
    let report = read(&cut, ReadOptions::default()).expect("what is there");
    let shortfall = report.shortfall().expect("cut short");
    assert_eq!(shortfall, format!("the file is cut short: {} of 50 frames are there", report.frames));
    let span = |start, end| input(&cut).trimmed(start, end).expect("a span");
    let frames = |input: &Input| {
        let mut reader = VideoReader::open(input, &ReadOptions::default()).expect("opens");
        while reader.next_frame().expect("decodes").is_some() {}
        (reader.report().frames, reader.report().truncated)
    };
    assert_eq!(frames(&span(Some(0.2), Some(0.6))), (10, false), "the missing end is behind the span");
    assert!(frames(&span(Some(0.2), None)).1 && frames(&span(None, Some(1.96))).1);
    let past = input(&clip).trimmed(Some(1.0), Some(100.0)).expect("a span");
    assert_eq!(frames(&past), (25, false), "a span that is longer than a whole clip");
}

/// A download that was given its whole length at once has zeros where it has not come.
#[test]
fn a_file_whose_end_is_zeros_is_cut_short() {
    let Some(folder) = workshop() else { return };
    for (name, args) in [
        ("a.mkv", "-c:v libx264 -g 5"),
        ("a.mp4", "-c:v libx264 -movflags +faststart"),
        ("a.avi", "-c:v mpeg4"),
        ("a.flv", "-c:v flv1"),
    ] {
        let clip = make(folder.path(), name, &format!("{} {args}", pattern(100)));
        let mut bytes = std::fs::read(&clip).expect("read");
        let half = bytes.len() / 2;
        bytes[half..].fill(0);
        std::fs::write(&clip, bytes).expect("write");
        let report = read(&clip, ReadOptions::default()).expect(name);
        assert!(report.truncated && report.frames < 80, "{name}: {report:?}");
    }
}

/// Sound often goes on behind the pictures, and edit lists leave frames out: nothing is missing then.
#[test]
fn whole_clips_with_more_in_them_than_pictures_are_not_cut_short() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let sound = "-f lavfi -i sine=duration=6";
    let both = "-c:v libx264 -c:a aac -g 10";
    make(folder, "long.mkv", &format!("{} {sound} {both}", pattern(50)));
    make(folder, "long.flv", &format!("{} {sound} {both}", pattern(50)));
    make(folder, "long.mp4", &format!("{} {sound} {both}", pattern(50)));
    let from = folder.join("long.mp4");
    make(folder, "edited.mp4", &format!("-ss 0.9 -i {} -c copy", from.display()));
    make(folder, "edited.mkv", &format!("-ss 0.9 -i {} -c copy", from.display()));
    make(folder, "varying.mkv", &format!("{} -vf select='not(mod(n\\,7))+lt(n\\,9)' -vsync vfr {both}", pattern(100)));
    make(folder, "sparse.mkv", &format!("{} -vf select='lt(n\\,3)+gt(n\\,97)' -vsync vfr {both}", pattern(100)));
    for name in ["long.mkv", "long.flv", "long.mp4", "edited.mp4", "edited.mkv", "varying.mkv", "sparse.mkv"] {
        let report = read(&folder.join(name), ReadOptions::default()).expect(name);
        assert!(!report.truncated, "{name}: {report:?}");
    }
}

#[test]
fn a_run_on_a_cut_clip_exits_3_and_with_strict_65() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = make(folder, "a.mkv", &format!("{} -c:v libx264 -g 5", pattern(50)));
    let bytes = std::fs::read(&clip).expect("read");
    std::fs::write(folder.join("cut.mkv"), &bytes[..bytes.len() / 2]).expect("write");
    let run = |args: &[&str]| {
        let done = plumbline_in(folder, args);
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let (code, text) = run(&["stabilize", "cut.mkv", "-o", "out.mkv", "--mode", "similarity", "--preset", "ultrafast"]);
    assert_eq!(code, Some(3), "{text}");
    assert_eq!(text.matches("the file is cut short").count(), 1, "{text}");
    assert!(text.contains("of 50 frames are there"), "{text}");
    let (code, text) = run(&["stabilize", "cut.mkv", "-o", "strict.mkv", "--mode", "similarity", "--strict"]);
    assert_eq!(code, Some(65), "{text}");
    assert!(!folder.join("strict.mkv").exists());
    let (code, text) = run(&["stabilize", "a.mkv", "-o", "whole.mkv", "--mode", "similarity", "--strict"]);
    assert_eq!(code, Some(0), "{text}");
}
