//! A warp field sampled on a regular lattice of the output, dense enough for bilinear interpolation.
//!
//! Rendering needs the source position of every output pixel. Evaluating the chain there costs tens of nanoseconds each;
//! a dense map costs 16 MB of memory traffic per 1080p frame. Instead the chain is evaluated at the points
//! `(k·h, l·h)` of a lattice and interpolated bilinearly, which along a scan line of a cell is one addition per pixel.
//!
//! The lattice stores the *offset* `src − out`, which is small where the position is large: `f32` then resolves 1e-4 px
//! even in an 8K frame. The step `h` starts at [`MAX_STEP_PX`] and is halved until the interpolation errs by less than
//! [`TOLERANCE_PX`]. The error is measured where the next finer lattice has points, at the middles of cells and edges:
//! for a quadratic field that is where it is largest, and for a kink (the edge of a mesh cell that crosses a lattice
//! cell) the error elsewhere is at most twice that, hence the factor ½ in the test. A cell that passes is not evaluated further: where
//! others need a finer lattice, its points there are those of its interpolation.

use rayon::prelude::*;

use super::WarpField;
use plumbline_num::math::{Point2, Vec2};

/// Bound on the interpolation error inside the source, px: a fortieth of the width of a bicubic kernel's main lobe;
/// blur and shift by it are invisible.
const TOLERANCE_PX: f64 = 0.02;
/// First step tried, px. A similarity is exact at any step; homographies of shaky video pass here.
const MAX_STEP_PX: usize = 32;
/// Last step, px, accepted whatever its error. The offsets of a 1080p frame fill 1 MB there. A change `Δ` of the slope
/// across a mesh edge errs by `Δ h/4` in each component, and where two edges cross by the sum of both: second differences of
/// the mesh up to 0.7 % of its cells (`√2 · 2 · Δ h/4`) stay within the tolerance, several times what a content-preserving warp
/// leaves between neighboring cells.
const MIN_STEP_PX: usize = 4;
/// Points whose source lies further outside the source than this need no precision, px: no kernel reaches them.
const MARGIN_PX: f64 = 4.0;

/// Offsets `src − out` at points `(k·step, l·step)` of the output.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    step: usize,
    cols: usize,
    rows: usize,
    width: usize,
    height: usize,
    offsets: Vec<[f32; 2]>,
}

impl Lattice {
    /// Samples `field` for an output and a source of `width × height` px, as finely as it needs.
    pub fn new(field: &WarpField, width: usize, height: usize) -> Self {
        Self::between(field, (width, height), (width, height))
    }

    /// Samples `field` for an output of size `out` and a source of size `src`, px each.
    pub fn between(field: &WarpField, out: (usize, usize), src: (usize, usize)) -> Self {
        let inside = Inside { width: src.0 as f64 + MARGIN_PX, height: src.1 as f64 + MARGIN_PX };
        if let Some(step) = Self::step_known_to_suffice(field) {
            return Self::sample(field, out, step);
        }
        let mut coarse = Self::sample(field, out, MAX_STEP_PX);
        let mut accurate = vec![false; (coarse.cols - 1) * (coarse.rows - 1)];
        while coarse.step > MIN_STEP_PX {
            let fine = coarse.refined(field, &accurate);
            coarse.judge(&fine, &inside, &mut accurate);
            if !accurate.contains(&false) {
                break;
            }
            if coarse.step == MAX_STEP_PX {
                // Five points say little of a cell this large beside one that bends.
                accurate.fill(false);
            }
            accurate = coarse.inherited(&accurate, &fine);
            coarse = fine;
        }
        coarse
    }

    /// The coarsest step whose error is bounded by the tolerance, where a bound is known.
    fn step_known_to_suffice(field: &WarpField) -> Option<usize> {
        let mut step = MAX_STEP_PX;
        while step > MIN_STEP_PX && !(field.interpolation_error(step as f64)? < TOLERANCE_PX) {
            step /= 2;
        }
        field.interpolation_error(step as f64).map(|_| step)
    }

    /// Offsets at one step.
    fn sample(field: &WarpField, (width, height): (usize, usize), step: usize) -> Self {
        let (cols, rows) = (width.div_ceil(step).max(1) + 1, height.div_ceil(step).max(1) + 1);
        let mut offsets = vec![[f32::NAN; 2]; cols * rows];
        offsets.par_chunks_mut(cols).enumerate().for_each_init(
            || vec![usize::MAX; field.chain.len()],
            |hints, (l, row)| {
                for (k, offset) in row.iter_mut().enumerate() {
                    *offset = offset_at(field, Point2::new((k * step) as f64, (l * step) as f64), hints);
                }
            },
        );
        Self { step, cols, rows, width, height, offsets }
    }

    /// The lattice of half the step: new points of cells that are accurate are interpolated, the others evaluated.
    fn refined(&self, field: &WarpField, accurate: &[bool]) -> Self {
        let (step, width, height) = (self.step / 2, self.width, self.height);
        let (cols, rows) = (width.div_ceil(step).max(1) + 1, height.div_ceil(step).max(1) + 1);
        let is_accurate = |k: usize, l: usize| accurate[l * (self.cols - 1) + k];
        // The cells on either side of a new point, or the one around it.
        let beside = |k: usize, n: usize| (k.saturating_sub(1) / 2, (k / 2).min(n - 2));
        let mut offsets = vec![[f32::NAN; 2]; cols * rows];
        offsets.par_chunks_mut(cols).enumerate().for_each_init(
            || vec![usize::MAX; field.chain.len()],
            |hints, (l, row)| {
                let ((above, below), (top, bottom)) =
                    (beside(l, self.rows), (self.row(l / 2), self.row(l.div_ceil(2))));
                for (k, offset) in row.iter_mut().enumerate() {
                    let (left, right) = beside(k, self.cols);
                    let known = (k | l) & 1 == 0
                        || (is_accurate(left, above)
                            && is_accurate(right, above)
                            && is_accurate(left, below)
                            && is_accurate(right, below));
                    *offset = if known {
                        let (a, b) = (k / 2, k.div_ceil(2));
                        let mean = |i: usize| 0.25 * ((top[a][i] + top[b][i]) + (bottom[a][i] + bottom[b][i]));
                        [mean(0), mean(1)]
                    } else {
                        offset_at(field, Point2::new((k * step) as f64, (l * step) as f64), hints)
                    };
                }
            },
        );
        Self { step, cols, rows, width, height, offsets }
    }

    /// Marks the cells whose interpolation is accurate at the points that `fine` adds inside the source.
    fn judge(&self, fine: &Self, inside: &Inside, accurate: &mut [bool]) {
        accurate.par_chunks_mut(self.cols - 1).enumerate().for_each(|(l, cells)| {
            for (k, cell) in cells.iter_mut().enumerate().filter(|(_, cell)| !**cell) {
                let near = |k: usize, l: usize| self.error_at(fine, inside, k, l) < 0.5 * TOLERANCE_PX;
                let (i, j) = (2 * k, 2 * l);
                *cell =
                    near(i + 1, j + 1) && near(i + 1, j) && near(i, j + 1) && near(i + 2, j + 1) && near(i + 1, j + 2);
            }
        });
    }

    /// Which cells of `fine` are parts of accurate ones.
    fn inherited(&self, accurate: &[bool], fine: &Self) -> Vec<bool> {
        let (cols, rows) = (fine.cols - 1, fine.rows - 1);
        (0..cols * rows).map(|i| accurate[i / cols / 2 * (self.cols - 1) + i % cols / 2]).collect()
    }

    fn error_at(&self, fine: &Self, inside: &Inside, k: usize, l: usize) -> f64 {
        // The last column and row of a lattice of half the step may end before those of this one.
        if k >= fine.cols || l >= fine.rows {
            return 0.0;
        }
        let out = Point2::new((k * fine.step) as f64, (l * fine.step) as f64);
        let [x, y] = fine.offsets[l * fine.cols + k].map(f64::from);
        let exact = Vec2::new(x, y);
        // Undefined points are outside whatever the step.
        if !inside.holds(out + exact) {
            return 0.0;
        }
        self.offset(out).map_or(f64::INFINITY, |offset| (offset - exact).amax())
    }

    /// `src − out` at an output point by bilinear interpolation; `None` where the field is not defined around it.
    fn offset(&self, out: Point2) -> Option<Vec2> {
        let h = self.step as f64;
        let k = ((out.x / h).floor().max(0.0) as usize).min(self.cols - 2);
        let l = ((out.y / h).floor().max(0.0) as usize).min(self.rows - 2);
        let (s, t) = (out.x / h - k as f64, out.y / h - l as f64);
        let v = |k: usize, l: usize| Vec2::from(self.offsets[l * self.cols + k].map(f64::from));
        let top = v(k, l) * (1.0 - s) + v(k + 1, l) * s;
        let bottom = v(k, l + 1) * (1.0 - s) + v(k + 1, l + 1) * s;
        let d = top * (1.0 - t) + bottom * t;
        (d.x.is_finite() && d.y.is_finite()).then_some(d)
    }

    /// Source position of an output point; `None` where the field is not defined.
    pub fn src_from_out(&self, out: Point2) -> Option<Point2> {
        self.offset(out).map(|d| out + d)
    }

    /// Distance of neighboring lattice points, px: a power of two from 4 to 32.
    pub fn step(&self) -> usize {
        self.step
    }

    /// Width and height of the output, px.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// `(columns, rows)` of lattice points; both ≥ 2.
    pub fn points(&self) -> (usize, usize) {
        (self.cols, self.rows)
    }

    /// Offsets of lattice row `l`, px; NaN where the field is not defined.
    pub fn row(&self, l: usize) -> &[[f32; 2]] {
        &self.offsets[l * self.cols..(l + 1) * self.cols]
    }
}

/// The source rectangle, grown by the margin.
struct Inside {
    width: f64,
    height: f64,
}

impl Inside {
    fn holds(&self, p: Point2) -> bool {
        p.x > -MARGIN_PX && p.y > -MARGIN_PX && p.x < self.width && p.y < self.height
    }
}

fn offset_at(field: &WarpField, out: Point2, hints: &mut [usize]) -> [f32; 2] {
    field.map_from(out, hints).map_or([f32::NAN; 2], |src| [(src.x - out.x) as f32, (src.y - out.y) as f32])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::GridMesh;
    use nalgebra::Matrix3;
    use plumbline_num::math::{Homography, PointMap, Similarity2};
    use proptest::prelude::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

    /// Largest error at random points of the output whose source lies inside the source.
    fn worst(field: &WarpField, lattice: &Lattice) -> f64 {
        let (w, h) = lattice.size();
        let mut rng = fastrand::Rng::with_seed(5);
        let error = |_| {
            let out = Point2::new(rng.f64() * w as f64, rng.f64() * h as f64);
            let src = field.map(out).filter(|p| p.x > 0.0 && p.y > 0.0 && p.x < w as f64 && p.y < h as f64)?;
            Some((lattice.src_from_out(out).expect("defined inside") - src).norm())
        };
        (0..4000).filter_map(error).fold(0.0, f64::max)
    }

    #[test]
    fn the_identity_is_exact_at_the_coarsest_step() {
        let lattice = Lattice::new(&WarpField::identity(), 641, 361);
        assert_eq!(lattice.step(), 32);
        assert!(lattice.offsets.iter().all(|d| *d == [0.0, 0.0]));
        assert_eq!(lattice.points(), (22, 13));
    }

    #[test]
    fn a_similarity_needs_no_refinement() {
        let s = Similarity2::about(Point2::new(960.0, 540.0), 0.05, 1.1, Vec2::new(30.0, -20.0));
        let field = WarpField::from_forward_homography(&s.to_homography()).expect("regular");
        let lattice = Lattice::new(&field, 1920, 1080);
        assert_eq!(lattice.step(), 32);
        assert!(worst(&field, &lattice) < 1e-3);
    }

    /// Moves points near one by some px, and counts how often it is asked.
    struct Bump(Arc<AtomicUsize>);

    impl PointMap for Bump {
        fn map(&self, p: Point2) -> Option<Point2> {
            self.0.fetch_add(1, Relaxed);
            let d = p - Point2::new(200.0, 150.0);
            Some(p + Vec2::new(4.0, -3.0) * (-d.norm_squared() / 3200.0).exp())
        }

        fn jacobian(&self, _: Point2) -> Option<nalgebra::Matrix2<f64>> {
            None
        }
    }

    #[test]
    fn cells_are_evaluated_finely_where_they_bend_and_nowhere_else() {
        let asked = Arc::new(AtomicUsize::new(0));
        let field = WarpField { chain: vec![crate::warp::Map::Radial(Box::new(Bump(Arc::clone(&asked))))] };
        let lattice = Lattice::new(&field, 1280, 720);
        let count = asked.load(Relaxed);
        let (cols, rows) = lattice.points();
        assert!(lattice.step() == 4 && 3 * count < cols * rows, "{count} at {}", lattice.step());
        assert!(worst(&field, &lattice) < TOLERANCE_PX, "{}", worst(&field, &lattice));
    }

    #[test]
    fn a_partly_undefined_field_stays_undefined_there() {
        let h = Homography::new(Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -0.005, 0.0, 1.0));
        let field = WarpField { chain: vec![crate::warp::Map::Homography(h)] };
        let lattice = Lattice::new(&field, 640, 360);
        assert!(lattice.src_from_out(Point2::new(50.0, 50.0)).is_some());
        assert!(lattice.src_from_out(Point2::new(400.0, 50.0)).is_none());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn homographies_are_followed_within_the_tolerance(
            e in prop::array::uniform8(-1.0..1.0f64),
        ) {
            let h = Homography::new(Matrix3::new(
                1.0 + 0.1 * e[0], 0.05 * e[1], 60.0 * e[2],
                0.05 * e[3], 1.0 + 0.1 * e[4], 40.0 * e[5],
                8e-5 * e[6], 8e-5 * e[7], 1.0,
            ));
            let field = WarpField::from_forward_homography(&h).expect("near the identity");
            let lattice = Lattice::new(&field, 960, 540);
            prop_assert!(worst(&field, &lattice) < TOLERANCE_PX);
        }

        #[test]
        fn meshes_are_followed_within_the_tolerance(seed in 0..u64::MAX) {
            let mut rng = fastrand::Rng::with_seed(seed);
            // Smooth bends plus moves of up to 0.05 px of each vertex by itself: second differences up to 0.2 px, 0.7 % of a cell.
            let [a, b] = [(); 2].map(|()| 6.0 * rng.f64());
            let vertex = |k: usize| {
                let (x, y) = ((k % 33) as f64 * 30.0, (k / 33) as f64 * 30.0);
                let noise = Vec2::new(rng.f64() - 0.5, rng.f64() - 0.5) * 0.1;
                Point2::new(x + 8.0 * (0.005 * y + a).sin(), y + 8.0 * (0.005 * x + b).sin()) + noise
            };
            let mesh = GridMesh { cols: 32, rows: 18, vertices: (0..33 * 19).map(vertex).collect() };
            let field = WarpField::from_forward_mesh(&mesh, 960.0, 540.0).expect("well formed");
            let lattice = Lattice::new(&field, 960, 540);
            prop_assert!(worst(&field, &lattice) < TOLERANCE_PX, "{} at step {}", worst(&field, &lattice), lattice.step());
        }
    }
}
