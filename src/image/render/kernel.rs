//! Interpolation kernels as fixed-point tables.
//!
//! A kernel `k` of support `n` reconstructs `f(i + t) = Σⱼ k(j − t) f(i + j)`, `j = 1 − n/2 … n/2`, `t ∈ [0, 1)`, and
//! separably in two dimensions. Tables hold the weights at [`PHASES`] values of `t`, scaled by 2¹⁴ and rounded so that
//! every row sums to exactly 2¹⁴: constant images stay constant, and at `t = 0` the row is `(0, …, 2¹⁴, …, 0)`, so
//! that a shift by whole pixels copies bits.
//!
//! | kernel | taps | gradient energy | |
//! | --- | --- | --- | --- |
//! | bilinear | 2 | 0.75 | previews |
//! | [`four_tap`](super::four_tap) | 4 | 1.02 | least error over a band, exact for ramps; the default |
//! | Lanczos, 3 lobes | 6 | 1.00 | Duchon 1979; at about 1.6 times the cost of four taps |
//!
//! Gradient energy is that of the result relative to Lanczos-3 in floating point, the mean over frames of real video
//! warped by small similarities (the sharpness that is left). Cubic convolution (Keys 1981), the usual four taps, loses 9 %
//! of it with `a = −½` and no longer reproduces ramps with the sharper `a = −¾`; 4 lobes gain nothing over 3.
//!
//! # References
//! R. Keys, *Cubic convolution interpolation for digital image processing*, IEEE TASSP 29 (1981), eq. 4.
//! C. Duchon, *Lanczos filtering in one and two dimensions*, J. Applied Meteorology 18 (1979).

use std::f64::consts::PI;

use super::four_tap;

/// Sub-pixel positions per pixel. 256 place a sample within 1/512 px; a tenth of the lattice's own tolerance.
pub(super) const PHASES: usize = 256;
/// `log₂ PHASES`: positions are integers in units of 1/256 px.
pub(super) const PHASE_BITS: u32 = 8;
/// `log₂` of the sum of a row of weights. 14 keeps every weight in an `i16` and 8 to 16-bit sums in an `i32`.
const WEIGHT_BITS: u32 = 14;
/// Turns a sum over rows and columns of doubly weighted samples into a sample value.
pub(super) const UNIT: f32 = 1.0 / (1_u32 << (2 * WEIGHT_BITS)) as f32;

/// How pixels between pixels are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// Two taps; soft, for previews.
    Bilinear,
    /// Four taps, optimal over the band that video fills: as sharp as Lanczos, straight ramps stay straight.
    #[default]
    Bicubic,
    /// Six taps, windowed sinc.
    Lanczos3,
}

impl Interpolation {
    /// Weights of the samples around `t ∈ [0, 1)`, the sample 0 at index `n/2 − 1` of the `n` that `N` holds.
    fn weights<const N: usize>(self, t: f64) -> [f64; N] {
        let before = taps(N) / 2 - 1;
        let inner = four_tap::weights(t);
        std::array::from_fn(|k| {
            let x = k as f64 - before as f64 - t;
            match self {
                Self::Bilinear => (1.0 - x.abs()).max(0.0),
                Self::Bicubic => (k + 1).checked_sub(before).and_then(|j| inner.get(j)).copied().unwrap_or(0.0),
                Self::Lanczos3 => sinc(x) * if x.abs() < 3.0 { sinc(x / 3.0) } else { 0.0 },
            }
        })
    }
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

/// Weights of one phase; `N` = 4 holds 4 taps, `N` = 8 holds 6 taps and two zeros.
pub(super) type Table<const N: usize> = [[i16; N]; PHASES];

/// Taps that are not padding.
pub(super) const fn taps(n: usize) -> usize {
    if n == 8 { 6 } else { n }
}

/// The table of a kernel; `N` must hold its support.
#[allow(clippy::unnecessary_box_returns)] // 2 or 4 KB that would be moved through the stack
pub(super) fn table<const N: usize>(kernel: Interpolation) -> Box<Table<N>> {
    let mut table = Box::new([[0; N]; PHASES]);
    for (phase, row) in table.iter_mut().enumerate() {
        *row = quantized(kernel, phase as f64 / PHASES as f64);
    }
    table
}

fn quantized<const N: usize>(kernel: Interpolation, t: f64) -> [i16; N] {
    let mut exact = kernel.weights::<N>(t);
    exact[taps(N)..].fill(0.0);
    fixed_point(exact, t)
}

/// Weights in fixed point that sum to one exactly, as `exact` are up to a factor.
fn fixed_point<const N: usize>(exact: [f64; N], t: f64) -> [i16; N] {
    let (n, one) = (taps(N), f64::from(1 << WEIGHT_BITS));
    let sum: f64 = exact.iter().sum();
    let mut row = exact.map(|w| (w / sum * one).round() as i16);
    // The rest of the rounding goes to the largest weight, where it is relatively smallest.
    let rest = (1 << WEIGHT_BITS) - row.iter().map(|&w| i32::from(w)).sum::<i32>();
    row[if t < 0.5 { n / 2 - 1 } else { n / 2 }] += rest as i16;
    row
}

/// Distances of two samples that a [`PairTable`] has weights for, the first of them 0.
pub(super) const PAIR_LEVELS: usize = 32;
/// Half the distance of the samples from one level to the next, phases.
const PAIR_STEP: usize = 6;
/// Largest distance of two samples, px, whose mean is within six taps.
pub(super) const MAX_PAIR_PX: f32 = 2.0 * (PAIR_STEP * (PAIR_LEVELS - 1)) as f32 / PHASES as f32;

/// Weights of the mean of two samples of a four-tap kernel, `e` before and `e` behind a position: the six taps around it,
/// for each level of `e` those of all phases.
pub(super) type PairTable = [[i16; 8]; PAIR_LEVELS * PHASES];

/// The level of a distance of two samples, px, as the index of its first row in a [`PairTable`].
pub(super) fn pair_rows(distance: f32) -> usize {
    let half = 0.5 * distance * PHASES as f32;
    ((half / PAIR_STEP as f32 + 0.5) as usize).min(PAIR_LEVELS - 1) * PHASES
}

/// The table of pairs of a kernel of four taps or fewer; for Lanczos, whose pairs have eight, that of the sharpest four.
pub(super) fn pair_table(kernel: Interpolation) -> Box<PairTable> {
    let kernel = if kernel == Interpolation::Lanczos3 { Interpolation::Bicubic } else { kernel };
    let single: Vec<[f64; 4]> = (0..PHASES).map(|phase| kernel.weights(phase as f64 / PHASES as f64)).collect();
    let row = |k: usize| {
        let (phase, half) = (k % PHASES, k / PHASES * PAIR_STEP);
        let mut six = [0.0; 8];
        // Positions from the sample before the present one on, so that they are positive.
        for at in [PHASES + phase - half, PHASES + phase + half] {
            let first = at / PHASES;
            six[first..first + 4].iter_mut().zip(single[at % PHASES]).for_each(|(sum, w)| *sum += w);
        }
        fixed_point(six, phase as f64 / PHASES as f64)
    };
    let rows: Vec<[i16; 8]> = (0..PAIR_LEVELS * PHASES).map(row).collect();
    rows.into_boxed_slice().try_into().expect("as many rows as the table has")
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Interpolation; 3] = [Interpolation::Bilinear, Interpolation::Bicubic, Interpolation::Lanczos3];

    #[test]
    fn weights_sum_to_one_and_phase_zero_is_the_sample_itself() {
        for kernel in ALL {
            let table = table::<8>(kernel);
            assert!(table.iter().all(|row| row.iter().map(|&w| i32::from(w)).sum::<i32>() == 16384));
            assert_eq!(table[0], [0, 0, 16384, 0, 0, 0, 0, 0]);
        }
    }

    #[test]
    fn tables_are_symmetric_in_the_phase() {
        for kernel in ALL {
            let table = table::<8>(kernel);
            for phase in 1..PHASES {
                let mirrored: Vec<i16> = table[PHASES - phase][..6].iter().rev().copied().collect();
                let off = table[phase].iter().zip(mirrored).map(|(a, b)| (a - b).abs()).max();
                assert!(off <= Some(1), "{kernel:?} at phase {phase}");
            }
        }
    }

    #[test]
    fn a_pair_is_the_mean_of_two_samples() {
        let samples = [3.0, 200.0, 17.0, 90.0, 255.0, 0.0, 31.0, 8.0];
        let table = pair_table(Interpolation::Bicubic);
        for (level, phase) in [(0, 0), (0, 77), (1, 3), (13, 128), (31, 0), (31, 255), (31, 70)] {
            // A position between the third sample and the fourth.
            let (t, half) = (phase as f64 / PHASES as f64, (level * PAIR_STEP) as f64 / PHASES as f64);
            let one = |at: f64| {
                let (first, w) = (at.floor() as usize - 1, Interpolation::Bicubic.weights::<4>(at.fract()));
                samples[first..].iter().zip(w).map(|(s, w)| s * w).sum::<f64>()
            };
            let expected = 0.5 * (one(2.0 + t - half) + one(2.0 + t + half));
            let six = table[level * PHASES + phase];
            let found = samples.iter().zip(six).map(|(s, w)| s * f64::from(w)).sum::<f64>() / 16384.0;
            assert!((found - expected).abs() < 0.05, "level {level}, phase {phase}: {found} for {expected}");
        }
        assert!(table.iter().all(|row| row.iter().map(|&w| i32::from(w)).sum::<i32>() == 16384));
        assert_eq!((pair_rows(0.0), pair_rows(MAX_PAIR_PX), pair_rows(9.0)), (0, 31 * PHASES, 31 * PHASES));
    }
}
