//! Projection and crop as people write them: `panini:0.8`, `16:9`.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Crop, Target};
use crate::aspect_ratio::AspectRatio;
use plumbline_camera::Projection;

/// Largest distance `d` of the eye of a Panini projection. Its scale `(d + 1) / (d + cos φ)` is there within a tenth of the
/// limit `d → ∞` up to 90° from the axis: more would change nothing that is seen.
const MAX_PANINI: f64 = 10.0;

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let fixed = match text {
            "optimized" | "optimised" => return Ok(Self::Optimized),
            "perspective" => Some(Projection::Rectilinear),
            "stereographic" => Some(Projection::Stereographic),
            "panini" => Some(Projection::Panini(1.0)),
            "mercator" => Some(Projection::Mercator),
            "cylindrical" => Some(Projection::Cylindrical),
            "equirectangular" => Some(Projection::Equirectangular),
            _ => {
                let distance = text.strip_prefix("panini:").and_then(|d| d.parse::<f64>().ok());
                distance.filter(|d| (0.0..=MAX_PANINI).contains(d)).map(Projection::Panini)
            }
        };
        fixed.map(Self::Fixed).ok_or_else(|| {
            format!(
                "`{text}` is no projection (expected optimized, perspective, stereographic, panini, panini:D with D from 0 to \
                 {MAX_PANINI}, mercator, cylindrical or equirectangular)"
            )
        })
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Optimized => f.write_str("optimized"),
            Self::Fixed(Projection::Rectilinear) => f.write_str("perspective"),
            Self::Fixed(Projection::Panini(1.0)) => f.write_str("panini"),
            Self::Fixed(Projection::Panini(distance)) => write!(f, "panini:{distance}"),
            Self::Fixed(other) => f.write_str(other.name()),
        }
    }
}

impl FromStr for Crop {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.trim() {
            "auto" => Ok(Self::Auto),
            "rectangle" => Ok(Self::Rectangle),
            "none" => Ok(Self::None),
            shape => shape.parse().map(Self::Aspect).map_err(|e| format!("{e}; or `auto`, `rectangle` or `none`")),
        }
    }
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Rectangle => f.write_str("rectangle"),
            Self::None => f.write_str("none"),
            Self::Aspect(ratio) => ratio.fmt(f),
        }
    }
}

/// Read from and written as text.
macro_rules! as_text {
    ($($name:ident: $pattern:literal;)*) => {$(
        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                String::deserialize(d)?.parse().map_err(serde::de::Error::custom)
            }
        }

        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
                s.collect_str(self)
            }
        }

        #[cfg(feature = "schema")]
        impl schemars::JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                schemars::json_schema!({"type": "string", "pattern": $pattern})
            }
        }
    )*};
}

as_text! {
    Target: "^[a-z]+(:[0-9.]+)?$";
    Crop: "^auto$|^rectangle$|^none$|^[0-9.]+:[0-9.]+$";
    AspectRatio: "^[0-9.]+:[0-9.]+$";
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip<T: FromStr<Err = String> + fmt::Display + PartialEq + fmt::Debug>(text: &str) {
        let value: T = text.parse().unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(value.to_string(), text);
        assert_eq!(value.to_string().parse::<T>().as_ref(), Ok(&value));
    }

    #[test]
    fn projections_and_crops_are_written_as_they_are_read() {
        for text in ["optimized", "perspective", "stereographic", "panini", "panini:0.8", "mercator", "cylindrical"] {
            round_trip::<Target>(text);
        }
        round_trip::<Target>("equirectangular");
        for text in ["auto", "rectangle", "none", "3:2"] {
            round_trip::<Crop>(text);
        }
        round_trip::<AspectRatio>("1.91:1");
    }

    #[test]
    fn other_text_is_refused_with_the_allowed_values() {
        assert!("fill".parse::<Crop>().is_err_and(|e| e.contains("`none`")));
        for text in ["panini:", "panini:11", "panini:nan", "fisheye"] {
            assert!(text.parse::<Target>().is_err_and(|e| e.contains("panini:D")), "{text}");
        }
        for text in ["0:1", "1:0", "nan:1", "1:1000", ":", "inf:inf"] {
            assert!(text.parse::<AspectRatio>().is_err_and(|e| e.contains("16:9")), "{text}");
        }
    }
}
