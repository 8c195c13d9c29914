//! Options of commands that set the settings of a stage, built from the JSON schema of its kind.
//!
//! A command lists which settings it offers, under which heading, and what their values are called in help. Text, default,
//! range and choices are those of the schema, so that help, `plumbline stages`, the checks of pipeline files and editors say
//! the same.

use std::fmt;
use std::path::PathBuf;

use clap::builder::{
    OsStringValueParser, PathBufValueParser, PossibleValue, PossibleValuesParser, RangedI64ValueParser,
    TypedValueParser, ValueParser,
};
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Command, FromArgMatches, ValueHint};
use serde_json::{Map, Value as Json};

use super::spelling::british;
use crate::pipeline::file::literal_path;
use crate::pipeline::kind::{Stage, schema_of};
use crate::pipeline::paths::to_text;
use crate::pipeline::reference::escape;
use crate::pipeline::settings::{aliases, allowed_range, check_report, choices, number_of, range_text};

/// One setting as an option of a command.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting {
    key: &'static str,
    long: Option<&'static str>,
    short: Option<char>,
    value: Option<&'static str>,
    heading: Option<&'static str>,
    requires: Option<&'static str>,
    conflicts: Option<&'static str>,
    signed: bool,
    ranged: bool,
    aliases: &'static [(&'static str, &'static str)],
    also: Option<&'static str>,
}

impl Setting {
    /// The setting `key`, as the option of the same name.
    pub(super) const fn of(key: &'static str) -> Self {
        Self {
            key,
            long: None,
            short: None,
            value: None,
            heading: None,
            requires: None,
            conflicts: None,
            signed: false,
            ranged: false,
            aliases: &[],
            also: None,
        }
    }

    /// Another name of the option.
    pub(super) const fn named(self, long: &'static str) -> Self {
        Self { long: Some(long), ..self }
    }

    /// A second name of the option, which help shows.
    pub(super) const fn also(self, also: &'static str) -> Self {
        Self { also: Some(also), ..self }
    }

    /// A letter for it.
    pub(super) const fn short(self, short: char) -> Self {
        Self { short: Some(short), ..self }
    }

    /// What its value is called in help, where the type alone does not say it.
    pub(super) const fn value(self, name: &'static str) -> Self {
        Self { value: Some(name), ..self }
    }

    /// The heading that it is under in help.
    pub(super) const fn under(self, heading: &'static str) -> Self {
        Self { heading: Some(heading), ..self }
    }

    /// It requires another option.
    pub(super) const fn requires(self, id: &'static str) -> Self {
        Self { requires: Some(id), ..self }
    }

    /// It excludes another option.
    pub(super) const fn conflicts(self, id: &'static str) -> Self {
        Self { conflicts: Some(id), ..self }
    }

    /// Its value may begin with a minus.
    pub(super) const fn signed(self) -> Self {
        Self { signed: true, ..self }
    }

    /// Help shows its range.
    pub(super) const fn ranged(self) -> Self {
        Self { ranged: true, ..self }
    }

    /// Other words for its choices, each behind the word that it means.
    pub(super) const fn aliases(self, aliases: &'static [(&'static str, &'static str)]) -> Self {
        Self { aliases, ..self }
    }

    /// The name that clap knows it by.
    fn id(self) -> String {
        self.long.unwrap_or(self.key).replace('-', "_")
    }

    /// The option, from what the schema says of the setting.
    fn arg<S: Stage>(self, property: &Json, default: &Json) -> Arg {
        let id = self.id();
        let arg = Arg::new(id.clone()).long(id.replace('_', "-")).help(self.help(property));
        let arg = arg.aliases(aliases(property).map(|old| old.replace('_', "-")));
        let arg = if let Some(also) = self.also { arg.visible_alias(also) } else { arg };
        let arg = self.short.map_or(arg.clone(), |short| arg.short(short));
        let arg = self.heading.map_or(arg.clone(), |heading| arg.help_heading(heading));
        let arg = self.requires.map_or(arg.clone(), |other| arg.requires(other));
        let arg = self.conflicts.map_or(arg.clone(), |other| arg.conflicts_with(other));
        // `--settings` finds the option of a setting by this group.
        let arg = arg.group(format!("{}/{}", S::KIND, self.key));
        if is(property, "boolean") {
            return arg.action(ArgAction::SetTrue);
        }
        let arg = arg.value_name(self.value.unwrap_or_else(|| value_name(property)));
        let arg = arg.value_parser(self.parser::<S>(property)).allow_hyphen_values(self.signed);
        let arg = if is_path(property) && !is(property, "array") { arg.value_hint(ValueHint::AnyPath) } else { arg };
        let arg = if is(property, "array") { arg.action(ArgAction::Append).num_args(1..) } else { arg };
        match shown(default) {
            _ if S::REQUIRED.contains(&self.key) => arg.required(true),
            Some(text) => arg.default_value(text),
            None => arg,
        }
    }

    /// The text of the option; of a choice whose words say nothing more, with the words.
    fn help(self, property: &Json) -> String {
        let text = property["description"].as_str().unwrap_or_default();
        let words = choices(property);
        if !words.is_empty() && words.iter().all(|(_, about)| about.is_none()) {
            let words: Vec<&str> = words.into_iter().map(|(word, _)| word).collect();
            return format!("{text}: {}", words.join(", "));
        }
        let range = range_text(allowed_range(property));
        if self.ranged { format!("{text} ({range})") } else { text.to_owned() }
    }

    /// Reads a value as the setting's JSON, refusing what the schema, or the type behind it, does not take.
    fn parser<S: Stage>(self, property: &Json) -> ValueParser {
        let words = choices(property);
        if words.iter().any(|(_, about)| about.is_some()) {
            return PossibleValuesParser::new(described(&words, self.aliases)).map(Json::String).into();
        }
        let (least, most) = allowed_range(property);
        if is(property, "integer") {
            let bound = |x: Option<f64>| x.map(|x| x as i64);
            let range = (bound(least).unwrap_or(i64::MIN), bound(most).unwrap_or(i64::MAX));
            return RangedI64ValueParser::<i64>::new().range(range.0..=range.1).map(Json::from).into();
        }
        if is(property, "number") {
            let property = property.clone();
            return ValueParser::new(move |text: &str| number_of(&property, text).map(Json::from));
        }
        if is_path(property) && !is(property, "array") {
            let property = property.clone();
            let checked = move |path: PathBuf| {
                let path = Json::String(literal_path(&path));
                check_report(&property, &path).map(|()| path)
            };
            return PathBufValueParser::new().try_map(checked).into();
        }
        if is(property, "array") {
            return OsStringValueParser::new().map(|name| Json::String(escape(&to_text(name)))).into();
        }
        // Text with a pattern holds no reference; other text may look like one.
        let free = property["pattern"].is_null() && words.is_empty();
        ValueParser::new(move |text: &str| {
            let json = Json::String(if free { escape(text) } else { text.to_owned() });
            let table = Json::Object([(self.key.to_owned(), json.clone())].into_iter().collect());
            serde_json::from_value::<S>(table).map(|_| json).map_err(|e| e.to_string())
        })
    }

    /// The value that the user gave.
    fn given(self, matches: &ArgMatches, property: &Json) -> Option<Json> {
        let id = self.id();
        if is(property, "boolean") {
            return Some(matches.get_flag(&id).into());
        }
        if is(property, "array") {
            return Some(matches.get_many::<Json>(&id)?.cloned().collect());
        }
        matches.get_one::<Json>(&id).cloned()
    }
}

/// Which settings of a kind a command offers, in the order of its help.
pub(super) trait Offer {
    /// The kind.
    type Kind: Stage;
    /// The settings.
    const SETTINGS: &'static [Setting];
}

/// Settings from the command line; those without an option have their defaults.
pub(super) struct Given<O: Offer> {
    pub(super) settings: O::Kind,
}

impl<O: Offer> fmt::Debug for Given<O> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.settings.fmt(f)
    }
}

impl<O: Offer> clap::Args for Given<O> {
    fn augment_args(command: Command) -> Command {
        let schema = schema_of::<O::Kind>(&[]);
        let defaults = serde_json::to_value(O::Kind::default()).unwrap_or_default();
        let arg = |s: &Setting| s.arg::<O::Kind>(&schema["properties"][s.key], &defaults[s.key]);
        command.args(O::SETTINGS.iter().map(arg))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<O: Offer> FromArgMatches for Given<O> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let schema = schema_of::<O::Kind>(&[]);
        let given = |s: &Setting| Some((s.key.to_owned(), s.given(matches, &schema["properties"][s.key])?));
        let json: Map<String, Json> = O::SETTINGS.iter().filter_map(given).collect();
        let wrong = |e: serde_json::Error| clap::Error::raw(ErrorKind::ValueValidation, format!("{e}\n"));
        Ok(Self { settings: serde_json::from_value(Json::Object(json)).map_err(wrong)? })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The value may be of this JSON type.
fn is(property: &Json, name: &str) -> bool {
    match &property["type"] {
        Json::String(only) => only == name,
        Json::Array(several) => several.iter().any(|one| one == name),
        _ => false,
    }
}

fn is_path(property: &Json) -> bool {
    property["format"] == "path"
}

/// What a value is called by its type.
fn value_name(property: &Json) -> &'static str {
    if is(property, "integer") {
        "N"
    } else if is(property, "number") {
        "X"
    } else if is_path(property) {
        "FILE"
    } else if choices(property).is_empty() {
        "TEXT"
    } else {
        "HOW"
    }
}

/// The words of a choice with their meanings; each of `aliases` is a word, and another for the same.
fn described(words: &[(&str, Option<&str>)], aliases: &[(&'static str, &'static str)]) -> Vec<PossibleValue> {
    let value = |(word, about): &(&str, Option<&str>)| {
        let value = PossibleValue::new((*word).to_owned()).help(about.unwrap_or_default().to_owned());
        let others = aliases.iter().filter(|(of, _)| of == word).map(|(_, alias)| (*alias).to_owned());
        value.aliases(others.chain(british(word)))
    };
    words.iter().map(value).collect()
}

/// A default as it is written on the command line; numbers without exponents.
fn shown(default: &Json) -> Option<String> {
    match default {
        Json::String(text) if !text.is_empty() => Some(text.clone()),
        Json::Number(n) => Some(n.as_i64().map_or_else(|| n.as_f64().unwrap_or(0.0).to_string(), |i| i.to_string())),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use clap::Args;

    use super::*;
    use crate::stages::MeshDeformSettings;

    #[derive(Debug)]
    struct Some3;

    impl Offer for Some3 {
        type Kind = MeshDeformSettings;
        const SETTINGS: &'static [Setting] =
            &[Setting::of("handles"), Setting::of("solver"), Setting::of("tolerance").value("FRACTION")];
    }

    fn given(args: &[&str]) -> Result<MeshDeformSettings, String> {
        let command = Given::<Some3>::augment_args(Command::new("x"));
        let matches = command.try_get_matches_from(args).map_err(|e| e.to_string())?;
        Given::<Some3>::from_arg_matches(&matches).map(|g| g.settings).map_err(|e| e.to_string())
    }

    #[test]
    fn options_are_read_as_the_settings_that_they_mean() {
        let plain = given(&["x", "--handles", "a ${b}"]).expect("only the required one");
        assert_eq!(plain, MeshDeformSettings { handles: "a $${b}".into(), ..MeshDeformSettings::default() });
        let set = given(&["x", "--handles", "h", "--tolerance", "0.25"]).expect("in range");
        assert_eq!(set.tolerance, 0.25);
        for (args, expected) in [
            (&["x"][..], "--handles <FILE>"),
            (&["x", "--handles", "h", "--tolerance", "0.6"], "out of range (expected 0 to 0.5)"),
            (&["x", "--handles", "h", "--tolerance", "nan"], "out of range (expected 0 to 0.5)"),
            (&["x", "--handles", "h", "--solver", "acelerated"], "a similar value exists: 'accelerated'"),
        ] {
            let refused = given(args).expect_err("a bad command line");
            assert!(refused.contains(expected), "{refused}");
        }
    }

    #[test]
    fn help_and_schema_come_from_one_text() {
        let schema = schema_of::<MeshDeformSettings>(&[]);
        let command = Given::<Some3>::augment_args(Command::new("x"));
        for setting in Some3::SETTINGS {
            let arg = command.get_arguments().find(|a| a.get_id() == setting.key).expect("an option");
            let text = schema["properties"][setting.key]["description"].as_str().expect("a text");
            assert_eq!(arg.get_help().map(ToString::to_string).as_deref(), Some(text));
        }
        let solver = command.get_arguments().find(|a| a.get_id() == "solver").expect("an option");
        let words: Vec<_> = solver.get_possible_values().iter().map(|v| v.get_name().to_owned()).collect();
        assert_eq!(words, ["accelerated", "local-global", "gauss-newton"]);
    }

    #[test]
    fn every_word_of_the_schema_is_read_as_its_choice() {
        use crate::stages::ModelChoice;
        for (word, help) in crate::pipeline::words_of::<ModelChoice>() {
            assert!(!help.is_empty(), "{word}");
            let choice: ModelChoice = serde_json::from_value(Json::String(word.clone())).expect("a choice");
            assert_eq!(choice.to_string(), word);
        }
    }
}
