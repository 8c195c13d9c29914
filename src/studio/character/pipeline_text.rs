//! The pipeline file of a character: its text, and what the text says.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use toml_edit::Value;

use crate::error::StudioError;
use crate::pipeline_file::{self, Change, checked, setting};
use plumbline_app::pipeline::Graph;
use plumbline_app::pipeline::file::literal_path;
use plumbline_app::pipeline::graph::Stage;
use plumbline_app::pipeline::paths::to_path;
use plumbline_app::stages::{MeshLoadSettings, MeshSaveSettings, PoseSettings, SkeletonLoadSettings};

/// A pipeline file with a stage `character.pose` of a mesh and a skeleton that are read from files.
#[derive(Clone, Debug)]
pub struct PipelineText {
    path: Arc<Path>,
    text: Arc<str>,
    read: Arc<Read>,
}

impl PartialEq for PipelineText {
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path && self.text == other.text
    }
}

/// What the text says.
#[derive(Debug)]
struct Read {
    /// Names of the stages that are edited.
    pose: String,
    load: String,
    save: Option<String>,
    settings: PoseSettings,
    output: Option<MeshSaveSettings>,
    mesh: PathBuf,
    skeleton: PathBuf,
}

impl PipelineText {
    /// Reads the text of a pipeline file.
    ///
    /// # Errors
    /// [`StudioError::Input`]: the first fault with its line; a pipeline without a character, or whose mesh or skeleton is not read from
    /// a file.
    pub fn read(path: &Path, text: &str) -> Result<Self, StudioError> {
        let graph = checked(path, text)?;
        let read = Read::of(&graph).map_err(|why| StudioError::Input { path: path.to_owned(), why })?;
        Ok(Self { path: path.into(), text: text.into(), read: Arc::new(read) })
    }

    /// The file of a new character of a mesh in the same folder.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn begin(path: &Path, mesh: &Path, skeleton: &Path) -> Result<Self, StudioError> {
        let name = |path: &Path| Value::from(literal_path(Path::new(path.file_name().unwrap_or_default()))).to_string();
        let stem = mesh.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let output = PathBuf::from(format!("{stem}-posed.obj"));
        let text = format!(
            "# A character made in the studio. `plumbline run` on this file writes the pose that the studio shows.\n\
             version = 1\n\n\
             [stage.mesh]\nuse  = \"mesh.load\"\npath = {}\n\n\
             [stage.skeleton]\nuse  = \"skeleton.load\"\npath = {}\n\n\
             [stage.posed]\nuse    = \"character.pose\"\ninputs = [\"mesh\", \"skeleton\"]\n\n\
             [stage.out]\nuse    = \"mesh.save\"\ninputs = [\"posed\"]\npath   = {}\n",
            name(mesh).trim(),
            name(skeleton).trim(),
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

    /// Settings of `character.pose`.
    pub fn settings(&self) -> &PoseSettings {
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

    /// The file of the skeleton.
    pub fn skeleton(&self) -> &Path {
        &self.read.skeleton
    }

    /// The text with other settings of `character.pose`; null leaves one to its default.
    ///
    /// # Errors
    /// [`StudioError::Request`].
    pub fn with(&self, settings: &[(&str, serde_json::Value)]) -> Result<Self, StudioError> {
        let pose = self.read.pose.as_str();
        let changes = settings.iter().map(|(key, value)| Ok((pose, *key, setting(key, value)?)));
        self.edited(&changes.collect::<Result<Vec<_>, StudioError>>()?)
    }

    /// The text with another file of the skeleton.
    ///
    /// # Errors
    /// [`StudioError::Request`].
    pub fn with_skeleton(&self, file: &Path) -> Result<Self, StudioError> {
        self.edited(&[(&self.read.load, "path", Some(beside(&self.path, file).into()))])
    }

    /// The text for which a run writes so many poses of a clip, or one pose without a clip.
    ///
    /// # Errors
    /// [`StudioError::Request`].
    pub fn writing(&self, clip: Option<&str>, frames: u32) -> Result<Self, StudioError> {
        let count = (frames != 1).then(|| i64::from(frames).into());
        let pose = self.read.pose.as_str();
        let mut changes = vec![(pose, "clip", clip.map(Into::into)), (pose, "frames", count.clone())];
        if clip.is_some() {
            changes.push((pose, "pose", None));
        }
        if let Some(save) = &self.read.save {
            changes.push((save, "frames", count));
        }
        self.edited(&changes)
    }

    fn edited(&self, changes: &[Change<'_>]) -> Result<Self, StudioError> {
        pipeline_file::edited(&self.path, &self.text, changes, Self::read)
    }
}

/// A file as the pipeline file names it: by its name where it is beside it.
pub fn beside(pipeline: &Path, file: &Path) -> String {
    match (pipeline.parent(), file.parent(), file.file_name()) {
        (Some(a), Some(b), Some(name)) if a == b => literal_path(Path::new(name)),
        _ => literal_path(file),
    }
}

impl Read {
    fn of(graph: &Graph) -> Result<Self, String> {
        let stages = &graph.stages;
        let pose = stages.iter().position(|s| s.settings.get::<PoseSettings>().is_some());
        let pose = pose.ok_or("has no stage character.pose: the studio poses characters")?;
        let source =
            |port: &str| stages[pose].edges.iter().find(|edge| edge.port.name == port).map(|edge| &stages[edge.from]);
        let load = source("mesh").and_then(|s| s.settings.get::<MeshLoadSettings>());
        let load = load.ok_or("the mesh of character.pose is not read by mesh.load")?;
        let rig = source("skeleton").filter(|s| s.settings.get::<SkeletonLoadSettings>().is_some());
        let rig = rig.ok_or("the skeleton of character.pose is not read by skeleton.load")?;
        let skeleton = rig.settings.get::<SkeletonLoadSettings>().map(|s| to_path(&s.path)).unwrap_or_default();
        let takes = |s: &&Stage| s.edges.iter().any(|edge| edge.from == pose);
        let save = stages.iter().filter(takes).find(|s| s.settings.get::<MeshSaveSettings>().is_some());
        Ok(Self {
            pose: stages[pose].name.clone(),
            load: rig.name.clone(),
            settings: stages[pose].settings.get::<PoseSettings>().cloned().unwrap_or_default(),
            save: save.map(|s| s.name.clone()),
            output: save.and_then(|s| s.settings.get::<MeshSaveSettings>()).cloned(),
            mesh: to_path(&load.path),
            skeleton,
        })
    }
}
