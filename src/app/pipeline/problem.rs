//! What is wrong with a pipeline: every fault at once, each with its span and a remedy.

use std::fmt;

use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, NamedSource};
use serde_json::json;

use super::syntax::{Sources, Span};

/// Longest line that is drawn, bytes; of longer ones an excerpt is shown.
const MAX_LINE: usize = 400;
/// Characters of an excerpt before and after the column of the fault.
const EXCERPT: (usize, usize) = (30, 50);

/// Faults that are shown; of more, their number.
pub const MAX_SHOWN: usize = 50;

/// One fault.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Stable short name of the class of fault, for programs.
    pub code: &'static str,
    /// What is wrong, with the value and the allowed range.
    pub message: String,
    /// Spans that take part in it, the culprit first.
    pub labels: Vec<(Span, String)>,
    /// What to do.
    pub help: Option<String>,
}

impl Problem {
    /// A fault without a span.
    pub fn new(code: &'static str, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), labels: Vec::new(), help: None }
    }

    /// Points at `span`; nothing happens where there is none.
    #[must_use]
    pub fn label(mut self, span: Option<Span>, text: impl Into<String>) -> Self {
        self.labels.extend(span.map(|s| (s, text.into())));
        self
    }

    /// It says that something is missing.
    pub(super) fn is_of_absence(&self) -> bool {
        let variable = self.code == "reference" && self.message.ends_with("refers to no variable");
        let missing = ["missing-key", "no-stages", "no-output", "input", "set", "disabled"].contains(&self.code);
        variable || missing || (self.code == "version" && self.labels.is_empty())
    }

    /// Says what to do.
    #[must_use]
    pub fn help(mut self, text: impl Into<String>) -> Self {
        self.help = Some(text.into());
        self
    }

    /// Says "did you mean …" where there is something to suggest.
    #[must_use]
    pub fn suggest(mut self, text: Option<String>) -> Self {
        self.help = text.or(self.help);
        self
    }
}

/// Every fault that was found, with the texts they point into. Never empty where it is an error.
#[derive(Clone, Debug)]
pub struct Problems {
    /// The faults, in the order of the text.
    pub problems: Vec<Problem>,
    /// The texts.
    pub sources: Sources,
}

impl Problems {
    /// Sorted by span, those without a span last.
    pub fn new(mut problems: Vec<Problem>, sources: Sources) -> Self {
        let start = |p: &Problem| p.labels.first().map_or((usize::MAX, 0), |(s, _)| (s.source.0, s.start));
        problems.sort_by_key(start);
        problems.dedup();
        Self { problems, sources }
    }

    /// Text for people: each fault with the lines it points at, at most `width` columns wide.
    pub fn render(&self, color: bool, width: usize) -> String {
        let theme = if color { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
        let handler = GraphicalReportHandler::new_themed(theme).with_width(width).with_links(false);
        let mut out = String::new();
        for problem in self.problems.iter().take(MAX_SHOWN) {
            let shown = Located { problem, sources: &self.sources, text: self.named_source(problem) };
            let drawable = shown.text.is_some() && !self.is_on_long_lines(problem);
            if !drawable || handler.render_report(&mut out, &shown).is_err() {
                out.push_str(&self.plain(problem));
            }
        }
        if let Some(more) = self.further() {
            out.extend(["and ", &more.to_string(), " further errors\n"]);
        }
        out
    }

    /// Number of faults that are not shown.
    fn further(&self) -> Option<usize> {
        self.problems.len().checked_sub(MAX_SHOWN).filter(|more| *more > 0)
    }

    /// One object per fault: `{code, severity, message, file, span: {line, column, length}, help}`. Of more than [`MAX_SHOWN`]
    /// the last, of code `further`, states the number of those left out.
    pub fn to_json(&self) -> serde_json::Value {
        let one = |p: &Problem| {
            let span = p.labels.first().map(|(span, _)| {
                let (line, column) = self.sources.line_column(*span);
                json!({"line": line, "column": column, "length": span.end - span.start})
            });
            let file = p.labels.first().and_then(|(s, _)| self.sources.get(s.source)).map(|s| s.name.clone());
            json!({"code": p.code, "severity": "error", "message": p.message, "file": file, "span": span, "help": p.help})
        };
        let further = self.further().map(|more| {
            let message = format!("and {more} further errors");
            json!({"code": "further", "severity": "error", "message": message, "file": null, "span": null, "help": null})
        });
        self.problems.iter().take(MAX_SHOWN).map(one).chain(further).collect()
    }

    /// A line that would be drawn, one with a label or beside one, is too long to be read.
    fn is_on_long_lines(&self, problem: &Problem) -> bool {
        let long = |span: &Span| {
            let (line, _) = self.sources.line_column(*span);
            let text = self.sources.get(span.source).map_or("", |source| source.text.as_str());
            text.lines().skip(line.saturating_sub(2)).take(3).any(|line| line.len() > MAX_LINE)
        };
        problem.labels.iter().any(|(span, _)| long(span))
    }

    /// The fault without a drawing: where it is, and what is around the column.
    fn plain(&self, problem: &Problem) -> String {
        let excerpt = |(span, label): &(Span, String)| {
            let (line, column) = self.sources.line_column(*span);
            let source = self.sources.get(span.source)?;
            let text = source.text.lines().nth(line - 1)?;
            let from = (column - 1).saturating_sub(EXCERPT.0);
            let around: String = text.chars().skip(from).take(EXCERPT.0 + EXCERPT.1).collect();
            Some(format!("  {}:{line}:{column}: … {around} …: {label}\n", source.name))
        };
        let excerpt = problem.labels.first().and_then(excerpt).unwrap_or_default();
        let help = problem.help.as_ref().map(|h| format!("  help: {h}\n")).unwrap_or_default();
        format!("error: {}\n{excerpt}{help}", problem.message)
    }

    fn named_source(&self, problem: &Problem) -> Option<NamedSource<String>> {
        let (span, _) = problem.labels.first()?;
        let source = self.sources.get(span.source)?;
        Some(NamedSource::new(&source.name, source.text.clone()))
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, p) in self.problems.iter().enumerate() {
            let separator = if i == 0 { "" } else { "\n" };
            write!(f, "{separator}{}", p.message)?;
        }
        Ok(())
    }
}

impl std::error::Error for Problems {}

/// A problem beside its text, in the form that miette draws.
struct Located<'a> {
    problem: &'a Problem,
    sources: &'a Sources,
    text: Option<NamedSource<String>>,
}

impl fmt::Debug for Located<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.problem.message)
    }
}

impl fmt::Display for Located<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.problem.message)
    }
}

impl std::error::Error for Located<'_> {}

impl Diagnostic for Located<'_> {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.problem.help.as_ref().map(|h| Box::new(h) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        self.text.as_ref().map(|t| t as &dyn miette::SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let source = self.problem.labels.first()?.0.source;
        let length = self.sources.get(source).map_or(0, |s| s.text.len());
        let inside = self.problem.labels.iter().filter(move |(s, _)| s.source == source);
        Some(Box::new(inside.map(move |(s, text)| {
            let start = s.start.min(length);
            LabeledSpan::new(Some(text.clone()), start, s.end.clamp(start, length) - start)
        })))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::syntax::{Source, parse};

    #[test]
    fn of_a_long_line_what_is_around_the_fault_is_shown() {
        let numbers = "1, ".repeat(60_000);
        let mut sources = Sources::default();
        let id = sources.add(Source { name: "a.toml".into(), text: format!("a = [{numbers}x]\n"), base: None });
        let problem = parse(&sources, id).expect_err("x is no value");
        let text = Problems::new(vec![problem], sources).render(false, 100);
        assert!(text.starts_with("error: this is not valid TOML") && text.contains("a.toml:1:180006"), "{text}");
        assert!(text.contains("1, 1, x]") && text.len() < 400, "{text}");
    }
}
