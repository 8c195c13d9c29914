//! The focal length from a container's metadata.
//!
//! Cameras give it in 35-mm terms: that of a lens with the same diagonal angle of view on a frame of 36 × 24 mm. For a picture
//! of `W × H` px,
//!
//! ```text
//! f = f₃₅ √(W² + H²) / √(36² + 24²).
//! ```
//!
//! Phones by Apple write it as `com.apple.quicktime.camera.focal_length.35mm_equivalent` among the keys of the video *track*, which
//! FFmpeg does not hand on, so those are read here; programs that rewrite such clips put it among the tags of the file, or under
//! the name of the EXIF field. Android's recorder writes none. What is left uncertain is how much of the sensor a video uses:
//! a clip steadied in the camera shows a part.
//!
//! # Reference
//! Apple, *QuickTime File Format*, metadata atoms (`meta`, `keys`, `ilst`); CIPA DC-008 (EXIF), `FocalLengthIn35mmFilm`.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// Diagonal of a 35-mm frame, mm.
const DIAGONAL_MM: f64 = 43.266_615_305_567_87;
/// Plausible focal lengths, mm in 35-mm terms.
const PLAUSIBLE_MM: std::ops::RangeInclusive<f64> = 5.0..=3000.0;
/// Metadata keys of the focal length.
const TAGS: [&str; 3] =
    ["com.apple.quicktime.camera.focal_length.35mm_equivalent", "FocalLengthIn35mmFormat", "FocalLengthIn35mmFilm"];
/// Maximum size of an atom that is read whole, bytes: the lists of keys have a few hundred.
const MAX_ATOM: u64 = 1 << 20;
/// Maximum number of atoms read: bounds the time on a damaged file.
const MAX_ATOMS: usize = 10_000;

/// Focal length, px, of a lens of `f35_mm` in 35-mm terms, for pictures of `width × height` px.
pub fn focal_px(f35_mm: f64, width: usize, height: usize) -> f64 {
    f35_mm * (width as f64).hypot(height as f64) / DIAGONAL_MM
}

/// The focal length in tags of a container, mm in 35-mm terms.
pub(super) fn of_tags<'t>(tags: impl Iterator<Item = (&'t String, &'t String)>) -> Option<f64> {
    tags.filter(|(name, _)| TAGS.iter().any(|t| name.eq_ignore_ascii_case(t))).find_map(|(_, value)| millimeters(value))
}

/// `26`, `26.0 mm` or `50.00mm`.
fn millimeters(text: &str) -> Option<f64> {
    let number = text.trim().trim_end_matches("mm").trim_end();
    number.parse().ok().filter(|mm| PLAUSIBLE_MM.contains(mm))
}

/// The focal length among the keys of the tracks of a QuickTime or MP4 file, mm in 35-mm terms; `None` for any other file.
pub(super) fn of_tracks(file: File) -> Option<f64> {
    let mut atoms = Atoms { file, left: MAX_ATOMS };
    let end = atoms.file.metadata().ok()?.len();
    let movie = atoms.child(0..end, *b"moov")?;
    let mut at = movie.start;
    while let Some((kind, body)) = atoms.next(at, movie.end) {
        at = body.end;
        let found = (kind == *b"trak").then(|| atoms.child(body, *b"meta")).flatten().and_then(|m| atoms.keyed(m));
        if found.is_some() {
            return found;
        }
    }
    None
}

type Span = std::ops::Range<u64>;

/// A file of atoms: size (`u32`), four letters, body; a size of 1 stands for a `u64` behind the letters, 0 for the rest.
struct Atoms {
    file: File,
    left: usize,
}

impl Atoms {
    fn bytes<const N: usize>(&mut self, at: u64) -> Option<[u8; N]> {
        let mut bytes = [0; N];
        self.file.seek(SeekFrom::Start(at)).ok()?;
        self.file.read_exact(&mut bytes).ok()?;
        Some(bytes)
    }

    /// Letters and body of the atom at `at`, which must end by `end`.
    fn next(&mut self, at: u64, end: u64) -> Option<([u8; 4], Span)> {
        self.left = self.left.checked_sub(1)?;
        if end.checked_sub(at)? < 8 {
            return None;
        }
        let [a, b, c, d, kind @ ..] = self.bytes::<8>(at)?;
        let (header, size) = match u64::from(u32::from_be_bytes([a, b, c, d])) {
            0 => (8, end - at),
            1 => (16, u64::from_be_bytes(self.bytes(at + 8)?)),
            size => (8, size),
        };
        let stop = at.checked_add(size).filter(|stop| *stop <= end && size >= header)?;
        Some((kind, at + header..stop))
    }

    /// The body of the first atom of this kind in `span`.
    fn child(&mut self, span: Span, wanted: [u8; 4]) -> Option<Span> {
        let mut at = span.start;
        loop {
            let (kind, body) = self.next(at, span.end)?;
            if kind == wanted {
                return Some(body);
            }
            at = body.end;
        }
    }

    fn read(&mut self, span: &Span) -> Option<Vec<u8>> {
        let length = span.end.checked_sub(span.start).filter(|n| *n <= MAX_ATOM)?;
        let mut bytes = vec![0; length as usize];
        self.file.seek(SeekFrom::Start(span.start)).ok()?;
        self.file.read_exact(&mut bytes).ok()?;
        Some(bytes)
    }

    /// The focal length in a `meta` atom: its number among the `keys`, its value in the `ilst` under that number.
    fn keyed(&mut self, meta: Span) -> Option<f64> {
        let keys = self.child(meta.clone(), *b"keys")?;
        let number = key_number(&self.read(&keys)?)?;
        let list = self.child(meta, *b"ilst")?;
        let item = self.child(list, number.to_be_bytes())?;
        let data = self.child(item, *b"data")?;
        value(&self.read(&data)?)
    }
}

/// The number, from 1, of our key in a `keys` atom: version and count, then entries of size, name space and name.
fn key_number(keys: &[u8]) -> Option<u32> {
    let mut rest = keys.get(8..)?;
    for number in 1.. {
        let size = u32::from_be_bytes(rest.get(..4)?.try_into().ok()?) as usize;
        if rest.get(8..size)? == TAGS[0].as_bytes() {
            return Some(number);
        }
        rest = &rest[size..];
    }
    None
}

/// A `data` atom: type, locale, value; text, or a number of the type's width.
fn value(data: &[u8]) -> Option<f64> {
    let kind = u32::from_be_bytes(data.get(..4)?.try_into().ok()?);
    let body = data.get(8..)?;
    let integer = || body.iter().fold(0_u64, |sum, b| sum << 8 | u64::from(*b));
    let found = match (kind, body.len()) {
        (1, _) => return millimeters(std::str::from_utf8(body).ok()?),
        (21 | 22 | 65..=67 | 75..=77, 1..=4) => integer() as f64,
        (23, 4) => f64::from(f32::from_bits(integer() as u32)),
        (24, 8) => f64::from_bits(integer()),
        _ => return None,
    };
    PLAUSIBLE_MM.contains(&found).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn atom(kind: [u8; 4], body: &[u8]) -> Vec<u8> {
        [&(body.len() as u32 + 8).to_be_bytes()[..], &kind, body].concat()
    }

    /// A file whose second track has two keys, the second ours.
    fn movie(data: &[u8]) -> Vec<u8> {
        let key = |name: &str| [&(name.len() as u32 + 8).to_be_bytes()[..], b"mdta", name.as_bytes()].concat();
        let keys =
            [&[0, 0, 0, 0, 0, 0, 0, 2][..], &key("com.apple.quicktime.camera.lens_model"), &key(TAGS[0])].concat();
        let item = |number: u32, data: &[u8]| atom(number.to_be_bytes(), &atom(*b"data", data));
        let list = [item(1, b"\0\0\0\x01\0\0\0\0back camera"), item(2, data)].concat();
        let meta = [atom(*b"hdlr", &[0; 25]), atom(*b"keys", &keys), atom(*b"ilst", &list)].concat();
        let tracks = [atom(*b"trak", &atom(*b"tkhd", &[0; 84])), atom(*b"trak", &atom(*b"meta", &meta))].concat();
        let movie = [atom(*b"mvhd", &[0; 100]), tracks].concat();
        [atom(*b"ftyp", b"qt  \0\0\0\0"), atom(*b"moov", &movie)].concat()
    }

    fn read(bytes: &[u8]) -> Option<f64> {
        let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
        file.write_all(bytes).expect("a small file");
        of_tracks(file.reopen().expect("reopens"))
    }

    #[test]
    fn the_key_of_a_track_is_read_whatever_its_type() {
        for (data, expected) in [
            (&b"\0\0\0\x15\0\0\0\0\0\0\0\x1a"[..], Some(26.0)),
            (b"\0\0\0\x41\0\0\0\0\x1b", Some(27.0)),
            (b"\0\0\0\x01\0\0\0\x0050.00mm", Some(50.0)),
            (&[&[0, 0, 0, 23, 0, 0, 0, 0][..], &13.5_f32.to_be_bytes()].concat(), Some(13.5)),
            (b"\0\0\0\x15\0\0\0\0\0\0\0\0", None),
            (b"\0\0\0\x01\0\0\0\0wide", None),
            (b"\0\0\0", None),
        ] {
            assert_eq!(read(&movie(data)), expected, "{data:?}");
        }
    }

    #[test]
    fn damaged_and_other_files_have_none_and_never_panic() {
        let good = movie(b"\0\0\0\x15\0\0\0\0\0\0\0\x1a");
        assert_eq!(read(b"\x1a\x45\xdf\xa3 no QuickTime"), None);
        let mut random = fastrand::Rng::with_seed(4);
        for _ in 0..400 {
            let mut bytes = good.clone();
            for _ in 0..random.usize(1..5) {
                let at = random.usize(..bytes.len());
                bytes[at] = random.u8(..);
            }
            bytes.truncate(random.usize(..=bytes.len()));
            let _ = read(&bytes);
        }
    }

    #[test]
    fn tags_are_read_with_and_without_their_unit() {
        let tags = |name: &str, value: &str| of_tags([(&name.to_owned(), &value.to_owned())].into_iter());
        assert_eq!(tags(TAGS[0], "26"), Some(26.0));
        assert_eq!(tags("FOCALLENGTHIN35MMFORMAT", "26.5 mm"), Some(26.5));
        assert_eq!(tags("title", "26"), None);
        assert_eq!(tags(TAGS[0], "-26"), None);
        assert_eq!(tags(TAGS[0], "nan"), None);
    }

    #[test]
    fn the_diagonal_of_a_35_mm_frame_is_the_diagonal_of_the_picture() {
        assert!((focal_px(36.0, 3600, 2400) - 3600.0).abs() < 1e-9);
        assert!((focal_px(26.0, 1080, 1920) - focal_px(26.0, 1920, 1080)).abs() < 1e-12);
    }
}
