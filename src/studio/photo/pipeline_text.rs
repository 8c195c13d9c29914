//! The pipeline file of a rectified photo: its text, and what the text says.
//!
//! An edit of a setting is an edit of the text, after which the text is read and checked as `plumbline run` does: comments, variables
//! and other stages stay, and what the studio accepts the program accepts.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use toml_edit::Value;

use crate::error::StudioError;
use crate::pipeline_file::{self, checked};
use plumbline_app::pipeline::file::literal_path;
use plumbline_app::pipeline::graph::Stage;
use plumbline_app::pipeline::paths::to_path;
use plumbline_app::pipeline::{self, Graph};
use plumbline_app::stages::{
    FacesDetectSettings, FacesLoadSettings, ImageLoadSettings, ImageRenderSettings, ImageSaveSettings,
    ImportanceSettings, LinesDetectSettings, LinesLoadSettings, PhotoRectifySettings,
};

/// Extensions that results keep; of other photos they are PNG.
const WRITTEN: [&str; 7] = ["jpg", "jpeg", "jpe", "jfif", "png", "tif", "tiff"];

/// A pipeline file with a stage `photo.rectify` over one photo.
#[derive(Clone, Debug)]
pub struct PipelineText {
    path: Arc<Path>,
    text: Arc<str>,
    read: Arc<Read>,
}

/// What the text says. Paths are absolute, or relative to the working directory.
#[derive(Clone, Debug, Default)]
pub struct Read {
    /// Settings of `image.load`.
    pub photo: ImageLoadSettings,
    /// Settings of `photo.rectify`.
    pub map: PhotoRectifySettings,
    /// Settings of `lines.detect`, where found lines are used.
    pub found: Option<LinesDetectSettings>,
    /// The file of marked lines.
    pub lines: Option<PathBuf>,
    /// Settings of `faces.detect`, where faces are found.
    pub faces_found: Option<FacesDetectSettings>,
    /// The file of faces.
    pub faces: Option<PathBuf>,
    /// The importance of each position is judged.
    pub importance: bool,
    /// Settings of `image.render`.
    pub render: ImageRenderSettings,
    /// Settings of `image.save`.
    pub save: ImageSaveSettings,
    names: Names,
}

/// Names of the stages that are edited.
#[derive(Clone, Debug, Default)]
struct Names {
    map: String,
    found: Option<String>,
    faces: Option<String>,
    render: String,
    save: String,
}

impl PartialEq for PipelineText {
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path && self.text == other.text
    }
}

/// A stage whose settings can be changed.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part {
    /// The map, `photo.rectify`.
    Map,
    /// The search for lines, where there is one.
    Found,
    /// The faces.
    Faces,
    /// The rendering.
    Render,
    /// The file that is written.
    Save,
}

/// A change of a setting; `None` leaves it to the default.
pub(super) type Change<'c> = (Part, &'c str, Option<Value>);

impl PipelineText {
    /// Reads and checks a text, which is or will be the file `path`.
    ///
    /// # Errors
    /// The first fault, with its line; a pipeline that rectifies no photo, or several.
    pub fn read(path: &Path, text: &str) -> Result<Self, StudioError> {
        let graph = checked(path, text)?;
        let read = Read::of(&graph).map_err(|why| StudioError::Input { path: path.to_owned(), why })?;
        Ok(Self { path: path.into(), text: text.into(), read: Arc::new(read) })
    }

    /// The file of a photo in the same folder that was not rectified yet.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn begin(path: &Path, photo: &Path, lines: &Path, faces: Option<&Path>) -> Result<Self, StudioError> {
        let name = |path: &Path| Value::from(literal_path(Path::new(path.file_name().unwrap_or_default()))).to_string();
        let stem = photo.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let extension = photo.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        let extension = if WRITTEN.contains(&extension.as_str()) { extension } else { "png".to_owned() };
        let output = PathBuf::from(format!("{stem}-straight.{extension}"));
        let faces = faces.map_or("use    = \"faces.detect\"\ninputs = [\"photo\"]\n".to_owned(), |faces| {
            format!("use    = \"faces.load\"\ninputs = [\"photo\"]\npath   = {}\n", name(faces).trim())
        });
        let (photo, lines, output) = (name(photo), name(lines), name(&output));
        Self::read(path, &template(photo.trim(), lines.trim(), &faces, output.trim()))
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What it says.
    pub fn said(&self) -> &Read {
        &self.read
    }

    /// The file of marked lines; beside the photo where the pipeline names none.
    pub fn lines_path(&self) -> Option<&Path> {
        self.read.lines.as_deref()
    }

    /// The text with other settings.
    ///
    /// # Errors
    /// [`StudioError::Request`] with the allowed values.
    pub(super) fn with<'c>(&'c self, changes: &[Change<'c>]) -> Result<Self, StudioError> {
        let of_stage = |(part, key, value): &Change<'c>| Some((self.read.names.of(*part)?, *key, value.clone()));
        let changes: Vec<_> = changes.iter().filter_map(of_stage).collect();
        pipeline_file::edited(&self.path, &self.text, &changes, Self::read)
    }

    /// The text that takes faces from a file.
    ///
    /// # Errors
    /// [`StudioError::Request`] where the pipeline has no faces.
    pub fn with_faces_of(&self, file: &Path) -> Result<Self, StudioError> {
        if self.read.faces.is_some() {
            return Ok(self.clone());
        }
        if self.read.names.faces.is_none() {
            return Err(StudioError::request("the pipeline has no stage of faces: add one of faces.load to it"));
        }
        let name = literal_path(Path::new(file.file_name().unwrap_or_default()));
        self.with(&[
            (Part::Faces, "use", Some("faces.load".into())),
            (Part::Faces, "min_score", None),
            (Part::Faces, "path", Some(name.into())),
        ])
    }

    /// The text that finds faces.
    ///
    /// # Errors
    /// [`StudioError::Request`].
    pub fn with_found_faces(&self) -> Result<Self, StudioError> {
        self.with(&[(Part::Faces, "use", Some("faces.detect".into())), (Part::Faces, "path", None)])
    }
}

impl Names {
    fn of(&self, part: Part) -> Option<&str> {
        match part {
            Part::Map => Some(&self.map),
            Part::Found => self.found.as_deref(),
            Part::Faces => self.faces.as_deref(),
            Part::Render => Some(&self.render),
            Part::Save => Some(&self.save),
        }
    }
}

impl Read {
    fn of(graph: &Graph) -> Result<Self, String> {
        let stages = &graph.stages;
        let found = stages.iter().position(|s| s.settings.get::<PhotoRectifySettings>().is_some());
        let at = found.ok_or("has no stage photo.rectify: the studio edits the rectification of a photo")?;
        let (map, name) = (&stages[at], |stage: &Stage| stage.name.clone());
        let mut read = Self { map: settings(map).unwrap_or_default(), ..Self::default() };
        read.names.map = name(map);
        let photo = source(stages, map, "image").and_then(settings::<ImageLoadSettings>);
        read.photo = photo.ok_or("the photo does not come from image.load: the studio opens photos that are files")?;
        read.add_lines(stages, map)?;
        if let Some(faces) = source(stages, map, "faces") {
            read.names.faces = Some(name(faces));
            read.faces = settings::<FacesLoadSettings>(faces).map(|s| to_path(&s.path));
            read.faces_found = settings(faces);
        }
        if let Some(importance) = source(stages, map, "importance") {
            read.importance = true;
            let plain = settings::<ImportanceSettings>(importance).is_some_and(|s| s.mask.is_none());
            if !plain || source(stages, importance, "faces").is_some() {
                return Err("importance comes from a mask or from faces, which the studio does not show".to_owned());
            }
        }
        let taker = |at: usize, is: fn(&Stage) -> bool| {
            stages.iter().position(|s| is(s) && s.edges.iter().any(|edge| edge.from == at))
        };
        let drawn = taker(at, |s| s.settings.get::<ImageRenderSettings>().is_some());
        let drawn = drawn.ok_or("the map is not rendered: no stage image.render takes it")?;
        let out = taker(drawn, |s| s.settings.get::<ImageSaveSettings>().is_some());
        let out = &stages[out.ok_or("the result is not written: no stage image.save takes it")?];
        (read.names.render, read.names.save) = (name(&stages[drawn]), name(out));
        (read.render, read.save) = (settings(&stages[drawn]).unwrap_or_default(), settings(out).unwrap_or_default());
        Ok(read)
    }

    /// Lines that are loaded, found, or found where none are loaded.
    fn add_lines(&mut self, stages: &[Stage], map: &Stage) -> Result<(), String> {
        let sources: Vec<&Stage> =
            map.edges.iter().filter(|edge| edge.port.name == "lines").map(|edge| &stages[edge.from]).collect();
        let Some(first) = sources.first() else { return Ok(()) };
        if sources.len() > 1 {
            return Err("lines come from several stages: the studio edits those of one".to_owned());
        }
        self.lines = lines_file(first);
        if let Some(found) = settings::<LinesDetectSettings>(first) {
            self.names.found = Some(first.name.clone());
            self.found = Some(found);
            self.lines = source(stages, first, "marked").and_then(lines_file);
        }
        Ok(())
    }
}

fn settings<S: pipeline::kind::Stage + Clone>(stage: &Stage) -> Option<S> {
    stage.settings.get::<S>().cloned()
}

/// The file of a stage that reads lines.
fn lines_file(stage: &Stage) -> Option<PathBuf> {
    settings::<LinesLoadSettings>(stage).map(|s| to_path(&s.path))
}

/// The stage that a port takes its data from.
fn source<'s>(stages: &'s [Stage], stage: &Stage, port: &str) -> Option<&'s Stage> {
    stage.edges.iter().find(|edge| edge.port.name == port).map(|edge| &stages[edge.from])
}

fn template(photo: &str, lines: &str, faces: &str, output: &str) -> String {
    format!(
        "# A photo rectified in the studio. `plumbline run` on this file writes the picture that the studio shows.
version = 1

[stage.photo]
use  = \"image.load\"
path = {photo}

[stage.lines]                              # marked by hand
use      = \"lines.load\"
inputs   = [\"photo\"]
path     = {lines}
optional = true                            # a missing file means that no lines are marked

[stage.found]                              # taken where no lines are marked
use    = \"lines.detect\"
inputs = {{ image = \"photo\", marked = \"lines\" }}
lens   = \"auto\"                            # as in the stage `map`

[stage.faces]
{faces}
[stage.saliency]
use    = \"image.importance\"
inputs = [\"photo\"]

[stage.map]                                # where each pixel comes from
use    = \"photo.rectify\"
inputs = {{ image = \"photo\", lines = [\"found\"], faces = \"faces\", importance = \"saliency\" }}
to     = \"optimized\"
lens   = \"auto\"
crop   = \"auto\"

[stage.drawn]                              # the only stage that samples pixels
use    = \"image.render\"
inputs = {{ image = \"photo\", warps = [\"map\"] }}

[stage.out]
use     = \"image.save\"
inputs  = [\"drawn\"]
path    = {output}
quality = 92
"
    )
}
