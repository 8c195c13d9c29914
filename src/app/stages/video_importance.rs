//! `video.importance`: how much each place of a clip matters.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{Stage, TemporalScope};
use crate::pipeline::memory::MemoryCost;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::port_value::{HandedOn, Wired};
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages;
use crate::stages::context::Context;

/// Whether faces are looked for in a clip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ClipFaces {
    /// Twice a second
    #[default]
    Auto,
    /// Not at all
    Off,
}

/// Settings of `video.importance`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct VideoImportanceSettings {
    /// Whether faces are looked for, which matter most
    pub faces: ClipFaces,
    /// A picture of the clip's size, painted by hand: white matters, black does not, mid-gray leaves what was found
    #[schemars(extend("format" = "path"))]
    pub mask: Option<String>,
}

impl Stage for VideoImportanceSettings {
    const KIND: &'static str = "video.importance";
    const SUMMARY: &'static str = "judges how much each place of a clip matters, six times a second";
    const INPUTS: &'static [Port] = &[Port::one("frames", PortType::Frames, "the clip to judge")];
    const OUTPUTS: &'static [Port] = &[Port::one("importance", PortType::Importance, "how much each place matters")];
    type Input = Wired;
    type Output = HandedOn;

    fn over_time(&self) -> TemporalScope {
        TemporalScope::Reduce
    }

    fn held(&self) -> Vec<MemoryCost> {
        // 1300 bytes per moment; the detector's model and pyramid.
        vec![
            MemoryCost { what: "importance", bytes_per_clip_frame: 1300.0 / 5.0, ..MemoryCost::default() },
            MemoryCost { what: "a small picture and the search for faces", bytes: 24 << 20, ..MemoryCost::default() },
        ]
    }

    fn reads(&self) -> Vec<&str> {
        self.mask.as_deref().into_iter().collect()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        stages::video_importance(context, stage).map(|()| HandedOn)
    }
}
