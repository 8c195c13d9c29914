//! Examples for the start page: one of `media/` for each workspace, embedded, 1 MB together. Opening one opens a copy of it.

use std::borrow::Cow;

use rust_embed::RustEmbed;
use serde::Serialize;

/// Files of `media/`, where the program is built in a checkout.
#[derive(RustEmbed)]
#[folder = "../../media"]
#[include = "giraffe.ply"]
#[include = "humanoid.glb"]
#[include = "room-kb-125.jpg"]
#[allow_missing = true]
struct Media;

/// An example.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Example {
    /// What `/api/open` takes.
    path: String,
    workspace: &'static str,
    title: &'static str,
}

/// The scheme of paths that are examples.
const SCHEME: &str = "example:";

const SHOWN: [(&str, &str, &str); 3] = [
    ("giraffe.ply", "mesh", "A giraffe to deform"),
    ("humanoid.glb", "character", "A humanoid with a skeleton"),
    ("room-kb-125.jpg", "photo", "A room through a wide-angle lens"),
];

/// All that the program has.
pub(super) fn all() -> Vec<Example> {
    let shown = SHOWN.iter().filter(|(name, ..)| Media::get(name).is_some());
    shown.map(|(name, workspace, title)| Example { path: format!("{SCHEME}{name}"), workspace, title }).collect()
}

/// Name and content of the example that a path of `/api/open` means.
pub(super) fn find(path: &str) -> Option<(&str, Cow<'static, [u8]>)> {
    let name = path.strip_prefix(SCHEME)?;
    Media::get(name).map(|file| (name, file.data))
}
