//! `pose`: a character in another pose, or in the poses of a movement.

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{Conflict, OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};
use plumbline_shape::character::skinning::SkinningMethod;
use plumbline_shape::character::weights::WeightMethod;

/// How the surface follows the joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum SkinningWish {
    /// Linear blend: as every viewer does; collapses under twist
    Lbs,
    /// Dual quaternions: keep the radius under twist, bulge at bends
    #[default]
    Dqs,
    /// Optimized centers of rotation: neither
    Cor,
    /// Dual quaternions where joints twist, linear where they swing
    Mixed,
    /// As a model has learnt from examples
    Regression,
}

impl SkinningWish {
    /// The method; none of its own for what a model has learnt.
    pub fn method(self) -> Option<SkinningMethod> {
        match self {
            Self::Lbs => Some(SkinningMethod::LinearBlend),
            Self::Dqs => Some(SkinningMethod::DualQuaternion),
            Self::Cor => Some(SkinningMethod::CentersOfRotation),
            Self::Mixed => Some(SkinningMethod::TwistSwing),
            Self::Regression => None,
        }
    }
}

/// How a surface is bound to a skeleton.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum BindingWish {
    /// As heat that comes from the nearest bones in sight and spreads along the surface
    #[default]
    Heat,
    /// As smoothly as bounds of 0 and 1 allow, rigid about the middles of bones
    #[serde(alias = "bbw")]
    #[value(alias = "bbw")]
    Biharmonic,
    /// By distance to the bones alone, through the surface
    Distance,
}

impl BindingWish {
    /// The method.
    pub fn method(self) -> WeightMethod {
        match self {
            Self::Heat => WeightMethod::Heat,
            Self::Biharmonic => WeightMethod::BoundedBiharmonic,
            Self::Distance => WeightMethod::Distance,
        }
    }
}

/// Settings of `pose`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PoseSettings {
    /// The pose: a pose file (JSON; `plumbline schema pose` describes it)
    #[schemars(extend("format" = "path"))]
    pub pose: Option<String>,
    /// The movement, by its name
    pub clip: Option<String>,
    /// How the surface follows the joints
    pub skinning: SkinningWish,
    /// The trained model (.skin) for regression, of this mesh and skeleton
    #[schemars(extend("format" = "path"))]
    pub model: Option<String>,
    /// How a surface without a skin is bound to the skeleton
    pub binding: BindingWish,
    /// A file of weights in place of `binding` (JSON; `plumbline schema weights` describes it)
    #[schemars(extend("format" = "path"))]
    pub weights: Option<String>,
    /// Keep the details that the surface has at rest, as they turn with the joints; the number holds it to the skinned surface: 1
    /// as strongly as neighbors hold each other, less lets it leave further
    #[schemars(range(min = 1e-9, max = 1e9))]
    pub details: Option<f64>,
    /// Poses: of a movement from its start to its end, of a pose file from rest to the pose; 1: the last alone
    #[schemars(range(min = 1, max = 9999))]
    pub frames: u32,
    /// Where the movement begins, s; its first key if left out
    pub start: Option<f64>,
    /// Where the movement ends, s; its last key if left out
    pub end: Option<f64>,
    /// Steps toward the targets of a pose file, at most
    #[schemars(range(min = 1, max = 100_000))]
    pub iterations: u32,
    /// The output keeps its skeleton and movements, and stands in the pose by its joints: for .glb and .gltf, which are then
    /// shown with linear blend
    pub rig: bool,
}

impl Default for PoseSettings {
    fn default() -> Self {
        Self {
            pose: None,
            clip: None,
            skinning: SkinningWish::default(),
            model: None,
            binding: BindingWish::default(),
            weights: None,
            details: None,
            frames: 1,
            start: None,
            end: None,
            iterations: 200,
            rig: false,
        }
    }
}

impl StageSettings for PoseSettings {
    const KIND: &'static str = "pose";
    const SUMMARY: &'static str = "puts a character into a pose, or through a movement";
    const INPUTS: &'static [Port] = &[
        Port::one("mesh", PortType::Mesh, "the surface: with a skin, or to be bound to the skeleton"),
        Port::optional("skeleton", PortType::Skeleton, "the skeleton, where the file of the surface has none"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the surface in its poses")];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn conflicts(&self) -> Vec<Conflict> {
        let conflict = |key, message: &str, help| Conflict { key, message: message.to_owned(), help };
        let mut found = Vec::new();
        if self.pose.is_some() && self.clip.is_some() {
            let help = "name the clip in the pose file (`from`), or leave one out";
            found.push(conflict("clip", "a pose file and a clip are both given", help));
        }
        if self.rig && self.frames > 1 {
            found.push(conflict(
                "rig",
                "a rig is one file, and several frames are asked for",
                "leave out `frames` or `rig`",
            ));
        }
        if (self.skinning == SkinningWish::Regression) != self.model.is_some() {
            let help = "give `skinning = \"regression\"` and `model`, or neither";
            found.push(conflict("model", "regression and a trained model belong together", help));
        }
        if self.rig && self.model.is_some() {
            found.push(conflict("rig", "a rig follows its joints by linear blend", "leave out `rig` or `model`"));
        }
        for (key, time) in [("start", self.start), ("end", self.end)] {
            if let Some(time) = time.filter(|t| !t.is_finite()) {
                found.push(conflict(key, &format!("{time} is no time"), "give a number of seconds"));
            }
        }
        if let (Some(start), Some(end)) = (self.start, self.end)
            && !(start <= end)
        {
            found.push(conflict("end", "it is before the start", "give an `end` that is not before `start`"));
        }
        found
    }

    fn reads(&self) -> Vec<&str> {
        self.pose.iter().chain(&self.model).chain(&self.weights).map(String::as_str).collect()
    }
}
