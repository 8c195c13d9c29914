//! Orientations in files.

use std::fmt;

use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::Orientation;

/// The values allowed in a file.
const EXPECTED: &str = "\"free\", \"horizontal\", \"vertical\", null, or an angle from -360 to 360 degrees";

/// An orientation as written in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Written(pub(super) Orientation);

impl<'de> Deserialize<'de> for Written {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OrientationVisitor)
    }
}

struct OrientationVisitor;

impl Visitor<'_> for OrientationVisitor {
    type Value = Written;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(EXPECTED)
    }

    fn visit_unit<E: Error>(self) -> Result<Written, E> {
        Ok(Written(Orientation::Free))
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<Written, E> {
        match word {
            "free" => Ok(Written(Orientation::Free)),
            "horizontal" | "h" => Ok(Written(Orientation::Horizontal)),
            "vertical" | "v" => Ok(Written(Orientation::Vertical)),
            _ => Err(E::invalid_value(Unexpected::Str(word), &self)),
        }
    }

    fn visit_f64<E: Error>(self, degrees: f64) -> Result<Written, E> {
        if !(degrees.abs() <= 360.0) {
            return Err(E::invalid_value(Unexpected::Float(degrees), &self));
        }
        // Lines are undirected: angles are modulo 180°.
        let turned = degrees.rem_euclid(180.0);
        Ok(Written(match turned {
            0.0 => Orientation::Horizontal,
            90.0 => Orientation::Vertical,
            _ => Orientation::Angle(turned.to_radians()),
        }))
    }

    fn visit_i64<E: Error>(self, degrees: i64) -> Result<Written, E> {
        self.visit_f64(degrees as f64)
    }

    fn visit_u64<E: Error>(self, degrees: u64) -> Result<Written, E> {
        self.visit_f64(degrees as f64)
    }
}

impl Serialize for Written {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Orientation::Free => serializer.serialize_str("free"),
            Orientation::Horizontal => serializer.serialize_str("horizontal"),
            Orientation::Vertical => serializer.serialize_str("vertical"),
            Orientation::Angle(radians) => serializer.serialize_f64(radians.to_degrees()),
        }
    }
}

impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Orientation::Free => f.write_str("free"),
            Orientation::Horizontal => f.write_str("horizontal"),
            Orientation::Vertical => f.write_str("vertical"),
            Orientation::Angle(radians) => write!(f, "at {}°", radians.to_degrees()),
        }
    }
}

#[cfg(feature = "schema")]
impl schemars::JsonSchema for Written {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Orientation".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "How the line shall lie in the output: by name, or degrees from +x towards +y (down).",
            "anyOf": [
                { "enum": ["free", "horizontal", "vertical", "h", "v", null] },
                { "type": "number", "minimum": -360, "maximum": 360 },
            ]
        })
    }
}
