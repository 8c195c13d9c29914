//! Finds the files that `foreach` means.
//!
//! A pattern that names an existing file is that file, whatever characters it holds; one that names a folder is every clip in
//! it, told by the extension; anything else is a glob (`*`, `?`, `[…]`, `{a,b}`, `**` for folders at any depth).

use std::path::{Component, Path, PathBuf};

use globset::{GlobBuilder, GlobMatcher};

/// Extensions of clips: what a folder given as input is searched for.
pub const CLIP_EXTENSIONS: [&str; 19] = [
    "3gp", "avi", "flv", "insv", "m2ts", "m4v", "mkv", "mov", "mp4", "mpeg", "mpg", "mts", "mxf", "ogv", "ts", "vob",
    "webm", "wmv", "y4m",
];

/// The files of all patterns in order, each pattern's sorted, none twice. Relative patterns start from `base`.
///
/// # Errors
/// A malformed glob.
pub fn expand(patterns: &[String], base: Option<&Path>) -> Result<Vec<PathBuf>, String> {
    let mut out: Vec<PathBuf> = Vec::new();
    for pattern in patterns {
        let full = base.map_or_else(|| PathBuf::from(pattern), |base| base.join(pattern));
        for path in expand_one(&full)? {
            if !out.contains(&path) {
                out.push(path);
            }
        }
    }
    Ok(out)
}

/// True where the text may mean more than one name.
pub fn is_glob(pattern: &str) -> bool {
    let choice = pattern
        .split_once('{')
        .and_then(|(_, rest)| rest.split_once('}'))
        .is_some_and(|(inner, _)| inner.contains(','));
    choice || pattern.contains(['*', '?', '['])
}

fn expand_one(pattern: &Path) -> Result<Vec<PathBuf>, String> {
    let text = pattern.to_string_lossy();
    if pattern.is_dir() {
        return Ok(clips_in(pattern));
    }
    if pattern.exists() || !is_glob(&text) {
        return Ok(vec![pattern.to_owned()]);
    }
    let glob = GlobBuilder::new(&text)
        .literal_separator(true)
        .build()
        .map_err(|e| format!("`{text}` is no glob: {}", e.kind()))?;
    let (root, depth) = literal_root(pattern);
    let mut found = Vec::new();
    walk(&root, depth, &glob.compile_matcher(), &mut found);
    found.sort();
    Ok(found)
}

fn clips_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let is_clip = |path: &PathBuf| {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        path.is_file() && CLIP_EXTENSIONS.contains(&extension.as_str())
    };
    let mut found: Vec<PathBuf> = entries.map(|e| e.path()).filter(is_clip).collect();
    found.sort();
    found
}

/// The folder before the first component with a wildcard, and how many folders deep the rest can reach (`None`: any).
fn literal_root(pattern: &Path) -> (PathBuf, Option<usize>) {
    let components: Vec<Component<'_>> = pattern.components().collect();
    let first = components
        .iter()
        .position(|c| c.as_os_str().to_string_lossy().contains(['*', '?', '[', '{']))
        .unwrap_or(components.len());
    let rest = &components[first..];
    // A brace may hold a separator, and `**` stands for any depth.
    let endless = rest.iter().any(|c| {
        let text = c.as_os_str().to_string_lossy();
        text.contains("**") || text.matches('{').count() != text.matches('}').count()
    });
    (components[..first].iter().collect(), (!endless).then_some(rest.len()))
}

/// Links to folders are not followed: they may lead round in a circle.
fn walk(folder: &Path, depth: Option<usize>, glob: &GlobMatcher, found: &mut Vec<PathBuf>) {
    if depth == Some(0) {
        return;
    }
    let listed = if folder == Path::new("") { Path::new(".") } else { folder };
    for entry in std::fs::read_dir(listed).into_iter().flatten().filter_map(Result::ok) {
        let path = folder.join(entry.file_name());
        match entry.file_type() {
            Ok(kind) if kind.is_dir() => walk(&path, depth.map(|d| d - 1), glob, found),
            Ok(_) if glob.is_match(&path) && path.is_file() => found.push(path),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(found: &[PathBuf], root: &Path) -> Vec<String> {
        found.iter().map(|p| p.strip_prefix(root).unwrap_or(p).display().to_string()).collect()
    }

    #[test]
    fn globs_folders_and_files_find_what_they_say() {
        let folder = tempfile::tempdir().map(tempfile::TempDir::keep).unwrap_or_default();
        for name in ["b.mp4", "a.MOV", "notes.txt", "odd[1].mp4", "sub/c.mp4", "sub/deep/d.mkv"] {
            let path = folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap_or(&folder)).unwrap_or_default();
            std::fs::write(path, "").unwrap_or_default();
        }
        let find = |patterns: &[&str]| {
            let patterns: Vec<String> = patterns.iter().map(|p| (*p).to_owned()).collect();
            expand(&patterns, Some(&folder)).map(|found| names(&found, &folder))
        };
        let list = |names: &[&str]| Ok(names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>());
        assert_eq!(find(&["*.mp4"]), list(&["b.mp4", "odd[1].mp4"]));
        assert_eq!(find(&["**/*.{mp4,mkv}"]), list(&["b.mp4", "odd[1].mp4", "sub/c.mp4", "sub/deep/d.mkv"]));
        assert_eq!(find(&["*/*.mp4"]), list(&["sub/c.mp4"]));
        assert_eq!(find(&["{sub/c,b}.mp4"]), list(&["b.mp4", "sub/c.mp4"]));
        assert_eq!(find(&["."]).map(|n| n.len()), Ok(3), "a folder is its clips, whatever the case of the extension");
        assert_eq!(find(&["odd[1].mp4"]), list(&["odd[1].mp4"]), "an existing file is itself, not a glob");
        assert_eq!(find(&["b.mp4", "*.mp4"]), list(&["b.mp4", "odd[1].mp4"]), "none twice");
        assert_eq!(find(&["none-*.mp4"]), list(&[]));
        assert_eq!(find(&["missing.mp4"]), list(&["missing.mp4"]), "a missing file fails later, by its name");
        assert!(find(&["[.mp4"]).is_err());
        std::fs::remove_dir_all(&folder).unwrap_or_default();
    }
}
