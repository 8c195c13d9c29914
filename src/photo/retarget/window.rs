//! Where to crop before warping.
//!
//! A change of shape by the factor `ρ = min(s_x/s_y, s_y/s_x)` squeezes everything that matters once there is too little left
//! that does not: below some 50 % no warp looks right. Then the side squeezed more is cropped first, to the window that
//! leaves just that factor to the warp, and the window is laid where it keeps most of the importance.

use super::RetargetError;
use crate::feature::Importance;
use crate::math::{Point2, Rect};
use crate::optim::qp::{Affine, QuadraticProgram};

/// Importance counts to this power: a face outweighs a hundred times its area of sky.
const POWER: i32 = 2;
/// Columns (or rows) that the importance is summed over.
const STRIPS: usize = 400;
/// What it costs to cut through something, relative to what it would be worth to show as much again in full. At 0 the window
/// may cut a person in two to show half a chair more.
const CUT: f64 = 0.05;

/// The part of the picture to keep, source px; the whole picture where `ρ ≥ least`.
pub(super) fn window(source: (f64, f64), out: (f64, f64), importance: &Importance, least: f64) -> Rect {
    let (share, columns) = share(source, out, least);
    if share == 1.0 {
        return Rect::of_size(source.0, source.1);
    }
    at(source, best_start(&profile(importance, columns), share), share, columns)
}

/// Share of the picture that is kept along the side squeezed more, and whether that is its width.
fn share(source: (f64, f64), out: (f64, f64), least: f64) -> (f64, bool) {
    let (sx, sy) = (out.0 / source.0, out.1 / source.1);
    let kept = sx.min(sy) / (least * sx.max(sy));
    (if kept < 1.0 { kept } else { 1.0 }, sx < sy)
}

/// The window that starts at `first`, in [0, 1 − share].
fn at(source: (f64, f64), first: f64, share: f64, columns: bool) -> Rect {
    if columns {
        Rect { min: Point2::new(first * source.0, 0.0), max: Point2::new((first + share) * source.0, source.1) }
    } else {
        Rect { min: Point2::new(0.0, first * source.1), max: Point2::new(source.0, (first + share) * source.1) }
    }
}

/// The windows of one shot, a frame each: near to where each frame by itself would have them, and moving smoothly.
///
/// ```text
/// min  Σ_t (x_t − b_t)² + μ Σ_t (x_{t+1} − 2 x_t + x_{t−1})²      s.t.  0 ≤ x_t ≤ 1 − share,      μ = frames⁴
/// ```
///
/// with `b_t` the best start: motion of periods below about `6 frames` is taken out.
///
/// # Errors
/// [`RetargetError::Start`] where the program is not solved.
pub(super) fn windows(
    source: (f64, f64),
    out: (f64, f64),
    importance: &[Importance],
    least: f64,
    frames: f64,
) -> Result<Vec<Rect>, RetargetError> {
    let (share, columns) = share(source, out, least);
    if share == 1.0 || importance.is_empty() {
        return Ok(vec![Rect::of_size(source.0, source.1); importance.len()]);
    }
    let mut qp = QuadraticProgram::new(importance.len());
    for (t, importance) in importance.iter().enumerate() {
        let best = best_start(&profile(importance, columns), share);
        qp.add_square(1.0, Affine::var(t) - Affine::constant(best));
        qp.require_at_most_zero(-1.0 * Affine::var(t));
        qp.require_at_most_zero(Affine::var(t) - Affine::constant(1.0 - share));
    }
    for t in 1..importance.len().saturating_sub(1) {
        qp.add_square(frames.powi(4), Affine::var(t + 1) - 2.0 * Affine::var(t) + Affine::var(t - 1));
    }
    let path = qp.solve()?;
    Ok(path.iter().map(|&first| at(source, first.clamp(0.0, 1.0 - share), share, columns)).collect())
}

/// Importance of columns (or rows), summed.
fn profile(importance: &Importance, columns: bool) -> Vec<f64> {
    const ACROSS: usize = 100;
    let whole = Rect::of_size(1.0, 1.0);
    let (cols, rows) = if columns { (STRIPS, ACROSS) } else { (ACROSS, STRIPS) };
    let mut sums = vec![0.0; STRIPS];
    for (i, v) in importance.cell_means(&whole, cols, rows).into_iter().enumerate() {
        sums[if columns { i % cols } else { i / cols }] += v.powi(POWER);
    }
    sums
}

/// Where, in [0, 1 − share], the window starts that is worth most; of equals the one nearest to the middle.
fn best_start(profile: &[f64], share: f64) -> f64 {
    let n = profile.len();
    let length = ((share * n as f64).round() as usize).clamp(1, n);
    let total: f64 = profile.iter().sum();
    let least = profile.iter().copied().fold(f64::INFINITY, f64::min);
    let worth = |first: usize| -> f64 {
        let inside: f64 = profile[first..first + length].iter().sum();
        let cut = |strip: usize| (profile[strip] - least) * CUT * length as f64;
        let left = if first == 0 { 0.0 } else { cut(first) };
        let right = if first + length == n { 0.0 } else { cut(first + length - 1) };
        let off_center = (first as f64 - 0.5 * (n - length) as f64).abs() / n as f64;
        inside - left - right - 1e-3 * total * off_center
    };
    let better = |a: &usize, b: &usize| worth(*a).total_cmp(&worth(*b));
    let first = (0..=n - length).max_by(better).unwrap_or(0);
    (first as f64 / n as f64).min(1.0 - share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Plane;

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
    fn the_window_leaves_the_least_factor_and_keeps_what_matters() {
        for (s, out) in [(0.2, (100.0, 200.0)), (0.85, (60.0, 300.0))] {
            let found = window((400.0, 200.0), out, &spot(s), 0.4);
            let left = (out.0 / found.width()) / (out.1 / found.height());
            assert!((left - 0.4).abs() < 1e-9, "{left}");
            assert!(found.min.x >= 0.0 && found.max.x <= 400.0 + 1e-9 && found.height() == 200.0, "{found:?}");
            assert!(found.min.x < (s - 0.045) * 400.0 && found.max.x > (s + 0.045) * 400.0, "{found:?} cuts {s}");
        }
    }

    #[test]
    fn the_windows_of_a_shot_follow_smoothly() {
        let mut rng = fastrand::Rng::with_seed(2);
        let place = |t: usize| 0.3 + 0.4 * t as f64 / 60.0;
        let clip: Vec<Importance> = (0..60).map(|t| spot(place(t) + 0.06 * (rng.f64() - 0.5))).collect();
        let found = windows((400.0, 200.0), (60.0, 200.0), &clip, 0.4, 8.0).expect("convex");
        for t in 1..59 {
            let jerk = found[t + 1].min.x - 2.0 * found[t].min.x + found[t - 1].min.x;
            assert!(jerk.abs() < 0.4, "frame {t}: {jerk} px");
            let (from, to) = (400.0 * place(t) - 10.0, 400.0 * place(t) + 10.0);
            assert!(found[t].min.x < from && found[t].max.x > to, "frame {t}: {:?}", found[t]);
        }
        assert!(found.iter().all(|r| (r.width() - 150.0).abs() < 1e-9 && r.min.x >= 0.0 && r.max.x <= 400.0 + 1e-9));
    }

    #[test]
    fn the_other_axis_is_cropped_alike() {
        let found = window((400.0, 200.0), (400.0, 50.0), &Importance::even(), 0.4);
        assert!((found.height() - 125.0).abs() < 1e-9 && found.width() == 400.0);
        assert!((found.min.y - 37.5).abs() <= 0.5, "an even picture is cropped in the middle: {found:?}");
    }
}
