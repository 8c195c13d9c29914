//! Tags of an XML text, one after another, as byte ranges: as much as corrections in the text need.
//!
//! Comments, processing instructions and character data are passed over. Documents with a type declaration, which XMP must not have,
//! are refused: entities would change what the text means.

use std::ops::Range;

/// Kind of a tag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Open,
    Close,
    Empty,
}

/// An attribute.
#[derive(Clone, Debug)]
pub(super) struct Attribute {
    pub(super) name: Range<usize>,
    /// Without its quotes.
    pub(super) value: Range<usize>,
    /// With the space before it.
    pub(super) whole: Range<usize>,
}

/// A tag.
#[derive(Clone, Debug)]
pub(super) struct Tag {
    pub(super) kind: Kind,
    pub(super) name: Range<usize>,
    pub(super) attributes: Vec<Attribute>,
    pub(super) whole: Range<usize>,
}

/// The text is no XML, or of a kind that XMP is not.
#[derive(Clone, Copy, Debug)]
pub(super) struct NotXml;

/// The tags of a text.
#[derive(Clone, Debug)]
pub(super) struct Tags<'t> {
    text: &'t str,
    at: usize,
}

/// Sections that are passed over, by how they begin and end.
const PASSED: [(&str, &str); 3] = [("<!--", "-->"), ("<?", "?>"), ("<![CDATA[", "]]>")];

impl<'t> Tags<'t> {
    pub(super) const fn new(text: &'t str) -> Self {
        Self { text, at: 0 }
    }

    /// Where the next tag is looked for.
    pub(super) const fn at(&self) -> usize {
        self.at
    }

    /// The next tag; `None` at the end.
    pub(super) fn next_tag(&mut self) -> Result<Option<Tag>, NotXml> {
        loop {
            let Some(start) = self.text[self.at..].find('<').map(|i| self.at + i) else {
                self.at = self.text.len();
                return Ok(None);
            };
            let rest = &self.text[start..];
            if let Some((open, close)) = PASSED.into_iter().find(|(open, _)| rest.starts_with(open)) {
                let length = rest[open.len()..].find(close).ok_or(NotXml)?;
                self.at = start + open.len() + length + close.len();
                continue;
            }
            let tag = tag(self.text, start).ok_or(NotXml)?;
            self.at = tag.whole.end;
            return Ok(Some(tag));
        }
    }

    /// The text from here to the next tag, where that closes `name`.
    pub(super) fn text_before_closing(&self, name: &str) -> Option<Range<usize>> {
        let end = self.at + self.text[self.at..].find('<')?;
        let after = self.text[end..].strip_prefix("</")?.strip_prefix(name)?;
        after.starts_with(|c: char| c == '>' || c.is_ascii_whitespace()).then_some(self.at..end)
    }

    /// Goes behind the tag that closes the element `name`, whose opening tag was the last.
    pub(super) fn skip_to_close(&mut self, name: &str) -> Option<()> {
        let mut depth = 1_usize;
        while depth > 0 {
            let tag = self.next_tag().ok()??;
            if &self.text[tag.name] == name {
                match tag.kind {
                    Kind::Open => depth += 1,
                    Kind::Close => depth -= 1,
                    Kind::Empty => {}
                }
            }
        }
        Some(())
    }
}

/// The tag that begins at `start`, where `<` is.
fn tag(text: &str, start: usize) -> Option<Tag> {
    let bytes = text.as_bytes();
    let closes = bytes.get(start + 1) == Some(&b'/');
    let first = start + 1 + usize::from(closes);
    let name = first..name_end(bytes, first)?;
    let (mut at, mut attributes) = (name.end, Vec::new());
    loop {
        let before = at;
        at += bytes[at..].iter().take_while(|b| b.is_ascii_whitespace()).count();
        match (*bytes.get(at)?, bytes.get(at + 1)) {
            (b'>', _) => {
                let kind = if closes { Kind::Close } else { Kind::Open };
                return Some(Tag { kind, name, attributes, whole: start..at + 1 });
            }
            (b'/', Some(b'>')) if !closes => {
                return Some(Tag { kind: Kind::Empty, name, attributes, whole: start..at + 2 });
            }
            _ if before == at || closes => return None,
            _ => {}
        }
        let attribute = attribute(bytes, before, at)?;
        at = attribute.whole.end;
        attributes.push(attribute);
    }
}

fn attribute(bytes: &[u8], before: usize, start: usize) -> Option<Attribute> {
    let name = start..name_end(bytes, start)?;
    let space = |at: usize| at + bytes[at..].iter().take_while(|b| b.is_ascii_whitespace()).count();
    let equals = space(name.end);
    if *bytes.get(equals)? != b'=' {
        return None;
    }
    let quote = space(equals + 1);
    let mark = *bytes.get(quote)?;
    if !matches!(mark, b'"' | b'\'') {
        return None;
    }
    let length = bytes[quote + 1..].iter().position(|b| *b == mark || *b == b'<')?;
    let value = quote + 1..quote + 1 + length;
    (bytes[value.end] == mark).then(|| Attribute { name, whole: before..value.end + 1, value })
}

/// Where a name ends; `None` where there is none.
fn name_end(bytes: &[u8], start: usize) -> Option<usize> {
    let is_name = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b':' | b'_' | b'-' | b'.') || *b >= 0x80;
    let length = bytes.get(start..)?.iter().take_while(|b| is_name(b)).count();
    (length > 0).then_some(start + length)
}
