//! Numbers of arrays, within a budget.

use std::borrow::Cow;
use std::cell::Cell;
use std::io::Read as _;

use super::binary::{Array, Element, Tree};
use super::fault;
use crate::mesh::{MeshError, ReadLimits};
use plumbline_num::run::Run;

/// Bytes of arrays that may be read of any file. Each takes up to six bytes in a model.
const FREE: u64 = 16 << 20;
/// Bytes of arrays that may be read per byte of the file: each array once, and as much again of arrays that several objects refer to.
const PER_BYTE: u64 = 2;
/// Bytes of arrays that may be read per compressed byte. Coordinates and indices take 2 to 5; constant animation curves more, for which
/// [`FREE`] is enough.
const PER_COMPRESSED_BYTE: u64 = 8;
/// Bytes of samples of animations that may be made per byte of the file, and bytes of a sample: a time and four numbers.
const SAMPLED: u64 = 4;
const PER_SAMPLE: u64 = 40;
/// Bytes that count for a record that is searched, so that many references to one large object do not take quadratic time.
const PER_RECORD: u64 = 32;

/// The records of a file, and how much may still be read of them.
pub(super) struct Reader<'a> {
    pub(super) tree: Tree<'a>,
    pub(super) limits: &'a ReadLimits,
    pub(super) run: &'a Run,
    most: u64,
    taken: Cell<u64>,
    /// Samples of animations that may still be made.
    samples: Cell<u64>,
}

impl<'a> Reader<'a> {
    pub(super) fn new(tree: Tree<'a>, limits: &'a ReadLimits, run: &'a Run) -> Self {
        let of_compressed = tree.compressed.saturating_mul(PER_COMPRESSED_BYTE);
        let most = tree.size.saturating_mul(PER_BYTE).saturating_add(of_compressed).saturating_add(FREE);
        let samples = tree.size.saturating_mul(SAMPLED).saturating_add(of_compressed).saturating_add(FREE);
        Self { tree, limits, run, most, taken: Cell::new(0), samples: Cell::new(samples / PER_SAMPLE) }
    }

    /// Counts bytes that are read at position `at`.
    pub(super) fn spend(&self, bytes: u64, at: usize) -> Result<(), MeshError> {
        let taken = self.taken.get().saturating_add(bytes);
        if taken > self.most {
            let (most, size) = (self.most, self.tree.size);
            let told =
                format!("more than {most} bytes of arrays are read of a file of {size} (copies, or compression)");
            return Err(fault(at, format!("{told}; export the model again, with fewer copies")));
        }
        self.taken.set(taken);
        Ok(())
    }

    /// Counts the search of an object's record and of its connections.
    pub(super) fn open(&self, record: u32, connections: usize) -> Result<(), MeshError> {
        self.run.check()?;
        let searched = u64::from(self.tree.size_of(record)) + connections as u64;
        self.spend(PER_RECORD * searched, self.tree.record(record).at)
    }

    /// Counts samples of an animation; returns whether there may be as many.
    pub(super) fn spend_samples(&self, count: usize) -> bool {
        let left = self.samples.get().checked_sub(count as u64);
        self.samples.set(left.unwrap_or(0));
        left.is_some()
    }

    /// The array of the first record of a name in a record; `None` without one.
    fn array(&self, record: u32, name: &str) -> Option<(Array<'a>, usize)> {
        let child = self.tree.record(self.tree.child(Some(record), name)?);
        Some((child.value(0)?.array()?, child.at))
    }

    /// An array of real numbers; empty without one. Integers count as such.
    pub(super) fn reals(&self, record: u32, name: &str) -> Result<Vec<f64>, MeshError> {
        let Some((array, at)) = self.array(record, name) else { return Ok(Vec::new()) };
        let bytes = self.decoded(&array, at)?;
        Ok(match array.element {
            Element::Byte => bytes.iter().map(|&b| f64::from(b)).collect(),
            Element::Int => fixed::<4>(&bytes).map(|b| f64::from(i32::from_le_bytes(b))).collect(),
            Element::Long => fixed::<8>(&bytes).map(|b| i64::from_le_bytes(b) as f64).collect(),
            Element::Float => fixed::<4>(&bytes).map(|b| f64::from(f32::from_le_bytes(b))).collect(),
            Element::Double => fixed::<8>(&bytes).map(f64::from_le_bytes).collect(),
        })
    }

    /// An array of integers; empty without one.
    ///
    /// # Errors
    /// An array of other numbers.
    pub(super) fn integers(&self, record: u32, name: &str) -> Result<Vec<i32>, MeshError> {
        let Some((array, at)) = self.array(record, name) else { return Ok(Vec::new()) };
        if array.element != Element::Int {
            return Err(fault(at, format!("{name} is an array of {:?} (expected 32-bit integers)", array.element)));
        }
        Ok(fixed::<4>(&self.decoded(&array, at)?).map(i32::from_le_bytes).collect())
    }

    /// An array of 64-bit integers; empty without one.
    ///
    /// # Errors
    /// An array of other numbers.
    pub(super) fn longs(&self, record: u32, name: &str) -> Result<Vec<i64>, MeshError> {
        let Some((array, at)) = self.array(record, name) else { return Ok(Vec::new()) };
        if array.element != Element::Long {
            return Err(fault(at, format!("{name} is an array of {:?} (expected 64-bit integers)", array.element)));
        }
        Ok(fixed::<8>(&self.decoded(&array, at)?).map(i64::from_le_bytes).collect())
    }

    /// The bits of an array of 32-bit numbers: some files hold packed integers among them.
    pub(super) fn words(&self, record: u32, name: &str) -> Result<Vec<u32>, MeshError> {
        let Some((array, at)) = self.array(record, name) else { return Ok(Vec::new()) };
        if !matches!(array.element, Element::Int | Element::Float) {
            return Err(fault(at, format!("{name} is an array of {:?} (expected 32-bit numbers)", array.element)));
        }
        Ok(fixed::<4>(&self.decoded(&array, at)?).map(u32::from_le_bytes).collect())
    }

    /// The bytes of the elements.
    fn decoded(&self, array: &Array<'a>, at: usize) -> Result<Cow<'a, [u8]>, MeshError> {
        let size = array.count * array.element.size();
        self.spend(size as u64, at)?;
        if !array.compressed {
            return Ok(Cow::Borrowed(array.bytes));
        }
        // No more than announced, which the budget allowed, and one byte that would be too many.
        let mut bytes = Vec::with_capacity(size + 1);
        let inflated = flate2::read::ZlibDecoder::new(array.bytes).take(size as u64 + 1).read_to_end(&mut bytes);
        match inflated {
            Ok(read) if read == size => Ok(Cow::Owned(bytes)),
            Ok(read) => {
                let more = if read > size { "more" } else { "fewer" };
                Err(fault(at, format!("an array of {size} bytes decompresses to {more}: the file is damaged")))
            }
            Err(e) => Err(fault(at, format!("a compressed array is damaged ({e})"))),
        }
    }
}

fn fixed<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; N]> + '_ {
    bytes.as_chunks::<N>().0.iter().copied()
}
