//! Numbered image sequences: `frames/%05d.png`.

use std::path::{Path, PathBuf};

use super::MediaError;

/// A pattern and the first number that exists for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Sequence {
    pattern: String,
    first: u64,
    first_file: PathBuf,
}

/// A file name with one number in it: the text before, the text after and the least number of digits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pattern<'a> {
    before: &'a str,
    after: &'a str,
    digits: usize,
}

impl<'a> Pattern<'a> {
    /// Splits `name` at its single `%d` or `%0Nd`; `None` where there is none or more than one.
    pub(super) fn parse(name: &'a str) -> Option<Self> {
        let (before, rest) = name.split_once('%')?;
        let (digits, after) = rest.split_once('d')?;
        let plain = digits.is_empty() || (digits.starts_with('0') && digits.bytes().all(|b| b.is_ascii_digit()));
        let digits = if digits.is_empty() { 1 } else { digits.parse().ok().filter(|d| *d < 20)? };
        (plain && !after.contains('%')).then_some(Self { before, after, digits: digits.max(1) })
    }

    /// The number in `name`, where it matches.
    pub(super) fn number(&self, name: &str) -> Option<u64> {
        let digits = name.strip_prefix(self.before)?.strip_suffix(self.after)?;
        let padded = digits.len() == self.digits || (digits.len() > self.digits && !digits.starts_with('0'));
        if padded && digits.bytes().all(|b| b.is_ascii_digit()) { digits.parse().ok() } else { None }
    }
}

impl Sequence {
    /// The sequence that `text` names; `None` where it is no pattern.
    ///
    /// # Errors
    /// [`MediaError::Missing`] where no file matches.
    pub(super) fn find(text: &str) -> Result<Option<Self>, MediaError> {
        let path = Path::new(text);
        let Some(pattern) = path.file_name().and_then(|n| n.to_str()).and_then(Pattern::parse) else {
            return Ok(None);
        };
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let missing = || MediaError::Missing { path: text.to_owned() };
        let entries = std::fs::read_dir(folder).map_err(|_| missing())?;
        let numbered = entries.filter_map(|e| {
            let e = e.ok()?;
            Some((pattern.number(e.file_name().to_str()?)?, e.path()))
        });
        let (first, first_file) = numbered.min().ok_or_else(missing)?;
        Ok(Some(Self { pattern: muxer_pattern(folder, text), first, first_file }))
    }

    /// The pattern as FFmpeg takes it.
    pub(super) fn pattern(&self) -> &str {
        &self.pattern
    }

    pub(super) fn first(&self) -> u64 {
        self.first
    }

    pub(super) fn first_file(&self) -> &Path {
        &self.first_file
    }
}

/// The pattern `text` inside `folder` as FFmpeg takes it: percent signs of the folder's name are doubled.
pub(super) fn muxer_pattern(folder: &Path, text: &str) -> String {
    let name = Path::new(text).file_name().unwrap_or_default().to_string_lossy();
    format!("{}/{name}", folder.to_string_lossy().replace('%', "%%"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_one_decimal_number_makes_a_pattern() {
        let p = Pattern::parse("shot_%04d.png").expect("a pattern");
        assert_eq!(p.number("shot_0042.png"), Some(42));
        assert_eq!(p.number("shot_12345.png"), Some(12345), "numbers may outgrow the padding");
        assert_eq!(p.number("shot_042.png"), None);
        assert_eq!(p.number("shot_00042.png"), None);
        assert_eq!(p.number("shot_004x.png"), None);
        for name in ["a.png", "a%s.png", "%d-%d.png", "100%.png", "%4d.png"] {
            assert_eq!(Pattern::parse(name), None, "{name}");
        }
    }

    #[test]
    fn a_sequence_begins_at_its_lowest_number() {
        let folder = tempfile::tempdir().expect("temporary folder");
        for n in [12, 7, 9] {
            std::fs::write(folder.path().join(format!("f{n:03}.png")), b"x").expect("write");
        }
        let text = folder.path().join("f%03d.png");
        let text = text.to_str().expect("UTF-8");
        assert_eq!(Sequence::find(text).expect("found").map(|s| s.first()), Some(7));
        let other = text.replace("f%", "g%");
        assert!(matches!(Sequence::find(&other), Err(MediaError::Missing { .. })));
    }
}
