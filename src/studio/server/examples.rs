//! Examples for the start page: files of `media/` where the program runs in a checkout. Opening one opens a copy.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::folders::Folders;

/// An example.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Example {
    /// What `/api/open` takes.
    pub(crate) path: String,
    pub(crate) workspace: &'static str,
    pub(crate) title: &'static str,
    #[serde(skip)]
    pub(crate) file: PathBuf,
    /// Files that belong to it.
    #[serde(skip)]
    pub(crate) beside: Vec<PathBuf>,
}

/// The scheme of paths that are examples.
const SCHEME: &str = "example:";

const SHOWN: [(&str, &str, &str, &[&str]); 4] = [
    ("giraffe.ply", "mesh", "A giraffe to deform", &[]),
    ("humanoid.glb", "character", "A humanoid with a skeleton", &[]),
    ("dog.ply", "mesh", "A dog", &[]),
    ("room-kb-125.jpg", "photo", "A room through a wide-angle lens", &[]),
];

/// Examples of the `media/` beside one of the folders, the current one, or the program.
pub(crate) fn find(folders: &Folders) -> Vec<Example> {
    let program = std::env::current_exe().unwrap_or_default();
    let current = std::env::current_dir().unwrap_or_default();
    let near = folders.named().iter().map(PathBuf::as_path).chain([current.as_path(), program.as_path()]);
    let mut candidates = near.flat_map(Path::ancestors).flat_map(|folder| [folder.join("media"), folder.to_owned()]);
    let media = candidates.find(|folder| folder.join("giraffe.ply").is_file() && folder.join("humanoid.glb").is_file());
    let Some(media) = media else { return Vec::new() };
    let example = |(name, workspace, title, beside): &(&str, &'static str, &'static str, &[&str])| {
        let file = media.join(name);
        let beside = beside.iter().map(|name| media.join(name)).collect();
        file.is_file().then(|| Example { path: format!("{SCHEME}{name}"), workspace, title, file, beside })
    };
    SHOWN.iter().filter_map(example).collect()
}

/// The example that a path of `/api/open` means.
pub(crate) fn of<'a>(examples: &'a [Example], path: &str) -> Option<&'a Example> {
    examples.iter().find(|example| example.path == path)
}
