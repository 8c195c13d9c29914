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
//! cell) the error elsewhere is at most twice that, hence the factor ½ in the test.

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
            return Self::sample(field, out, step, None);
        }
        let mut coarse = Self::sample(field, out, MAX_STEP_PX, None);
        while coarse.step > MIN_STEP_PX {
            let fine = Self::sample(field, out, coarse.step / 2, Some(&coarse));
            if coarse.error(&fine, &inside) < 0.5 * TOLERANCE_PX {
                break;
            }
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

    /// Offsets at one step; points that `coarse` has already are taken from there.
    fn sample(field: &WarpField, (width, height): (usize, usize), step: usize, coarse: Option<&Self>) -> Self {
        let (cols, rows) = (width.div_ceil(step).max(1) + 1, height.div_ceil(step).max(1) + 1);
        let mut offsets = vec![[f32::NAN; 2]; cols * rows];
        offsets.par_chunks_mut(cols).enumerate().for_each_init(
            || vec![usize::MAX; field.chain.len()],
            |hints, (l, row)| {
                for (k, offset) in row.iter_mut().enumerate() {
                    let known = coarse.filter(|c| (k | l) & 1 == 0 && k / 2 < c.cols && l / 2 < c.rows);
                    *offset = known.map_or_else(
                        || offset_at(field, Point2::new((k * step) as f64, (l * step) as f64), hints),
                        |c| c.offsets[l / 2 * c.cols + k / 2],
                    );
                }
            },
        );
        Self { step, cols, rows, width, height, offsets }
    }

    /// Largest error, px, of this lattice at the points of one twice as fine, inside the source.
    fn error(&self, fine: &Self, inside: &Inside) -> f64 {
        let row = |l: usize| (0..fine.cols).map(|k| self.error_at(fine, inside, k, l)).fold(0.0, f64::max);
        (0..fine.rows).into_par_iter().map(row).reduce(|| 0.0, f64::max)
    }

    fn error_at(&self, fine: &Self, inside: &Inside, k: usize, l: usize) -> f64 {
        if (k | l) & 1 == 0 {
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
