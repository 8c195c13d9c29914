//! `video.stmap`: writes the map of each frame for compositors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::Stage;
use crate::pipeline::memory::MemoryCost;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::port_value::{HandedOn, Wired};
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages;
use crate::stages::context::Context;

/// Settings of `video.stmap`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StMapSettings {
    /// The folder to fill with `frame_000000.exr`, `frame_000001.exr`, …
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// The picture may not show anything outside the source, as where `video.render` has `border = "crop"`
    pub keep_inside: bool,
}

impl Default for StMapSettings {
    fn default() -> Self {
        Self { path: String::new(), keep_inside: true }
    }
}

impl Stage for StMapSettings {
    const KIND: &'static str = "video.stmap";
    const SUMMARY: &'static str = "writes each frame's map as a 32-bit EXR: R = x/W, G = 1 − y/H of the source";
    const INPUTS: &'static [Port] = &[
        Port::one("frames", PortType::Frames, "the pictures that the maps are of"),
        Port::many("warps", PortType::Warp, "maps, applied in this order and composed"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the files")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = Wired;
    type Output = HandedOn;

    fn held(&self) -> Vec<MemoryCost> {
        // Two floats per pixel, and the library's blocks of them, for as many frames as threads; eight of them as a bound.
        vec![MemoryCost { what: "maps being written", bytes_per_px: 8.0 * 16.0, ..MemoryCost::default() }]
    }

    fn fills(&self) -> Vec<&str> {
        vec![&self.path]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        stages::stmap(context, stage, self).map(|()| HandedOn)
    }

    fn preflight(&self) -> Result<(), RunError> {
        stages::preflight_stmap(self)
    }
}
