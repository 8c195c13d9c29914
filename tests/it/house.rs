//! Rules of the house that are not about code: what tracked files may say, and that the documents are true.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::support::missing::skip;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Names of the tracked files; `None` where this is no checkout (a source archive) or git is missing.
fn tracked_files() -> Option<Vec<String>> {
    let out = Command::new("git").arg("-C").arg(root()).args(["ls-files", "-z"]).output().ok()?;
    let names = String::from_utf8(out.stdout).ok()?;
    out.status.success().then(|| names.split('\0').filter(|n| !n.is_empty()).map(str::to_owned).collect())
}

#[test]
fn only_the_ci_script_knows_where_real_media_lie() {
    let needle = concat!("..", "/shared");
    let Some(files) = tracked_files() else {
        skip("this is no git checkout");
        return;
    };
    for name in files.iter().filter(|n| *n != ".ci/run") {
        let Ok(bytes) = fs::read(root().join(name)) else { continue };
        let found = bytes.windows(needle.len()).any(|w| w == needle.as_bytes());
        assert!(!found, "{name} names the folder of real media; take it from PLUMBLINE_MEDIA");
    }
}

#[test]
fn the_clips_of_media_stay_small() {
    let Some(files) = tracked_files() else {
        skip("this is no git checkout");
        return;
    };
    let size = |n: &String| fs::metadata(root().join(n)).map_or(0, |m| m.len());
    let total: u64 = files.iter().filter(|n| n.starts_with("media/")).map(size).sum();
    assert!(total < 30_000_000, "media/ holds {total} bytes (allowed: 30 MB)");
}

/// Links `[text](target)` to files of the project.
fn links(document: &str) -> impl Iterator<Item = &str> {
    let targets = document.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    targets.filter(|t| !t.contains("://") && !t.starts_with('#')).map(|t| t.split('#').next().unwrap_or(t))
}

#[test]
fn sources_that_the_architecture_names_exist() {
    let Some(files) = tracked_files() else {
        skip("this is no git checkout");
        return;
    };
    let text = fs::read_to_string(root().join("docs/ARCHITECTURE.md")).expect("a document");
    let quoted = text.split('`').skip(1).step_by(2);
    let named: Vec<&str> = quoted.filter(|name| Path::new(name).extension().is_some_and(|e| e == "rs")).collect();
    assert!(named.len() > 10, "{named:?}");
    for name in named.iter().filter(|name| name.chars().all(|c| c.is_ascii_lowercase() || "_/.".contains(c))) {
        let found = files.iter().any(|file| file == name || file.ends_with(&format!("/{name}")));
        assert!(found, "docs/ARCHITECTURE.md names `{name}`, and there is no such file");
    }
}

/// The file of a test that `docs/GUARANTEES.md` names: of the studio where it says so, else of `tests/it`.
fn file_of_test(file: &str) -> String {
    match file.strip_prefix("studio/") {
        Some(page) if is_of_page(page) => format!("src/studio/ui/tests/{page}"),
        Some(file) => format!("src/studio/{file}.rs"),
        None => format!("tests/it/{file}.rs"),
    }
}

/// Whether the tests of a file run in a browser.
fn is_of_page(file: &str) -> bool {
    Path::new(file).extension().is_some_and(|e| e == "mjs")
}

/// Every guarantee names its tests as `file::name` of `tests/it`, `studio/file::name` of `src/studio`, or as `studio/file.mjs::sentence`
/// of the tests in a browser.
#[test]
fn guarantees_name_tests_that_exist() {
    let text = fs::read_to_string(root().join("docs/GUARANTEES.md")).expect("a document");
    let rows: Vec<&str> = text
        .lines()
        .filter(|l| l.starts_with("| ") && !l.starts_with("| guarantee") && !l.starts_with("| ---"))
        .collect();
    assert!(rows.len() >= 20, "{} guarantees", rows.len());
    for row in rows {
        let cells: Vec<&str> = row.trim_matches('|').split(" | ").collect();
        let tests: Vec<&str> = cells[cells.len() - 1].split('`').skip(1).step_by(2).collect();
        assert!(!tests.is_empty(), "a guarantee without a test: {row}");
        for test in tests {
            let (file, name) = test.rsplit_once("::").unwrap_or((test, ""));
            let source =
                fs::read_to_string(root().join(file_of_test(file))).unwrap_or_else(|_| panic!("{test}: no file"));
            let definition = if is_of_page(file) { format!("test(\"{name}\"") } else { format!("fn {name}(") };
            assert!(source.contains(&definition), "{test} is no test");
        }
    }
}

#[test]
fn links_between_documents_lead_somewhere() {
    let docs =
        fs::read_dir(root().join("docs")).expect("docs/").chain(fs::read_dir(root().join("docs/adr")).expect("adr/"));
    let mut files: Vec<_> = docs.map(|e| e.expect("an entry").path()).filter(|p| p.is_file()).collect();
    files.extend(["README.md", "CHANGELOG.md"].map(|n| root().join(n)));
    for file in files {
        let text = fs::read_to_string(&file).expect("a document");
        for target in links(&text) {
            let path = file.parent().expect("a folder").join(target);
            assert!(path.exists(), "{}: the link to {target} leads nowhere", file.display());
        }
    }
}

/// Lines of the shell blocks of a document that start with `plumbline`, continuation lines joined.
fn commands(document: &str) -> Vec<String> {
    let mut blocks = document.split("```");
    let mut found = Vec::new();
    while let (Some(_), Some(block)) = (blocks.next(), blocks.next()) {
        if let Some(shell) = block.strip_prefix("sh\n") {
            let joined = shell.replace("\\\n", " ");
            found.extend(joined.lines().map(str::trim).filter(|l| l.starts_with("plumbline ")).map(str::to_owned));
        }
    }
    found
}

/// What the command that a line begins with says of itself; the first words of a group (`skin train`) are two.
fn help_of(words: &[&str]) -> Option<String> {
    let alone = help(&words[..1])?;
    if alone.contains("<COMMAND>") { help(words.get(..2)?) } else { Some(alone) }
}

fn help(subcommand: &[&str]) -> Option<String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_plumbline"));
    let out = command.args(subcommand).arg("--help").stdin(Stdio::null()).output().expect("the command runs");
    out.status.success().then(|| String::from_utf8_lossy(&out.stdout).into_owned())
}

#[test]
fn commands_in_the_readme_and_in_the_document_on_commands_exist() {
    // As many as users find at a glance, and as many as show each command's uses.
    for (document, least) in [("README.md", 4), ("docs/COMMANDS.md", 30)] {
        let lines = commands(&fs::read_to_string(root().join(document)).expect("a document"));
        assert!(lines.len() >= least, "{document} shows {} commands (expected {least} or more)", lines.len());
        for line in &lines {
            options_exist(line);
        }
    }
}

/// Fails unless the subcommand of a line exists and has the line's options.
fn options_exist(line: &str) {
    let words: Vec<_> = line.split('#').next().unwrap_or("").split_whitespace().collect();
    let help = help_of(&words[1..]).unwrap_or_else(|| panic!("`{line}`: no subcommand `{}`", words[1]));
    let known: BTreeSet<_> = help.split(|c: char| !(c.is_alphanumeric() || c == '-')).collect();
    for option in words.iter().filter(|w| w.starts_with("--")) {
        let name = option.split('=').next().unwrap_or(option);
        assert!(known.contains(name), "`{line}`: `{}` has no option `{name}`", words[1]);
    }
}

/// Largest picture of `docs/gallery/`, bytes: a page of ten of them still comes quickly over a slow line.
const MAX_PICTURE: u64 = 400_000;
/// Largest animation, and the largest sum of all, bytes.
const MAX_ANIMATION: u64 = 1_500_000;
const MAX_GALLERY: u64 = 4_000_000;

#[test]
fn pictures_of_the_readme_exist_are_small_and_are_made_by_the_script() {
    let read = |name: &str| fs::read_to_string(root().join(name)).expect("a document");
    let (readme, script) = (read("README.md"), read("docs/gallery.sh"));
    let shown: BTreeSet<_> = links(&readme).filter_map(|t| t.strip_prefix("docs/gallery/")).collect();
    assert!(shown.len() >= 9, "{shown:?}");
    let mut total = 0;
    for entry in fs::read_dir(root().join("docs/gallery")).expect("a folder") {
        let entry = entry.expect("an entry");
        let name = entry.file_name().into_string().expect("UTF-8");
        let bytes = entry.metadata().expect("a size").len();
        let allowed = if name == "stabilize.webp" { MAX_ANIMATION } else { MAX_PICTURE };
        assert!(bytes > 0 && bytes <= allowed, "docs/gallery/{name} has {bytes} bytes (allowed: {allowed})");
        assert!(script.contains(&format!("\"$gallery/{name}\"")), "docs/gallery.sh does not make {name}");
        assert!(shown.contains(name.as_str()), "the README does not show docs/gallery/{name}");
        total += bytes;
    }
    for name in &shown {
        assert!(root().join("docs/gallery").join(name).is_file(), "docs/gallery/{name} is missing: `make gallery`");
    }
    assert!(total <= MAX_GALLERY, "docs/gallery/ holds {total} bytes (allowed: {MAX_GALLERY})");
}

#[test]
fn the_readme_is_short_and_has_the_words_that_users_search_for() {
    let readme = fs::read_to_string(root().join("README.md")).expect("README.md");
    assert!(readme.lines().count() <= 160, "{} lines (allowed: 160)", readme.lines().count());
    let text = readme.to_lowercase().split_whitespace().collect::<Vec<_>>().join(" ");
    for word in [
        "deshake",
        "rolling shutter",
        "defish",
        "perspective correction",
        "keystone",
        "seam carving",
        "content-aware scale",
        "auto-rig",
        "skinning",
    ] {
        assert!(text.contains(word), "the README does not say `{word}`");
    }
}

/// The Rust blocks of a document: the lines that a reader sees.
fn rust_blocks(document: &str) -> Vec<String> {
    document.split("```rust\n").skip(1).filter_map(|rest| rest.split("```").next()).map(str::to_owned).collect()
}

/// The documentation of a crate's root as a document: doc comments, and the fences that depend on features.
fn crate_page(source: &str) -> String {
    let mut page = String::new();
    let mut inside = false;
    for line in source.lines() {
        let fence = line.contains("doc = \"```\"") || line == "//! ```" || line == "//! ```text";
        if fence {
            inside = !inside;
            page += if !inside || line.ends_with("text") { "```\n" } else { "```rust\n" };
        } else if let Some(text) = line.strip_prefix("//!").map(|t| t.strip_prefix(' ').unwrap_or(t))
            && !(inside && text.starts_with("# "))
        {
            page.extend([text, "\n"]);
        }
    }
    page
}

#[test]
fn the_rust_blocks_of_the_readme_are_the_examples_of_the_crate_page_which_run() {
    let read = |name: &str| fs::read_to_string(root().join(name)).expect("a file");
    let [readme, page] = [rust_blocks(&read("README.md")), rust_blocks(&crate_page(&read("src/lib.rs")))];
    assert_eq!(page.len(), 4, "clips, photos, meshes, skeletons");
    assert_eq!(readme, page, "README.md and src/lib.rs");
    for block in &page {
        assert!(block.lines().count() <= 10, "more than ten lines:\n{block}");
    }
}

#[test]
fn rust_blocks_are_taken_without_hidden_lines_and_without_other_blocks() {
    let source = "//! A\n//!\n//! ```text\n//! E\n//! ```\n#![cfg_attr(a, doc = \"```\")]\n#![cfg_attr(b, doc = \"```ignore\")]\n//! # x\n\
                  //! a(b);\n//! ```\n//! # T\n//! ```\n//! c\n//!\n//! ```\nuse d;\n";
    assert_eq!(rust_blocks(&crate_page(source)), ["a(b);\n", "c\n\n"]);
}

#[test]
fn commands_are_taken_from_shell_blocks_only() {
    let text = "plumbline no\n```sh\nplumbline run \\\n  --a\n# plumbline no\nmake\n```\n```toml\nplumbline no\n```\n";
    assert_eq!(commands(text), ["plumbline run    --a"]);
}
