//! `video.motion_import`: takes motion and points from a file, so that nothing need be tracked.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::RollingShutter;
use crate::pipeline::kind::{Stage, TemporalScope};
use crate::pipeline::memory::MemoryCost;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::port_value::{HandedOn, Wired};
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages;
use crate::stages::context::Context;

/// Settings of `video.motion_import`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MotionImportSettings {
    /// A motion file (JSON, `plumbline.motion`), or the folder of a COLMAP model
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// Rolling-shutter correction: as the file says, off, or the sensor's readout time in seconds
    pub rolling_shutter: RollingShutter,
    /// Also recover where the camera stood in space, where the file does not say
    pub cameras: bool,
}

impl Stage for MotionImportSettings {
    const KIND: &'static str = "video.motion_import";
    const SUMMARY: &'static str = "reads motion and points from a file in place of tracking the clip";
    const INPUTS: &'static [Port] =
        &[Port::one("frames", PortType::Frames, "the clip that they are of; its size and times are compared")];
    const OUTPUTS: &'static [Port] = &[
        Port::one("motion", PortType::Motion, "motion between neighboring frames"),
        Port::one("tracks", PortType::Tracks, "the points of every frame"),
    ];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = Wired;
    type Output = HandedOn;

    fn over_time(&self) -> TemporalScope {
        TemporalScope::Once
    }

    fn held(&self) -> Vec<MemoryCost> {
        // As video.motion and video.track: the file is read point by point.
        vec![
            MemoryCost { what: "motion", bytes_per_clip_frame: 192.0, ..MemoryCost::default() },
            MemoryCost { what: "tracks", bytes_per_clip_frame: 8_000.0, on_disk: true, ..MemoryCost::default() },
        ]
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        stages::motion_import(context, stage, self).map(|()| HandedOn)
    }
}
