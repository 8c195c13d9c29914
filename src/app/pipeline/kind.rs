//! A stage kind: its name, ports, settings and behavior over time, as one table row per kind.
//!
//! The settings are a plain struct with doc comments. The comments become the help of `plumbline stages` and the texts of the
//! JSON schema; ranges are in the schema attributes and are enforced from there, so help, editor and check cannot disagree.

use std::any::Any;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::{Arc, Mutex};

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::memory::MemoryCost;
use super::port::Port;
use super::port_value::{Inputs, Outputs, inputs_fit, outputs_fit};
use super::run_error::RunError;
use crate::stages::context::Context;

/// How a stage's result depends on time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TemporalScope {
    /// One frame in, one frame out.
    Map,
    /// A frame needs this many frames around it.
    Window(u32),
    /// The result needs the whole clip, so it ends a pass.
    Reduce,
    /// The result is there before the first frame.
    Once,
}

/// What a map does, in the order in which maps can be applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum MapStep {
    /// It takes a lens out of a clip.
    Lens,
    /// It stabilizes a clip.
    Steady,
    /// It changes the shape of a clip.
    Shape,
    /// It is of a still picture.
    Photo,
}

/// Settings that exclude each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Conflict {
    /// The setting to point at.
    pub key: &'static str,
    /// What is wrong.
    pub message: String,
    /// What to do.
    pub help: &'static str,
}

/// A stage kind: its settings, what is true of every stage of the kind, and what a stage of it does.
///
/// `Default` gives every setting that a file leaves out; `REQUIRED` names those that a file must give.
pub trait Stage:
    Serialize + DeserializeOwned + JsonSchema + Default + PartialEq + Debug + Send + Sync + 'static
{
    /// The name after `use =`.
    const KIND: &'static str;
    /// Names that it had in earlier versions: files may still use them, and no listing shows them.
    const ALIASES: &'static [&'static str] = &[];
    /// What the stage does, in one line.
    const SUMMARY: &'static str;
    /// What it takes; a list of inputs fills them in this order.
    const INPUTS: &'static [Port];
    /// What it gives; the first is meant by the stage's bare name.
    const OUTPUTS: &'static [Port];
    /// What `run` takes: the values at its input ports, in their order.
    type Input: Inputs;
    /// What `run` gives: the values at its output ports, in their order.
    type Output: Outputs;
    /// Settings without a default.
    const REQUIRED: &'static [&'static str] = &[];
    /// It interpolates pixels; at most one such stage may be on the path of a picture.
    const RESAMPLES: bool = false;
    /// What the map that it gives does, where a render stage must know.
    const MAP: Option<MapStep> = None;

    /// How the result depends on time.
    fn over_time(&self) -> TemporalScope {
        Self::Input::OVER_TIME
    }

    /// The memory that it needs while it runs.
    fn memory(&self) -> Vec<MemoryCost> {
        Vec::new()
    }

    /// Settings that exclude each other.
    fn conflicts(&self) -> Vec<Conflict> {
        Vec::new()
    }

    /// Files it reads.
    fn reads(&self) -> Vec<&str> {
        Vec::new()
    }

    /// Files it writes.
    fn writes(&self) -> Vec<String> {
        Vec::new()
    }

    /// Folders that it fills with files.
    fn fills(&self) -> Vec<&str> {
        Vec::new()
    }

    /// Refuses what must fail at the end, before any work is done.
    ///
    /// # Errors
    /// [`RunError::Output`] or [`RunError::Usage`] where a file cannot be written.
    fn preflight(&self) -> Result<(), RunError> {
        Ok(())
    }

    /// Does the work of one stage in one pass.
    ///
    /// # Errors
    /// Whatever went wrong; no file may be left under its final name unless it is whole.
    fn run(&self, input: Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError>;
}

/// A stage of a kind known at run time; [`dyn Settings::get`] gives back the typed struct.
pub trait Settings: Any + Debug + Send + Sync {
    /// See [`Stage::over_time`].
    fn over_time(&self) -> TemporalScope;
    /// See [`Stage::memory`].
    fn memory(&self) -> Vec<MemoryCost>;
    /// See [`Stage::conflicts`].
    fn conflicts(&self) -> Vec<Conflict>;
    /// See [`Stage::reads`].
    fn reads(&self) -> Vec<&str>;
    /// See [`Stage::writes`].
    fn writes(&self) -> Vec<String>;
    /// See [`Stage::fills`].
    fn fills(&self) -> Vec<&str>;
    /// See [`Stage::preflight`].
    ///
    /// # Errors
    /// See [`Stage::preflight`].
    fn preflight(&self) -> Result<(), RunError>;
    /// Takes what is at the input ports of stage number `stage`, runs it, and hands on what it gives.
    ///
    /// # Errors
    /// See [`Stage::run`].
    fn run(&self, context: &mut Context<'_, '_>, stage: usize) -> Result<(), RunError>;
    /// Every setting, defaults included.
    fn to_json(&self) -> serde_json::Value;
}

impl<S: Stage> Settings for S {
    fn over_time(&self) -> TemporalScope {
        Stage::over_time(self)
    }

    fn memory(&self) -> Vec<MemoryCost> {
        Stage::memory(self)
    }

    fn conflicts(&self) -> Vec<Conflict> {
        Stage::conflicts(self)
    }

    fn reads(&self) -> Vec<&str> {
        Stage::reads(self)
    }

    fn writes(&self) -> Vec<String> {
        Stage::writes(self)
    }

    fn fills(&self) -> Vec<&str> {
        Stage::fills(self)
    }

    fn preflight(&self) -> Result<(), RunError> {
        Stage::preflight(self)
    }

    fn run(&self, context: &mut Context<'_, '_>, stage: usize) -> Result<(), RunError> {
        context.at = stage;
        let input = S::Input::take(context, stage, S::INPUTS)?;
        let output = Stage::run(self, input, context)?;
        output.put(context, stage, S::OUTPUTS);
        Ok(())
    }

    fn to_json(&self) -> serde_json::Value {
        serde_json::to_value(self).unwrap_or_default()
    }
}

impl dyn Settings {
    /// The settings as `S`; `None` for a stage of another kind.
    pub fn get<S: Stage>(&self) -> Option<&S> {
        (self as &dyn Any).downcast_ref()
    }
}

/// One row of the registry.
#[derive(Clone, Copy, Debug)]
pub struct StageKind {
    /// The name after `use =`.
    pub name: &'static str,
    /// Earlier names, which files may still use.
    pub aliases: &'static [&'static str],
    /// What the stage does, in one line.
    pub summary: &'static str,
    /// What it takes.
    pub inputs: &'static [Port],
    /// What it gives; never empty.
    pub outputs: &'static [Port],
    /// Settings without a default.
    pub required: &'static [&'static str],
    /// It interpolates pixels.
    pub resamples: bool,
    /// What the map that it gives does.
    pub map: Option<MapStep>,
    /// Reads settings from JSON; settings that are left out take their defaults.
    pub parse: fn(serde_json::Value) -> Result<Arc<dyn Settings>, serde_json::Error>,
    /// The JSON schema (draft-07) of the settings, without references.
    pub schema: fn() -> serde_json::Value,
}

impl StageKind {
    /// The row of `S`.
    pub const fn of<S: Stage>() -> Self {
        const {
            assert!(inputs_fit(S::INPUTS, <S::Input as Inputs>::FITS), "`run` takes other values than the ports carry");
            assert!(
                outputs_fit(S::OUTPUTS, <S::Output as Outputs>::FITS),
                "`run` gives other values than the ports carry"
            );
        }
        Self {
            name: S::KIND,
            aliases: S::ALIASES,
            summary: S::SUMMARY,
            inputs: S::INPUTS,
            outputs: S::OUTPUTS,
            required: S::REQUIRED,
            resamples: S::RESAMPLES,
            map: S::MAP,
            parse: |value| Ok(Arc::new(serde_json::from_value::<S>(value)?)),
            schema: || schema_of::<S>(S::REQUIRED),
        }
    }

    /// The schema of the settings. It is built once: batches ask for it per item.
    pub(crate) fn json_schema(&self) -> Arc<serde_json::Value> {
        static SCHEMAS: Mutex<BTreeMap<&str, Arc<serde_json::Value>>> = Mutex::new(BTreeMap::new());
        let mut schemas = SCHEMAS.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        Arc::clone(schemas.entry(self.name).or_insert_with(|| Arc::new((self.schema)())))
    }

    /// The input port called `name`.
    pub fn input(&self, name: &str) -> Option<&'static Port> {
        self.inputs.iter().find(|p| p.name == name)
    }

    /// The output port called `name`.
    pub fn output(&self, name: &str) -> Option<&'static Port> {
        self.outputs.iter().find(|p| p.name == name)
    }

    /// The default settings.
    ///
    /// # Errors
    /// None of the kinds of [`crate::stages::KINDS`] gives one: a test parses the defaults of each.
    pub fn defaults(&self) -> Result<Arc<dyn Settings>, serde_json::Error> {
        (self.parse)(serde_json::json!({}))
    }
}

/// Draft-07 schema of `T`, every type spelled out in place: editors for TOML understand no newer draft. Of the doc comment of a
/// setting the first paragraph is its text, without a full stop at its end: what follows is for readers of the code.
pub(crate) fn schema_of<T: JsonSchema>(required: &[&str]) -> serde_json::Value {
    let settings = SchemaSettings::draft07().with(|s| {
        s.inline_subschemas = true;
        s.meta_schema = None;
    });
    let mut schema: Schema = settings.into_generator().into_root_schema_for::<T>();
    if !required.is_empty() {
        schema.insert("required".into(), required.into());
    }
    let mut schema = schema.to_value();
    if let Some(object) = schema.as_object_mut() {
        object.values_mut().for_each(shorten);
    }
    schema
}

fn shorten(schema: &mut serde_json::Value) {
    match schema {
        serde_json::Value::Object(object) => {
            if let Some(serde_json::Value::String(text)) = object.get_mut("description") {
                let first = text.split("\n\n").next().unwrap_or_default();
                *text = first.strip_suffix('.').unwrap_or(first).replace('\n', " ");
            }
            object.values_mut().for_each(shorten);
        }
        serde_json::Value::Array(list) => list.iter_mut().for_each(shorten),
        _ => {}
    }
}
