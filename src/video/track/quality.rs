//! Statistics of a picture that detect black, blurred and repeated frames and shot cuts.

use std::collections::VecDeque;

use plumbline_image::simd::multiversion;
use plumbline_image::{PaddedPlane, Pyramid};

/// Bins of the histogram.
const BINS: usize = 32;

/// Least spread between the darkest and the brightest thousandth of a picture that shows something, gray levels at half
/// size, where noise of 3 gray levels spreads over about 7. Larger values call dim scenes black.
const MIN_SPREAD: usize = 8;

/// Fraction of the running median under which sharpness counts as blur. Exposure and content change it by a tenth or two; a
/// motion blur of 12 px takes half of it, one of 8 px four tenths.
const BLUR_FRACTION: f32 = 0.6;

/// Frames of the running median: about a second.
const MEDIAN_FRAMES: usize = 31;

/// Greatest mean difference of a repeated frame, gray levels: the noise that re-encoding adds to a still picture.
const REPEAT_MEAN: f32 = 0.25;

/// Greatest mean difference of any 32×32 block of a repeated frame, gray levels: above it something small moves.
const REPEAT_BLOCK: f32 = 1.0;

/// Least histogram distance across a shot cut, 0 to 1. Quick pans reach about 0.15.
const CUT_DISTANCE: f32 = 0.2;

/// Numbers of one picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PictureStats {
    /// See [`super::FrameQuality::sharpness`].
    pub sharpness: f32,
    /// Nothing to track.
    pub black: bool,
    /// Fractions of gray levels, summing to 1.
    histogram: [f32; BINS],
}

impl PictureStats {
    /// The numbers of a picture.
    pub(super) fn of(pyramid: &Pyramid) -> Self {
        let levels = pyramid.levels();
        let level = |l: usize| &levels[l.min(levels.len() - 1)];
        let counts = histogram(level(1));
        let total = counts.iter().sum::<u32>() as f32;
        let mut fractions = [0.0; BINS];
        for (v, count) in counts.iter().enumerate() {
            fractions[v * BINS / 256] += *count as f32 / total;
        }
        // Half size, since sensor noise would hide blur at full size; an eighth, which shake seldom reaches.
        let sharpness = least_ratio(tensor(level(1)), tensor(level(3)));
        Self { sharpness, black: spread(&counts) < MIN_SPREAD, histogram: fractions }
    }

    /// Whether the histograms differ as much as across a cut.
    pub(super) fn differs(&self, other: &Self) -> bool {
        let l1: f32 = self.histogram.iter().zip(&other.histogram).map(|(a, b)| (a - b).abs()).sum();
        0.5 * l1 > CUT_DISTANCE
    }
}

fn histogram(level: &PaddedPlane) -> [u32; 256] {
    let mut counts = [0; 256];
    for y in 0..level.height() {
        for v in level.row(y) {
            counts[usize::from(*v)] += 1;
        }
    }
    counts
}

/// Gray levels between the thousandth darkest and the thousandth brightest sample.
fn spread(counts: &[u32; 256]) -> usize {
    let skip = counts.iter().sum::<u32>() / 1000;
    let from_below = |seen: &mut u32, count: &u32| {
        *seen += count;
        Some(*seen)
    };
    let low = counts.iter().scan(0, from_below).position(|seen| seen > skip);
    let high = counts.iter().rev().scan(0, from_below).position(|seen| seen > skip);
    low.zip(high).map_or(0, |(low, high)| 255_usize.saturating_sub(low + high))
}

/// `min_u (uᵀ S u) / (uᵀ T u)`, the smaller root of `det(S − λT) = 0`: the contrast left at the fine scale in the direction
/// that lost most. Camera shake smears along one direction only and leaves the other sharp.
fn least_ratio([a, b, c]: [f64; 3], [d, e, f]: [f64; 3]) -> f32 {
    let (det_s, det_t) = (a * c - b * b, d * f - e * e);
    let mixed = 0.5 * (a * f + c * d) - b * e;
    let root = (mixed * mixed - det_s * det_t).max(0.0).sqrt();
    if mixed + root > 0.0 { (det_s / (mixed + root)) as f32 } else { 0.0 }
}

/// `[S_xx, S_xy, S_yy]` of the mean `S` of `∇I ∇Iᵀ` by forward differences, (gray/px)².
fn tensor(level: &PaddedPlane) -> [f64; 3] {
    let n = level.width();
    let mut sums = [0; 3];
    for y in 0..level.height() as isize {
        let row = row_tensor(&level.from(0, y)[..=n], &level.from(0, y + 1)[..n]);
        sums.iter_mut().zip(row).for_each(|(sum, row)| *sum += row);
    }
    sums.map(|s| s as f64 / (n * level.height()) as f64)
}

multiversion! {
    /// `[Σ dx², Σ dx dy, Σ dy²]` over a row; `row` has one sample more than `below`. Each term is at most 255², so that 8192 of
    /// them fit in an `i32`.
    fn row_tensor(row: &[u8], below: &[u8]) -> [i64; 3] {
        let mut total = [0; 3];
        for start in (0..below.len()).step_by(8192) {
            let end = (start + 8192).min(below.len());
            let (mut xx, mut xy, mut yy) = (0_i32, 0_i32, 0_i32);
            for ((v, right), down) in row[start..end].iter().zip(&row[start + 1..=end]).zip(&below[start..end]) {
                let (dx, dy) = (i32::from(*right) - i32::from(*v), i32::from(*down) - i32::from(*v));
                (xx, xy, yy) = (xx + dx * dx, xy + dx * dy, yy + dy * dy);
            }
            total = [total[0] + i64::from(xx), total[1] + i64::from(xy), total[2] + i64::from(yy)];
        }
        total
    }
}

/// Whether `b` repeats `a`, up to the noise of an encoder.
pub(super) fn repeats(a: &PaddedPlane, b: &PaddedPlane) -> bool {
    const SIDE: usize = 32;
    let (w, h) = (a.width(), a.height());
    if (w, h) != (b.width(), b.height()) {
        return false;
    }
    let mut total = 0;
    let mut blocks = vec![0; w.div_ceil(SIDE)];
    for y0 in (0..h).step_by(SIDE) {
        let rows = SIDE.min(h - y0);
        blocks.fill(0);
        for y in y0..y0 + rows {
            block_differences(a.row(y), b.row(y), &mut blocks);
        }
        let full = (SIDE * rows) as f32;
        if blocks.iter().any(|sum| *sum as f32 > REPEAT_BLOCK * full) {
            return false;
        }
        total += blocks.iter().sum::<u32>();
    }
    total as f32 <= REPEAT_MEAN * (w * h) as f32
}

multiversion! {
    /// Adds the absolute differences of each 32 samples of two rows.
    fn block_differences(a: &[u8], b: &[u8], blocks: &mut [u32]) {
        for ((a, b), sum) in a.chunks(32).zip(b.chunks(32)).zip(blocks) {
            *sum += a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b))).sum::<u32>();
        }
    }
}

/// Running median of the sharpness.
#[derive(Clone, Debug, Default)]
pub(super) struct SharpnessMedian {
    recent: VecDeque<f32>,
}

impl SharpnessMedian {
    /// Takes the sharpness of a frame; true where it is far below the running median.
    pub(super) fn push(&mut self, sharpness: f32) -> bool {
        let mut sorted: Vec<f32> = self.recent.iter().copied().collect();
        sorted.sort_unstable_by(f32::total_cmp);
        let blurred = sorted.get(sorted.len() / 2).is_some_and(|median| sharpness < BLUR_FRACTION * median);
        if self.recent.len() == MEDIAN_FRAMES {
            self.recent.pop_front();
        }
        self.recent.push_back(sharpness);
        blurred
    }

    /// Clears the history at a cut.
    pub(super) fn clear(&mut self) {
        self.recent.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::Plane;

    fn built(f: impl FnMut(usize, usize) -> u8) -> Pyramid {
        let mut pyramid = Pyramid::new();
        pyramid.rebuild(Plane::from_fn(320, 180, f).as_ref(), 4);
        pyramid
    }

    fn blocks(x: usize, y: usize) -> u8 {
        [30, 200, 90, 140, 60][(7 * (x / 9) + 3 * (y / 7) + (x / 9) * (y / 7)) % 5]
    }

    #[test]
    fn noise_on_black_is_black_and_a_dim_scene_is_not() {
        let mut rng = fastrand::Rng::with_seed(1);
        assert!(PictureStats::of(&built(|_, _| 16 + rng.u8(..6))).black);
        assert!(PictureStats::of(&built(|_, _| 240)).black, "one flat tone");
        assert!(!PictureStats::of(&built(|x, y| 16 + blocks(x, y) / 10)).black);
    }

    #[test]
    fn blur_lowers_sharpness_whatever_the_contrast() {
        let sharp = PictureStats::of(&built(blocks)).sharpness;
        let faint = PictureStats::of(&built(|x, y| 100 + blocks(x, y) / 4)).sharpness;
        assert!((faint / sharp - 1.0).abs() < 0.1, "{faint} against {sharp}");
        for (dx, dy) in [(1, 0), (0, 1), (1, 1)] {
            let mean =
                |x: usize, y: usize| (0..12).map(|k| u32::from(blocks(x + dx * k, y + dy * k))).sum::<u32>() / 12;
            let smeared = PictureStats::of(&built(|x, y| mean(x, y) as u8)).sharpness;
            assert!(smeared < BLUR_FRACTION * sharp, "along ({dx}, {dy}): {smeared} against {sharp}");
        }
    }

    #[test]
    fn only_a_drop_below_the_running_median_is_blur() {
        let mut median = SharpnessMedian::default();
        assert!(!median.push(0.1), "a clip that is soft throughout is not blurred");
        assert!((0..40).all(|i| !median.push(0.4 + 0.01 * (i % 5) as f32)));
        assert!(median.push(0.15));
        assert!(!median.push(0.35));
    }

    #[test]
    fn a_repeated_frame_may_carry_coding_noise_but_nothing_that_moves() {
        let a = built(blocks);
        let noisy = built(|x, y| blocks(x, y) + u8::from((x * 7 + y * 13) % 5 == 0));
        let moved = built(|x, y| if x / 20 == 5 && y / 20 == 5 { 255 - blocks(x, y) } else { blocks(x, y) });
        let [a, noisy, moved] = [&a, &noisy, &moved].map(|p| &p.levels()[0]);
        assert!(repeats(a, a) && repeats(a, noisy) && !repeats(a, moved));
    }

    #[test]
    fn a_shifted_picture_has_the_histogram_of_the_first() {
        let stats = PictureStats::of(&built(blocks));
        assert!(!stats.differs(&PictureStats::of(&built(|x, y| blocks(x + 40, y + 11)))));
        assert!(stats.differs(&PictureStats::of(&built(|x, y| blocks(x, y) / 2))));
    }
}
