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
        self.word_of(|| what.to_owned())
    }

    /// [`Self::word`], described only if it is missing.
    fn word_of(&mut self, what: impl FnOnce() -> String) -> Result<&'a str, RigFileError> {
        let found = self.next();
        found.ok_or_else(|| self.fault(format!("the file ends where {} is expected; it is cut short", what())))
    }

    /// Expects this word.
    pub(super) fn expect(&mut self, word: &str) -> Result<(), RigFileError> {
        let found = self.word(word)?;
        let fits = found.eq_ignore_ascii_case(word);
        fits.then_some(()).ok_or_else(|| self.fault(format!("{:?}, where {word} is expected", shown(found))))
    }

    /// The next word as a finite number.
    pub(super) fn number(&mut self, what: &str) -> Result<f64, RigFileError> {
        self.number_of(|| what.to_owned())
    }

    /// [`Self::number`], described only if it is missing.
    pub(super) fn number_of(&mut self, what: impl Fn() -> String) -> Result<f64, RigFileError> {
        let word = self.word_of(&what)?;
        let value = word.parse().ok().filter(|x: &f64| x.is_finite());
        let fault = || format!("{:?} is no finite number, where {} is expected", shown(word), what());
        value.ok_or_else(|| self.fault(fault()))
    }

    /// The next three words as finite numbers.
    pub(super) fn triple(&mut self, what: &str) -> Result<[f64; 3], RigFileError> {
        Ok([self.number(what)?, self.number(what)?, self.number(what)?])
    }

    /// The next word as a count of at most `most`.
    pub(super) fn count(&mut self, what: &str, most: usize) -> Result<usize, RigFileError> {
        let word = self.word(what)?;
        let value = word.parse().ok().filter(|n| *n <= most);
        value.ok_or_else(|| self.fault(format!("{:?}, where {what} is expected (0 to {most})", shown(word))))
    }

    /// An error at the current line.
    pub(super) fn fault(&self, fault: impl std::fmt::Display) -> RigFileError {
        malformed(self.format, self.line, fault)
    }
}

/// The beginning of a text, for messages: a hostile one may be as long as the file.
pub(super) fn shown(text: &str) -> String {
    const MAX: usize = 60;
    let mut short: String = text.chars().take(MAX).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
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
