//! Pipeline files that come with the program, found by name.

use std::path::Path;

use plumbline_num::document::read_text;

use super::paths::to_path;
use super::syntax::Source;

/// `(name, text)` of every shipped file.
pub const SHIPPED: [(&str, &str); 8] = [
    ("stabilize", include_str!("../../../pipeline/stabilize.toml")),
    ("stabilize-3d", include_str!("../../../pipeline/stabilize-3d.toml")),
    ("rectify", include_str!("../../../pipeline/rectify.toml")),
    ("retarget", include_str!("../../../pipeline/retarget.toml")),
    ("vertical-video", include_str!("../../../pipeline/vertical-video.toml")),
    ("deform-mesh", include_str!("../../../pipeline/deform-mesh.toml")),
    ("rig-and-pose", include_str!("../../../pipeline/rig-and-pose.toml")),
    ("morph", include_str!("../../../pipeline/morph.toml")),
];

/// The shipped file called `name`. Relative paths in it start from the working directory.
pub fn shipped(name: &str) -> Option<Source> {
    let (name, text) = SHIPPED.iter().find(|(n, _)| *n == name)?;
    Some(Source { name: format!("{name}.toml (shipped)"), text: (*text).to_owned(), base: None })
}

/// Size of the largest pipeline file, bytes: written by hand, they have some kilobytes.
pub(crate) const MAX_BYTES: u64 = 1 << 24;

/// The source that `FILE|NAME` means: an existing file first, then a shipped name.
///
/// # Errors
/// Neither exists, or the file cannot be read.
pub fn find_source(name: &str) -> Result<Source, String> {
    let path = &to_path(name);
    match read_text(path, MAX_BYTES) {
        Ok(text) => {
            let base = path.parent().filter(|p| *p != Path::new("")).map(Path::to_owned);
            Ok(Source { name: name.to_owned(), text, base })
        }
        Err(error) => match (shipped(name), error.kind()) {
            (Some(source), _) => Ok(source),
            (None, std::io::ErrorKind::NotFound) => {
                let known: Vec<&str> = SHIPPED.iter().map(|(n, _)| *n).collect();
                Err(format!("there is no pipeline file `{name}` (shipped ones: {})", super::suggest::listed(&known)))
            }
            (None, _) => Err(format!("cannot read the pipeline file `{name}`: {error}")),
        },
    }
}
