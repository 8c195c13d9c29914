//! The syntax tree of a pipeline file: TOML values with their spans.
//!
//! A [`Node`] is a value with the [`Span`] it was read from, so that a fault found long after parsing (in a setting, an
//! edge, a batch item) still points at the text that caused it. Two nodes are equal when their values are, wherever they are.

use toml_edit::{Document, Item, Key, Value as Toml};

use super::problem::Problem;

/// Which text a [`Span`] points into: index into [`Sources`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SourceId(pub usize);

/// A range of bytes of one source text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// The text.
    pub source: SourceId,
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

/// One text that a pipeline was read from: the file, or one `--set` option.
#[derive(Clone, Debug)]
pub struct Source {
    /// What error messages call it.
    pub name: String,
    /// The text itself.
    pub text: String,
    /// Folder that relative paths in it start from; `None`: the working directory.
    pub base: Option<std::path::PathBuf>,
}

/// All texts that a pipeline was read from.
#[derive(Clone, Debug, Default)]
pub struct Sources(pub Vec<Source>);

impl Sources {
    /// Adds a text and returns its id.
    pub fn add(&mut self, source: Source) -> SourceId {
        self.0.push(source);
        SourceId(self.0.len() - 1)
    }

    /// The text of `id`; ids come from [`Sources::add`] alone.
    pub fn get(&self, id: SourceId) -> Option<&Source> {
        self.0.get(id.0)
    }

    /// Line and column, both from 1, of the first character of `span`; columns count characters.
    pub fn line_column(&self, span: Span) -> (usize, usize) {
        let Some(source) = self.get(span.source) else { return (1, 1) };
        let before = &source.text.as_bytes()[..span.start.min(source.text.len())];
        let line = before.split(|&b| b == b'\n').count();
        let line_start = before.iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
        let column = String::from_utf8_lossy(&before[line_start..]).chars().count() + 1;
        (line, column)
    }
}

/// A value and the span it was read from (`None`: built by a program).
#[derive(Clone, Debug)]
pub struct Node {
    /// The value.
    pub value: Value,
    /// Its span.
    pub span: Option<Span>,
}

/// A TOML value. Dates and times are kept as the text they were written in.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `true` or `false`.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A number; may be NaN or infinite until it is checked.
    Float(f64),
    /// A string, which may contain references `${…}`.
    Text(String),
    /// Text without quotes, from `--set` or the environment: takes the type of the setting.
    Loose(String),
    /// An array.
    List(Vec<Node>),
    /// A table, in the order of the file.
    Table(Vec<Entry>),
    /// What could not be read. The fault was reported: nothing more is said of it.
    Unknown,
}

/// One `key = value`.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The key, unquoted.
    pub key: String,
    /// The span of the key.
    pub key_span: Option<Span>,
    /// The value.
    pub node: Node,
}

impl PartialEq for Node {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key && self.node == other.node
    }
}

impl Node {
    /// A value without a text.
    pub fn built(value: Value) -> Self {
        Self { value, span: None }
    }

    /// The value's type in words, for messages.
    pub fn type_name(&self) -> &'static str {
        match self.value {
            Value::Bool(_) => "a boolean",
            Value::Integer(_) => "an integer",
            Value::Float(_) => "a number",
            Value::Text(_) | Value::Loose(_) => "a string",
            Value::List(_) => "a list",
            Value::Table(_) => "a table",
            Value::Unknown => "unknown",
        }
    }

    /// The string, if it is one.
    pub fn text(&self) -> Option<&str> {
        match &self.value {
            Value::Text(text) | Value::Loose(text) => Some(text),
            _ => None,
        }
    }
}

impl Entry {
    /// An entry without a text.
    pub fn built(key: &str, value: Value) -> Self {
        Self { key: key.to_owned(), key_span: None, node: Node::built(value) }
    }
}

/// Reads the TOML text of `id`.
///
/// # Errors
/// The first fault of syntax, duplicate keys among them, with its span.
pub fn parse(sources: &Sources, id: SourceId) -> Result<Vec<Entry>, Problem> {
    let text = sources.get(id).map_or("", |s| s.text.as_str());
    let document = Document::parse(text).map_err(|error| syntax_problem(id, text, &error))?;
    Ok(entries_of(id, &document))
}

/// The top level of a document.
pub(super) fn entries_of(id: SourceId, document: &Document<&str>) -> Vec<Entry> {
    table_entries(id, document.as_table().iter().map(|(k, item)| (document.as_table().key(k), k, item)))
}

/// Reads one value written as TOML, such as `23`, `"text"` or `[1, 2]`; `None` where it is not TOML.
pub fn parse_value(id: SourceId, text: &str, offset: usize) -> Option<Node> {
    let value: Toml = text.parse().ok()?;
    let mut node = value_node(id, &value);
    respan(&mut node, Span { source: id, start: offset, end: offset + text.len() });
    Some(node)
}

/// Gives a whole tree one span: pieces of an option are too short to be worth pointing into.
fn respan(node: &mut Node, span: Span) {
    node.span = Some(span);
    match &mut node.value {
        Value::List(items) => items.iter_mut().for_each(|n| respan(n, span)),
        Value::Table(entries) => entries.iter_mut().for_each(|e| {
            e.key_span = Some(span);
            respan(&mut e.node, span);
        }),
        _ => {}
    }
}

pub(super) fn syntax_problem(id: SourceId, text: &str, error: &toml_edit::TomlError) -> Problem {
    let range = error.span().unwrap_or(0..0);
    let span = Span { source: id, start: range.start.min(text.len()), end: range.end.min(text.len()) };
    let message = error.message().lines().next().unwrap_or("invalid TOML").to_owned();
    Problem::new("syntax", format!("this is not valid TOML: {message}")).label(Some(span), "here")
}

fn span_of(id: SourceId, range: Option<std::ops::Range<usize>>) -> Option<Span> {
    range.map(|r| Span { source: id, start: r.start, end: r.end })
}

fn table_entries<'a>(id: SourceId, items: impl Iterator<Item = (Option<&'a Key>, &'a str, &'a Item)>) -> Vec<Entry> {
    items
        .filter(|(_, _, item)| !item.is_none())
        .map(|(key, name, item)| Entry {
            key: name.to_owned(),
            key_span: span_of(id, key.and_then(Key::span)),
            node: item_node(id, item),
        })
        .collect()
}

fn item_node(id: SourceId, item: &Item) -> Node {
    let span = span_of(id, item.span());
    let value = match item {
        Item::Value(value) => return value_node(id, value),
        Item::Table(table) => Value::Table(table_entries(id, table.iter().map(|(k, i)| (table.key(k), k, i)))),
        Item::ArrayOfTables(tables) => {
            let one = |t: &toml_edit::Table| Node {
                value: Value::Table(table_entries(id, t.iter().map(|(k, i)| (t.key(k), k, i)))),
                span: span_of(id, t.span()),
            };
            Value::List(tables.iter().map(one).collect())
        }
        Item::None => Value::Table(Vec::new()),
    };
    Node { value, span }
}

fn value_node(id: SourceId, value: &Toml) -> Node {
    let span = span_of(id, value.span());
    let value = match value {
        Toml::String(s) => Value::Text(s.value().clone()),
        Toml::Integer(i) => Value::Integer(*i.value()),
        Toml::Float(f) => Value::Float(*f.value()),
        Toml::Boolean(b) => Value::Bool(*b.value()),
        Toml::Datetime(d) => Value::Text(d.value().to_string()),
        Toml::Array(array) => Value::List(array.iter().map(|v| value_node(id, v)).collect()),
        Toml::InlineTable(table) => {
            let entry = |(key, v): (&str, &Toml)| Entry {
                key: key.to_owned(),
                key_span: span_of(id, table.key(key).and_then(Key::span)),
                node: value_node(id, v),
            };
            Value::Table(table.iter().map(entry).collect())
        }
    };
    Node { value, span }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_columns_count_characters_from_one() {
        let mut sources = Sources::default();
        let id = sources.add(Source { name: "a".into(), text: "a = 1\né = 2 # x\n".into(), base: None });
        let at = |start| sources.line_column(Span { source: id, start, end: start });
        assert_eq!(at(0), (1, 1));
        assert_eq!(at(6), (2, 1));
        assert_eq!(at(11), (2, 5), "é is one column, two bytes");
        assert_eq!(at(999), (3, 1), "past the end is the end");
    }

    #[test]
    fn an_unquoted_time_is_text() {
        let mut sources = Sources::default();
        let id = sources.add(Source { name: "a".into(), text: "start = 00:00:12.5".into(), base: None });
        let entries = parse(&sources, id).unwrap_or_default();
        assert_eq!(entries[0].node.text(), Some("00:00:12.5"));
    }
}
