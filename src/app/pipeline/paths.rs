//! Paths as the strings of settings, and back: no file name is lost on the way.
//!
//! Settings, references and JSON are text, names of files are bytes. A byte that is not part of valid UTF-8 becomes the character
//! U+10FF00 + byte of a private plane, and back; so does each byte of such a character where a name has one, so that two names
//! never become one text. Names in UTF-8, which is nearly all, are their own text. It is what Python calls `surrogateescape`,
//! with characters that a string can hold.

use std::borrow::Cow;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// What a byte is added to.
const ESCAPED: u32 = 0x10_FF00;

/// The byte that a character stands for.
fn byte_of(c: char) -> Option<u8> {
    (u32::from(c)).checked_sub(ESCAPED).and_then(|byte| u8::try_from(byte).ok()).filter(|byte| *byte >= 0x80)
}

/// The character that stands for a byte, which is none of ASCII.
fn char_of(byte: u8) -> char {
    char::from_u32(ESCAPED + u32::from(byte)).unwrap_or(char::REPLACEMENT_CHARACTER)
}

/// A name or a path as the text of a setting; [`to_path`] gives it back.
///
/// ```
/// # use plumbline_app::pipeline::paths::{to_path, to_text};
/// # use std::path::Path;
/// assert_eq!(to_text("clips/süd.mp4"), "clips/süd.mp4");
/// # #[cfg(unix)] {
/// use std::os::unix::ffi::OsStrExt;
/// let name = std::ffi::OsStr::from_bytes(b"s\xfcd.mp4");
/// assert_eq!(to_text(name), "s\u{10fffc}d.mp4");
/// assert_eq!(to_path(&to_text(name)).as_os_str(), name);
/// # }
/// ```
pub fn to_text(name: impl AsRef<OsStr>) -> String {
    let name = name.as_ref();
    if let Some(text) = name.to_str()
        && !text.contains(|c| byte_of(c).is_some())
    {
        return text.to_owned();
    }
    let mut out = String::with_capacity(name.len() + 8);
    for chunk in name.as_encoded_bytes().utf8_chunks() {
        for c in chunk.valid().chars() {
            match byte_of(c) {
                Some(_) => out.extend(c.encode_utf8(&mut [0; 4]).bytes().map(char_of)),
                None => out.push(c),
            }
        }
        out.extend(chunk.invalid().iter().copied().map(char_of));
    }
    out
}

/// The path that the text of a setting means.
pub fn to_path(text: &str) -> PathBuf {
    PathBuf::from(to_name(text))
}

/// The path that a setting of a library means, which was read as a path from the text of one.
pub(crate) fn unescaped(path: &Path) -> PathBuf {
    path.to_str().map_or_else(|| path.to_owned(), to_path)
}

/// Paths that cross to another process, or are written as JSON, as their texts.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Paths(#[serde(with = "as_texts")] pub Vec<PathBuf>);

/// Paths as the texts of settings, for serde.
pub(crate) mod as_texts {
    use std::path::PathBuf;

    use serde::{Deserialize, Deserializer, Serializer};

    use super::{to_path, to_text};

    pub(crate) fn serialize<S: Serializer>(paths: &[PathBuf], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(paths.iter().map(to_text))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<PathBuf>, D::Error> {
        let texts = Vec::<String>::deserialize(deserializer)?;
        Ok(texts.iter().map(|text| to_path(text)).collect())
    }
}

/// The name that a text means.
pub fn to_name(text: &str) -> OsString {
    if !text.contains(|c| byte_of(c).is_some()) {
        return OsString::from(text);
    }
    let mut bytes = Vec::with_capacity(text.len());
    for c in text.chars() {
        match byte_of(c) {
            Some(byte) => bytes.push(byte),
            None => bytes.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes()),
        }
    }
    from_bytes(bytes)
}

#[cfg(unix)]
fn from_bytes(bytes: Vec<u8>) -> OsString {
    std::os::unix::ffi::OsStringExt::from_vec(bytes)
}

#[cfg(not(unix))]
fn from_bytes(bytes: Vec<u8>) -> OsString {
    String::from_utf8_lossy(&bytes).into_owned().into()
}

/// The text for people: bytes that are no UTF-8 become U+FFFD, as [`Path::display`] shows them.
pub fn shown(text: &str) -> Cow<'_, str> {
    if text.contains(|c| byte_of(c).is_some()) {
        Cow::Owned(Path::new(&to_name(text)).display().to_string())
    } else {
        Cow::Borrowed(text)
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::os::unix::ffi::OsStrExt;

    #[test]
    fn every_name_comes_back_and_no_two_become_one_text() {
        let escaped = to_text(OsStr::from_bytes(b"\xff"));
        let names: Vec<Vec<u8>> = (0..=255_u8)
            .flat_map(|b| [vec![b'a', b, b'.'], vec![b, 0xC3, 0xA9], vec![0xC3, b], vec![0xF4, 0x8F, 0xBF, b]])
            .chain(["süd", "\u{10ffff}", "\u{10ff80}x", "\u{10ff7f}", "${item.x}", ""].map(|t| t.as_bytes().to_vec()))
            .chain([escaped.into_bytes()])
            .collect();
        let distinct: HashSet<&Vec<u8>> = names.iter().collect();
        let texts: HashSet<String> = names.iter().map(|name| to_text(OsStr::from_bytes(name))).collect();
        assert_eq!(texts.len(), distinct.len());
        for name in &names {
            let name = OsStr::from_bytes(name);
            assert_eq!(to_name(&to_text(name)), name);
        }
    }

    #[test]
    fn people_see_names_as_paths_are_displayed() {
        assert_eq!(shown(&to_text(OsStr::from_bytes(b"s\xfcd.mp4"))), "s\u{fffd}d.mp4");
        assert_eq!(shown("süd.mp4"), "süd.mp4");
    }
}
