//! A picture resized by rows and columns: each keeps straight, some shrink more than others.
//!
//! The grid over the picture gets new column widths and row heights. With `a_c` the scale of column `c`, `d_r` that of row
//! `r` and `w_rc` the weight of their cell,
//!
//! ```text
//! min  Σ w_rc (a_c − d_r)²      s.t.  Σ_c a_c = n_c s_x,   Σ_r d_r = n_r s_y,   a_c ≥ m s_x,   d_r ≥ m s_y:
//! ```
//!
//! cells that matter want equal scale both ways. `s_x`, `s_y` are the scales of the plain resize. The program is convex, has
//! one unknown per row and column, and always a solution without folds whose border is exact: it works for any size, and
//! scale-and-stretch starts from it. Equal weights give the plain resize.
//!
//! # Reference
//! D. Panozzo, O. Weber, O. Sorkine, *Robust image retargeting via axis-aligned deformation*, Computer Graphics Forum
//! (Eurographics) 31 (2012).

use super::RetargetError;
use crate::math::Point2;
use crate::mesh::{Grid, GridMesh};
use crate::optim::qp::{Affine, QuadraticProgram};

/// The grid with rows and columns resized so that the whole is `size` px, none below `least` of its plain share.
///
/// `weights` are those of the cells, row-major.
///
/// # Errors
/// [`RetargetError::Start`] where the program is not solved.
pub(super) fn axis_aligned(
    grid: &Grid,
    weights: &[f64],
    size: (f64, f64),
    least: f64,
) -> Result<GridMesh, RetargetError> {
    let (columns, rows) = scales(grid, weights, (size.0 / grid.width, size.1 / grid.height), least)?;
    let (x, y) = (places(&columns, size.0), places(&rows, size.1));
    let vertices = y.iter().flat_map(|&y| x.iter().map(move |&x| Point2::new(x, y))).collect();
    Ok(GridMesh { cols: grid.cols, rows: grid.rows, vertices })
}

/// Scales of columns and rows relative to the plain resize: `a_c / s_x`, `d_r / s_y`, means 1.
///
/// # Errors
/// [`RetargetError::Start`] where the program is not solved.
pub(in crate::photo) fn scales(
    grid: &Grid,
    weights: &[f64],
    (sx, sy): (f64, f64),
    least: f64,
) -> Result<(Vec<f64>, Vec<f64>), RetargetError> {
    let (cols, rows) = (grid.cols, grid.rows);
    let mut qp = QuadraticProgram::new(cols + rows);
    // A common factor changes nothing but the solver's idea of small.
    let unit = 1.0 / (sx * sy).sqrt();
    for (cell, &w) in weights.iter().enumerate() {
        let (a, d) = (Affine::var(cell % cols), Affine::var(cols + cell / cols));
        qp.add_square(w, (sx * unit) * a - (sy * unit) * d);
    }
    for (first, count) in [(0, cols), (cols, rows)] {
        let sum = (first..first + count).map(Affine::var).fold(Affine::constant(-(count as f64)), |s, v| s + v);
        qp.require_zero(sum);
        (first..first + count).for_each(|i| qp.require_at_most_zero(Affine::constant(least) - Affine::var(i)));
    }
    let solved = qp.solve()?;
    let (a, d) = solved.split_at(cols);
    Ok((made_exact(a, least), made_exact(d, least)))
}

/// Moves the last hair: nothing below `least`, mean 1.
fn made_exact(scales: &[f64], least: f64) -> Vec<f64> {
    let above = |s: f64| (s - least).max(0.0);
    let sum: f64 = scales.iter().map(|&s| above(s)).sum();
    let room = scales.len() as f64 * (1.0 - least);
    scales.iter().map(|&s| if sum > 0.0 { least + above(s) * (room / sum) } else { 1.0 }).collect()
}

/// Where the lines between cells come to lie: from 0 to `extent`, both exact.
pub(in crate::photo) fn places(scales: &[f64], extent: f64) -> Vec<f64> {
    let share = extent / scales.len() as f64;
    let mut places = vec![0.0; scales.len() + 1];
    for (i, s) in scales.iter().enumerate() {
        places[i + 1] = places[i] + s * share;
    }
    places[scales.len()] = extent;
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GRID: Grid = Grid { cols: 12, rows: 8, width: 600.0, height: 400.0 };

    fn widths(mesh: &GridMesh) -> Vec<f64> {
        (0..mesh.cols).map(|c| mesh.vertices[c + 1].x - mesh.vertices[c].x).collect()
    }

    #[test]
    fn equal_weights_give_the_plain_resize() {
        let mesh = axis_aligned(&GRID, &[0.4; 96], (360.0, 500.0), 0.3).expect("convex");
        for (i, v) in mesh.vertices.iter().enumerate() {
            let plain = GRID.vertex(i);
            let off = (v.x - plain.x * 0.6).abs().max((v.y - plain.y * 1.25).abs());
            assert!(off < 1e-3, "vertex {i} is off by {off} px");
        }
    }

    #[test]
    fn columns_that_matter_keep_their_width() {
        let weights: Vec<f64> = (0..96).map(|cell| if (4..8).contains(&(cell % 12)) { 1.0 } else { 0.05 }).collect();
        let mesh = axis_aligned(&GRID, &weights, (360.0, 400.0), 0.3).expect("convex");
        let w = widths(&mesh);
        assert!(w[4..8].iter().all(|w| *w > 47.0) && w[..4].iter().all(|w| *w < 23.0), "{w:?}");
    }

    #[test]
    fn no_solution_of_equal_border_costs_less() {
        let weights: Vec<f64> = (0..96).map(|cell| 0.1 + (cell * 37 % 11) as f64 / 11.0).collect();
        let cost = |mesh: &GridMesh| -> f64 {
            let size = |cell: usize| {
                let q = mesh.quad(cell);
                ((q.0[1].x - q.0[0].x) / 50.0, (q.0[2].y - q.0[0].y) / 50.0)
            };
            weights.iter().enumerate().map(|(cell, w)| w * (size(cell).0 - size(cell).1).powi(2)).sum()
        };
        let best = axis_aligned(&GRID, &weights, (360.0, 400.0), 0.1).expect("convex");
        let mut rng = fastrand::Rng::with_seed(3);
        for _ in 0..200 {
            let mut other = best.clone();
            let (c, by) = (1 + rng.usize(..11), 4.0 * (rng.f64() - 0.5));
            (0..9).for_each(|r| other.vertices[r * 13 + c].x += by);
            let (r, by) = (1 + rng.usize(..7), 4.0 * (rng.f64() - 0.5));
            (0..13).for_each(|c| other.vertices[r * 13 + c].y += by);
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
            let mesh = axis_aligned(&GRID, &weights, size, least).expect("convex");
            prop_assert_eq!(mesh.vertices[0], Point2::origin());
            prop_assert_eq!(mesh.vertices[116], Point2::new(size.0, size.1));
            prop_assert_eq!(mesh.folded_cells(), 0);
            let narrowest = widths(&mesh).into_iter().fold(f64::INFINITY, f64::min);
            prop_assert!(narrowest > least * 50.0 * sx * (1.0 - 1e-9), "{narrowest}");
        }
    }
}
