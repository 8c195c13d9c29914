//! The importance of the positions of a clip, moment by moment.

use serde_json::{Value as Json, json};

use super::{IMPORTANCE, Kept, Slot, TRACKS, clip};
use crate::pipeline::paths::to_path;
use crate::stages::context::Context;
use crate::stages::{TrackSettings, VideoImportanceSettings};
use plumbline_photo::temporal::ClipImportance;

impl Kept for ClipImportance {
    const FILES: &'static [&'static str] = &["importance.bin"];

    fn to_files(&self) -> Option<Vec<Vec<u8>>> {
        Some(vec![self.to_bytes()])
    }

    fn of_files(files: &[Vec<u8>]) -> Result<Self, String> {
        Self::from_bytes(&files[0]).ok_or_else(|| "no importance of a clip".to_owned())
    }
}

/// That of stage number `stage` on the clip that stage number `decode` opens; its cuts are found by `tracker`, if there is one.
pub(crate) fn importance_slot(
    context: &mut Context<'_, '_>,
    stage: usize,
    decode: usize,
    settings: &VideoImportanceSettings,
    tracker: Option<&TrackSettings>,
) -> Option<Slot> {
    let (path, decoded) = clip(context, decode)?;
    Slot::of(context, stage, &IMPORTANCE, |cache| {
        let mask = settings.mask.as_deref().map(|mask| cache.digest_of(&to_path(mask))).transpose()?;
        let cuts = match tracker {
            None => Json::Null,
            Some(tracker) => {
                let mask = tracker.mask.as_deref().map(|mask| cache.digest_of(mask)).transpose()?;
                json!({"version": TRACKS.version, "points": tracker.points, "mask": mask})
            }
        };
        Ok([
            ("clip", json!(cache.digest_of(&path)?)),
            ("decode", json!(decoded)),
            ("mask", json!(mask)),
            ("faces", json!(settings.faces)),
            ("cuts", cuts),
        ])
    })
}
