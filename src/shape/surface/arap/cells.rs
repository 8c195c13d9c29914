//! Cells and their rotations: the local step.
//!
//! A cell is a set of weighted edges with a common rotation. Its covariance is linear in the positions, its contribution to the
//! right-hand side of the global step linear in its rotation, both through the same vectors `c_ij`:
//!
//! ```text
//! Sᵢ = Σⱼ c_ij (xⱼ − xᵢ)ᵀ,     b = Σᵢ Σⱼ Rᵢ c_ij (δⱼ − δᵢ),     Σᵢ tr(Rᵢ Sᵢ) = b · x
//!
//! spokes             c_ij = w_ij (pⱼ − pᵢ)
//! spokes and rims    c_ij = ⅓ Σ_{t ∋ i, j} gⱼᵗ        gₖᵗ = Σ_{l ∈ t} h_kl (pₖ − p_l),   h the half cotangents of t
//! elements           c_tk = gₖᵗ                       (the cell is a triangle, relative to its first corner)
//! ```
//!
//! One pass over the cells gathers `S`, fits `R` to it and scatters `R c`, four cells at a time.

#![allow(clippy::inline_always)] // A kernel is compiled for wide registers only as far as it is inlined.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion};

use super::smoothness::Smoothness;
use crate::mesh::operators::Cotangents;
use crate::surface::lanes::{self, Kernel, LANES, Lanes};
use crate::surface::rotation_fit::{Covariances, Quaternions, fit, matrices, product};
use plumbline_num::math::Lists;

/// The edges with a common rotation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::surface) enum CellKind {
    /// The edges at a vertex (Sorkine & Alexa 2007). Not bounded below with negative weights.
    Spokes,
    /// All edges of the triangles around a vertex (Chao, Pinkall, Sanan, Schröder 2010): non-negative.
    #[default]
    SpokesAndRims,
    /// The edges of one triangle: resists stretching, not bending.
    Elements,
}

impl CellKind {
    /// The factor `q` of the Laplacian in the energy: the number of cells that each term `h_e |e|²` counts for.
    pub(super) fn laplacians(self) -> f64 {
        match self {
            Self::Spokes => 2.0,
            Self::SpokesAndRims | Self::Elements => 1.0,
        }
    }
}

/// `c_ij` and `j`.
#[derive(Clone, Copy, Debug, Default)]
struct Spoke {
    c: [f64; 3],
    vertex: u32,
}

/// All cells of a rest shape, with the rotation last fitted to each.
#[derive(Clone, Debug)]
pub(in crate::surface) struct Cells {
    /// Spokes of cell `i`: `spokes[starts[i]..starts[i + 1]]`; empty cells pad the last group.
    starts: Vec<u32>,
    centers: Vec<u32>,
    spokes: Vec<Spoke>,
    rotations: Vec<Quaternions>,
}

const IDENTITY: Quaternions = [Lanes::ZERO, Lanes::ZERO, Lanes::ZERO, Lanes::splat(1.0)];

impl Cells {
    /// The cells of the rest positions `rest`. Vertex cells are weighted by `bending` and complemented by triangle cells with the
    /// remaining weight.
    pub(in crate::surface) fn new(kind: CellKind, rest: &[Lanes], cotangents: &Cotangents, bending: f64) -> Self {
        let (mut starts, mut centers, mut spokes) = match kind {
            CellKind::Elements => element_cells(rest, cotangents),
            CellKind::Spokes | CellKind::SpokesAndRims => vertex_cells(kind, rest, cotangents),
        };
        if kind != CellKind::Elements && bending < 1.0 {
            let scaled = |spokes: &mut [Spoke], by: f64| spokes.iter_mut().for_each(|s| s.c = s.c.map(|c| c * by));
            let (more_starts, more_centers, mut more_spokes) = element_cells(rest, cotangents);
            scaled(&mut spokes, bending);
            scaled(&mut more_spokes, (1.0 - bending) * kind.laplacians());
            starts.extend(more_starts[1..].iter().map(|s| s + spokes.len() as u32));
            centers.extend(more_centers);
            spokes.extend(more_spokes);
        }
        let groups = centers.len().div_ceil(LANES);
        starts.resize(groups * LANES + 1, spokes.len() as u32);
        centers.resize(groups * LANES, 0);
        Self { starts, centers, spokes, rotations: vec![IDENTITY; groups] }
    }

    /// Fits all rotations to `x`, from the previous ones, and writes the right-hand side `b` of the fitted cells (one entry per
    /// vertex). Returns `Σ tr(R S) = b · x`.
    pub(in crate::surface) fn fit(&mut self, x: &[Lanes], b: &mut [Lanes]) -> f64 {
        b.fill(Lanes::ZERO);
        lanes::run(LocalStep { cells: self, x, b })
    }

    /// Fits all rotations to `x` and to the previous rotations of their neighbors, and writes the right-hand side.
    pub(super) fn fit_smoothly(&mut self, smoothness: &Smoothness, x: &[Lanes], b: &mut [Lanes]) {
        let last = self.rotation_matrices(smoothness.len());
        for group in 0..self.rotations.len() {
            let mut s = self.covariances(group, x);
            for lane in 0..LANES.min(smoothness.len().saturating_sub(LANES * group)) {
                let coupling = smoothness.coupling(LANES * group + lane, &last);
                for (r, c) in (0..9).map(|k| (k / 3, k % 3)) {
                    s[r][c].0[lane] += coupling[(c, r)];
                }
            }
            fit(&s, &mut self.rotations[group]);
        }
        self.right_hand_side(b);
    }

    /// Matrices of the rotations of the first cells.
    pub(super) fn rotation_matrices(&self, cells: usize) -> Vec<Matrix3<f64>> {
        (0..cells).map(|cell| self.rotation(cell).to_rotation_matrix().into_inner()).collect()
    }

    /// Writes the right-hand side of the current rotations.
    pub(super) fn right_hand_side(&self, b: &mut [Lanes]) {
        b.fill(Lanes::ZERO);
        for (group, rotations) in self.rotations.iter().enumerate() {
            self.scatter(group, &matrices(rotations), b);
        }
    }

    /// Inverses of the moments of inertia of the cells at rest, `(tr C I − C)⁻¹` with `C = Σ w e eᵀ`.
    pub(super) fn inertia(&self, rest: &[Lanes]) -> Vec<Inertia> {
        (0..self.rotations.len()).map(|group| inverse_inertia(&self.covariances(group, rest))).collect()
    }

    /// Subtracts from `y` the change of the right-hand side when `x` moves by `p` and the cells rotate with it as rigid bodies:
    /// `R [ω]ₓ c` with `ω = (tr C I − C)⁻¹ Σ c × Rᵀ(pⱼ − pᵢ)`.
    pub(super) fn subtract_rotation_term(&self, inertia: &[Inertia], p: &[Lanes], y: &mut [Lanes]) {
        lanes::run(RotationTerm { cells: self, inertia, p, y });
    }

    /// The rotation of a cell.
    pub(in crate::surface) fn rotation(&self, cell: usize) -> UnitQuaternion<f64> {
        let [i, j, k, w] = self.rotations[cell / LANES].map(|q| q.0[cell % LANES]);
        UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k))
    }

    /// Sets the rotation of a cell.
    pub(super) fn set_rotation(&mut self, cell: usize, rotation: &UnitQuaternion<f64>) {
        for (k, lanes) in self.rotations[cell / LANES].iter_mut().enumerate() {
            lanes.0[cell % LANES] = rotation.coords[k];
        }
    }

    /// Resets all rotations to the identity.
    pub(super) fn reset(&mut self) {
        self.rotations.fill(IDENTITY);
    }

    #[inline(always)]
    fn spokes_of(&self, cell: usize) -> &[Spoke] {
        &self.spokes[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// The covariances of four cells.
    #[inline(always)]
    fn covariances(&self, group: usize, x: &[Lanes]) -> Covariances {
        let mut s = [[Lanes::ZERO; 3]; LANES];
        for (lane, rows) in s.iter_mut().enumerate() {
            let cell = LANES * group + lane;
            let center = x[self.centers[cell] as usize];
            for spoke in self.spokes_of(cell) {
                let d = x[spoke.vertex as usize] - center;
                for (row, &c) in rows.iter_mut().zip(&spoke.c) {
                    *row += Lanes::splat(c) * d;
                }
            }
        }
        std::array::from_fn(|r| std::array::from_fn(|c| Lanes(std::array::from_fn(|lane| s[lane][r].0[c]))))
    }

    /// Adds the terms `R c` of four cells.
    #[inline(always)]
    fn scatter(&self, group: usize, r: &Covariances, b: &mut [Lanes]) {
        for lane in 0..LANES {
            let cell = LANES * group + lane;
            let column = |c: usize| Lanes([r[0][c].0[lane], r[1][c].0[lane], r[2][c].0[lane], 0.0]);
            let columns = [column(0), column(1), column(2)];
            let mut sum = Lanes::ZERO;
            for spoke in self.spokes_of(cell) {
                let [x, y, z] = spoke.c.map(Lanes::splat);
                let term = columns[0] * x + columns[1] * y + columns[2] * z;
                b[spoke.vertex as usize] += term;
                sum += term;
            }
            b[self.centers[cell] as usize] -= sum;
        }
    }
}

struct LocalStep<'a> {
    cells: &'a mut Cells,
    x: &'a [Lanes],
    b: &'a mut [Lanes],
}

impl Kernel for LocalStep<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let mut traces = Lanes::ZERO;
        for group in 0..self.cells.rotations.len() {
            let s = self.cells.covariances(group, self.x);
            let mut rotations = self.cells.rotations[group];
            traces += fit(&s, &mut rotations);
            self.cells.rotations[group] = rotations;
            self.cells.scatter(group, &matrices(&rotations), self.b);
        }
        traces.dot(Lanes::splat(1.0))
    }
}

/// Four symmetric matrices: `xx, yy, zz, xy, xz, yz`.
pub(super) type Inertia = [Lanes; 6];

/// Minimum moment of inertia as a fraction of the largest: that of a collinear cell vanishes about its line.
const MIN_INERTIA: f64 = 1e-9;

fn inverse_inertia(c: &Covariances) -> Inertia {
    let mut inverse = [Lanes::ZERO; 6];
    for lane in 0..LANES {
        let c = Matrix3::from_fn(|i, j| 0.5 * (c[i][j].0[lane] + c[j][i].0[lane]));
        let inertia = Matrix3::identity() * c.trace() - c;
        let floor = (MIN_INERTIA * inertia.amax()).max(f64::MIN_POSITIVE);
        let eigen = inertia.symmetric_eigen();
        let inverted = eigen.eigenvalues.map(|m| 1.0 / m.max(floor));
        let m = eigen.eigenvectors * Matrix3::from_diagonal(&inverted) * eigen.eigenvectors.transpose();
        let entries = [m.m11, m.m22, m.m33, m.m12, m.m13, m.m23];
        for (inverse, entry) in inverse.iter_mut().zip(entries) {
            inverse.0[lane] = if entry.is_finite() { entry } else { 0.0 };
        }
    }
    inverse
}

struct RotationTerm<'a> {
    cells: &'a Cells,
    inertia: &'a [Inertia],
    p: &'a [Lanes],
    y: &'a mut [Lanes],
}

impl Kernel for RotationTerm<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (group, [xx, yy, zz, xy, xz, yz]) in self.inertia.iter().enumerate() {
            let r = matrices(&self.cells.rotations[group]);
            // M = δS R = Σ c (Rᵀ d)ᵀ
            let m = product(&self.cells.covariances(group, self.p), &r);
            let a = [m[1][2] - m[2][1], m[2][0] - m[0][2], m[0][1] - m[1][0]];
            let omega = [
                *xx * a[0] + *xy * a[1] + *xz * a[2],
                *xy * a[0] + *yy * a[1] + *yz * a[2],
                *xz * a[0] + *yz * a[1] + *zz * a[2],
            ];
            // −R [ω]ₓ: each row of R crossed with ω, since rᵀ(ω × c) = (r × ω)ᵀ c.
            let rotated = r.map(|[x, y, z]| {
                [z * omega[1] - y * omega[2], x * omega[2] - z * omega[0], y * omega[0] - x * omega[1]]
            });
            self.cells.scatter(group, &rotated, self.y);
        }
    }
}

/// `gₖ = Σ_l h_kl (pₖ − p_l)` of a triangle's corners.
fn corner_gradients(rest: &[Lanes], v: &[u32; 3], h: &[f64; 3]) -> [[f64; 3]; 3] {
    let edge =
        |k: usize, l: usize, opposite: usize| (rest[v[k] as usize] - rest[v[l] as usize]) * Lanes::splat(h[opposite]);
    let (ab, bc, ca) = (edge(0, 1, 2), edge(1, 2, 0), edge(2, 0, 1));
    [(ab - ca).xyz(), (bc - ab).xyz(), (ca - bc).xyz()]
}

/// Starts, centers and spokes of cells.
type CellLists = (Vec<u32>, Vec<u32>, Vec<Spoke>);

fn element_cells(rest: &[Lanes], cotangents: &Cotangents) -> CellLists {
    let triangles = cotangents.triangles();
    let spokes = triangles.iter().zip(cotangents.half()).flat_map(|(v, h)| {
        let [_, second, third] = corner_gradients(rest, v, h);
        [Spoke { c: second, vertex: v[1] }, Spoke { c: third, vertex: v[2] }]
    });
    let starts = (0..=triangles.len()).map(|t| 2 * t as u32).collect();
    (starts, triangles.iter().map(|v| v[0]).collect(), spokes.collect())
}

fn vertex_cells(kind: CellKind, rest: &[Lanes], cotangents: &Cotangents) -> CellLists {
    let vertices = rest.len();
    // Every triangle contributes two spokes per corner; those of the same edge are merged.
    let of_triangle = |(v, h): (&[u32; 3], &[f64; 3])| {
        let (v, h, g) = (*v, *h, corner_gradients(rest, v, h));
        (0..3).flat_map(move |i| {
            let [j, k] = [(i + 1) % 3, (i + 2) % 3];
            [(j, h[k]), (k, h[j])].map(|(other, weight)| {
                let c = match kind {
                    CellKind::Spokes => spoke(rest, v[i], v[other], weight),
                    _ => g[other].map(|g| g / 3.0),
                };
                (v[i], Spoke { c, vertex: v[other] })
            })
        })
    };
    let mut all = Lists::new(vertices, cotangents.triangles().iter().zip(cotangents.half()).flat_map(of_triangle));
    let mut spokes = Vec::with_capacity(all.items().len() / 2 + vertices);
    let mut merged_starts = Vec::with_capacity(vertices + 1);
    merged_starts.push(0);
    for i in 0..vertices {
        let row = all.of_mut(i);
        row.sort_by_key(|s| s.vertex);
        for of_edge in row.chunk_by(|a, b| a.vertex == b.vertex).filter(|s| s[0].vertex as usize != i) {
            let c = of_edge.iter().fold([0.0; 3], |sum, s| std::array::from_fn(|k| sum[k] + s.c[k]));
            spokes.push(Spoke { c, vertex: of_edge[0].vertex });
        }
        merged_starts.push(spokes.len() as u32);
    }
    (merged_starts, (0..vertices as u32).collect(), spokes)
}

/// `w (pⱼ − pᵢ)`.
fn spoke(rest: &[Lanes], i: u32, j: u32, w: f64) -> [f64; 3] {
    ((rest[j as usize] - rest[i as usize]) * Lanes::splat(w)).xyz()
}
