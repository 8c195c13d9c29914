//! Nothing but the named file becomes part of a result, and no input makes a reader wait without end.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use plumbline::media::{Input, MediaError, Output, ReadOptions, VideoReader, VideoWriter, probe};
use plumbline::num::run::{Interrupt, Stopped};

use crate::support::clips::{fast, make, pattern, workshop};
use crate::support::program::plumbline_in;

fn frames(input: &Input) -> Result<u64, MediaError> {
    let mut reader = VideoReader::open(input, &ReadOptions { threads: 1, ..ReadOptions::default() })?;
    while reader.next_frame()?.is_some() {}
    Ok(reader.report().frames)
}

fn write(path: PathBuf, text: &str) -> PathBuf {
    std::fs::write(&path, text).expect("write");
    path
}

/// A clip outside of the folder `list`, one inside, and what HLS makes of the latter.
fn clips(folder: &Path) -> (PathBuf, PathBuf) {
    let list = folder.join("list");
    std::fs::create_dir(&list).expect("a folder");
    make(&list, "a.ts", &format!("{} -c:v libx264", pattern(10)));
    make(&list, "b c.mp4", &format!("{} -c:v libx264", pattern(10)));
    (make(folder, "secret.ts", &format!("{} -c:v libx264", pattern(10))), list)
}

fn hls(segments: &[&str]) -> String {
    let lines: Vec<String> = segments.iter().map(|s| format!("#EXTINF:0.4,\n{s}\n")).collect();
    let lines = lines.concat();
    format!("#EXTM3U\n#EXT-X-VERSION:3\n#EXT-X-TARGETDURATION:1\n#EXT-X-MEDIA-SEQUENCE:0\n{lines}#EXT-X-ENDLIST\n")
}

#[test]
fn texts_that_name_other_files_are_refused_under_any_name() {
    let Some(folder) = workshop() else { return };
    let (secret, list) = clips(folder.path());
    let secret = secret.display();
    let mpd = format!(
        "<?xml version=\"1.0\"?><MPD xmlns=\"urn:mpeg:dash:schema:mpd:2011\" profiles=\"urn:mpeg:dash:profile:isoff-on-demand:2011\" \
         type=\"static\" mediaPresentationDuration=\"PT1S\"><Period><AdaptationSet mimeType=\"video/mp2t\"><Representation id=\"1\" \
         bandwidth=\"1\"><BaseURL>{secret}</BaseURL></Representation></AdaptationSet></Period></MPD>"
    );
    let sdp = "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\nm=video 5004 RTP/AVP 96\na=rtpmap:96 H264/90000\n";
    for (text, expected) in [
        (hls(&[&secret.to_string()]), "is an HLS playlist, not a video"),
        (format!("ffconcat version 1.0\nfile {secret}\n"), "is an ffconcat list, not a video"),
        ("ffconcat version 1.0\nfile clip.mp4\n".to_owned(), "is an ffconcat list, not a video"),
        (mpd, "is not a video but a DASH manifest"),
        (sdp.to_owned(), "is not a video but an SDP session description"),
        ("1\n00:00:00,000 --> 00:00:01,000\nHello\n\n".to_owned(), "is not a video but SubRip subtitle"),
        ("# VobSub index file, v7 (do not modify this line!)\n".to_owned(), "not a video"),
    ] {
        for name in ["clip.mp4", "clip.mkv", "clip.m3u8", "clip", "clip.txt"] {
            let input = Input::parse(write(list.join(name), &text)).expect("a file");
            for input in [input.clone(), input.allowing_playlists(text.contains("file clip.mp4"))] {
                let error = VideoReader::open(&input, &ReadOptions::default()).expect_err("refused").to_string();
                let refused = error.contains(expected) || error.contains("is not there, or not within the folder");
                let recursive = error.contains("it is no clip but");
                assert!(refused || recursive, "{name}: {error}");
                assert!(probe(&input).is_err());
            }
            std::fs::remove_file(list.join(name)).expect("remove");
        }
    }
}

#[test]
fn an_allowed_playlist_reads_its_own_folder_and_nothing_else() {
    let Some(folder) = workshop() else { return };
    let (secret, list) = clips(folder.path());
    std::os::unix::fs::symlink(&secret, list.join("link.ts")).expect("link");
    let read = |text: &str| frames(&Input::parse(write(list.join("list.mp4"), text))?.allowing_playlists(true));
    assert_eq!(read(&hls(&["a.ts"])).expect("its own folder"), 10);
    let inside = list.join("a.ts").display().to_string();
    assert_eq!(read(&hls(&[&inside])).expect("an absolute name inside"), 10);
    let both = "ffconcat version 1.0\n# two parts\nfile a.ts\nfile 'b c.mp4'\n";
    assert_eq!(read(both).expect("its own folder"), 20);
    let secret = secret.display().to_string();
    for name in [
        secret.as_str(),
        "../secret.ts",
        "link.ts",
        "file:../secret.ts",
        "http://127.0.0.1:9/a.ts",
        "concat:../secret.ts",
    ] {
        for text in [hls(&[name]), format!("ffconcat version 1.0\nfile '{name}'\n")] {
            let error = read(&text).expect_err(name);
            assert!(!matches!(error, MediaError::Internal { .. }), "{name}: {error}");
        }
    }
    // A good part first: what follows is left out, not taken from elsewhere.
    let mixed = read(&hls(&["a.ts", &secret])).map_or(10, |n| n);
    assert_eq!(mixed, 10);
    let own = "ffconcat version 1.0\nfile list.mp4\n";
    assert!(read(own).expect_err("recursion").to_string().contains("it is no clip but"));
}

#[test]
fn an_mp4_that_refers_to_another_file_gets_nothing_from_it() {
    let Some(folder) = workshop() else { return };
    let clip = make(folder.path(), "a.mov", &format!("{} -c:v rawvideo -pix_fmt uyvy422", pattern(2)));
    let mut bytes = std::fs::read(&clip).expect("read");
    let at = bytes.windows(4).position(|w| w == b"url ").expect("a data reference");
    // An alias in place of "in this file".
    bytes[at..at + 4].copy_from_slice(b"alis");
    bytes[at + 7] = 0;
    std::fs::write(&clip, bytes).expect("write");
    // Whatever the demuxer makes of it, it ends without a panic and opens nothing.
    let _ = frames(&Input::parse(&clip).expect("a file"));
    assert_eq!(std::fs::read_dir(folder.path()).expect("folder").count(), 1);
}

#[test]
fn what_is_no_regular_file_is_refused_at_once_with_the_remedy() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    assert!(Command::new("mkfifo").arg(folder.join("fifo.mp4")).status().expect("mkfifo").success());
    let _listener = std::os::unix::net::UnixListener::bind(folder.join("socket.mp4")).expect("a socket");
    std::os::unix::fs::symlink("/dev/zero", folder.join("zero.mp4")).expect("link");
    for (name, expected) in [
        (
            "fifo.mp4",
            "it is a named pipe, not a regular file; write its content to a file and give the path of that; - reads standard input",
        ),
        ("socket.mp4", "it is a socket, not a regular file"),
        ("zero.mp4", "it is a device, not a regular file"),
    ] {
        let started = Instant::now();
        let done = plumbline_in(folder, &["probe", name]);
        let text = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(65), "{text}");
        assert!(text.contains(expected), "{text}");
        assert!(started.elapsed() < Duration::from_secs(20));
    }
}

#[test]
fn an_interrupt_stops_opening_reading_and_copying() {
    let Some(folder) = workshop() else { return };
    let sound = "-f lavfi -i sine=duration=1";
    let clip = make(folder.path(), "a.mkv", &format!("{} {sound} -c:v libx264 -c:a aac", pattern(25)));
    let interrupt = Interrupt::new();
    let input = Input::parse(&clip).expect("a file").with_interrupt(&interrupt);
    let mut reader = VideoReader::open(&input, &ReadOptions { threads: 1, ..ReadOptions::default() }).expect("opens");
    let target = folder.path().join("out.mkv");
    let mut writer = VideoWriter::create(&Output::parse(&target), &input, reader.info(), &fast()).expect("creates");
    writer.write(reader.next_frame().expect("decodes").expect("a frame")).expect("writes");
    interrupt.stop();
    let is_interrupt = |e: &MediaError| matches!(e, MediaError::Interrupted(Stopped::Interrupted));
    let read = std::iter::from_fn(|| reader.next_frame().transpose()).find_map(Result::err).expect("stops");
    assert!(is_interrupt(&read), "{read}");
    let written = writer.finish().expect_err("stops");
    assert!(is_interrupt(&written), "{written}");
    assert!(is_interrupt(&VideoReader::open(&input, &ReadOptions::default()).expect_err("stops")));
    assert!(is_interrupt(&probe(&input).expect_err("stops")));
    assert!(!target.exists());
}

#[test]
fn names_that_are_not_utf_8_are_read_and_written() {
    let Some(folder) = workshop() else { return };
    let odd = folder.path().join(OsStr::from_bytes(b"f\xff\xfe"));
    std::fs::create_dir(&odd).expect("a folder");
    let plain = make(folder.path(), "a.mp4", &format!("{} -c:v libx264", pattern(5)));
    let clip = odd.join(OsStr::from_bytes(b"clip\x80.mp4"));
    std::fs::copy(&plain, &clip).expect("copy");
    make(folder.path(), "p%02d.png", &pattern(3));
    for n in 1..=3 {
        let name = [&b"p\xc3"[..], format!("{n:02}.png").as_bytes()].concat();
        std::fs::copy(folder.path().join(format!("p{n:02}.png")), odd.join(OsStr::from_bytes(&name))).expect("copy");
    }
    let pattern = odd.join(OsStr::from_bytes(b"p\xc3%02d.png"));
    for (from, to, expected) in
        [(&clip, &b"out\x81.mkv"[..], 5), (&pattern, b"pictures\x82.mp4", 3), (&clip, b"s\x83%03d.png", 5)]
    {
        let input = Input::parse(from).expect("exists");
        let target = odd.join(OsStr::from_bytes(to));
        let mut reader = VideoReader::open(&input, &ReadOptions::default()).expect("opens");
        let mut writer = VideoWriter::create(&Output::parse(&target), &input, reader.info(), &fast()).expect("creates");
        while let Some(frame) = reader.next_frame().expect("decodes") {
            writer.write(frame).expect("writes");
        }
        writer.finish().expect("finishes");
        assert_eq!(frames(&Input::parse(&target).expect("exists")).expect("reads"), expected, "{}", target.display());
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_plumbline"));
    let done = command.arg("probe").arg(&clip).output().expect("runs");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}
