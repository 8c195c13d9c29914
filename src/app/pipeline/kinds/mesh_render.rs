//! `mesh.render`: draws a mesh.

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{Conflict, OverTime, StageSettings};
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::sizes::PixelSize;
use crate::pipeline::surfaces::{BackgroundColor, ViewWish};
use plumbline_shape::draw::UpAxis;

/// Which axis of the mesh points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum UpWish {
    /// +y up, the front looks along +z
    #[default]
    Y,
    /// +z up, the front looks along -y
    Z,
}

impl UpWish {
    /// The axis of the camera.
    pub fn axis(self) -> UpAxis {
        match self {
            Self::Y => UpAxis::Y,
            Self::Z => UpAxis::Z,
        }
    }
}

/// Settings of `mesh.render`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[expect(clippy::struct_excessive_bools, reason = "switches that do not depend on each other")]
pub struct MeshRenderSettings {
    /// Size of the picture, such as 1280x960
    pub size: PixelSize,
    /// From where: corner, front, back, left, right, top or bottom, or "YAW,PITCH" in degrees
    pub view: ViewWish,
    /// Which axis points up
    pub up: UpWish,
    /// Triangles flat; else normals are smooth up to creases
    pub flat: bool,
    /// Edges as lines, of polygons without their diagonals
    pub wireframe: bool,
    /// The vertices' own colors, where the file has any
    pub colors: bool,
    /// Numbers as colors: a NumPy file with one per vertex or triangle, or x, y, z, displacement or stretch
    pub scalar: Option<String>,
    /// Faces seen from behind in another color
    pub mark_back: bool,
    /// A skeleton inside: our own JSON (its curve is drawn too), glTF, GLB, BVH, .tgf or .skel
    #[schemars(extend("format" = "path"))]
    pub skeleton: Option<String>,
    /// How opaque the surface is, 0 to 1; what lies behind shows through. 0.2 with a skeleton, else 1, if left out
    #[schemars(range(min = 0, max = 1))]
    pub opacity: Option<f64>,
    /// Handles of a deformed mesh as dots: held ones dark, moved ones orange
    pub handles: bool,
    /// One color behind the mesh; a light gradient if left out
    pub background: Option<BackgroundColor>,
}

impl Default for MeshRenderSettings {
    fn default() -> Self {
        Self {
            size: PixelSize { width: 1280, height: 960 },
            view: ViewWish::default(),
            up: UpWish::default(),
            flat: false,
            wireframe: false,
            colors: false,
            scalar: None,
            mark_back: false,
            skeleton: None,
            opacity: None,
            handles: true,
            background: None,
        }
    }
}

impl MeshRenderSettings {
    /// Names of numbers that every mesh has, or every deformed one.
    pub const ATTRIBUTES: [&'static str; 5] = ["x", "y", "z", "displacement", "stretch"];

    /// How opaque the surface is drawn.
    pub fn drawn_opacity(&self) -> f64 {
        self.opacity.unwrap_or(if self.skeleton.is_some() { 0.2 } else { 1.0 })
    }

    /// The file that `scalar` names.
    pub fn scalar_file(&self) -> Option<&str> {
        self.scalar.as_deref().filter(|s| !Self::ATTRIBUTES.contains(s))
    }
}

impl StageSettings for MeshRenderSettings {
    const KIND: &'static str = "mesh.render";
    const SUMMARY: &'static str = "draws a mesh in its last pose, lit, with the camera fitted to it";
    const INPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh")];
    const OUTPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture, 8 bit")];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn held(&self) -> Vec<Held> {
        // Nine samples per pixel, each with a triangle and a depth; of translucent surfaces two layers of them, and depth and
        // opacity of twelve.
        let samples = if self.drawn_opacity() < 1.0 { 2 * 9 * 8 + 12 * 8 } else { 9 * 8 };
        let bytes = u64::from(self.size.width) * u64::from(self.size.height) * (samples + 6 + 16);
        vec![Held { what: "samples of the picture", bytes, ..Held::default() }]
    }

    fn conflicts(&self) -> Vec<Conflict> {
        let both = self.colors && self.scalar.is_some();
        let message = "`colors` and `scalar` color the same surface".to_owned();
        let help = "take one of both";
        if both { vec![Conflict { key: "colors", message, help }] } else { Vec::new() }
    }

    fn reads(&self) -> Vec<&str> {
        self.scalar_file().into_iter().chain(self.skeleton.as_deref()).collect()
    }
}
