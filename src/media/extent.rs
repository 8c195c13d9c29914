//! Whether a file goes as far as its container says.
//!
//! FFmpeg reads what is there and calls the end of the file the end of the clip. Most containers, however, say where they end:
//! by the size of their outermost element, by an offset of their last part, or by a mark on the last page. These are read
//! here, without the pictures between them.
//!
//! | container | what shows that the end is missing |
//! | --- | --- |
//! | MP4, MOV | a box that is longer than the file |
//! | Matroska, WebM | the segment's size; of a live recording, an element that is longer than the file |
//! | AVI, WAV | the size of a RIFF chunk |
//! | FLV | `filesize` of its metadata, a tag that is longer than the file |
//! | ASF | the size in its file properties |
//! | MXF | the offset of the footer partition, a packet that is longer than the file |
//! | Ogg | a stream without its last page |
//! | MPEG-TS, MPEG-PS, DV, Y4M, IVF, RealMedia | a last packet, pack or frame that is not whole |
//! | GIF, APNG | no trailer |
//!
//! What cannot be seen: a live recording, a fragmented MP4, an MPEG stream, a Y4M, an IVF or a DV file that ends between two of its parts, and a raw
//! stream anywhere.

use std::collections::HashSet;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// Most parts of a file that are visited. Beyond them the file counts as whole: 2^20 parts of a few kilobytes are hours.
const MAX_PARTS: usize = 1 << 20;

/// Bytes at the end of an MPEG stream in which its last packs are searched.
const TAIL: u64 = 1 << 18;

/// How far a file goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// As far as can be seen.
    Whole,
    /// The end is missing.
    Cut {
        /// Length that the container announces, bytes, where it does.
        announced: Option<u64>,
    },
}

const CUT: Extent = Extent::Cut { announced: None };

/// Reads the extent from the bytes of one container; `None` where they cannot be understood.
type Rule = fn(&mut Bytes) -> Option<Extent>;

/// The extent of `file`, which FFmpeg takes for `container` (short names, separated by commas). Whatever cannot be read or
/// understood counts as whole.
pub(super) fn of(file: File, container: &str) -> Extent {
    let Some(mut bytes) = Bytes::of(file) else { return Extent::Whole };
    let named = |name: &str| container.split(',').any(|n| n == name);
    let rules: [(&str, Rule); 17] = [
        ("mov", boxes),
        ("matroska", matroska),
        ("avi", riff),
        ("wav", riff),
        ("flv", flv),
        ("asf", asf),
        ("mxf", mxf),
        ("ogg", ogg),
        ("mpegts", transport_stream),
        ("mpeg", program_stream),
        ("gif", gif),
        ("apng", apng),
        ("ivf", ivf),
        ("yuv4mpegpipe", y4m),
        ("dv", dv),
        ("rm", real_media),
        ("asf_o", asf),
    ];
    let rule = rules.iter().find(|(name, _)| named(name));
    rule.and_then(|(_, extent)| extent(&mut bytes)).unwrap_or(Extent::Whole)
}

/// Random access to a file.
struct Bytes {
    file: File,
    length: u64,
}

impl Bytes {
    fn of(file: File) -> Option<Self> {
        let length = file.metadata().ok()?.len();
        Some(Self { file, length })
    }

    /// Up to `N` bytes at `at`; `None` where fewer are there.
    fn at<const N: usize>(&mut self, at: u64) -> Option<[u8; N]> {
        let mut bytes = [0; N];
        self.file.seek(SeekFrom::Start(at)).ok()?;
        self.file.read_exact(&mut bytes).ok()?;
        Some(bytes)
    }

    /// At most `count` bytes at `at`.
    fn up_to(&mut self, at: u64, count: u64) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        self.file.seek(SeekFrom::Start(at)).ok()?;
        self.file.by_ref().take(count).read_to_end(&mut bytes).ok()?;
        Some(bytes)
    }

    /// The bytes from `at` on are the beginning of something: there are some, and not zeros that fill a block.
    fn remnant(&mut self, at: u64) -> Extent {
        let rest = self.up_to(at, 64).unwrap_or_default();
        if rest.iter().any(|b| *b != 0) { CUT } else { Extent::Whole }
    }

    fn ends_at(&self, end: u64) -> Option<Extent> {
        (end > self.length).then_some(Extent::Cut { announced: Some(end) })
    }
}

/// ISO base media: boxes of `size, type` one after the other.
fn boxes(bytes: &mut Bytes) -> Option<Extent> {
    let mut at = 0;
    for _ in 0..MAX_PARTS {
        if at == bytes.length {
            return Some(Extent::Whole);
        }
        let Some([a, b, c, d, kind @ ..]) = bytes.at::<8>(at) else { return Some(bytes.remnant(at)) };
        let printable = |b: &u8| b.is_ascii_graphic() || *b == b' ' || *b == 0xa9;
        let size = match u32::from_be_bytes([a, b, c, d]) {
            0 => return Some(Extent::Whole), // to the end, wherever that is
            1 => u64::from_be_bytes(bytes.at(at + 8)?),
            n => u64::from(n),
        };
        if size < 8 || !kind.iter().all(printable) {
            return Some(Extent::Whole); // bytes behind the last box
        }
        at = at.checked_add(size)?;
        if let Some(cut) = bytes.ends_at(at) {
            return Some(cut);
        }
    }
    None
}

/// EBML elements: identifier and size are numbers of variable length; a size of ones alone is unknown.
fn matroska(bytes: &mut Bytes) -> Option<Extent> {
    const SEGMENT: u64 = 0x1853_8067;
    const CLUSTER: u64 = 0x1f43_b675;
    let mut at = 0;
    for _ in 0..MAX_PARTS {
        if at >= bytes.length {
            return Some(Extent::Whole);
        }
        let header = bytes.up_to(at, 12)?;
        let Some((id, id_length)) = ebml_number(&header, false) else { return Some(bytes.remnant(at)) };
        let Some((size, size_length)) = ebml_number(&header[id_length..], true) else { return Some(bytes.remnant(at)) };
        let body = at + (id_length + size_length) as u64;
        let unknown = size == (1 << (7 * size_length)) - 1;
        match (id, unknown) {
            (SEGMENT | CLUSTER, true) => at = body, // its parts are visited
            (_, true) => return None,
            (SEGMENT, false) => return Some(bytes.ends_at(body.checked_add(size)?).unwrap_or(Extent::Whole)),
            (_, false) => {
                at = body.checked_add(size)?;
                if let Some(cut) = bytes.ends_at(at) {
                    return Some(cut);
                }
            }
        }
    }
    None
}

/// A number of EBML and its length; the length mark is part of identifiers, not of sizes.
fn ebml_number(bytes: &[u8], size: bool) -> Option<(u64, usize)> {
    let first = *bytes.first()?;
    let length = first.leading_zeros() as usize + 1;
    let rest = bytes.get(1..length).filter(|_| length <= 8)?;
    let head = if size { u64::from(first) & ((1 << (8 - length)) - 1) } else { u64::from(first) };
    Some((rest.iter().fold(head, |n, b| n << 8 | u64::from(*b)), length))
}

/// RIFF chunks; large AVI files have several.
fn riff(bytes: &mut Bytes) -> Option<Extent> {
    let mut at = 0;
    for _ in 0..MAX_PARTS {
        let Some([b'R', b'I', b'F', b'F', size @ ..]) = bytes.at::<8>(at) else { return Some(Extent::Whole) };
        let size = u32::from_le_bytes(size);
        if size == 0 || size == u32::MAX {
            return Some(Extent::Whole); // written to a pipe
        }
        let end = at + 8 + u64::from(size);
        if let Some(cut) = bytes.ends_at(end) {
            return Some(cut);
        }
        at = end + (end & 1);
    }
    None
}

/// Tags of `type, size (24), time (32), stream (24)`, each followed by its size.
fn flv(bytes: &mut Bytes) -> Option<Extent> {
    let header: [u8; 9] = bytes.at(0)?;
    let mut at = u64::from(u32::from_be_bytes(*header.last_chunk()?)) + 4;
    let head = bytes.up_to(at, 4096)?;
    let key = b"filesize\0"; // followed by a number of eight bytes
    if let Some(found) = head.windows(key.len()).position(|w| w == key)
        && let Some(value) = head[found + key.len()..].first_chunk::<8>()
    {
        let announced = f64::from_be_bytes(*value);
        if announced.is_finite() && announced > bytes.length as f64 && announced < 2_f64.powi(53) {
            return Some(Extent::Cut { announced: Some(announced as u64) });
        }
    }
    for _ in 0..MAX_PARTS {
        if at >= bytes.length {
            return Some(Extent::Whole);
        }
        let Some([kind, a, b, c, ..]) = bytes.at::<11>(at) else { return Some(bytes.remnant(at)) };
        if !matches!(kind & 0x1f, 8 | 9 | 18) {
            return None;
        }
        at += 11 + u64::from(u32::from_be_bytes([0, a, b, c]));
        if let Some(cut) = bytes.ends_at(at) {
            return Some(cut);
        }
        at += 4;
    }
    None
}

/// Objects of `identifier (128), size (64)`: the file properties are inside the header, the packets follow it.
fn asf(bytes: &mut Bytes) -> Option<Extent> {
    const FILE_PROPERTIES: [u8; 16] =
        [0xa1, 0xdc, 0xab, 0x8c, 0x47, 0xa9, 0xcf, 0x11, 0x8e, 0xe4, 0x00, 0xc0, 0x0c, 0x20, 0x53, 0x65];
    const BROADCAST: u32 = 1;
    let object = |bytes: &mut Bytes, at: u64| -> Option<([u8; 16], u64)> {
        let header: [u8; 24] = bytes.at(at)?;
        Some((*header.first_chunk()?, u64::from_le_bytes(*header.last_chunk()?)))
    };
    let header_end = object(bytes, 0)?.1;
    let mut at = 30; // after the number of objects and two reserved bytes
    for _ in 0..MAX_PARTS {
        if at >= header_end.min(bytes.length) {
            break;
        }
        let (id, size) = object(bytes, at)?;
        if id == FILE_PROPERTIES {
            let length = u64::from_le_bytes(bytes.at(at + 40)?);
            let flags = u32::from_le_bytes(bytes.at(at + 88)?);
            return (flags & BROADCAST == 0).then(|| bytes.ends_at(length).unwrap_or(Extent::Whole));
        }
        at = at.checked_add(size.max(24))?;
    }
    None
}

/// Packets of `key (128), length, value`; partition packs say where the last partition, the footer, begins.
fn mxf(bytes: &mut Bytes) -> Option<Extent> {
    const PARTITION: [u8; 13] = [6, 0x0e, 0x2b, 0x34, 2, 5, 1, 1, 0x0d, 1, 2, 1, 1];
    const RUN_IN: u64 = 65536;
    let head = bytes.up_to(0, RUN_IN + 16)?;
    let start = head.windows(PARTITION.len()).position(|w| w == PARTITION)? as u64;
    let (value, _) = klv(bytes, start)?;
    // Versions, grid, this and the previous partition come before it.
    let footer = u64::from_be_bytes(bytes.at(value + 24)?);
    if footer == 0 {
        return None; // never closed
    }
    let mut at = start.checked_add(footer)?;
    if at >= bytes.length {
        return Some(Extent::Cut { announced: None });
    }
    for _ in 0..MAX_PARTS {
        if at >= bytes.length {
            return Some(Extent::Whole);
        }
        let Some((value, length)) = klv(bytes, at) else { return Some(bytes.remnant(at)) };
        at = value.checked_add(length)?;
        if let Some(cut) = bytes.ends_at(at) {
            return Some(cut);
        }
    }
    None
}

/// Where the value of the packet at `at` begins, and its length.
fn klv(bytes: &mut Bytes, at: u64) -> Option<(u64, u64)> {
    let [first] = bytes.at::<1>(at + 16)?;
    if first < 0x80 {
        return Some((at + 17, u64::from(first)));
    }
    let count = u64::from(first & 0x7f);
    let digits = bytes.up_to(at + 17, count.min(8))?;
    (digits.len() as u64 == count).then(|| {
        let length = digits.iter().fold(0, |n, b| n << 8 | u64::from(*b));
        (at + 17 + count, length)
    })
}

/// Pages; the last one of each stream is marked.
fn ogg(bytes: &mut Bytes) -> Option<Extent> {
    const BEGINS: u8 = 2;
    const ENDS: u8 = 4;
    let mut open = HashSet::new();
    let mut at = 0;
    for _ in 0..MAX_PARTS {
        if at >= bytes.length {
            return Some(if open.is_empty() { Extent::Whole } else { CUT });
        }
        let Some(header) = bytes.at::<27>(at) else { return Some(bytes.remnant(at)) };
        if !header.starts_with(b"OggS") {
            return None;
        }
        let serial: [u8; 4] = *header[14..].first_chunk()?;
        if header[5] & BEGINS != 0 {
            open.insert(serial);
        }
        if header[5] & ENDS != 0 {
            open.remove(&serial);
        }
        let segments = bytes.up_to(at + 27, u64::from(header[26]))?;
        if segments.len() < usize::from(header[26]) {
            return Some(CUT);
        }
        at += 27 + segments.len() as u64 + segments.iter().map(|s| u64::from(*s)).sum::<u64>();
        if let Some(cut) = bytes.ends_at(at) {
            return Some(cut);
        }
    }
    None
}

/// Packets of 188 bytes, with a time before each or a checksum behind it in some.
fn transport_stream(bytes: &mut Bytes) -> Option<Extent> {
    const SYNC: u8 = 0x47;
    let head = bytes.up_to(0, 204 * 5)?;
    let fits = |(size, first): &(usize, usize)| (0..5).all(|k| head.get(first + k * size) == Some(&SYNC));
    let (size, first) = [(188, 0), (192, 4), (204, 0)].into_iter().find(fits)?;
    let rest = bytes.length % size as u64;
    let last = bytes.up_to(bytes.length - rest, rest)?;
    // Bytes of another kind behind the last packet are no packet.
    Some(if last.get(first) == Some(&SYNC) || (0 < rest && rest <= first as u64) { CUT } else { Extent::Whole })
}

/// Packs and packets with start codes; the last packs are looked at.
fn program_stream(bytes: &mut Bytes) -> Option<Extent> {
    const PACK: [u8; 4] = [0, 0, 1, 0xba];
    let from = bytes.length.saturating_sub(TAIL);
    let tail = bytes.up_to(from, TAIL)?;
    let mut at = tail.windows(4).position(|w| w == PACK)?;
    loop {
        let rest = &tail[at..];
        let size = match rest {
            // The end of the file, or the end code.
            [] | [0, 0, 1, 0xb9, ..] => return Some(Extent::Whole),
            [0, 0, 1, 0xba, first, ..] if first >> 6 == 1 => match rest.get(13) {
                Some(stuffing) => 14 + usize::from(stuffing & 7),
                None => return Some(CUT),
            },
            [0, 0, 1, 0xba, ..] => 12,
            [0, 0, 1, code, high, low, ..] if *code >= 0xbb => 6 + usize::from(u16::from_be_bytes([*high, *low])),
            [0, 0, 1, code, ..] if *code < 0xbb => return None,
            _ if rest.iter().all(|b| *b == 0) => return Some(Extent::Whole),
            _ if rest.len() < 6 => return Some(CUT),
            _ => return None,
        };
        at += size;
        if at > tail.len() {
            return Some(Extent::Cut { announced: Some(from + at as u64) });
        }
    }
}

/// The last byte is a semicolon; zeros may follow.
fn gif(bytes: &mut Bytes) -> Option<Extent> {
    let from = bytes.length.saturating_sub(4096);
    let tail = bytes.up_to(from, 4096)?;
    let last = tail.iter().rev().find(|b| **b != 0)?;
    Some(if *last == b';' { Extent::Whole } else { CUT })
}

/// Chunks of `length, type, data, checksum`, the last of which is `IEND`.
fn apng(bytes: &mut Bytes) -> Option<Extent> {
    let mut at = 8;
    for _ in 0..MAX_PARTS {
        let Some([a, b, c, d, kind @ ..]) = bytes.at::<8>(at) else { return Some(CUT) };
        at += 12 + u64::from(u32::from_be_bytes([a, b, c, d]));
        if let Some(cut) = bytes.ends_at(at) {
            return Some(cut);
        }
        if &kind == b"IEND" {
            return Some(Extent::Whole);
        }
    }
    None
}

/// A header, whose length it says, and frames of `size (32), time (64)`.
fn ivf(bytes: &mut Bytes) -> Option<Extent> {
    let mut at = u64::from(u16::from_le_bytes(bytes.at(6)?));
    for _ in 0..MAX_PARTS {
        if at >= bytes.length {
            return Some(Extent::Whole);
        }
        let Some(size) = bytes.at::<4>(at) else { return Some(CUT) };
        at += 12 + u64::from(u32::from_le_bytes(size));
        if let Some(cut) = bytes.ends_at(at) {
            return Some(cut);
        }
    }
    None
}

/// A line of text, then frames of one size, each after a line `FRAME`.
fn y4m(bytes: &mut Bytes) -> Option<Extent> {
    const MARK: &[u8] = b"FRAME\n";
    let head = bytes.up_to(0, 4096)?;
    let end = head.iter().position(|b| *b == b'\n')? + 1;
    if !head.get(end..)?.starts_with(MARK) {
        return None; // frames with parameters are of any length
    }
    let words = std::str::from_utf8(&head[..end]).ok()?;
    let number = |key: char| words.split_ascii_whitespace().find_map(|w| w.strip_prefix(key)?.parse::<u64>().ok());
    let (width, height) = (number('W')?, number('H')?);
    if width.max(height) > 1 << 20 {
        return None;
    }
    let chroma = words.split_ascii_whitespace().skip(1).find_map(|w| w.strip_prefix('C')).unwrap_or("420");
    let (w2, h2) = (width.div_ceil(2), height.div_ceil(2));
    let (luma, high) = (width * height, chroma.contains("p1") || chroma.ends_with("mono16"));
    let samples = match chroma {
        c if c.starts_with("mono") => luma,
        c if c.starts_with("420") => luma + 2 * w2 * h2,
        c if c.starts_with("411") => luma + 2 * width.div_ceil(4) * height,
        c if c.starts_with("422") => luma + 2 * w2 * height,
        "444alpha" => 4 * luma,
        c if c.starts_with("444") => 3 * luma,
        _ => return None,
    };
    let high = high || chroma.starts_with("mono1") || chroma.starts_with("mono9") || chroma.contains("p9");
    let frame = samples * if high { 2 } else { 1 } + MARK.len() as u64;
    Some(if (bytes.length - end as u64).is_multiple_of(frame) { Extent::Whole } else { CUT })
}

/// Frames of one size per system.
fn dv(bytes: &mut Bytes) -> Option<Extent> {
    let [section, _, _, system] = bytes.at::<4>(0)?;
    let frame = if system & 0x80 == 0 { 120_000 } else { 144_000 };
    (section == 0x1f && bytes.length >= frame)
        .then(|| if bytes.length.is_multiple_of(frame) { Extent::Whole } else { CUT })
}

/// Chunks of `type, size`.
fn real_media(bytes: &mut Bytes) -> Option<Extent> {
    const SLACK: u64 = 32;
    let mut at = 0;
    for _ in 0..MAX_PARTS {
        if at >= bytes.length {
            return Some(Extent::Whole);
        }
        let Some([_, _, _, _, size @ ..]) = bytes.at::<8>(at) else { return Some(bytes.remnant(at)) };
        let size = u64::from(u32::from_be_bytes(size));
        if size < 10 {
            return None; // of unknown size
        }
        at += size;
        // FFmpeg's muxer counts the header of the chunk of packets twice.
        if let Some(cut) = bytes.ends_at(at.saturating_sub(SLACK)) {
            return Some(cut);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn extent(container: &str, bytes: &[u8]) -> Extent {
        let mut file = tempfile::tempfile().expect("temporary file");
        file.write_all(bytes).expect("write");
        of(file, container)
    }

    #[test]
    fn numbers_of_matroska_are_read_with_their_length() {
        assert_eq!(ebml_number(&[0x81], true), Some((1, 1)));
        assert_eq!(ebml_number(&[0x40, 0x02], true), Some((2, 2)));
        assert_eq!(ebml_number(&[0x1a, 0x45, 0xdf, 0xa3], false), Some((0x1a45_dfa3, 4)));
        assert_eq!(ebml_number(&[0x40], true), None);
        assert_eq!(ebml_number(&[0], true), None);
    }

    #[test]
    fn every_cut_of_a_box_is_seen_and_padding_is_none() {
        let whole = [&[0, 0, 0, 12][..], b"ftypisom", &[0, 0, 0, 16], b"mdat", &[1; 8]].concat();
        assert_eq!(extent("mov,mp4", &whole), Extent::Whole);
        assert_eq!(extent("mov,mp4", &[&whole[..], &[0; 5]].concat()), Extent::Whole);
        for end in 13..whole.len() {
            let cut = extent("mov,mp4", &whole[..end]);
            // A remnant of zeros may be padding.
            assert_eq!(cut == Extent::Whole, end < 16, "{end}: {cut:?}");
        }
    }

    #[test]
    fn no_bytes_make_the_reader_panic_or_run_on() {
        let mut random = fastrand::Rng::with_seed(5);
        let heads: [(&str, &[u8]); 12] = [
            ("mov", b"\0\0\0\x01ftyp\xff\xff\xff\xff\xff\xff\xff\xff"),
            ("matroska", b"\x1a\x45\xdf\xa3\x80\x18\x53\x80\x67\x01\xff\xff\xff\xff\xff\xff\xff\x1f\x43\xb6\x75\xff"),
            ("avi", b"RIFF\x04\0\0\0AVI RIFF"),
            ("flv", b"FLV\x01\x05\0\0\0\x09\0\0\0\0\x08\0\0\0"),
            ("asf", &[0x30; 64]),
            ("mxf", b"\x06\x0e\x2b\x34\x02\x05\x01\x01\x0d\x01\x02\x01\x01\x02\x04\x00\x88"),
            ("ogg", b"OggS\0\x02"),
            ("mpeg", b"\0\0\x01\xba\x44\0\0\x01\xe0\0\0"),
            ("apng", b"\x89PNG\r\n\x1a\n"),
            ("ivf", b"DKIF\0\0\0\0"),
            ("yuv4mpegpipe", b"YUV4MPEG2 W18446744073709551615 H2\nFRAME\n"),
            ("rm", b".RMF\0\0\0\x12"),
        ];
        for (container, head) in heads {
            for _ in 0..300 {
                let tail: Vec<u8> = (0..random.usize(0..80)).map(|_| random.u8(..)).collect();
                let mut bytes = [head, &tail].concat();
                if let Some(at) = random.choice(0..bytes.len()) {
                    bytes[at] = random.u8(..);
                }
                let _ = extent(container, &bytes);
            }
        }
    }
}
