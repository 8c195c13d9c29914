//! Questions and exports.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Value, json};

use super::document::MeshDocument;
use super::handle_text;
use super::pipeline_text::PipelineText;
use super::solver::Solver;
use super::state::SolveState;
use crate::error::StudioError;
use crate::tar;
use crate::workspace::Answer;
use plumbline_app::stages::{self, MeshDeformSettings, animated_model};
use plumbline_num::run::Run;
use plumbline_shape::mesh::io::{WriteOptions, encode_model};
use plumbline_shape::mesh::{MeshFormat, Model};

/// A question, or an export.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields))]
#[serde(tag = "ask", rename_all = "snake_case", deny_unknown_fields)]
#[expect(missing_docs, reason = "fields are what they are named; what they do is said of the question")]
pub enum Ask {
    /// The schema of the settings of the deformation: names, texts, ranges, words, defaults.
    Schema,
    /// The mesh as it is shown, solved to the end: `obj`, `ply`, `off`, `stl`, `gltf`, `glb`.
    Export {
        format: String,
        #[serde(default)]
        ascii: Option<bool>,
    },
    /// All frames: one moving `glb` or `gltf`, or a `tar` of files of another format.
    ExportFrames {
        format: String,
        #[serde(default)]
        seconds: Option<f64>,
    },
    /// The file of handles.
    ExportHandles,
    /// How the solve went, as JSON.
    Report,
    /// The equivalent command line.
    Command,
}

/// What is asked about.
pub struct Asked<'a> {
    /// The document.
    pub document: &'a MeshDocument,
    /// Its mesh.
    pub model: &'a Model,
    /// The surface that is shown.
    pub solver: &'a mut Solver,
    /// How a long answer runs.
    pub run: &'a Run,
}

/// The answer.
///
/// # Errors
/// Why there is none.
pub fn answer(asked: &mut Asked<'_>, ask: Ask) -> Result<Answer, StudioError> {
    match ask {
        Ask::Schema => schema(),
        Ask::Export { format, ascii } => export(asked, &format, ascii == Some(true)),
        Ask::ExportFrames { format, seconds } => export_frames(asked, &format, seconds),
        Ask::ExportHandles => {
            let name = asked.document.pipeline.handles();
            let name = name.file_name().unwrap_or_default().to_string_lossy().into_owned();
            Ok(Answer::Download { name, bytes: handle_text::write(asked.document).into_bytes() })
        }
        Ask::Report => report(asked),
        Ask::Command => Ok(Answer::Value(json!({ "command": command(&asked.document.pipeline) }))),
    }
}

fn schema() -> Result<Answer, StudioError> {
    let kind = stages::find("mesh.deform").ok_or_else(|| StudioError::Method("mesh.deform is no stage".to_owned()))?;
    let mut schema = (kind.schema)();
    let defaults = serde_json::to_value(MeshDeformSettings::default()).unwrap_or_default();
    schema["defaults"] = defaults;
    Ok(Answer::Value(schema))
}

fn format_named(name: &str) -> Result<MeshFormat, StudioError> {
    let format = MeshFormat::of_name(Path::new(&format!("x.{name}"))).filter(|f| f.is_writable());
    format.ok_or_else(|| {
        StudioError::request(format!("`{name}` is no format to write (expected obj, ply, off, stl, gltf or glb)"))
    })
}

fn stem(pipeline: &PipelineText) -> String {
    pipeline.mesh().file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn method(error: impl std::fmt::Display) -> StudioError {
    StudioError::Method(error.to_string())
}

fn export(asked: &mut Asked<'_>, format: &str, ascii: bool) -> Result<Answer, StudioError> {
    let of = format_named(format)?;
    asked.solver.finish(asked.document, asked.run)?;
    let positions = asked.solver.carried_back(asked.solver.shown());
    let moved = asked.model.with_positions(positions).map_err(method)?;
    let bytes = encode_model(&moved, of, &WriteOptions { ascii }, asked.run).map_err(method)?;
    Ok(Answer::Download { name: format!("{}-deformed.{format}", stem(&asked.document.pipeline)), bytes })
}

fn export_frames(asked: &mut Asked<'_>, format: &str, seconds: Option<f64>) -> Result<Answer, StudioError> {
    let of = format_named(format)?;
    asked.solver.finish(asked.document, asked.run)?;
    let frames = asked.solver.frames();
    if frames.len() < 2 {
        return Err(StudioError::request("there is one pose alone: set the number of frames to 2 or more"));
    }
    let poses: Vec<_> = frames.iter().map(|pose| asked.solver.carried_back(pose)).collect();
    let stem = stem(&asked.document.pipeline);
    if matches!(of, MeshFormat::Gltf | MeshFormat::Glb) {
        let (first, last) = asked.document.times();
        let seconds = seconds.or(asked.document.pipeline.output().and_then(|o| o.seconds)).unwrap_or(last - first);
        if !(0.001..=86_400.0).contains(&seconds) {
            return Err(StudioError::request(format!("{seconds} seconds are invalid (expected 0.001 to 86400)")));
        }
        let moving = animated_model(asked.model, &poses, seconds, &stem).map_err(method)?;
        let bytes = encode_model(&moving, of, &WriteOptions::default(), asked.run).map_err(method)?;
        return Ok(Answer::Download { name: format!("{stem}-frames.{format}"), bytes });
    }
    let mut files = Vec::with_capacity(poses.len());
    for (k, pose) in poses.into_iter().enumerate() {
        let moved = asked.model.with_positions(pose).map_err(method)?;
        let bytes = encode_model(&moved, of, &WriteOptions::default(), asked.run).map_err(method)?;
        files.push((format!("{stem}-deformed_{k:04}.{format}"), bytes));
    }
    let bytes =
        tar::archive(&files).ok_or_else(|| StudioError::request("the name of the mesh is too long for an archive"))?;
    Ok(Answer::Download { name: format!("{stem}-frames.tar"), bytes })
}

fn report(asked: &mut Asked<'_>) -> Result<Answer, StudioError> {
    asked.solver.finish(asked.document, asked.run)?;
    let (mesh, settings) = (asked.model.mesh(), asked.document.pipeline.settings());
    let value = json!({
        "mesh": { "file": file_name(asked.document.pipeline.mesh()), "vertices": mesh.vertex_count(), "triangles": mesh.triangle_count() },
        "repair": asked.solver.solvable.report,
        "settings": settings,
        "solve": SolveState::new(asked.solver),
        "energies": asked.solver.report.as_ref().map(|r| r.energies.clone()),
    });
    let bytes = serde_json::to_vec_pretty(&value).map_err(method)?;
    Ok(Answer::Download { name: format!("{}-report.json", stem(&asked.document.pipeline)), bytes })
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The command that does what the pipeline file says, with the files as they are saved.
pub fn command(pipeline: &PipelineText) -> String {
    let settings = pipeline.settings();
    let output = pipeline.output().map(|o| plumbline_app::pipeline::paths::to_path(&o.path));
    if pipeline.output().is_none_or(|o| o.seconds.is_some() || o.ascii) {
        return format!("plumbline run {}", quoted(pipeline.path()));
    }
    let output = output.unwrap_or_else(|| PathBuf::from("deformed.obj"));
    let mut words = vec!["plumbline deform".to_owned(), quoted(pipeline.mesh()), "--handles".to_owned()];
    words.push(quoted(&pipeline.handles()));
    words.extend(options(settings));
    words.extend(["-o".to_owned(), quoted(&output)]);
    words.join(" ")
}

/// Settings that differ from their defaults, as options.
fn options(settings: &MeshDeformSettings) -> Vec<String> {
    let object = |s: &MeshDeformSettings| match serde_json::to_value(s) {
        Ok(Value::Object(map)) => map,
        _ => serde_json::Map::new(),
    };
    let (given, defaults) = (object(settings), object(&MeshDeformSettings::default()));
    let differs = |(key, value): &(&String, &Value)| *key != "handles" && defaults.get(*key) != Some(*value);
    let option = |(key, value): (&String, &Value)| {
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        [format!("--{}", key.replace('_', "-")), quoted(Path::new(&value))]
    };
    given.iter().filter(differs).flat_map(option).collect()
}

/// A word of a POSIX shell.
fn quoted(word: &Path) -> String {
    let text = word.to_string_lossy();
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+,:=@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) && !text.starts_with('-') {
        return text.into_owned();
    }
    let text = if text.starts_with('-') { format!("./{text}") } else { text.into_owned() };
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_the_shell_are_quoted_where_they_must() {
        let word = |text: &str| quoted(Path::new(text));
        assert_eq!(word("/a/b-1.obj"), "/a/b-1.obj");
        assert_eq!(word("it's here.obj"), r"'it'\''s here.obj'");
        assert_eq!(word("-x.obj"), "'./-x.obj'");
        assert_eq!(word("$HOME"), "'$HOME'");
    }
}
