//! IPTC: captions, credits and keywords of the press, as bytes of the Information Interchange Model (IIM).
//!
//! TIFF has them in a tag of their own, JPEG in a list of Photoshop's resources `"8BIM", id u16, name, size u32, bytes`, padded to
//! even lengths, and PNG, by the convention of ImageMagick, in the same list as hexadecimal text.
//!
//! # Reference
//! IPTC-NAA, *Information Interchange Model* 4.2; Adobe, *Photoshop file formats specification*, image resource blocks.

/// Begins a resource.
const RESOURCE: &[u8] = b"8BIM";
/// Resource that holds IIM.
const IIM: u16 = 0x0404;
/// Begins a data set of IIM.
const DATA_SET: u8 = 0x1c;
/// Maximum size, bytes: one segment of a JPEG file holds 64 kB, and nobody writes a second one.
pub(super) const MAX_BYTES: usize = 1 << 20;
/// Hexadecimal digits in a line of text.
const LINE: usize = 72;

/// IIM from a list of resources, or from bytes that are IIM; `None` where there is none.
pub(super) fn of_resources(bytes: &[u8]) -> Option<Vec<u8>> {
    if bytes.first() == Some(&DATA_SET) {
        return Some(bytes.to_vec()).filter(|b| b.len() <= MAX_BYTES);
    }
    let mut rest = bytes;
    while let Some(after) = rest.strip_prefix(RESOURCE) {
        let id = u16::from_be_bytes([*after.first()?, *after.get(1)?]);
        // A name with its length before it, padded to an even size.
        let named = after.get(2 + even(1 + usize::from(*after.get(2)?))..)?;
        let (size, content) = named.split_first_chunk::<4>()?;
        let size = u32::from_be_bytes(*size) as usize;
        if id == IIM {
            let found = content.get(..size)?;
            return Some(found.to_vec()).filter(|b| (1..=MAX_BYTES).contains(&b.len()));
        }
        rest = content.get(even(size)..)?;
    }
    None
}

/// A list with IIM as its only resource.
pub(super) fn resources(iim: &[u8]) -> Vec<u8> {
    let mut out = [RESOURCE, &IIM.to_be_bytes(), &[0, 0], &(iim.len() as u32).to_be_bytes(), iim].concat();
    out.resize(even(out.len()), 0);
    out
}

/// IIM from the text of a PNG file: a name, a length, and hexadecimal digits.
pub(super) fn of_text(text: &[u8]) -> Option<Vec<u8>> {
    let text = std::str::from_utf8(text).ok()?;
    let mut lines = text.trim_start().splitn(3, '\n');
    let (_name, length) = (lines.next()?, lines.next()?.trim().parse::<usize>().ok()?);
    let digits: Vec<u8> = lines.next()?.bytes().filter(u8::is_ascii_hexdigit).collect();
    let value = |digit: u8| char::from(digit).to_digit(16).unwrap_or(0) as u8;
    let bytes: Vec<u8> = digits.chunks_exact(2).map(|pair| 16 * value(pair[0]) + value(pair[1])).collect();
    (bytes.len() == length).then(|| of_resources(&bytes)).flatten()
}

/// The text of a PNG file.
pub(super) fn text(iim: &[u8]) -> String {
    let bytes = resources(iim);
    let digit = |v: u8| char::from_digit(u32::from(v), 16).unwrap_or('0');
    let mut out = format!("\niptc\n{:8}", bytes.len());
    for (i, byte) in bytes.iter().enumerate() {
        if (2 * i).is_multiple_of(LINE) {
            out.push('\n');
        }
        out.extend([digit(byte >> 4), digit(byte & 15)]);
    }
    out.push('\n');
    out
}

const fn even(size: usize) -> usize {
    size + size % 2
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A caption of odd length.
    const CAPTION: &[u8] = b"\x1c\x02\x78\x00\x05Hello";

    #[test]
    fn a_caption_comes_back_from_resources_and_from_text() {
        for iim in [CAPTION, &CAPTION[..9]] {
            assert_eq!(of_resources(&resources(iim)).as_deref(), Some(iim));
            assert_eq!(of_resources(iim).as_deref(), Some(iim));
            assert_eq!(of_text(text(iim).as_bytes()).as_deref(), Some(iim));
        }
        // Behind a resource with a name and an odd size.
        let before = [RESOURCE, &[4, 0x22], b"\x02ab\0", &[0, 0, 0, 3], b"xyz\0"].concat();
        let list = [before.clone(), resources(CAPTION)].concat();
        assert_eq!(of_resources(&list).as_deref(), Some(CAPTION));
        assert_eq!(of_resources(&before), None);
    }

    #[test]
    fn lists_that_are_cut_off_or_lie_give_nothing() {
        let whole = resources(CAPTION);
        for length in 0..whole.len() - 1 {
            assert_eq!(of_resources(&whole[..length]), None, "{length}");
        }
        let huge = [RESOURCE, &[4, 4, 0, 0], &u32::MAX.to_be_bytes(), &[1]].concat();
        assert_eq!(of_resources(&huge), None);
        assert_eq!(of_text(b"\niptc\n 4\nzz"), None);
        assert_eq!(of_text(&[0xff]), None);
    }
}
