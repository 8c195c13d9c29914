//! The option for the correction of rolling-shutter wobble: a word, or the readout time.

use std::fmt;
use std::str::FromStr;

use serde::de::{self, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

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
        struct WordOrSeconds;
        impl Visitor<'_> for WordOrSeconds {
            type Value = RollingShutter;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"auto\", \"off\" or seconds")
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<RollingShutter, E> {
                text.parse().map_err(E::custom)
            }
            fn visit_f64<E: de::Error>(self, seconds: f64) -> Result<RollingShutter, E> {
                self.visit_str(&seconds.to_string())
            }
            fn visit_i64<E: de::Error>(self, seconds: i64) -> Result<RollingShutter, E> {
                self.visit_str(&seconds.to_string())
            }
            fn visit_u64<E: de::Error>(self, seconds: u64) -> Result<RollingShutter, E> {
                self.visit_str(&seconds.to_string())
            }
        }
        d.deserialize_any(WordOrSeconds)
    }
}

#[cfg(feature = "schema")]
impl schemars::JsonSchema for RollingShutter {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "RollingShutter".into()
    }
    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({"anyOf": [
            {"type": "string", "enum": ["auto", "off"]},
            {"type": "number", "exclusiveMinimum": 0, "maximum": 0.1}
        ]})
    }
}
