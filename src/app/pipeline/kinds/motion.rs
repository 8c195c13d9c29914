//! `video.motion`: how the camera moved.

use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::pipeline::kind::StageSettings;
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::units::number_or_text;

/// Correction of rolling-shutter wobble.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum RollingShutter {
    /// The readout time is estimated from the clip.
    #[default]
    Auto,
    /// No correction.
    Off,
    /// The sensor's readout time from first to last row, seconds, in `(0, 0.1]`.
    Readout(f64),
}

impl FromStr for RollingShutter {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.parse::<f64>()) {
            ("auto", _) => Ok(Self::Auto),
            ("off", _) => Ok(Self::Off),
            (_, Ok(seconds)) if seconds > 0.0 && seconds <= 0.1 => Ok(Self::Readout(seconds)),
            _ => Err(format!(
                "`{text}` is no rolling-shutter setting (expected auto, off, or a readout time above 0 up to 0.1 s)"
            )),
        }
    }
}

impl fmt::Display for RollingShutter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Off => f.write_str("off"),
            Self::Readout(seconds) => write!(f, "{seconds}"),
        }
    }
}

impl Serialize for RollingShutter {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Readout(seconds) => s.serialize_f64(*seconds),
            word => s.collect_str(word),
        }
    }
}

impl<'de> Deserialize<'de> for RollingShutter {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        number_or_text(d, "\"auto\", \"off\" or seconds")
    }
}

impl JsonSchema for RollingShutter {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "RollingShutter".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"anyOf": [
            {"type": "string", "enum": ["auto", "off"]},
            {"type": "number", "exclusiveMinimum": 0, "maximum": 0.1}
        ]})
    }
}

/// Settings of `video.motion`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MotionSettings {
    /// Rolling-shutter correction: estimated, off, or the sensor's readout time in seconds
    pub rolling_shutter: RollingShutter,
    /// Also recover where the camera stood in space, and the points it saw
    pub cameras: bool,
}

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
