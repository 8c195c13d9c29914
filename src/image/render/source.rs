//! A source plane with its border, and the scalar way to sample it: what the SIMD kernels must equal bit for bit.

use super::border::Border;
use super::kernel::{PHASE_BITS, PHASES, PairTable, Table, UNIT, taps};
use crate::PlaneRef;

/// Where the weights of the samples of a row are, by the index of the sample and its position in units of 1/256 px.
pub(super) trait Taps<const N: usize> {
    /// Weights along x.
    fn across(&self, i: usize, x: i32) -> &[i16; N];
    /// Weights along y.
    fn down(&self, i: usize, y: i32) -> &[i16; N];
}

impl<const N: usize> Taps<N> for Table<N> {
    fn across(&self, _: usize, x: i32) -> &[i16; N] {
        &self[x as usize % PHASES]
    }

    fn down(&self, _: usize, y: i32) -> &[i16; N] {
        &self[y as usize % PHASES]
    }
}

/// Pairs of samples: for each sample of a row the first row of its levels in the table.
pub(super) struct Pairs<'a> {
    pub(super) table: &'a PairTable,
    pub(super) across: &'a [u16],
    pub(super) down: &'a [u16],
}

impl Taps<8> for Pairs<'_> {
    fn across(&self, i: usize, x: i32) -> &[i16; 8] {
        &self.table[(usize::from(self.across[i]) + x as usize % PHASES) % self.table.len()]
    }

    fn down(&self, i: usize, y: i32) -> &[i16; 8] {
        &self.table[(usize::from(self.down[i]) + y as usize % PHASES) % self.table.len()]
    }
}

/// A sample type: `u8` or `u16`.
pub(super) trait Sample: Copy + Default + PartialEq + std::fmt::Debug + Send + Sync + 'static {
    fn to_i32(self) -> i32;
    /// The value, which lies within the type's range.
    fn from_i32(v: i32) -> Self;
}

impl Sample for u8 {
    fn to_i32(self) -> i32 {
        i32::from(self)
    }

    fn from_i32(v: i32) -> Self {
        v as Self
    }
}

impl Sample for u16 {
    fn to_i32(self) -> i32 {
        i32::from(self)
    }

    fn from_i32(v: i32) -> Self {
        v as Self
    }
}

/// A plane to sample from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source<'a, S> {
    pub(super) plane: PlaneRef<'a, S>,
    pub(super) border: Border,
    /// Value outside the plane for [`Border::Black`].
    pub(super) black: S,
    /// Subtracted before weighting: 2¹⁵ for 16-bit samples, which then fit an `i16`; 0 otherwise.
    pub(super) bias: i32,
    /// Largest value.
    pub(super) max: i32,
}

impl<'a, S: Sample> Source<'a, S> {
    pub(super) fn new(plane: PlaneRef<'a, S>, border: Border, black: i32, bits: u8) -> Self {
        let bias = if bits == 16 { 1 << 15 } else { 0 };
        Self { plane, border, black: S::from_i32(black), bias, max: (1 << bits) - 1 }
    }

    /// The value at any index.
    pub(super) fn at(&self, x: i32, y: i32) -> S {
        let (x, y) = (self.border.resolve(x, self.plane.width()), self.border.resolve(y, self.plane.height()));
        match (x, y) {
            (Some(x), Some(y)) => self.plane.row(y)[x],
            _ => self.black,
        }
    }

    /// The interpolated value at a position in units of 1/256 px.
    ///
    /// Rows first, exactly in `i32`; then down the column in `f32`, in the order of the rows, rounded once to even.
    pub(super) fn sample<const N: usize>(&self, [wx, wy]: [&[i16; N]; 2], x: i32, y: i32) -> S {
        let before = taps(N) as i32 / 2 - 1;
        let (x0, y0) = ((x >> PHASE_BITS) - before, (y >> PHASE_BITS) - before);
        let mut sum = 0.0_f32;
        for (r, &w) in wy[..taps(N)].iter().enumerate() {
            sum += self.weighted(&wx[..taps(N)], x0, y0 + r as i32) as f32 * f32::from(w);
        }
        let value = (sum * UNIT).round_ties_even() as i32 + self.bias;
        S::from_i32(value.clamp(0, self.max))
    }

    /// Weighted sum along one row.
    fn weighted(&self, weights: &[i16], x0: i32, y: i32) -> i32 {
        let inside = x0 >= 0 && y >= 0 && x0 as usize + weights.len() <= self.plane.width();
        let product = |(&w, s): (&i16, S)| i32::from(w) * (s.to_i32() - self.bias);
        if inside && (y as usize) < self.plane.height() {
            let row = &self.plane.row(y as usize)[x0 as usize..][..weights.len()];
            weights.iter().zip(row.iter().copied()).map(product).sum()
        } else {
            let row = (0..).map(|k| self.at(x0 + k, y));
            weights.iter().zip(row).map(product).sum()
        }
    }

    /// Samples along a row of positions.
    pub(super) fn sample_row<const N: usize>(&self, taps: &impl Taps<N>, (xs, ys): (&[i32], &[i32]), out: &mut [S]) {
        for (i, ((&x, &y), sample)) in xs.iter().zip(ys).zip(out).enumerate() {
            *sample = self.sample([taps.across(i, x), taps.down(i, y)], x, y);
        }
    }

    /// Copies rows of `W` samples from index `(x0, y0)` on, the border resolved.
    pub(super) fn copy_patch<const W: usize>(&self, x0: i32, y0: i32, patch: &mut [[S; W]]) {
        let within = x0 >= 0 && x0 as usize + W <= self.plane.width();
        let column = |k: usize| self.border.resolve(x0 + k as i32, self.plane.width());
        let columns: [Option<usize>; W] = if within { [None; W] } else { std::array::from_fn(column) };
        for (y, row) in (y0..).zip(patch) {
            match self.border.resolve(y, self.plane.height()).map(|y| self.plane.row(y)) {
                Some(source) if within => row.copy_from_slice(&source[x0 as usize..][..W]),
                Some(source) => *row = columns.map(|column| column.map_or(self.black, |x| source[x])),
                None => *row = [self.black; W],
            }
        }
    }
}
