//! Finds the files that `foreach` means.
//!
//! A pattern that names an existing file is that file, whatever characters it contains; one that names a folder is every clip
//! below it, or every photo or mesh for graphs of those, recognized by the extension; anything else is a glob (`*`, `?`, `[…]`,
//! `{a,b}`, `**` for folders at any depth). Links to folders are not followed: they may form a cycle. Hidden folders below a
//! folder are passed over, and so are files that a run has not finished. A folder that cannot be read is found itself: it fails
//! as an item, by its name, instead of being left out without a word.

use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};

use globset::{GlobBuilder, GlobMatcher};

use super::paths::{to_path, to_text};
use plumbline_num::files::AtomicFile;

/// Extensions of clips: what a folder given as input is searched for.
pub const CLIP_EXTENSIONS: [&str; 19] = [
    "3gp", "avi", "flv", "insv", "m2ts", "m4v", "mkv", "mov", "mp4", "mpeg", "mpg", "mts", "mxf", "ogv", "ts", "vob",
    "webm", "wmv", "y4m",
];

/// Extensions of photos: what a folder given as input is searched for by graphs of still pictures.
pub const PHOTO_EXTENSIONS: [&str; 11] =
    ["avif", "heic", "heif", "jfif", "jpe", "jpeg", "jpg", "png", "tif", "tiff", "webp"];

/// Extensions of meshes: what a folder given as input is searched for by graphs of meshes.
pub const MESH_EXTENSIONS: [&str; 9] = ["fbx", "glb", "gltf", "mesh", "obj", "off", "ply", "stl", "vrm"];

/// A file that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The file.
    pub path: PathBuf,
    /// Its folder, relative to the folder or the root of the glob that it was found under; `.` for a file that was named itself.
    pub rel: PathBuf,
}

/// How files are looked for.
#[derive(Clone, Copy, Debug, Default)]
pub struct Search<'a> {
    /// Where relative patterns start from; `None`: the working directory.
    pub base: Option<&'a Path>,
    /// Extensions of the files that a folder means, in lower case.
    pub extensions: &'a [&'a str],
    /// Folders are searched at any depth.
    pub recurse: bool,
}

/// A pattern that is no glob.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct BadGlob {
    /// Which of the patterns.
    pub index: usize,
    /// What is wrong with it.
    pub message: String,
}

impl Search<'_> {
    /// The files of all patterns in order, each pattern's sorted, none twice.
    ///
    /// # Errors
    /// Every malformed glob.
    pub fn expand(&self, patterns: &[String]) -> Result<Vec<Found>, Vec<BadGlob>> {
        let (mut out, mut seen, mut bad) = (Vec::new(), HashSet::new(), Vec::new());
        for (index, pattern) in patterns.iter().enumerate() {
            let pattern = to_path(pattern);
            match self.expand_one(&self.base.map_or(pattern.clone(), |base| base.join(&pattern))) {
                Ok(found) => out.extend(found.into_iter().filter(|found| seen.insert(found.path.clone()))),
                Err(message) => bad.push(BadGlob { index, message }),
            }
        }
        if bad.is_empty() { Ok(out) } else { Err(bad) }
    }

    /// The paths of [`Self::expand`] alone.
    ///
    /// # Errors
    /// The first malformed glob.
    pub fn paths(&self, patterns: &[String]) -> Result<Vec<PathBuf>, BadGlob> {
        let found = self.expand(patterns).map_err(|mut bad| bad.swap_remove(0))?;
        Ok(found.into_iter().map(|found| found.path).collect())
    }

    fn expand_one(&self, pattern: &Path) -> Result<Vec<Found>, String> {
        let known = pattern.metadata();
        let walk =
            |root: &Path, depth, wanted: &dyn Fn(&Path) -> bool, hidden| Walk { root, depth, hidden, wanted }.files();
        if known.as_ref().is_ok_and(std::fs::Metadata::is_dir) {
            let depth = (!self.recurse).then_some(1);
            return Ok(walk(pattern, depth, &|path| has_extension(path, self.extensions), false));
        }
        let text = to_text(pattern);
        if known.is_ok() || !is_glob(&text) {
            return Ok(vec![Found { path: pattern.to_owned(), rel: PathBuf::from(".") }]);
        }
        let glob = glob_of(&text)?;
        let (root, depth) = literal_root(pattern);
        Ok(walk(&root, depth, &|path| glob.is_match(to_text(path)), true))
    }
}

fn glob_of(text: &str) -> Result<GlobMatcher, String> {
    let glob = GlobBuilder::new(text).literal_separator(true).build();
    glob.map(|glob| glob.compile_matcher()).map_err(|e| format!("`{text}` is no glob: {}", e.kind()))
}

/// A folder that is listed; the empty path is the working directory.
fn root_of(folder: &Path) -> &Path {
    if folder == Path::new("") { Path::new(".") } else { folder }
}

/// Files below a folder.
struct Walk<'a> {
    root: &'a Path,
    /// How many folders deep; `None`: any.
    depth: Option<usize>,
    /// Hidden folders too.
    hidden: bool,
    wanted: &'a dyn Fn(&Path) -> bool,
}

impl Walk<'_> {
    /// The files in the order of their paths, and the folders that cannot be read.
    fn files(&self) -> Vec<Found> {
        let mut found = Vec::new();
        // Folders to list: relative to the root, with how much deeper to go. A stack of its own: names nest deeper than calls may.
        let mut left = vec![(PathBuf::new(), self.depth)];
        while let Some((rel, depth)) = left.pop() {
            if depth == Some(0) {
                continue;
            }
            let folder = if rel == Path::new("") { self.root.to_owned() } else { self.root.join(&rel) };
            let shown = if rel == Path::new("") { PathBuf::from(".") } else { rel.clone() };
            let Ok(entries) = std::fs::read_dir(root_of(&folder)) else {
                // The root of a glob need not exist.
                if folder.exists() {
                    found.push(Found { path: folder, rel: shown });
                }
                continue;
            };
            for entry in entries.filter_map(Result::ok) {
                let path = folder.join(entry.file_name());
                match entry.file_type() {
                    Ok(kind) if kind.is_dir() => {
                        let rel = rel.join(entry.file_name());
                        if self.enters(&rel) {
                            left.push((rel, depth.map(|d| d - 1)));
                        }
                    }
                    Ok(_) if (self.wanted)(&path) && path.is_file() && !is_partial(&path) => {
                        found.push(Found { path, rel: shown.clone() });
                    }
                    _ => {}
                }
            }
        }
        found.sort_by(|a, b| a.path.cmp(&b.path));
        found
    }

    fn enters(&self, rel: &Path) -> bool {
        let name = rel.file_name().unwrap_or_default();
        name != RECORDS_FOLDER && (self.hidden || !name.as_encoded_bytes().starts_with(b"."))
    }
}

/// A run that was killed left it.
fn is_partial(path: &Path) -> bool {
    path.file_name().and_then(|name| name.to_str()).is_some_and(AtomicFile::is_partial_name)
}

/// Folder in which a run notes what it made; never searched.
pub(crate) const RECORDS_FOLDER: &str = ".plumbline";

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
    let path = to_path(text);
    if !path.is_dir() && (!is_glob(text) || path.exists()) {
        return None;
    }
    let search = Search { extensions: &PICTURE_EXTENSIONS, ..Search::default() };
    let mut found = search.paths(&[text.to_owned()]).ok()?;
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

/// True where the name ends in one of these extensions, in letters of either case.
pub fn has_extension(path: &Path, known: &[&str]) -> bool {
    path.extension().is_some_and(|e| known.contains(&e.to_string_lossy().to_ascii_lowercase().as_str()))
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
            let search = Search { base: Some(&folder), extensions: &CLIP_EXTENSIONS, ..Search::default() };
            search.paths(&patterns).map(|found| names(&found, &folder))
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
    #[test]
    fn folders_are_searched_at_any_depth_but_not_where_they_are_hidden_or_linked() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let root = folder.path();
        for name in ["b.mp4", "a/c.mp4", "a/d/e.MOV", ".git/f.mp4", ".plumbline/g.mp4", "h.partial-7-abcd1234.mp4"] {
            let path = root.join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            std::fs::write(path, "").expect("a small file");
        }
        std::os::unix::fs::symlink(root, root.join("a/round")).expect("a link");
        let find = |pattern: &str, recurse| {
            let search = Search { base: Some(root), extensions: &CLIP_EXTENSIONS, recurse };
            let found = search.expand(&[pattern.to_owned()]).expect("no glob, or a good one");
            let shown = |f: Found| (names(std::slice::from_ref(&f.path), root).remove(0), f.rel.display().to_string());
            found.into_iter().map(shown).collect::<Vec<_>>()
        };
        let pairs = |list: &[(&str, &str)]| -> Vec<(String, String)> {
            list.iter().map(|(path, rel)| ((*path).to_owned(), (*rel).to_owned())).collect()
        };
        let all = [("a/c.mp4", "a"), ("a/d/e.MOV", "a/d"), ("b.mp4", ".")];
        assert_eq!(find("", true), pairs(&all), "from the folder");
        assert_eq!(find("a", true), pairs(&[("a/c.mp4", "."), ("a/d/e.MOV", "d")]));
        assert_eq!(find("", false), pairs(&[("b.mp4", ".")]));
        assert_eq!(find(".git", true), pairs(&[(".git/f.mp4", ".")]), "named itself, it is searched");
        let of_glob = [(".git/f.mp4", ".git"), ("a/c.mp4", "a"), ("b.mp4", ".")];
        assert_eq!(find("**/*.mp4", false), pairs(&of_glob), "a glob means what it matches");
        assert_eq!(find("a/*/*.MOV", true), pairs(&[("a/d/e.MOV", "d")]), "from the root of the glob");
        assert_eq!(find("a/c.mp4", true), pairs(&[("a/c.mp4", ".")]));
    }
}
