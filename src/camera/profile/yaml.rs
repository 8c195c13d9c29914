//! YAML to a tree, from events, with bounds: no aliases (which can grow without bound), no deep nesting.

use serde_json::{Map, Number, Value};
use yaml_rust2::parser::{Event, Parser};
use yaml_rust2::scanner::TScalarStyle;

use super::{MAX_NESTING, ProfileError};

/// The first document of a text. OpenCV's first line, `%YAML:1.0`, is no YAML and is passed over.
pub(super) fn tree(text: &str) -> Result<Value, ProfileError> {
    let directives = |line: &&str| !line.starts_with("%YAML");
    let text: String = text.lines().filter(directives).flat_map(|l| [l, "\n"]).collect();
    let mut parser = Parser::new_from_str(&text);
    let mut open: Vec<Open> = Vec::new();
    loop {
        let (event, mark) = parser.next_token().map_err(|e| ProfileError::syntax("YAML", e))?;
        let refused = |what: &str| Err(ProfileError::syntax("YAML", format!("line {}: {what}", mark.line())));
        let value = match event {
            Event::StreamEnd | Event::DocumentEnd => return Err(ProfileError::UnknownFormat),
            Event::Alias(_) => return refused("aliases (*name) are not read: write the value itself"),
            Event::SequenceStart(..) | Event::MappingStart(..) if open.len() >= MAX_NESTING => {
                return refused("nested too deeply");
            }
            Event::SequenceStart(..) => {
                open.push(Open::List(Vec::new()));
                continue;
            }
            Event::MappingStart(..) => {
                open.push(Open::Mapping(Map::new(), None));
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(Open::List(items)) => Value::Array(items),
                Some(Open::Mapping(map, _)) => Value::Object(map),
                None => return Err(ProfileError::UnknownFormat),
            },
            Event::Scalar(text, style, ..) => scalar(text, style),
            Event::Nothing | Event::StreamStart | Event::DocumentStart => continue,
        };
        match open.last_mut() {
            Some(top) => top.add(value),
            None => return Ok(value),
        }
    }
}

/// A collection that is being read.
enum Open {
    List(Vec<Value>),
    Mapping(Map<String, Value>, Option<String>),
}

impl Open {
    fn add(&mut self, value: Value) {
        match self {
            Self::List(items) => items.push(value),
            Self::Mapping(map, key) => match key.take() {
                Some(key) => {
                    map.insert(key, value);
                }
                None => *key = Some(value.as_str().map_or_else(|| value.to_string(), str::to_owned)),
            },
        }
    }
}

/// A plain number is one; everything else stays text.
fn scalar(text: String, style: TScalarStyle) -> Value {
    if style != TScalarStyle::Plain {
        return Value::String(text);
    }
    match text.as_str() {
        "" | "~" | "null" => return Value::Null,
        "true" => return Value::Bool(true),
        "false" => return Value::Bool(false),
        _ => {}
    }
    match text.trim_end_matches('.').parse::<f64>().ok().and_then(Number::from_f64) {
        Some(number) => Value::Number(number),
        None => Value::String(text),
    }
}
