//! Records of a binary file.
//!
//! ```text
//! file     magic (21 bytes), 0x1A, byte order, version (32 bits), records, footer
//! record   end offset, number of values, length of values (32 bits each; 64 from version 7.5), length of name (8 bits),
//!          name, values, records, zeros in place of a record
//! value    type (one letter), then a number, or a length and bytes, or an array
//! array    number of elements, encoding (0 raw, 1 zlib), length in bytes (32 bits each), bytes
//! ```
//!
//! Values stay in the file until they are asked for; here they are only measured.

use super::fault;
use crate::mesh::MeshError;
use plumbline_num::run::Run;

/// Maximum depth of records: files have up to eight.
const MAX_DEPTH: usize = 64;
/// First version with 64-bit offsets.
const WIDE: u32 = 7500;
/// Versions that are read: 7.0 up to, and without, 8.0.
const VERSIONS: std::ops::Range<u32> = 7000..8000;
/// Records between two checks for interruption: they take less than a millisecond.
const CHECK_EVERY: usize = 1 << 12;
/// Maximum ratio of bytes to compressed bytes that DEFLATE reaches.
const MAX_RATIO: u64 = 1032;

/// All records of a file, each followed by those in it.
pub(super) struct Tree<'a> {
    records: Vec<Record<'a>>,
    /// Bytes of the file, and those of its compressed arrays.
    pub(super) size: u64,
    pub(super) compressed: u64,
}

/// A record.
#[derive(Clone, Copy)]
pub(super) struct Record<'a> {
    /// Its position in the file, bytes.
    pub(super) at: usize,
    pub(super) name: &'a [u8],
    /// Its values as stored.
    values: &'a [u8],
    /// Index of the first record that is not in it.
    end: u32,
}

/// A value of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Integer(i64),
    Real(f64),
    Text(&'a [u8]),
    Array(Array<'a>),
}

/// An array as stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Array<'a> {
    pub(super) element: Element,
    pub(super) count: usize,
    pub(super) compressed: bool,
    pub(super) bytes: &'a [u8],
}

/// Type of the elements of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Element {
    Byte,
    Int,
    Long,
    Float,
    Double,
}

impl Element {
    pub(super) fn size(self) -> usize {
        match self {
            Self::Byte => 1,
            Self::Int | Self::Float => 4,
            Self::Long | Self::Double => 8,
        }
    }
}

impl<'a> Tree<'a> {
    /// Measures the records of a file that begins with the magic bytes.
    pub(super) fn parse(bytes: &'a [u8], run: &Run) -> Result<Self, MeshError> {
        let mut cursor = Cursor { bytes, at: super::MAGIC.len() };
        let [_, order] = [cursor.number(1)?, cursor.number(1)?];
        if order != 0 {
            return Err(fault(22, "its numbers are big-endian; only little-endian files are read: export it again"));
        }
        let version = cursor.number(4)? as u32;
        if !VERSIONS.contains(&version) {
            let told = format!("version {version} (expected 7000 to 7700): export it again as FBX 7.4 or as glTF");
            return Err(fault(23, told));
        }
        let mut tree = Self { records: Vec::new(), size: bytes.len() as u64, compressed: 0 };
        // Records that are open: index, and position of the end.
        let mut open: Vec<(usize, usize)> = Vec::new();
        loop {
            if tree.records.len().is_multiple_of(CHECK_EVERY) {
                run.check()?;
            }
            let end = open.last().map_or(bytes.len(), |&(_, end)| end);
            let head = if cursor.at < end { Head::read(&mut cursor, version)? } else { None };
            let Some(head) = head else {
                // The end of a list: the next record is beyond the one that has it.
                let Some((record, end)) = open.pop() else { return Ok(tree) };
                tree.records[record].end = tree.records.len() as u32;
                cursor.at = end;
                continue;
            };
            if head.end > end {
                let told = format!("a record that ends at {}, beyond the end of the one that has it, {end}", head.end);
                return Err(fault(head.at, told));
            }
            let Ok(index) = u32::try_from(tree.records.len()) else {
                return Err(fault(head.at, format!("more than {} records", u32::MAX)));
            };
            let values = cursor.within(head.end, head.length)?;
            tree.compressed += measure(values, head.values, cursor.at - values.len())?;
            tree.records.push(Record { at: head.at, name: head.name, values, end: index + 1 });
            if cursor.at < head.end {
                if open.len() >= MAX_DEPTH {
                    return Err(fault(head.at, format!("records more than {MAX_DEPTH} deep")));
                }
                open.push((index as usize, head.end));
            }
        }
    }

    pub(super) fn record(&self, index: u32) -> &Record<'a> {
        &self.records[index as usize]
    }

    /// Records in a record and in these, in all.
    pub(super) fn size_of(&self, index: u32) -> u32 {
        self.records[index as usize].end - index
    }

    /// Records in a record, or of the file.
    pub(super) fn children(&self, index: Option<u32>) -> impl Iterator<Item = u32> + '_ {
        let first = index.map_or(0, |i| i + 1);
        let end = index.map_or(self.records.len() as u32, |i| self.records[i as usize].end);
        let checked = move |i: u32| (i < end).then_some(i);
        std::iter::successors(checked(first), move |&i| checked(self.records[i as usize].end))
    }

    /// The first record of a name in a record, or of the file.
    pub(super) fn child(&self, index: Option<u32>, name: &str) -> Option<u32> {
        self.children(index).find(|&i| self.record(i).name == name.as_bytes())
    }
}

impl<'a> Record<'a> {
    /// Its values in order.
    pub(super) fn values(&self) -> impl Iterator<Item = Value<'a>> {
        let mut cursor = Cursor { bytes: self.values, at: 0 };
        std::iter::from_fn(move || (cursor.at < cursor.bytes.len()).then(|| value(&mut cursor).ok()).flatten())
    }

    pub(super) fn value(&self, index: usize) -> Option<Value<'a>> {
        self.values().nth(index)
    }

    /// The first value as text.
    pub(super) fn text(&self) -> Option<&'a [u8]> {
        self.value(0).and_then(Value::text)
    }
}

impl<'a> Value<'a> {
    pub(super) fn integer(self) -> Option<i64> {
        match self {
            Self::Integer(n) => Some(n),
            _ => None,
        }
    }

    pub(super) fn real(self) -> Option<f64> {
        match self {
            Self::Integer(n) => Some(n as f64),
            Self::Real(x) => Some(x),
            _ => None,
        }
    }

    pub(super) fn text(self) -> Option<&'a [u8]> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }

    pub(super) fn array(self) -> Option<Array<'a>> {
        match self {
            Self::Array(array) => Some(array),
            _ => None,
        }
    }
}

/// First fields of a record.
struct Head<'a> {
    at: usize,
    end: usize,
    values: u64,
    length: usize,
    name: &'a [u8],
}

impl<'a> Head<'a> {
    /// `None` for the zeros at the end of a list.
    fn read(cursor: &mut Cursor<'a>, version: u32) -> Result<Option<Self>, MeshError> {
        let (at, width) = (cursor.at, if version >= WIDE { 8 } else { 4 });
        let [end, values, length] = [cursor.number(width)?, cursor.number(width)?, cursor.number(width)?];
        let name = cursor.number(1)? as usize;
        if end == 0 {
            return Ok(None);
        }
        let name = cursor.take(name)?;
        let [end, length] = [end, length].map(|n| usize::try_from(n).unwrap_or(usize::MAX));
        if end < cursor.at {
            return Err(fault(at, format!("a record that ends at {end}, before its name does")));
        }
        Ok(Some(Self { at, end, values, length, name }))
    }
}

/// A position in bytes.
#[derive(Clone, Copy)]
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], MeshError> {
        self.within(self.bytes.len(), count)
    }

    /// The next `count` bytes, which end at `end` at the latest.
    fn within(&mut self, end: usize, count: usize) -> Result<&'a [u8], MeshError> {
        let last = self.at.checked_add(count).filter(|&last| last <= end.min(self.bytes.len()));
        let Some(last) = last else {
            let left = end.min(self.bytes.len()).saturating_sub(self.at);
            return Err(fault(self.at, format!("{count} bytes are announced, and there are {left}: it is cut short")));
        };
        let taken = &self.bytes[self.at..last];
        self.at = last;
        Ok(taken)
    }

    /// A little-endian number without sign.
    fn number(&mut self, bytes: usize) -> Result<u64, MeshError> {
        let taken = self.take(bytes)?;
        Ok(taken.iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte)))
    }
}

/// Checks that `bytes`, at position `at` of the file, are `count` values; returns the length of the compressed arrays among them.
fn measure(bytes: &[u8], count: u64, at: usize) -> Result<u64, MeshError> {
    let mut cursor = Cursor { bytes, at: 0 };
    let mut compressed = 0;
    for _ in 0..count {
        let start = cursor.at;
        let moved = |fault: MeshError| match fault {
            MeshError::Malformed { format, at: crate::mesh::Position::Byte(offset), fault } => {
                MeshError::Malformed { format, at: crate::mesh::Position::Byte(at + offset), fault }
            }
            other => other,
        };
        if let Value::Array(array) = value(&mut cursor).map_err(moved)? {
            let (stored, size) = (array.bytes.len() as u64, array.count as u64 * array.element.size() as u64);
            let fits = if array.compressed { size <= MAX_RATIO * stored } else { size == stored };
            if !fits {
                let told = format!("an array of {} elements in {stored} bytes", array.count);
                return Err(fault(at + start, format!("{told}; they do not fit: the file is damaged")));
            }
            compressed += if array.compressed { stored } else { 0 };
        }
    }
    if cursor.at < bytes.len() {
        let told = format!("{} bytes are left after the {count} values of a record", bytes.len() - cursor.at);
        return Err(fault(at + cursor.at, told));
    }
    Ok(compressed)
}

fn value<'a>(cursor: &mut Cursor<'a>) -> Result<Value<'a>, MeshError> {
    let at = cursor.at;
    let kind = cursor.number(1)? as u8;
    Ok(match kind {
        b'C' | b'B' => Value::Integer(cursor.number(1)? as i64),
        b'Y' => Value::Integer(i64::from(cursor.number(2)? as i16)),
        b'I' => Value::Integer(i64::from(cursor.number(4)? as i32)),
        b'L' => Value::Integer(cursor.number(8)? as i64),
        b'F' => Value::Real(f64::from(f32::from_bits(cursor.number(4)? as u32))),
        b'D' => Value::Real(f64::from_bits(cursor.number(8)?)),
        b'S' | b'R' => {
            let length = cursor.number(4)? as usize;
            Value::Text(cursor.take(length)?)
        }
        b'b' | b'c' => Value::Array(array(cursor, Element::Byte)?),
        b'i' => Value::Array(array(cursor, Element::Int)?),
        b'l' => Value::Array(array(cursor, Element::Long)?),
        b'f' => Value::Array(array(cursor, Element::Float)?),
        b'd' => Value::Array(array(cursor, Element::Double)?),
        other => return Err(fault(at, format!("a value of the unknown type {:?}", char::from(other)))),
    })
}

fn array<'a>(cursor: &mut Cursor<'a>, element: Element) -> Result<Array<'a>, MeshError> {
    let at = cursor.at;
    let [count, encoding, length] = [cursor.number(4)?, cursor.number(4)?, cursor.number(4)?];
    if encoding > 1 {
        return Err(fault(at, format!("an array in the unknown encoding {encoding} (expected 0 or 1)")));
    }
    let (count, length) = (count as usize, length as usize);
    // Some writers leave the length of raw arrays at 0.
    let length = if encoding == 0 && length == 0 { count.saturating_mul(element.size()) } else { length };
    Ok(Array { element, count, compressed: encoding == 1, bytes: cursor.take(length)? })
}
