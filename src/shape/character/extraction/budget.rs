//! A budget of work for the steps that collapse a component.
//!
//! A collapse takes time in proportion to the triangles at its vertices. On surfaces these are six on average; where tens of thousands meet at
//! one vertex, the work of all collapses would grow with the square of the triangles. It is counted, and the steps end where it is used up.

use std::cell::Cell;

/// Units of work for any component. One unit is a visit of a triangle at a vertex, some nanoseconds.
const MIN_UNITS: u64 = 1_000_000_000;
/// Units of work per triangle of a component: some twenty microseconds. Models of 3 000 to 23 000 triangles take about a hundred, so that none
/// of them comes near; at a hundredth of this hubs of a few thousand triangles are refused.
const UNITS_PER_TRIANGLE: u64 = 10_000;
/// Units of a queued collapse: a queue of millions takes the time of thirty visits for each.
const UNITS_PER_ENTRY: u64 = 30;

/// Work left to a component.
#[derive(Clone, Debug)]
pub(super) struct Budget {
    left: Cell<u64>,
}

impl Budget {
    /// The budget of a component with so many triangles.
    pub(super) fn new(triangles: usize) -> Self {
        Self { left: Cell::new(MIN_UNITS + UNITS_PER_TRIANGLE * triangles as u64) }
    }

    /// A budget of so many units.
    #[cfg(test)]
    pub(super) fn of(units: u64) -> Self {
        Self { left: Cell::new(units) }
    }

    /// Units that are left.
    #[cfg(test)]
    pub(super) fn left(&self) -> u64 {
        self.left.get()
    }

    /// Counts visits of triangles or edges.
    pub(super) fn visit(&self, count: usize) {
        self.left.set(self.left.get().saturating_sub(count as u64));
    }

    /// Counts entries of a queue.
    pub(super) fn queue(&self, count: usize) {
        self.left.set(self.left.get().saturating_sub(UNITS_PER_ENTRY * count as u64));
    }

    /// Whether all work is done.
    pub(super) fn is_spent(&self) -> bool {
        self.left.get() == 0
    }
}
