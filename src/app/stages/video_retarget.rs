//! `video.retarget`: a map per frame to another shape.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{MapStep, Stage};
use crate::pipeline::memory::MemoryCost;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::port_value::{HandedOn, Wired};
use crate::pipeline::run_error::RunError;
use crate::pipeline::sizes::TargetSize;
use crate::pipeline::stages;
use crate::stages::context::Context;
use plumbline_photo::temporal::ClipRetargetOptions;

/// Settings of `video.retarget`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct VideoRetargetSettings {
    /// The new size as it is shown, such as 1080x1920, or the new shape, such as 9:16
    pub size: Option<TargetSize>,
    /// Changes of shape below this factor crop first, and warp the rest: 1 only crops, 0 only warps
    #[schemars(range(min = 0.0, max = 1.0))]
    pub crop_below: f64,
}

impl Default for VideoRetargetSettings {
    fn default() -> Self {
        Self { size: None, crop_below: ClipRetargetOptions::default().crop_below }
    }
}

impl Stage for VideoRetargetSettings {
    const KIND: &'static str = "video.retarget";
    const SUMMARY: &'static str = "finds the map of each frame to another shape that keeps and spares what matters";
    const INPUTS: &'static [Port] = &[
        Port::one("importance", PortType::Importance, "how much each place of the clip matters"),
        Port::one("motion", PortType::Motion, "shots, and the motion along which importance is followed"),
        Port::optional("path", PortType::Path, "the virtual camera, where the clip is held steady first"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("warp", PortType::Warp, "one map per frame")];
    const REQUIRED: &'static [&'static str] = &["size"];
    const MAP: Option<MapStep> = Some(MapStep::Shape);
    type Input = Wired;
    type Output = HandedOn;

    fn held(&self) -> Vec<MemoryCost> {
        // Places of sixty rows and columns per moment, twice while they are evened out.
        vec![MemoryCost { what: "rows and columns", bytes_per_clip_frame: 200.0, ..MemoryCost::default() }]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        stages::video_retarget(context, stage, self).map(|()| HandedOn)
    }
}
