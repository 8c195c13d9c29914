//! `video.smooth`: plans the virtual camera.

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{Conflict, OverTime, StageSettings};
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};

/// How the virtual camera moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum PathMethod {
    /// The smoothest path that keeps the picture inside the crop budget: rests, even pans and soft turns
    #[default]
    Optimal,
    /// The camera's own path, low-passed
    Gaussian,
    /// On a line at even speed, turning evenly
    Linear,
    /// Evenly accelerated, on a parabola
    Parabolic,
    /// The camera stands still
    Tripod,
    /// In space, on a circle about what the camera looks at; without cameras there, as linear
    Orbit,
    /// In space, on a line at even speed, looking in one direction; without cameras there, as linear
    Dolly,
}

/// How the picture is enlarged to hide the borders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Zoom {
    /// One zoom for the whole clip
    Fixed,
    /// A zoom that changes slowly with the need
    #[default]
    Adaptive,
    /// No zoom: borders may show
    None,
}

/// What is made of cameras in space, where they were recovered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum InSpace {
    /// Shot by shot, they are smoothed in space where that comes out no worse than in the picture
    #[default]
    Auto,
    /// They are smoothed in space
    Always,
    /// Only their turning is smoothed, as if nothing were near
    Turn,
}

/// Settings of `video.smooth`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SmoothSettings {
    /// How the virtual camera moves
    pub method: PathMethod,
    /// The horizon stays level, as far as the crop allows
    pub horizon: bool,
    /// Time over which motion is evened out, seconds
    #[schemars(range(min = 0.05, max = 30.0))]
    pub smoothness: f64,
    /// Least part of the picture's width and height that must stay, 1 = all
    #[schemars(range(min = 0.3, max = 1.0))]
    pub min_crop: f64,
    /// How the picture is enlarged to hide the borders
    pub zoom: Zoom,
    /// Room kept between the picture and the border of the source, as a part of the picture's width: the mesh needs it to bend the border
    #[schemars(range(min = 0.0, max = 0.1))]
    pub reserve: f64,
    /// What is made of cameras in space, where video.motion recovered them
    pub in_space: InSpace,
    /// Wanted cameras, and the input's to align them by: this file says the path, not the method
    #[schemars(extend("format" = "path"))]
    pub path_file: Option<String>,
    /// The picture may not show anything outside the source; false where the renderer fills its borders
    pub keep_inside: bool,
}

impl Default for SmoothSettings {
    fn default() -> Self {
        let (method, zoom) = (PathMethod::default(), Zoom::default());
        let in_space = InSpace::default();
        Self {
            method,
            horizon: false,
            smoothness: 0.5,
            min_crop: 0.8,
            zoom,
            reserve: 0.01,
            in_space,
            path_file: None,
            keep_inside: true,
        }
    }
}

impl StageSettings for SmoothSettings {
    const KIND: &'static str = "video.smooth";
    const SUMMARY: &'static str = "plans the path of the virtual camera under a crop budget";
    const INPUTS: &'static [Port] = &[
        Port::one("motion", PortType::Motion, "motion of the real camera"),
        Port::optional("tracks", PortType::Tracks, "points of the clip, for virtual cameras in space"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("path", PortType::Path, "path of the virtual camera")];

    fn over_time(&self) -> OverTime {
        OverTime::Reduce
    }

    fn conflicts(&self) -> Vec<Conflict> {
        let help = "choose `fixed` or `adaptive`, or let borders show (`--border mirror`, `keep_inside = false`)";
        let message = "`zoom` = \"none\" leaves no room to move the picture while no border may show".to_owned();
        let stuck = self.zoom == Zoom::None && self.keep_inside;
        stuck.then_some(Conflict { key: "zoom", message, help }).into_iter().collect()
    }

    fn held(&self) -> Vec<Held> {
        // One homography and one crop per frame, and the optimizer's rows of the same order.
        vec![Held { what: "path", bytes_per_clip_frame: 80.0, ..Held::default() }]
    }
}
