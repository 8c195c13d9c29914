//! Finds the files that `foreach` means.
//!
//! A pattern that names an existing file is that file, whatever characters it contains; one that names a folder is every clip in
//! it, or every photo or mesh for graphs of those, recognized by the extension; anything else is a glob (`*`, `?`, `[…]`, `{a,b}`, `**` for folders at any depth).

use std::path::{Component, Path, PathBuf};

use globset::{GlobBuilder, GlobMatcher};

/// Extensions of clips: what a folder given as input is searched for.
pub const CLIP_EXTENSIONS: [&str; 19] = [
    "3gp", "avi", "flv", "insv", "m2ts", "m4v", "mkv", "mov", "mp4", "mpeg", "mpg", "mts", "mxf", "ogv", "ts", "vob",
    "webm", "wmv", "y4m",
];

/// Extensions of photos: what a folder given as input is searched for by graphs of still pictures.
pub const PHOTO_EXTENSIONS: [&str; 11] =
    ["avif", "heic", "heif", "jfif", "jpe", "jpeg", "jpg", "png", "tif", "tiff", "webp"];

/// Extensions of meshes: what a folder given as input is searched for by graphs of meshes.
pub const MESH_EXTENSIONS: [&str; 7] = ["glb", "gltf", "mesh", "obj", "off", "ply", "stl"];

/// The files of all patterns in order, each pattern's sorted, none twice. Relative patterns start from `base`; of a folder, the
/// files with one of `extensions` are meant.
///
/// # Errors
/// A malformed glob.
pub fn expand(patterns: &[String], base: Option<&Path>, extensions: &[&str]) -> Result<Vec<PathBuf>, String> {
    let mut out: Vec<PathBuf> = Vec::new();
    for pattern in patterns {
        let full = base.map_or_else(|| PathBuf::from(pattern), |base| base.join(pattern));
        for path in expand_one(&full, extensions)? {
            if !out.contains(&path) {
                out.push(path);
            }
        }
    }
    Ok(out)
}

/// Extensions of pictures: what an image sequence is made of.
pub const PICTURE_EXTENSIONS: [&str; 12] =
    ["bmp", "dpx", "exr", "jp2", "jpeg", "jpg", "pgm", "png", "ppm", "tif", "tiff", "webp"];

/// True for a name that ends like a picture's.
pub fn is_picture(path: &Path) -> bool {
    has_extension(path, &PICTURE_EXTENSIONS)
}

/// The pictures of an image sequence named by its folder or by a glob, in the order of their names, numbers in them by value.
/// `None` where the text is neither, or names anything but pictures.
pub fn pictures(text: &str) -> Option<Vec<PathBuf>> {
    let path = Path::new(text);
    let mut found = if path.is_dir() {
        files_in(path, &PICTURE_EXTENSIONS)
    } else if is_glob(text) && !path.exists() {
        expand_one(path, &PICTURE_EXTENSIONS).ok()?
    } else {
        return None;
    };
    if found.is_empty() || !found.iter().all(|p| is_picture(p)) {
        return None;
    }
    found.sort_by_cached_key(|p| natural(&p.to_string_lossy()));
    Some(found)
}

/// Text cut into runs of other characters and numbers, which compare by value: `f9` before `f10`.
fn natural(text: &str) -> Vec<(String, u128)> {
    let mut out = vec![(String::new(), 0_u128)];
    let mut digits = false;
    for c in text.chars() {
        if digits && !c.is_ascii_digit() {
            out.push((String::new(), 0));
        }
        digits = c.is_ascii_digit();
        if let Some((run, number)) = out.last_mut() {
            match c.to_digit(10).filter(|_| digits) {
                Some(d) => *number = number.saturating_mul(10).saturating_add(u128::from(d)),
                None => run.push(c),
            }
        }
    }
    out
}

/// True where the text may mean more than one name.
pub fn is_glob(pattern: &str) -> bool {
    let choice = pattern
        .split_once('{')
        .and_then(|(_, rest)| rest.split_once('}'))
        .is_some_and(|(inner, _)| inner.contains(','));
    choice || pattern.contains(['*', '?', '['])
}

fn expand_one(pattern: &Path, extensions: &[&str]) -> Result<Vec<PathBuf>, String> {
    let text = pattern.to_string_lossy();
    if pattern.is_dir() {
        return Ok(files_in(pattern, extensions));
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

/// True where the name ends in one of these extensions, in letters of either case.
pub fn has_extension(path: &Path, known: &[&str]) -> bool {
    path.extension().is_some_and(|e| known.contains(&e.to_string_lossy().to_ascii_lowercase().as_str()))
}

fn files_in(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let wanted = |path: &PathBuf| path.is_file() && has_extension(path, extensions);
    let mut found: Vec<PathBuf> = entries.map(|e| e.path()).filter(wanted).collect();
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
    // A brace may contain a separator, and `**` means any depth.
    let endless = rest.iter().any(|c| {
        let text = c.as_os_str().to_string_lossy();
        text.contains("**") || text.matches('{').count() != text.matches('}').count()
    });
    (components[..first].iter().collect(), (!endless).then_some(rest.len()))
}

/// Links to folders are not followed: they may form a cycle.
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
    fn pictures_are_ordered_by_the_numbers_in_their_names() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let all = ["f10.png", "f9.png", "f9a.png", "g1.png", "f009.png"];
        for name in all.iter().chain(&["notes.txt"]) {
            std::fs::write(folder.path().join(name), "").expect("a small file");
        }
        let text = folder.path().to_string_lossy().into_owned();
        let found = |text: &str| pictures(text).map(|found| names(&found, folder.path()));
        let expected: Vec<String> = ["f009.png", "f9.png", "f9a.png", "f10.png", "g1.png"].map(str::to_owned).into();
        let mut listed = found(&text).expect("a folder of pictures");
        listed[..2].sort();
        assert_eq!(listed, expected);
        assert_eq!(found(&format!("{text}/g*.png")), Some(vec!["g1.png".to_owned()]));
        assert_eq!(found(&format!("{text}/*")), None, "not all are pictures");
        assert_eq!(found(&format!("{text}/h*.png")), None, "nothing");
        assert_eq!(found(&format!("{text}/f9.png")), None, "one picture is no sequence");
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
            expand(&patterns, Some(&folder), &CLIP_EXTENSIONS).map(|found| names(&found, &folder))
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
