//! A second picture behind the first: the gain map of Ultra HDR.
//!
//! A segment `MPF` of the first picture holds a TIFF directory, whose offsets and those of the pictures count from its header. Which
//! of the other pictures is a gain map, its own segments say: XMP of the namespace `hdrgm`, or the binary form of ISO 21496-1.
//! The first picture repeats that there is one, in XMP with the lengths of all that follows.
//!
//! # Reference
//! CIPA DC-007, *Multi-Picture Format*; Google, *Ultra HDR image format* 1.1; ISO 21496-1.

use super::super::exif::{Order, first_directory};
use super::segments::{ISO, XMP, contents, pieces, segment};

/// Begins the segment.
const MPF: &[u8] = b"MPF\0";
const NAMESPACE: &[u8] = b"http://ns.adobe.com/hdr-gain-map/1.0/";
/// Of the pictures that phones of Apple write.
const APPLE: &[u8] = b"hdrgainmap";
/// Tag with a list of pictures, and the length of an entry of it.
const ENTRIES: u16 = 0xb002;
const ENTRY: usize = 16;
/// Maximum number of pictures that are looked at.
const MAX_PICTURES: usize = 64;
/// Length of the segment that is written, with its marker.
const LENGTH: usize = 90;

/// A gain map as a file of its own.
#[derive(Clone, Debug)]
pub(in super::super) struct EncodedMap {
    /// The JPEG file.
    pub(in super::super) file: Vec<u8>,
    /// How it is applied, as XMP and in binary form.
    pub(in super::super) xmp: Option<Vec<u8>>,
    pub(in super::super) iso: Option<Vec<u8>>,
}

/// The gain map of a file; where it says that it has one and none can be taken, the error is in words.
pub(in super::super) fn gain_map(bytes: &[u8]) -> Result<Option<EncodedMap>, &'static str> {
    let mut apple = false;
    for file in pictures(bytes).unwrap_or_default() {
        let xmp = contents(file, 0xe1, XMP).find(|packet| has(packet, NAMESPACE));
        let iso = contents(file, 0xe2, ISO).next();
        if xmp.is_some() || iso.is_some() {
            let [xmp, iso] = [xmp, iso].map(|content| content.map(<[u8]>::to_vec));
            return Ok(Some(EncodedMap { file: file.to_vec(), xmp, iso }));
        }
        apple |= contents(file, 0xe1, XMP).any(|packet| has(packet, APPLE));
    }
    let named = contents(bytes, 0xe1, XMP).any(|packet| has(packet, NAMESPACE));
    match (apple, named) {
        (true, _) => Err("its HDR gain map is of a kind that is not read, and was left out"),
        (_, true) => Err("its HDR gain map is not where the file says, and was left out"),
        _ => Ok(None),
    }
}

fn has(bytes: &[u8], what: &[u8]) -> bool {
    bytes.windows(what.len()).any(|w| w == what)
}

/// The pictures behind the first one.
fn pictures(bytes: &[u8]) -> Option<Vec<&[u8]>> {
    let header = pieces(bytes, 0xe2, MPF).next()?.start;
    let block = &bytes[header..];
    let (order, entries) = first_directory(block)?;
    let list = entries.iter().find(|e| e.tag == ENTRIES)?;
    let list = block.get(list.value(order) as usize..)?.get(..list.count(order) as usize)?;
    let picture = |entry: &[u8]| {
        let number = |at: usize| Some(order.u32(*entry.get(at..)?.first_chunk()?) as usize);
        let file = block.get(number(8)?..)?.get(..number(4)?)?;
        file.starts_with(b"\xff\xd8\xff").then_some(file)
    };
    Some(list.chunks_exact(ENTRY).skip(1).take(MAX_PICTURES).filter_map(picture).collect())
}

/// Both pictures as one file: the segment that names them goes behind the segments of the first.
pub(in super::super) fn joined(first: &[u8], second: &[u8]) -> Option<Vec<u8>> {
    let mut at = 2;
    while let Some(s) = segment(first, at).filter(|s| matches!(s.code, 0xe0..=0xef)) {
        at = s.end;
    }
    let header = at + 4 + MPF.len();
    let order = Order::Big;
    let long = |v: usize| u32::try_from(v).ok().map(|v| order.bytes32(v));
    let whole = long(first.len() + LENGTH)?;
    let mut mpf = [&[0xff, 0xe2], &((LENGTH - 2) as u16).to_be_bytes()[..], MPF, b"MM\0*\0\0\0\x08\0\x03"].concat();
    mpf.extend(*b"\xb0\0\0\x07\0\0\0\x040100");
    mpf.extend(*b"\xb0\x01\0\x04\0\0\0\x01\0\0\0\x02");
    // The list is behind the directory: 8 of the header, 2 + 3 · 12 + 4 of the directory.
    mpf.extend(*b"\xb0\x02\0\x07\0\0\0\x20\0\0\0\x32");
    mpf.extend([0; 4]);
    mpf.extend([&[0, 3, 0, 0][..], &whole, &[0; 8]].concat());
    mpf.extend([&[0; 4][..], &long(second.len())?, &long(first.len() + LENGTH - header)?, &[0; 4]].concat());
    debug_assert_eq!(mpf.len(), LENGTH, "the length in the segment");
    Some([&first[..at], &mpf, &first[at..], second].concat())
}
