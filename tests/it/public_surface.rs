//! The public surface of the library crates: committed, so that a review sees its changes, and without two types of one name.
//!
//! Items are read from the source text as `rustfmt` leaves it. The lint `unreachable_pub` sees to it that what is `pub` in the text
//! can be reached from outside.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Crates that the façade re-exports as libraries, and the façade.
pub(crate) const LIBRARIES: [&str; 8] = ["num", "image", "camera", "media", "photo", "video", "shape", FACADE];
const FACADE: &str = "plumbline";

/// Type names that more than one crate has. Each is a word of two fields and always used with its module; a new one needs a reason
/// of its own here, or better another name.
const SHARED_NAMES: [(&str, &str); 13] = [
    ("Clip", "a movement of a character; the motion that a path is planned from"),
    ("Component", "connected, of the graph of a matrix; of a surface"),
    ("Correspondence", "of points of two pictures; of two surfaces"),
    ("Interpolation", "between pixels; between keys of an animation"),
    ("Method", "of factorization; of deformation"),
    ("Model", "a mesh file's; COLMAP's"),
    ("Plane", "of a frame; a mirror in space"),
    ("Segment", "a straight edge in a picture; frames treated alike"),
    ("Stop", "when an iterative solve is good enough; why a deformation ended"),
    ("Target", "of rectifying; of inverse kinematics"),
    ("TrajectoryOptions", "of points over time; of shapes between two"),
    ("View", "where the viewer looks; one more view of a point"),
    ("WriteOptions", "of clips; of meshes"),
];

/// How a module of tests begins.
const TESTS: &str = "\n#[cfg(test)]\nmod ";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The source files of a crate in order of their names, those of tests left out.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") && !name.contains("test") {
            found.push(path);
        }
    }
}

/// Declarations that begin with `pub` in a file, each on one line, up to the module of its tests.
fn public_items(source: &str) -> Vec<String> {
    let inline = |at: &usize| source[at + TESTS.len()..].lines().next().is_some_and(|rest| rest.ends_with('{'));
    let tests = source.match_indices(TESTS).map(|(at, _)| at).find(inline);
    let own = &source[..tests.unwrap_or(source.len())];
    let (mut items, mut open): (Vec<String>, Option<String>) = (Vec::new(), None);
    for line in own.lines().map(str::trim) {
        let item = match open.take() {
            Some(begun) => format!("{begun} {line}"),
            None if line.starts_with("pub ") => line.to_owned(),
            None => continue,
        };
        let code = item.split(" // ").next().unwrap_or(&item).trim_end();
        let depth = |open, close| code.matches(open).count() as i64 - code.matches(close).count() as i64;
        let closed = depth('(', ')') == 0 && depth('[', ']') == 0;
        let import = code.starts_with("pub use ") || code.starts_with("pub const ") || code.starts_with("pub static");
        let ends = if import { code.ends_with(';') } else { code.ends_with(['{', '}', ';', ',']) };
        if closed && ends {
            let declared = if import { code } else { code.split(" {").next().unwrap_or(code) };
            items.push(declared.trim_end_matches([',', ';']).to_owned());
        } else {
            open = Some(item);
        }
    }
    items
}

/// Public items of a crate: `module` lines followed by their items.
pub(crate) fn surface(krate: &str) -> Vec<(String, Vec<String>)> {
    let folder = root().join("src").join(if krate == FACADE { "" } else { krate });
    let mut files = Vec::new();
    if krate == FACADE {
        files.extend(["clip.rs", "lib.rs", "prelude.rs"].map(|name| folder.join(name)));
    } else {
        sources(&folder, &mut files);
    }
    let of_file = |path: &PathBuf| {
        let name = path.strip_prefix(&folder).expect("below the crate").to_string_lossy().replace('\\', "/");
        (name, public_items(&fs::read_to_string(path).expect("a source file")))
    };
    files.iter().map(of_file).filter(|(_, items)| !items.is_empty()).collect()
}

/// The name of a type that an item declares.
fn type_name(item: &str) -> Option<&str> {
    let mut words = item.strip_prefix("pub ")?.split(|c: char| !(c.is_alphanumeric() || c == '_'));
    let kind = words.next()?;
    if matches!(kind, "struct" | "enum" | "trait" | "union" | "type") { words.next() } else { None }
}

#[test]
fn the_public_surface_is_as_committed() {
    for krate in LIBRARIES {
        let mut text = String::new();
        for (file, items) in surface(krate) {
            text.extend([file.as_str(), "\n"]);
            for item in &items {
                text.extend(["    ", item, "\n"]);
            }
        }
        insta::assert_snapshot!(format!("public_surface_{krate}"), text);
    }
}

#[test]
fn type_names_are_unique_across_the_crates() {
    let mut crates: BTreeMap<String, BTreeSet<&str>> = BTreeMap::new();
    for krate in LIBRARIES {
        for (_, items) in surface(krate) {
            for name in items.iter().filter_map(|item| type_name(item)) {
                crates.entry(name.to_owned()).or_default().insert(krate);
            }
        }
    }
    assert!(crates.len() > 400, "{} types: the scan lost some", crates.len());
    let shared: BTreeMap<_, _> = crates.into_iter().filter(|(_, crates)| crates.len() > 1).collect();
    for (name, crates) in &shared {
        let known = SHARED_NAMES.iter().any(|(shared, _)| shared == name);
        assert!(known, "`{name}` is a type of {crates:?}: give one of them another name");
    }
    for (name, _) in SHARED_NAMES {
        assert!(shared.contains_key(name), "`{name}` is unique now: take it from the list");
    }
}

#[test]
fn declarations_are_found_whole_and_bodies_are_not() {
    let source = "\n#[cfg(test)]\nmod tests;\npub fn f(\n    a: u8,\n    b: u8,\n) -> u8 {\n    a\n}\npub struct S {\n    pub x: f64,\n    y: f64,\n}\npub(crate) fn g() {}\n\
                  pub use a::{\n    B,\n    C,\n};\npub enum E {\n    A,\n}\nimpl S {\n    pub const N: usize = 3;\n}\n\n#[cfg(test)]\nmod tests {\n    pub fn t() {}\n}\n";
    let expected = [
        "pub fn f( a: u8, b: u8, ) -> u8",
        "pub struct S",
        "pub x: f64",
        "pub use a::{ B, C, }",
        "pub enum E",
        "pub const N: usize = 3",
    ];
    assert_eq!(public_items(source), expected);
    assert_eq!(type_name("pub struct S<T>(pub T)"), Some("S"));
    assert_eq!(type_name("pub fn f()"), None);
}
