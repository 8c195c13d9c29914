//! References in strings: `${vars.x}`, `${env.X:-default}`, `${item.path|stem|name|dir|rel|ext|index}`.
//!
//! Substitution happens on parsed strings, never on raw text, so a value cannot inject syntax. A string that is one single
//! reference takes the type of the value it refers to. `$${` is a literal `${`. No functions and no conditionals.

use std::path::{Path, PathBuf};

use super::paths::to_text;
use super::problem::Problem;
use super::suggest::{did_you_mean, listed};
use super::syntax::{Entry, Node, SourceId, Span, Value};

/// One item of a batch: the file that an instance of the graph works on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// The file, as found.
    pub path: PathBuf,
    /// Its folder, relative to the folder or the root of the glob that it was found under; `.` for a file that was named itself.
    pub rel: PathBuf,
    /// Position in the batch, from 0.
    pub index: usize,
}

/// The fields of `${item.…}`.
pub const ITEM_FIELDS: [&str; 7] = ["path", "stem", "name", "dir", "rel", "ext", "index"];

impl Item {
    fn field(&self, name: &str) -> Option<Value> {
        let text = |part: Option<&std::ffi::OsStr>| Value::Text(to_text(part.unwrap_or_default()));
        Some(match name {
            "path" => text(Some(self.path.as_os_str())),
            "stem" => text(self.path.file_stem()),
            "name" => text(self.path.file_name()),
            "dir" => {
                text(Some(self.path.parent().filter(|p| *p != Path::new("")).unwrap_or(Path::new(".")).as_os_str()))
            }
            "rel" => text(Some(self.rel.as_os_str())),
            "ext" => text(self.path.extension()),
            "index" => Value::Integer(i64::try_from(self.index).unwrap_or(i64::MAX)),
            _ => return None,
        })
    }
}

/// What references may refer to.
#[derive(Clone, Copy)]
pub struct Scope<'a> {
    /// `[vars]`.
    pub vars: &'a [Entry],
    /// The environment.
    pub env: &'a dyn Fn(&str) -> Option<String>,
    /// The item at hand; `None` while the graph is checked before any item is known.
    pub item: Option<&'a Item>,
}

/// A value without references.
#[derive(Clone, Debug, PartialEq)]
pub enum Resolved {
    /// The value, at the span of the string that refers to it, and the text whose folder a relative path in it starts from
    /// (`None`: the working directory).
    Ready(Node, Option<SourceId>),
    /// It depends on the item, which is not known yet.
    Deferred,
}

/// Text in which no `${` is a reference: what a program passes where a file would write a string.
pub fn escape(text: &str) -> String {
    text.replace("${", "$${")
}

/// Replaces the references of `node`, lists and tables included.
///
/// # Errors
/// The first reference that is malformed, or refers to nothing.
pub fn resolve(node: &Node, scope: &Scope<'_>) -> Result<Resolved, Problem> {
    let source = node.span.map(|s| s.source);
    match &node.value {
        Value::Text(text) => resolve_text(text, node.span, scope),
        Value::List(items) => {
            let mut out = Vec::with_capacity(items.len());
            for item in items {
                match resolve(item, scope)? {
                    Resolved::Ready(n, _) => out.push(n),
                    Resolved::Deferred => return Ok(Resolved::Deferred),
                }
            }
            Ok(Resolved::Ready(Node { value: Value::List(out), span: node.span }, source))
        }
        _ => Ok(Resolved::Ready(node.clone(), source)),
    }
}

/// What part of a string is.
#[derive(Debug, PartialEq)]
enum Piece {
    Literal(String),
    Reference(String),
}

fn pieces(text: &str) -> Result<Vec<Piece>, String> {
    let (mut out, mut literal, mut rest) = (Vec::new(), String::new(), text);
    while let Some(at) = rest.find("${") {
        if rest[..at].ends_with('$') {
            literal.push_str(&rest[..at - 1]);
            literal.push_str("${");
            rest = &rest[at + 2..];
            continue;
        }
        literal.push_str(&rest[..at]);
        let Some(length) = rest[at..].find('}') else {
            return Err(format!("`{}` has no closing `}}`", &rest[at..]));
        };
        if !literal.is_empty() {
            out.push(Piece::Literal(std::mem::take(&mut literal)));
        }
        out.push(Piece::Reference(rest[at + 2..at + length].trim().to_owned()));
        rest = &rest[at + length + 1..];
    }
    literal.push_str(rest);
    if !literal.is_empty() || out.is_empty() {
        out.push(Piece::Literal(literal));
    }
    Ok(out)
}

fn resolve_text(text: &str, span: Option<Span>, scope: &Scope<'_>) -> Result<Resolved, Problem> {
    let own = span.map(|s| s.source);
    let pieces = pieces(text).map_err(|message| {
        Problem::new("reference", message).label(span, "unfinished reference").help("write `$${` for a literal `${`")
    })?;
    if let [Piece::Reference(name)] = pieces.as_slice() {
        return Ok(match look_up(name, span, scope)? {
            Some((value, base)) => Resolved::Ready(Node { value, span }, base),
            None => Resolved::Deferred,
        });
    }
    let (mut out, mut base, mut deferred) = (String::new(), own, false);
    for (i, piece) in pieces.iter().enumerate() {
        match piece {
            Piece::Literal(text) => out.push_str(text),
            Piece::Reference(name) => match look_up(name, span, scope)? {
                Some((Value::Unknown, base)) => {
                    return Ok(Resolved::Ready(Node { value: Value::Unknown, span }, base));
                }
                Some((value, from)) => {
                    out.push_str(&scalar_text(&value, name, span)?);
                    base = if i == 0 { from } else { base };
                }
                None => deferred = true,
            },
        }
    }
    Ok(if deferred { Resolved::Deferred } else { Resolved::Ready(Node { value: Value::Text(out), span }, base) })
}

fn scalar_text(value: &Value, name: &str, span: Option<Span>) -> Result<String, Problem> {
    match value {
        Value::Bool(b) => Ok(b.to_string()),
        Value::Integer(i) => Ok(i.to_string()),
        Value::Float(x) => Ok(x.to_string()),
        Value::Text(text) | Value::Loose(text) => Ok(text.clone()),
        Value::List(_) | Value::Table(_) | Value::Unknown => {
            Err(Problem::new("reference", format!("`${{{name}}}` is a list and cannot be part of a string"))
                .label(span, "used here")
                .help("a list needs the whole string to itself"))
        }
    }
}

/// The value of a reference and the text it comes from; `None` where it waits for the item.
type Found = Option<(Value, Option<SourceId>)>;

fn look_up(name: &str, span: Option<Span>, scope: &Scope<'_>) -> Result<Found, Problem> {
    let found = match name.split_once('.') {
        Some(("vars", var)) => variable(var, scope).map(Some),
        Some(("env", var)) => environment(var, scope).map(Some),
        Some(("item", field)) if ITEM_FIELDS.contains(&field) => {
            Ok(scope.item.and_then(|item| item.field(field)).map(|value| (value, None)))
        }
        Some(("item", field)) => {
            let problem = Problem::new("reference", format!("`${{item.{field}}}` is no field of an item"));
            Err(problem.suggest(did_you_mean(field, ITEM_FIELDS)))
        }
        _ => {
            let kinds = listed(&["${vars.NAME}", "${env.NAME}", "${item.FIELD}"]);
            Err(Problem::new("reference", format!("`${{{name}}}` refers to nothing"))
                .help(format!("a reference is {kinds}")))
        }
    };
    found.map_err(|problem| problem.label(span, "used here"))
}

fn variable(name: &str, scope: &Scope<'_>) -> Result<(Value, Option<SourceId>), Problem> {
    if let Some(entry) = scope.vars.iter().find(|e| e.key == name) {
        return Ok((entry.node.value.clone(), entry.node.span.map(|s| s.source)));
    }
    let suggestion = did_you_mean(name, scope.vars.iter().map(|e| e.key.as_str()));
    Err(Problem::new("reference", format!("`${{vars.{name}}}` refers to no variable"))
        .help(format!("add `{name} = …` to [vars]"))
        .suggest(suggestion))
}

fn environment(reference: &str, scope: &Scope<'_>) -> Result<(Value, Option<SourceId>), Problem> {
    let (name, default) = reference.split_once(":-").map_or((reference, None), |(n, d)| (n, Some(d.to_owned())));
    let text = (scope.env)(name).filter(|v| !v.is_empty()).or(default).ok_or_else(|| {
        Problem::new("reference", format!("environment variable `{name}` is not set"))
            .help(format!("set it, or write `${{env.{name}:-default}}`"))
    })?;
    Ok((Value::Loose(text), None))
}

/// True where a string anywhere in `node` refers to the item.
pub fn refers_to_item(node: &Node) -> bool {
    match &node.value {
        Value::Text(text) => pieces(text)
            .is_ok_and(|p| p.iter().any(|p| matches!(p, Piece::Reference(name) if name.starts_with("item.")))),
        Value::List(items) => items.iter().any(refers_to_item),
        Value::Table(entries) => entries.iter().any(|e| refers_to_item(&e.node)),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Result<Resolved, String> {
        let vars = [Entry::built("crf", Value::Integer(23)), Entry::built("dir", Value::Text("out".into()))];
        let item = Item { path: "clips/day 1/tour.one.mp4".into(), rel: "day 1".into(), index: 4 };
        let env = |name: &str| (name == "HOME").then(|| "/users/ada".to_owned());
        let scope = Scope { vars: &vars, env: &env, item: Some(&item) };
        resolve(&Node::built(Value::Text(text.into())), &scope).map_err(|p| p.message)
    }

    fn ready(value: Value) -> Resolved {
        Resolved::Ready(Node::built(value), None)
    }

    #[test]
    fn a_lone_reference_keeps_its_type_and_others_become_text() {
        assert_eq!(value("${vars.crf}"), Ok(ready(Value::Integer(23))));
        assert_eq!(value("${ vars.crf }"), Ok(ready(Value::Integer(23))));
        assert_eq!(value("crf${vars.crf}"), Ok(ready(Value::Text("crf23".into()))));
        assert_eq!(value("${item.index}"), Ok(ready(Value::Integer(4))));
        assert_eq!(value("${vars.dir}/${item.stem}.${item.ext}"), Ok(ready(Value::Text("out/tour.one.mp4".into()))));
        assert_eq!(value("${item.dir}|${item.name}"), Ok(ready(Value::Text("clips/day 1|tour.one.mp4".into()))));
        assert_eq!(value("out/${item.rel}"), Ok(ready(Value::Text("out/day 1".into()))));
        assert_eq!(value("${env.HOME}/x"), Ok(ready(Value::Text("/users/ada/x".into()))));
        assert_eq!(value("${env.NONE:-7}"), Ok(ready(Value::Loose("7".into()))));
    }

    #[test]
    fn what_is_escaped_comes_back_as_it_was() {
        for text in ["", "plain", "${vars.crf}", "$${a}", "a$", "$$${x", "cost: 5$"] {
            assert_eq!(value(&escape(text)), Ok(ready(Value::Text(text.into()))), "{text}");
        }
    }

    #[test]
    fn a_reference_to_nothing_is_named() {
        assert_eq!(value("${vars.cfr}"), Err("`${vars.cfr}` refers to no variable".into()));
        assert_eq!(value("${item.steam}"), Err("`${item.steam}` is no field of an item".into()));
        assert_eq!(value("${env.NOPE}"), Err("environment variable `NOPE` is not set".into()));
        assert_eq!(value("${nope}"), Err("`${nope}` refers to nothing".into()));
        assert_eq!(value("a ${vars.crf"), Err("`${vars.crf` has no closing `}`".into()));
    }
}
