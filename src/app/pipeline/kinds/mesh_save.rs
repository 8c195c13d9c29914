//! `mesh.save`: writes a mesh.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `mesh.save`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MeshSaveSettings {
    /// The file to write; its extension chooses the format: .obj, .ply, .off, .stl, .gltf or .glb
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// Poses to write, as many as the mesh has; of more than one, NAME_0000.EXT and so on
    #[schemars(range(min = 1, max = 9999))]
    pub frames: u32,
    /// Poses as morph targets of one .glb or .gltf, with an animation through them of so many seconds; if left out each is a file
    #[schemars(range(min = 0.001, max = 86_400.0))]
    pub seconds: Option<f64>,
    /// PLY and STL as text; binary if left out
    pub ascii: bool,
}

impl Default for MeshSaveSettings {
    fn default() -> Self {
        Self { path: String::new(), frames: 1, seconds: None, ascii: false }
    }
}

impl MeshSaveSettings {
    /// The file of each pose; one where it moves through all of them.
    pub fn files(&self) -> Vec<String> {
        if self.frames <= 1 || self.seconds.is_some() {
            return vec![self.path.clone()];
        }
        let path = Path::new(&self.path);
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let extension = path.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
        let file = |i: u32| path.with_file_name(format!("{stem}_{i:04}{extension}")).to_string_lossy().into_owned();
        (0..self.frames).map(file).collect()
    }
}

impl StageSettings for MeshSaveSettings {
    const KIND: &'static str = "mesh.save";
    const SUMMARY: &'static str = "writes a mesh with what its file held: polygons, texture coordinates, groups";
    const INPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["path"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn writes(&self) -> Vec<String> {
        self.files()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_poses_are_numbered_before_the_extension() {
        let files = |path: &str, frames| MeshSaveSettings { path: path.into(), frames, ..Default::default() }.files();
        assert_eq!(files("out/a.b.obj", 1), ["out/a.b.obj"]);
        assert_eq!(files("out/a.b.obj", 2), ["out/a.b_0000.obj", "out/a.b_0001.obj"]);
        let moving = MeshSaveSettings { path: "a.glb".into(), frames: 7, seconds: Some(2.0), ascii: false };
        assert_eq!(moving.files(), ["a.glb"]);
    }
}
