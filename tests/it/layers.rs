//! The import table of `docs/ARCHITECTURE.md`, enforced on the source text.
//!
//! Every path that starts at the crate's root (`crate::a::b`, `use crate::{a, b::c}`, enough `super::`) is resolved to
//! its first module and looked up in the table. Crates that the table gives a single room are looked for by name.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Crates that only one place may name, and the place.
const ROOMS: [(&str, &str); 9] = [
    ("faer", "sparse"),
    ("feral_metis", "sparse"),
    ("clarabel", "optim"),
    ("ffmpeg_next", "media"),
    ("ffmpeg_sys_next", "media"),
    ("exr", "image"),
    ("kornia_image", "feature image"),
    ("kornia_imgproc", "feature image"),
    ("rustface", "feature"),
];

/// Module → modules that it may import, and the order of the rows.
struct Table {
    order: Vec<String>,
    allowed: BTreeMap<String, BTreeSet<String>>,
}

impl Table {
    fn parse(document: &str) -> Self {
        let (_, rest) = document.split_once("<!-- layers:begin -->").expect("the table's first mark");
        let (table, _) = rest.split_once("<!-- layers:end -->").expect("the table's last mark");
        let (mut order, mut allowed) = (Vec::new(), BTreeMap::new());
        for row in table.lines().filter(|l| l.starts_with("| `")) {
            let cells: Vec<_> = row.trim_matches('|').split('|').map(str::trim).collect();
            assert_eq!(cells.len(), 3, "a row of the table has three cells: {row}");
            let module = cells[0].trim_matches('`').to_owned();
            let imports = cells[2].split_whitespace().filter(|w| *w != "–").map(str::to_owned).collect();
            assert!(allowed.insert(module.clone(), imports).is_none(), "two rows for `{module}`");
            order.push(module);
        }
        Self { order, allowed }
    }

    /// Why `file`, which belongs to `module`, breaks the rule; empty where it does not.
    fn violations(&self, file: &str, module: &[&str], source: &str) -> Vec<String> {
        let top = module[0];
        let Some(allowed) = self.allowed.get(top) else {
            return vec![format!("{file}: the table has no row for module `{top}`")];
        };
        let tokens = tokens(source);
        let mut found = Vec::new();
        for (line, target) in root_paths(&tokens, module) {
            if target != top && !allowed.contains(&target) {
                found.push(format!("{file}:{line}: `{top}` may not import `{target}`"));
            }
        }
        for (i, token) in tokens.iter().enumerate() {
            for (name, room) in ROOMS {
                let named = token.text == name && is_path_start(&tokens, i);
                if named && !room.split(' ').any(|r| r == top) {
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

fn table() -> Table {
    Table::parse(&fs::read_to_string(root().join("docs/ARCHITECTURE.md")).expect("docs/ARCHITECTURE.md"))
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

/// `src/a/b.rs` → `[a, b]`, `src/a/mod.rs` → `[a]`.
fn module_of(relative: &Path) -> Vec<String> {
    let stem = relative.with_extension("");
    let parts = stem.components().map(|c| c.as_os_str().to_string_lossy().into_owned());
    parts.filter(|p| p != "mod").collect()
}

#[test]
fn every_import_is_in_the_table() {
    let (table, src) = (table(), root().join("src"));
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    let mut found = Vec::new();
    for path in files {
        let relative = path.strip_prefix(&src).expect("below src");
        let module = module_of(relative);
        if module == ["lib"] || module == ["main"] {
            continue;
        }
        let names: Vec<_> = module.iter().map(String::as_str).collect();
        let source = fs::read_to_string(&path).expect("a source file");
        found.extend(table.violations(&format!("src/{}", relative.display()), &names, &source));
    }
    assert!(found.is_empty(), "imports against docs/ARCHITECTURE.md:\n{}", found.join("\n"));
}

#[test]
fn the_table_is_in_layers() {
    let table = table();
    for (i, module) in table.order.iter().enumerate() {
        for import in &table.allowed[module] {
            assert!(table.order[..i].contains(import), "`{module}` imports `{import}`, which is not above it");
        }
    }
}

/// What the scan says of `source` as a file of module `a::b`, where `a` may import `low` only.
fn planted(source: &str) -> Vec<String> {
    let table =
        "<!-- layers:begin -->\n| `low` | x | – |\n| `a` | x | low |\n| `up` | x | low a |\n<!-- layers:end -->";
    Table::parse(table).violations("a/b.rs", &["a", "b"], source)
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
    let table = Table::parse("<!-- layers:begin -->\n| `a` | x | – |\n<!-- layers:end -->");
    assert_eq!(table.violations("z.rs", &["z"], ""), ["z.rs: the table has no row for module `z`"]);
    assert_eq!(table.violations("a.rs", &["a"], "\n/*\n*/\nuse crate::z;"), ["a.rs:4: `a` may not import `z`"]);
}
