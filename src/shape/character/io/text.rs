//! Words and numbers of text files, with the lines they stand in.

use super::RigFileError;

/// Words of a text, one after the other.
pub(super) struct Words<'a> {
    format: &'static str,
    lines: std::iter::Peekable<std::iter::Enumerate<std::str::Lines<'a>>>,
    /// What is left of the present line, and its number.
    rest: std::str::SplitWhitespace<'a>,
    line: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(format: &'static str, text: &'a str) -> Self {
        Self { format, lines: text.lines().enumerate().peekable(), rest: "".split_whitespace(), line: 1 }
    }

    /// The next word; none at the end.
    pub(super) fn next(&mut self) -> Option<&'a str> {
        loop {
            if let Some(word) = self.rest.next() {
                return Some(word);
            }
            let (number, line) = self.lines.next()?;
            (self.line, self.rest) = (number + 1, line.split_whitespace());
        }
    }

    /// The rest of the present line, as words.
    pub(super) fn rest_of_line(&mut self) -> Vec<&'a str> {
        self.rest.by_ref().collect()
    }

    /// The next word, which `what` is; the end of the file is a fault.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a str, RigFileError> {
        let end = self.fault(format!("the file ends where {what} is expected; it is cut short"));
        self.next().ok_or(end)
    }

    /// The next word must be this one.
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

    /// A fault in the present line.
    pub(super) fn fault(&self, fault: impl Into<String>) -> RigFileError {
        malformed(self.format, self.line, fault)
    }
}

/// A fault of a text file.
pub(super) fn malformed(format: &'static str, line: usize, fault: impl Into<String>) -> RigFileError {
    RigFileError::Malformed { format, line, fault: fault.into() }
}

/// A name that is one word.
pub(super) fn one_word(name: &str) -> String {
    let word: Vec<&str> = name.split_whitespace().collect();
    if word.is_empty() { "_".to_owned() } else { word.join("_") }
}
