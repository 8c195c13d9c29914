//! Files of a character for the user.

use super::document::CharacterDocument;
use super::message::Format;
use super::rig::fault;
use super::{CharacterWorkspace, Known, files, not_ready, solve};
use crate::error::StudioError;
use crate::tar;
use crate::workspace::Answer;
use plumbline_num::run::Run;
use plumbline_shape::character::io::bvh_text;
use plumbline_shape::character::pose_file::TargetPose;
use plumbline_shape::character::{Clip, Pose};
use plumbline_shape::mesh::MeshFormat;
use plumbline_shape::mesh::io::{WriteOptions, encode_model};

/// Maximum size of an archive of frames, bytes: what a browser saves without trouble.
const MAX_ARCHIVE: usize = 1 << 30;
/// As many frames as the stage `character.pose` makes.
const MAX_FRAMES: f64 = 9999.0;

impl CharacterWorkspace {
    /// The character in the pose that is shown, or its movement.
    ///
    /// # Errors
    /// Where skeleton and weights are still computed; what the format cannot hold.
    pub(super) fn export(
        &mut self,
        document: &CharacterDocument,
        format: Format,
        run: &Run,
    ) -> Result<Answer, StudioError> {
        let known = self.known(document)?.ok_or_else(not_ready)?;
        let pose = self.pose(document, &known.skeleton, run)?;
        let (extension, bytes) = match format {
            Format::Glb => {
                let weights = (*known.weights).clone();
                let character = files::character(&self.model, &known.skeleton, weights, document)?;
                ("glb", files::glb(&character, Some(&pose))?)
            }
            Format::Bvh => {
                let clip = document.shown_clip().map(|clip| solve::clip(&known.skeleton, clip)).transpose()?;
                ("bvh", bvh_text(&known.skeleton, clip.as_ref()).map_err(method)?.0.into_bytes())
            }
            Format::Obj => ("obj", self.obj(document, &known, &pose, run)?),
        };
        Ok(Answer::Download { name: format!("{}-posed.{extension}", self.stem()), bytes })
    }

    /// The surface in the poses of the clip that is shown, from its first key to its last.
    ///
    /// # Errors
    /// As [`Self::export`]; without keys, or too many frames.
    pub(super) fn export_frames(
        &mut self,
        document: &CharacterDocument,
        rate: f64,
        run: &Run,
    ) -> Result<Answer, StudioError> {
        let known = self.known(document)?.ok_or_else(not_ready)?;
        let clip = document.shown_clip().ok_or_else(|| StudioError::request("no clip is chosen"))?;
        let count = frame_count(&solve::clip(&known.skeleton, clip)?, rate)?;
        let (stem, mut size, mut obj) = (self.stem(), 0, Vec::new());
        for (k, pose) in solve::frames(&known.skeleton, clip, count)?.iter().enumerate() {
            let bytes = self.obj(document, &known, pose, run)?;
            size += bytes.len();
            if size > MAX_ARCHIVE {
                let limit = MAX_ARCHIVE >> 20;
                return Err(StudioError::request(format!(
                    "{count} frames have more than {limit} MB: let a run of the saved file write them"
                )));
            }
            obj.push((format!("{stem}-posed_{k:04}.obj"), bytes));
        }
        let bytes = tar::archive(&obj);
        let bytes = bytes.ok_or_else(|| StudioError::request("the name of the mesh is too long for an archive"))?;
        Ok(Answer::Download { name: format!("{stem}-frames.tar"), bytes })
    }

    /// The pose that is shown as the text of a pose file.
    ///
    /// # Errors
    /// Where there is no skeleton.
    pub(super) fn copy_pose(&self, document: &CharacterDocument) -> Result<Answer, StudioError> {
        let skeleton = self.rigs.skeleton(&document.skeleton).ok_or_else(not_ready)?;
        let start = self.shown_now(document)?.unwrap_or_else(|| skeleton.rest_pose());
        let pose = TargetPose { start, ..TargetPose::default() };
        Ok(Answer::Value(pose.to_json(&skeleton).map_err(fault)?.into()))
    }

    fn obj(
        &mut self,
        document: &CharacterDocument,
        known: &Known,
        pose: &Pose,
        run: &Run,
    ) -> Result<Vec<u8>, StudioError> {
        let globals = known.skeleton.globals(pose).map_err(fault)?;
        let posed = self.rigs.positions(&known.following(document, document.skinning), &globals, run)?;
        let model = self.model.with_positions(posed).map_err(method)?;
        encode_model(&model, MeshFormat::Obj, &WriteOptions::default(), run).map_err(method)
    }

    fn stem(&self) -> String {
        self.name.split('.').next().unwrap_or("character").to_owned()
    }
}

/// Frames of a clip at a rate.
fn frame_count(clip: &Clip, rate: f64) -> Result<u32, StudioError> {
    let (start, end) =
        clip.span().ok_or_else(|| StudioError::request(format!("clip {:?} has no keys", clip.name())))?;
    let count = ((end - start) * rate).round() + 1.0;
    if rate > 0.0 && count <= MAX_FRAMES {
        Ok(count as u32)
    } else {
        Err(StudioError::request(format!("{rate} frames per second give {count} frames (expected 1 to {MAX_FRAMES})")))
    }
}

fn method(error: impl std::fmt::Display) -> StudioError {
    StudioError::Method(error.to_string())
}
