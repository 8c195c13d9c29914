//! Our own JSON documents, which begin with what they are:
//!
//! ```json
//! { "format": "plumbline.handles", "version": 1, … }
//! ```
//!
//! Every reader of such a file goes through [`Kind`]: the size is checked before anything is read, format and version before
//! the content, so that a file of another kind or of a newer program is distinguished from one that is malformed.

pub mod gltf;
mod size;

use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::files::open_regular;
pub use size::{JsonCosts, ValueWithin, max_memory_of};

/// The one version of every kind that is read and written.
pub const VERSION: u32 = 1;

/// A kind of file.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// What messages call one: `a file of handles`.
    pub name: &'static str,
    /// What its `format` says.
    pub format: &'static str,
    /// Largest file that is read, bytes.
    pub max_bytes: u64,
}

/// Why a file was refused.
#[derive(Debug, thiserror::Error)]
pub enum DocumentError {
    /// Input: not JSON of the expected shape; the message ends with line and column.
    #[error("not {name}: {fault}")]
    Syntax {
        /// What the file should be.
        name: &'static str,
        /// What the parser says.
        #[source]
        fault: serde_json::Error,
    },
    /// Input: some other JSON.
    #[error("format {found:?} is not {name} (expected {expected:?})")]
    Format {
        /// What the file should be.
        name: &'static str,
        /// What `format` says.
        found: String,
        /// What it should say.
        expected: &'static str,
    },
    /// Input: made by a program of another version.
    #[error("version {found} of {name} is not supported (expected {VERSION})")]
    Version {
        /// What the file should be.
        name: &'static str,
        /// What `version` says.
        found: u64,
    },
    /// Input: larger than any such file.
    #[error("{bytes} bytes are too many for {name} (at most {most}): is this the right file?")]
    TooLarge {
        /// What the file should be.
        name: &'static str,
        /// Its size.
        bytes: u64,
        /// The largest that is read.
        most: u64,
    },
    /// Input: so many values that they would need far more memory than the file has bytes.
    #[error(
        "{bytes} bytes in memory for the values of a text of {length} bytes are too many for {name}: is this the right file?"
    )]
    TooManyValues {
        /// What the file should be.
        name: &'static str,
        /// Bound on the memory of the values, bytes.
        bytes: u64,
        /// Bytes of the text.
        length: u64,
    },
    /// Environment: reading failed.
    #[error("{fault}")]
    Io {
        /// What the file should be.
        name: &'static str,
        /// What the system says.
        #[source]
        fault: io::Error,
    },
}

/// Enough of a file to identify it.
#[derive(Deserialize)]
struct Header {
    format: String,
    version: u64,
}

impl Kind {
    /// The content of a file of bearable size.
    ///
    /// # Errors
    /// [`DocumentError::TooLarge`], [`DocumentError::Io`].
    pub fn bytes(&self, path: &Path) -> Result<Vec<u8>, DocumentError> {
        let mut bytes = Vec::new();
        self.open(path)?.read_to_end(&mut bytes).map_err(|e| self.io(e))?;
        Ok(bytes)
    }

    /// The text of a file of bearable size.
    ///
    /// # Errors
    /// As [`Self::bytes`]; [`DocumentError::Io`] also for what is not UTF-8.
    pub fn text(&self, path: &Path) -> Result<String, DocumentError> {
        let mut text = String::new();
        self.open(path)?.read_to_string(&mut text).map_err(|e| self.io(e))?;
        Ok(text)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`DocumentError`].
    pub fn read<D: DeserializeOwned>(&self, path: &Path) -> Result<D, DocumentError> {
        self.parse(&self.text(path)?)
    }

    /// Reads a text; a byte order mark before it is passed over.
    ///
    /// # Errors
    /// [`DocumentError::Syntax`], [`DocumentError::Format`], [`DocumentError::Version`], [`DocumentError::TooManyValues`].
    pub fn parse<D: DeserializeOwned>(&self, text: &str) -> Result<D, DocumentError> {
        let text = text.trim_start_matches('\u{feff}');
        self.check_header(serde_json::from_str(text))?;
        let length = text.len() as u64;
        let checked = JsonCosts::OF_STRUCTS.check(text.as_bytes(), length);
        checked.map_err(|bytes| self.too_many_values(bytes, length))?;
        serde_json::from_str(text).map_err(|e| self.syntax(e))
    }

    /// Reads what is too large for the memory as text.
    ///
    /// # Errors
    /// [`DocumentError`].
    pub fn stream<D: DeserializeOwned>(&self, mut file: impl Read + Seek) -> Result<D, DocumentError> {
        let length = file.seek(SeekFrom::End(0)).map_err(|e| self.io(e))?;
        self.check_size(length)?;
        file.rewind().map_err(|e| self.io(e))?;
        self.check_header(serde_json::from_reader(BufReader::new(&mut file)))?;
        file.rewind().map_err(|e| self.io(e))?;
        let checked = JsonCosts::OF_STREAMS.check_stream(BufReader::new(&mut file)).map_err(|e| self.io(e))?;
        checked.map_err(|bytes| self.too_many_values(bytes, length))?;
        file.rewind().map_err(|e| self.io(e))?;
        serde_json::from_reader(BufReader::new(file)).map_err(|e| self.syntax(e))
    }

    /// What the parser says of a text that should be of this kind.
    pub fn syntax(&self, fault: serde_json::Error) -> DocumentError {
        DocumentError::Syntax { name: self.name, fault }
    }

    fn too_many_values(&self, bytes: u64, length: u64) -> DocumentError {
        DocumentError::TooManyValues { name: self.name, bytes, length }
    }

    fn io(&self, fault: io::Error) -> DocumentError {
        DocumentError::Io { name: self.name, fault }
    }

    /// A file of bearable size, also where it grows.
    fn open(&self, path: &Path) -> Result<impl Read, DocumentError> {
        let file = open_regular(path).map_err(|e| self.io(e))?;
        self.check_size(file.metadata().map_err(|e| self.io(e))?.len())?;
        Ok(file.take(self.max_bytes))
    }

    fn check_size(&self, bytes: u64) -> Result<(), DocumentError> {
        let most = self.max_bytes;
        if bytes > most { Err(DocumentError::TooLarge { name: self.name, bytes, most }) } else { Ok(()) }
    }

    fn check_header(&self, header: serde_json::Result<Header>) -> Result<(), DocumentError> {
        let Header { format, version } = header.map_err(|e| self.syntax(e))?;
        if format != self.format {
            return Err(DocumentError::Format { name: self.name, found: format, expected: self.format });
        }
        if version != u64::from(VERSION) {
            return Err(DocumentError::Version { name: self.name, found: version });
        }
        Ok(())
    }
}

/// The bytes of a regular file of at most `max_bytes`, also of one that grows.
///
/// # Errors
/// The file cannot be read, or is larger.
pub fn read_bounded(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open_regular(path)?.take(max_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > max_bytes {
        return Err(io::Error::other(format!("larger than {max_bytes} bytes")));
    }
    Ok(bytes)
}

/// The text of a file of at most `max_bytes` in UTF-8.
///
/// # Errors
/// As for [`read_bounded`]; the file is no text.
pub fn read_text(path: &Path, max_bytes: u64) -> io::Result<String> {
    String::from_utf8(read_bounded(path, max_bytes)?).map_err(|_| io::Error::other("not text in UTF-8"))
}

/// By how many px positions are moved so that pixel centers are at integer + 0.5, as everywhere inside: from the
/// `pixel_center` of a file, 0.5 or 0. `None` for any other.
pub fn pixel_center_shift(pixel_center: f64) -> Option<f64> {
    (pixel_center == 0.5 || pixel_center == 0.0).then_some(0.5 - pixel_center)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_up_to_their_limit_and_devices_are_refused() {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        let bytes = std::fs::read(&manifest).expect("the manifest");
        assert_eq!(read_bounded(&manifest, bytes.len() as u64).expect("as large as allowed"), bytes);
        let message = read_text(&manifest, bytes.len() as u64 - 1).expect_err("a byte too large").to_string();
        assert!(message.contains("larger than"), "{message}");
        assert!(read_bounded(Path::new("/dev/zero"), 1000).is_err());
    }

    const KIND: Kind = Kind { name: "a file of numbers", format: "plumbline.numbers", max_bytes: 100 };

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Numbers {
        #[serde(rename = "format")]
        _format: String,
        #[serde(rename = "version")]
        _version: u32,
        #[serde(rename = "numbers")]
        list: Vec<u32>,
    }

    fn parsed(text: &str) -> Result<Vec<u32>, String> {
        let streamed = KIND.stream::<Numbers>(io::Cursor::new(text));
        let text = KIND.parse::<Numbers>(text).map(|n| n.list).map_err(|e| e.to_string());
        // Columns count from 0 or 1.
        let told = |e: &String| e.trim_end_matches(char::is_numeric).to_owned();
        let streamed = streamed.map(|n| n.list).map_err(|e| told(&e.to_string()));
        assert_eq!(text.as_ref().map_err(told), streamed.as_ref().map_err(Clone::clone));
        text
    }

    #[test]
    fn format_and_version_are_told_before_the_content() {
        let of = |format: &str, version: u32| {
            format!(r#"{{"format": "plumbline.{format}", "version": {version}, "other": 3}}"#)
        };
        let cases = [
            (of("words", 2), r#"format "plumbline.words" is not a file of numbers (expected "plumbline.numbers")"#),
            (of("numbers", 2), "version 2 of a file of numbers is not supported (expected 1)"),
            (of("numbers", 1), "not a file of numbers: unknown field `other`, expected one of"),
            ("{}".to_owned(), "not a file of numbers: missing field `format` at line 1 column 2"),
            ("…".to_owned(), "not a file of numbers: expected value at line 1 column 1"),
        ];
        for (text, expected) in cases {
            let error = parsed(&text).unwrap_err();
            assert!(error.starts_with(expected), "{error}");
        }
        assert_eq!(parsed(r#"{"format": "plumbline.numbers", "version": 1, "numbers": [3, 4]}"#), Ok(vec![3, 4]));
    }

    #[test]
    fn a_file_is_read_up_to_its_limit_with_or_without_a_byte_order_mark() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("numbers.json");
        let text = "\u{feff}{\"format\": \"plumbline.numbers\", \"version\": 1, \"numbers\": [7]}";
        std::fs::write(&path, text).unwrap();
        assert_eq!(KIND.read::<Numbers>(&path).unwrap().list, [7]);
        assert_eq!(KIND.bytes(&path).unwrap(), text.as_bytes());
        std::fs::write(&path, " ".repeat(101)).unwrap();
        let expected = "101 bytes are too many for a file of numbers (at most 100): is this the right file?";
        assert_eq!(KIND.read::<Numbers>(&path).unwrap_err().to_string(), expected);
        assert_eq!(KIND.bytes(&path).unwrap_err().to_string(), expected);
        assert_eq!(KIND.stream::<Numbers>(io::Cursor::new([b' '; 101])).unwrap_err().to_string(), expected);
        assert!(matches!(KIND.text(&folder.path().join("none")), Err(DocumentError::Io { .. })));
    }

    #[test]
    fn pixel_centers_at_integers_are_moved_by_half() {
        assert_eq!([0.5, 0.0, 1.0, f64::NAN].map(pixel_center_shift), [Some(0.0), Some(0.5), None, None]);
    }
}
