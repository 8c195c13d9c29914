//! `video.motion`: how the camera moved.

use super::prelude::*;
pub use plumbline_video::stabilize::{CameraMotionOptions as MotionSettings, RollingShutter};

impl Stage for MotionSettings {
    const KIND: &'static str = "video.motion";
    const SUMMARY: &'static str = "estimates the camera's motion from frame to frame, following the background";
    const INPUTS: &'static [Port] = &[Port::one("tracks", PortType::Tracks, "points of the clip")];
    const OUTPUTS: &'static [Port] = &[Port::one("motion", PortType::Motion, "motion between neighboring frames")];
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        // A homography, a similarity and the verdicts of one frame.
        vec![MemoryCost { what: "motion", bytes_per_clip_frame: 192.0, ..MemoryCost::default() }]
    }

    // Found while the points are tracked: `video.track` hands it on.
    fn run(&self, _input: Wired, _context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        Ok(HandedOn)
    }
}
