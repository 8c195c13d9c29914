//! Geometric nested dissection: an elimination order from positions alone.
//!
//! Cut the unknowns in two halves along their longer extent, put the vertices that touch the cut last, and go on inside
//! the halves. On a grid of `n` vertices the factor has `O(n log n)` entries and `O(n^{3/2})` arithmetic, which no order
//! can beat; computing it costs less than one factorization.
//!
//! # Reference
//! George 1973; recursive coordinate bisection as in M. T. Heath, P. Raghavan, *A Cartesian parallel nested dissection
//! algorithm*, SIAM J. Matrix Anal. Appl. 16 (1995).

use super::{Pattern, Permutation};
use crate::math::Lists;

/// Sets of at most so many unknowns are no longer cut. On the 65×37 image grid 12 to 16 were fastest to factor and solve
/// (1.74 ms a frame; 2.04 ms at 1 to 4, where supernodes are too thin, 1.98 ms at 32, where fill grows by a tenth).
const LEAF: usize = 16;

/// The nested dissection order of unknowns at `positions` (one per unknown; unknowns of one vertex share its position), and the
/// multiplications of its separators alone, as dense matrices.
///
/// Positions only guide the cuts: any positions give a valid order.
pub(super) fn nested_dissection(pattern: &Pattern, positions: &[[f64; 3]]) -> (Permutation, f64) {
    let mut unknowns: Vec<u32> = (0..pattern.n() as u32).collect();
    let (neighbors, side) = (pattern.adjacency(), vec![Side::Other; pattern.n()]);
    let mut dissection = Dissection { neighbors, positions, side, flops: 0.0 };
    dissection.order(&mut unknowns);
    (Permutation::from_old_from_new(unknowns), dissection.flops)
}

#[derive(Clone, Copy, PartialEq)]
enum Side {
    Other,
    Low,
    High,
}

struct Dissection<'a> {
    neighbors: Lists<u32>,
    positions: &'a [[f64; 3]],
    side: Vec<Side>,
    /// Multiplications of the separators so far.
    flops: f64,
}

impl Dissection<'_> {
    /// Puts a set into elimination order: low half, high half, separator.
    fn order(&mut self, set: &mut [u32]) {
        if set.len() <= LEAF {
            return;
        }
        let cut = self.bisect(set);
        let low_border = self.border(&set[..cut], Side::High);
        let high_border = self.border(&set[cut..], Side::Low);
        let (low, high) = set.split_at_mut(cut);
        let separator = if low_border <= high_border {
            let kept = self.move_border_last(low, Side::High);
            low[kept..].to_vec()
        } else {
            let kept = self.move_border_last(high, Side::Low);
            high[kept..].to_vec()
        };
        self.flops += (separator.len() as f64).powi(3) / 3.0;
        for &v in set.iter() {
            self.side[v as usize] = Side::Other;
        }
        let (mut low_len, mut high_len) = (cut, set.len() - cut);
        if low_border <= high_border {
            low_len -= separator.len();
            set.copy_within(cut.., low_len);
        } else {
            high_len -= separator.len();
        }
        set[low_len + high_len..].copy_from_slice(&separator);
        self.order(&mut set[..low_len]);
        self.order(&mut set[low_len..low_len + high_len]);
    }

    /// Splits a set at the median of its longer extent, equal coordinates together where possible, and marks the sides.
    fn bisect(&mut self, set: &mut [u32]) -> usize {
        let axis = self.longest_axis(set);
        let key = |v: u32| self.positions[v as usize][axis];
        set.sort_unstable_by(|&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        let half = set.len() / 2;
        let median = key(set[half]);
        let below = set.partition_point(|&v| key(v) < median);
        let through = set.partition_point(|&v| key(v) <= median);
        let cut = match (below > 0, through < set.len()) {
            (true, true) if half - below <= through - half => below,
            (true, false) => below,
            (_, true) => through,
            (false, false) => half,
        };
        for (k, &v) in set.iter().enumerate() {
            self.side[v as usize] = if k < cut { Side::Low } else { Side::High };
        }
        cut
    }

    fn longest_axis(&self, set: &[u32]) -> usize {
        let extent = |axis: usize| {
            let coordinates = set.iter().map(|&v| self.positions[v as usize][axis]);
            let (low, high) =
                coordinates.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (x.min(low), x.max(high)));
            high - low
        };
        (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b)).then(b.cmp(&a))).unwrap_or(0)
    }

    fn touches(&self, v: u32, side: Side) -> bool {
        self.neighbors.of(v as usize).iter().any(|&w| self.side[w as usize] == side)
    }

    fn border(&self, set: &[u32], side: Side) -> usize {
        set.iter().filter(|&&v| self.touches(v, side)).count()
    }

    /// Moves the vertices that touch `side` to the end, keeping the order otherwise; returns how many do not.
    fn move_border_last(&self, set: &mut [u32], side: Side) -> usize {
        let border: Vec<u32> = set.iter().copied().filter(|&v| self.touches(v, side)).collect();
        let inner: Vec<u32> = set.iter().copied().filter(|&v| !self.touches(v, side)).collect();
        set[..inner.len()].copy_from_slice(&inner);
        set[inner.len()..].copy_from_slice(&border);
        inner.len()
    }
}
