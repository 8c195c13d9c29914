//! What goes in comes out: frames, times, color, and every other stream.

use plumbline::media::{
    Codec, Input, ReadOptions, StreamInfo, StreamKind, VideoReader, VideoWriter, WriteOptions, probe,
};

use crate::support::clips::{
    fast, input, make, output, packet_sums, pattern, picture_sums, real_clip, times, transcode, video_field, workshop,
};

/// Largest difference of two lists of times, s; infinite where their lengths differ.
fn drift(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn every_frame_comes_out_at_its_own_time() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let vfr = "-vf setpts=(N+floor(mod(N*N\\,7)/2))/25/TB -fps_mode vfr -video_track_timescale 90000";
    for (name, args, into) in [
        ("cfr.mp4", "-c:v libx264 -bf 3", "mp4"),
        ("vfr.mp4", &*format!("{vfr} -c:v libx264 -bf 2"), "mp4"),
        ("late.mp4", "-output_ts_offset 1.48 -c:v libx264", "mp4"),
        ("broadcast.ts", "-c:v mpeg2video -bf 2", "ts"),
        ("old.avi", "-c:v mpeg4 -bf 0", "mp4"),
        ("matroska.mkv", "-c:v libx264", "mkv"),
        ("ntsc.mov", "-r 30000/1001 -c:v libx264", "mov"),
    ] {
        let clip = make(folder, name, &format!("{} {args}", pattern(30)));
        let result = folder.join(format!("out-{name}.{into}"));
        let (read, written) = transcode(&input(&clip), &result, &fast()).expect(name);
        assert_eq!((read.frames, read.retimed), (written.frames, 0), "{name}");
        let (before, after) = (times(&clip), times(&result));
        let (first_before, first_after) = (before[0], after[0]);
        // Transport streams move the clock as a whole; distances between frames stay.
        let level = |t: &[f64], by: f64| t.iter().map(|t| t - by).collect::<Vec<_>>();
        let moved = if into == "ts" { (first_before, first_after) } else { (0.0, 0.0) };
        let drift = drift(&level(&before, moved.0), &level(&after, moved.1));
        assert!(drift < 2e-6, "{name}: {drift} s");
    }
}

#[test]
fn an_edit_list_that_hides_frames_hides_them_in_the_result() {
    let Some(folder) = workshop() else { return };
    let long = make(folder.path(), "long.mp4", &format!("{} -c:v libx264 -g 25 -bf 2", pattern(50)));
    let long = long.to_str().expect("UTF-8");
    let cut = make(folder.path(), "cut.mp4", &format!("-ss 0.6 -i {long} -c copy"));
    let result = folder.path().join("out.mp4");
    let (read, _) = transcode(&input(&cut), &result, &fast()).expect("transcodes");
    assert_eq!(read.frames as usize, times(&cut).len());
    assert!(drift(&times(&cut), &times(&result)) < 2e-6);
}

#[test]
fn the_last_frame_keeps_its_duration() {
    let Some(folder) = workshop() else { return };
    let clip = make(folder.path(), "a.mp4", &format!("{} -c:v libx264 -bf 2", pattern(30)));
    let result = folder.path().join("out.mp4");
    transcode(&input(&clip), &result, &fast()).expect("transcodes");
    assert_eq!(video_field(&result, "duration"), video_field(&clip, "duration"));
}

#[test]
fn the_same_work_gives_the_same_bytes() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = make(folder, "a.mp4", &format!("{} -f lavfi -i sine -t 1 -c:v libx264 -c:a aac", pattern(25)));
    for container in ["mkv", "mp4", "mov", "avi", "ts"] {
        let bytes = ["one", "two"].map(|name| {
            let result = folder.join(format!("{name}.{container}"));
            transcode(&input(&clip), &result, &fast()).expect(container);
            std::fs::read(&result).expect("a result")
        });
        assert!(bytes[0] == bytes[1], "{container}");
    }
}

#[test]
fn other_streams_packets_are_bit_identical() {
    let Some(folder) = workshop() else { return };
    let tone = "-f lavfi -i sine=frequency=440:duration=1.2 -f lavfi -i sine=frequency=880:duration=1.2";
    for (name, codecs, into) in [
        ("two.mp4", "-c:a aac -metadata:s:a:1 language=deu", "mp4"),
        ("opus.mkv", "-c:a libopus", "mkv"),
        ("mp2.ts", "-c:a mp2", "mp4"),
        ("pcm.avi", "-c:a pcm_s16le", "mkv"),
    ] {
        let args = format!("{} {tone} -map 0 -map 1 -map 2 -c:v mpeg4 {codecs}", pattern(30));
        let clip = make(folder.path(), name, &args);
        let result = folder.path().join(format!("out-{name}.{into}"));
        let (_, written) = transcode(&input(&clip), &result, &fast()).expect(name);
        let sums = packet_sums(&clip, "a");
        assert!(sums.len() > 10 && written.copied_packets as usize == sums.len(), "{name}");
        let sorted = |mut sums: Vec<String>| {
            sums.sort();
            sums
        };
        assert_eq!(sorted(packet_sums(&result, "a")), sorted(sums), "{name}");
    }
}

#[test]
fn a_lossless_codec_gives_back_every_sample_of_every_format() {
    let Some(folder) = workshop() else { return };
    for (pix, codec, container) in [
        ("yuv420p", "ffv1", "mkv"),
        ("yuv422p10le", "ffv1", "mkv"),
        ("yuv444p12le", "ffv1", "mkv"),
        ("yuv440p", "ffv1", "mkv"),
        ("yuv411p", "ffv1", "mkv"),
        ("yuva420p", "ffv1", "mkv"),
        ("gray", "ffv1", "mkv"),
        ("gray16le", "ffv1", "mkv"),
        ("gbrp10le", "ffv1", "mkv"),
        ("bgra", "ffv1", "mkv"),
        ("bgr0", "ffv1", "mkv"),
        ("rgb48le", "ffv1", "mkv"),
        ("nv12", "rawvideo", "nut"),
        ("yuyv422", "rawvideo", "nut"),
        ("rgb24", "rawvideo", "nut"),
        ("p010le", "rawvideo", "nut"),
        ("yuv420p16be", "rawvideo", "nut"),
        ("monob", "rawvideo", "nut"),
    ] {
        let name = format!("{pix}.{container}");
        let clip = make(folder.path(), &name, &format!("{} -pix_fmt {pix} -c:v {codec}", pattern(3)));
        let result = folder.path().join(format!("out-{pix}.mkv"));
        let options = WriteOptions { codec: Codec::Ffv1, strict: true, ..fast() };
        let options = WriteOptions { preset: None, ..options };
        transcode(&input(&clip), &result, &options).expect(pix);
        assert_eq!(picture_sums(&result, pix), picture_sums(&clip, pix), "{pix}");
    }
}

#[test]
fn range_primaries_transfer_matrix_and_siting_are_kept() {
    let Some(folder) = workshop() else { return };
    let fields = "color_range,color_space,color_transfer,color_primaries,chroma_location,sample_aspect_ratio";
    for (name, tags, codec) in [
        ("709", "-color_range tv -colorspace bt709 -color_trc bt709 -color_primaries bt709", Codec::H264),
        ("full", "-color_range pc -colorspace bt470bg -color_trc iec61966-2-1 -color_primaries bt470bg", Codec::H264),
        ("center", "-chroma_sample_location topleft -vf setsar=4/3", Codec::H264),
        (
            "pq",
            "-pix_fmt yuv420p10le -color_range tv -colorspace bt2020nc -color_trc smpte2084 -color_primaries bt2020",
            Codec::Hevc,
        ),
    ] {
        let clip = make(folder.path(), &format!("{name}.mp4"), &format!("{} {tags} -c:v libx264", pattern(3)));
        let result = folder.path().join(format!("out-{name}.mp4"));
        transcode(&input(&clip), &result, &WriteOptions { codec, ..fast() }).expect(name);
        assert_eq!(video_field(&result, fields), video_field(&clip, fields), "{name}");
    }
}

#[test]
fn hdr_metadata_inside_the_bitstream_reach_container_and_bitstream() {
    let Some(folder) = workshop() else { return };
    let hdr = "master-display=G(8500,39850)B(6550,2300)R(35400,14600)WP(15635,16450)L(10000000,1):max-cll=1000,400";
    let args = format!("{} -pix_fmt yuv420p10le -c:v libx265 -x265-params log-level=none:{hdr}", pattern(3));
    let clip = make(folder.path(), "hdr.mkv", &args);
    // Bitstream of HEVC (FFmpeg 5.1 does not read that of H.264 back), container of both.
    for (codec, name, shown) in [
        (Codec::Hevc, "out.mp4", ["-show_frames", "-read_intervals", "%+#1"]),
        (Codec::H264, "h264.mp4", ["-show_streams", "-select_streams", "v:0"]),
    ] {
        let result = folder.path().join(name);
        transcode(&input(&clip), &result, &WriteOptions { codec, ..fast() }).expect(name);
        let text = crate::support::clips::probe(&result, &shown);
        for expected in ["red_x=35400/50000", "max_content=1000", "max_average=400"] {
            assert!(text.contains(expected), "{name}: {expected} is missing in {text}");
        }
        let hdr = |s: &StreamInfo| matches!(&s.kind, StreamKind::Video(v) if v.hdr_metadata);
        assert!(probe(&input(&result)).expect("probes").streams.iter().any(hdr), "{name}");
    }
}

#[test]
fn the_rotation_flag_passes_and_the_pixels_stay_unturned() {
    let Some(folder) = workshop() else { return };
    let plain = make(folder.path(), "plain.mp4", &format!("{} -c:v libx264", pattern(3)));
    let plain = plain.to_str().expect("UTF-8");
    let turned = make(folder.path(), "turned.mp4", &format!("-i {plain} -c copy -metadata:s:v rotate=90"));
    let reader = VideoReader::open(&input(&turned), &ReadOptions::default()).expect("opens");
    assert_eq!((reader.info().width, reader.info().rotation_deg.abs()), (160, 90.0));
    let result = folder.path().join("out.mp4");
    transcode(&input(&turned), &result, &fast()).expect("transcodes");
    let after = VideoReader::open(&input(&result), &ReadOptions::default()).expect("opens");
    assert_eq!(after.info().rotation_deg, reader.info().rotation_deg);
}

#[test]
fn chapters_tags_and_text_subtitles_pass_between_containers() {
    let Some(folder) = workshop() else { return };
    let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    std::fs::write(path("s.srt"), "1\n00:00:00,200 --> 00:00:00,900\nHold it steady\n").expect("write");
    let meta = ";FFMETADATA1\ntitle=A walk\nartist=Nobody\n[CHAPTER]\nTIMEBASE=1/1000\nSTART=0\nEND=500\ntitle=First\n\
                [CHAPTER]\nTIMEBASE=1/1000\nSTART=500\nEND=1200\ntitle=Second\n";
    std::fs::write(path("m.txt"), meta).expect("write");
    let args = format!(
        "{} -i {} -i {} -map 0 -map 1 -map_metadata 2 -c:v libx264 -c:s mov_text -metadata:s:s language=eng",
        pattern(30),
        path("s.srt"),
        path("m.txt")
    );
    let first = make(folder.path(), "a.mp4", &args);
    // mp4 → Matroska → mp4: text subtitles change their codec twice.
    let (mkv, mp4) = (folder.path().join("b.mkv"), folder.path().join("c.mp4"));
    let (_, one) = transcode(&input(&first), &mkv, &fast()).expect("to Matroska");
    let (_, two) = transcode(&input(&mkv), &mp4, &fast()).expect("and back");
    assert!(one.warnings.is_empty() && two.warnings.is_empty(), "{:?} {:?}", one.warnings, two.warnings);
    let ms = |s: f64| (s * 1e3).round() as i64;
    for result in [&mkv, &mp4] {
        let info = probe(&input(result)).expect("probes");
        assert_eq!(info.tags.iter().find(|(k, _)| k.eq_ignore_ascii_case("title")).map(|(_, v)| &**v), Some("A walk"));
        let titles: Vec<_> =
            info.chapters.iter().map(|c| (c.title.as_deref().unwrap_or(""), ms(c.start_s), ms(c.end_s))).collect();
        assert_eq!(titles, [("First", 0, 500), ("Second", 500, 1200)]);
        let text = make(folder.path(), "back.srt", &format!("-i {}", result.to_str().expect("UTF-8")));
        let text = std::fs::read_to_string(text).expect("read");
        assert!(text.contains("00:00:00,200 --> 00:00:00,900") && text.contains("Hold it steady"), "{text}");
    }
}

#[test]
fn a_cover_is_copied_and_never_taken_for_the_video() {
    let Some(folder) = workshop() else { return };
    let cover = make(folder.path(), "cover.png", "-f lavfi -i color=red:size=600x600 -frames:v 1");
    let args = format!(
        "-i {} {} -map 0 -map 1 -c:v:0 png -c:v:1 libx264 -disposition:v:0 attached_pic",
        cover.to_str().expect("UTF-8"),
        pattern(5)
    );
    let clip = make(folder.path(), "covered.mp4", &args);
    let reader = VideoReader::open(&input(&clip), &ReadOptions::default()).expect("opens");
    assert_eq!((reader.info().width, reader.info().height), (160, 120));
    let result = folder.path().join("out.mp4");
    let (read, written) = transcode(&input(&clip), &result, &fast()).expect("transcodes");
    assert_eq!((read.frames, written.copied_packets), (5, 1));
    let info = probe(&input(&result)).expect("probes");
    assert!(info.streams.iter().any(|s| s.kind == StreamKind::Picture), "{info}");
}

#[test]
fn a_trimmed_clip_begins_at_its_beginning_with_its_sound() {
    let Some(folder) = workshop() else { return };
    let tone = "-f lavfi -i sine=frequency=440:duration=4";
    let args = format!("{} {tone} -c:v libx264 -g 12 -bf 2 -c:a aac", pattern(100));
    let clip = make(folder.path(), "long.mp4", &args);
    let span = input(&clip).trimmed(Some(1.0), Some(2.2)).expect("a span");
    let opened = VideoReader::open(&span, &ReadOptions::default()).expect("opens");
    assert_eq!(opened.info().frames_estimate, Some(30), "frames of the span, not of the clip");
    let result = folder.path().join("out.mp4");
    let (read, _) = transcode(&span, &result, &fast()).expect("transcodes");
    assert_eq!(read.frames, 30);
    let expected: Vec<f64> = (0..30).map(|i| f64::from(i) / 25.0).collect();
    assert!(drift(&times(&result), &expected) < 2e-6, "{:?}", times(&result));
    let (all, kept) = (packet_sums(&clip, "a"), packet_sums(&result, "a"));
    // 1024 samples at 44.1 kHz: 52 packets, one more for each side that is overlapped.
    assert!((52..=54).contains(&kept.len()), "{}", kept.len());
    assert!(all.windows(kept.len()).any(|w| w == kept), "the packets of the span, in their order");
}

#[test]
fn image_sequences_go_in_and_out() {
    let Some(folder) = workshop() else { return };
    let clip = make(folder.path(), "a.mkv", &format!("{} -pix_fmt bgr0 -c:v ffv1", pattern(7)));
    std::fs::create_dir(folder.path().join("100%")).expect("folder");
    let frames = folder.path().join("100%").join("%05d.png");
    transcode(&input(&clip), &frames, &WriteOptions::default()).expect("writes pictures");
    let mut names: Vec<_> = std::fs::read_dir(folder.path().join("100%"))
        .expect("folder")
        .map(|e| e.expect("entry").file_name().into_string().expect("UTF-8"))
        .collect();
    names.sort();
    assert_eq!(names, (1..=7).map(|i| format!("{i:05}.png")).collect::<Vec<_>>());
    let back = folder.path().join("b.mkv");
    let options = WriteOptions { codec: Codec::Ffv1, strict: true, ..WriteOptions::default() };
    let (read, _) = transcode(&input(&frames), &back, &options).expect("reads pictures");
    assert_eq!(read.frames, 7);
    assert_eq!(picture_sums(&back, "rgb24"), picture_sums(&clip, "rgb24"));
}

#[test]
fn standard_input_needs_no_second_reading() {
    let Some(folder) = workshop() else { return };
    let clip = make(folder.path(), "a.mp4", &format!("{} -c:v libx264", pattern(5)));
    let bytes = std::fs::read(&clip).expect("read");
    let spooled = Input::spool(&bytes[..], &plumbline::media::SpoolOptions::default()).expect("spools");
    let result = folder.path().join("out.mp4");
    let (read, _) = transcode(&spooled, &result, &fast()).expect("transcodes");
    assert_eq!(read.frames, 5);
}

#[test]
fn frames_in_memory_of_our_own_are_written_like_any_others() {
    let Some(folder) = workshop() else { return };
    let clip = make(folder.path(), "a.mkv", &format!("{} -pix_fmt yuv420p10le -c:v ffv1", pattern(4)));
    let mut reader = VideoReader::open(&input(&clip), &ReadOptions::default()).expect("opens");
    let result = folder.path().join("out.mkv");
    let options = WriteOptions { codec: Codec::Ffv1, ..WriteOptions::default() };
    let mut writer = VideoWriter::create(&output(&result), &input(&clip), reader.info(), &options).expect("creates");
    let mut pooled = false;
    while let Some(frame) = reader.next_frame().expect("decodes") {
        let mut copy = if pooled {
            writer.new_frame().expect("pool")
        } else {
            plumbline::image::Frame::new(frame.format, frame.width, frame.height)
        };
        pooled = !pooled;
        copy.copy_properties(&frame);
        for i in 0..3 {
            let (from, mut to) = (frame.plane16(i).expect("10 bit"), copy.plane16_mut(i).expect("writable"));
            (0..from.height()).for_each(|y| to.row_mut(y).copy_from_slice(from.row(y)));
        }
        writer.write(copy).expect("writes");
    }
    writer.finish().expect("finishes");
    assert_eq!(picture_sums(&result, "yuv420p10le"), picture_sums(&clip, "yuv420p10le"));
    assert!(drift(&times(&result), &times(&clip)) < 1e-3);
}

#[test]
fn real_clips_keep_frames_times_color_and_sound() {
    if workshop().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let fields = "color_space,color_transfer,color_primaries,pix_fmt,color_range";
    for name in ["campus-vertical-rotflag.mp4", "forest-vfr-audio.mp4", "nus0-hlg10.mp4", "plant-short-audio.mp4"] {
        let Some(clip) = real_clip(name) else { return };
        let result = folder.path().join(name);
        let (read, _) = transcode(&input(&clip), &result, &fast()).expect(name);
        assert_eq!(read.frames as usize, times(&clip).len(), "{name}");
        assert!(drift(&times(&clip), &times(&result)) < 2e-6, "{name}");
        assert_eq!(video_field(&result, fields), video_field(&clip, fields), "{name}");
        let info = |path| VideoReader::open(&input(path), &ReadOptions::default()).expect("opens").info().rotation_deg;
        assert_eq!(info(&result), info(&clip), "{name}");
        if probe(&input(&clip)).expect("probes").streams.len() > 1 {
            assert_eq!(packet_sums(&result, "a"), packet_sums(&clip, "a"), "{name}");
        }
    }
}
