//! `video.motion_export`: writes motion, cameras and points for other programs and later runs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{Conflict, Stage};
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::port_value::{HandedOn, Wired};
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages;
use crate::stages::context::Context;

/// Settings of `video.motion_export`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MotionExportSettings {
    /// A motion file (JSON, `plumbline.motion`), which `video.motion_import` reads again
    #[schemars(extend("format" = "path"))]
    pub path: Option<String>,
    /// A folder for COLMAP models, as text and binary; with a folder in it per shot where several have cameras
    #[schemars(extend("format" = "path"))]
    pub colmap: Option<String>,
    /// A glTF scene of the cameras and points: `.glb`, or `.gltf` with its numbers embedded
    #[schemars(extend("format" = "path"))]
    pub gltf: Option<String>,
    /// A table with one line per frame
    #[schemars(extend("format" = "path"))]
    pub csv: Option<String>,
}

impl Stage for MotionExportSettings {
    const KIND: &'static str = "video.motion_export";
    const SUMMARY: &'static str = "writes motion, cameras and points: for a later run, and for other programs";
    const INPUTS: &'static [Port] = &[
        Port::one("motion", PortType::Motion, "motion, and the cameras if they are known"),
        Port::one("tracks", PortType::Tracks, "the points of every frame"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the files")];
    type Input = Wired;
    type Output = HandedOn;

    fn conflicts(&self) -> Vec<Conflict> {
        let nothing = self.writes().is_empty() && self.colmap.is_none();
        let message = "it writes nothing".to_owned();
        let help = "give `path`, `colmap`, `gltf` or `csv`";
        nothing.then_some(Conflict { key: "path", message, help }).into_iter().collect()
    }

    fn writes(&self) -> Vec<String> {
        [&self.path, &self.gltf, &self.csv].into_iter().flatten().cloned().collect()
    }

    fn fills(&self) -> Vec<&str> {
        self.colmap.as_deref().into_iter().collect()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        stages::motion_export(context, stage, self).map(|()| HandedOn)
    }

    fn preflight(&self) -> Result<(), RunError> {
        stages::preflight_motion_export(self)
    }
}
