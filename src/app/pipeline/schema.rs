//! The JSON schemas of the formats that are read: of pipeline files (draft-07, for editors: one `if use = … then …` branch per
//! stage kind), and of the files that go with them.

use clap::ValueEnum;
use serde_json::{Map, Value as Json, json};

use super::file::VERSION;
use super::kind::{StageKind, schema_of};
use super::options::{BatchSettings, RunSettings};
use crate::stages::KINDS;
use plumbline_camera::lens_file_schema;
use plumbline_photo::marks::{faces_schema, lines_schema};
use plumbline_shape::character::pose_file::pose_file_schema;
use plumbline_shape::character::retargeting::joint_map_schema;
use plumbline_shape::character::skeleton_file::skeleton_file_schema;
use plumbline_shape::character::weights_file_schema;
use plumbline_shape::morph::composition::seam_schema;
use plumbline_shape::morph::correspondence::landmarks_schema;
use plumbline_shape::morph::paint::paint_schema;
use plumbline_shape::surface::handle_file::handle_file_schema;
use plumbline_video::motion::motion_file_schema;
use plumbline_video::stabilize::path_file_schema;

const NAME_PATTERN: &str = "^[a-z][a-z0-9_-]*$";

/// A format that has a schema.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum FileFormat {
    /// Pipeline files
    #[default]
    Pipeline,
    /// Lines marked in a picture, NAME.lines.json
    Lines,
    /// Faces marked in a picture
    Faces,
    /// Lenses, our own JSON
    Lens,
    /// How a camera moved, plumbline.motion
    Motion,
    /// Where the camera is wanted, for stabilize --path-file
    Path,
    /// Handles of a surface, for deform --handles
    Handles,
    /// Skeletons, plumbline.skeleton
    Skeleton,
    /// Poses of a character, for pose --pose
    Pose,
    /// Which joint follows which, for pose --map
    JointMap,
    /// Weights of a skin, plumbline.weights
    Weights,
    /// Corresponding points of two meshes, for morph and blend --landmarks
    Landmarks,
    /// Times painted on a mesh, for blend --paint
    Paint,
    /// Where two meshes are cut and joined, for compose --seam
    Seam,
}

/// The schema of a format.
pub fn schema_of_format(format: FileFormat) -> Json {
    match format {
        FileFormat::Pipeline => schema(),
        FileFormat::Lines => lines_schema().to_value(),
        FileFormat::Faces => faces_schema().to_value(),
        FileFormat::Lens => lens_file_schema(),
        FileFormat::Motion => motion_file_schema().to_value(),
        FileFormat::Path => path_file_schema().to_value(),
        FileFormat::Handles => handle_file_schema().to_value(),
        FileFormat::Skeleton => skeleton_file_schema().to_value(),
        FileFormat::Weights => weights_file_schema().to_value(),
        FileFormat::Pose => pose_file_schema().to_value(),
        FileFormat::JointMap => joint_map_schema().to_value(),
        FileFormat::Landmarks => landmarks_schema().to_value(),
        FileFormat::Paint => paint_schema().to_value(),
        FileFormat::Seam => seam_schema().to_value(),
    }
}

/// The schema of a whole pipeline file.
pub fn schema() -> Json {
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "plumbline pipeline",
        "type": "object",
        "required": ["version", "stage"],
        "additionalProperties": false,
        "properties": {
            "version": {"const": VERSION, "description": "Version of the format"},
            "name": {"type": "string", "description": "Names the run in messages"},
            "vars": {
                "description": "Values that stages refer to as ${vars.NAME}",
                "type": "object",
                "propertyNames": {"pattern": NAME_PATTERN},
                "additionalProperties": {"type": ["string", "number", "boolean", "array"]}
            },
            "run": table(&schema_of::<RunSettings>(&[])),
            "batch": table(&schema_of::<BatchSettings>(&["foreach"])),
            "stage": {
                "description": "The stages; their order has no meaning",
                "type": "object",
                "minProperties": 1,
                "propertyNames": {"pattern": NAME_PATTERN},
                "additionalProperties": stage()
            }
        }
    })
}

fn stage() -> Json {
    let names: Vec<&str> = KINDS.iter().map(|k| k.name).collect();
    let branches: Vec<Json> = KINDS.iter().map(branch).collect();
    json!({
        "type": "object",
        "required": ["use"],
        "properties": {"use": {"enum": names, "description": "Kind of the stage; `plumbline stages` describes them"}},
        "allOf": branches
    })
}

fn branch(kind: &StageKind) -> Json {
    let settings = (kind.schema)();
    let mut then = table(&settings);
    then["description"] = format!("Settings of `{}`.", kind.name).into();
    let properties = then["properties"].as_object_mut();
    if let Some(properties) = properties {
        properties.insert("use".into(), json!({"const": kind.name, "description": kind.summary}));
        properties.insert("inputs".into(), inputs(kind));
        properties.insert(
            "enable".into(),
            json!({"type": ["boolean", "string"], "description": "false leaves the stage out"}),
        );
    }
    then["required"] = kind.required.into();
    json!({"if": {"properties": {"use": {"const": kind.name}}}, "then": then})
}

fn inputs(kind: &StageKind) -> Json {
    let endpoint = json!({"type": "string", "pattern": "^[a-z][a-z0-9_-]*(\\.[a-z][a-z0-9_]*)?$"});
    let port = |p: &super::port::Port| {
        let many = json!({"type": "array", "items": endpoint, "description": p.doc});
        let one = json!({"type": "string", "pattern": endpoint["pattern"], "description": p.doc});
        (p.name.to_owned(), if p.arity.is_list() { many } else { one })
    };
    let ports: Map<String, Json> = kind.inputs.iter().map(port).collect();
    json!({
        "description": "Where the data comes from: a list in the order of the ports, or a table of ports",
        "anyOf": [{"type": "array", "items": endpoint}, {"type": "object", "properties": ports, "additionalProperties": false}]
    })
}

/// The schema of a settings struct, with a reference allowed for every value.
fn table(settings: &Json) -> Json {
    let empty = Map::new();
    let properties = settings["properties"].as_object().unwrap_or(&empty);
    let properties: Map<String, Json> = properties.iter().map(|(k, v)| (k.clone(), or_reference(v))).collect();
    let mut out = json!({"type": "object", "additionalProperties": false, "properties": properties});
    for key in ["required", "description"] {
        if let Some(value) = settings.get(key) {
            out[key] = value.clone();
        }
    }
    out
}

fn or_reference(property: &Json) -> Json {
    let reference = json!({"type": "string", "pattern": "^\\$\\{.*\\}$"});
    let mut outer = Map::new();
    let mut inner = property.clone();
    for key in ["description", "default"] {
        let taken = inner.as_object_mut().and_then(|o| o.remove(key));
        outer.extend(taken.filter(|v| !v.is_null()).map(|v| (key.to_owned(), v)));
    }
    outer.insert("anyOf".into(), json!([inner, reference]));
    Json::Object(outer)
}
