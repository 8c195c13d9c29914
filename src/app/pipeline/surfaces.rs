//! How meshes are deformed and looked at, as people write it: `arap-spokes`, `front`, `35,25`, `#204060`.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Deserializer;
use serde::{Deserialize, Serialize, Serializer};

use super::sizes::as_text;
use super::suggest::listed;
use super::units::number_or_text;
use plumbline_image::canvas::Rgb;
use plumbline_shape::draw::ViewDirection;
use plumbline_shape::surface::Method;

/// A method of deformation, by its name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MethodName(pub Method);

/// From where a mesh is looked at. Written `"corner"`, `"front"` … or `"YAW,PITCH"`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ViewWish {
    /// Three sides of a box are seen
    #[default]
    Corner,
    /// One of the words of [`ViewDirection::NAMED`]
    Named(&'static str),
    /// Degrees: to the model's left hand, and up
    Angles(f64, f64),
}

/// Color behind a mesh. Written `"#204060"`, `"white"` or `"black"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BackgroundColor(pub Rgb);

impl MethodName {
    /// Names of all methods.
    pub fn all() -> Vec<&'static str> {
        Method::ALL.iter().map(|m| m.name()).collect()
    }
}

impl FromStr for MethodName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let unknown = || format!("`{text}` is no method of deformation (expected {})", listed(&Self::all()));
        Method::from_name(text.trim()).map(Self).ok_or_else(unknown)
    }
}

impl fmt::Display for MethodName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.name())
    }
}

impl ViewWish {
    /// The direction that is meant.
    pub fn direction(self) -> ViewDirection {
        match self {
            Self::Corner => ViewDirection::default(),
            Self::Named(name) => ViewDirection::named(name).unwrap_or_default(),
            Self::Angles(yaw, pitch) => ViewDirection::degrees(yaw, pitch),
        }
    }
}

impl FromStr for ViewWish {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if let Some((name, ..)) = ViewDirection::NAMED.iter().find(|(name, ..)| *name == text) {
            return Ok(if *name == "corner" { Self::Corner } else { Self::Named(name) });
        }
        let names = ViewDirection::NAMED.map(|(name, ..)| name);
        let wrong = || {
            let words = listed(&names);
            format!("`{text}` is no direction (expected {words}, or YAW,PITCH in degrees: -360 to 360, -90 to 90)")
        };
        let (yaw, pitch) = text.split_once(',').ok_or_else(wrong)?;
        let angle = |t: &str, most: f64| t.trim().parse::<f64>().ok().filter(|a| (-most..=most).contains(a));
        let angles = angle(yaw, 360.0).zip(angle(pitch, 90.0));
        angles.map(|(yaw, pitch)| Self::Angles(yaw, pitch)).ok_or_else(wrong)
    }
}

impl fmt::Display for ViewWish {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Corner => f.write_str("corner"),
            Self::Named(name) => f.write_str(name),
            Self::Angles(yaw, pitch) => write!(f, "{yaw},{pitch}"),
        }
    }
}

impl FromStr for BackgroundColor {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is no color (expected white, black, gray, or #RRGGBB such as #204060)");
        let hex = match text.trim() {
            "white" => "ffffff",
            "black" => "000000",
            "gray" => "808080",
            other => other.strip_prefix('#').filter(|h| h.len() == 6 && h.is_ascii()).ok_or_else(wrong)?,
        };
        let part = |i: usize| u8::from_str_radix(&hex[i..i + 2], 16).map_err(|_| wrong());
        Ok(Self([part(0)?, part(2)?, part(4)?]))
    }
}

impl fmt::Display for BackgroundColor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.0;
        write!(f, "#{r:02x}{g:02x}{b:02x}")
    }
}

as_text! {
    ViewWish: "a direction such as \"front\" or \"35,25\"", "^[a-z]+$|^-?[0-9.]+,-?[0-9.]+$";
    BackgroundColor: "a color such as \"white\" or \"#204060\"", "^white$|^black$|^gray$|^#[0-9a-fA-F]{6}$";
}

impl<'de> Deserialize<'de> for MethodName {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        number_or_text(d, "the name of a method of deformation")
    }
}

impl Serialize for MethodName {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_str(self)
    }
}

impl JsonSchema for MethodName {
    fn schema_name() -> Cow<'static, str> {
        "MethodName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": "string", "enum": Self::all()})
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_back_and_nonsense_is_refused_with_what_is_expected() {
        for method in Method::ALL {
            assert_eq!(method.name().parse(), Ok(MethodName(method)));
        }
        for text in ["corner", "front", "bottom", "35,-20.5"] {
            assert_eq!(text.parse::<ViewWish>().map(|v| v.to_string()).as_deref(), Ok(text));
        }
        assert_eq!("white".parse::<BackgroundColor>().map(|c| c.to_string()).as_deref(), Ok("#ffffff"));
        assert!("arab".parse::<MethodName>().is_err_and(|e| e.contains("`arap-spokes`")));
        for text in ["", "10", "0,91", "nan,0", "1,2,3", "sideways"] {
            assert!(text.parse::<ViewWish>().is_err_and(|e| e.contains("YAW,PITCH")), "{text}");
        }
        for text in ["", "#12345", "#12345g", "red", "#ééé"] {
            assert!(text.parse::<BackgroundColor>().is_err_and(|e| e.contains("#204060")), "{text}");
        }
    }
}
