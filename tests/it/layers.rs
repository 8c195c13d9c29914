//! The tables of `docs/ARCHITECTURE.md`, enforced on manifests and source text.
//!
//! Between crates Cargo enforces the first table; a test holds the manifests against it. Inside a crate every path that
//! starts at its root (`crate::a::b`, `use crate::{a, b::c}`, enough `super::`) is resolved to its first module and looked
//! up in the second table. Crates from outside that only one place may name are looked for by name.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Crates from outside that only one place may name, and the place.
const ROOMS: [(&str, &str); 9] = [
    ("faer", "num::sparse"),
    ("feral_metis", "num::sparse"),
    ("clarabel", "num::optim"),
    ("ffmpeg_next", "media"),
    ("ffmpeg_sys_next", "media"),
    ("exr", "image"),
    ("kornia_image", "image::feature"),
    ("kornia_imgproc", "image::feature"),
    ("rten", "image::feature"),
];

/// Module → modules that it may import, and the order of the rows. A row is called by its first module.
struct Table {
    order: Vec<String>,
    row: BTreeMap<String, String>,
    allowed: BTreeMap<String, BTreeSet<String>>,
}

impl Table {
    /// The table between the marks `name:begin` and `name:end`.
    fn parse(document: &str, name: &str) -> Self {
        let (_, rest) = document.split_once(&format!("<!-- {name}:begin -->")).expect("the table's first mark");
        let (table, _) = rest.split_once(&format!("<!-- {name}:end -->")).expect("the table's last mark");
        let (mut order, mut row_of, mut allowed) = (Vec::new(), BTreeMap::new(), BTreeMap::new());
        for row in table.lines().filter(|l| l.starts_with("| `")) {
            let cells: Vec<_> = row.trim_matches('|').split('|').map(str::trim).collect();
            assert_eq!(cells.len(), 3, "a row of the table has three cells: {row}");
            let modules: Vec<_> = cells[0].split_whitespace().map(|m| m.trim_matches('`').to_owned()).collect();
            let module = modules[0].clone();
            row_of.extend(modules.into_iter().map(|m| (m, module.clone())));
            let imports = cells[2].split_whitespace().filter(|w| *w != "–").map(str::to_owned).collect();
            assert!(allowed.insert(module.clone(), imports).is_none(), "two rows for `{module}`");
            order.push(module);
        }
        Self { order, row: row_of, allowed }
    }

    /// The row that a module of a crate belongs to: its own, or the crate's.
    fn row_of(&self, krate: &str, module: Option<&str>) -> String {
        let own = module.map(|m| format!("{krate}::{m}"));
        own.and_then(|module| self.row.get(&module).cloned()).unwrap_or_else(|| krate.to_owned())
    }

    /// Why `file`, which is `module` of `krate`, breaks the rule; empty where it does not.
    fn violations(&self, file: &str, krate: &str, module: &[&str], source: &str) -> Vec<String> {
        let row = self.row_of(krate, module.first().copied());
        let Some(allowed) = self.allowed.get(&row) else {
            return vec![format!("{file}: the table has no row for `{row}`")];
        };
        let tokens = tokens(source);
        let mut found = Vec::new();
        for (line, target) in root_paths(&tokens, module) {
            let target = self.row_of(krate, Some(&target));
            if target != row && !allowed.contains(&target) {
                found.push(format!("{file}:{line}: `{row}` may not import `{target}`"));
            }
        }
        for (i, token) in tokens.iter().enumerate() {
            for (name, room) in ROOMS {
                let named = token.text == name && is_path_start(&tokens, i);
                if named && room != row {
                    found.push(format!("{file}:{}: only `{room}` may name the crate `{name}`", token.line));
                }
            }
        }
        found
    }
}

#[derive(Debug)]
struct Token {
    text: String,
    line: usize,
}

/// Identifiers, `::` and single punctuation marks; comments, strings and character literals left out.
fn tokens(source: &str) -> Vec<Token> {
    let chars: Vec<char> = source.chars().collect();
    let (mut found, mut i, mut line) = (Vec::new(), 0, 1);
    while i < chars.len() {
        let end = match chars[i] {
            c if c.is_whitespace() => i + 1,
            '/' if matches!(chars.get(i + 1), Some('/' | '*')) => comment_end(&chars, i),
            '"' => string_end(&chars, i),
            '\'' => quote_end(&chars, i),
            c if c.is_alphanumeric() || c == '_' => {
                let end = i + chars[i..].iter().take_while(|c| c.is_alphanumeric() || **c == '_').count();
                raw_string_end(&chars, i, end).unwrap_or_else(|| {
                    found.push(Token { text: chars[i..end].iter().collect(), line });
                    end
                })
            }
            ':' if chars.get(i + 1) == Some(&':') => {
                found.push(Token { text: "::".into(), line });
                i + 2
            }
            c => {
                found.push(Token { text: c.into(), line });
                i + 1
            }
        };
        let end = end.min(chars.len());
        line += chars[i..end].iter().filter(|c| **c == '\n').count();
        i = end;
    }
    found
}

fn comment_end(chars: &[char], start: usize) -> usize {
    if chars[start + 1] == '/' {
        return start + chars[start..].iter().take_while(|c| **c != '\n').count();
    }
    let (mut depth, mut i) = (0, start);
    while i < chars.len() {
        match (chars[i], chars.get(i + 1)) {
            ('/', Some('*')) => (depth, i) = (depth + 1, i + 2),
            ('*', Some('/')) => (depth, i) = (depth - 1, i + 2),
            _ => i += 1,
        }
        if depth == 0 {
            break;
        }
    }
    i
}

fn string_end(chars: &[char], start: usize) -> usize {
    let mut i = start + 1;
    while i < chars.len() && chars[i] != '"' {
        i += if chars[i] == '\\' { 2 } else { 1 };
    }
    i + 1
}

/// End of `r"…"`, `br#"…"#` and the like, whose prefix is the word `start..end`; `None` for any other word.
fn raw_string_end(chars: &[char], start: usize, end: usize) -> Option<usize> {
    let word: String = chars[start..end].iter().collect();
    if !matches!(word.as_str(), "r" | "br" | "cr") {
        return None;
    }
    let hashes = chars[end..].iter().take_while(|c| **c == '#').count();
    if chars.get(end + hashes) != Some(&'"') {
        return None;
    }
    let mut i = end + hashes + 1;
    while i < chars.len() {
        if chars[i] == '"' && chars[i + 1..].iter().take(hashes).filter(|c| **c == '#').count() == hashes {
            return Some(i + 1 + hashes);
        }
        i += 1;
    }
    Some(i)
}

/// End of a character literal, or of the quote alone where it starts a lifetime.
fn quote_end(chars: &[char], start: usize) -> usize {
    match (chars.get(start + 1), chars.get(start + 2)) {
        (Some('\\'), _) => start + 3 + chars[start + 3..].iter().take_while(|c| **c != '\'').count() + 1,
        (Some(_), Some('\'')) => start + 3,
        _ => start + 1,
    }
}

fn text(tokens: &[Token], i: usize) -> &str {
    tokens.get(i).map_or("", |t| t.text.as_str())
}

/// The word begins a path (`x::…`, `use x`), and is not a later part of one.
fn is_path_start(tokens: &[Token], i: usize) -> bool {
    let before = if i == 0 { "" } else { text(tokens, i - 1) };
    // `::x` names a crate too, unless a word stands before the colons.
    let leading = before == "::" && (i < 2 || !text(tokens, i - 2).chars().all(|c| c.is_alphanumeric() || c == '_'));
    let starts = (before != "::" || leading) && before != ".";
    starts && (text(tokens, i + 1) == "::" || matches!(before, "use" | "crate"))
}

/// (line, module) of every path that reaches the crate's root from inside `module`.
fn root_paths(tokens: &[Token], module: &[&str]) -> Vec<(usize, String)> {
    let (mut found, mut i) = (Vec::new(), 0);
    // Inline modules deepen the path that `super` climbs: one entry per open brace, true where it opens a module.
    let mut braces = Vec::new();
    while i < tokens.len() {
        match text(tokens, i) {
            "{" => braces.push(i >= 2 && text(tokens, i - 2) == "mod"),
            "}" => {
                braces.pop();
            }
            "crate" if text(tokens, i + 1) == "::" => targets(tokens, i + 2, 0, &mut found),
            "crate" if text(tokens, i + 1) == "as" || ends_use(tokens, i) => {
                found.push((tokens[i].line, "crate".into()));
            }
            "super" => {
                let depth = module.len() + braces.iter().filter(|b| **b).count();
                let mut climbed = 1;
                while text(tokens, i + 1) == "::" && text(tokens, i + 2) == "super" {
                    (climbed, i) = (climbed + 1, i + 2);
                }
                if text(tokens, i + 1) == "::" && climbed <= depth {
                    targets(tokens, i + 2, depth - climbed, &mut found);
                }
            }
            _ => {}
        }
        i += 1;
    }
    found
}

fn ends_use(tokens: &[Token], i: usize) -> bool {
    i > 0 && matches!(text(tokens, i - 1), "use" | "{" | ",") && matches!(text(tokens, i + 1), ";" | "," | "}")
}

/// Modules named at `i`, which stands `above` levels below the root: a word, or the words of a (nested) group.
fn targets(tokens: &[Token], i: usize, above: usize, found: &mut Vec<(usize, String)>) {
    match text(tokens, i) {
        "{" => {
            let (mut depth, mut j, mut first) = (1, i + 1, true);
            while depth > 0 && j < tokens.len() {
                match text(tokens, j) {
                    "{" => depth += 1,
                    "}" => depth -= 1,
                    "," if depth == 1 => first = true,
                    _ if depth == 1 && first => {
                        targets(tokens, j, above, found);
                        first = false;
                    }
                    _ => {}
                }
                j += 1;
            }
        }
        "super" if above > 0 && text(tokens, i + 1) == "::" => targets(tokens, i + 2, above - 1, found),
        word if above == 0 => found.push((tokens[i].line, word.to_owned())),
        _ => {}
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn table(name: &str) -> Table {
    Table::parse(&fs::read_to_string(root().join("docs/ARCHITECTURE.md")).expect("docs/ARCHITECTURE.md"), name)
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// `a/b.rs` → `[a, b]`, `a/mod.rs` → `[a]`, `lib.rs` → `[]`, relative to the crate.
fn module_of(relative: &Path) -> Vec<String> {
    let stem = relative.with_extension("");
    let parts = stem.components().map(|c| c.as_os_str().to_string_lossy().into_owned());
    parts.filter(|p| p != "mod" && p != "lib").collect()
}

/// Folders of `src/` with a manifest.
fn members() -> Vec<String> {
    let entries = fs::read_dir(root().join("src")).expect("src/").map(|e| e.expect("an entry").path());
    let mut names: Vec<String> = entries
        .filter(|p| p.join("Cargo.toml").is_file())
        .map(|p| p.file_name().expect("a name").to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

fn manifest(member: &str) -> String {
    fs::read_to_string(root().join("src").join(member).join("Cargo.toml")).expect("a manifest")
}

#[test]
fn crates_use_only_what_the_table_allows() {
    let table = table("crates");
    let members = members();
    let listed: BTreeSet<_> = table.order.iter().cloned().collect();
    assert_eq!(listed, members.iter().cloned().collect(), "rows of the table and folders of src/");
    for member in &members {
        let manifest = manifest(member);
        let dependencies = manifest.split("[dev-dependencies]").next().expect("a first part");
        let ours = dependencies.lines().filter_map(|l| l.strip_prefix("plumbline-")?.split(['.', ' ']).next());
        for used in ours {
            assert!(table.allowed[member].contains(used), "`{member}` may not use `{used}`");
        }
    }
}

#[test]
fn members_inherit_the_lints_and_have_no_hidden_targets() {
    for member in members() {
        let manifest = manifest(&member);
        assert!(manifest.contains("\n[lints]\nworkspace = true\n"), "{member}: lints.workspace = true is missing");
        for line in ["build = false", "autotests = false", "autobenches = false", "autoexamples = false"] {
            assert!(manifest.lines().any(|l| l == line), "{member}: `{line}` is missing");
        }
    }
}

#[test]
fn cargo_lines_of_the_makefile_cover_the_workspace() {
    let makefile = fs::read_to_string(root().join("Makefile")).expect("Makefile");
    let checks = ["fmt", "clippy", "doc", "test", "bench"].map(|c| format!("cargo {c}"));
    let mut found = 0;
    for line in makefile.lines().filter(|l| checks.iter().any(|c| l.contains(c.as_str()))) {
        let all = if line.contains("cargo fmt") { "--all" } else { "--workspace" };
        assert!(line.contains(all), "`{}` lacks {all}", line.trim());
        found += 1;
    }
    assert!(found >= checks.len(), "{found} cargo lines in the Makefile");
}

/// Crates whose names mean FFmpeg, clang or the command line.
const FOREIGN: [&str; 5] = ["ffmpeg-next", "ffmpeg-sys-next", "bindgen", "clang-sys", "clap"];

/// Names of the packages that a member is built with, dev-dependencies included, given `--all-features` or nothing.
fn dependencies(package: &str, features: &[&str]) -> BTreeSet<String> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["tree", "--locked", "--offline", "--prefix", "none", "--format", "{p}", "--package", package]);
    let out = cargo.args(features).current_dir(root()).output().expect("cargo runs");
    let tree = String::from_utf8_lossy(&out.stdout);
    assert!(out.status.success() && tree.contains(package), "{}", String::from_utf8_lossy(&out.stderr));
    tree.lines().filter_map(|l| l.split(' ').next()).map(str::to_owned).collect()
}

#[test]
fn libraries_build_without_ffmpeg_clang_and_clap() {
    for member in ["num", "image", "camera", "photo", "video", "shape", "testkit"] {
        let package = format!("plumbline-{member}");
        let found = dependencies(&package, &["--all-features"]);
        for name in FOREIGN {
            assert!(!found.contains(name), "{package} depends on {name}");
        }
    }
}

#[test]
fn shapes_build_without_codecs_detectors_and_quadratic_programs() {
    let found = dependencies("plumbline-shape", &[]);
    for name in ["clarabel", "exr", "image", "kornia-imgproc", "rten"] {
        assert!(!found.contains(name), "plumbline-shape depends on {name}");
    }
}

#[test]
fn every_import_is_in_the_table() {
    let table = table("modules");
    let mut found = Vec::new();
    for member in members() {
        let folder = root().join("src").join(&member);
        let mut files = Vec::new();
        rust_files(&folder, &mut files);
        for path in files {
            let relative = path.strip_prefix(&folder).expect("below the crate");
            let module = module_of(relative);
            let names: Vec<_> = module.iter().map(String::as_str).collect();
            let source = fs::read_to_string(&path).expect("a source file");
            let file = format!("src/{member}/{}", relative.display());
            found.extend(table.violations(&file, &member, &names, &source));
        }
    }
    assert!(found.is_empty(), "imports against docs/ARCHITECTURE.md:\n{}", found.join("\n"));
}

#[test]
fn the_tables_are_in_layers() {
    for table in [table("crates"), table("modules")] {
        for (i, module) in table.order.iter().enumerate() {
            for import in &table.allowed[module] {
                assert!(table.order[..i].contains(import), "`{module}` imports `{import}`, which is not above it");
            }
        }
    }
}

/// What the scan says of `source` as a file of module `c::a::b`, where `c::a` may import `c::low` and `c::mate` only.
fn planted(source: &str) -> Vec<String> {
    let table = "<!-- modules:begin -->\n| `c::low` | x | – |\n| `c::a` `c::mate` | x | c::low |\n| `c::up` | x | c::low c::a |\n\
                 <!-- modules:end -->";
    Table::parse(table, "modules").violations("a/b.rs", "c", &["a", "b"], source)
}

#[test]
fn planted_upward_imports_are_found() {
    let cases = [
        "use crate::up;",
        "use crate::up::x;",
        "use crate::{low, up::x};",
        "use crate::{low::{self, up as v}, up};",
        "use {std::fmt, crate::{up}};",
        "fn f() { crate::up::g(); }",
        "fn f() -> crate  ::  up::T {}",
        "use super::super::up;",
        "use super::{x, super::up};",
        "mod tests { use super::super::super::up; }",
        "macro_rules! m { () => { $crate::up::f() } }",
        "use crate as everything;",
        "use crate::*;",
        "use crate::{self as everything};",
        "const A: char = '\"'; use crate::up; const B: char = '\"';",
        "fn f<'a>(x: &'a str) { crate::up::g(x) }",
        "const A: &str = r#\"\"\"#; use crate::up;",
        "/* /* */ */ use crate::up;",
        "use faer::Mat;",
        "fn f() { ::clarabel::solver::f() }",
        "extern crate ffmpeg_next;",
        "use kornia_imgproc as k;",
        "use exr::prelude::Image;",
    ];
    for source in cases {
        assert_eq!(planted(source).len(), 1, "in: {source}: {:?}", planted(source));
    }
}

#[test]
fn allowed_imports_comments_and_strings_are_left_alone() {
    let cases = [
        "use crate::low::{self, up};",
        "use crate::a::c;",
        "use crate::mate;",
        "use super::up;",
        "use super::{up, c};",
        "mod tests { use super::super::up; }",
        "// use crate::up;",
        "//! `faer::Mat` and [`crate::up`]",
        "const A: &str = \"crate::up \\\" crate::up\";",
        "const A: &str = r#\"use crate::up \" crate::up\"#;",
        "pub(crate) fn f(faer: u8) -> u8 { faer }",
        "mod faer_like {}",
        "use crate::low::exr::write;",
        "fn f() { self::faer::g() }",
    ];
    for source in cases {
        assert_eq!(planted(source), Vec::<String>::new(), "in: {source}");
    }
}

#[test]
fn a_module_without_a_row_is_found_and_a_finding_names_its_line() {
    let table = Table::parse("<!-- modules:begin -->\n| `c::a` | x | – |\n<!-- modules:end -->", "modules");
    assert_eq!(table.violations("z.rs", "c", &["z"], ""), ["z.rs: the table has no row for `c`"]);
    assert_eq!(table.violations("a.rs", "c", &["a"], "\n/*\n*/\nuse crate::z;"), ["a.rs:4: `c::a` may not import `c`"]);
}
