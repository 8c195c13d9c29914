//! A document with its buffers, and the budget of values read from them.

use std::cell::Cell;

use super::super::ReadLimits;
use super::accessor::{self, Values};
use super::buffers::Buffers;
use super::document::Document;
use crate::mesh::MeshError;

/// Input of the readers of the parts of a document.
pub(super) struct Input<'a> {
    pub(super) document: &'a Document,
    pub(super) buffers: &'a Buffers<'a>,
    pub(super) limits: &'a ReadLimits,
    /// Numbers read so far: a small file may reference one accessor many times.
    taken: Cell<usize>,
}

/// Numbers that may be read per allowed element of a model. A vertex has 3 + 3 + 2 + 4 numbers of position, normal, texture
/// coordinates and color and 16 of influences; the rest is for morph targets and animation keys. Bounds memory and time for
/// hostile files.
const NUMBERS_PER_ELEMENT: usize = 64;

impl<'a> Input<'a> {
    pub(super) fn new(document: &'a Document, buffers: &'a Buffers<'a>, limits: &'a ReadLimits) -> Self {
        Self { document, buffers, limits, taken: Cell::new(0) }
    }

    /// Values of accessor `index`, whose type must be among `kinds`.
    pub(super) fn values(&self, index: usize, kinds: &[&str]) -> Result<Values, MeshError> {
        let values = accessor::values(self.document, self.buffers, index, kinds, self.limits)?;
        self.taken.set(self.taken.get() + values.numbers.len());
        self.limits.check("number of values in accessors, over 64,", self.taken.get() / NUMBERS_PER_ELEMENT)?;
        Ok(values)
    }
}
