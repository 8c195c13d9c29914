//! Image sequences: by a numbered pattern such as `frames/%05d.png`, or from any pictures in a given order.
//!
//! FFmpeg counts through a pattern and takes the first number that is missing for the end, so gaps are refused here. Pictures
//! without such numbers are linked under numbers in a temporary folder.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::MediaError;
use plumbline_num::files::AtomicFile;

/// A pattern, the first number that exists for it, and all its files.
#[derive(Clone, Debug)]
pub(super) struct Sequence {
    pattern: OsString,
    first: u64,
    files: Vec<PathBuf>,
    /// Holds the links, if any.
    _links: Option<Arc<AtomicFile>>,
}

/// A file name with one number in it: the text before, the text after and the least number of digits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pattern<'a> {
    before: &'a [u8],
    after: &'a [u8],
    digits: usize,
}

impl<'a> Pattern<'a> {
    /// Splits `name` at its single `%d` or `%0Nd`; `None` where there is none or more than one. Names need not be UTF-8.
    pub(super) fn parse(name: &'a OsStr) -> Option<Self> {
        let name = name.as_encoded_bytes();
        let (before, rest) = name.split_at(name.iter().position(|b| *b == b'%')?);
        let rest = rest.strip_prefix(b"%")?;
        let (digits, after) = rest.split_at(rest.iter().position(|b| *b == b'd')?);
        let (digits, after) = (std::str::from_utf8(digits).ok()?, after.strip_prefix(b"d")?);
        let plain = digits.is_empty() || (digits.starts_with('0') && digits.bytes().all(|b| b.is_ascii_digit()));
        let digits = if digits.is_empty() { 1 } else { digits.parse().ok().filter(|d| *d < 20)? };
        (plain && !after.contains(&b'%')).then_some(Self { before, after, digits: digits.max(1) })
    }

    /// The number in `name`, where it matches.
    pub(super) fn number(&self, name: &OsStr) -> Option<u64> {
        let digits = name.as_encoded_bytes().strip_prefix(self.before)?.strip_suffix(self.after)?;
        let digits = std::str::from_utf8(digits).ok()?;
        let padded = digits.len() == self.digits || (digits.len() > self.digits && !digits.starts_with('0'));
        if padded && digits.bytes().all(|b| b.is_ascii_digit()) { digits.parse().ok() } else { None }
    }
}

impl Sequence {
    /// The sequence that `text` names; `None` where it is no pattern.
    ///
    /// # Errors
    /// [`MediaError::Missing`] where no file matches, [`MediaError::Input`] where a number is missing in between.
    pub(super) fn find(text: &OsStr) -> Result<Option<Self>, MediaError> {
        let path = Path::new(text);
        let Some(pattern) = path.file_name().and_then(Pattern::parse) else {
            return Ok(None);
        };
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let missing = || MediaError::Missing { path: text.to_string_lossy().into_owned() };
        let entries = std::fs::read_dir(folder).map_err(|_| missing())?;
        let numbered = entries.filter_map(|e| {
            let e = e.ok()?;
            Some((pattern.number(&e.file_name())?, e.path()))
        });
        let mut numbered: Vec<(u64, PathBuf)> = numbered.collect();
        numbered.sort();
        let first = numbered.first().ok_or_else(missing)?.0;
        if let Some(gap) = (first..).zip(&numbered).find_map(|(n, (found, _))| (n != *found).then_some(n)) {
            let last = numbered.last().map_or(gap, |l| l.0);
            let help = "supply it, or give the folder to take the pictures that are there in the order of their names";
            let problem = format!("number {gap} is missing ({first} to {last} are there in part); {help}");
            return Err(MediaError::input(&text.to_string_lossy(), problem));
        }
        let files = numbered.into_iter().map(|(_, file)| file).collect();
        Ok(Some(Self { pattern: muxer_pattern(folder, text), first, files, _links: None }))
    }

    /// `files` in this order; `name` is used in messages.
    ///
    /// # Errors
    /// [`MediaError::Missing`] without a file, [`MediaError::Input`] where they are of several kinds,
    /// [`MediaError::Spool`] where the links cannot be made.
    pub(super) fn of_pictures(name: &str, files: Vec<PathBuf>) -> Result<Self, MediaError> {
        let kind = |file: &PathBuf| file.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let mut kinds: Vec<String> = files.iter().map(kind).collect();
        kinds.sort();
        kinds.dedup();
        let [extension] = kinds.as_slice() else {
            let Some(first) = kinds.first() else { return Err(MediaError::Missing { path: name.to_owned() }) };
            let help = format!("name one kind, such as '{name}/*.{first}'");
            let problem = format!("holds pictures of several kinds ({}); {help}", kinds.join(", "));
            return Err(MediaError::input(name, problem));
        };
        let place = std::env::temp_dir();
        let fail = |source| MediaError::Spool { place: place.clone(), source };
        let links = AtomicFile::folder(&place, "plumbline-pictures-").map_err(fail)?;
        for (number, file) in files.iter().enumerate() {
            let target = std::path::absolute(file).map_err(fail)?;
            link(&target, &links.path().join(format!("{number:08}.{extension}"))).map_err(fail)?;
        }
        let pattern = muxer_pattern(links.path(), OsStr::new(&format!("%08d.{extension}")));
        Ok(Self { pattern, first: 0, files, _links: Some(Arc::new(links)) })
    }

    /// The pattern as FFmpeg takes it.
    pub(super) fn pattern(&self) -> &OsStr {
        &self.pattern
    }

    pub(super) fn first(&self) -> u64 {
        self.first
    }

    /// All its files, in order; there is at least one.
    pub(super) fn files(&self) -> &[PathBuf] {
        &self.files
    }
}

#[cfg(unix)]
fn link(target: &Path, name: &Path) -> std::io::Result<()> {
    std::os::unix::fs::symlink(target, name)
}

#[cfg(not(unix))]
fn link(target: &Path, name: &Path) -> std::io::Result<()> {
    std::fs::hard_link(target, name).or_else(|_| std::fs::copy(target, name).map(drop))
}

/// The pattern `text` inside `folder` as FFmpeg takes it: percent signs of the folder's name are doubled.
pub(super) fn muxer_pattern(folder: &Path, text: &OsStr) -> OsString {
    let name = Path::new(text).file_name().unwrap_or_default();
    let mut bytes = Vec::new();
    for byte in folder.as_os_str().as_encoded_bytes() {
        bytes.extend(std::iter::repeat_n(*byte, if *byte == b'%' { 2 } else { 1 }));
    }
    bytes.push(b'/');
    bytes.extend(name.as_encoded_bytes());
    os_string(bytes)
}

#[cfg(unix)]
fn os_string(bytes: Vec<u8>) -> OsString {
    std::os::unix::ffi::OsStringExt::from_vec(bytes)
}

#[cfg(not(unix))]
fn os_string(bytes: Vec<u8>) -> OsString {
    String::from_utf8_lossy(&bytes).into_owned().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_one_decimal_number_makes_a_pattern() {
        let p = Pattern::parse(OsStr::new("shot_%04d.png")).expect("a pattern");
        assert_eq!(p.number(OsStr::new("shot_0042.png")), Some(42));
        assert_eq!(p.number(OsStr::new("shot_12345.png")), Some(12345), "numbers may outgrow the padding");
        assert_eq!(p.number(OsStr::new("shot_042.png")), None);
        assert_eq!(p.number(OsStr::new("shot_00042.png")), None);
        assert_eq!(p.number(OsStr::new("shot_004x.png")), None);
        for name in ["a.png", "a%s.png", "%d-%d.png", "100%.png", "%4d.png"] {
            assert_eq!(Pattern::parse(OsStr::new(name)), None, "{name}");
        }
    }

    #[test]
    fn a_sequence_begins_at_its_lowest_number() {
        let folder = tempfile::tempdir().expect("temporary folder");
        for n in [9, 7, 8] {
            std::fs::write(folder.path().join(format!("f{n:03}.png")), b"x").expect("write");
        }
        let text = folder.path().join("f%03d.png");
        let text = text.to_str().expect("UTF-8");
        assert_eq!(Sequence::find(OsStr::new(text)).expect("found").map(|s| s.first()), Some(7));
        let other = text.replace("f%", "g%");
        assert!(matches!(Sequence::find(OsStr::new(&other)), Err(MediaError::Missing { .. })));
        std::fs::write(folder.path().join("f012.png"), b"x").expect("write");
        let gap = Sequence::find(OsStr::new(text)).expect_err("10 and 11 are missing").to_string();
        assert!(gap.contains("number 10 is missing (7 to 12 are there in part)"), "{gap}");
    }

    #[test]
    fn pictures_of_any_name_are_numbered_in_the_order_given() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let files: Vec<_> = ["b.png", "a.PNG"].map(|n| folder.path().join(n)).into();
        for file in &files {
            std::fs::write(file, file.to_str().expect("UTF-8")).expect("write");
        }
        let sequence = Sequence::of_pictures("x", files.clone()).expect("made");
        let read = |n: &str| {
            std::fs::read_to_string(sequence.pattern().to_str().expect("UTF-8").replace("%08d", n)).expect("linked")
        };
        assert_eq!(
            (read("00000000"), read("00000001")),
            (files[0].display().to_string(), files[1].display().to_string())
        );
        let place = Path::new(sequence.pattern()).parent().expect("a folder").to_owned();
        drop(sequence);
        assert!(!place.exists() && files[0].exists(), "the links go, the pictures stay");
        let mixed = Sequence::of_pictures("x", vec!["a.png".into(), "b.jpg".into()]).expect_err("refused");
        assert_eq!(
            mixed.to_string(),
            "x: holds pictures of several kinds (jpg, png); name one kind, such as 'x/*.jpg'"
        );
    }
}
