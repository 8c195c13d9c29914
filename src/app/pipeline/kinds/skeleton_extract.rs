//! `skeleton.extract`: the curve in the middle of a surface, and joints on it, its own or those of a template.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};
use plumbline_shape::character::extraction::ExtractionOptions;

/// Settings of `skeleton.extract`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SkeletonExtractSettings {
    /// The file to write: .json (with the curve), .glb or .gltf (bound to the surface), .tgf, .skel or .bvh
    #[schemars(extend("format" = "path"))]
    pub path: Option<String>,
    /// About how many joints; as many as bends, ends and junctions need if left out
    #[schemars(range(min = 1, max = 10_000))]
    pub joints: Option<u32>,
    /// Branches whose end sticks out of the rest of the shape by less than this share of its own half-width are taken away
    #[schemars(range(min = 0, max = 100))]
    pub prune: f64,
    /// Ends that stay: "auto", the tips of the surface, or a file with numbers of vertices, from 0
    pub keep: Option<String>,
    /// A skeleton whose joints are fitted to the curve (json glb gltf bvh tgf skel); its names, parents and limits stay, and `joints` does
    /// not count
    #[schemars(extend("format" = "path"))]
    pub template: Option<String>,
    /// A folder for the surface after each round of contraction, as .obj
    #[schemars(extend("format" = "path"))]
    pub contraction_frames: Option<String>,
}

impl Default for SkeletonExtractSettings {
    fn default() -> Self {
        let prune = ExtractionOptions::default().prune;
        Self { path: None, joints: None, prune, keep: None, template: None, contraction_frames: None }
    }
}

impl SkeletonExtractSettings {
    /// The file that `keep` names.
    pub fn keep_file(&self) -> Option<&str> {
        self.keep.as_deref().filter(|keep| *keep != "auto")
    }
}

impl StageSettings for SkeletonExtractSettings {
    const KIND: &'static str = "skeleton.extract";
    const SUMMARY: &'static str = "finds the curve in the middle of a surface by contraction, and joints on it";
    const INPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the surface; it may be open or in parts")];
    const OUTPUTS: &'static [Port] = &[
        Port::one("skeleton", PortType::Skeleton, "the skeleton"),
        Port::one("file", PortType::File, "the file, where one is named"),
    ];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn reads(&self) -> Vec<&str> {
        self.keep_file().into_iter().chain(self.template.as_deref()).collect()
    }

    fn writes(&self) -> Vec<String> {
        self.path.iter().cloned().collect()
    }
}
