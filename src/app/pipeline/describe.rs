//! Stage kinds in words: ports, settings, ranges and defaults, all read from the registry and the schemas.

use std::fmt::Write as _;

use serde_json::Value as Json;

use super::kind::StageKind;
use super::port::{Arity, Port};
use super::settings::{allowed_range, allowed_words, range_text};
use crate::stages::KINDS;

/// Every kind on a line.
pub fn list() -> String {
    let width = KINDS.iter().map(|k| k.name.len()).max().unwrap_or(0);
    let lines: Vec<String> = KINDS.iter().map(|k| format!("{:width$}  {}\n", k.name, k.summary)).collect();
    lines.concat()
}

/// One kind with its ports and settings.
pub fn describe(kind: &StageKind) -> String {
    let mut out = format!("{}: {}\n", kind.name, kind.summary);
    ports(&mut out, "inputs", kind.inputs);
    ports(&mut out, "outputs", kind.outputs);
    out.push_str("\nsettings\n");
    let schema = kind.json_schema();
    let defaults = kind.defaults().map(|d| d.to_json()).unwrap_or_default();
    for (key, property) in schema["properties"].as_object().into_iter().flatten() {
        out.push_str(&setting(key, property, &defaults[key], kind.required.contains(&key.as_str())));
    }
    out
}

fn ports(out: &mut String, title: &str, ports: &[Port]) {
    if ports.is_empty() {
        return;
    }
    write!(out, "\n{title}\n").expect("writing to a string cannot fail");
    for port in ports {
        let arity = match port.arity {
            Arity::One => "",
            Arity::Optional => ", optional",
            Arity::Many => ", list",
            Arity::Any => ", list or nothing",
        };
        let data = format!("({}{arity})", port.data);
        writeln!(out, "  {:<10} {data:<18} {}", port.name, port.doc).expect("writing to a string cannot fail");
    }
}

fn setting(key: &str, property: &Json, default: &Json, required: bool) -> String {
    let doc = property["description"].as_str().unwrap_or_default();
    let mut notes = Vec::new();
    let words = allowed_words(property);
    if !words.is_empty() {
        notes.push(words.join(" | "));
    }
    notes.extend(Some(range_text(allowed_range(property))).filter(|r| !r.is_empty()));
    match default {
        _ if required => notes.push("required".to_owned()),
        Json::Null => {}
        Json::String(text) => notes.push(format!("default \"{text}\"")),
        other => notes.push(format!("default {other}")),
    }
    let notes = if notes.is_empty() { String::new() } else { format!("\n{:19}[{}]", "", notes.join("; ")) };
    format!("  {key:<16} {doc}{notes}\n")
}
