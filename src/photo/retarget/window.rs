//! Where to crop before warping.
//!
//! A change of shape by the factor `ρ = min(s_x/s_y, s_y/s_x)` squeezes important objects once too little else is left:
//! below some 50 % no warp looks natural. Then the side squeezed more is cropped first, to the window that leaves this
//! factor to the warp, at the position that keeps most of the importance.

use plumbline_image::feature::Importance;
use plumbline_num::math::{Point2, Rect};

/// Exponent of importance in the profile: at 2 a face outweighs a hundred times its area of sky.
const POWER: i32 = 2;
/// Resolution of the profile, columns or rows: window positions 1/400 of the side apart.
const STRIPS: usize = 400;
/// Cost of cutting through an object relative to the value of showing as much again in full. At 0 the window may cut a
/// person in two to show half a chair more.
const CUT_COST: f64 = 0.05;

/// The part of the picture to keep, source px; the whole picture where `ρ ≥ least`.
pub(super) fn window(source: (f64, f64), out: (f64, f64), importance: &Importance, least: f64) -> Rect {
    let (sx, sy) = (out.0 / source.0, out.1 / source.1);
    let share = kept_share((sx, sy), least);
    if share >= 1.0 {
        return Rect::of_size(source.0, source.1);
    }
    let first = best_start(&strip_profile(importance, sx < sy, STRIPS), share);
    if sx < sy {
        Rect { min: Point2::new(first * source.0, 0.0), max: Point2::new((first + share) * source.0, source.1) }
    } else {
        Rect { min: Point2::new(0.0, first * source.1), max: Point2::new(source.0, (first + share) * source.1) }
    }
}

/// The fraction of the side squeezed more that a window keeps under the scales `(s_x, s_y)`; 1 where `ρ ≥ least`.
pub(crate) fn kept_share((sx, sy): (f64, f64), least: f64) -> f64 {
    if sx.min(sy) >= least * sx.max(sy) { 1.0 } else { sx.min(sy) / (least * sx.max(sy)) }
}

/// Importance of columns (or rows), summed, in so many strips.
pub(crate) fn strip_profile(importance: &Importance, columns: bool, strips: usize) -> Vec<f64> {
    const ACROSS: usize = 100;
    let whole = Rect::of_size(1.0, 1.0);
    let (cols, rows) = if columns { (strips, ACROSS) } else { (ACROSS, strips) };
    let mut sums = vec![0.0; strips];
    for (i, v) in importance.cell_means(&whole, cols, rows).into_iter().enumerate() {
        sums[if columns { i % cols } else { i / cols }] += v.powi(POWER);
    }
    sums
}

/// Start, in [0, 1 − share], of the window with the highest score; of equals the one nearest to the middle.
fn best_start(profile: &[f64], share: f64) -> f64 {
    let worth = worth_of_starts(profile, share);
    let first = (0..worth.len()).max_by(|a, b| worth[*a].total_cmp(&worth[*b])).unwrap_or(0);
    (first as f64 * worth_spread(worth.len(), share)).min(1.0 - share)
}

/// Scores of a window of the fraction `share` at each start from 0 to `1 − share`.
fn worth_of_starts(profile: &[f64], share: f64) -> Vec<f64> {
    let n = profile.len();
    let length = ((share * n as f64).round() as usize).clamp(1, n);
    let total: f64 = profile.iter().sum();
    let worth = |first: usize| -> f64 {
        let inside: f64 = profile[first..first + length].iter().sum();
        let cut = |strip: usize| profile[strip] * CUT_COST * length as f64;
        // Objects at the picture's own edges count alike: they were cut by the camera.
        let cuts = cut(first) + cut(first + length - 1);
        let off_center = (first as f64 - 0.5 * (n - length) as f64).abs() / n as f64;
        inside - cuts - 1e-3 * total * off_center
    };
    (0..=n - length).map(worth).collect()
}

/// Distance of neighboring starts of [`worth_of_starts`], given their number.
fn worth_spread(starts: usize, share: f64) -> f64 {
    if starts > 1 { (1.0 - share) / (starts - 1) as f64 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::Plane;

    fn spot(s: f64) -> Importance {
        let plane = Plane::from_fn(200, 100, |x, _| if (x as f64 / 200.0 - s).abs() < 0.05 { 1.0 } else { 0.1 });
        Importance::from_plane(plane).expect("in range")
    }

    #[test]
    fn mild_changes_of_shape_crop_nothing() {
        for out in [(400.0, 100.0), (160.0, 200.0), (1000.0, 200.0), (80.0, 40.0)] {
            let found = window((400.0, 200.0), out, &spot(0.2), 0.4);
            let ratio: f64 = out.0 / 400.0 / (out.1 / 200.0);
            if (0.4..=2.5).contains(&ratio) {
                assert_eq!(found, Rect::of_size(400.0, 200.0), "{out:?}");
            }
        }
    }

    #[test]
    fn the_window_leaves_the_minimum_ratio_and_keeps_important_objects() {
        for (s, out) in [(0.2, (100.0, 200.0)), (0.85, (60.0, 300.0))] {
            let found = window((400.0, 200.0), out, &spot(s), 0.4);
            let left = (out.0 / found.width()) / (out.1 / found.height());
            assert!((left - 0.4).abs() < 1e-9, "{left}");
            assert!(found.min.x >= 0.0 && found.max.x <= 400.0 + 1e-9 && found.height() == 200.0, "{found:?}");
            // Pixels of the importance are 2 px wide; those of the spot lie wholly inside it.
            assert!(
                found.min.x <= (s - 0.05) * 400.0 + 2.0 && found.max.x >= (s + 0.05) * 400.0 - 2.0,
                "{found:?} cuts {s}"
            );
        }
    }

    #[test]
    fn the_other_axis_is_cropped_alike() {
        let found = window((400.0, 200.0), (400.0, 50.0), &Importance::even(), 0.4);
        assert!((found.height() - 125.0).abs() < 1e-9 && found.width() == 400.0);
        assert!((found.min.y - 37.5).abs() <= 0.5, "an even picture is cropped in the middle: {found:?}");
    }
}
