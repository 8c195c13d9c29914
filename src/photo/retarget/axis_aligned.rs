//! Axis-aligned retargeting: rows and columns stay straight and are resized by importance.
//!
//! The grid over the picture gets new column widths and row heights. With `a_c` the scale of column `c`, `d_r` that of row
//! `r` and `w_rc` the weight of their cell,
//!
//! ```text
//! min  Σ w_rc (a_c − d_r)² / (â_c d̂_r)      s.t.  Σ_c a_c = n_c s_x,   Σ_r d_r = n_r s_y,
//!                                                 m s_x ≤ a_c ≤ M,   m s_y ≤ d_r ≤ M:
//! ```
//!
//! cells that matter want equal scale both ways. `s_x`, `s_y` are the scales of the plain resize, hats the last
//! solution of a few. The program is convex, has one unknown per row and column, and always a solution without folds
//! whose border is exact: it works for any size and is the initial guess of scale-and-stretch. Equal weights give the
//! plain resize. The paper has no denominators: a cell then distorts the less the smaller it is, so that squeezing
//! unimportant cells costs too little compared with scaling important ones.
//!
//! # Reference
//! D. Panozzo, O. Weber, O. Sorkine, *Robust image retargeting via axis-aligned deformation*, Computer Graphics Forum
//! (Eurographics) 31 (2012).

use crate::PhotoError;
use plumbline_image::grid::{Grid, GridMesh};
use plumbline_num::math::Point2;
use plumbline_num::optim::qp::{Affine, QuadraticProgram};
use plumbline_num::run::Run;

/// Iterations of the division by the cells' current size. The first changes the result most, the fourth by a few
/// percent.
const REWEIGHTINGS: usize = 4;

/// The grid with rows and columns resized so that the whole is `size` px, none out of bounds.
///
/// `weights` are those of the cells, row-major.
///
/// # Errors
/// [`PhotoError::Input`] where the program is not solved.
pub(super) fn axis_aligned(
    grid: &Grid,
    weights: &[f64],
    size: (f64, f64),
    bounds: Bounds,
    run: &Run,
) -> Result<GridMesh, PhotoError> {
    let (columns, rows) = scales(grid, weights, (size.0 / grid.width, size.1 / grid.height), bounds, run)?;
    let (x, y) = (positions(&columns, size.0), positions(&rows, size.1));
    let vertices = y.iter().flat_map(|&y| x.iter().map(move |&x| Point2::new(x, y))).collect();
    Ok(GridMesh { cols: grid.cols, rows: grid.rows, vertices })
}

/// Bounds of the scales.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    /// `m`: minimum scale relative to the plain resize along the axis.
    pub(crate) least: f64,
    /// `M`: maximum scale relative to the larger scale of the plain resize, above 1.
    pub(crate) most: f64,
}

/// Scales of columns and rows relative to the plain resize: `a_c / s_x`, `d_r / s_y`, means 1.
///
/// # Errors
/// [`PhotoError::Input`] where the program is not solved.
pub(crate) fn scales(
    grid: &Grid,
    weights: &[f64],
    (sx, sy): (f64, f64),
    bounds: Bounds,
    run: &Run,
) -> Result<(Vec<f64>, Vec<f64>), PhotoError> {
    let (mut a, mut d) = (vec![1.0; grid.cols], vec![1.0; grid.rows]);
    for _ in 0..REWEIGHTINGS {
        let relative = |(cell, w): (usize, &f64)| w / (a[cell % grid.cols] * d[cell / grid.cols]);
        let weights: Vec<f64> = weights.iter().enumerate().map(relative).collect();
        let solved = program(grid, &weights, (sx, sy), bounds).solve(run)?;
        (a, d) = (made_exact(&solved[..grid.cols], bounds.least), made_exact(&solved[grid.cols..], bounds.least));
    }
    Ok((a, d))
}

fn program(grid: &Grid, weights: &[f64], (sx, sy): (f64, f64), bounds: Bounds) -> QuadraticProgram {
    let (cols, rows) = (grid.cols, grid.rows);
    let mut qp = QuadraticProgram::new(cols + rows);
    // A common factor only normalizes the solver's tolerances.
    let unit = 1.0 / (sx * sy).sqrt();
    for (cell, &w) in weights.iter().enumerate() {
        let (a, d) = (Affine::var(cell % cols), Affine::var(cols + cell / cols));
        qp.add_square(w, (sx * unit) * a - (sy * unit) * d);
    }
    for (first, count, scale) in [(0, cols, sx), (cols, rows, sy)] {
        let sum = (first..first + count).map(Affine::var).fold(Affine::constant(-(count as f64)), |s, v| s + v);
        qp.require_zero(sum);
        let most = bounds.most * sx.max(sy) / scale;
        for i in first..first + count {
            qp.require_at_most_zero(Affine::constant(bounds.least) - Affine::var(i));
            qp.require_at_most_zero(Affine::var(i) - Affine::constant(most));
        }
    }
    qp
}

/// Removes the solver's tolerance: minimum `least`, mean 1 exactly.
fn made_exact(scales: &[f64], least: f64) -> Vec<f64> {
    let above = |s: f64| (s - least).max(0.0);
    let sum: f64 = scales.iter().map(|&s| above(s)).sum();
    let room = scales.len() as f64 * (1.0 - least);
    scales.iter().map(|&s| if sum > 0.0 { least + above(s) * (room / sum) } else { 1.0 }).collect()
}

/// Positions of the grid lines: from 0 to `extent`, both exact.
pub(crate) fn positions(scales: &[f64], extent: f64) -> Vec<f64> {
    let cell = extent / scales.len() as f64;
    let mut positions = vec![0.0; scales.len() + 1];
    for (i, s) in scales.iter().enumerate() {
        positions[i + 1] = positions[i] + s * cell;
    }
    positions[scales.len()] = extent;
    positions
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GRID: Grid = Grid { cols: 12, rows: 8, width: 600.0, height: 400.0 };

    const BOUNDS: Bounds = Bounds { least: 0.3, most: 1.5 };

    fn widths(mesh: &GridMesh) -> Vec<f64> {
        (0..mesh.cols).map(|c| mesh.vertices[c + 1].x - mesh.vertices[c].x).collect()
    }

    #[test]
    fn equal_weights_give_the_plain_resize() {
        let mesh = axis_aligned(&GRID, &[0.4; 96], (360.0, 500.0), BOUNDS, &Run::default()).expect("convex");
        for (i, v) in mesh.vertices.iter().enumerate() {
            let plain = GRID.vertex(i);
            let off = (v.x - plain.x * 0.6).abs().max((v.y - plain.y * 1.25).abs());
            assert!(off < 1e-3, "vertex {i} is off by {off} px");
        }
    }

    #[test]
    fn columns_that_matter_keep_their_width() {
        let weights: Vec<f64> = (0..96).map(|cell| if (4..8).contains(&(cell % 12)) { 1.0 } else { 0.05 }).collect();
        let mesh = axis_aligned(&GRID, &weights, (360.0, 400.0), BOUNDS, &Run::default()).expect("convex");
        let w = widths(&mesh);
        // Rows stay plain, so that columns share one derivative: w (1 − 1/a), while 4 a + 8 b = 7.2.
        let (a, b) = (w[5] / 50.0, w[1] / 50.0);
        assert!(((1.0 - 1.0 / a) - 0.05 * (1.0 - 1.0 / b)).abs() < 1e-3, "{w:?}");
        assert!(a > 0.9 && b < 0.5, "{w:?}");
    }

    #[test]
    fn no_rows_and_columns_of_the_same_sums_cost_less() {
        let weights: Vec<f64> = (0..96).map(|cell| 0.1 + (cell * 37 % 11) as f64 / 11.0).collect();
        let cost = |x: &[f64]| -> f64 {
            let term = |(cell, w): (usize, &f64)| w * (0.6 * x[cell % 12] - x[12 + cell / 12]).powi(2);
            weights.iter().enumerate().map(term).sum()
        };
        let best = program(&GRID, &weights, (0.6, 1.0), BOUNDS).solve(&Run::default()).expect("convex");
        let mut rng = fastrand::Rng::with_seed(3);
        for _ in 0..200 {
            let (mut other, by) = (best.clone(), 0.1 * (rng.f64() - 0.5));
            let (i, j) = if rng.bool() {
                (rng.usize(..12), rng.usize(..12))
            } else {
                (12 + rng.usize(..8), 12 + rng.usize(..8))
            };
            other[i] += by;
            other[j] -= by;
            assert!(cost(&other) >= cost(&best) * (1.0 - 1e-6), "{} below {}", cost(&other), cost(&best));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn any_size_has_an_exact_border_and_no_cell_below_the_least(
            seed in 0..u64::MAX, sx in 0.05..8.0f64, sy in 0.05..8.0f64, least in 0.01..0.9f64,
        ) {
            let mut rng = fastrand::Rng::with_seed(seed);
            let weights: Vec<f64> = (0..96).map(|_| 10_f64.powf(-3.0 * rng.f64())).collect();
            let size = (600.0 * sx, 400.0 * sy);
            let mesh = axis_aligned(&GRID, &weights, size, Bounds { least, most: 1.5 }, &Run::default()).expect("convex");
            prop_assert_eq!(mesh.vertices[0], Point2::origin());
            prop_assert_eq!(mesh.vertices[116], Point2::new(size.0, size.1));
            prop_assert_eq!(mesh.folded_cells(), 0);
            let narrowest = widths(&mesh).into_iter().fold(f64::INFINITY, f64::min);
            prop_assert!(narrowest > least * 50.0 * sx * (1.0 - 1e-9), "{narrowest}");
        }
    }
}
