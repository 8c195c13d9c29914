//! Checks a table of settings against the schema of its struct: every unknown key, wrong type, value out of range and missing
//! key at once, each at its own span.
//!
//! Deserializing a whole table stops at the first fault, so each key is tried alone; what the struct's schema says about
//! ranges and names is read from there, never repeated.

use schemars::JsonSchema;
use serde_json::{Map, Value as Json};

use super::kind::{Stage, schema_of};
use super::paths::{to_path, to_text};
use super::problem::Problem;
use super::reference::{Resolved, Scope, resolve};
use super::suggest::{did_you_mean, listed};
use super::syntax::{Entry, Node, SourceId, Sources, Span, Value, parse_value};
use crate::report::ReportFormat;

/// What a table must look like.
pub(super) struct Expected<'a> {
    /// What messages call the table, such as ``stage `out` (video.encode)``.
    pub what: String,
    /// Schema of the settings struct.
    pub schema: &'a Json,
    /// Keys that must be given.
    pub required: &'a [&'a str],
    /// Tries a table of settings; the error says what is wrong with it.
    pub accepts: &'a dyn Fn(Json) -> Result<(), String>,
}

/// What a table gave.
#[derive(Debug, Default)]
pub(super) struct Checked {
    /// Values of the keys that were in order.
    pub json: Map<String, Json>,
    /// Keys whose value waits for the item.
    pub deferred: Vec<Entry>,
}

/// Checks `entries`, appending every fault to `problems`. `header` is the span for a missing key.
pub(super) fn check_table(
    entries: &[Entry],
    header: Option<Span>,
    expected: &Expected<'_>,
    scope: &Scope<'_>,
    sources: &Sources,
    problems: &mut Vec<Problem>,
) -> Checked {
    let mut checked = Checked::default();
    let empty = Map::new();
    let properties = expected.schema["properties"].as_object().unwrap_or(&empty);
    // Each entry by itself, so that every fault is reported at once.
    for entry in entries {
        let Some((key, property)) = property_of(properties, &entry.key) else {
            problems.push(unknown_key(entry, expected, properties));
            continue;
        };
        match resolve(&entry.node, scope) {
            Err(problem) => problems.push(problem),
            Ok(Resolved::Deferred) => checked.deferred.push(entry.clone()),
            Ok(Resolved::Ready(Node { value: Value::Unknown, .. }, _)) => {}
            Ok(Resolved::Ready(node, base)) => match check_value(key, &node, property, expected) {
                Ok(json) => {
                    checked.json.insert(key.to_owned(), rebase(json, property, base, sources));
                }
                Err(problem) => problems.push(problem),
            },
        }
    }
    // Required keys that no entry gives.
    for key in expected.required {
        if !entries.iter().any(|e| property_of(properties, &e.key).is_some_and(|(name, _)| name == *key)) {
            problems.push(missing_key(key, header, expected, properties));
        }
    }
    checked
}

/// A setting by its name, or by a name that it had before: the schema lists those under `aliases`.
pub(crate) fn property_of<'a>(properties: &'a Map<String, Json>, key: &str) -> Option<(&'a str, &'a Json)> {
    let named =
        |(name, property): &(&String, &Json)| name.as_str() == key || aliases(property).any(|alias| alias == key);
    properties.iter().find(named).map(|(name, property)| (name.as_str(), property))
}

/// Names that a setting had before.
pub(crate) fn aliases(property: &Json) -> impl Iterator<Item = &str> {
    property["aliases"].as_array().into_iter().flatten().filter_map(Json::as_str)
}

/// Refuses a report whose extension names no format.
pub(crate) fn check_report(property: &Json, value: &Json) -> Result<(), String> {
    match value.as_str().filter(|_| property["report"] == true) {
        Some(path) => ReportFormat::of(path).map(drop),
        None => Ok(()),
    }
}

/// The setting is a fraction, which may be written as a percentage.
pub(crate) fn is_fraction(property: &Json) -> bool {
    property["format"] == "fraction"
}

/// The fraction that a percentage such as `80%` means.
fn fraction_of(text: &str) -> Option<f64> {
    text.trim().strip_suffix('%')?.trim().parse::<f64>().ok().map(|percent| percent / 100.0)
}

fn unknown_key(entry: &Entry, expected: &Expected<'_>, properties: &Map<String, Json>) -> Problem {
    Problem::new("unknown-key", format!("{} has no setting `{}`", expected.what, entry.key))
        .label(entry.key_span.or(entry.node.span), "unknown setting")
        .suggest(did_you_mean(&entry.key, properties.keys().map(String::as_str)))
}

fn missing_key(key: &str, header: Option<Span>, expected: &Expected<'_>, properties: &Map<String, Json>) -> Problem {
    let doc = properties.get(key).and_then(|p| p["description"].as_str()).unwrap_or_default();
    Problem::new("missing-key", format!("{} needs the setting `{key}`", expected.what))
        .label(header, format!("`{key}` is missing"))
        .help(format!("{key}: {doc}"))
}

/// The value as JSON, if the settings struct takes it.
fn check_value(key: &str, node: &Node, property: &Json, expected: &Expected<'_>) -> Result<Json, Problem> {
    let mut refusal = None;
    for candidate in candidates(node) {
        let percentage = candidate.text().filter(|_| is_fraction(property)).and_then(fraction_of);
        let json = percentage.map_or_else(|| to_json(&candidate, key), |fraction| Ok(fraction.into()))?;
        check_range(key, node, &json, property, expected)?;
        check_report(property, &json).map_err(|why| refused(key, node, expected, &why))?;
        match (expected.accepts)(Json::Object([(key.to_owned(), json.clone())].into_iter().collect())) {
            Ok(()) => return Ok(json),
            Err(reason) => refusal = Some(reason),
        }
    }
    let words = allowed_words(property);
    let doc = || property["description"].as_str().map(|doc| format!("{key}: {doc}"));
    let (shown, suggestion) = match (node.text(), words.as_slice()) {
        (_, []) => return Err(refused(key, node, expected, &refusal.unwrap_or_default()).suggest(doc())),
        (Some(text), words) => (text.to_owned(), did_you_mean(text, words.iter().copied())),
        (None, _) => (to_json(node, key)?.to_string(), doc()),
    };
    let message = format!("`{key}` of {} cannot be `{shown}` (expected {})", expected.what, listed(&words));
    Err(Problem::new("bad-value", message).label(node.span, "this value").suggest(suggestion))
}

/// A refusal in the words of the deserializer, its names of types put in ours.
fn refused(key: &str, node: &Node, expected: &Expected<'_>, reason: &str) -> Problem {
    let reason = reason
        .replace("expected usize", "expected a whole number")
        .replace("expected u32", "expected a whole number")
        .replace("expected f64", "expected a number");
    Problem::new("bad-value", format!("`{key}` of {} is wrong: {reason}", expected.what)).label(node.span, "this value")
}

/// What the node may mean: text without quotes is first read as TOML, then taken as it is.
fn candidates(node: &Node) -> Vec<Node> {
    match &node.value {
        Value::Loose(text) => {
            let typed = parse_value(SourceId(0), text, 0).map(|n| Node { value: n.value, span: node.span });
            typed.into_iter().chain([Node { value: Value::Text(text.clone()), span: node.span }]).collect()
        }
        _ => vec![node.clone()],
    }
}

fn to_json(node: &Node, key: &str) -> Result<Json, Problem> {
    Ok(match &node.value {
        Value::Bool(b) => (*b).into(),
        Value::Integer(i) => (*i).into(),
        Value::Float(x) if !x.is_finite() => {
            return Err(Problem::new("bad-value", format!("`{key}` = {x} is not a finite number"))
                .label(node.span, "this value"));
        }
        Value::Float(x) => (*x).into(),
        Value::Text(text) | Value::Loose(text) => text.clone().into(),
        Value::Unknown => Json::Null,
        Value::List(items) => Json::Array(items.iter().map(|n| to_json(n, key)).collect::<Result<_, _>>()?),
        Value::Table(entries) => {
            let pairs = entries.iter().map(|e| Ok((e.key.clone(), to_json(&e.node, key)?)));
            Json::Object(pairs.collect::<Result<_, Problem>>()?)
        }
    })
}

/// The words that the schema of a value lists, if it is a choice.
pub(super) fn allowed_words(property: &Json) -> Vec<&str> {
    choices(property).into_iter().map(|(word, _)| word).collect()
}

fn listed_words(schema: &Json) -> Vec<&str> {
    schema["enum"].as_array().into_iter().flatten().filter_map(Json::as_str).collect()
}

/// The same, and what each word means.
pub(crate) fn choices(property: &Json) -> Vec<(&str, Option<&str>)> {
    // A choice that may be left out is one of its words or null.
    let property = match property["anyOf"].as_array().map(Vec::as_slice) {
        Some([choice, null]) if null["type"] == "null" => choice,
        _ => property,
    };
    let plain = listed_words(property).into_iter().map(|word| (word, None));
    let described = property["oneOf"].as_array().into_iter().flatten().flat_map(|one| {
        let about = one["description"].as_str();
        one["const"].as_str().into_iter().chain(listed_words(one)).map(move |word| (word, about)).collect::<Vec<_>>()
    });
    plain.chain(described).collect()
}

/// The words of an enum and the help text of each, as its schema has them.
pub fn words_of<T: JsonSchema>() -> Vec<(String, String)> {
    let schema = schema_of::<T>(&[]);
    let described = |word: &str| {
        let of_word = |one: &&Json| one["const"] == word;
        let one = schema["oneOf"].as_array().into_iter().flatten().find(of_word);
        one.and_then(|one| one["description"].as_str()).unwrap_or_default().to_owned()
    };
    allowed_words(&schema).into_iter().map(|word| (word.to_owned(), described(word))).collect()
}

/// `(least, most)` that the schema allows a number.
pub(crate) fn allowed_range(property: &Json) -> (Option<f64>, Option<f64>) {
    (property["minimum"].as_f64(), property["maximum"].as_f64())
}

fn check_range(key: &str, node: &Node, json: &Json, property: &Json, expected: &Expected<'_>) -> Result<(), Problem> {
    let (least, most) = allowed_range(property);
    let Some(x) = json.as_f64() else { return Ok(()) };
    // Written so that NaN is out of range.
    let inside = least.is_none_or(|a| x >= a) && most.is_none_or(|b| x <= b);
    if inside {
        return Ok(());
    }
    let range = range_text((least, most));
    let doc = property["description"].as_str().unwrap_or_default();
    Err(Problem::new("out-of-range", format!("`{key}` = {x} of {} is out of range (expected {range})", expected.what))
        .label(node.span, format!("expected {range}"))
        .help(format!("{key}: {doc}")))
}

/// `0.3 to 1`, `at least 0`, or nothing.
pub(crate) fn range_text(range: (Option<f64>, Option<f64>)) -> String {
    match range {
        (Some(a), Some(b)) => format!("{a} to {b}"),
        (Some(a), None) => format!("at least {a}"),
        (None, Some(b)) => format!("at most {b}"),
        (None, None) => String::new(),
    }
}

/// Relative paths start from the folder of the text that contains them.
fn rebase(json: Json, property: &Json, base: Option<SourceId>, sources: &Sources) -> Json {
    let json = match json {
        // Of `out/${item.rel}/a.mp4`, where the item is in no folder of its own.
        Json::String(path) if property["format"] == "path" && path.contains("/./") => path.replace("/./", "/").into(),
        json => json,
    };
    let folder = base.and_then(|id| sources.get(id)).and_then(|s| s.base.as_ref());
    match (folder, json) {
        (Some(folder), Json::String(path)) if property["format"] == "path" && !path.is_empty() && path != "-" => {
            to_text(folder.join(to_path(&path))).into()
        }
        // A lens is a file or a word.
        (Some(folder), Json::String(lens)) if property["format"] == "lens" && folder.join(to_path(&lens)).is_file() => {
            to_text(folder.join(to_path(&lens))).into()
        }
        (Some(_), Json::Array(list)) if property["format"] == "path" => {
            list.into_iter().map(|path| rebase(path, property, base, sources)).collect()
        }
        (_, json) => json,
    }
}

/// Reads a number for the setting `key` of `S` within the range that its schema states: for options that mean a setting.
///
/// # Errors
/// No number, or out of range; the message states the range.
pub fn number_for<S: Stage>(key: &str, text: &str) -> Result<f64, String> {
    number_of(&schema_of::<S>(&[])["properties"][key], text)
}

/// Reads a number for a setting, a fraction also as a percentage.
pub(crate) fn number_of(property: &Json, text: &str) -> Result<f64, String> {
    let percentage = is_fraction(property).then(|| fraction_of(text)).flatten();
    let range = allowed_range(property);
    percentage.map_or_else(|| number_in(range, text), |fraction| number_in(range, &fraction.to_string()))
}

/// Reads a number between two bounds.
fn number_in(range: (Option<f64>, Option<f64>), text: &str) -> Result<f64, String> {
    let wanted = range_text(range);
    let wanted = if wanted.is_empty() { "a number".to_owned() } else { wanted };
    let x: f64 = text.parse().map_err(|_| format!("not a number (expected {wanted})"))?;
    // Written so that NaN is out of range.
    let inside = range.0.is_none_or(|a| x >= a) && range.1.is_none_or(|b| x <= b);
    if inside && x.is_finite() { Ok(x) } else { Err(format!("out of range (expected {wanted})")) }
}
