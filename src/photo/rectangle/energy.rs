//! The global warp: cells keep their shape, lines stay straight, the border is a rectangle.
//!
//! ```text
//! E(V) = Σ_q w_q ‖(I − A_q A_q⁺) V_q‖²  +  λ Σ_k (c/|e_k|) (n(φ_k + θ_{m(k)}) · e'_k)²
//! ```
//!
//! The first sum is the deviation of the four corners `V_q` of a cell from a similarity transform of their source
//! positions: `A_q` spans all similar copies. In the second `e_k` are pieces of lines within one cell, at the angle
//! `φ_k` in the picture and `e'_k` in the output; lines of one of 50 bins `m` of directions rotate together, by `θ_m`,
//! and `n(·)` is the normal of the resulting direction. Straight lines stay straight and parallel lines parallel. `c`
//! is the side of a cell. The coordinates that put the border on the rectangle are not unknowns.
//!
//! Alternating minimization: for given `θ` a linear system in `V`; for given `V` each `θ_m` is the length-weighted mean
//! rotation of its pieces.
//!
//! # Reference
//! K. He, H. Chang, J. Sun, *Rectangling panoramic images via warping*, ACM Trans. Graph. (SIGGRAPH) 32 (2013), section 3.2.

use std::f64::consts::PI;

use crate::Line;
use plumbline_image::grid::{Grid, GridMesh, Quad};
use plumbline_image::warp::InverseMesh;
use plumbline_num::energy::{EnergyError, Ordering, QuadraticEnergy};
use plumbline_num::math::{Point2, PointMap, Vec2};
use plumbline_num::run::Run;

/// Bins of line directions, 3.6° each, as in the paper.
const BINS: usize = 50;
/// Samples of a line per side of a cell: a piece's end is off by at most a sixth of a cell.
const PER_CELL: f64 = 6.0;

/// A piece of a line within one cell.
#[derive(Clone, Copy, Debug)]
struct Piece {
    cell: usize,
    /// Differences of the bilinear weights of its ends.
    corners: [f64; 4],
    /// Angle in the picture, and length there, px.
    angle: f64,
    length: f64,
    bin: usize,
}

/// The energy of a grid in a picture.
#[derive(Debug)]
pub(super) struct Rectangling<'a> {
    source: &'a GridMesh,
    /// `I − A A⁺` of every cell.
    shapes: Vec<[[f64; 8]; 8]>,
    /// `w_q`.
    pub(super) weights: Vec<f64>,
    pieces: Vec<Piece>,
    /// `λ`.
    straightness: f64,
    /// Side of a cell, px.
    cell_px: f64,
    unknown_of: Vec<Option<usize>>,
    energy: QuadraticEnergy,
}

impl<'a> Rectangling<'a> {
    pub(super) fn new(
        source: &'a GridMesh,
        lines: &[Line],
        weights: Vec<f64>,
        straightness: f64,
    ) -> Result<Self, EnergyError> {
        let cells = source.cols * source.rows;
        let area: f64 = (0..cells).map(|cell| source.quad(cell).area()).sum();
        let cell_px = (area / cells as f64).sqrt();
        let shapes = (0..cells).map(|cell| shape_residual(&source.quad(cell))).collect();
        let pieces = lines.iter().flat_map(|line| pieces(line, source, cell_px)).collect();
        let (unknown_of, count) = number_free_coordinates(source);
        let elements: Vec<Vec<usize>> = (0..cells)
            .map(|cell| coordinates(source, cell).into_iter().filter_map(|c| unknown_of[c]).collect())
            .collect();
        let energy = QuadraticEnergy::new(count, elements.iter().map(Vec::as_slice), &Ordering::Amd)?;
        Ok(Self { source, shapes, weights, pieces, straightness, cell_px, unknown_of, energy })
    }

    /// Mean rotation of each bin of directions from the picture to a mesh; 0 for empty bins.
    pub(super) fn rotations(&self, mesh: &GridMesh) -> [f64; BINS] {
        let (mut sums, mut lengths) = ([0.0; BINS], [0.0; BINS]);
        for piece in &self.pieces {
            let now = piece.now(mesh);
            let rotation = (now.y.atan2(now.x) - piece.angle + PI).rem_euclid(2.0 * PI) - PI;
            sums[piece.bin] += piece.length * rotation;
            lengths[piece.bin] += piece.length;
        }
        std::array::from_fn(|m| if lengths[m] > 0.0 { sums[m] / lengths[m] } else { 0.0 })
    }

    /// The minimizer over the rectangle of `size`, for given rotations; `None`: without the line terms.
    pub(super) fn solve(
        &mut self,
        size: (f64, f64),
        rotations: Option<&[f64; BINS]>,
        run: &Run,
    ) -> Result<GridMesh, EnergyError> {
        self.energy.clear();
        let fixed = |k: usize| fixed(self.source, k, size).unwrap_or(0.0);
        let mut rows: Vec<(usize, f64, [f64; 8])> = Vec::new();
        for (cell, (shape, w)) in self.shapes.iter().zip(&self.weights).enumerate() {
            rows.extend(shape.iter().map(|row| (cell, *w, *row)));
        }
        for piece in rotations.iter().flat_map(|rotations| self.pieces.iter().map(move |p| (p, rotations[p.bin]))) {
            let (piece, rotation) = piece;
            let (sin, cos) = (piece.angle + rotation).sin_cos();
            let row = std::array::from_fn(|k| piece.corners[k / 2] * if k % 2 == 0 { -sin } else { cos });
            rows.push((piece.cell, self.straightness * self.cell_px / piece.length, row));
        }
        for (cell, w, row) in rows {
            let (mut free, mut count, mut b) = ([0.0; 8], 0, 0.0);
            for (a, c) in row.into_iter().zip(coordinates(self.source, cell)) {
                if self.unknown_of[c].is_some() {
                    free[count] = a;
                    count += 1;
                } else {
                    b -= a * fixed(c);
                }
            }
            self.energy.add(cell, w, &free[..count], b);
        }
        let x = self.energy.minimize(run)?;
        let value = |c: usize| self.unknown_of[c].map_or_else(|| fixed(c), |u| x[u]);
        let vertices = (0..self.source.vertices.len()).map(|i| Point2::new(value(2 * i), value(2 * i + 1))).collect();
        Ok(GridMesh { cols: self.source.cols, rows: self.source.rows, vertices })
    }
}

impl Piece {
    /// The piece as it lies in a mesh.
    fn now(&self, mesh: &GridMesh) -> Vec2 {
        let corners = mesh.corners(self.cell).into_iter().zip(self.corners);
        corners.fold(Vec2::zeros(), |sum, (i, w)| sum + mesh.vertices[i].coords * w)
    }
}

/// The coordinates of a cell's corners, ascending.
fn coordinates(mesh: &GridMesh, cell: usize) -> [usize; 8] {
    let corners = mesh.corners(cell);
    std::array::from_fn(|k| 2 * corners[k / 2] + k % 2)
}

/// Where the rectangle puts coordinate `c` of the border; `None` for one that is free.
fn fixed(mesh: &GridMesh, c: usize, size: (f64, f64)) -> Option<f64> {
    let (i, j) = (c / 2 % (mesh.cols + 1), c / 2 / (mesh.cols + 1));
    let (at, last, extent) = if c.is_multiple_of(2) { (i, mesh.cols, size.0) } else { (j, mesh.rows, size.1) };
    match at {
        0 => Some(0.0),
        at if at == last => Some(extent),
        _ => None,
    }
}

fn number_free_coordinates(mesh: &GridMesh) -> (Vec<Option<usize>>, usize) {
    let mut count = 0;
    let mut number = |c: usize| {
        let free = fixed(mesh, c, (1.0, 1.0)).is_none();
        count += usize::from(free);
        free.then(|| count - 1)
    };
    let unknown_of = (0..2 * mesh.vertices.len()).map(&mut number).collect();
    (unknown_of, count)
}

/// `I − A A⁺`: the projection of a cell's corners off the similar copies of `quad`. About the mean of its corners these
/// are spanned by `z`, its rotation by 90°, and the two translations, which are orthogonal.
fn shape_residual(quad: &Quad) -> [[f64; 8]; 8] {
    let mean = quad.0.iter().fold(Vec2::zeros(), |sum, p| sum + p.coords) / 4.0;
    let z: [f64; 8] = std::array::from_fn(|k| (quad.0[k / 2].coords - mean)[k % 2]);
    let rotation: [f64; 8] = std::array::from_fn(|k| if k % 2 == 0 { -z[k + 1] } else { z[k - 1] });
    let shift = |axis: usize| -> [f64; 8] { std::array::from_fn(|k| if k % 2 == axis { 1.0 } else { 0.0 }) };
    let basis = [z, rotation, shift(0), shift(1)].map(|v| {
        let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        v.map(|x| x / norm)
    });
    std::array::from_fn(|i| {
        std::array::from_fn(|j| f64::from(u8::from(i == j)) - basis.iter().map(|v| v[i] * v[j]).sum::<f64>())
    })
}

/// The pieces of a line, px of the picture.
fn pieces(line: &Line, source: &GridMesh, cell_px: f64) -> Vec<Piece> {
    let (width, height) = (source.cols as f64, source.rows as f64);
    let Ok(inverse) = InverseMesh::new(source, width, height) else { return Vec::new() };
    let grid = Grid { cols: source.cols, rows: source.rows, width, height };
    let mut found = Vec::new();
    for ends in line.points.windows(2) {
        let d = ends[1] - ends[0];
        let count = (d.norm() * PER_CELL / cell_px).ceil().clamp(1.0, 1e5) as usize;
        let place = |k: usize| grid.locate(inverse.map(ends[0] + d * (k as f64 / count as f64))?);
        let angle = d.y.atan2(d.x);
        let bin = ((angle.rem_euclid(PI) / PI * BINS as f64) as usize).min(BINS - 1);
        let places: Vec<_> = (0..=count).map(place).collect();
        let mut start = 0;
        for k in 1..=count + 1 {
            // Samples of one cell make one piece, from the first to the last of them.
            let cell = |k: usize| places.get(k).copied().flatten().map(|p| p.cell);
            if k <= count && cell(k) == cell(start) {
                continue;
            }
            if let (Some(a), Some(b)) = (places[start], places[k - 1])
                && k - 1 > start
            {
                let (from, to) = (Quad::weights(a.s, a.t), Quad::weights(b.s, b.t));
                let corners = std::array::from_fn(|c| to[c] - from[c]);
                let length = d.norm() * (k - 1 - start) as f64 / count as f64;
                found.push(Piece { cell: a.cell, corners, angle, length, bin });
            }
            start = k;
        }
    }
    found
}
