//! Image sequences as input, through the built program: named by a pattern, a folder or a glob, at a rate of their own.

use std::path::Path;

use crate::support::clips::{make, shaky, times, video_field, workshop};
use crate::support::program::{err, plumbline_in, succeed};

/// Ten pictures in `folder/f`, named f1.png to f10.png.
fn pictures(folder: &Path) {
    std::fs::create_dir(folder.join("f")).expect("a folder");
    make(folder, "f/f%d.png", &format!("{} -frames:v 10", shaky(0.4)));
}

#[test]
fn a_pattern_a_folder_and_a_glob_are_the_same_clip_at_the_rate_asked_for() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    pictures(folder);
    let mut files = Vec::new();
    for (name, rate, told, step) in [
        ("f/f%d.png", None, "f/f%d.png, 320×180, 25 fps (assumed; --fps sets another)", 1.0 / 25.0),
        ("f/f%d.png", Some("50"), "f/f%d.png, 320×180, 50 fps\n", 1.0 / 50.0),
        ("f", Some("23.976"), "f, 320×180, 23.976 fps\n", 1001.0 / 24000.0),
        ("f/*.png", Some("50"), "f/*.png, 320×180, 50 fps\n", 1.0 / 50.0),
    ] {
        let mut args = vec!["stabilize", name, "-o", "out.mkv", "--codec", "ffv1", "--overwrite"];
        args.extend(rate.into_iter().flat_map(|r| ["--fps", r]));
        let ran = succeed(folder, &args);
        assert!(err(&ran).contains(told), "{name}: {}", err(&ran));
        let shown = times(&folder.join("out.mkv"));
        assert_eq!(shown.len(), 10, "{name}");
        // Matroska tells times in milliseconds.
        assert!(shown.iter().enumerate().all(|(i, t)| (t - i as f64 * step).abs() < 1e-3), "{name}: {shown:?}");
        files.push(crate::support::clips::picture_sums(&folder.join("out.mkv"), "yuv420p"));
    }
    assert_eq!(files[1], files[3], "by number and not by letter: f10 comes last");
}

#[test]
fn pictures_that_are_no_sequence_are_refused_with_what_to_do() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    pictures(folder);
    make(folder, "a.mp4", &format!("{} -frames:v 5 -c:v libx264 -preset ultrafast -pix_fmt yuv420p", shaky(0.4)));
    let refuse = |args: &[&str], code: i32, message: &str| {
        let ran = plumbline_in(folder, &[&["stabilize", "-o", "out.mp4"], args].concat());
        assert_eq!(ran.status.code(), Some(code), "{args:?}: {}", err(&ran));
        assert!(err(&ran).contains(message), "{args:?}: {}", err(&ran));
    };
    refuse(
        &["a.mp4", "--fps", "30"],
        2,
        "a.mp4: has times of its own; a frame rate can be given for image sequences only",
    );
    refuse(&["f", "--fps", "0"], 2, "`0` is no frame rate");
    refuse(
        &["f/f1.png", "f/f2.png"],
        2,
        "2 pictures do not say that they are one clip; name their folder, or put the glob",
    );
    refuse(
        &["f/f1.png"],
        65,
        "f/f1.png: is a still picture (png), not a video; a sequence is given as frames/%05d.png",
    );
    std::fs::remove_file(folder.join("f/f4.png")).expect("removed");
    refuse(
        &["f/f%d.png"],
        65,
        "f/f%d.png: number 4 is missing (1 to 10 are there in part); supply it, or give the folder",
    );
    std::fs::copy(folder.join("f/f1.png"), folder.join("f/x.jpg")).expect("a copy");
    refuse(&["f"], 65, "f: holds pictures of several kinds (jpg, png); name one kind, such as 'f/*.jpg'");
}

#[test]
fn pictures_are_never_written_over_their_sources() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    pictures(folder);
    let before = std::fs::read(folder.join("f/f7.png")).expect("a picture");
    let ran = plumbline_in(folder, &["stabilize", "f", "-o", "f/f%d.png", "--overwrite"]);
    assert!(matches!(ran.status.code(), Some(2 | 73)), "{}", err(&ran));
    assert!(err(&ran).contains("is the input itself") || err(&ran).contains("over its input"), "{}", err(&ran));
    assert_eq!(std::fs::read(folder.join("f/f7.png")).expect("a picture"), before);
    succeed(folder, &["stabilize", "f", "-o", "g/%03d.png", "--fps", "10"]);
    assert_eq!(video_field(&folder.join("g/001.png"), "width"), "320");
}
