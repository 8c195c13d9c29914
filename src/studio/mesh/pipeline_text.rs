//! The pipeline file of a deformation: its text, and what the text says.
//!
//! An edit of a setting is an edit of the text, after which the text is read and checked as `plumbline run` does: comments, variables
//! and other stages stay, and what the studio accepts the program accepts.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value as Json;
use toml_edit::Value;

use crate::error::StudioError;
use crate::pipeline_file::{self, Change, checked, setting};
use plumbline_app::pipeline::file::literal_path;
use plumbline_app::pipeline::paths::to_path;
use plumbline_app::pipeline::{self, Graph};
use plumbline_app::stages::{MeshDeformSettings, MeshLoadSettings, MeshSaveSettings};

/// A pipeline file with a stage `mesh.deform`.
#[derive(Clone, Debug)]
pub struct PipelineText {
    path: Arc<Path>,
    text: Arc<str>,
    read: Arc<Read>,
}

/// What the text says.
#[derive(Debug)]
struct Read {
    deform: String,
    save: Option<String>,
    settings: MeshDeformSettings,
    output: Option<MeshSaveSettings>,
    mesh: PathBuf,
}

impl PartialEq for PipelineText {
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path && self.text == other.text
    }
}

impl PipelineText {
    /// Reads and checks a text, which is or will be the file `path`.
    ///
    /// # Errors
    /// The first fault, with its line; a pipeline that deforms no mesh, or one that is not read from a file.
    pub fn read(path: &Path, text: &str) -> Result<Self, StudioError> {
        let graph = checked(path, text)?;
        let read = Read::of(&graph).map_err(|why| StudioError::Input { path: path.to_owned(), why })?;
        Ok(Self { path: path.into(), text: text.into(), read: Arc::new(read) })
    }

    /// The file of a new deformation of a mesh in the same folder.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn begin(path: &Path, mesh: &Path, handles: &Path) -> Result<Self, StudioError> {
        let name = |path: &Path| Value::from(literal_path(Path::new(path.file_name().unwrap_or_default()))).to_string();
        let stem = mesh.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let written = ["obj", "ply", "off", "stl", "gltf", "glb"];
        let extension = mesh.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        let extension = if written.contains(&extension.as_str()) { extension } else { "obj".to_owned() };
        let output = PathBuf::from(format!("{stem}-deformed.{extension}"));
        let text = format!(
            "# A deformation made in the studio. `plumbline run` on this file writes the mesh that the studio shows.\n\
             version = 1\n\n\
             [stage.mesh]\nuse  = \"mesh.load\"\npath = {}\n\n\
             [stage.posed]\nuse     = \"mesh.deform\"\ninputs  = [\"mesh\"]\nhandles = {}\n\n\
             [stage.out]\nuse    = \"mesh.save\"\ninputs = [\"posed\"]\npath   = {}\n",
            name(mesh).trim(),
            name(handles).trim(),
            name(&output).trim(),
        );
        Self::read(path, &text)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Settings of the deformation.
    pub fn settings(&self) -> &MeshDeformSettings {
        &self.read.settings
    }

    /// Settings of the stage that writes the result, if there is one.
    pub fn output(&self) -> Option<&MeshSaveSettings> {
        self.read.output.as_ref()
    }

    /// The mesh.
    pub fn mesh(&self) -> &Path {
        &self.read.mesh
    }

    /// The file of handles.
    pub fn handles(&self) -> PathBuf {
        to_path(&self.read.settings.handles)
    }

    /// The text with another setting of the deformation; null leaves it to the default.
    ///
    /// # Errors
    /// [`StudioError::Request`] with the allowed range.
    pub fn with_setting(&self, key: &str, value: &Json) -> Result<Self, StudioError> {
        if ["handles", "use", "inputs", "enable", "report"].contains(&key) {
            return Err(StudioError::request(format!("`{key}` is not set here")));
        }
        self.edited(&[(&self.read.deform, key, setting(key, value)?)])
    }

    /// The text with another number of poses, in the stage that writes them too; `seconds` for one file that moves.
    ///
    /// # Errors
    /// [`StudioError::Request`].
    pub fn with_frames(&self, frames: u32, seconds: Option<f64>) -> Result<Self, StudioError> {
        let count = (frames != 1).then(|| Value::from(i64::from(frames)));
        let mut all = vec![(self.read.deform.as_str(), "frames", count.clone())];
        if let Some(save) = self.read.save.as_deref() {
            all.extend([(save, "frames", count), (save, "seconds", seconds.map(Value::from))]);
        }
        self.edited(&all)
    }

    /// The text with another file to write.
    ///
    /// # Errors
    /// [`StudioError::Request`].
    pub fn with_output(&self, name: &str) -> Result<Self, StudioError> {
        let save = self.read.save.as_deref();
        let save =
            save.ok_or_else(|| StudioError::request("the pipeline has no stage mesh.save that takes the result"))?;
        let file = Path::new(name).components().count() == 1 && Path::new(name).file_name().is_some();
        if !file {
            return Err(StudioError::request(format!(
                "`{name}` is not a file name (expected NAME.obj, beside the pipeline)"
            )));
        }
        self.edited(&[(save, "path", Some(literal_path(Path::new(name)).into()))])
    }

    fn edited(&self, changes: &[Change<'_>]) -> Result<Self, StudioError> {
        pipeline_file::edited(&self.path, &self.text, changes, Self::read)
    }
}

impl Read {
    fn of(graph: &Graph) -> Result<Self, String> {
        let stages = &graph.stages;
        let deform = stages.iter().position(|s| s.settings.get::<MeshDeformSettings>().is_some());
        let deform = deform.ok_or("has no stage mesh.deform: the studio edits the deformation of a mesh")?;
        let settings = stages[deform].settings.get::<MeshDeformSettings>().cloned().unwrap_or_default();
        let source = stages[deform].edges.first().map(|edge| &stages[edge.from]);
        let load = source.and_then(|s| s.settings.get::<MeshLoadSettings>());
        let load = load.ok_or_else(|| {
            let name = source.map_or_else(String::new, |s| format!(" `{}` ({})", s.name, s.kind.name));
            format!("the mesh comes from stage{name}: the studio opens meshes that mesh.load reads")
        })?;
        let takes = |s: &&pipeline::graph::Stage| s.edges.iter().any(|edge| edge.from == deform);
        let save = stages.iter().filter(takes).find(|s| s.settings.get::<MeshSaveSettings>().is_some());
        Ok(Self {
            deform: stages[deform].name.clone(),
            save: save.map(|s| s.name.clone()),
            settings,
            output: save.and_then(|s| s.settings.get()).cloned(),
            mesh: to_path(&load.path),
        })
    }
}
