//! A document with its buffers, and the budget of values read from them.

use std::cell::Cell;

use super::super::ReadLimits;
use super::accessor::{self, Values};
use super::buffers::Buffers;
use super::document::Document;
use super::fault;
use crate::mesh::MeshError;

/// Input of the readers of the parts of a document.
pub(super) struct Input<'a> {
    pub(super) document: &'a Document,
    pub(super) buffers: &'a Buffers<'a>,
    pub(super) limits: &'a ReadLimits,
    /// Bytes of the document and of the files that it names, and the numbers that may be read of them.
    size: u64,
    most: usize,
    /// Numbers read so far: a small file may reference one accessor many times.
    taken: Cell<usize>,
}

/// Numbers that may be read per allowed element of a model. A vertex has 3 + 3 + 2 + 4 numbers of position, normal, texture
/// coordinates and color and 16 of influences; the rest is for morph targets and animation keys. Bounds memory and time for
/// hostile files.
const NUMBERS_PER_ELEMENT: usize = 64;

/// Numbers that may be read of any file beyond one per byte, of which no file has more: instances of meshes, and accessors without a
/// buffer view, which are zeros. A number takes up to 40 bytes in a model.
const FREE_NUMBERS: u64 = 4 << 20;

/// Numbers that may be read per byte of a compressed view: a triangle takes a byte at best, and the numbers of a vertex, most of
/// which have one or two bytes, half of theirs.
const NUMBERS_PER_COMPRESSED_BYTE: u64 = 8;

impl<'a> Input<'a> {
    /// `size` is the number of bytes of the document and of the files that it names.
    pub(super) fn new(document: &'a Document, buffers: &'a Buffers<'a>, limits: &'a ReadLimits, size: u64) -> Self {
        let of_compressed = buffers.compressed_bytes().saturating_mul(NUMBERS_PER_COMPRESSED_BYTE);
        let most = size.saturating_add(of_compressed).saturating_add(FREE_NUMBERS);
        let most = usize::try_from(most).unwrap_or(usize::MAX);
        Self { document, buffers, limits, most, size, taken: Cell::new(0) }
    }

    /// Values of accessor `index`, whose type must be among `kinds`.
    pub(super) fn values(&self, index: usize, kinds: &[&str]) -> Result<Values, MeshError> {
        let left = self.most - self.taken.get();
        let values = accessor::values(self.document, self.buffers, index, kinds, self.limits, left)?;
        let at = format!("/accessors/{index}");
        let values = values.ok_or_else(|| self.too_many(&at))?;
        self.spend(values.numbers.len(), &at)?;
        Ok(values)
    }

    /// Counts numbers that the value at `at` makes.
    pub(super) fn spend(&self, numbers: usize, at: &str) -> Result<(), MeshError> {
        let taken = self.taken.get().saturating_add(numbers);
        if taken > self.most {
            return Err(self.too_many(at));
        }
        self.taken.set(taken);
        self.limits.check("number of values in accessors, over 64,", taken / NUMBERS_PER_ELEMENT)
    }

    fn too_many(&self, at: &str) -> MeshError {
        let (most, size) = (self.most, self.size);
        let told =
            format!("more than {most} numbers are read of {size} bytes (copies of meshes, or accessors without data)");
        fault(at, format!("{told}; export the model with fewer instances"))
    }
}
