//! Tokenizer of text files, with line numbers.

use crate::character::RigFileError;

/// The words of a text, in order.
pub(super) struct Words<'a> {
    format: &'static str,
    lines: std::iter::Peekable<std::iter::Enumerate<std::str::Lines<'a>>>,
    /// Rest of the current line, and its number.
    rest: std::str::SplitWhitespace<'a>,
    line: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(format: &'static str, text: &'a str) -> Self {
        Self { format, lines: text.lines().enumerate().peekable(), rest: "".split_whitespace(), line: 1 }
    }

    /// The next word; `None` at the end.
    pub(super) fn next(&mut self) -> Option<&'a str> {
        loop {
            if let Some(word) = self.rest.next() {
                return Some(word);
            }
            let (number, line) = self.lines.next()?;
            (self.line, self.rest) = (number + 1, line.split_whitespace());
        }
    }

    /// The remaining words of the current line.
    pub(super) fn rest_of_line(&mut self) -> Vec<&'a str> {
        self.rest.by_ref().collect()
    }

    /// The next word, described by `what`; the end of the file is an error.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a str, RigFileError> {
        let end = self.fault(format!("the file ends where {what} is expected; it is cut short"));
        self.next().ok_or(end)
    }

    /// Expects this word.
    pub(super) fn expect(&mut self, word: &str) -> Result<(), RigFileError> {
        let found = self.word(word)?;
        let fits = found.eq_ignore_ascii_case(word);
        fits.then_some(()).ok_or_else(|| self.fault(format!("{found:?}, where {word} is expected")))
    }

    /// The next word as a finite number.
    pub(super) fn number(&mut self, what: &str) -> Result<f64, RigFileError> {
        let word = self.word(what)?;
        let value = word.parse().ok().filter(|x: &f64| x.is_finite());
        value.ok_or_else(|| self.fault(format!("{word:?} is no finite number, where {what} is expected")))
    }

    /// The next three words as finite numbers.
    pub(super) fn triple(&mut self, what: &str) -> Result<[f64; 3], RigFileError> {
        Ok([self.number(what)?, self.number(what)?, self.number(what)?])
    }

    /// The next word as a count of at most `most`.
    pub(super) fn count(&mut self, what: &str, most: usize) -> Result<usize, RigFileError> {
        let word = self.word(what)?;
        let value = word.parse().ok().filter(|n| *n <= most);
        value.ok_or_else(|| self.fault(format!("{word:?}, where {what} is expected (0 to {most})")))
    }

    /// An error at the current line.
    pub(super) fn fault(&self, fault: impl std::fmt::Display) -> RigFileError {
        malformed(self.format, self.line, fault)
    }
}

/// An error in a text file.
pub(super) fn malformed(format: &str, line: usize, fault: impl std::fmt::Display) -> RigFileError {
    RigFileError::Content(format!("{format}, line {line}: {fault}"))
}

/// The name with whitespace replaced by `_`.
pub(super) fn one_word(name: &str) -> String {
    let word: Vec<&str> = name.split_whitespace().collect();
    if word.is_empty() { "_".to_owned() } else { word.join("_") }
}
