//! A stage kind: its name, ports, settings and behavior over time, as one table row per kind.
//!
//! The settings are a plain struct with doc comments. The comments become the help of `plumbline stages` and the texts of the
//! JSON schema; ranges stand in the schema attributes and are enforced from there, so help, editor and check cannot disagree.

use std::any::Any;
use std::fmt::Debug;
use std::sync::Arc;

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::memory::Held;
use super::port::Port;

/// How a stage's result depends on time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OverTime {
    /// One frame in, one frame out.
    Map,
    /// A frame needs this many frames around it.
    Window(u32),
    /// The result needs the whole clip, so it ends a pass.
    Reduce,
    /// The result is there before the first frame.
    Once,
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

/// The settings of one stage kind, and what holds for every stage of the kind.
///
/// `Default` gives every setting that a file leaves out; `REQUIRED` names those that a file must give.
pub trait StageSettings:
    Serialize + DeserializeOwned + JsonSchema + Default + PartialEq + Debug + Send + Sync + 'static
{
    /// The name after `use =`.
    const KIND: &'static str;
    /// What the stage does, in one line.
    const SUMMARY: &'static str;
    /// What it takes; a list of inputs fills them in this order.
    const INPUTS: &'static [Port];
    /// What it gives; the first is meant by the stage's bare name.
    const OUTPUTS: &'static [Port];
    /// Settings without a default.
    const REQUIRED: &'static [&'static str] = &[];
    /// It interpolates pixels; at most one such stage may lie on the way of a picture.
    const RESAMPLES: bool = false;

    /// How the result depends on time.
    fn over_time(&self) -> OverTime {
        OverTime::Map
    }

    /// What it holds while it runs.
    fn held(&self) -> Vec<Held> {
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
}

/// Settings of a kind known at run time; [`dyn Settings::get`] gives back the typed struct.
pub trait Settings: Any + Debug + Send + Sync {
    /// See [`StageSettings::over_time`].
    fn over_time(&self) -> OverTime;
    /// See [`StageSettings::held`].
    fn held(&self) -> Vec<Held>;
    /// See [`StageSettings::conflicts`].
    fn conflicts(&self) -> Vec<Conflict>;
    /// See [`StageSettings::reads`].
    fn reads(&self) -> Vec<&str>;
    /// See [`StageSettings::writes`].
    fn writes(&self) -> Vec<String>;
    /// See [`StageSettings::fills`].
    fn fills(&self) -> Vec<&str>;
    /// Every setting, defaults included.
    fn to_json(&self) -> serde_json::Value;
}

impl<S: StageSettings> Settings for S {
    fn over_time(&self) -> OverTime {
        StageSettings::over_time(self)
    }

    fn held(&self) -> Vec<Held> {
        StageSettings::held(self)
    }

    fn conflicts(&self) -> Vec<Conflict> {
        StageSettings::conflicts(self)
    }

    fn reads(&self) -> Vec<&str> {
        StageSettings::reads(self)
    }

    fn writes(&self) -> Vec<String> {
        StageSettings::writes(self)
    }

    fn fills(&self) -> Vec<&str> {
        StageSettings::fills(self)
    }

    fn to_json(&self) -> serde_json::Value {
        serde_json::to_value(self).unwrap_or_default()
    }
}

impl dyn Settings {
    /// The settings as `S`; `None` for a stage of another kind.
    pub fn get<S: StageSettings>(&self) -> Option<&S> {
        (self as &dyn Any).downcast_ref()
    }
}

/// One row of the registry.
#[derive(Clone, Copy, Debug)]
pub struct StageKind {
    /// The name after `use =`.
    pub name: &'static str,
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
    /// Reads settings from JSON; settings that are left out take their defaults.
    pub parse: fn(serde_json::Value) -> Result<Arc<dyn Settings>, serde_json::Error>,
    /// The JSON schema (draft-07) of the settings, without references.
    pub schema: fn() -> serde_json::Value,
}

impl StageKind {
    /// The row of `S`.
    pub const fn of<S: StageSettings>() -> Self {
        Self {
            name: S::KIND,
            summary: S::SUMMARY,
            inputs: S::INPUTS,
            outputs: S::OUTPUTS,
            required: S::REQUIRED,
            resamples: S::RESAMPLES,
            parse: |value| Ok(Arc::new(serde_json::from_value::<S>(value)?)),
            schema: || schema_of::<S>(S::REQUIRED),
        }
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
    /// None of the kinds of [`super::kinds::KINDS`] gives one: a test parses the defaults of each.
    pub fn defaults(&self) -> Result<Arc<dyn Settings>, serde_json::Error> {
        (self.parse)(serde_json::json!({}))
    }
}

/// Draft-07 schema of `T`, every type spelled out in place: editors for TOML understand no newer draft.
pub(super) fn schema_of<T: JsonSchema>(required: &[&str]) -> serde_json::Value {
    let settings = SchemaSettings::draft07().with(|s| {
        s.inline_subschemas = true;
        s.meta_schema = None;
    });
    let mut schema: Schema = settings.into_generator().into_root_schema_for::<T>();
    if !required.is_empty() {
        schema.insert("required".into(), required.into());
    }
    schema.to_value()
}
