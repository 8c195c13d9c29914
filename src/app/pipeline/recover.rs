//! Reads a TOML text past its faults, so that one does not hide the others.
//!
//! The parser stops at the first fault. The statement that it is in (a `key = value`, a header) is then mended in a copy of the
//! text and the copy is read again: a value that cannot be read becomes [`Value::Unknown`], which every check passes over; a header gets
//! its bracket; a key that was given before goes; only what is neither is taken out, and then what is missing proves nothing.
//! Spans point into the text as it was.

use std::collections::HashSet;

use toml_edit::{Document, Key};

use super::problem::{MAX_SHOWN, Problem};
use super::syntax::{Entry, Node, SourceId, Sources, Span, Value, entries_of, syntax_problem};

/// Bytes that are parsed in all, repetitions included: a fault near the end of a large text costs a whole pass.
const MAX_WORK: usize = 1 << 26;

/// What could be read of a text.
#[derive(Debug, Default)]
pub(super) struct Recovered {
    /// The top level.
    pub root: Vec<Entry>,
    /// The faults of syntax.
    pub problems: Vec<Problem>,
    /// Something was taken out: a table or key that is missing may have been there.
    pub incomplete: bool,
}

/// Reads the TOML text of `id` as far as it can be read.
pub(super) fn parse_recovering(sources: &Sources, id: SourceId) -> Recovered {
    let text = sources.get(id).map_or("", |s| s.text.as_str());
    if let Ok(document) = Document::parse(text) {
        return Recovered { root: entries_of(id, &document), ..Recovered::default() };
    }
    let mut copy = Copy::of(text);
    let mut out = Recovered::default();
    for _ in 0..(MAX_WORK / text.len().max(1)).clamp(1, MAX_SHOWN) {
        let error = match Document::parse(copy.text.as_str()) {
            Ok(document) => {
                out.root = entries_of(id, &document);
                let unknown = &copy.unknown;
                out.root.iter_mut().for_each(|entry| mark(entry, unknown));
                out.root.iter_mut().for_each(|entry| respan(entry, &copy.origin));
                return out;
            }
            Err(error) => error,
        };
        let at = error.span().map_or(0, |range| range.start).min(copy.text.len());
        let mut problem = syntax_problem(id, &copy.text, &error);
        // What is never closed is noticed at the end of the text.
        let statement = copy.statement_at(at);
        if let Some((span, _)) = problem.labels.first_mut().filter(|_| at > statement.end) {
            let equals = equals_in(&copy.text[statement.start..statement.end]).map_or(0, |equals| equals + 1);
            let end = statement.start + copy.text[statement.start..statement.end].lines().next().map_or(0, str::len);
            (span.start, span.end) = ((statement.start + equals).min(end), end);
        }
        problem.labels.iter_mut().for_each(|(span, _)| *span = original(*span, &copy.origin));
        out.problems.push(problem);
        let before = copy.text.clone();
        out.incomplete |= !copy.mend(at, error.message().contains("duplicate key"));
        // Nothing is left to try.
        if copy.text == before {
            break;
        }
    }
    out.incomplete = true;
    out
}

/// A text that is mended, and where each of its bytes was.
struct Copy {
    text: String,
    /// By the bytes of `text` and one more: positions in the text as it was.
    origin: Vec<usize>,
    /// Positions in `text` of values that could not be read.
    unknown: HashSet<usize>,
}

/// A statement, as a range of bytes without its last line break.
struct Statement {
    start: usize,
    end: usize,
    /// A bracket or string of it is open where the next one begins.
    unclosed: bool,
}

impl Copy {
    fn of(text: &str) -> Self {
        Self { text: text.to_owned(), origin: (0..=text.len()).collect(), unknown: HashSet::new() }
    }

    /// Mends the statement with a fault at `at`; false where something was taken out.
    fn mend(&mut self, at: usize, duplicate: bool) -> bool {
        let Statement { start, end, .. } = self.statement_at(at);
        let statement = &self.text[start..end];
        if statement.trim_start().starts_with('[') {
            return self.mend_header(start, end, duplicate);
        }
        // A key that was given before: the first one counts.
        if duplicate {
            self.blank(start, end);
            return true;
        }
        let Some(equals) = equals_in(statement).filter(|equals| statement[..*equals].parse_key()) else {
            let empty = statement.trim().is_empty();
            self.blank(start, end);
            return empty;
        };
        // A second fault of the same statement is in what was put there: nothing is left to try.
        if self.unknown.contains(&(start + equals + 1)) {
            self.blank(start, end);
            return false;
        }
        self.replace(start + equals + 1, end, "0");
        self.unknown.insert(start + equals + 1);
        true
    }

    /// Gives a header its brackets, or another name where the table was there before; else takes it out with all that it holds.
    fn mend_header(&mut self, start: usize, end: usize, duplicate: bool) -> bool {
        let line = self.text[start..end].split('#').next().unwrap_or_default().trim();
        let name = line.trim_matches(['[', ']', ' ', '\t']).to_owned();
        if name.parse_key() {
            let fresh = (2..100).map(|i| format!("[{name}-{i}]")).find(|header| !self.text.contains(header.as_str()));
            let header = match (duplicate, fresh) {
                (false, _) => format!("[{name}]"),
                (true, Some(header)) if name.starts_with("stage.") => header,
                _ => String::new(),
            };
            if !header.is_empty() && header != line {
                self.replace(start, end, &header);
                return true;
            }
        }
        let mut until = end;
        while until < self.text.len() {
            let next = self.statement_from(until + 1);
            if self.text[next.start..next.end].trim_start().starts_with('[') {
                break;
            }
            until = next.end;
        }
        self.blank(start, until);
        false
    }

    /// The statement to blame for a fault at `at`: the first that is not closed, else the one around it.
    fn statement_at(&self, at: usize) -> Statement {
        let mut statement = self.statement_from(0);
        while !statement.unclosed && statement.end < at && statement.end < self.text.len() {
            statement = self.statement_from(statement.end + 1);
        }
        statement
    }

    /// The statement that begins at `start`, the beginning of a line.
    fn statement_from(&self, start: usize) -> Statement {
        let start = start.min(self.text.len());
        let bytes = self.text.as_bytes();
        let header = self.text[start..].trim_start_matches([' ', '\t']).starts_with('[');
        let (mut i, mut depth, mut string) = (start, 0_usize, None::<(u8, bool)>);
        while i < bytes.len() {
            let long = |quote: u8| bytes[i..].starts_with(&[quote; 3]);
            match (bytes[i], string) {
                (b'\n', _) => {
                    let open = depth > 0 || matches!(string, Some((_, true)));
                    if header || !open {
                        return Statement { start, end: i, unclosed: false };
                    }
                    if begins_statement(self.text[i + 1..].lines().next().unwrap_or_default()) {
                        return Statement { start, end: i, unclosed: true };
                    }
                    // A string of one line ends with it.
                    string = string.filter(|(_, long)| *long);
                }
                (b'\\', Some((b'"', _))) if bytes.get(i + 1).is_some_and(|b| *b != b'\n') => i += 1,
                (quote, Some((open, true))) if quote == open && long(quote) => {
                    string = None;
                    i += 2;
                }
                (quote, Some((open, false))) if quote == open => string = None,
                (b'#', None) => i += bytes[i..].iter().position(|b| *b == b'\n').unwrap_or(bytes.len() - i) - 1,
                (quote @ (b'"' | b'\''), None) if long(quote) => {
                    string = Some((quote, true));
                    i += 2;
                }
                (quote @ (b'"' | b'\''), None) => string = Some((quote, false)),
                (b'[' | b'{', None) => depth += 1,
                (b']' | b'}', None) => depth = depth.saturating_sub(1),
                _ => {}
            }
            i += 1;
        }
        Statement { start, end: bytes.len(), unclosed: false }
    }

    /// Takes out a range; line breaks stay.
    fn blank(&mut self, start: usize, end: usize) {
        let spaces: String = self.text[start..end].bytes().map(|b| if b == b'\n' { '\n' } else { ' ' }).collect();
        self.text.replace_range(start..end, &spaces);
    }

    fn replace(&mut self, start: usize, end: usize, with: &str) {
        let at = self.origin[start];
        self.text.replace_range(start..end, with);
        self.origin.splice(start..end, std::iter::repeat_n(at, with.len()));
        let shift = |position: usize| if position > start { position + with.len() - (end - start) } else { position };
        self.unknown = self.unknown.iter().map(|position| shift(*position)).collect();
    }
}

/// The first `=` outside of quotes.
fn equals_in(statement: &str) -> Option<usize> {
    let mut quote = None;
    statement
        .char_indices()
        .take_while(|(_, c)| *c != '\n' && (quote.is_some() || *c != '#'))
        .collect::<Vec<_>>()
        .into_iter()
        .find_map(|(i, c)| {
            match (c, quote) {
                ('=', None) => return Some(i),
                ('"' | '\'', None) => quote = Some(c),
                (c, Some(open)) if c == open => quote = None,
                _ => {}
            }
            None
        })
}

/// A line that looks like a header or a `key = value`, inside of what has not been closed.
fn begins_statement(line: &str) -> bool {
    let line = line.trim();
    if let Some(rest) = line.strip_prefix('[') {
        let name = rest.trim_start_matches('[').split(']').next().unwrap_or_default().trim();
        return name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.parse_key() && rest.contains(']');
    }
    equals_in(line).is_some_and(|equals| line[..equals].parse_key())
}

/// Whether a text is a key, dotted or not.
trait ParseKey {
    fn parse_key(&self) -> bool;
}

impl ParseKey for str {
    fn parse_key(&self) -> bool {
        let key = self.trim();
        !key.is_empty() && !key.contains('\n') && Key::parse(key).is_ok()
    }
}

/// Marks values that stand for what could not be read.
fn mark(entry: &mut Entry, unknown: &HashSet<usize>) {
    if entry.node.span.is_some_and(|span| unknown.contains(&span.start)) && !matches!(entry.node.value, Value::Table(_))
    {
        entry.node.value = Value::Unknown;
    }
    if let Value::Table(entries) = &mut entry.node.value {
        for entry in entries {
            mark(entry, unknown);
        }
    }
}

fn original(span: Span, origin: &[usize]) -> Span {
    let last = origin.len() - 1;
    let start = origin[span.start.min(last)];
    Span { start, end: origin[span.end.min(last)].max(start), ..span }
}

fn respan(entry: &mut Entry, origin: &[usize]) {
    entry.key_span = entry.key_span.map(|span| original(span, origin));
    respan_node(&mut entry.node, origin);
}

fn respan_node(node: &mut Node, origin: &[usize]) {
    node.span = node.span.map(|span| original(span, origin));
    match &mut node.value {
        Value::List(items) => items.iter_mut().for_each(|node| respan_node(node, origin)),
        Value::Table(entries) => entries.iter_mut().for_each(|entry| respan(entry, origin)),
        _ => {}
    }
}
