//! `morph`: the shapes between two meshes.

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{Conflict, OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};
use plumbline_shape::morph::correspondence::{CorrespondenceMethod, DiskOptions, RegistrationOptions, SphereOptions};

/// How one mesh is laid over another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum OverWish {
    /// Deformed smoothly until it lies there: any mesh, never flawless
    #[default]
    Registration,
    /// Through the sphere: closed meshes without handles, one to one
    Sphere,
    /// Through the disk: meshes with one boundary and without handles, one to one
    Disk,
}

impl OverWish {
    /// The option of the method.
    pub fn option(self) -> CorrespondenceMethod {
        match self {
            Self::Registration => CorrespondenceMethod::Registration(RegistrationOptions::default()),
            Self::Sphere => CorrespondenceMethod::Sphere(SphereOptions::default()),
            Self::Disk => CorrespondenceMethod::Disk(DiskOptions::default()),
        }
    }
}

/// Settings of `morph`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MorphSettings {
    /// Places of both meshes that belong together, for meshes that are not two poses of one (`plumbline schema landmarks`, .cons
    /// or .yml)
    #[schemars(extend("format" = "path"))]
    pub landmarks: Option<String>,
    /// Shapes, both meshes among them
    #[schemars(range(min = 2, max = 9999))]
    pub frames: u32,
    /// Rounds in which each shape is made more rigid towards both meshes
    #[schemars(range(min = 0, max = 10_000))]
    pub rounds: u32,
    /// Rounds at most in which a shape that passes through itself is pushed out of itself
    #[schemars(range(min = 0, max = 1000))]
    pub untangle: u32,
    /// How the first mesh is laid over the second: by deforming it, over the sphere (closed meshes without handles, one to
    /// one), or over the disk (meshes with one boundary and without handles, one to one)
    pub over: OverWish,
    /// Whole turns added to how the surface turns as a whole: -1 makes 90 degrees the other way 270
    #[schemars(range(min = -100, max = 100))]
    pub whole_turns: i32,
    /// With landmarks: vertices are added until no feature of the second mesh is missed by more than this share of its size;
    /// none if left out
    #[schemars(range(min = 0.0001, max = 1.0))]
    pub refine: Option<f64>,
    /// Also write how it went, as JSON
    #[schemars(extend("format" = "path"))]
    pub report: Option<String>,
}

impl Default for MorphSettings {
    fn default() -> Self {
        Self {
            landmarks: None,
            frames: 9,
            rounds: 10,
            untangle: 8,
            over: OverWish::default(),
            whole_turns: 0,
            refine: None,
            report: None,
        }
    }
}

impl StageSettings for MorphSettings {
    const KIND: &'static str = "morph";
    const SUMMARY: &'static str = "finds the shapes between two meshes, as rigid towards both as can be";
    const INPUTS: &'static [Port] = &[
        Port::one("mesh", PortType::Mesh, "the mesh at time 0, whose faces all shapes have"),
        Port::one("other", PortType::Mesh, "the mesh at time 1"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the shapes")];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn conflicts(&self) -> Vec<Conflict> {
        let by_landmarks = [("over", self.over != OverWish::default()), ("refine", self.refine.is_some())];
        let asked = by_landmarks.into_iter().filter(|(_, is_given)| *is_given && self.landmarks.is_none());
        let message =
            "without landmarks the meshes are two poses of one, and neither is laid over the other".to_owned();
        asked
            .map(|(key, _)| Conflict { key, message: message.clone(), help: "give `landmarks`, or leave it out" })
            .collect()
    }

    fn reads(&self) -> Vec<&str> {
        self.landmarks.iter().map(String::as_str).collect()
    }

    fn writes(&self) -> Vec<String> {
        self.report.iter().cloned().collect()
    }
}
