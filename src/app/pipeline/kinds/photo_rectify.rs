//! `photo.rectify`: the map that makes lines straight and keeps shapes.

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::sizes::{CropWish, PixelSize, ProjectionWish, ViewAngles, ViewField};

/// Along which way a field of view is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum FovAxis {
    /// Horizontally
    #[default]
    #[value(alias = "horizontal")]
    H,
    /// Vertically
    #[value(alias = "vertical")]
    V,
    /// From corner to corner
    #[value(alias = "diagonal")]
    D,
}

/// Settings of `photo.rectify`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoRectifySettings {
    /// How directions become the picture: optimized, perspective, stereographic, panini, panini:D, mercator, cylindrical or equirectangular
    pub to: ProjectionWish,
    /// The lens: auto, a file (lensfun XML, OpenCV or Kalibr YAML, Gyroflow JSON, COLMAP cameras.txt, OCam, our JSON), or a model such as equidistant
    #[schemars(extend("format" = "lens"))]
    pub lens: String,
    /// Field of view, degrees, for a lens named by its model; found from lines or EXIF if left out
    #[schemars(range(min = 1.0, max = 360.0))]
    pub fov: Option<f64>,
    /// Along which way the field of view is measured
    pub fov_axis: FovAxis,
    /// Where the viewer looks: yaw, pitch and roll in degrees
    pub view: ViewAngles,
    /// How much the view shows, such as 100,75; all that the picture has if left out, and of panoramas 100,75
    pub view_field: Option<ViewField>,
    /// What is cut away: auto makes the border straight, or takes the largest full rectangle; rectangle, none, or a shape such as 3:2
    pub crop: CropWish,
    /// Size of the result, such as 1600x1200; as wide as the picture if left out
    pub size: Option<PixelSize>,
}

impl Default for PhotoRectifySettings {
    fn default() -> Self {
        Self {
            to: ProjectionWish::default(),
            lens: "auto".to_owned(),
            fov: None,
            fov_axis: FovAxis::default(),
            view: ViewAngles::default(),
            view_field: None,
            crop: CropWish::default(),
            size: None,
        }
    }
}

impl StageSettings for PhotoRectifySettings {
    const KIND: &'static str = "photo.rectify";
    const SUMMARY: &'static str = "finds the map that makes lines straight and keeps shapes";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture"),
        Port::any("lines", PortType::Lines, "lines to make straight"),
        Port::optional("faces", PortType::Faces, "faces to keep in shape"),
        Port::optional("importance", PortType::Importance, "where distortion would show"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("warp", PortType::Warp, "the map")];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn held(&self) -> Vec<Held> {
        vec![Held { what: "grid and factor", bytes: 64 << 20, ..Held::default() }]
    }
}
