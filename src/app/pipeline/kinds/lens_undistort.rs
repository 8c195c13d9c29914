//! `lens.undistort`: one map for a whole clip that takes out its lens.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{MapStep, Stage, TemporalScope};
use crate::pipeline::memory::MemoryCost;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::port_value::{HandedOn, Wired};
use crate::pipeline::run_error::RunError;
use crate::pipeline::sizes::{CropWish, PixelSize, ProjectionWish, ViewAngles};
use crate::pipeline::stages;
use crate::stages::context::Context;
use plumbline_camera::FieldAxis;

/// Settings of `lens.undistort`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LensUndistortSettings {
    /// The lens: auto (the focal length that the clip tells, or fov), a file (lensfun XML, OpenCV or Kalibr YAML, Gyroflow JSON, COLMAP cameras.txt, OCam, our JSON), or a model such as equidistant
    #[schemars(extend("format" = "lens"))]
    pub lens: String,
    /// Field of view, degrees, for a lens named by its model
    #[schemars(range(min = 1.0, max = 360.0))]
    pub fov: Option<f64>,
    /// Along which way the field of view is measured
    pub fov_axis: FieldAxis,
    /// How directions become the picture: perspective, stereographic, panini, panini:D, mercator, cylindrical, equirectangular or optimized
    pub to: ProjectionWish,
    /// Where the viewer looks: yaw, pitch and roll in degrees
    pub view: ViewAngles,
    /// What is cut away: auto keeps the clip's shape, none keeps a curved border, or a shape such as 16:9
    pub crop: CropWish,
    /// Size of the result, such as 1920x1080; that of the clip if left out
    pub size: Option<PixelSize>,
}

impl Default for LensUndistortSettings {
    fn default() -> Self {
        Self {
            lens: String::new(),
            fov: None,
            fov_axis: FieldAxis::default(),
            to: ProjectionWish::Perspective,
            view: ViewAngles::default(),
            crop: CropWish::default(),
            size: None,
        }
    }
}

impl Stage for LensUndistortSettings {
    const KIND: &'static str = "lens.undistort";
    const SUMMARY: &'static str = "finds the one map that takes a lens out of every frame";
    const INPUTS: &'static [Port] = &[Port::one("frames", PortType::Frames, "the clip, for the size of its pictures")];
    const OUTPUTS: &'static [Port] = &[Port::one("warp", PortType::Warp, "the map")];
    const REQUIRED: &'static [&'static str] = &["lens"];
    const MAP: Option<MapStep> = Some(MapStep::Lens);
    type Input = Wired;
    type Output = HandedOn;

    fn over_time(&self) -> TemporalScope {
        TemporalScope::Once
    }

    fn held(&self) -> Vec<MemoryCost> {
        vec![MemoryCost { what: "grid of the map", bytes: 16 << 20, ..MemoryCost::default() }]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        stages::lens_undistort(context, stage, self).map(|()| HandedOn)
    }
}
