//! `video.motion_export`: writes motion, cameras and points for other programs and later runs.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::files::{cannot, filled, try_begin};
use super::prelude::*;
use crate::pipeline::Job;
use crate::pipeline::paths::to_path;
use plumbline_num::files::{AtomicFile, IfExists, publish_all};
use plumbline_video::motion::ClipMotion;
use plumbline_video::motion::exchange::{Container, colmap, write_csv, write_gltf};
use plumbline_video::stabilize::{StabilizeError, Tracks};

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
        let motion: &ClipMotion = context.values.get(context.required(stage, "motion")?)?;
        let tracks: &Tracks = context.values.get(context.required(stage, "tracks")?)?;
        let mut written = Written::new(context.job.if_exists());
        if let Some(path) = &self.path {
            written.file(&to_path(path), |out| Ok(motion.write_json_with_tracks(out, &tracks.store)?))?;
        }
        if let Some(folder) = &self.colmap {
            written.models(&to_path(folder), motion, tracks)?;
        }
        if let Some(path) = &self.gltf {
            let path = &to_path(path);
            written.file(path, |out| Ok(write_gltf(motion, Container::of(path), out)?))?;
        }
        if let Some(path) = &self.csv {
            written.file(&to_path(path), |out| Ok(write_csv(motion, out)?))?;
        }
        let warnings = std::mem::take(&mut written.warnings);
        let outputs = written.publish(context.job)?;
        context.summary.outputs.extend(outputs);
        for warning in warnings {
            context.warn(warning);
        }
        Ok(HandedOn)
    }

    fn preflight(&self) -> Result<(), RunError> {
        let files = [&self.path, &self.gltf, &self.csv].into_iter().flatten().map(|path| to_path(path));
        let files = files.chain(self.colmap.iter().map(|folder| to_path(folder).join(colmap::FILES[0].0)));
        files.into_iter().try_for_each(|path| try_begin(&path))
    }
}

type Fault = Box<dyn std::error::Error + Send + Sync>;

/// Files that are whole but have no names yet.
struct Written {
    if_exists: IfExists,
    files: Vec<(AtomicFile, PathBuf)>,
    /// Files of an earlier run that would be taken for these.
    stale: Vec<PathBuf>,
    /// Files and folders that the summary names.
    outputs: Vec<PathBuf>,
    warnings: Vec<String>,
}

impl Written {
    fn new(if_exists: IfExists) -> Self {
        Self { if_exists, files: Vec::new(), stale: Vec::new(), outputs: Vec::new(), warnings: Vec::new() }
    }

    fn file(&mut self, path: &Path, write: impl FnOnce(&mut dyn Write) -> Result<(), Fault>) -> Result<(), RunError> {
        self.outputs.push(path.to_owned());
        self.unlisted(path, write)
    }

    fn unlisted(
        &mut self,
        path: &Path,
        write: impl FnOnce(&mut dyn Write) -> Result<(), Fault>,
    ) -> Result<(), RunError> {
        self.files.push((filled(path, self.if_exists, |out| write(out))?, path.to_owned()));
        Ok(())
    }

    /// The models of the shots: in `folder` itself where there is one, else each in a folder of its own.
    fn models(&mut self, folder: &Path, motion: &ClipMotion, tracks: &Tracks) -> Result<(), RunError> {
        let models = colmap::models_of(motion, &tracks.store).map_err(StabilizeError::from)?;
        if models.is_empty() {
            let nothing = "nothing was written there: no shot has cameras in space to trust";
            self.warnings.push(format!("{}: {nothing}", folder.display()));
            return Ok(());
        }
        for (k, (_, model)) in models.iter().enumerate() {
            let folder = if models.len() == 1 { folder.to_owned() } else { folder.join(k.to_string()) };
            std::fs::create_dir_all(&folder).map_err(|e| cannot(&folder, &e))?;
            for (name, write) in colmap::FILES {
                self.unlisted(&folder.join(name), |out| Ok(write(model, out)?))?;
            }
        }
        if models.len() > 1 {
            // A model in the folder itself would be read instead of those in its folders.
            self.stale.extend(colmap::FILES.iter().map(|(name, _)| folder.join(name)).filter(|f| f.exists()));
        }
        self.outputs.push(folder.to_owned());
        Ok(())
    }

    fn publish(self, job: &Job<'_>) -> Result<Vec<PathBuf>, RunError> {
        let first = self.files.first().map(|(_, path)| path.clone()).unwrap_or_default();
        self.files.iter().try_for_each(|(unfinished, path)| job.publishing(unfinished.path(), path))?;
        publish_all(self.files, self.if_exists).map_err(|e| cannot(&first, &e))?;
        for path in self.stale {
            std::fs::remove_file(&path).map_err(|e| cannot(&path, &e))?;
        }
        Ok(self.outputs)
    }
}
