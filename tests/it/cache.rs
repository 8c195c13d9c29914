//! The cache: the same results, less work, and nothing taken from it that is damaged.

use std::path::{Path, PathBuf};

use crate::support::clips::{make, picture_sums, shaky, workshop};
use crate::support::program::{command, err, out, plumbline_in, succeed};

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
fn files(folder: &Path, part: &str) -> Vec<PathBuf> {
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
    assert_eq!(out(&succeed(folder, &["cache", "du", "--cache", "cache"])), "0 results, 0 B in cache\n");
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
        text.contains("tracks in the cache: damaged: 00000.window; it was removed") && !text.contains("cached "),
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

/// A kind of result: a command that needs it, with options that make another of it, and options for which it is the same.
struct Case {
    results: &'static str,
    args: &'static [&'static str],
    other: &'static [&'static str],
    /// What of the results is there for those other options.
    left: &'static str,
    same: &'static [&'static str],
    /// The result is a clip, whose file has times in it: its pictures are compared.
    is_clip: bool,
}

/// All kinds of results but tracks alone, which have tests of their own.
const CASES: [Case; 4] = [
    Case {
        results: "tracks, cameras",
        args: &["motion", "walk.mp4", "--end", "0.5", "-o"],
        other: &["--rolling-shutter", "off"],
        left: "tracks",
        same: &["--threads", "1"],
        is_clip: false,
    },
    Case {
        results: "importance, tracks",
        args: &["retarget", "walk.mp4", "--end", "0.5", "--size", "180x320", "--crf", "0", "-o"],
        other: &["--faces", "off"],
        left: "tracks",
        same: &["--threads", "1"],
        is_clip: true,
    },
    Case {
        results: "skeleton",
        args: &["skeleton", "giraffe.ply", "-o"],
        other: &["--prune", "9"],
        left: "",
        same: &["--joints", "60"],
        is_clip: false,
    },
    Case {
        results: "weights",
        args: &["skin", "weights", "giraffe.ply", "--skeleton", "rig.json", "-o"],
        other: &["--influences", "2"],
        left: "",
        same: &["--threads", "1"],
        is_clip: false,
    },
];

impl Case {
    /// Runs the command, with the result in a file of this name: what the summary says is from the cache, and all that was printed.
    fn run(&self, folder: &Path, name: &str, more: &[&str]) -> (String, String) {
        let name = self.file(name);
        let text = err(&succeed(folder, &[self.args, &[&name], more, &["-y"]].concat()));
        let line = text.lines().find_map(|line| line.trim().strip_prefix("cached")).unwrap_or_default();
        (line.trim().to_owned(), text)
    }

    fn file(&self, name: &str) -> String {
        format!("{name}.{}", if self.is_clip { "mkv" } else { "json" })
    }

    /// What the result is.
    fn result(&self, folder: &Path, name: &str) -> Vec<String> {
        let path = folder.join(self.file(name));
        if self.is_clip {
            return picture_sums(&path, "yuv420p");
        }
        vec![std::fs::read_to_string(path).expect("written")]
    }
}

#[test]
fn every_kind_of_result_is_the_same_from_the_cache_and_computed_again_for_other_settings_and_after_damage() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let media = Path::new(env!("CARGO_MANIFEST_DIR")).join("media");
    std::fs::copy(media.join("street-walk.mp4"), folder.join("walk.mp4")).expect("copied");
    std::fs::copy(media.join("giraffe.ply"), folder.join("giraffe.ply")).expect("copied");
    succeed(folder, &["skeleton", "giraffe.ply", "-o", "rig.json"]);
    let cache = ["--cache", "cache"];
    for case in &CASES {
        let expected = |name: &str, (cached, text): (String, String), results: &str| {
            assert_eq!(cached, results, "{name} of {}: {text}", case.results);
        };
        let is_same = |name: &str| {
            assert!(case.result(folder, name) == case.result(folder, "alone"), "{name} of {}", case.results);
        };
        expected("alone", case.run(folder, "alone", &["--no-cache"]), "");
        expected("first", case.run(folder, "first", &cache), "");
        expected("again", case.run(folder, "again", &cache), case.results);
        expected("same", case.run(folder, "same", &[&cache, case.same].concat()), case.results);
        expected("other", case.run(folder, "other", &[&cache, case.other].concat()), case.left);
        // By force, and stored again.
        let forced: Vec<&str> = case.results.split(", ").flat_map(|result| ["--force", result]).collect();
        expected("forced", case.run(folder, "forced", &[&cache[..], &forced].concat()), "");
        expected("after", case.run(folder, "after", &cache), case.results);
        for result in case.results.split(", ") {
            let (cached, _) = case.run(folder, "part", &[&cache[..], &["--force", result]].concat());
            assert!(!cached.contains(result), "{cached}");
            is_same("part");
        }
        // Every file of every entry is damaged in turn.
        for file in files(folder, "entries") {
            let good = std::fs::read(&file).expect("read");
            let mut bytes = good.clone();
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
            std::fs::write(&file, &bytes).expect("written");
            let (_, text) = case.run(folder, "damaged", &cache);
            is_same("damaged");
            if text.contains("damaged: ") {
                assert!(text.contains("it was removed"), "{text}");
                expected("mended", case.run(folder, "mended", &cache), case.results);
            }
            // That of other settings.
            if file.exists() && std::fs::read(&file).expect("read") == bytes {
                std::fs::write(&file, good).expect("written");
            }
        }
        for name in ["first", "again", "forced", "after"] {
            is_same(name);
        }
        succeed(folder, &["cache", "clear", "--cache", "cache"]);
    }
}

#[test]
fn the_cache_of_the_user_is_used_unless_it_is_turned_off_or_cannot_be_used() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let giraffe = Path::new(env!("CARGO_MANIFEST_DIR")).join("media/giraffe.ply");
    std::fs::copy(giraffe, folder.join("giraffe.ply")).expect("copied");
    let run = |variable: Option<&str>, home: &Path, args: &[&str]| {
        let mut program = command(folder, args);
        program.env("XDG_CACHE_HOME", home).arg("-v");
        match variable {
            Some(value) => program.env("PLUMBLINE_CACHE", value),
            None => program.env_remove("PLUMBLINE_CACHE"),
        };
        let output = program.output().expect("the program starts");
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        err(&output) + &out(&output)
    };
    let skeleton = ["skeleton", "giraffe.ply", "-o", "rig.json", "-y"];
    let home = folder.join("home");
    // To look does not make one.
    assert!(run(None, &home, &["cache", "du"]).starts_with("0 results, 0 B in "));
    for (variable, more) in [(Some(""), vec![]), (None, vec!["--no-cache"])] {
        run(variable, &home, &[&skeleton[..], &more].concat());
        assert!(!home.exists());
    }
    assert!(!run(None, &home, &skeleton).contains("cached"));
    assert!(run(None, &home, &skeleton).contains("cached    skeleton"));
    assert!(run(None, &home, &["cache", "du"]).starts_with("1 results, "));
    assert!(run(None, &home, &["doctor"]).contains("home/plumbline, 1 results, "));
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let cache = home.join("plumbline");
        assert_eq!(cache.metadata().expect("there").permissions().mode() & 0o777, 0o700);
        std::fs::set_permissions(&cache, std::fs::Permissions::from_mode(0o777)).expect("set");
        // Nobody asked for it: no warning. Who names it gets one, and may trust it.
        let text = run(None, &home, &skeleton);
        assert!(!text.contains("cache"), "{text}");
        let named = cache.to_str().expect("UTF-8");
        let text = run(Some(named), &home, &skeleton);
        assert!(text.contains("is not used: others may write to it") && text.contains("--trust-cache"), "{text}");
        assert!(run(Some(named), &home, &[&skeleton[..], &["--trust-cache"]].concat()).contains("cached    skeleton"));
        std::fs::set_permissions(&cache, std::fs::Permissions::from_mode(0o700)).expect("set");
        // What is read-only serves as far as it goes; root writes in any case.
        let entries = cache.join("entries");
        std::fs::set_permissions(&entries, std::fs::Permissions::from_mode(0o500)).expect("set");
        assert!(run(Some(named), &home, &skeleton).contains("cached    skeleton"));
        let text = run(Some(named), &home, &[&skeleton[..], &["--prune", "3"]].concat());
        let is_root = std::fs::create_dir(entries.join("probe")).is_ok();
        assert_eq!(text.contains("skeleton not stored in the cache: "), !is_root, "{text}");
        std::fs::set_permissions(&entries, std::fs::Permissions::from_mode(0o700)).expect("set");
    }
    // No folder for caches, and none can be made.
    std::fs::write(folder.join("file"), "").expect("written");
    let text = run(None, &folder.join("file"), &skeleton);
    assert!(!text.contains("cache"), "{text}");
}

#[test]
fn a_batch_takes_from_the_cache_what_it_stored_and_a_cache_on_another_file_system_serves_as_well() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let media = Path::new(env!("CARGO_MANIFEST_DIR")).join("media");
    for name in ["giraffe.ply", "dog.ply"] {
        std::fs::copy(media.join(name), folder.join(name)).expect("copied");
    }
    // Memory, where there is such a file system.
    let elsewhere = Path::new("/dev/shm");
    let elsewhere = if elsewhere.is_dir() { elsewhere } else { folder };
    let elsewhere = tempfile::tempdir_in(elsewhere).expect("a folder");
    let cache = elsewhere.path().join("cache");
    let cache = cache.to_str().expect("UTF-8");
    let skeletons = |more: &[&str]| {
        let args = ["skeleton", "giraffe.ply", "dog.ply", "--out-dir", "rigs", "--cache", cache, "-y"];
        let text = err(&succeed(folder, &[&args, more].concat()));
        (text.matches("cached    skeleton").count(), text)
    };
    let files =
        || ["giraffe", "dog"].map(|name| std::fs::read(folder.join(format!("rigs/{name}.json"))).expect("written"));
    assert_eq!(skeletons(&[]).0, 0);
    let first = files();
    let (cached, text) = skeletons(&[]);
    assert_eq!(cached, 2, "{text}");
    assert!(files() == first);
    assert_eq!(skeletons(&["--force", "skeleton.extract"]).0, 0);
    let refused = plumbline_in(folder, &["skeleton", "dog.ply", "-o", "a.json", "--cache", cache, "--force", "wind"]);
    let text = err(&refused);
    assert_eq!(refused.status.code(), Some(2), "{text}");
    assert!(text.contains("names `wind`, which is neither a result nor a stage") && text.contains("weights"), "{text}");
    let why = |args: &[&str]| out(&succeed(folder, &[&["cache", "why"], args, &["--cache", cache]].concat()));
    assert!(why(&["dog.ply"]).contains("  why   there was none before") || why(&["giraffe.ply"]).contains("mesh was "));
    succeed(folder, &["skeleton", "dog.ply", "-o", "b.json", "--cache", cache, "--prune", "4"]);
    let text = why(&["dog.ply", "skeleton"]);
    assert!(text.contains("options.prune was 1.05"), "{text}");
    assert!(why(&["dog.ply", "weights"]).contains("the cache has no weights of `dog.ply`"));
}
