//! Corners that can be tracked, spread over the picture.
//!
//! A corner is a local maximum of the smaller eigenvalue of the structure tensor
//!
//! ```text
//! S(x) = mean over 3×3 around x of  ∇I ∇Iᵀ,      λ_min(S) in (gray/px)²,
//! ```
//!
//! with Sobel's gradient. The picture is cut into buckets; each asks for its own corners against its own best, so that a
//! brick wall does not take them all and a hazy sky gets some. Positions are refined by a parabola through `λ_min` per axis.
//! Only buckets that lack points are looked at.
//!
//! # Reference
//! J. Shi and C. Tomasi, *Good Features to Track*, CVPR 1994.
#![allow(clippy::cast_possible_wrap)] // indices of pixels are far below 2⁶³

use crate::simd::multiversion;
use crate::{PADDING, PaddedPlane, Plane};

use super::Mask;

/// Buckets along the longer side of the picture; the shorter side has as many as keep them nearly square.
const BUCKETS: usize = 16;
/// Least `λ_min` relative to the best of the bucket. Small values take weak corners next to a strong one.
const QUALITY: f32 = 0.05;
/// Least `λ_min`, (gray/px)²: below it lies the noise of the sensor (a noise of 2 gray levels gives about 0.5).
const FLOOR: f32 = 1.0;
/// Least distance between two points, px.
const MIN_DISTANCE: f32 = 8.0;
/// Least distance from the edge of the picture, px.
const MARGIN: usize = 6;

/// A corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Position, px, pixel centers at integer + 0.5.
    pub position: [f32; 2],
    /// `λ_min`, (gray/px)².
    pub score: f32,
}

/// Finds corners; holds its scratch memory.
#[derive(Clone, Debug, Default)]
pub struct CornerDetector {
    /// Nonzero where no further corner may lie: masked, or near a point.
    taken: Plane<u8>,
    /// Structure tensor rows of a bucket.
    tensor: TensorRows,
    /// `λ_min` of a bucket with a ring of one pixel.
    response: Vec<f32>,
    candidates: Vec<(f32, usize, usize)>,
}

/// Horizontally summed products of the gradient, three rows in turn.
#[derive(Clone, Debug, Default)]
struct TensorRows {
    rows: [Products; 3],
}

#[derive(Clone, Debug, Default)]
struct Products {
    xx: Vec<f32>,
    xy: Vec<f32>,
    yy: Vec<f32>,
}

/// A rectangle of the picture, px.
#[derive(Clone, Copy, Debug)]
struct Bucket {
    x0: usize,
    y0: usize,
    x1: usize,
    y1: usize,
}

impl CornerDetector {
    /// Appends corners of `image` to `found` until every bucket holds `per_bucket` points, `points` included, as far as
    /// the picture has them; none in the mask, none within the least distance of a point.
    pub fn top_up(
        &mut self,
        image: &PaddedPlane,
        points: &[[f32; 2]],
        per_bucket: usize,
        mask: Option<&Mask>,
        found: &mut Vec<Corner>,
    ) {
        let (w, h) = (image.width(), image.height());
        let (cols, rows) = Self::grid(w, h);
        self.occupy(w, h, points, mask);
        let mut counts = vec![0_usize; cols * rows];
        for p in points {
            let bin = |v: f32, n: usize, side: usize| ((v.max(0.0) as usize * n) / side).min(n - 1);
            counts[bin(p[1], rows, h) * cols + bin(p[0], cols, w)] += 1;
        }
        for (i, count) in counts.into_iter().enumerate().filter(|(_, count)| *count < per_bucket) {
            let (col, row) = (i % cols, i / cols);
            let bucket = Bucket {
                x0: (col * w).div_ceil(cols).max(MARGIN),
                y0: (row * h).div_ceil(rows).max(MARGIN),
                x1: ((col + 1) * w).div_ceil(cols).min(w.saturating_sub(MARGIN)),
                y1: ((row + 1) * h).div_ceil(rows).min(h.saturating_sub(MARGIN)),
            };
            if bucket.x0 < bucket.x1 && bucket.y0 < bucket.y1 {
                self.search(image, bucket, per_bucket - count, found);
            }
        }
    }

    /// Columns and rows of buckets for a picture.
    pub fn grid(width: usize, height: usize) -> (usize, usize) {
        let longer = width.max(height).max(1);
        let along = |side: usize| ((BUCKETS * side + longer / 2) / longer).clamp(1, side.max(1));
        (along(width), along(height))
    }

    fn occupy(&mut self, width: usize, height: usize, points: &[[f32; 2]], mask: Option<&Mask>) {
        self.taken.resize(width, height);
        for y in 0..height {
            let mut view = self.taken.as_mut();
            match mask {
                Some(mask) => view.row_mut(y).copy_from_slice(mask.plane().row(y)),
                None => view.row_mut(y).fill(0),
            }
        }
        for p in points {
            self.take(*p);
        }
    }

    /// Marks the disc around a point.
    fn take(&mut self, p: [f32; 2]) {
        let r = MIN_DISTANCE;
        let (w, h) = (self.taken.width(), self.taken.height());
        let span = |c: f32, d: f32, n: usize| {
            ((c - d - 0.5).ceil().max(0.0) as usize, ((c + d + 0.5).floor().max(0.0) as usize).min(n))
        };
        let (first, last) = span(p[1], r, h);
        let mut view = self.taken.as_mut();
        for y in first..last {
            let dy = y as f32 + 0.5 - p[1];
            let (x0, x1) = span(p[0], (r * r - dy * dy).max(0.0).sqrt(), w);
            if x0 < x1 {
                view.row_mut(y)[x0..x1].fill(1);
            }
        }
    }

    /// The best corners of one bucket.
    fn search(&mut self, image: &PaddedPlane, bucket: Bucket, wanted: usize, found: &mut Vec<Corner>) {
        let width = self.respond(image, bucket);
        let rows = bucket.y1 - bucket.y0;
        self.candidates.clear();
        let mut best = 0.0_f32;
        for j in 1..=rows {
            for i in 1..width - 1 {
                let score = self.response[j * width + i];
                best = best.max(score);
                if score > FLOOR && self.is_peak(j * width + i, width) {
                    self.candidates.push((score, bucket.x0 + i - 1, bucket.y0 + j - 1));
                }
            }
        }
        let least = (QUALITY * best).max(FLOOR);
        let mut candidates = std::mem::take(&mut self.candidates);
        candidates.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then((a.2, a.1).cmp(&(b.2, b.1))));
        let mut missing = wanted;
        for &(score, x, y) in candidates.iter().take_while(|c| c.0 >= least) {
            if missing == 0 {
                break;
            }
            if self.taken.as_ref().row(y)[x] == 0 {
                let corner = self.refined(score, x, y, bucket, width);
                self.take(corner.position);
                found.push(corner);
                missing -= 1;
            }
        }
        self.candidates = candidates;
    }

    /// Not below any neighbor, and above those that come later in reading order, so that a plateau has one peak.
    fn is_peak(&self, k: usize, width: usize) -> bool {
        let r = &self.response;
        let before = [k - width - 1, k - width, k - width + 1, k - 1];
        let after = [k + 1, k + width - 1, k + width, k + width + 1];
        before.iter().all(|n| r[k] >= r[*n]) && after.iter().all(|n| r[k] > r[*n])
    }

    fn refined(&self, score: f32, x: usize, y: usize, bucket: Bucket, width: usize) -> Corner {
        let k = (y - bucket.y0 + 1) * width + x - bucket.x0 + 1;
        let offset = |d: usize| {
            let (before, after) = (self.response[k - d], self.response[k + d]);
            let curvature = before + after - 2.0 * score;
            if curvature < 0.0 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
        };
        Corner { position: [x as f32 + 0.5 + offset(1), y as f32 + 0.5 + offset(width)], score }
    }

    /// Fills the response of a bucket and a ring of one pixel; returns its row length.
    fn respond(&mut self, image: &PaddedPlane, bucket: Bucket) -> usize {
        let width = bucket.x1 - bucket.x0 + 2;
        let height = bucket.y1 - bucket.y0 + 2;
        self.response.resize(width * height, 0.0);
        for products in &mut self.tensor.rows {
            products.resize(width);
        }
        let (x, y) = (bucket.x0 as isize - 3, bucket.y0 as isize - 2);
        debug_assert!(x >= -(PADDING as isize));
        for k in 0..height + 2 {
            let rows = [-1, 0, 1].map(|d| &image.from(x, y + k as isize + d)[..width + 4]);
            self.tensor.rows[k % 3].fill(rows);
            if k >= 2 {
                let out = &mut self.response[(k - 2) * width..(k - 1) * width];
                smaller_eigenvalues(&self.tensor.rows, out);
            }
        }
        width
    }
}

impl Products {
    fn resize(&mut self, width: usize) {
        for v in [&mut self.xx, &mut self.xy, &mut self.yy] {
            v.resize(width, 0.0);
        }
    }

    /// Products of Sobel's gradient of the middle of three rows, each summed with its two neighbors in the row.
    fn fill(&mut self, rows: [&[u8]; 3]) {
        products(rows, &mut self.xx, &mut self.xy, &mut self.yy);
    }
}

/// Longest row of a bucket with its rings, px; longer ones are taken in pieces.
const CHUNK: usize = 128;

multiversion! {
    fn products(rows: [&[u8]; 3], xx: &mut [f32], xy: &mut [f32], yy: &mut [f32]) {
        let mut gradient = [[0.0_f32; CHUNK + 2]; 2];
        for start in (0..xx.len()).step_by(CHUNK) {
            let n = CHUNK.min(xx.len() - start);
            let [a, b, c] = rows.map(|r| &r[start..start + n + 4]);
            let [gx, gy] = &mut gradient;
            for i in 0..n + 2 {
                let at = |r: &[u8], k: usize| i16::from(r[i + k]);
                let dx = (at(a, 2) - at(a, 0)) + 2 * (at(b, 2) - at(b, 0)) + (at(c, 2) - at(c, 0));
                let dy = (at(c, 0) - at(a, 0)) + 2 * (at(c, 1) - at(a, 1)) + (at(c, 2) - at(a, 2));
                gx[i] = f32::from(dx);
                gy[i] = f32::from(dy);
            }
            let (xx, xy, yy) = (&mut xx[start..start + n], &mut xy[start..start + n], &mut yy[start..start + n]);
            for i in 0..n {
                let (x, y) = ([gx[i], gx[i + 1], gx[i + 2]], [gy[i], gy[i + 1], gy[i + 2]]);
                xx[i] = x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
                xy[i] = x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
                yy[i] = y[0] * y[0] + y[1] * y[1] + y[2] * y[2];
            }
        }
    }
}

/// Sobel's gradient is 8 times the slope, and nine squares are summed: the scale of a mean in (gray/px)².
const SCALE: f32 = 1.0 / (64.0 * 9.0);

multiversion! {
    fn smaller_eigenvalues(rows: &[Products; 3], out: &mut [f32]) {
        let n = out.len();
        let [a, b, c] = rows;
        let (axx, axy, ayy) = (&a.xx[..n], &a.xy[..n], &a.yy[..n]);
        let (bxx, bxy, byy) = (&b.xx[..n], &b.xy[..n], &b.yy[..n]);
        let (cxx, cxy, cyy) = (&c.xx[..n], &c.xy[..n], &c.yy[..n]);
        for i in 0..n {
            let xx = axx[i] + bxx[i] + cxx[i];
            let xy = axy[i] + bxy[i] + cxy[i];
            let yy = ayy[i] + byy[i] + cyy[i];
            let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
            out[i] = SCALE * (mean - (half * half + xy * xy).sqrt());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pyramid;

    fn level(width: usize, height: usize, f: impl FnMut(usize, usize) -> u8) -> PaddedPlane {
        let mut pyramid = Pyramid::new();
        pyramid.rebuild(Plane::from_fn(width, height, f).as_ref(), 1);
        pyramid.levels()[0].clone()
    }

    fn noise(width: usize, height: usize) -> PaddedPlane {
        let mut rng = fastrand::Rng::with_seed(11);
        level(width, height, |_, _| rng.u8(..))
    }

    fn corners(image: &PaddedPlane, per_bucket: usize, mask: Option<&Mask>) -> Vec<Corner> {
        let mut found = Vec::new();
        CornerDetector::default().top_up(image, &[], per_bucket, mask, &mut found);
        found
    }

    /// The formula of the module, term by term.
    fn by_definition(image: &PaddedPlane, x: isize, y: isize) -> f64 {
        let at = |x: isize, y: isize| f64::from(image.from(x, y)[0]);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (i, j) in (-1..=1).flat_map(|j| (-1..=1).map(move |i| (x + i, y + j))) {
            let along = |s: isize| at(i + 1, j + s) - at(i - 1, j + s);
            let across = |s: isize| at(i + s, j + 1) - at(i + s, j - 1);
            let [gx, gy] =
                [along(-1) + 2.0 * along(0) + along(1), across(-1) + 2.0 * across(0) + across(1)].map(|g| g / 8.0);
            (xx, xy, yy) = (xx + gx * gx / 9.0, xy + gx * gy / 9.0, yy + gy * gy / 9.0);
        }
        0.5 * (xx + yy) - (0.25 * (xx - yy).powi(2) + xy * xy).sqrt()
    }

    #[test]
    fn the_response_is_the_smaller_eigenvalue_of_the_structure_tensor() {
        let image = noise(300, 40);
        let mut detector = CornerDetector::default();
        let bucket = Bucket { x0: 1, y0: 1, x1: 299, y1: 39 };
        let width = detector.respond(&image, bucket);
        for (i, got) in detector.response.iter().enumerate() {
            let want = by_definition(&image, (i % width) as isize, (i / width) as isize);
            assert!((f64::from(*got) - want).abs() < 1e-3 * want.max(10.0), "{i}: {got} against {want}");
        }
    }

    #[test]
    fn the_corner_of_a_square_is_found_at_its_position() {
        let image = level(64, 64, |x, y| if (20..44).contains(&x) && (20..44).contains(&y) { 200 } else { 40 });
        let found = corners(&image, 4, None);
        for want in [[20.0, 20.0], [44.0, 20.0], [20.0, 44.0], [44.0, 44.0]] {
            let near = |c: &Corner| (c.position[0] - want[0]).hypot(c.position[1] - want[1]) < 1.0;
            assert!(found.iter().any(near), "{want:?} in {found:?}");
        }
        assert_eq!(found.len(), 4, "edges and flat ground are no corners");
    }

    #[test]
    fn texture_does_not_take_the_corners_of_flat_areas() {
        let mut rng = fastrand::Rng::with_seed(2);
        let image = level(640, 360, |x, _| if x < 320 { rng.u8(..) } else { 120 + rng.u8(..12) });
        let found = corners(&image, 3, None);
        let faint = found.iter().filter(|c| c.position[0] > 330.0).count();
        assert!(
            found.len() >= 380 && 5 * faint >= 2 * found.len(),
            "{} corners, {faint} of them in the faint half",
            found.len()
        );
    }

    #[test]
    fn corners_keep_their_distance_also_from_points_that_stand() {
        let image = noise(320, 180);
        let points: Vec<[f32; 2]> = (0..20).map(|i| [15.5 * i as f32 + 3.0, 90.0]).collect();
        let mut found = Vec::new();
        CornerDetector::default().top_up(&image, &points, 5, None, &mut found);
        let all: Vec<[f32; 2]> = points.iter().copied().chain(found.iter().map(|c| c.position)).collect();
        assert!(found.len() > 100);
        for (i, p) in all.iter().enumerate().skip(points.len()) {
            for q in &all[..i] {
                // A pixel is taken where its center is; the refinement moves by up to half a pixel per axis.
                assert!((p[0] - q[0]).hypot(p[1] - q[1]) > 8.0 - 1.5, "{p:?} and {q:?}");
            }
        }
    }

    #[test]
    fn only_buckets_that_lack_points_are_topped_up() {
        let image = noise(320, 180);
        let (cols, rows) = CornerDetector::grid(320, 180);
        assert_eq!((cols, rows), (16, 9));
        let full: Vec<[f32; 2]> = (0..cols * rows)
            .filter(|i| i % cols != 4)
            .map(|i| [(i % cols) as f32 * 20.0 + 10.0, (i / cols) as f32 * 20.0 + 10.0])
            .collect();
        let mut found = Vec::new();
        CornerDetector::default().top_up(&image, &full, 1, None, &mut found);
        assert!(!found.is_empty() && found.iter().all(|c| (79.0..101.0).contains(&c.position[0])), "{found:?}");
    }

    #[test]
    fn no_corner_lies_in_the_mask() {
        let drawn = Plane::from_fn(320, 180, |x, _| if x >= 160 { 255 } else { 0 });
        let mask = Mask::from_plane(drawn.as_ref(), 320, 180, 10).expect("half is left");
        let found = corners(&noise(320, 180), 4, Some(&mask));
        assert!(found.len() > 150 && found.iter().all(|c| c.position[0] < 151.0));
    }

    #[test]
    fn pictures_smaller_than_the_margins_have_no_corners() {
        for (w, h) in [(1, 1), (12, 12), (13, 5), (2, 300)] {
            assert!(corners(&noise(w, h), 3, None).is_empty(), "{w}×{h}");
        }
    }
}
