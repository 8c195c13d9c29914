//! How busy the picture is: magnitude of the color gradient, averaged over a neighborhood.
//!
//! ```text
//! G(p) = mean over |q − p|∞ ≤ r of  ‖∇x(q)‖,      ‖∇x‖² = Σ_channels (∂x/∂u)² + (∂x/∂v)²
//! ```
//!
//! with central differences in L\*a\*b\*. Texture shows distortion and an even sky does not, whatever stands out.

use super::LabPicture;
use crate::Plane;

/// Mean gradient magnitude around every pixel, L\*a\*b\*/100 per px; `radius` in px.
pub fn gradient(picture: &LabPicture, radius: usize) -> Plane<f32> {
    let (w, h) = (picture.width(), picture.height());
    let at = |x: usize, y: usize| picture.pixels()[y * w + x];
    let magnitude = Plane::from_fn(w, h, |x, y| {
        let (left, right) = (at(x.saturating_sub(1), y), at((x + 1).min(w - 1), y));
        let (above, below) = (at(x, y.saturating_sub(1)), at(x, (y + 1).min(h - 1)));
        let square = |c: usize| (right[c] - left[c]).powi(2) + (below[c] - above[c]).powi(2);
        0.5 * (0..3).map(square).sum::<f32>().sqrt()
    });
    box_mean(&magnitude, radius)
}

/// Mean over the square of side `2 radius + 1` around every pixel, clipped to the plane.
pub(super) fn box_mean(plane: &Plane<f32>, radius: usize) -> Plane<f32> {
    let (w, h) = (plane.width(), plane.height());
    // Sums over [0, x) × [0, y), one row and column more than the plane.
    let mut sums = vec![0_f64; (w + 1) * (h + 1)];
    for y in 0..h {
        let mut row = 0.0;
        for (x, &v) in plane.as_ref().row(y).iter().enumerate() {
            row += f64::from(v);
            sums[(y + 1) * (w + 1) + x + 1] = sums[y * (w + 1) + x + 1] + row;
        }
    }
    Plane::from_fn(w, h, |x, y| {
        let (x0, x1) = (x.saturating_sub(radius), (x + radius + 1).min(w));
        let (y0, y1) = (y.saturating_sub(radius), (y + radius + 1).min(h));
        let s = |x: usize, y: usize| sums[y * (w + 1) + x];
        ((s(x1, y1) - s(x0, y1) - s(x1, y0) + s(x0, y0)) / ((x1 - x0) * (y1 - y0)) as f64) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_picture_has_no_gradient() {
        let g = gradient(&LabPicture::from_fn(30, 20, |_, _| [0.4, 0.2, 0.9]), 2);
        assert!((0..20).all(|y| g.as_ref().row(y).iter().all(|&v| v == 0.0)));
    }

    #[test]
    fn a_step_is_felt_within_the_radius_and_no_further() {
        let g = gradient(&LabPicture::from_fn(40, 10, |x, _| if x < 20 { [0.0; 3] } else { [1.0; 3] }), 3);
        let row = g.as_ref().row(5);
        // The step of height 1 makes two pixels of gradient ½; seven wide, the mean is 1/7.
        assert!((row[19] - 1.0 / 7.0).abs() < 1e-3 && (row[16] - 0.5 / 7.0).abs() < 1.0, "{row:?}");
        assert!(row[14] < 1e-6 && row[25] < 1e-6, "{row:?}");
    }

    #[test]
    fn the_mean_of_a_constant_is_the_constant_up_to_the_corners() {
        let m = box_mean(&Plane::from_fn(9, 7, |_, _| 0.25), 4);
        assert!((0..7).all(|y| m.as_ref().row(y).iter().all(|&v| (v - 0.25).abs() < 1e-7)));
    }
}
