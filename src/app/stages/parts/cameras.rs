//! The cameras of a clip in space, window by window.

use std::ops::Range;
use std::path::Path;

use super::{Chunks, PartName, inexact, made_before, read_motion};
use crate::stages::MotionSettings;
use crate::stages::prelude::*;
use crate::stages::video_track::focal_px_of;
use plumbline_video::motion::sfm::Windows;
use plumbline_video::motion::{ClipCameras, ClipMotion, MotionFileError, WindowCameras};
use plumbline_video::stabilize::CameraRecovery;

/// Settings of the cameras of the windows that start in a chunk.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct CamerasPartSettings {
    /// The folder of parts
    #[schemars(extend("format" = "path"))]
    pub(crate) folder: String,
    /// The chunks of the clip
    pub(crate) chunks: Chunks,
    /// Index of the chunk
    pub(crate) chunk: usize,
    /// Of the leading windows of shots, or of all others
    pub(crate) leading: bool,
    /// How motion is estimated
    pub(crate) motion: MotionSettings,
}

impl CamerasPartSettings {
    /// Frames that are solved, of a clip of one shot.
    pub(crate) fn expected_frames(&self) -> usize {
        let first = Windows::default().length.min(self.chunks.frames);
        let frames = self.chunks.range(self.chunk);
        match (self.leading, self.chunk) {
            (true, 0) => first,
            (true, _) => 0,
            (false, _) => frames.end - frames.start.max(first).min(frames.end),
        }
    }

    fn written(&self) -> PartName {
        if self.leading { PartName::Leading(self.chunk) } else { PartName::Cameras(self.chunk) }
    }
}

impl Stage for CamerasPartSettings {
    const KIND: &'static str = "part.cameras";
    const SUMMARY: &'static str = "recovers the cameras of some windows of a clip";
    const INPUTS: &'static [Port] = &[Port::one("frames", PortType::Frames, "the clip")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the cameras of the windows")];
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        self.motion.memory()
    }

    fn writes(&self) -> Vec<String> {
        vec![self.written().text(&self.folder)]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let decode = context.required(stage, "frames")?.from;
        let focal_px = focal_px_of(&context.input(decode)?);
        let motion = read_motion(&PartName::Planar.in_folder(&self.folder))?;
        let recovery = CameraRecovery::new(&motion, &self.motion, focal_px);
        let starts = self.chunks.range(self.chunk);
        let tracks = context.joined_tracks(&self.folder, self.chunks, &recovery.support(&starts), &motion)?;
        let run = context.job.run();
        let found = if self.leading {
            recovery.leading(&tracks, starts, &run)?
        } else {
            let known = self.leading_of(&motion, &starts)?;
            recovery.following(&tracks, starts, &known, &run)?
        };
        let fault = |e: MotionFileError| RunError::Internal(e.to_string());
        let text = WindowCameras::to_json(&found).map_err(fault)?;
        if WindowCameras::from_json(&text).map_err(fault)? != found {
            return Err(inexact("the cameras of a part are"));
        }
        context.write_file(&self.written().in_folder(&self.folder), text.into_bytes())?;
        Ok(HandedOn)
    }
}

impl CamerasPartSettings {
    /// The leading windows of all shots that have a frame among `starts`.
    fn leading_of(&self, motion: &ClipMotion, starts: &Range<usize>) -> Result<Vec<WindowCameras>, RunError> {
        let first = motion.shots.iter().find(|shot| shot.end > starts.start).map_or(starts.start, |shot| shot.start);
        let chunks = self.chunks.overlapping(&(first..starts.end));
        read_all(&self.folder, chunks.map(PartName::Leading))
    }
}

/// The cameras of the clip of `motion`, from all its windows.
pub(super) fn joined_cameras(
    folder: &str,
    chunks: Chunks,
    motion: &ClipMotion,
    settings: &MotionSettings,
) -> Result<ClipCameras, RunError> {
    let all = (0..chunks.count).flat_map(|chunk| [PartName::Leading(chunk), PartName::Cameras(chunk)]);
    Ok(CameraRecovery::new(motion, settings, None).join(read_all(folder, all)?)?)
}

fn read_all(folder: &str, names: impl Iterator<Item = PartName>) -> Result<Vec<WindowCameras>, RunError> {
    let mut all = Vec::new();
    for name in names {
        all.extend(read(&name.in_folder(folder))?);
    }
    Ok(all)
}

fn read(path: &Path) -> Result<Vec<WindowCameras>, RunError> {
    WindowCameras::read_json(made_before(path)?).map_err(|e| RunError::Input(format!("{}: {e}", path.display())))
}
