//! Skeleton, character and clip files: glTF and BVH, `.tgf` and `.skel` skeletons are read and written; FBX and `.anim`
//! clips are read.
//!
//! Readers validate counts, parents and finiteness, and report the position of a fault in the file.

mod bvh;
mod gltf;
mod skel;
mod text;
mod tgf;

use std::path::Path;

use super::character::clip_named;
use super::{CharacterError, Clip, RigFileError, Skeleton};
use crate::mesh::{ReadLimits, read_model};
use plumbline_num::document::read_bounded;
use plumbline_num::run::Run;

pub use bvh::{bvh_text, parse_bvh};
pub use gltf::character_of;
pub use skel::{parse_anim, parse_skel, skel_text};
pub use tgf::{parse_tgf, tgf_text};

/// Size limit of text files: 100 joints for an hour at 60 frames per second.
const MAX_TEXT: u64 = 1 << 30;

/// A skeleton with the clips of its file.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// The skeleton.
    pub skeleton: Skeleton,
    /// The clips.
    pub clips: Vec<Clip>,
    /// What the reader left out.
    pub warnings: Vec<String>,
}

impl Rig {
    /// The clip with this name.
    ///
    /// # Errors
    /// [`CharacterError::Input`], with the names of all clips.
    pub fn clip(&self, name: &str) -> Result<&Clip, CharacterError> {
        clip_named(&self.clips, name)
    }
}

/// Reads a skeleton file; the format (JSON, glTF, FBX, BVH, `.tgf`, `.skel`) follows from the extension. The limits are those of glTF, the
/// one format whose files may name others.
///
/// # Errors
/// [`RigFileError`] with the file name.
pub fn read_rig(path: &Path, limits: &ReadLimits, run: &Run) -> Result<Rig, RigFileError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let alone = |skeleton| Rig { skeleton, clips: Vec::new(), warnings: Vec::new() };
    let read = || match extension.as_str() {
        "json" => {
            let file = super::skeleton_file::SkeletonFile::read(path)?;
            Ok(Rig { clips: file.clips, ..alone(file.skeleton) })
        }
        "gltf" | "glb" | "vrm" | "fbx" => {
            let model = read_model(path, limits, run)?;
            if let Some(rig) = gltf::skeleton_of(&model)? {
                return Ok(rig);
            }
            let character = character_of(&model)?;
            Ok(Rig { skeleton: character.skeleton, clips: character.clips, warnings: character.warnings })
        }
        "bvh" => parse_bvh(&text_of(path)?),
        "tgf" => parse_tgf(&text_of(path)?),
        "skel" => parse_skel(&text_of(path)?).map(alone),
        _ => Err(unknown_extension("json, glb, gltf, vrm, fbx, bvh, tgf or skel")),
    };
    read().map_err(|e: RigFileError| e.of_file(path))
}

/// Writes a skeleton, and a clip if the format supports one (JSON, BVH). The format follows from the extension: `.json`, `.bvh`, `.tgf` or
/// `.skel`. Second result: what the format cannot represent.
///
/// # Errors
/// [`RigFileError`]: an unknown extension, or a skeleton that the format cannot represent.
pub fn rig_text(
    skeleton: &Skeleton,
    clip: Option<&Clip>,
    extension: &str,
) -> Result<(String, Vec<&'static str>), RigFileError> {
    match extension.to_ascii_lowercase().as_str() {
        "json" => {
            let clips = clip.cloned().into_iter().collect();
            let file = super::skeleton_file::SkeletonFile {
                skeleton: skeleton.clone(),
                curve: None,
                proposed_names: None,
                clips,
            };
            let morphed = clip.is_some_and(|c| !c.morphs().is_empty());
            Ok((file.to_json(), if morphed { vec!["weights of morph targets"] } else { Vec::new() }))
        }
        "bvh" => bvh_text(skeleton, clip),
        "tgf" => Ok((tgf_text(skeleton), vec!["names, rotations and limits of joints"])),
        "skel" => Ok((skel_text(skeleton), vec!["rotations and limits of joints"])),
        _ => Err(unknown_extension("json, bvh, tgf or skel")),
    }
}

fn unknown_extension(expected: &str) -> RigFileError {
    RigFileError::Content(format!("unknown skeleton file extension (expected {expected})"))
}

/// Reads a text file within the size limit.
fn text_of(path: &Path) -> Result<String, RigFileError> {
    let raw = read_bounded(path, MAX_TEXT)?;
    // Moved where it is UTF-8: a copy of the largest files does not fit beside them.
    let mut text = String::from_utf8(raw).unwrap_or_else(|e| String::from_utf8_lossy(e.as_bytes()).into_owned());
    let marks = text.len() - text.trim_start_matches('\u{feff}').len();
    text.drain(..marks);
    Ok(text)
}

#[cfg(test)]
mod tests;
