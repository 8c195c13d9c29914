//! Changes to EXIF in place: the block keeps its length and every offset in it, so that unknown entries (the notes of
//! the camera's maker, whose offsets may count from anywhere) stays readable.
//!
//! The block is a TIFF file: a header with the byte order, then directories of 12-byte entries
//! `tag u16, type u16, count u32, value or offset u32`, each followed by the offset of the next directory. The second
//! directory describes the thumbnail; unlinked, it is gone for every reader.

use std::io::{BufRead, Seek};

use super::ExifTags;

/// The EXIF block of any container that has one (HEIF too), for an upright picture of `width × height` px, and what it said of
/// camera and lens.
pub fn exif_of_container(mut reader: impl BufRead + Seek, width: usize, height: usize) -> Option<(Vec<u8>, ExifTags)> {
    let mut exif = ::exif::Reader::new();
    exif.continue_on_error(true);
    let found = exif.read_from_container(&mut reader).or_else(|e| e.distill_partial_result(|_| {})).ok()?;
    let mut block = found.buf().to_vec();
    let tags = ExifTags::of(&block);
    describe(&mut block, width, height).then_some((block, tags))
}

/// Tags of the first directory.
const WIDTH: u16 = 256;
const HEIGHT: u16 = 257;
pub(super) const ORIENTATION: u16 = 274;
const EXIF_DIRECTORY: u16 = 34665;
/// Tags of the EXIF directory.
const PIXEL_X: u16 = 40962;
const PIXEL_Y: u16 = 40963;

/// Types of values.
pub(super) const SHORT: u16 = 3;
pub(super) const LONG: u16 = 4;

/// Byte order of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    Little,
    Big,
}

impl Order {
    /// The byte order in a TIFF header.
    pub(super) fn of(block: &[u8]) -> Option<Self> {
        match block.get(..4)? {
            b"II*\0" => Some(Self::Little),
            b"MM\0*" => Some(Self::Big),
            _ => None,
        }
    }

    pub(super) fn u16(self, b: [u8; 2]) -> u16 {
        if self == Self::Little { u16::from_le_bytes(b) } else { u16::from_be_bytes(b) }
    }

    pub(super) fn u32(self, b: [u8; 4]) -> u32 {
        if self == Self::Little { u32::from_le_bytes(b) } else { u32::from_be_bytes(b) }
    }

    pub(super) fn bytes16(self, v: u16) -> [u8; 2] {
        if self == Self::Little { v.to_le_bytes() } else { v.to_be_bytes() }
    }

    pub(super) fn bytes32(self, v: u32) -> [u8; 4] {
        if self == Self::Little { v.to_le_bytes() } else { v.to_be_bytes() }
    }

    fn u16_at(self, block: &[u8], at: usize) -> Option<u16> {
        Some(self.u16(block.get(at..at.checked_add(2)?)?.try_into().ok()?))
    }

    fn u32_at(self, block: &[u8], at: usize) -> Option<u32> {
        Some(self.u32(block.get(at..at.checked_add(4)?)?.try_into().ok()?))
    }
}

/// A directory: where its entries are, and where the link to the next one.
#[derive(Clone, Copy, Debug)]
struct Directory {
    first: usize,
    entries: usize,
}

impl Directory {
    /// The directory at `offset`, if it lies inside the block with its link.
    fn at(block: &[u8], order: Order, offset: u32) -> Option<Self> {
        let offset = offset as usize;
        let entries = usize::from(order.u16_at(block, offset)?);
        let directory = Self { first: offset + 2, entries };
        (directory.link() + 4 <= block.len()).then_some(directory)
    }

    fn link(self) -> usize {
        self.first + 12 * self.entries
    }

    /// Position of the entry with this tag.
    fn entry(self, block: &[u8], order: Order, tag: u16) -> Option<usize> {
        (0..self.entries).map(|i| self.first + 12 * i).find(|&at| order.u16_at(block, at) == Some(tag))
    }
}

/// An unparsed entry, in the block's byte order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) tag: u16,
    pub(super) bytes: [u8; 12],
}

impl Entry {
    /// Type of its values.
    pub(super) fn kind(&self, order: Order) -> u16 {
        order.u16([self.bytes[2], self.bytes[3]])
    }

    /// How many values it has.
    pub(super) fn count(&self, order: Order) -> u32 {
        let [.., a, b, c, d, _, _, _, _] = self.bytes;
        order.u32([a, b, c, d])
    }

    /// The first of its short numbers, which are in the block where there are more than two.
    pub(super) fn first_short(&self, block: &[u8], order: Order) -> Option<u16> {
        match self.count(order) {
            _ if self.kind(order) != SHORT => None,
            1 | 2 => Some(order.u16([self.bytes[8], self.bytes[9]])),
            _ => order.u16_at(block, self.value(order) as usize),
        }
    }

    /// Its value read as a long: a number, or where the values are.
    pub(super) fn value(&self, order: Order) -> u32 {
        let [.., a, b, c, d] = self.bytes;
        order.u32([a, b, c, d])
    }
}

/// Entries of the first directory; `None` where the block is no TIFF or the directory is cut off.
pub(super) fn first_directory(block: &[u8]) -> Option<(Order, Vec<Entry>)> {
    let order = Order::of(block)?;
    let directory = Directory::at(block, order, order.u32_at(block, 4)?)?;
    let entry = |i: usize| {
        let at = directory.first + 12 * i;
        let bytes: [u8; 12] = block.get(at..at + 12)?.try_into().ok()?;
        Some(Entry { tag: order.u16([bytes[0], bytes[1]]), bytes })
    };
    Some((order, (0..directory.entries).filter_map(entry).collect()))
}

/// One short or long number.
fn number(block: &[u8], order: Order, entry: usize) -> Option<u32> {
    match (order.u16_at(block, entry + 2)?, order.u32_at(block, entry + 4)?) {
        (SHORT, 1) => order.u16_at(block, entry + 8).map(u32::from),
        (LONG, 1) => order.u32_at(block, entry + 8),
        _ => None,
    }
}

/// Sets one short or long number; a short that is too small becomes a long, at the same position.
fn set_number(block: &mut [u8], order: Order, entry: usize, value: u32) {
    let kind = order.u16_at(block, entry + 2);
    let lone = order.u32_at(block, entry + 4) == Some(1);
    if !lone || !matches!(kind, Some(SHORT | LONG)) {
        return;
    }
    match u16::try_from(value) {
        Ok(short) if kind == Some(SHORT) => {
            block[entry + 8..entry + 10].copy_from_slice(&order.bytes16(short));
            block[entry + 10..entry + 12].fill(0);
        }
        _ => {
            block[entry + 2..entry + 4].copy_from_slice(&order.bytes16(LONG));
            block[entry + 8..entry + 12].copy_from_slice(&order.bytes32(value));
        }
    }
}

/// Value of the orientation tag.
pub(super) fn orientation(block: &[u8]) -> Option<u32> {
    let order = Order::of(block)?;
    let directory = Directory::at(block, order, order.u32_at(block, 4)?)?;
    number(block, order, directory.entry(block, order, ORIENTATION)?)
}

/// Says that the picture is upright and `width × height` px large, and unlinks the thumbnail. False where the block cannot
/// be read: then it is unchanged and must not be kept.
pub(super) fn describe(block: &mut [u8], width: usize, height: usize) -> bool {
    let Some(order) = Order::of(block) else { return false };
    let first = order.u32_at(block, 4).and_then(|offset| Directory::at(block, order, offset));
    let Some(first) = first else { return false };
    let (width, height) = (width as u32, height as u32);
    for (tag, value) in [(ORIENTATION, 1), (WIDTH, width), (HEIGHT, height)] {
        if let Some(entry) = first.entry(block, order, tag) {
            set_number(block, order, entry, value);
        }
    }
    let link = first.link();
    block[link..link + 4].fill(0);
    let inner = first.entry(block, order, EXIF_DIRECTORY).and_then(|entry| number(block, order, entry));
    if let Some(inner) = inner.and_then(|offset| Directory::at(block, order, offset)) {
        for (tag, value) in [(PIXEL_X, width), (PIXEL_Y, height)] {
            if let Some(entry) = inner.entry(block, order, tag) {
                set_number(block, order, entry, value);
            }
        }
    }
    true
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A block with orientation 6, a size as shorts, a maker's note at the end and a thumbnail directory.
    pub(in super::super) fn sample(order: Order) -> Vec<u8> {
        let mut b: Vec<u8> = if order == Order::Little { b"II*\0".to_vec() } else { b"MM\0*".to_vec() };
        let entry = |tag: u16, kind: u16, count: u32, value: [u8; 4]| {
            [&order.bytes16(tag)[..], &order.bytes16(kind), &order.bytes32(count), &value].concat()
        };
        let short = |v: u16| [order.bytes16(v), [0, 0]].concat().try_into().expect("four bytes");
        b.extend(order.bytes32(8));
        // First directory at 8: make, orientation, EXIF directory.
        b.extend(order.bytes16(3));
        b.extend(entry(271, 2, 4, *b"Cam\0"));
        b.extend(entry(ORIENTATION, SHORT, 1, short(6)));
        b.extend(entry(EXIF_DIRECTORY, LONG, 1, order.bytes32(50)));
        b.extend(order.bytes32(120));
        assert_eq!(b.len(), 50);
        // EXIF directory at 50: focal length, size, maker's note.
        b.extend(order.bytes16(4));
        b.extend(entry(37386, 5, 1, order.bytes32(104)));
        b.extend(entry(37500, 7, 8, order.bytes32(112)));
        b.extend(entry(PIXEL_X, SHORT, 1, short(400)));
        b.extend(entry(PIXEL_Y, SHORT, 1, short(300)));
        b.extend(order.bytes32(0));
        assert_eq!(b.len(), 104);
        b.extend(order.bytes32(28));
        b.extend(order.bytes32(10));
        b.extend(*b"MAKERXYZ");
        // Thumbnail directory at 120, empty.
        b.extend(order.bytes16(0));
        b.extend(order.bytes32(0));
        b
    }

    #[test]
    fn only_what_changed_is_changed_in_either_byte_order() {
        for order in [Order::Little, Order::Big] {
            let before = sample(order);
            assert_eq!(orientation(&before), Some(6));
            let mut after = before.clone();
            assert!(describe(&mut after, 70_000, 200));
            assert_eq!(orientation(&after), Some(1));
            let inner = Directory::at(&after, order, 50).expect("inside");
            let value = |tag| number(&after, order, inner.entry(&after, order, tag).expect("there"));
            assert_eq!((value(PIXEL_X), value(PIXEL_Y)), (Some(70_000), Some(200)));
            assert_eq!(order.u32_at(&after, 46), Some(0), "the thumbnail is unlinked");
            let changed: Vec<usize> = (0..before.len()).filter(|&i| before[i] != after[i]).collect();
            let allowed = |i: &usize| (22..34).contains(i) || (46..50).contains(i) || (76..100).contains(i);
            assert!(changed.iter().all(allowed), "{changed:?}");
        }
    }

    #[test]
    fn blocks_that_are_cut_off_or_lie_are_refused_or_left() {
        let whole = sample(Order::Little);
        for length in 0..whole.len() {
            let mut cut = whole[..length].to_vec();
            let good = describe(&mut cut, 10, 10);
            assert_eq!(good, length >= 50, "{length}");
        }
        let mut rng = fastrand::Rng::with_seed(4);
        for _ in 0..20_000 {
            let mut wild = whole.clone();
            for _ in 0..rng.usize(1..6) {
                let at = rng.usize(..wild.len());
                wild[at] = rng.u8(..);
            }
            describe(&mut wild, 10, 10);
            assert_eq!(wild.len(), whole.len());
        }
    }
}
