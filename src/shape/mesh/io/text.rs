//! Tokenizer for text formats: lines, words and numbers with their positions.

use super::{MeshFormat, malformed};
use crate::mesh::{MeshError, Position};

/// Lines of a file with their numbers, from 1. Line endings are `\n`, `\r\n` or, in a file without `\n`, `\r`. A UTF-8 byte
/// order mark is skipped.
#[derive(Clone, Debug)]
pub(super) struct Lines<'a> {
    rest: Option<&'a [u8]>,
    end: u8,
    number: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn of(bytes: &'a [u8]) -> Self {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let end = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
        Self { rest: Some(bytes), end, number: 0 }
    }

    /// Number of the most recent line.
    pub(super) fn number(&self) -> usize {
        self.number
    }

    /// Bytes not yet read.
    pub(super) fn remaining(&self) -> usize {
        self.rest.map_or(0, <[u8]>::len)
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.rest?;
        let end = rest.iter().position(|&b| b == self.end);
        self.rest = end.map(|end| &rest[end + 1..]);
        let line = &rest[..end.unwrap_or(rest.len())];
        self.number += 1;
        Some((self.number, line))
    }
}

/// Words separated by white space.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// Parses a number; spellings of not-a-number give NaN, so that the caller can report the value.
pub(super) fn number(word: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(word).ok()?;
    text.parse().ok().or_else(|| {
        // Spellings of the Microsoft C runtime: 1.#QNAN, -1.#IND, 1.#INF, -nan(ind).
        let lower = text.to_ascii_lowercase();
        ["#qnan", "#snan", "#ind", "#inf", "nan("].iter().any(|mark| lower.contains(mark)).then_some(f64::NAN)
    })
}

/// Parses an integer.
pub(super) fn whole<T: std::str::FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// The first 40 characters in quotes, for error messages. 160 bytes contain at least 40 characters of UTF-8.
pub(super) fn shown(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(160)]);
    let mut short: String = text.chars().take(40).collect();
    if text.chars().count() > 40 || bytes.len() > 160 {
        short.push('…');
    }
    format!("{short:?}")
}

/// Words of a text with their lines, for formats in which line breaks are plain white space.
#[derive(Clone, Debug)]
pub(super) struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    format: MeshFormat,
    comment: Option<u8>,
}

impl<'a> Words<'a> {
    /// The words from byte `at` in line `line`; text from `comment` to the end of a line is skipped.
    pub(super) fn new(bytes: &'a [u8], at: usize, line: usize, format: MeshFormat, comment: Option<u8>) -> Self {
        Self { bytes, at, line, format, comment }
    }

    /// Line of the most recent word.
    pub(super) fn position(&self) -> Position {
        Position::Line(self.line)
    }

    /// Bytes not yet read.
    pub(super) fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    pub(super) fn fault(&self, fault: impl Into<String>) -> MeshError {
        malformed(self.format, self.position(), fault)
    }

    /// The next word; `None` at the end of the file.
    pub(super) fn next_word(&mut self) -> Option<&'a [u8]> {
        loop {
            let &byte = self.bytes.get(self.at)?;
            if Some(byte) == self.comment {
                self.rest_of_line();
            } else if byte.is_ascii_whitespace() {
                self.line += usize::from(byte == b'\n');
                self.at += 1;
            } else {
                break;
            }
        }
        let rest = &self.bytes[self.at..];
        let ends = |b: &u8| b.is_ascii_whitespace() || Some(*b) == self.comment;
        let word = &rest[..rest.iter().position(ends).unwrap_or(rest.len())];
        self.at += word.len();
        Some(word)
    }

    /// The remaining text of the line, without the line ending.
    pub(super) fn rest_of_line(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let line = &rest[..rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len())];
        self.at += line.len();
        line
    }

    /// The next word; an error at the end of the file.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a [u8], MeshError> {
        self.next_word()
            .ok_or_else(|| self.fault(format!("the file ends where {what} should follow; it may be cut short")))
    }

    pub(super) fn number(&mut self, what: &str) -> Result<f64, MeshError> {
        let word = self.word(what)?;
        number(word).ok_or_else(|| self.fault(format!("{} is not a number ({what})", shown(word))))
    }

    pub(super) fn whole<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, MeshError> {
        let word = self.word(what)?;
        whole(word).ok_or_else(|| self.fault(format!("{} is not a whole number ({what})", shown(word))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_every_way_there_is() {
        for text in ["a\nb\n\nc", "a\r\nb\r\n\r\nc", "a\rb\r\rc"] {
            let lines: Vec<_> = Lines::of(text.as_bytes()).map(|(n, line)| (n, line.trim_ascii())).collect();
            assert_eq!(lines, [(1, &b"a"[..]), (2, b"b"), (3, b""), (4, b"c")], "{text:?}");
        }
    }

    #[test]
    fn words_know_their_lines_and_skip_comments() {
        let mut words = Words::new(b"a # x\n\n b#y\nc", 0, 1, MeshFormat::Off, Some(b'#'));
        let mut seen = Vec::new();
        while let Some(word) = words.next_word() {
            seen.push((word, words.position()));
        }
        assert_eq!(seen, [(&b"a"[..], Position::Line(1)), (b"b", Position::Line(3)), (b"c", Position::Line(4))]);
    }

    #[test]
    fn not_a_number_is_told_from_no_number() {
        for word in ["nan", "-NaN", "1.#QNAN", "-1.#IND", "-nan(ind)", "inf", "1e999"] {
            assert!(number(word.as_bytes()).is_some_and(|x| !x.is_finite()), "{word}");
        }
        assert_eq!((number(b"1,5"), number(b"x"), number(b"1e-3")), (None, None, Some(0.001)));
    }
}
