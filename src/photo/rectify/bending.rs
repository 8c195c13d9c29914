//! Straightness beside lines.
//!
//! A line lies on a wall, a floor, a board, whose other edges nobody marked and nobody found. Where conformality alone decides how the
//! map goes on beside the last line, it bends them at once. So great circles resist bending near lines. With `e^φ` the scale of the
//! chart, a great circle in the direction `t` is curved by `a = ∇φ − (∇φ·t) t` there, and its image by
//!
//! ```text
//! b(t) = N·(∂_tt u + ∂_a u),                              N: unit normal of ∂_t u
//! E_b  = (ℓ_b/h)² Σ_vertices ω Σ_t (h² b(t))²
//! ω    = max over the virtual vertices of lines of w exp(−d²/2σ²)
//! ```
//!
//! with `d` the distance in the chart and `w` the weight of the virtual vertex. `b` is a cubic in `t`: the four directions of the grid
//! and its diagonals determine it. It is zero for all `t` where the map is projective, a perspective view from any direction, and
//! nowhere else, so that `E_b` asks no more of the map than lines of all directions would, and leaves cross-ratios as they are.
//!
//! As in `straight.rs` each solve is a Gauss–Newton step: with `c = h² (∂_tt u + ∂_a u)` on the present mesh and `d` the chord from the
//! neighbor behind to the one ahead, `N·(c − τ d)`, `τ = c·d/d·d`, agrees with the bend to first order for every motion.

use super::sphere_grid::SphereGrid;
use super::straight::GridLine;
use plumbline_image::grid::{Grid, GridMesh};
use plumbline_num::math::Vec2;

/// `σ`, rad at the center of the view: 7°, what lies beside a line. Where a quarter of a board's lines is marked, half of it leaves a
/// third more bend, twice as much an eighth less, at a tenth more of the cost in shapes.
const REACH: f64 = 0.12;
/// Cutoff of the Gaussian, standard deviations: it has fallen to 3e-4.
const CUTOFF: f64 = 4.0;
/// Neighbors of a vertex, center included, as steps of columns and rows, ascending by number; those 1 and 3, and 0 and 4, are opposite.
const STARS: [[(isize, isize); 5]; 2] =
    [[(0, -1), (-1, 0), (0, 0), (1, 0), (0, 1)], [(-1, -1), (1, -1), (0, 0), (-1, 1), (1, 1)]];
/// Opposite neighbors along a direction, and those across it.
const DIRECTIONS: [([usize; 2], [usize; 2]); 2] = [([1, 3], [0, 4]), ([0, 4], [1, 3])];

/// One square of `E_b`.
pub(super) struct Bend {
    /// Its element among those of [`stars`].
    pub(super) star: usize,
    /// Its vertex, whose `ω` it has.
    pub(super) vertex: usize,
    pub(super) weight: f64,
    /// Of the unknowns of the star.
    pub(super) coefficients: [f64; 10],
}

/// The unknowns of every star, each list ascending: two stars for each vertex inside the grid.
pub(super) fn stars(grid: &Grid) -> impl Iterator<Item = Vec<usize>> + use<> {
    let columns = grid.cols + 1;
    inner(grid).flat_map(move |i| {
        STARS.map(|star| neighbors(i, columns, &star).into_iter().flat_map(|v| [2 * v, 2 * v + 1]).collect())
    })
}

/// The squares of `E_b/ω` linearized about a mesh, without `(ℓ_b/h)²`.
pub(super) fn bends<'a>(sphere: &'a SphereGrid, mesh: &'a GridMesh) -> impl Iterator<Item = Bend> + 'a {
    let columns = sphere.grid.cols + 1;
    let stars = inner(&sphere.grid).flat_map(|i| STARS.iter().map(move |star| (i, star)));
    stars.enumerate().flat_map(move |(star, (vertex, steps))| {
        let slope = sphere.chart.log_scale_gradient(sphere.vertex(vertex)) * sphere.cell();
        let u = neighbors(vertex, columns, steps).map(|v| mesh.vertices[v]);
        DIRECTIONS.into_iter().filter_map(move |([back, ahead], [low, high])| {
            let step = |k: usize| Vec2::new(steps[k].0 as f64, steps[k].1 as f64);
            let lift = 0.5 * slope.dot(&step(high));
            let chord = u[ahead] - u[back];
            let bent = (u[ahead] - u[2]) + (u[back] - u[2]) + (u[high] - u[low]) * lift;
            let normal = Vec2::new(-chord.y, chord.x).try_normalize(1e-12)?;
            let along = bent.dot(&chord) / chord.norm_squared();
            let mut shares = [0.0; 5];
            (shares[back], shares[2], shares[ahead]) = (1.0 + along, -2.0, 1.0 - along);
            (shares[low], shares[high]) = (-lift, lift);
            let mut coefficients = [0.0; 10];
            for (pair, share) in coefficients.chunks_exact_mut(2).zip(shares) {
                (pair[0], pair[1]) = (share * normal.x, share * normal.y);
            }
            // A step along the diagonal is √2 times as long, its second difference twice.
            let weight = step(ahead).norm_squared().powi(-2);
            Some(Bend { star, vertex, weight, coefficients })
        })
    })
}

/// `ω` of each vertex of the grid.
pub(super) fn nearness(sphere: &SphereGrid, lines: &[GridLine]) -> Vec<f64> {
    let grid = &sphere.grid;
    let cell = sphere.cell();
    // The logarithm, so that one exponential per vertex is left.
    let mut near = vec![f64::NEG_INFINITY; grid.vertex_count()];
    let range = |at: f64, count: usize| {
        let first = ((at - CUTOFF * REACH) / cell).ceil().max(0.0) as usize;
        let last = ((at + CUTOFF * REACH) / cell).floor().max(0.0) as usize;
        first..(last + 1).min(count + 1)
    };
    for line in lines.iter().filter(|line| !line.is_side()) {
        for (vertex, weight) in line.vertices.iter().zip(&line.weights) {
            let (at, weight) = (grid.at(*vertex), weight.ln());
            for row in range(at.y, grid.rows) {
                for i in range(at.x, grid.cols).map(|col| row * (grid.cols + 1) + col) {
                    let squared = (grid.vertex(i) - at).norm_squared() / (REACH * REACH);
                    near[i] = near[i].max(weight - 0.5 * squared);
                }
            }
        }
    }
    near.into_iter().map(f64::exp).collect()
}

/// The vertices that have all neighbors.
fn inner(grid: &Grid) -> impl Iterator<Item = usize> + use<> {
    let (cols, rows) = (grid.cols, grid.rows);
    (1..rows).flat_map(move |row| (1..cols).map(move |col| row * (cols + 1) + col))
}

fn neighbors(vertex: usize, columns: usize, star: &[(isize, isize); 5]) -> [usize; 5] {
    star.map(|(col, row)| vertex.wrapping_add_signed(row * columns as isize + col))
}

#[cfg(test)]
mod tests {
    use super::super::chart::Chart;
    use super::*;
    use nalgebra::Rotation3;
    use plumbline_camera::{FieldAxis, FieldOfView, Lens, Projection, Vec3};
    use plumbline_num::math::Point2;

    /// Bends of a map of view directions, per radian: the largest, of all vertices and directions.
    fn largest(chart: Chart, map: impl Fn(Vec3) -> Vec2) -> f64 {
        let fov = FieldOfView::degrees(80.0, FieldAxis::Horizontal);
        let lens = Lens::from_field_of_view(Projection::Equidistant, fov, (400.0, 300.0)).expect("a lens");
        let sphere = SphereGrid::new(chart, &lens, None, 64).expect("in the view");
        let at = |i: usize| Point2::from(map(sphere.chart.ray_in_view(sphere.vertex(i)).expect("in the chart")));
        let vertices = (0..sphere.grid.vertex_count()).map(at).collect();
        let mesh = GridMesh { cols: sphere.grid.cols, rows: sphere.grid.rows, vertices };
        let elements: Vec<Vec<usize>> = stars(&sphere.grid).collect();
        let bend = |bend: Bend| {
            let x = |i: &usize| mesh.vertices[i / 2].coords[i % 2];
            elements[bend.star].iter().zip(bend.coefficients).map(|(i, a)| a * x(i)).sum::<f64>() * bend.weight.sqrt()
        };
        let cell = sphere.cell();
        bends(&sphere, &mesh).map(|b| bend(b).abs() / (cell * cell)).fold(0.0, f64::max)
    }

    #[test]
    fn views_in_perspective_bend_nothing_and_other_maps_do() {
        let charts = [Chart::stereographic, Chart::mercator];
        for chart in charts.map(|chart| chart(Rotation3::identity())) {
            for turn in [Vec3::zeros(), Vec3::new(0.1, -0.15, 0.5)] {
                let view = Rotation3::new(turn);
                let perspective = |ray: Vec3| (view * ray).xy() / (view * ray).z;
                let bend = largest(chart.clone(), perspective);
                assert!(bend < 0.02, "{chart:?} by {turn}: {bend}");
            }
            let itself = largest(chart.clone(), |ray| chart.at_view(&ray).expect("in the chart"));
            assert!(itself > 0.2, "{chart:?}: {itself}");
        }
    }

    #[test]
    fn stars_are_ascending_and_bends_do_not_see_a_shift() {
        let grid = Grid { cols: 5, rows: 4, width: 5.0, height: 4.0 };
        let elements: Vec<Vec<usize>> = stars(&grid).collect();
        assert_eq!(elements.len(), 2 * 4 * 3);
        assert!(elements.iter().all(|unknowns| unknowns.is_sorted() && unknowns.len() == 10));
        let shifted = |by: Vec2| largest(Chart::stereographic(Rotation3::identity()), move |ray| ray.xy() / ray.z + by);
        assert!((shifted(Vec2::zeros()) - shifted(Vec2::new(3.0, -7.0))).abs() < 1e-9);
    }
}
