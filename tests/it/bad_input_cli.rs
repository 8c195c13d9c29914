//! Bad input, bad targets and sudden ends, through the built program: a clear error, its exit status, and nothing lost.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStderr, Stdio};

use crate::support::clips::{make, pattern, picture_sums, shaky, times, video_field, workshop};
use crate::support::program::{command, err, names, plumbline_in, succeed};

fn clip(folder: &Path, name: &str) -> std::path::PathBuf {
    make(folder, name, &format!("{} -c:v libx264 -preset ultrafast -pix_fmt yuv420p", shaky(0.8)))
}

#[test]
fn what_is_no_clip_is_refused_by_name_and_leaves_nothing() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    std::fs::write(folder.join("empty.mp4"), b"").expect("a file");
    std::fs::write(folder.join("noise.mp4"), [7; 4096]).expect("a file");
    let whole = clip(folder, "whole.mp4");
    let bytes = std::fs::read(&whole).expect("a clip");
    std::fs::write(folder.join("cut.mp4"), &bytes[..bytes.len() / 2]).expect("a file");
    make(folder, "sound.mp4", "-f lavfi -i sine=duration=0.2 -c:a aac");
    make(folder, "photo.png", "-f lavfi -i color=red:size=32x32 -frames:v 1");
    std::fs::rename(folder.join("photo.png"), folder.join("photo.mp4")).expect("a new name");
    let before = names(folder);
    for (name, message) in [
        ("missing.mp4", "missing.mp4: no such file; check the name"),
        ("empty.mp4", "empty.mp4: the file is empty (0 bytes)"),
        ("noise.mp4", "noise.mp4: not a video that FFmpeg can read, or cut short"),
        ("cut.mp4", "cut.mp4: not a video that FFmpeg can read, or cut short"),
        ("sound.mp4", "sound.mp4: has no video stream (only audio)"),
        ("photo.mp4", "photo.mp4: is a still picture (png), not a video"),
        ("https://example.org/a.mp4", "only local files are read"),
    ] {
        let ran = plumbline_in(folder, &["stabilize", name, "-o", "out.mp4"]);
        assert_eq!(ran.status.code(), Some(65), "{name}: {}", err(&ran));
        assert!(err(&ran).contains(message), "{name}: {}", err(&ran));
        assert_eq!(names(folder), before, "{name}");
    }
}

#[test]
fn what_cannot_be_followed_passes_unchanged_and_says_so() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let coded = "-c:v ffv1 -pix_fmt yuv420p";
    make(folder, "one.mkv", &format!("{} -frames:v 1 {coded}", pattern(3)));
    make(folder, "black.mkv", &format!("-f lavfi -i color=black:size=160x120:rate=25:duration=0.8 {coded}"));
    make(folder, "gray.mkv", &format!("-f lavfi -i color=gray:size=160x120:rate=25:duration=0.8 {coded}"));
    for (name, frames, told) in [
        ("one.mkv", 1, "unchanged frames 0 to 0: shot of 1 frames, too short to smooth"),
        ("black.mkv", 20, "unchanged frames 0 to 19: motion could be followed in only 0 of 19 frames"),
        ("gray.mkv", 20, "unchanged frames 0 to 19: motion could be followed in only 0 of 19 frames"),
    ] {
        let ran = succeed(folder, &["stabilize", name, "-o", "out.mkv", "--codec", "ffv1", "--overwrite"]);
        assert!(err(&ran).contains(told), "{name}: {}", err(&ran));
        assert!(err(&ran).contains("100.0 % of width and height kept"), "{name}: {}", err(&ran));
        let sums = picture_sums(&folder.join("out.mkv"), "yuv420p");
        assert_eq!(sums.len(), frames);
        assert_eq!(sums, picture_sums(&folder.join(name), "yuv420p"), "{name}");
    }
}

#[test]
fn a_result_has_the_codec_of_its_container() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "a.mkv", &format!("{} -frames:v 4 -c:v ffv1 -pix_fmt yuv420p", pattern(3)));
    for (output, codec) in [("out.mp4", "h264"), ("out.webm", "av1")] {
        succeed(folder, &["stabilize", "a.mkv", "-o", output]);
        assert_eq!(video_field(&folder.join(output), "codec_name"), codec);
    }
    let ran = plumbline_in(folder, &["stabilize", "a.mkv", "-o", "out.webm", "--codec", "h264", "--overwrite"]);
    assert!(err(&ran).contains("webm holds no h264 (it holds av1)"), "{}", err(&ran));
    assert_eq!(video_field(&folder.join("out.webm"), "codec_name"), "av1", "nothing is lost");
}

#[test]
fn odd_sizes_keep_their_size() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "odd.mkv", &format!("{} -vf scale=641:361 -c:v ffv1 -pix_fmt yuv420p", shaky(0.4)));
    for output in ["out.mp4", "out.mkv"] {
        let ran = succeed(folder, &["stabilize", "odd.mkv", "-o", output, "--compare"]);
        let size = |name: &str| ["width", "height"].map(|f| video_field(&folder.join(name), f));
        assert_eq!(size(output), ["641", "361"]);
        assert_eq!(size(&output.replace("out", "out.compare")), ["1284", "361"]);
        assert!(err(&ran).contains("641×361 px is odd"), "{}", err(&ran));
    }
}

#[test]
fn a_change_of_frame_size_is_refused_with_its_frame() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let coded = "-c:v libx264 -preset ultrafast -pix_fmt yuv420p";
    let first = make(folder, "a.ts", &format!("{} {coded}", shaky(0.8)));
    let second = make(folder, "b.ts", &format!("{} -vf scale=160:90 {coded}", shaky(0.8)));
    let joined = [first, second].map(|p| std::fs::read(p).expect("a stream")).concat();
    std::fs::write(folder.join("joined.ts"), joined).expect("a file");
    let before = names(folder);
    let ran = plumbline_in(folder, &["stabilize", "joined.ts", "-o", "out.mp4"]);
    assert_eq!(ran.status.code(), Some(65), "{}", err(&ran));
    let message = "joined.ts: frame 20 is 160×90 px yuv420p, all before it are 320×180 px yuv420p";
    assert!(err(&ran).contains(message), "{}", err(&ran));
    assert_eq!(names(folder), before);
}

#[test]
fn damage_is_concealed_counted_and_reported() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = make(folder, "a.ts", &format!("{} -c:v libx264 -g 10 -preset ultrafast -pix_fmt yuv420p", shaky(1.6)));
    let mut bytes = std::fs::read(&clip).expect("a clip");
    let middle = bytes.len() / 2;
    bytes[middle..middle + 4000].iter_mut().enumerate().for_each(|(i, b)| *b ^= (i * 37 % 251) as u8);
    std::fs::write(folder.join("broken.ts"), bytes).expect("a file");
    let ran = succeed(folder, &["stabilize", "broken.ts", "-o", "out.mp4"]);
    let told = ["damaged packets", "frames with damage", "could not be decoded"];
    assert!(told.iter().any(|t| err(&ran).contains(t)), "{}", err(&ran));
    let (there, kept) = (times(&folder.join("broken.ts")).len(), times(&folder.join("out.mp4")).len());
    assert!(there > 20 && kept == there, "{kept} of {there} frames that can be decoded");
}

#[test]
fn targets_that_cannot_or_must_not_be_written_are_refused_before_any_work() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = clip(folder, "a.mp4");
    std::fs::hard_link(&clip, folder.join("hard.mp4")).expect("a link");
    std::os::unix::fs::symlink(&clip, folder.join("soft.mp4")).expect("a link");
    std::fs::write(folder.join("there.mp4"), b"precious").expect("a file");
    std::os::unix::fs::symlink("/dev/null", folder.join("null.mp4")).expect("a link");
    let original = std::fs::read(&clip).expect("a clip");
    let before = names(folder);
    for (output, overwrite, code, message) in [
        ("a.mp4", true, 2, "`a.mp4` would be written over its input"),
        ("soft.mp4", true, 2, "`soft.mp4` would be written over its input"),
        ("hard.mp4", true, 2, "`hard.mp4` would be written over its input"),
        ("there.mp4", false, 73, "`there.mp4` exists; allow to replace it with --overwrite"),
        (".", true, 73, "`.` is a folder; give the name of a file"),
        ("null.mp4", false, 73, "null.mp4: cannot be written: a device, not a regular file; it is not replaced"),
        ("null.mp4", true, 73, "null.mp4: cannot be written: a device, not a regular file; it is not replaced"),
        ("b.xyz", false, 2, "b.xyz: no container is known for this name; end it in .mp4"),
        ("/proc/b.mp4", false, 73, "/proc/b.mp4: cannot be written"),
        ("a.mp4/b.mp4", false, 73, "cannot make the folder `a.mp4`"),
    ] {
        let mut args = vec!["stabilize", "a.mp4", "-o", output, "--progress", "plain"];
        args.extend(overwrite.then_some("--overwrite"));
        let ran = plumbline_in(folder, &args);
        assert_eq!(ran.status.code(), Some(code), "{output}: {}", err(&ran));
        assert!(err(&ran).contains(message), "{output}: {}", err(&ran));
        assert!(!err(&ran).contains("frames"), "{output}: refused before any work: {}", err(&ran));
        assert_eq!(names(folder), before, "{output}");
    }
    assert_eq!(std::fs::read(&clip).expect("a clip"), original);
    assert_eq!(std::fs::read(folder.join("there.mp4")).expect("a file"), b"precious");
}

#[test]
fn a_full_disk_is_reported_and_leaves_nothing() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder, "a.mp4");
    let program = env!("CARGO_BIN_EXE_plumbline");
    let script = format!("ulimit -f 600; exec '{program}' stabilize a.mp4 -o out.mkv --codec ffv1");
    let ran = std::process::Command::new("bash").args(["-c", &script]).current_dir(folder).output().expect("bash runs");
    assert_eq!(ran.status.code(), Some(73), "{}", err(&ran));
    assert!(err(&ran).contains("out.mkv: cannot be written: File too large"), "{}", err(&ran));
    assert_eq!(names(folder), ["a.mp4"]);
}

/// The program on a clip long enough to be interrupted, once it renders, and what it will tell from there.
fn at_work(folder: &Path) -> (Child, BufReader<ChildStderr>) {
    let args = ["stabilize", "long.mkv", "-o", "out.mp4", "--preset", "slow", "--progress", "json", "--threads", "1"];
    let mut child = command(folder, &args).stderr(Stdio::piped()).spawn().expect("the program starts");
    let mut told = BufReader::new(child.stderr.take().expect("piped"));
    let mut line = String::new();
    while !line.contains("\"label\":\"render\"") {
        line.clear();
        assert!(told.read_line(&mut line).is_ok_and(|n| n > 0), "it ended before the second pass");
    }
    (child, told)
}

fn signal(child: &Child, name: &str) {
    let sent = std::process::Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status();
    assert!(sent.is_ok_and(|s| s.success()), "kill -{name}");
}

#[test]
fn an_interrupted_run_leaves_nothing_and_a_killed_one_only_what_the_next_run_sweeps_up() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let scaled = "-vf scale=960:540 -c:v libx264 -preset ultrafast -pix_fmt yuv420p";
    make(folder, "long.mkv", &format!("{} {scaled}", shaky(2.4)));
    for (name, code) in [("INT", 130), ("TERM", 143)] {
        let (mut child, mut told) = at_work(folder);
        assert!(names(folder).iter().any(|n| n.starts_with("out.partial-")), "{:?}", names(folder));
        signal(&child, name);
        let mut rest = String::new();
        told.read_to_string(&mut rest).expect("UTF-8");
        assert_eq!(child.wait().expect("it ends").code(), Some(code), "{rest}");
        assert!(rest.contains("interrupted; nothing was left under the final name"), "{rest}");
        assert_eq!(names(folder), ["long.mkv"], "SIG{name}");
    }
    let (mut killed, _told) = at_work(folder);
    signal(&killed, "KILL");
    killed.wait().expect("it ends");
    assert!(!folder.join("out.mp4").exists());
    let left = partials(folder);
    assert!(!left.is_empty() && names(folder).len() == left.len() + 1, "{:?}", names(folder));

    // The next run for the same target sweeps that up, and leaves alone what another run is writing there.
    let (mut live, _told) = at_work(folder);
    let lived = partials(folder);
    assert!(!lived.is_empty() && lived.iter().all(|n| !left.contains(n)), "{left:?}, then {lived:?}");
    succeed(folder, &["stabilize", "long.mkv", "-o", "out.mp4", "--preset", "ultrafast", "--end", "0.4", "-y"]);
    assert_eq!(partials(folder), lived);
    signal(&live, "INT");
    live.wait().expect("it ends");
    assert_eq!(names(folder), ["long.mkv", "out.mp4"]);
}

fn partials(folder: &Path) -> Vec<String> {
    names(folder).into_iter().filter(|n| n.starts_with("out.partial-")).collect()
}
