//! Appearance check: drift of a track against its first frame.
//!
//! Small errors of each step accumulate until a track has drifted off its corner, though every forward–backward check passed.
//! The first patch `P` is compared with the current one `Q` by normalized cross-correlation, which is invariant to brightness
//! and contrast:
//!
//! ```text
//! ncc = Σ (P − P̄)(Q − Q̄) / √(Σ (P − P̄)² Σ (Q − Q̄)²),      11×11 px.
//! ```

use plumbline_image::PaddedPlane;

/// Side of the patch, px: large enough to be distinct, small enough that a rotation by 20° keeps the correlation above 0.7.
const SIDE: usize = 11;

/// Least correlation. Slipped tracks fall to 0.4 and below; perspective and light on long ones stay above 0.7.
const MIN_CORRELATION: f32 = 0.55;

/// A patch, gray levels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Appearance {
    samples: [f32; SIDE * SIDE],
}

impl Appearance {
    /// The patch around a position.
    pub(super) fn at(level: &PaddedPlane, position: [f32; 2]) -> Self {
        let reach = (SIDE / 2) as f32;
        let clamp = |v: f32, n: usize| (v - 0.5).clamp(0.0, n as f32 - 1.0) - reach;
        let (left, top) = (clamp(position[0], level.width()), clamp(position[1], level.height()));
        let (a, b) = (left - left.floor(), top - top.floor());
        let mut samples = [0.0; SIDE * SIDE];
        for (y, row) in samples.chunks_exact_mut(SIDE).enumerate() {
            let row_at = |k: isize| &level.from(left.floor() as isize, top.floor() as isize + y as isize + k)[..=SIDE];
            let (upper, lower) = (row_at(0), row_at(1));
            for (x, sample) in row.iter_mut().enumerate() {
                let blend = |r: &[u8]| f32::from(r[x]) * (1.0 - a) + f32::from(r[x + 1]) * a;
                *sample = blend(upper) * (1.0 - b) + blend(lower) * b;
            }
        }
        Self { samples }
    }

    /// Whether `now` correlates with this patch.
    pub(super) fn agrees(&self, now: &Self) -> bool {
        self.correlation(now) >= MIN_CORRELATION
    }

    fn correlation(&self, other: &Self) -> f32 {
        let n = (SIDE * SIDE) as f32;
        let mean = |s: &[f32]| s.iter().sum::<f32>() / n;
        let (p0, q0) = (mean(&self.samples), mean(&other.samples));
        let (mut pq, mut pp, mut qq) = (0.0, 0.0, 0.0);
        for (p, q) in self.samples.iter().zip(&other.samples) {
            let (p, q) = (p - p0, q - q0);
            (pq, pp, qq) = (pq + p * q, pp + p * p, qq + q * q);
        }
        if pp > 0.0 && qq > 0.0 { pq / (pp * qq).sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::{Plane, Pyramid};

    fn level(f: impl FnMut(usize, usize) -> u8) -> PaddedPlane {
        let mut pyramid = Pyramid::new();
        pyramid.rebuild(Plane::from_fn(64, 64, f).as_ref(), 1);
        pyramid.levels()[0].clone()
    }

    fn texture(x: f32, y: f32) -> f32 {
        100.0 + 40.0 * (0.9 * x + 0.2 * y).sin() + 30.0 * (0.7 * y - 0.3 * x).cos()
    }

    #[test]
    fn brightness_and_a_small_rotation_keep_the_appearance_but_drift_does_not() {
        let first = Appearance::at(&level(|x, y| texture(x as f32, y as f32) as u8), [30.5, 30.5]);
        let darker = level(|x, y| (0.6 * texture(x as f32, y as f32)) as u8);
        assert!(first.agrees(&Appearance::at(&darker, [30.5, 30.5])));
        let (sin, cos) = 0.2_f32.sin_cos();
        let turned = level(|x, y| {
            let (x, y) = (x as f32 - 30.0, y as f32 - 30.0);
            texture(30.0 + cos * x - sin * y, 30.0 + sin * x + cos * y) as u8
        });
        assert!(first.agrees(&Appearance::at(&turned, [30.5, 30.5])));
        assert!(!first.agrees(&Appearance::at(&darker, [33.5, 31.5])));
    }

    #[test]
    fn patches_at_the_edge_of_the_picture_are_clamped() {
        let picture = level(|x, y| texture(x as f32, y as f32) as u8);
        for p in [[0.0, 0.0], [64.0, 64.0], [64.0, 1.0]] {
            assert!(Appearance::at(&picture, p).agrees(&Appearance::at(&picture, p)));
        }
    }
}
