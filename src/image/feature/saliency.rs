//! Saliency without learned weights: minimum barrier distance to the border, and color contrast with the border.
//!
//! Background reaches the border of the picture along paths that change little. The *barrier* of a path `π` in one channel
//! `I` is `max_π I − min_π I`; the distance of a pixel is the smallest barrier among all paths to the border,
//!
//! ```text
//! D(p) = Σ_channels  min_π (max_π I − min_π I),      π from p to the border.
//! ```
//!
//! It is approximated by raster scans, alternately from the top left and the bottom right: a pixel takes over the path of a
//! neighbor already visited where that lowers its barrier. Objects that touch the border have distance 0 there; the
//! *backgroundness* of the paper makes up for it: per side of the picture the Mahalanobis distance of a color to that side's
//! mean, the largest of the four left out (an object may occupy one side),
//!
//! ```text
//! U(p) = Σₖ Uₖ(p) − maxₖ Uₖ(p),      Uₖ(p)² = (x_p − x̄ₖ)ᵀ Qₖ⁻¹ (x_p − x̄ₖ).
//! ```
//!
//! Both are scaled to [0, 1], added, favored towards the middle of the picture and spread by a sigmoid. The paper's
//! morphological smoothing is left out: the result is averaged over cells.
//!
//! # Reference
//! J. Zhang, S. Sclaroff, Z. Lin, X. Shen, B. Price, R. Měch, *Minimum barrier salient object detection at 80 FPS*,
//! ICCV 2015.

use nalgebra::{Matrix3, Vector3};

use super::LabPicture;
use crate::Plane;

/// Raster scans, as in the paper; one more changes few pixels.
const SCANS: usize = 3;
/// Width of the border regions that represent the background, as a fraction of the shorter side; as in the paper.
const SIDE: f64 = 0.1;
/// Slope of the sigmoid; as in the paper. Larger makes the map binary.
const SLOPE: f32 = 10.0;
/// Reduction of the saliency in the corners relative to the middle. The paper's 1 suppresses objects at the border,
/// which the photographer framed deliberately.
const CORNER_LOSS: f32 = 0.5;

/// Largest difference below which a picture has no contrast but rounding.
const MIN_CONTRAST: f32 = 1e-3;

/// Saliency of every pixel, in [0, 1].
pub fn saliency(picture: &LabPicture) -> Plane<f32> {
    let (w, h) = (picture.width(), picture.height());
    let mut sum: Vec<f32> = barrier_distance(picture);
    scale_to_one(&mut sum);
    let mut unlike = unlike_the_border(picture);
    scale_to_one(&mut unlike);
    let half = (w as f32 / 2.0, h as f32 / 2.0);
    for (i, (sum, unlike)) in sum.iter_mut().zip(unlike).enumerate() {
        let (x, y) = ((i % w) as f32 + 0.5, (i / w) as f32 + 0.5);
        let off = 0.5 * (x / half.0 - 1.0).powi(2) + 0.5 * (y / half.1 - 1.0).powi(2);
        *sum = (*sum + unlike) * (1.0 - CORNER_LOSS * off);
    }
    scale_to_one(&mut sum);
    Plane::from_fn(w, h, |x, y| 1.0 / (1.0 + (-SLOPE * (sum[y * w + x] - 0.5)).exp()))
}

/// Divides by the largest value, so that the range is [0, 1]; a picture without contrast becomes 0.
fn scale_to_one(values: &mut [f32]) {
    let most = values.iter().copied().fold(0.0, f32::max);
    let scale = if most > MIN_CONTRAST { 1.0 / most } else { 0.0 };
    for v in values {
        *v *= scale;
    }
}

/// The path to a pixel found so far: its barrier, highest and lowest value.
#[derive(Clone, Copy)]
struct Path {
    barrier: f32,
    high: f32,
    low: f32,
}

impl Path {
    /// The path continued to a pixel of value `v`.
    fn to(self, v: f32) -> Self {
        let (high, low) = (self.high.max(v), self.low.min(v));
        Self { barrier: high - low, high, low }
    }
}

/// `D`, the sum over the channels.
fn barrier_distance(picture: &LabPicture) -> Vec<f32> {
    let mut sum = vec![0.0; picture.pixels().len()];
    for c in 0..3 {
        let values: Vec<f32> = picture.pixels().iter().map(|p| p[c]).collect();
        for (sum, path) in sum.iter_mut().zip(shortest_barriers(&values, picture.width(), picture.height())) {
            *sum += path.barrier;
        }
    }
    sum
}

fn shortest_barriers(values: &[f32], w: usize, h: usize) -> Vec<Path> {
    let start = |(i, &v): (usize, &f32)| {
        let at_border = i % w == 0 || i % w == w - 1 || i / w == 0 || i / w == h - 1;
        Path { barrier: if at_border { 0.0 } else { f32::INFINITY }, high: v, low: v }
    };
    let mut paths: Vec<Path> = values.iter().enumerate().map(start).collect();
    for scan in 0..SCANS {
        let backward = scan % 2 == 1;
        for k in 0..w * h {
            let i = if backward { w * h - 1 - k } else { k };
            let (x, y) = (i % w, i / w);
            let aside = if backward { (x + 1 < w).then_some(i + 1) } else { (x > 0).then(|| i - 1) };
            let before = if backward { (y + 1 < h).then_some(i + w) } else { (y > 0).then(|| i - w) };
            for neighbor in [aside, before].into_iter().flatten() {
                let longer = paths[neighbor].to(values[i]);
                if paths[neighbor].barrier.is_finite() && longer.barrier < paths[i].barrier {
                    paths[i] = longer;
                }
            }
        }
    }
    paths
}

/// `U`: how unlike the colors of the border.
fn unlike_the_border(picture: &LabPicture) -> Vec<f32> {
    let (w, h) = (picture.width(), picture.height());
    let thick = ((w.min(h) as f64 * SIDE) as usize).max(1);
    let in_side: [&dyn Fn(usize, usize) -> bool; 4] =
        [&|x, _| x < thick, &|x, _| x + thick >= w, &|_, y| y < thick, &|_, y| y + thick >= h];
    let sides = in_side.map(|inside| Side::of(picture, inside));
    let distance = |pixel: &[f32; 3]| {
        let distances = [0, 1, 2, 3].map(|k| sides[k].distance(pixel));
        distances.iter().sum::<f32>() - distances.iter().copied().fold(0.0, f32::max)
    };
    picture.pixels().iter().map(distance).collect()
}

/// The colors of one side of the picture.
struct Side {
    mean: Vector3<f32>,
    inverse: Matrix3<f32>,
    scale: f32,
}

impl Side {
    fn of(picture: &LabPicture, inside: &dyn Fn(usize, usize) -> bool) -> Self {
        let w = picture.width();
        let members = || picture.pixels().iter().enumerate().filter(|(i, _)| inside(i % w, i / w));
        let count = members().count().max(1) as f32;
        let mean = members().fold(Vector3::zeros(), |sum, (_, p)| sum + Vector3::from(*p)) / count;
        let spread = members().fold(Matrix3::zeros(), |sum, (_, p)| {
            let off = Vector3::from(*p) - mean;
            sum + off * off.transpose()
        }) / count;
        // A hundredth of L* 10 squared: an even side would otherwise call every other color infinitely far.
        let regular = spread + Matrix3::identity() * 1e-3;
        let inverse = regular.try_inverse().unwrap_or_else(Matrix3::identity);
        let mut side = Self { mean, inverse, scale: 1.0 };
        let most = picture.pixels().iter().map(|p| side.distance(p)).fold(0.0, f32::max);
        side.scale = if most > MIN_CONTRAST { 1.0 / most } else { 0.0 };
        side
    }

    fn distance(&self, pixel: &[f32; 3]) -> f32 {
        let off = Vector3::from(*pixel) - self.mean;
        self.scale * off.dot(&(self.inverse * off)).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean_over(plane: &Plane<f32>, inside: impl Fn(usize, usize) -> bool) -> f32 {
        let (mut sum, mut count) = (0.0, 0.0);
        for y in 0..plane.height() {
            for x in 0..plane.width() {
                if inside(x, y) {
                    sum += plane.as_ref().row(y)[x];
                    count += 1.0;
                }
            }
        }
        sum / count
    }

    #[test]
    fn a_uniform_picture_has_no_saliency() {
        let s = saliency(&LabPicture::from_fn(60, 40, |_, _| [0.3, 0.6, 0.2]));
        let first = s.as_ref().row(0)[0];
        assert!((0..40).all(|y| s.as_ref().row(y).iter().all(|&v| v == first && v < 0.01)), "{first}");
    }

    #[test]
    fn a_disk_on_a_gradient_is_salient() {
        let inside = |x: usize, y: usize| (x as f32 - 40.0).powi(2) + (y as f32 - 20.0).powi(2) < 100.0;
        let sky = |x: usize, y: usize| [0.3 + 0.004 * x as f32, 0.5, 0.5 + 0.01 * y as f32];
        let s = saliency(&LabPicture::from_fn(80, 40, |x, y| if inside(x, y) { [0.8, 0.1, 0.1] } else { sky(x, y) }));
        let (disk, rest) = (mean_over(&s, inside), mean_over(&s, |x, y| !inside(x, y)));
        assert!(disk > 0.9 && rest < 0.2, "{disk} against {rest}");
    }

    #[test]
    fn an_object_that_touches_one_side_is_still_salient() {
        let inside = |x: usize, y: usize| (30..50).contains(&x) && y > 20;
        let picture = LabPicture::from_fn(80, 60, |x, y| if inside(x, y) { [0.6, 0.1, 0.1] } else { [0.4, 0.6, 0.8] });
        let s = saliency(&picture);
        let (object, rest) = (mean_over(&s, inside), mean_over(&s, |x, y| !inside(x, y)));
        assert!(object > 3.0 * rest, "{object} against {rest}");
    }

    #[test]
    fn the_barrier_of_a_gradient_is_nothing_and_of_a_ring_is_its_height() {
        let (w, h) = (41, 41);
        let ring = |i: usize| {
            let r = ((i % w) as f32 - 20.0).hypot((i / w) as f32 - 20.0);
            if (8.0..12.0).contains(&r) { 0.7 } else { 0.2 }
        };
        let paths = shortest_barriers(&(0..w * h).map(ring).collect::<Vec<_>>(), w, h);
        assert!((paths[20 * w + 20].barrier - 0.5).abs() < 1e-6, "inside the ring");
        assert_eq!(paths[2 * w + 20].barrier, 0.0, "outside the ring");
    }

    #[test]
    fn tiny_pictures_do_not_fail() {
        for (w, h) in [(1, 1), (1, 5), (3, 1), (2, 2)] {
            let s = saliency(&LabPicture::from_fn(w, h, |x, y| [x as f32 / 3.0, y as f32 / 5.0, 0.5]));
            assert!((0..h).all(|y| s.as_ref().row(y).iter().all(|v| (0.0..=1.0).contains(v))), "{w}×{h}");
        }
    }
}
