//! Several video streams, and packets of other streams with times that no muxer takes.

use std::path::{Path, PathBuf};

use plumbline::media::{Fault, Input, ReadOptions, VideoReader, VideoWriter, WriteReport, probe};

use crate::support::clips::{fast, input, make, output, packet_sums, pattern, times, workshop};
use crate::support::program::plumbline_in;

fn rewrite(input: &Input, to: &Path) -> WriteReport {
    let mut reader = VideoReader::open(input, &ReadOptions::default()).expect("opens");
    let mut writer = VideoWriter::create(&output(to), input, reader.info(), &fast()).expect("creates");
    while let Some(frame) = reader.next_frame().expect("decodes") {
        writer.write(frame).expect("writes");
    }
    writer.finish().expect("finishes")
}

/// A clip with a small and a large video; `args`: further options, such as which is the default.
fn two(folder: &Path, name: &str, args: &str) -> PathBuf {
    let videos =
        "-f lavfi -i testsrc2=size=64x48:rate=25:duration=0.4 -f lavfi -i testsrc2=size=160x120:rate=25:duration=0.4";
    make(folder, name, &format!("{videos} -map 0 -map 1 -c:v libx264 {args}"))
}

#[test]
fn of_several_videos_the_one_that_ffmpeg_prefers_is_taken_unless_another_is_named() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    for (name, args, best) in [
        ("larger.mkv", "-disposition:v:0 0 -disposition:v:1 0", 1),
        ("larger.mp4", "-disposition:v:0 default -disposition:v:1 default", 1),
        ("default.mkv", "-disposition:v:0 default -disposition:v:1 0", 0),
    ] {
        let clip = two(folder, name, args);
        assert_eq!(probe(&input(&clip)).expect("probes").video, Some(best), "{name}");
        for chosen in [0, 1] {
            let input = input(&clip).with_stream(Some(chosen));
            let reader = VideoReader::open(&input, &ReadOptions::default()).expect("opens");
            let info = reader.info();
            assert_eq!((info.stream, info.width, &info.other_videos), (chosen, [64, 160][chosen], &vec![1 - chosen]));
        }
    }
    let wrong = input(&folder.join("larger.mkv")).with_stream(Some(7));
    let error = VideoReader::open(&wrong, &ReadOptions::default()).expect_err("refused");
    assert_eq!(error.fault(), Fault::Usage);
    assert!(error.to_string().ends_with("stream 7 is not there; of the video streams take one of 0, 1"), "{error}");
}

#[test]
fn the_other_videos_are_copied_and_named() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = two(folder, "two.mkv", "-disposition:v:0 0 -disposition:v:1 0");
    for (chosen, name) in [(0, "a.mkv"), (1, "b.mp4")] {
        let report = rewrite(&input(&clip).with_stream(Some(chosen)), &folder.join(name));
        assert_eq!(report.copied_videos, [format!("stream {} (video, h264)", 1 - chosen)]);
        assert!(report.warnings.is_empty(), "{:?}", report.warnings);
        let other = format!("v:{}", 1 - chosen);
        assert_eq!(packet_sums(&folder.join(name), &other), packet_sums(&clip, &other), "{name}");
    }
    let report = rewrite(&input(&clip), &folder.join("c.flv"));
    assert!(
        report.copied_videos.is_empty() && report.warnings[0].contains("left out: flv cannot hold it"),
        "{report:?}"
    );
    let done = plumbline_in(folder, &["stabilize", "two.mkv", "-o", "d.mkv", "--mode", "similarity", "--stream", "0"]);
    let text = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{text}");
    assert!(
        text.contains("video stream 0 of several") && text.contains("copied as it was: stream 1 (video, h264)"),
        "{text}"
    );
    assert_eq!(probe(&input(&folder.join("d.mkv"))).expect("probes").streams.len(), 2);
}

/// Sets the time of the `n`-th sound packet of an FLV file, ms.
fn set_time(bytes: &mut [u8], n: usize, time: u32) {
    let (mut at, mut seen) = (13, 0);
    while at + 11 <= bytes.len() {
        let size = u32::from_be_bytes([0, bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
        if bytes[at] == 8 {
            if seen == n {
                let [high, a, b, c] = time.to_be_bytes();
                bytes[at + 4..at + 8].copy_from_slice(&[a, b, c, high]);
                return;
            }
            seen += 1;
        }
        at += 11 + size + 4;
    }
    panic!("packet {n} of {seen}");
}

#[test]
fn an_odd_time_in_a_sound_packet_costs_neither_the_video_nor_the_sound() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let sound = "-f lavfi -i sine=duration=2:sample_rate=44100";
    let clip = make(folder, "a.flv", &format!("{} {sound} -c:v flv1 -c:a aac", pattern(50)));
    let whole = packet_sums(&clip, "a").len();
    let bytes = std::fs::read(&clip).expect("read");
    for (case, time) in
        [("back", 0), ("behind the next", 900), ("far ahead", 2_000_000_000), ("negative", u32::MAX - 5000)]
    {
        let mut odd = bytes.clone();
        set_time(&mut odd, 30, time);
        let from = folder.join("odd.flv");
        std::fs::write(&from, odd).expect("write");
        for name in ["out.mkv", "out.mp4", "out.mov", "out.ts"] {
            let target = folder.join(name);
            let report = rewrite(&input(&from), &target);
            assert_eq!(times(&target).len(), 50, "{case}, {name}");
            let kept = packet_sums(&target, "a").len();
            assert!(kept + 2 >= whole && kept <= whole, "{case}, {name}: {kept} of {whole}");
            let odd: Vec<_> = report.warnings.iter().filter(|w| w.contains("packets with odd times")).collect();
            assert_eq!(odd.len(), 1, "{case}, {name}: {:?}", report.warnings);
            assert!(odd[0].contains("(audio, aac): ") && odd[0].contains("1 got another time"), "{}", odd[0]);
            std::fs::remove_file(target).expect("remove");
        }
    }
    let report = rewrite(&input(&clip), &folder.join("whole.mp4"));
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
}

/// The tags of an FLV file: packets with their headers.
fn tags(flv: &[u8]) -> Vec<&[u8]> {
    let length =
        |at: usize| 15 + usize::from(flv[at + 1]) * 65536 + usize::from(flv[at + 2]) * 256 + usize::from(flv[at + 3]);
    let mut tags = Vec::new();
    let mut at = FLV_START;
    while at < flv.len() {
        tags.push(&flv[at..at + length(at)]);
        at += length(at);
    }
    tags
}

/// Bytes before the first tag of an FLV file.
const FLV_START: usize = 13;

/// Whether a tag is of AAC: its header (0) or a packet (1).
fn is_aac(tag: &[u8], kind: u8) -> bool {
    tag[0] == 8 && tag[11] >> 4 == 10 && tag[12] == kind
}

/// Repeats the header of the sound of an FLV file before its packet `number`, as live streams do; `alter` changes the copy.
fn with_repeated_header(flv: &[u8], number: usize, alter: impl Fn(&mut [u8])) -> Vec<u8> {
    let tags = tags(flv);
    let mut header = tags.iter().find(|tag| is_aac(tag, 0)).expect("a header of AAC").to_vec();
    let before = *tags.iter().filter(|tag| is_aac(tag, 1)).nth(number).expect("so many packets");
    header[4..8].copy_from_slice(&before[4..8]);
    alter(&mut header);
    let again = |tag: &&[u8]| if std::ptr::eq(*tag, before) { header.clone() } else { Vec::new() };
    flv[..FLV_START]
        .iter()
        .copied()
        .chain(tags.iter().flat_map(|tag| again(tag).into_iter().chain(tag.to_vec())))
        .collect()
}

#[test]
fn sound_whose_header_would_make_the_result_unreadable_is_left_out() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let sound = "-f lavfi -i sine=duration=1:sample_rate=44100";
    let clip = make(folder, "a.flv", &format!("{} {sound} -c:v flv1 -c:a aac", pattern(25)));
    let mut bytes = std::fs::read(&clip).expect("read");
    let before: usize = tags(&bytes).iter().take_while(|tag| !is_aac(tag, 0)).map(|tag| tag.len()).sum();
    // Four bits of the channels: 14 is reserved.
    let channels = &mut bytes[FLV_START + before + 14];
    *channels = *channels & 0x87 | 14 << 3;
    let from = folder.join("damaged.flv");
    std::fs::write(&from, bytes).expect("write");
    for name in ["out.mp4", "out.mov", "out.mkv"] {
        let target = folder.join(name);
        let report = rewrite(&input(&from), &target);
        assert_eq!(times(&target).len(), 25, "{name}: {:?}", report.warnings);
        let is_told = report.warnings.iter().any(|w| w.contains("(audio, aac) is left out"));
        assert!(is_told, "{name}: {:?}", report.warnings);
    }
}

#[test]
fn a_header_that_is_repeated_within_a_stream_does_not_damage_the_copy() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let sound = "-f lavfi -i sine=duration=1:sample_rate=44100";
    let clip = make(folder, "a.flv", &format!("{} {sound} -c:v flv1 -c:a aac", pattern(25)));
    let bytes = std::fs::read(&clip).expect("read");
    let sums = packet_sums(&clip, "a");
    let from = folder.join("repeated.flv");
    for (altered, alter) in [(false, (|_| ()) as fn(&mut [u8])), (true, |tag| tag[14] ^= 0x18)] {
        std::fs::write(&from, with_repeated_header(&bytes, 10, alter)).expect("write");
        for name in ["out.mkv", "out.mp4", "out.ts"] {
            let target = folder.join(name);
            let report = rewrite(&input(&from), &target);
            assert_eq!(times(&target).len(), 25, "{name}: {:?}", report.warnings);
            assert_eq!(packet_sums(&target, "a").len(), sums.len(), "{name}");
            let told = report.warnings.iter().any(|w| w.contains("its header changes on the way"));
            assert_eq!(told, altered, "{name}: {:?}", report.warnings);
            std::fs::remove_file(target).expect("remove");
        }
    }
}
