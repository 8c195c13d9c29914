//! `mesh.save`: writes a mesh.

use std::path::Path;

use super::files::try_begin;
use super::mesh::animated::animated;
use super::mesh::mesh_error;
use super::prelude::*;
use super::values::{Posed, not_finite};
use crate::pipeline::paths::to_path;
use plumbline_shape::mesh::io::{WriteOptions, encode_model, losses};
use plumbline_shape::mesh::{MeshError, MeshFormat, Model};

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

impl Stage for MeshSaveSettings {
    const KIND: &'static str = "mesh.save";
    const SUMMARY: &'static str = "writes a mesh with what its file contained: polygons, texture coordinates, groups";
    const INPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = (Posed,);
    type Output = (Written,);

    fn writes(&self) -> Vec<String> {
        self.files()
    }

    fn preflight(&self) -> Result<(), RunError> {
        let format = format_of(&to_path(&self.path))?;
        if self.seconds.is_some() && !matches!(format, MeshFormat::Gltf | MeshFormat::Glb) {
            let name = &self.path;
            return Err(RunError::Usage(format!("`{name}` has no movement (`seconds` needs .glb or .gltf)")));
        }
        try_begin(&to_path(&self.files()[0]))
    }

    fn run(&self, (posed,): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let format = format_of(&to_path(&self.path))?;
        let (files, poses) = (self.files(), posed.poses.len().max(1));
        let wanted = self.frames.max(1) as usize;
        if wanted != poses {
            let name = context.name();
            let message = format!("`{name}` is to write {wanted} poses, but the mesh has {poses}");
            return Err(RunError::Usage(format!("{message}; set `frames` of both stages alike")));
        }
        if self.seconds.is_some() {
            check_targets(poses, posed.model.mesh().vertex_count())?;
        }
        let options = WriteOptions { ascii: self.ascii };
        for lost in losses(&posed.model, format) {
            context.warn(format!("{format} cannot store {lost}"));
        }
        for (i, file) in files.iter().enumerate() {
            context.job.check_cancel()?;
            let path = &to_path(file);
            let moved = match self.seconds {
                Some(seconds) => Some(moving(context, &posed, seconds, path)),
                None => posed.poses.get(i).map(|pose| posed.model.with_positions(pose.clone())),
            };
            let moved = moved.transpose().map_err(|e| not_finite(&e))?;
            let model = moved.as_ref().unwrap_or(&posed.model);
            let bytes = encode_model(model, format, &options, &context.job.run()).map_err(|e| mesh_error(path, &e))?;
            context.write_file(path, bytes)?;
        }
        Ok((Written,))
    }
}

/// Largest number of poses in one file: each key has a weight for each of them.
const MAX_TARGETS: usize = 4096;
/// Largest number of vertices of all morph targets together: 800 MB in the file, with normals.
const MAX_TARGET_VERTICES: usize = 1 << 25;

/// Refuses more morph targets than a file should have.
fn check_targets(poses: usize, vertices: usize) -> Result<(), RunError> {
    if poses <= MAX_TARGETS && poses.saturating_mul(vertices) <= MAX_TARGET_VERTICES {
        return Ok(());
    }
    let fault = format!("{poses} poses of {vertices} vertices are too many for morph targets of one file");
    let most = format!("at most {MAX_TARGETS} poses, and {MAX_TARGET_VERTICES} vertices of all together");
    Err(RunError::Usage(format!("{fault} ({most}); write fewer frames, or a file for each (.ply, .obj, or a folder)")))
}

/// All poses as one model that goes through them.
fn moving(context: &mut Context<'_, '_>, posed: &Posed, seconds: f64, path: &Path) -> Result<Model, MeshError> {
    if posed.model.articulation().is_some() {
        context.warn(format!("{}: this movement replaces those that the mesh had", path.display()));
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    animated(&posed.model, &posed.poses, seconds, &name)
}

fn format_of(path: &Path) -> Result<MeshFormat, RunError> {
    let format = MeshFormat::of_name(path).filter(|f| f.is_writable());
    format.ok_or_else(|| {
        let name = path.display();
        RunError::Usage(format!(
            "the extension of `{name}` names no format to write (expected .obj, .ply, .off, .stl, .gltf or .glb)"
        ))
    })
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

    #[test]
    fn morph_targets_are_bounded() {
        assert!(check_targets(4096, 8192).is_ok());
        for (poses, vertices) in [(4097, 3), (4096, 8193), (2, usize::MAX)] {
            let refused = check_targets(poses, vertices).expect_err("too many").to_string();
            assert!(refused.contains("too many for morph targets of one file (at most 4096 poses"), "{refused}");
        }
    }
}
