//! `importance`: how much each place of a picture matters.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `importance`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImportanceSettings {
    /// A picture of the same size, painted by hand: white matters, black does not, mid-gray leaves what was found
    #[schemars(extend("format" = "path"))]
    pub mask: Option<String>,
}

impl StageSettings for ImportanceSettings {
    const KIND: &'static str = "importance";
    const SUMMARY: &'static str = "judges how much each place of a picture matters";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture"),
        Port::optional("faces", PortType::Faces, "faces, which matter most"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("importance", PortType::Importance, "how much each place matters")];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn reads(&self) -> Vec<&str> {
        self.mask.as_deref().into_iter().collect()
    }
}
