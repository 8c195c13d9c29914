//! A clip's importance, made coherent in time.
//!
//! Importance judged frame by frame flickers, and a grid solved from it swims. Each frame's importance is therefore averaged
//! with that of the frames around it, carried along by the motion of the picture between them, which is given:
//!
//! ```text
//! Ī_t(p) = Σ_k g(k) I_{t+k}(M_{t+k ← t}(p)) / Σ_k g(k),      g(k) = exp(−|k|/τ),
//! ```
//!
//! as two recursions, one forward and one backward in time, each with one lookup per frame: from `F_t = I_t + ρ (F_{t−1}
//! carried along)` and its mirror image `B_t`, `Ī_t ∝ F_t + B_t − I_t`, with `ρ = exp(−1/τ)` and the sums of weights carried
//! likewise. A place that comes into the picture has only the frames that show it. What moves by itself (a walker before a
//! still wall) is averaged over the way it takes within `τ`: the grid makes room for all of it and stands still.
//!
//! # Reference
//! Y.-S. Wang, H. Fu, O. Sorkine, T.-Y. Lee, H.-P. Seidel, *Motion-aware temporal coherence for video resizing*, ACM Trans.
//! Graph. (SIGGRAPH Asia) 28 (2009): constraints between frames follow the motion of the camera and of objects.

use crate::feature::{Importance, ImportanceError};
use crate::image::Plane;
use crate::math::{Homography, Point2};

/// Sums of weighted values and of the weights.
struct Sums {
    values: Vec<f32>,
    weights: Vec<f32>,
}

/// Importance of each frame averaged over about `frames` ≥ 0 frames to either side (`τ`).
///
/// All planes have one size. `next_from_this[t]` maps frame `t` to frame `t + 1`, both `size` px; `None` at a cut, across which
/// nothing is carried. Missing entries count as cuts.
///
/// # Errors
/// [`ImportanceError::Option`] for a negative `frames`; [`ImportanceError::MaskSize`] for planes of different size.
pub fn coherent_importance(
    importance: &[Importance],
    next_from_this: &[Option<Homography>],
    size: (f64, f64),
    frames: f64,
) -> Result<Vec<Importance>, ImportanceError> {
    if !(frames >= 0.0 && frames.is_finite()) {
        return Err(ImportanceError::Option { name: "frames", value: frames, range: "0 or more" });
    }
    check_sizes(importance)?;
    let keep = if frames > 0.0 { (-1.0 / frames).exp() as f32 } else { 0.0 };
    let n = importance.len();
    let link = |t: usize| next_from_this.get(t).and_then(Option::as_ref);
    let mut forward: Vec<Sums> = Vec::with_capacity(n);
    for (t, this) in importance.iter().enumerate() {
        let this_from_last = t.checked_sub(1).and_then(link);
        let last_from_this = this_from_last.and_then(Homography::inverse);
        let carried = last_from_this.zip(forward.last());
        forward.push(accumulated(this, carried.as_ref().map(|(h, last)| (h, *last)), size, keep));
    }
    let mut averaged: Vec<Importance> = Vec::with_capacity(n);
    let mut backward: Option<Sums> = None;
    for t in (0..n).rev() {
        let carried = link(t).zip(backward.as_ref());
        let sums = accumulated(&importance[t], carried, size, keep);
        averaged.push(joined(&importance[t], &forward[t], &sums)?);
        backward = Some(sums);
    }
    averaged.reverse();
    Ok(averaged)
}

fn check_sizes(importance: &[Importance]) -> Result<(), ImportanceError> {
    let size = |i: &Importance| (i.plane().width(), i.plane().height());
    let Some(first) = importance.first().map(size) else { return Ok(()) };
    match importance.iter().map(size).find(|other| *other != first) {
        None => Ok(()),
        Some((mask_width, mask_height)) => {
            Err(ImportanceError::MaskSize { mask_width, mask_height, width: first.0, height: first.1 })
        }
    }
}

/// `I + ρ (sums of the neighbor, carried along)`; the homography maps this frame to the neighbor.
fn accumulated(importance: &Importance, carried: Option<(&Homography, &Sums)>, size: (f64, f64), keep: f32) -> Sums {
    let plane = importance.plane();
    let (w, h) = (plane.width(), plane.height());
    let mut sums = Sums { values: packed(plane), weights: vec![1.0; w * h] };
    let Some((neighbor_from_this, neighbor)) = carried else { return sums };
    let (px, py) = (size.0 / w as f64, size.1 / h as f64);
    for i in 0..w * h {
        let center = Point2::new(((i % w) as f64 + 0.5) * px, ((i / w) as f64 + 0.5) * py);
        let Some(there) = neighbor_from_this.apply(center) else { continue };
        let (x, y) = (there.x / px, there.y / py);
        if x >= 0.0 && y >= 0.0 && x < w as f64 && y < h as f64 {
            sums.values[i] += keep * bilinear(&neighbor.values, (w, h), x, y);
            sums.weights[i] += keep * bilinear(&neighbor.weights, (w, h), x, y);
        }
    }
    sums
}

fn packed(plane: &Plane<f32>) -> Vec<f32> {
    (0..plane.height()).flat_map(|y| plane.as_ref().row(y).iter().copied()).collect()
}

/// Value at `(x, y)`, samples at centers, the border continued.
fn bilinear(values: &[f32], (w, h): (usize, usize), x: f64, y: f64) -> f32 {
    let (x, y) = ((x - 0.5).clamp(0.0, (w - 1) as f64), (y - 0.5).clamp(0.0, (h - 1) as f64));
    let (i, j) = (x as usize, y as usize);
    let (s, t) = ((x - i as f64) as f32, (y - j as f64) as f32);
    let at = |i: usize, j: usize| values[j.min(h - 1) * w + i.min(w - 1)];
    (1.0 - t) * ((1.0 - s) * at(i, j) + s * at(i + 1, j)) + t * ((1.0 - s) * at(i, j + 1) + s * at(i + 1, j + 1))
}

/// `(F + B − I) / weights`.
fn joined(importance: &Importance, forward: &Sums, backward: &Sums) -> Result<Importance, ImportanceError> {
    let plane = importance.plane();
    let w = plane.width();
    let mean = |x: usize, y: usize| {
        let i = y * w + x;
        let value = forward.values[i] + backward.values[i] - plane.as_ref().row(y)[x];
        (value / (forward.weights[i] + backward.weights[i] - 1.0)).clamp(0.0, 1.0)
    };
    Importance::from_plane(Plane::from_fn(w, plane.height(), mean))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    const SIZE: (f64, f64) = (400.0, 200.0);

    fn spot(x: f64, level: f32) -> Importance {
        let at = |i: usize, _: usize| if (i as f64 * 4.0 + 2.0 - x).abs() < 20.0 { level } else { 0.1 };
        Importance::from_plane(Plane::from_fn(100, 50, at)).expect("in range")
    }

    fn shift(x: f64) -> Homography {
        Homography::new(Matrix3::new(1.0, 0.0, x, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    }

    fn at(i: &Importance, x: f64) -> f32 {
        i.plane().as_ref().row(25)[(x / 4.0) as usize]
    }

    #[test]
    fn what_does_not_change_stays_as_it_is() {
        let clip = vec![spot(200.0, 0.9); 9];
        let coherent = coherent_importance(&clip, &vec![Some(shift(0.0)); 8], SIZE, 5.0).expect("one size");
        for (a, b) in clip.iter().zip(&coherent) {
            assert!((0..100).all(|i| (a.plane().as_ref().row(7)[i] - b.plane().as_ref().row(7)[i]).abs() < 1e-5));
        }
    }

    #[test]
    fn a_pan_carries_importance_along() {
        let clip: Vec<Importance> = (0..20).map(|t| spot(100.0 + 8.0 * t as f64, 0.9)).collect();
        let coherent = coherent_importance(&clip, &vec![Some(shift(8.0)); 19], SIZE, 6.0).expect("one size");
        for (t, frame) in coherent.iter().enumerate() {
            let x = 100.0 + 8.0 * t as f64;
            assert!(at(frame, x) > 0.89 && at(frame, x - 40.0) < 0.11 && at(frame, x + 40.0) < 0.11, "frame {t}");
        }
        let still = coherent_importance(&clip, &vec![Some(shift(0.0)); 19], SIZE, 6.0).expect("one size");
        assert!(at(&still[10], 180.0) < 0.7, "without the motion it smears");
    }

    #[test]
    fn flicker_is_averaged_away_but_not_across_a_cut() {
        let clip: Vec<Importance> = (0..30).map(|t| spot(200.0, if t % 2 == 0 { 0.9 } else { 0.3 })).collect();
        let mut links = vec![Some(shift(0.0)); 29];
        let coherent = coherent_importance(&clip, &links, SIZE, 6.0).expect("one size");
        assert!((5..25).all(|t| (at(&coherent[t], 200.0) - at(&coherent[t + 1], 200.0)).abs() < 0.06));
        links = vec![None; 29];
        let cut = coherent_importance(&clip, &links, SIZE, 6.0).expect("one size");
        assert!(clip.iter().zip(&cut).all(|(a, b)| (at(a, 200.0) - at(b, 200.0)).abs() < 1e-6));
    }

    #[test]
    fn time_runs_both_ways_alike() {
        let clip: Vec<Importance> = (0..12).map(|t| spot(120.0 + 10.0 * t as f64, 0.2 + 0.06 * t as f32)).collect();
        let ahead = coherent_importance(&clip, &vec![Some(shift(4.0)); 11], SIZE, 3.0).expect("one size");
        let reversed: Vec<Importance> = clip.into_iter().rev().collect();
        let back = coherent_importance(&reversed, &vec![Some(shift(-4.0)); 11], SIZE, 3.0).expect("one size");
        for (a, b) in ahead.iter().zip(back.iter().rev()) {
            assert!((0..100).all(|i| (a.plane().as_ref().row(3)[i] - b.plane().as_ref().row(3)[i]).abs() < 1e-5));
        }
    }

    #[test]
    fn planes_of_different_size_are_refused() {
        let clip = [spot(100.0, 0.5), Importance::even()];
        assert!(coherent_importance(&clip, &[], SIZE, 3.0).is_err());
        assert!(coherent_importance(&clip[..1], &[], SIZE, f64::NAN).is_err());
    }
}
