//! Unknowns whose values are given.

use std::sync::Arc;

use super::Value;

/// Which unknowns are given: part of the factorization.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct FixedSet(Arc<[usize]>);

/// Where they are: part of a solve. Made by [`FixedSet::values`], so that a value cannot belong to another unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct FixedValues<const D: usize> {
    set: FixedSet,
    values: Vec<Value<D>>,
}

impl FixedSet {
    /// Nothing is given.
    pub fn none() -> Self {
        Self::default()
    }

    /// These unknowns are given; order and repeats do not matter.
    pub fn new(unknowns: impl IntoIterator<Item = usize>) -> Self {
        let mut unknowns: Vec<usize> = unknowns.into_iter().collect();
        unknowns.sort_unstable();
        unknowns.dedup();
        Self(unknowns.into())
    }

    /// The unknowns, ascending.
    pub fn unknowns(&self) -> &[usize] {
        &self.0
    }

    /// A value for each given unknown.
    pub fn values<const D: usize>(&self, value: impl FnMut(usize) -> Value<D>) -> FixedValues<D> {
        FixedValues { values: self.0.iter().copied().map(value).collect(), set: self.clone() }
    }
}

impl<const D: usize> FixedValues<D> {
    /// The set whose values these are.
    pub fn set(&self) -> &FixedSet {
        &self.set
    }

    /// Values in the order of [`FixedSet::unknowns`].
    pub fn as_slice(&self) -> &[Value<D>] {
        &self.values
    }

    /// The same, to be moved without making a new set: drags of a handle.
    pub fn as_mut_slice(&mut self) -> &mut [Value<D>] {
        &mut self.values
    }
}
