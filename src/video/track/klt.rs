//! Pyramidal Lucas–Kanade tracking with a forward–backward check.
//!
//! For a point `p` of the picture `I` the displacement `d` that minimizes
//!
//! ```text
//! E(d) = Σ_{q ∈ W} (J(p + d + q) − I(p + q))²,      W = 21×21 px
//! ```
//!
//! is sought by Gauss–Newton with the gradient of the template, which does not move, so that the 2×2 matrix is
//! factored once per level:
//!
//! ```text
//! A = Σ ∇I ∇Iᵀ,   b = Σ ∇I (J(p + d + q) − I(p + q)),   d ← d − A⁻¹ b.
//! ```
//!
//! Levels run from the coarsest to the finest, each starting from twice the displacement of the one above. A match is
//! kept where tracking it *back*, through all levels and from the same prior displacement, not from the answer of the
//! forward run, returns to within a bound of `p` (Kalal et al.): a check that started at the answer would accept any
//! locally stable mismatch of repeated texture.
//!
//! Departures from Bouguet's note: the gradient is taken on the interpolated template instead of a gradient image;
//! samples of the template outside the picture carry no weight; and iteration stops where the steps, which shrink nearly
//! geometrically, predict that what remains is below the tolerance (ratio `r` of successive steps: the rest is
//! `|step|·r/(1−r)`), which saves the step that would only confirm it.
//!
//! # Reference
//! - B. Lucas and T. Kanade, *An Iterative Image Registration Technique with an Application to Stereo Vision*, IJCAI 1981.
//! - J.-Y. Bouguet, *Pyramidal Implementation of the Affine Lucas Kanade Feature Tracker*, Intel 2001.
//! - Z. Kalal, K. Mikolajczyk, J. Matas, *Forward-Backward Error*, ICPR 2010.

use rayon::prelude::*;

use super::window::{Kernel, Patch, RADIUS, SIDE, Template};
use plumbline_image::{PaddedPlane, Pyramid};

/// Most Gauss–Newton steps per level; this and the next two values are OpenCV's.
const ITERATIONS: usize = 30;
/// Convergence tolerance of the displacement, px of the level.
const EPSILON_PX: f32 = 0.01;
/// Least smaller eigenvalue of `A` per sample of the window, (gray/px)²; flatter windows cannot be tracked. OpenCV's threshold
/// 10⁻⁴ is in units of 1024 (gray/px)².
const MIN_EIGENVALUE: f32 = 0.1;
/// Forward–backward error from which a match is rejected, px.
const MAX_FORWARD_BACKWARD_PX: f32 = 0.5;

/// A tracked point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Position in the next picture, px, pixel centers at integer + 0.5.
    pub position: [f32; 2],
    /// Forward–backward error: distance between the point and the result of tracking back, px.
    pub forward_backward_px: f32,
}

/// Distance of a window's center outside a level up to which it is tracked, px: further out, less than a tenth of the window
/// is inside the picture, and vectors would read beyond the border of [`plumbline_image::PADDING`] px.
const MARGIN: f32 = 8.0;

/// Tracks `points` of `prev` into `next`, from the initial guesses `guesses` (positions in `next`, one per point).
///
/// Points are positions in px with pixel centers at integer + 0.5. `None` for points that left the picture, are in a
/// textureless area or failed the check. The result does not depend on the number of threads.
pub fn track(prev: &Pyramid, next: &Pyramid, points: &[[f32; 2]], guesses: &[[f32; 2]]) -> Vec<Option<Match>> {
    assert_eq!(points.len(), guesses.len(), "one guess per point");
    let pair = Pair { prev, next, kernel: Kernel::best() };
    let pairs = points.par_iter().zip(guesses).with_min_len(MIN_POINTS);
    pairs.map_init(Template::default, |template, (p, g)| pair.there_and_back(template, *p, *g)).collect()
}

/// Points per task: about 0.1 ms of work, far above the cost of handing it to another thread.
const MIN_POINTS: usize = 16;

/// Two pictures and how to match them.
struct Pair<'a> {
    prev: &'a Pyramid,
    next: &'a Pyramid,
    kernel: Kernel,
}

impl Pair<'_> {
    fn there_and_back(&self, template: &mut Template, p: [f32; 2], guess: [f32; 2]) -> Option<Match> {
        let prior = [guess[0] - p[0], guess[1] - p[1]];
        let q = self.follow(template, self.prev, self.next, p, prior)?;
        let back = self.follow(template, self.next, self.prev, q, [-prior[0], -prior[1]])?;
        let distance = (back[0] - p[0]).hypot(back[1] - p[1]);
        (distance < MAX_FORWARD_BACKWARD_PX).then_some(Match { position: q, forward_backward_px: distance })
    }

    /// The position in `to` of the point `p` of `from`; `d` is the initial guess of the displacement.
    fn follow(
        &self,
        template: &mut Template,
        from: &Pyramid,
        to: &Pyramid,
        p: [f32; 2],
        d: [f32; 2],
    ) -> Option<[f32; 2]> {
        let levels = from.levels().len().min(to.levels().len());
        let mut d = d.map(|d| d * 0.5_f32.powi(levels as i32 - 1));
        for l in (0..levels).rev() {
            let scale = 0.5_f32.powi(l as i32);
            let at = p.map(|p| (p - 0.5) * scale);
            match self.align(template, &from.levels()[l], &to.levels()[l], at, d) {
                Some(refined) => d = refined,
                None if l == 0 => return None,
                None => {}
            }
            if l > 0 {
                d = d.map(|d| 2.0 * d);
            }
        }
        let q = [p[0] + d[0], p[1] + d[1]];
        let image = &to.levels()[0];
        let inside = (0.0..=image.width() as f32).contains(&q[0]) && (0.0..=image.height() as f32).contains(&q[1]);
        inside.then_some(q)
    }

    /// Gauss–Newton on one level; `at` is the sample position of the template's center, `d` the displacement in its px.
    fn align(
        &self,
        template: &mut Template,
        from: &PaddedPlane,
        to: &PaddedPlane,
        at: [f32; 2],
        mut d: [f32; 2],
    ) -> Option<[f32; 2]> {
        self.cut_out(template, from, at)?;
        let inverse = inverse_normal((self.kernel.normal_matrix)(template), MIN_EIGENVALUE)?;
        let mut last = [0.0_f32; 2];
        for k in 0..ITERATIONS {
            let patch = patch_at(to, [at[0] + d[0], at[1] + d[1]], RADIUS)?;
            let b = (self.kernel.mismatch)(template, &patch).map(|b| b as f64);
            let step = inverse.map(|row| -(row[0] * b[0] + row[1] * b[1]) as f32);
            d = [d[0] + step[0], d[1] + step[1]];
            if k > 0 && oscillates(step, last, EPSILON_PX) {
                return Some([d[0] - 0.5 * step[0], d[1] - 0.5 * step[1]]);
            }
            if remaining(step, last, k) <= EPSILON_PX {
                break;
            }
            last = step;
        }
        Some(d)
    }

    /// Fills the template around `at`; samples outside the picture get no gradient, hence no weight.
    fn cut_out(&self, template: &mut Template, image: &PaddedPlane, at: [f32; 2]) -> Option<()> {
        (self.kernel.extract)(&patch_at(image, at, RADIUS + 1)?, template);
        let outside = |u: f32, n: usize| {
            let first = u.floor() as isize - RADIUS;
            let is_out = move |k: usize| !(0..n as isize).contains(&(first + k as isize));
            (is_out(0) || is_out(SIDE - 1)).then_some(is_out)
        };
        if let Some(is_out) = outside(at[0], image.width()) {
            for x in (0..SIDE).filter(|x| is_out(*x)) {
                template.gx.iter_mut().chain(&mut template.gy).for_each(|row| row[x] = 0);
            }
        }
        if let Some(is_out) = outside(at[1], image.height()) {
            for y in (0..SIDE).filter(|y| is_out(*y)) {
                template.gx[y].fill(0);
                template.gy[y].fill(0);
            }
        }
        Some(())
    }
}

/// The samples from `reach` px left of and above `at` on; `None` where `at` is too far outside, or not a number.
fn patch_at(image: &PaddedPlane, at: [f32; 2], reach: isize) -> Option<Patch<'_>> {
    let within = |u: f32, n: usize| u > -MARGIN && u < n as f32 - 1.0 + MARGIN;
    if !(within(at[0], image.width()) && within(at[1], image.height())) {
        return None;
    }
    let whole = at.map(f32::floor);
    let fraction = |k: usize| ((at[k] - whole[k]) * 32_768.0 + 0.5).min(32_767.0) as i16;
    let samples = image.from(whole[0] as isize - reach, whole[1] as isize - reach);
    Some(Patch { samples, stride: image.stride(), a: fraction(0), b: fraction(1) })
}

/// `A⁻¹`; `None` where the smaller eigenvalue per sample is below `min_eigenvalue`.
fn inverse_normal(sums: [i64; 3], min_eigenvalue: f32) -> Option<[[f64; 2]; 2]> {
    let [xx, xy, yy] = sums.map(|s| s as f64);
    let smaller = 0.5 * (xx + yy - (xx - yy).hypot(2.0 * xy));
    let samples = (SIDE * SIDE) as f64;
    if !(smaller >= f64::from(min_eigenvalue) * 1024.0 * samples && smaller > 0.0) {
        return None;
    }
    let det = xx * yy - xy * xy;
    Some([[yy / det, -xy / det], [-xy / det, xx / det]])
}

/// True where a step undoes the one before it.
fn oscillates(step: [f32; 2], last: [f32; 2], epsilon_px: f32) -> bool {
    (step[0] + last[0]).abs() < epsilon_px && (step[1] + last[1]).abs() < epsilon_px
}

/// Predicted distance to the minimum after step `k`, px, if the steps keep shrinking as the last two did.
fn remaining(step: [f32; 2], last: [f32; 2], k: usize) -> f32 {
    let (now, before) = (step[0].hypot(step[1]), last[0].hypot(last[1]));
    if k == 0 || now >= 0.5 * before {
        return now;
    }
    now * now / (before - now)
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::Plane;

    /// A smooth picture, moved by `(dx, dy)`.
    fn waves(width: usize, height: usize, dx: f64, dy: f64) -> Pyramid {
        let image = Plane::from_fn(width, height, |x, y| {
            let (x, y) = (x as f64 - dx, y as f64 - dy);
            let v = (0.21 * x + 0.05 * y).sin() + (0.17 * y - 0.08 * x).cos() + (0.031 * x).sin() * (0.043 * y).cos();
            (128.0 + 38.0 * v).round() as u8
        });
        let mut pyramid = Pyramid::new();
        pyramid.rebuild(image.as_ref(), 4);
        pyramid
    }

    fn grid(width: usize, height: usize, margin: usize) -> Vec<[f32; 2]> {
        let ys = (margin..height - margin).step_by(23);
        ys.flat_map(|y| (margin..width - margin).step_by(29).map(move |x| [x as f32 + 0.3, y as f32 + 0.9])).collect()
    }

    #[test]
    fn a_translation_is_found_to_a_fiftieth_of_a_pixel() {
        for (dx, dy) in [(0.0, 0.0), (0.37, -0.61), (6.2, 3.9), (-14.5, 9.25)] {
            let (a, b) = (waves(320, 240, 0.0, 0.0), waves(320, 240, dx, dy));
            let points = grid(320, 240, 40);
            for (p, m) in points.iter().zip(track(&a, &b, &points, &points)) {
                let q = m.expect("a textured point well inside").position;
                let miss = (f64::from(q[0] - p[0]) - dx).hypot(f64::from(q[1] - p[1]) - dy);
                assert!(miss < 0.02, "{p:?} moved by ({dx}, {dy}) found at {q:?}");
            }
        }
    }

    #[test]
    fn points_in_textureless_areas_or_outside_are_lost() {
        let flat = {
            let mut pyramid = Pyramid::new();
            pyramid.rebuild(Plane::from_fn(100, 80, |_, _| 90).as_ref(), 4);
            pyramid
        };
        let points = [[50.0, 40.0], [f32::NAN, 3.0], [-50.0, 10.0], [1e9, 1e9]];
        assert_eq!(track(&flat, &flat, &points, &points), vec![None; 4]);
    }

    #[test]
    fn the_kernels_agree_on_whole_tracks() {
        let (a, b) = (waves(200, 150, 0.0, 0.0), waves(200, 150, 3.3, -2.1));
        let run = |kernel| {
            let pair = Pair { prev: &a, next: &b, kernel };
            let mut template = Template::default();
            grid(200, 150, 5).into_iter().map(|p| pair.there_and_back(&mut template, p, p)).collect::<Vec<_>>()
        };
        assert_eq!(run(Kernel::best()), run(Kernel::SCALAR));
    }

    #[test]
    fn a_steady_contraction_ends_one_step_early() {
        assert!((remaining([0.02, 0.0], [0.1, 0.0], 1) - 0.005).abs() < 1e-6);
        assert_eq!(remaining([0.09, 0.0], [0.1, 0.0], 1), 0.09, "slow convergence is not trusted");
        assert_eq!(remaining([0.09, 0.0], [0.0, 0.0], 0), 0.09);
    }
}
