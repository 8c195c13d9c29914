//! `plumbline morph`: interpolation between two meshes. Builds the same graph as `pipeline/morph.toml`.

use std::path::{Path, PathBuf};

use super::mesh_stages::mesh;
use super::prelude::*;
use crate::pipeline::number_for;
use crate::stages::{MeshSaveSettings, MorphSettings};
use plumbline_shape::mesh::MeshFormat;

/// Options of `plumbline morph`.
#[derive(Debug, Args)]
pub(super) struct MorphArgs {
    /// The mesh at the beginning, whose faces all shapes have
    #[arg(value_name = "FIRST")]
    first: PathBuf,
    /// The mesh at the end: another pose of the first, or any mesh with --landmarks
    #[arg(value_name = "SECOND")]
    second: PathBuf,
    /// A folder, for morph_0000.EXT and so on; a .glb or .gltf file, animated through all shapes; or another file, for
    /// NAME_0000.EXT
    #[arg(short, long, value_name = "FOLDER|FILE")]
    output: PathBuf,

    /// Duration of the animation in a .glb or .gltf file, in seconds
    #[arg(long, default_value_t = 2.0, value_name = "S")]
    #[arg(value_parser = |text: &str| number_for::<MeshSaveSettings>("seconds", text))]
    seconds: f64,
    #[command(flatten)]
    morph: Given<Morph>,
}

/// Options for `mesh.morph`.
struct Morph;

impl Offer for Morph {
    type Kind = MorphSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("frames"),
        Setting::of("landmarks").under("Method"),
        Setting::of("refine").value("FRACTION").requires("landmarks").under("Method"),
        Setting::of("iterations").under("Method"),
        Setting::of("untangle").under("Method"),
        Setting::of("over").requires("landmarks").under("Method"),
        Setting::of("full_rotations").signed().under("Method"),
        Setting::of("report").value("FILE.html|FILE.json"),
    ];
}

impl BuildsPipeline for MorphArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let morph = &self.morph.settings;
        let path = in_folder(&self.output, &self.first, "morph");
        // In a folder every shape is a file, of whatever format.
        let moves =
            path == self.output && matches!(MeshFormat::of_name(&path), Some(MeshFormat::Glb | MeshFormat::Gltf));
        let seconds = moves.then_some(self.seconds);
        let save = MeshSaveSettings { path: literal_path(&path), frames: morph.frames, seconds, ..Default::default() };
        let stages = vec![
            mesh("first", literal_path(&self.first)),
            mesh("second", literal_path(&self.second)),
            StageEntry::built("shapes", morph).input("mesh", "first").input("other", "second"),
            StageEntry::built("out", &save).input("mesh", "shapes"),
        ];
        Ok(PipelineFile::built("morph", stages))
    }
}

/// The file that a folder means: of the format of the first mesh where that is written, else PLY.
pub(super) fn in_folder(output: &Path, first: &Path, name: &str) -> PathBuf {
    let ends = |c: char| output.to_string_lossy().ends_with(c);
    if output.extension().is_some() && !ends('/') && !output.is_dir() {
        return output.to_owned();
    }
    let known = MeshFormat::of_name(first).is_some_and(MeshFormat::is_writable);
    let extension = first.extension().filter(|_| known).map_or_else(|| "ply".into(), |e| e.to_string_lossy());
    output.join(format!("{name}.{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_means_files_of_the_format_that_was_read() {
        let means = |output: &str, first: &str| in_folder(Path::new(output), Path::new(first), "morph");
        assert_eq!(means("frames/", "a.obj"), Path::new("frames/morph.obj"));
        assert_eq!(means("frames", "a.off"), Path::new("frames/morph.off"));
        assert_eq!(means("frames", "a.mesh"), Path::new("frames/morph.ply"));
        assert_eq!(means("x/b.stl", "a.obj"), Path::new("x/b.stl"));
    }
}
