//! The Hessian of the ARAP energy at the rest shape.
//!
//! Cell `i` has the triangles around vertex `i`; with displacements `d` of the vertices and a small rotation `c_i` of each cell
//!
//! ```text
//! E(d) = ⅓ Σ_i min_{c_i} Σ_{ab ∈ cell i} w_ab ‖d_a − d_b − c_i × e_ab‖²      e_ab = p_a − p_b,  w_ab half a cotangent
//!      = dᵀ H d,       H = L ⊗ I − ⅓ Σ_i B_iᵀ C_i⁺ B_i
//! C_i  = Σ w (‖e‖² I − e eᵀ),     B_i d = Σ w e × (d_a − d_b).
//! ```
//!
//! Equation 6 of the paper has `Σ w e eᵀ` for `C_i`, a misprint for the sum of `[e]ₓ [e]ₓᵀ`. Departure: the paper's cells are
//! spokes; with rims the three edges of a triangle give a positive semidefinite form whatever its angles.

use std::sync::Arc;

use nalgebra::{Matrix3, Matrix6, SymmetricEigen, Vector3};

use crate::mesh::TriMesh;
use crate::mesh::operators::{Cotangents, Forming, max_multiplications};
use plumbline_num::math::Lists;
use plumbline_num::optim::lanczos::KnownVectors;
use plumbline_num::run::Run;
use plumbline_num::sparse::{FactorStructure, Ordering, Pattern, SparseError, SparseMatrix};
use plumbline_num::spatial::numbered_components;

/// Eigenvalues of `C_i` below this fraction of the largest are treated as 0: the rotation of a collinear cell about its line.
const RANK_TOLERANCE: f64 = 1e-12;

/// `B_i` of one cell, by vertex, with `C_i⁺`.
struct Cell {
    vertices: Vec<u32>,
    blocks: Vec<Matrix3<f64>>,
    inverse: Matrix3<f64>,
}

/// `H` over the coordinates `3 v + k` of the vertices, symmetric, positive semidefinite; without unit. Refused where its factor in this
/// order of the vertices would be out of proportion to the surface.
pub(super) fn hessian(
    mesh: &TriMesh,
    cotangents: &Cotangents,
    order: &Ordering,
    run: &Run,
) -> Result<SparseMatrix, SparseError> {
    let cells = cells(mesh, cotangents);
    run.check()?;
    check_cells(&cells)?;
    let blocks = Pattern::new(cells.len(), cells.iter().flat_map(|cell| pairs(&cell.vertices)))?;
    run.check()?;
    // Of each entry of the factor over vertices there are 3 × 3.
    let most = max_multiplications(3 * cells.len());
    let flops = 27.0 * FactorStructure::new(&blocks, order)?.flops();
    if flops > most {
        return Err(blocks.too_dense(flops, most));
    }
    run.check()?;
    let entries = blocks
        .entries()
        .flat_map(|(a, b, _)| (0..9).map(move |k| (3 * a + k % 3, 3 * b + k / 3)).filter(|(row, col)| row >= col));
    let mut h = SparseMatrix::zeros(Arc::new(Pattern::new(3 * cells.len(), entries)?));
    drop(blocks);
    run.check()?;
    for (a, b, w) in cotangents.edges().flatten().filter(|(a, b, _)| a != b) {
        let spring = Matrix3::identity() * w;
        add(&mut h, a, a, &spring);
        add(&mut h, b, b, &spring);
        add(&mut h, a.max(b), a.min(b), &-spring);
    }
    for cell in &cells {
        run.check()?;
        for (m, &a) in cell.vertices.iter().enumerate() {
            let left = cell.blocks[m].transpose() * cell.inverse / -3.0;
            for (n, &b) in cell.vertices.iter().enumerate().filter(|&(_, &b)| b <= a) {
                add(&mut h, a, b, &(left * cell.blocks[n]));
            }
        }
    }
    Ok(h)
}

/// Refuses cells whose vertices, each with each other, have more blocks than a surface.
fn check_cells(cells: &[Cell]) -> Result<(), SparseError> {
    let size = |cell: &Cell| cell.vertices.len();
    let Some((vertex, densest)) = cells.iter().enumerate().max_by_key(|(_, cell)| size(cell)) else { return Ok(()) };
    let neighbors = size(densest).saturating_sub(1);
    let forming = Forming { unknowns: 3 * cells.len(), per_vertex: 3, vertex, neighbors };
    forming.check_clique()?;
    forming.check_entries(cells.iter().map(|cell| 9 * size(cell) * (size(cell) + 1) / 2).sum())
}

/// Pairs `a ≥ b` of a list.
fn pairs(vertices: &[u32]) -> impl Iterator<Item = (usize, usize)> + '_ {
    vertices
        .iter()
        .flat_map(move |&a| vertices.iter().filter(move |&&b| b <= a).map(move |&b| (a as usize, b as usize)))
}

/// Adds a 3 × 3 block at rows of `a` and columns of `b ≤ a`.
fn add(h: &mut SparseMatrix, a: u32, b: u32, block: &Matrix3<f64>) {
    for col in 0..3 {
        let first = if a == b { col } else { 0 };
        let slot = h.pattern().slot(3 * a as usize + first, 3 * b as usize + col);
        let slot = slot.expect("the pattern has every pair of a cell");
        for row in first..3 {
            h.values_mut()[slot + row - first] += block[(row, col)];
        }
    }
}

fn cells(mesh: &TriMesh, cotangents: &Cotangents) -> Vec<Cell> {
    let corners = (0..).zip(cotangents.triangles()).flat_map(|(t, corners)| corners.map(|v| (v, t)));
    let around = Lists::new(mesh.vertex_count(), corners);
    let edges: Vec<_> = cotangents.edges().collect();
    let position = |v: u32| mesh.positions()[v as usize];
    let cell = |triangles: &[u32]| {
        let of_cell = || triangles.iter().flat_map(|&t| edges[t as usize]);
        let mut vertices: Vec<u32> = of_cell().map(|(a, _, _)| a).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let number = |v: u32| vertices.binary_search(&v).expect("the end of every edge is the start of another one");
        let (mut blocks, mut inertia) = (vec![Matrix3::zeros(); vertices.len()], Matrix3::zeros());
        for (a, b, w) in of_cell() {
            let e: Vector3<f64> = position(a) - position(b);
            inertia += (Matrix3::identity() * e.norm_squared() - e * e.transpose()) * w;
            let block = e.cross_matrix() * w;
            blocks[number(a)] += block;
            blocks[number(b)] -= block;
        }
        Cell { blocks, inverse: pseudo_inverse(&inertia), vertices }
    };
    around.iter().map(cell).collect()
}

/// `C⁺` of a positive semidefinite matrix.
fn pseudo_inverse(c: &Matrix3<f64>) -> Matrix3<f64> {
    let eigen = SymmetricEigen::new(*c);
    let largest = eigen.eigenvalues.amax();
    let inverse = eigen.eigenvalues.map(|v| if v > RANK_TOLERANCE * largest { 1.0 / v } else { 0.0 });
    eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

/// Displacements of the six infinitesimal rigid motions of each connected component, not orthogonalized: translations, and
/// rotations about the centroid of its vertices.
pub(super) fn rigid_motions(mesh: &TriMesh) -> Vec<KnownVectors> {
    let (component, count) = numbered_components(mesh.vertex_count(), mesh.triangles());
    let mut centroids = vec![(Vector3::zeros(), 0.0); count];
    for (&c, p) in component.iter().zip(mesh.positions()) {
        let (sum, count) = &mut centroids[c as usize];
        *sum += p.coords;
        *count += 1.0;
    }
    let mut motions = vec![KnownVectors { support: Vec::new(), vectors: vec![Vec::new(); 6] }; count];
    for (v, p) in mesh.positions().iter().enumerate() {
        let k = component[v] as usize;
        let arm = p.coords - centroids[k].0 / centroids[k].1;
        let mut both = Matrix6::zeros();
        both.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        both.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
        motions[k].support.extend((0..3).map(|row| (3 * v + row) as u32));
        for (motion, values) in motions[k].vectors.iter_mut().enumerate() {
            values.extend((0..3).map(|row| both[(row, motion)]));
        }
    }
    motions
}
