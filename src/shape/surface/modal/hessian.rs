//! The quadratic form that the ARAP energy is near the rest shape.
//!
//! Cell `i` holds the triangles around vertex `i`; with displacements `d` of the vertices and a small turn `c_i` of each cell
//!
//! ```text
//! E(d) = ⅓ Σ_i min_{c_i} Σ_{ab ∈ cell i} w_ab ‖d_a − d_b − c_i × e_ab‖²      e_ab = p_a − p_b,  w_ab half a cotangent
//!      = dᵀ H d,       H = L ⊗ I − ⅓ Σ_i B_iᵀ C_i⁺ B_i
//! C_i  = Σ w (‖e‖² I − e eᵀ),     B_i d = Σ w e × (d_a − d_b).
//! ```
//!
//! (Equation 6 of the paper has `Σ w e eᵀ` for `C_i`, a slip: the sum is of `[e]ₓ [e]ₓᵀ`.) The paper's cells are spokes; with
//! the rims, as here, three edges of a triangle stand together and no form is negative whatever its angles are.

use std::sync::Arc;

use nalgebra::{Matrix3, Matrix6, SymmetricEigen, Vector3};

use crate::mesh::TriMesh;
use crate::mesh::operators::Cotangents;
use plumbline_num::sparse::{Pattern, SparseError, SparseMatrix};

/// Eigenvalues of `C_i` below this share of the greatest are none: cells that are a line turn freely about it.
const NO_TURN: f64 = 1e-12;

/// `B_i` of one cell, by vertex, with `C_i⁺`.
struct Cell {
    vertices: Vec<u32>,
    pulls: Vec<Matrix3<f64>>,
    inverse: Matrix3<f64>,
}

/// `H` over the coordinates `3 v + k` of the vertices, symmetric, positive semidefinite; without unit.
pub(super) fn hessian(mesh: &TriMesh, cotangents: &Cotangents) -> Result<SparseMatrix, SparseError> {
    let cells = cells(mesh, cotangents);
    let blocks = cells.iter().flat_map(|cell| pairs(&cell.vertices));
    let entries = blocks.flat_map(|(a, b)| {
        (0..9).map(move |k| (3 * a as usize + k % 3, 3 * b as usize + k / 3)).filter(|(row, col)| row >= col)
    });
    let mut blocks: Vec<(usize, usize)> = entries.collect();
    blocks.sort_unstable();
    blocks.dedup();
    let mut h = SparseMatrix::zeros(Arc::new(Pattern::new(3 * mesh.vertex_count(), blocks)?));
    for (a, b, w) in cotangents.edges().flatten().filter(|(a, b, _)| a != b) {
        let spring = Matrix3::identity() * w;
        add(&mut h, a, a, &spring);
        add(&mut h, b, b, &spring);
        add(&mut h, a.max(b), a.min(b), &-spring);
    }
    for cell in &cells {
        for (m, &a) in cell.vertices.iter().enumerate() {
            let left = cell.pulls[m].transpose() * cell.inverse / -3.0;
            for (n, &b) in cell.vertices.iter().enumerate().filter(|&(_, &b)| b <= a) {
                add(&mut h, a, b, &(left * cell.pulls[n]));
            }
        }
    }
    Ok(h)
}

/// Pairs `a ≥ b` of a list.
fn pairs(vertices: &[u32]) -> impl Iterator<Item = (u32, u32)> + '_ {
    vertices.iter().flat_map(move |&a| vertices.iter().filter(move |&&b| b <= a).map(move |&b| (a, b)))
}

/// Adds a 3 × 3 block at rows of `a` and columns of `b ≤ a`.
fn add(h: &mut SparseMatrix, a: u32, b: u32, block: &Matrix3<f64>) {
    for col in 0..3 {
        let first = if a == b { col } else { 0 };
        let slot = h.pattern().slot(3 * a as usize + first, 3 * b as usize + col);
        let slot = slot.expect("the pattern holds every pair of a cell");
        for row in first..3 {
            h.values_mut()[slot + row - first] += block[(row, col)];
        }
    }
}

fn cells(mesh: &TriMesh, cotangents: &Cotangents) -> Vec<Cell> {
    let mut around = vec![Vec::new(); mesh.vertex_count()];
    for (t, corners) in cotangents.triangles().iter().enumerate() {
        for &v in corners {
            around[v as usize].push(t as u32);
        }
    }
    let edges: Vec<_> = cotangents.edges().collect();
    let place = |v: u32| mesh.positions()[v as usize];
    let cell = |triangles: &Vec<u32>| {
        let of_cell = || triangles.iter().flat_map(|&t| edges[t as usize]);
        let mut vertices: Vec<u32> = of_cell().map(|(a, _, _)| a).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let number = |v: u32| vertices.binary_search(&v).expect("every edge's end starts another edge");
        let (mut pulls, mut turning) = (vec![Matrix3::zeros(); vertices.len()], Matrix3::zeros());
        for (a, b, w) in of_cell() {
            let e: Vector3<f64> = place(a) - place(b);
            turning += (Matrix3::identity() * e.norm_squared() - e * e.transpose()) * w;
            let pull = e.cross_matrix() * w;
            pulls[number(a)] += pull;
            pulls[number(b)] -= pull;
        }
        Cell { pulls, inverse: pseudo_inverse(&turning), vertices }
    };
    around.iter().map(cell).collect()
}

/// `C⁺` of a positive semidefinite matrix.
fn pseudo_inverse(c: &Matrix3<f64>) -> Matrix3<f64> {
    let eigen = SymmetricEigen::new(*c);
    let most = eigen.eigenvalues.amax();
    let inverse = eigen.eigenvalues.map(|v| if v > NO_TURN * most { 1.0 / v } else { 0.0 });
    eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

/// Displacements of the rigid motions of each connected part, six for a part that is no line, not yet orthogonal: shifts,
/// and turns about the part's middle.
pub(super) fn rigid_motions(mesh: &TriMesh, part: &[u32]) -> Vec<Vec<f64>> {
    let mut parts: Vec<u32> = part.to_vec();
    parts.sort_unstable();
    parts.dedup();
    let number = |v: usize| parts.binary_search(&part[v]).expect("every part is listed");
    let mut middles = vec![(Vector3::zeros(), 0.0); parts.len()];
    for (v, p) in mesh.positions().iter().enumerate() {
        let (sum, count) = &mut middles[number(v)];
        *sum += p.coords;
        *count += 1.0;
    }
    let mut motions = vec![vec![0.0; 3 * part.len()]; 6 * parts.len()];
    for (v, p) in mesh.positions().iter().enumerate() {
        let k = number(v);
        let arm = p.coords - middles[k].0 / middles[k].1;
        let mut both = Matrix6::zeros();
        both.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        both.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
        for motion in 0..6 {
            for row in 0..3 {
                motions[6 * k + motion][3 * v + row] = both[(row, motion)];
            }
        }
    }
    motions
}
