//! A document with its bytes, and how much of them has been taken.

use std::cell::Cell;

use super::super::ReadLimits;
use super::accessor::{self, Values};
use super::buffers::Buffers;
use super::document::Document;
use crate::mesh::MeshError;

/// What the parts of a file are read from.
pub(super) struct Input<'a> {
    pub(super) document: &'a Document,
    pub(super) buffers: &'a Buffers<'a>,
    pub(super) limits: &'a ReadLimits,
    /// Numbers read so far: a small file may name one accessor many times over.
    taken: Cell<usize>,
}

/// Numbers that may be read for each element that a model may have: positions, normals, texture coordinates, colors and sixteen
/// for influences, besides morph targets and keys.
const NUMBERS_PER_ELEMENT: usize = 64;

impl<'a> Input<'a> {
    pub(super) fn new(document: &'a Document, buffers: &'a Buffers<'a>, limits: &'a ReadLimits) -> Self {
        Self { document, buffers, limits, taken: Cell::new(0) }
    }

    /// Values of accessor number `index`, whose type must be among `kinds`.
    pub(super) fn values(&self, index: usize, kinds: &[&str]) -> Result<Values, MeshError> {
        let values = accessor::values(self.document, self.buffers, index, kinds, self.limits)?;
        self.taken.set(self.taken.get() + values.numbers.len());
        self.limits.check("number of values in accessors, over 64,", self.taken.get() / NUMBERS_PER_ELEMENT)?;
        Ok(values)
    }
}
