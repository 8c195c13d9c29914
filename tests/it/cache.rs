//! The cache of tracks: the same results, less work, and nothing taken from it that is damaged.

use std::path::Path;

use crate::support::clips::{make, picture_sums, shaky, workshop};
use crate::support::program::{err, out, plumbline_in, succeed};

/// A clip of two analysis windows, as small as they come.
fn clip(folder: &Path) {
    make(
        folder,
        "clip.mp4",
        &format!("{} -vf scale=160:90 -c:v libx264 -crf 14 -preset ultrafast -pix_fmt yuv420p", shaky(24.8)),
    );
}

/// Stabilizes it to `name`; what is printed.
fn stabilized(folder: &Path, name: &str, more: &[&str]) -> String {
    let args = ["stabilize", "clip.mp4", "-o", name, "--mode", "mesh", "--preset", "ultrafast", "--cache", "cache"];
    err(&succeed(folder, &[&args, more].concat()))
}

/// Files of the cache below `part`.
fn files(folder: &Path, part: &str) -> Vec<std::path::PathBuf> {
    let mut found = Vec::new();
    let mut left = vec![folder.join("cache").join(part)];
    while let Some(folder) = left.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() { left.push(path) } else { found.push(path) }
        }
    }
    found.sort();
    found
}

#[test]
fn a_clip_is_tracked_once_for_all_paths_and_the_result_is_the_same() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    let pictures = |name: &str| picture_sums(&folder.join(name), "yuv420p");
    succeed(folder, &["stabilize", "clip.mp4", "-o", "alone.mkv", "--mode", "mesh", "--preset", "ultrafast"]);
    let first = stabilized(folder, "first.mkv", &[]);
    assert!(!first.contains("cached"), "{first}");
    let windows =
        files(folder, "entries").iter().filter(|path| path.extension().is_some_and(|e| e == "window")).count();
    assert_eq!(windows, 2);
    let again = stabilized(folder, "again.mkv", &[]);
    assert!(again.contains("cached    tracks"), "{again}");
    assert!(pictures("alone.mkv") == pictures("first.mkv") && pictures("first.mkv") == pictures("again.mkv"));
    // Another path from the same tracks; other frames from others.
    let smoother = stabilized(folder, "smoother.mkv", &["--smoothness", "3"]);
    assert!(smoother.contains("cached    tracks") && pictures("smoother.mkv") != pictures("first.mkv"), "{smoother}");
    for other in [["--end", "10"], ["--start", "1"]] {
        let text = stabilized(folder, "other.mkv", &[&other[..], &["-y"]].concat());
        assert!(!text.contains("cached"), "{other:?}: {text}");
    }
    // A clip of another name with the same content.
    std::fs::rename(folder.join("clip.mp4"), folder.join("moved.mp4")).expect("renamed");
    std::fs::copy(folder.join("moved.mp4"), folder.join("clip.mp4")).expect("copied");
    assert!(stabilized(folder, "moved.mkv", &[]).contains("cached    tracks"));
    let held = out(&succeed(folder, &["cache", "du", "--cache", "cache"]));
    assert!(held.starts_with("3 results, "), "{held}");
    assert!(out(&succeed(folder, &["cache", "clear", "--cache", "cache"])).starts_with("3 results, "));
    assert_eq!(out(&succeed(folder, &["cache", "du", "--cache", "cache"])), "0 results, 0 B\n");
}

#[test]
fn a_cache_that_is_damaged_or_cannot_be_used_costs_time_alone() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "clip.mp4", &format!("{} -c:v libx264 -preset ultrafast -pix_fmt yuv420p", shaky(1.0)));
    stabilized(folder, "first.mkv", &[]);
    let wanted = picture_sums(&folder.join("first.mkv"), "yuv420p");
    let window = files(folder, "entries").into_iter().find(|path| path.ends_with("00000.window")).expect("stored");
    let mut bytes = std::fs::read(&window).expect("read");
    let last = bytes.len() - 5;
    bytes[last] ^= 1;
    std::fs::write(&window, bytes).expect("written");
    let text = stabilized(folder, "damaged.mkv", &[]);
    assert!(
        text.contains("tracks in the cache: damaged: 00000.window; they were removed") && !text.contains("cached "),
        "{text}"
    );
    assert!(stabilized(folder, "mended.mkv", &[]).contains("cached    tracks"));
    std::fs::write(folder.join("no-folder"), "").expect("written");
    let args = [
        "stabilize",
        "clip.mp4",
        "-o",
        "without.mkv",
        "--mode",
        "mesh",
        "--preset",
        "ultrafast",
        "--cache",
        "no-folder",
    ];
    let text = err(&succeed(folder, &args));
    assert!(text.contains("the cache `no-folder` is not used"), "{text}");
    for name in ["damaged.mkv", "mended.mkv", "without.mkv"] {
        assert_eq!(picture_sums(&folder.join(name), "yuv420p"), wanted, "{name}");
    }
    let refused = plumbline_in(folder, &["cache", "du", "--cache", "no-folder"]);
    assert_eq!(refused.status.code(), Some(73), "{}", err(&refused));
}
