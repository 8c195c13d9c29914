//! Coarse global motion: the initial guess of the tracker.
//!
//! At a level of at most [`MAX_SIDE_PX`] px the shift `s` that minimizes
//!
//! ```text
//! mean over the overlap of |J(x + s) − I(x)|,      |s| ≤ a quarter of the side
//! ```
//!
//! is found by exhaustive search. Quick pans move the picture by a tenth of its width per frame and more, which is beyond the
//! convergence basin of gradient methods; half a pixel of a level 80 px wide is accurate enough as an initial guess.

use plumbline_image::simd::multiversion;
use plumbline_image::{PaddedPlane, Pyramid};

/// Longest side of the level that is searched, px. The cost grows with the fourth power; smaller levels are too coarse as the
/// initial guess of the next finer one.
const MAX_SIDE_PX: usize = 96;

/// Greatest mean difference of a shift relative to that of no motion, so that noise or one large moving object in a still
/// picture does not give every point a wrong initial guess.
const MAX_RATIO: f32 = 0.85;

/// Displacement of the picture from `prev` to `next`, px of level 0; zero where no shift is clearly better.
pub(super) fn shift(prev: &Pyramid, next: &Pyramid) -> [f32; 2] {
    let fits = |level: &PaddedPlane| level.width().max(level.height()) <= MAX_SIDE_PX;
    let Some(l) = prev.levels().iter().position(fits) else { return [0.0; 2] };
    let (a, b) = (&prev.levels()[l], &next.levels()[l]);
    let (reach_x, reach_y) = (a.width() as isize / 4, a.height() as isize / 4);
    let still = difference(a, b, 0, 0);
    let mut best = (MAX_RATIO * still, [0, 0]);
    for dy in -reach_y..=reach_y {
        for dx in -reach_x..=reach_x {
            let d = difference(a, b, dx, dy);
            if d < best.0 {
                best = (d, [dx, dy]);
            }
        }
    }
    best.1.map(|s| (s << l) as f32)
}

/// Mean absolute difference over the overlap of `a` and `b` moved back by `(dx, dy)`.
fn difference(a: &PaddedPlane, b: &PaddedPlane, dx: isize, dy: isize) -> f32 {
    let (w, h) = (a.width().min(b.width()) as isize, a.height().min(b.height()) as isize);
    let (x0, x1) = ((-dx).max(0), (w - dx).min(w));
    let (y0, y1) = ((-dy).max(0), (h - dy).min(h));
    let n = (x1 - x0) as usize;
    let rows = (y0..y1).map(|y| row_difference(&a.from(x0, y)[..n], &b.from(x0 + dx, y + dy)[..n]));
    rows.sum::<u32>() as f32 / ((y1 - y0) as f32 * n as f32).max(1.0)
}

multiversion! {
    fn row_difference(a: &[u8], b: &[u8]) -> u32 {
        a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b))).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::Plane;

    fn scene(dx: isize, dy: isize, brighter: u8) -> Pyramid {
        let image = Plane::from_fn(640, 360, |x, y| {
            let (x, y) = (x as isize - dx + 500, y as isize - dy + 500);
            let v = (x / 37 * 7919 + y / 29 * 104_729) % 211;
            v as u8 + brighter
        });
        let mut pyramid = Pyramid::new();
        pyramid.rebuild(image.as_ref(), 4);
        pyramid
    }

    #[test]
    fn a_pan_of_a_fifth_of_the_width_is_found_to_half_a_coarse_pixel() {
        for (dx, dy) in [(128, 0), (-128, 40), (0, -64), (70, 33), (0, 0)] {
            let found = shift(&scene(0, 0, 0), &scene(dx, dy, 3));
            assert!(
                (found[0] - dx as f32).abs() <= 5.0 && (found[1] - dy as f32).abs() <= 5.0,
                "({dx}, {dy}): {found:?}"
            );
        }
    }

    #[test]
    fn pictures_without_relation_do_not_move() {
        let mut rng = fastrand::Rng::with_seed(4);
        let mut noise = || {
            let mut pyramid = Pyramid::new();
            pyramid.rebuild(Plane::from_fn(640, 360, |_, _| rng.u8(..)).as_ref(), 4);
            pyramid
        };
        assert_eq!(shift(&noise(), &noise()), [0.0, 0.0]);
    }
}
