//! `video.track`: follows points through the frames.

use std::path::Path;

use crate::pipeline::kind::Stage;
use crate::pipeline::memory::MemoryCost;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::port_value::{HandedOn, Wired};
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages;
use crate::stages::context::Context;
pub use plumbline_video::stabilize::TrackingOptions as TrackSettings;

impl Stage for TrackSettings {
    const KIND: &'static str = "video.track";
    const SUMMARY: &'static str =
        "follows points through the frames, and recognizes cuts, blurred and duplicate frames";
    const INPUTS: &'static [Port] = &[
        Port::one("frames", PortType::Frames, "the clip to analyze"),
        Port::optional("lens", PortType::Warp, "a map of the whole clip that the points are carried through"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("tracks", PortType::Tracks, "the points of every frame")];
    type Input = Wired;
    type Output = HandedOn;

    fn held(&self) -> Vec<MemoryCost> {
        // Two frames' luma pyramids (1 + 1/4 + 1/16 + … = 4/3 each); tracks go to a temporary file at 8 bytes per point.
        vec![
            MemoryCost { what: "two luma pyramids", bytes_per_px: 8.0 / 3.0, ..MemoryCost::default() },
            MemoryCost {
                what: "tracks",
                bytes_per_clip_frame: f64::from(self.points) * 8.0,
                on_disk: true,
                ..MemoryCost::default()
            },
        ]
    }

    fn reads(&self) -> Vec<&str> {
        self.mask.as_deref().and_then(Path::to_str).into_iter().collect()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        stages::track(context, stage, self).map(|()| HandedOn)
    }
}
