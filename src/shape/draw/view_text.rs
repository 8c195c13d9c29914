//! View directions as people write them: `front`, or `35,25` for yaw and pitch in degrees.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::ViewDirection;

impl FromStr for ViewDirection {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if let Some(direction) = Self::named(text) {
            return Ok(direction);
        }
        let wrong = || {
            let names: Vec<String> = Self::NAMED.iter().map(|(name, ..)| format!("`{name}`")).collect();
            let names = names.join(", ");
            format!("`{text}` is no direction (expected {names}, or YAW,PITCH in degrees: -360 to 360, -90 to 90)")
        };
        let (yaw, pitch) = text.split_once(',').ok_or_else(wrong)?;
        let angle = |t: &str, max: f64| t.trim().parse::<f64>().ok().filter(|a| (-max..=max).contains(a));
        let angles = angle(yaw, 360.0).zip(angle(pitch, 90.0));
        angles.map(|(yaw, pitch)| Self::degrees(yaw, pitch)).ok_or_else(wrong)
    }
}

impl fmt::Display for ViewDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((name, ..)) = Self::NAMED.iter().find(|(_, yaw, pitch)| Self::degrees(*yaw, *pitch) == *self) {
            return f.write_str(name);
        }
        // To and from radians a number loses its last digits: nine decimals are a thousandth of an arc second, and what
        // people write has fewer.
        let degrees = |radians: f64| (radians.to_degrees() * 1e9).round() / 1e9;
        write!(f, "{},{}", degrees(self.yaw), degrees(self.pitch))
    }
}

impl<'de> Deserialize<'de> for ViewDirection {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        String::deserialize(d)?.parse().map_err(serde::de::Error::custom)
    }
}

impl Serialize for ViewDirection {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_str(self)
    }
}

#[cfg(feature = "schema")]
impl schemars::JsonSchema for ViewDirection {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "ViewDirection".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({"type": "string", "pattern": "^[a-z]+$|^-?[0-9.]+,-?[0-9.]+$"})
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_is_written_as_it_is_read_and_means_the_same() {
        for text in ["corner", "front", "bottom", "35,-20.5", "0.1,-0.3", "-359.999999,89.123456789"] {
            let read: ViewDirection = text.parse().unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(read.to_string(), text);
            assert_eq!(read.to_string().parse(), Ok(read));
        }
        assert_eq!(ViewDirection::default().to_string(), "corner");
    }

    #[test]
    fn other_text_is_refused_with_what_is_expected() {
        for text in ["", "10", "0,91", "nan,0", "1,2,3", "sideways"] {
            assert!(text.parse::<ViewDirection>().is_err_and(|e| e.contains("YAW,PITCH")), "{text}");
        }
    }
}
