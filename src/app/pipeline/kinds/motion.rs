//! `video.motion`: how the camera moved.

use crate::pipeline::kind::StageSettings;
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};
pub use plumbline_video::stabilize::{CameraMotionOptions as MotionSettings, RollingShutter};

impl StageSettings for MotionSettings {
    const KIND: &'static str = "video.motion";
    const SUMMARY: &'static str = "estimates the camera's motion from frame to frame, following the background";
    const INPUTS: &'static [Port] = &[Port::one("tracks", PortType::Tracks, "points of the clip")];
    const OUTPUTS: &'static [Port] = &[Port::one("motion", PortType::Motion, "motion between neighboring frames")];

    fn held(&self) -> Vec<Held> {
        // A homography, a similarity and the verdicts of one frame.
        vec![Held { what: "motion", bytes_per_clip_frame: 192.0, ..Held::default() }]
    }
}
