//! Files of skeletons, characters and movements: glTF and BVH read and written, `.tgf` and `.skel` skeletons read and written,
//! `.anim` movements and `.ini` characters read.
//!
//! Readers are strict about what a skeleton depends on (counts, parents, finite numbers) and say where in the file the fault is.

mod bvh;
mod error;
mod gltf;
mod ini;
mod skel;
mod text;
mod tgf;

use std::path::Path;

use super::{Clip, Skeleton};
use plumbline_num::run::Run;

pub use bvh::{bvh_text, parse_bvh};
pub use error::RigFileError;
pub use gltf::character_of;
pub use ini::read_ini;
pub use skel::{parse_anim, parse_skel, skel_text};
pub use tgf::{parse_tgf, tgf_text};

/// Largest skeleton or movement as text: 100 joints for an hour.
const MAX_TEXT: u64 = 1 << 30;

/// A skeleton with the movements that its file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// The joints.
    pub skeleton: Skeleton,
    /// Movements.
    pub clips: Vec<Clip>,
    /// What in the file was left out.
    pub warnings: Vec<String>,
}

/// Reads a skeleton from a file of any format: our own JSON, glTF, BVH, `.tgf` or `.skel`, told by the name's extension.
///
/// # Errors
/// [`RigFileError`] with the file.
pub fn read_rig(path: &Path) -> Result<Rig, RigFileError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let alone = |skeleton| Rig { skeleton, clips: Vec::new(), warnings: Vec::new() };
    let read = || match extension.as_str() {
        "json" => Ok(alone(super::skeleton_file::SkeletonFile::read(path)?.skeleton)),
        "gltf" | "glb" => {
            let model = crate::mesh::read_model(path, &crate::mesh::ReadLimits::default(), &Run::default())?;
            let character = character_of(&model)?;
            Ok(Rig { skeleton: character.skeleton, clips: character.clips, warnings: character.warnings })
        }
        "bvh" => parse_bvh(&text_of(path)?),
        "tgf" => parse_tgf(&text_of(path)?),
        "skel" => parse_skel(&text_of(path)?).map(alone),
        _ => Err(RigFileError::UnknownFormat { expected: "json, glb, gltf, bvh, tgf or skel" }),
    };
    read().map_err(|e: RigFileError| e.of_file(path))
}

/// Writes a skeleton, with a movement where the format holds one (BVH), in the format of the name's extension: `.json`, `.bvh`,
/// `.tgf` or `.skel`. What is lost, in words.
///
/// # Errors
/// [`RigFileError`]: an extension that is none of these, a skeleton that the format cannot hold.
pub fn rig_text(
    skeleton: &Skeleton,
    clip: Option<&Clip>,
    extension: &str,
) -> Result<(String, Vec<&'static str>), RigFileError> {
    match extension.to_ascii_lowercase().as_str() {
        "json" => {
            let file = super::skeleton_file::SkeletonFile { skeleton: skeleton.clone(), curve: None };
            Ok((file.to_json(), if clip.is_some() { vec!["the movement"] } else { Vec::new() }))
        }
        "bvh" => bvh_text(skeleton, clip),
        "tgf" => Ok((tgf_text(skeleton), vec!["names, turns and limits of joints"])),
        "skel" => Ok((skel_text(skeleton), vec!["turns and limits of joints"])),
        _ => Err(RigFileError::UnknownFormat { expected: "json, bvh, tgf or skel" }),
    }
}

/// The text of a file.
fn text_of(path: &Path) -> Result<String, RigFileError> {
    use std::io::Read as _;
    let file = std::fs::File::open(path)?;
    let bytes = file.metadata()?.len();
    if bytes > MAX_TEXT {
        return Err(RigFileError::TooLarge { bytes, most: MAX_TEXT });
    }
    let mut raw = Vec::new();
    file.take(MAX_TEXT).read_to_end(&mut raw)?;
    Ok(String::from_utf8_lossy(&raw).trim_start_matches('\u{feff}').to_owned())
}

#[cfg(test)]
mod tests;
