//! `plumbline render`: pictures of meshes.

use std::path::{Path, PathBuf};

use clap::Args;

use super::failure::Failure;
use super::job::{JobArgs, batch, only_input};
use super::run::run_or_print;
use crate::pipeline::file::literal_path;
use crate::pipeline::kinds::{ImageSaveSettings, MeshLoadSettings, MeshRenderSettings, UpWish};
use crate::pipeline::reference::escape;
use crate::pipeline::sizes::PixelSize;
use crate::pipeline::surfaces::{BackgroundColor, ViewWish};
use crate::pipeline::{Backend, Exit, PipelineFile, StageEntry, number_for};

/// Options of `plumbline render`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("target").required(true).args(["output", "out_dir"]))]
#[expect(clippy::struct_excessive_bools, reason = "switches that do not depend on each other")]
pub(super) struct RenderArgs {
    /// Meshes (obj ply off stl gltf glb): files, globs, or folders
    #[arg(required = true, value_name = "MESH")]
    inputs: Vec<String>,
    /// The picture to write, for one mesh; its extension chooses the format: png, jpg, tif or webp
    #[arg(short, long, value_name = "OUTPUT")]
    output: Option<PathBuf>,
    /// The folder to write to; pictures are called as their meshes
    #[arg(long, value_name = "DIR")]
    out_dir: Option<PathBuf>,

    /// Size of the picture
    #[arg(long, default_value_t = MeshRenderSettings::default().size, value_name = "WxH", help_heading = "View")]
    size: PixelSize,
    /// From where: corner, front, back, left, right, top, bottom, or YAW,PITCH in degrees
    #[arg(long, default_value_t, value_name = "VIEW", allow_hyphen_values = true, help_heading = "View")]
    view: ViewWish,
    /// Which axis points up
    #[arg(long, value_enum, default_value_t, value_name = "AXIS", help_heading = "View")]
    up: UpWish,

    /// Edges as lines, of polygons without their diagonals
    #[arg(long, help_heading = "Look")]
    wireframe: bool,
    /// Triangles flat; else normals are smooth up to creases
    #[arg(long, help_heading = "Look")]
    flat: bool,
    /// The vertices' own colors, where the file has any
    #[arg(long, conflicts_with = "scalar", help_heading = "Look")]
    colors: bool,
    /// Numbers as colors: a NumPy file with one per vertex or triangle, or x, y or z
    #[arg(long, value_name = "FILE.npy|x|y|z", help_heading = "Look")]
    scalar: Option<String>,
    /// Faces seen from behind in another color
    #[arg(long, help_heading = "Look")]
    mark_back: bool,
    /// A skeleton inside the mesh: json (its curve is drawn too), glb, gltf, bvh, tgf or skel
    #[arg(long, value_name = "FILE", help_heading = "Look")]
    skeleton: Option<PathBuf>,
    /// How opaque the mesh is, 0 to 1; what lies behind shows through. 0.2 with `--skeleton`, else 1, if left out
    #[arg(long, value_name = "SHARE", help_heading = "Look")]
    #[arg(value_parser = |text: &str| number_for::<MeshRenderSettings>("opacity", text))]
    opacity: Option<f64>,
    /// One color behind the mesh: white, black, gray or #RRGGBB; a light gradient if left out
    #[arg(long, value_name = "COLOR", help_heading = "Look")]
    background: Option<BackgroundColor>,

    /// Meshes at work at once; 0 = as many as processors and memory allow
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=256))]
    jobs: u32,
    #[command(flatten)]
    job: JobArgs,
}

impl RenderArgs {
    pub(super) fn run(self, backend: &dyn Backend) -> Result<Exit, Failure> {
        run_or_print(self.pipeline()?, self.job.print_pipeline, backend)
    }

    /// The pipeline that the options mean.
    pub(super) fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let (source, target) = self.names()?;
        let render = MeshRenderSettings {
            size: self.size,
            view: self.view,
            up: self.up,
            flat: self.flat,
            wireframe: self.wireframe,
            colors: self.colors,
            scalar: self.scalar.as_ref().map(|s| escape(s)),
            mark_back: self.mark_back,
            skeleton: self.skeleton.as_ref().map(|path| literal_path(path)),
            opacity: self.opacity,
            background: self.background,
            ..MeshRenderSettings::default()
        };
        let load = MeshLoadSettings { path: source, ..MeshLoadSettings::default() };
        let save = ImageSaveSettings { path: target, ..ImageSaveSettings::default() };
        Ok(PipelineFile {
            name: Some("render".to_owned()),
            run: self.job.run(),
            batch: self.output.is_none().then(|| batch(&self.inputs, self.jobs)),
            stages: vec![
                StageEntry::built("mesh", &load),
                StageEntry::built("drawn", &render).input("mesh", "mesh"),
                StageEntry::built("picture", &save).input("image", "drawn"),
            ],
            ..PipelineFile::default()
        })
    }

    /// What is read and what is written.
    fn names(&self) -> Result<(String, String), Failure> {
        let Some(output) = &self.output else {
            let folder = literal_path(self.out_dir.as_deref().unwrap_or(Path::new(".")));
            let target = format!("{}/${{item.stem}}.png", folder.trim_end_matches('/'));
            return Ok(("${item.path}".to_owned(), target));
        };
        Ok((escape(only_input(&self.inputs, "meshes")?), literal_path(output)))
    }
}
