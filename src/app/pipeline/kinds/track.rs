//! `video.track`: follows points through the frames.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::StageSettings;
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};
use plumbline_video::track::TrackOptions;

/// Settings of `video.track`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TrackSettings {
    /// Points kept alive per frame; more follow finer motion and cost time in proportion
    #[schemars(range(min = 50, max = 20_000))]
    pub points: u32,
    /// Picture of the clip's shape: nothing is tracked where it is white (a logo, a dashboard)
    #[schemars(extend("format" = "path"))]
    pub mask: Option<String>,
}

impl Default for TrackSettings {
    fn default() -> Self {
        Self { points: TrackOptions::default().points as u32, mask: None }
    }
}

impl StageSettings for TrackSettings {
    const KIND: &'static str = "video.track";
    const SUMMARY: &'static str =
        "follows points through the frames, and recognizes cuts, blurred and duplicate frames";
    const INPUTS: &'static [Port] = &[
        Port::one("frames", PortType::Frames, "the clip to analyze"),
        Port::optional("lens", PortType::Warp, "a map of the whole clip that the points are carried through"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("tracks", PortType::Tracks, "the points of every frame")];

    fn held(&self) -> Vec<Held> {
        // Two frames' luma pyramids (1 + 1/4 + 1/16 + … = 4/3 each); tracks go to a temporary file at 8 bytes per point.
        vec![
            Held { what: "two luma pyramids", bytes_per_px: 8.0 / 3.0, ..Held::default() },
            Held {
                what: "tracks",
                bytes_per_clip_frame: f64::from(self.points) * 8.0,
                on_disk: true,
                ..Held::default()
            },
        ]
    }

    fn reads(&self) -> Vec<&str> {
        self.mask.as_deref().into_iter().collect()
    }
}
