//! A slow zoom that keeps the source, and what its neighbors show beside it, over the output where crop windows were moved after they had been
//! planned.
//!
//! With `W_t` (`out_from_src`) and the output's center `c`, the part of the output about `c` that the source covers is
//!
//! ```text
//! s_t = max { s ≤ 1 : W_t⁻¹(c + s (p − c)) inside the source and its margins for all corners p of the output }
//! ```
//!
//! and the zoom `z_t ≥ 1/s_t` that covers all of it is the running maximum of `1/s`, low-passed: a mean over no more time than
//! the maximum was taken over stays above the required zoom.

use std::ops::Range;

use crate::path::{Margins, lowpass};
use plumbline_num::math::{Point2, Similarity2};

/// Standard deviation of the mean over time, s: a zoom by a percent over one or two seconds is not visible.
const SIGMA_S: f64 = 0.4;
/// Half width of that mean, standard deviations: beyond 4 a Gaussian has lost all but 10⁻⁴ of its weight.
const HALF_WIDTH: f64 = 4.0;

/// Zoom about the output's center for the windows of every frame of a shot, shown every `period_s`: from 1 to `max_zoom`. `beyond` has the margins
/// of each frame, or none. The mesh covers the remainder.
pub(super) fn covering_zoom(
    windows: &[Similarity2],
    beyond: &[Margins],
    size: (f64, f64),
    period_s: f64,
    max_zoom: f64,
) -> Vec<f64> {
    let sigma = SIGMA_S / period_s;
    let reach = (HALF_WIDTH * sigma).ceil() as usize + 1;
    let margins = |t: usize| beyond.get(t).copied().unwrap_or_default();
    let needed: Vec<f64> =
        windows.iter().enumerate().map(|(t, w)| 1.0 / covered_fraction(w, size, &margins(t))).collect();
    let near = |t: usize| -> Range<usize> { t.saturating_sub(reach)..(t + reach + 1).min(needed.len()) };
    let max_needed: Vec<f64> = (0..needed.len()).map(|t| needed[near(t)].iter().copied().fold(1.0, f64::max)).collect();
    lowpass(&max_needed, sigma).iter().map(|z| z.clamp(1.0, max_zoom)).collect()
}

/// `s_t`.
fn covered_fraction(out_from_src: &Similarity2, (width, height): (f64, f64), beyond: &Margins) -> f64 {
    let Some(src_from_out) = out_from_src.inverse() else { return 1.0 };
    let center = Point2::new(width / 2.0, height / 2.0);
    let from = src_from_out.apply(center);
    let corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)].map(|(x, y)| Point2::new(x, y));
    corners.iter().fold(1.0_f64, |fraction, corner| {
        let direction = src_from_out.apply(*corner) - from;
        let until = |from: f64, direction: f64, [start, end]: [f64; 2]| {
            let room = if direction > 0.0 { end - from } else { start - from };
            if direction == 0.0 { f64::INFINITY } else { room / direction }
        };
        let (across, down) = ([-beyond.left, width + beyond.right], [-beyond.top, height + beyond.bottom]);
        fraction.min(until(from.x, direction.x, across)).min(until(from.y, direction.y, down))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_num::math::Vec2;

    const SIZE: (f64, f64) = (640.0, 360.0);

    fn window(zoom: f64, shift: Vec2) -> Similarity2 {
        Similarity2::about(Point2::new(320.0, 180.0), 0.0, zoom, shift)
    }

    #[test]
    fn a_window_inside_the_frame_asks_for_no_zoom() {
        let windows = vec![window(1.1, Vec2::new(10.0, -5.0)); 50];
        assert!(covering_zoom(&windows, &[], SIZE, 0.03, 2.0).iter().all(|z| (*z - 1.0).abs() < 1e-12));
    }

    #[test]
    fn a_window_that_leaves_the_frame_for_a_moment_is_covered_by_a_zoom_without_a_jump() {
        let shift = |t: usize| if t == 100 { 20.0 } else { 0.0 };
        let windows: Vec<_> = (0..200).map(|t| window(1.02, Vec2::new(shift(t), 0.0))).collect();
        let zoom = covering_zoom(&windows, &[], SIZE, 1.0 / 30.0, 2.0);
        let shown = windows[100].inverse().expect("regular");
        let left = shown.apply(Point2::new(320.0 - 320.0 / zoom[100], 180.0));
        assert!(left.x >= 0.0, "the left edge of the output shows {}", left.x);
        assert!(zoom.windows(2).all(|z| (z[1] - z[0]).abs() < 0.005) && zoom[0] < 1.0 + 1e-6);
    }

    #[test]
    fn what_neighbors_show_beside_a_frame_needs_no_zoom() {
        let windows = vec![window(1.0, Vec2::new(20.0, 0.0)); 30];
        let beyond = vec![Margins { left: 20.0, ..Margins::default() }; 30];
        assert!(covering_zoom(&windows, &beyond, SIZE, 0.03, 2.0).iter().all(|z| (*z - 1.0).abs() < 1e-12));
    }

    #[test]
    fn no_more_zoom_than_allowed() {
        let windows = vec![window(1.0, Vec2::new(60.0, 0.0)); 30];
        assert!(covering_zoom(&windows, &[], SIZE, 0.03, 1.05).iter().all(|z| (*z - 1.05).abs() < 1e-12));
    }
}
