//! The surface whose triangles are mapped as given, as nearly as they can be joined:
//!
//! ```text
//! x = argmin Σ_t Σ_{edges of t} ½ cot · |(x_a − x_b) − D_t (p_a − p_b)|²
//! ```
//!
//! The Laplacian leaves each piece of the surface free to move; it is set so that its middle is that of given places. One vertex
//! of each piece gets a weight of its own in the factor, which changes no shape: the right-hand sides sum to zero.

use nalgebra::{Matrix3, Point3, Vector3};

use super::super::CharacterError;
use crate::mesh::operators::{CotangentRule, Cotangents, EdgeWeights, barycentric_areas};
use crate::mesh::{TriMesh, UnionFind};
use crate::sparse::{Cholesky, CompactFactor, Ordering};

/// The factored Laplacian.
#[derive(Clone, Debug)]
pub(super) struct SurfaceOfGradients {
    rest: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
    half: Vec<[f64; 3]>,
    piece: Vec<u32>,
    /// Share of each vertex in the middle of its piece.
    share: Vec<f64>,
    factor: CompactFactor,
    right: Vec<[f64; 3]>,
}

impl SurfaceOfGradients {
    pub(super) fn new(mesh: &TriMesh) -> Result<Self, CharacterError> {
        let cotangents = Cotangents::new(mesh, CotangentRule::Raw).limited(LARGEST);
        let edges = EdgeWeights::cotangent(mesh.vertex_count(), &cotangents);
        let mut laplacian = edges.laplacian()?;
        let piece = pieces(&edges);
        let starts = laplacian.pattern().column_starts().to_vec();
        let mut seen = vec![false; piece.len()];
        for (v, &p) in piece.iter().enumerate() {
            if !std::mem::replace(&mut seen[p as usize], true) {
                laplacian.values_mut()[starts[v] as usize] += 1.0;
            }
        }
        let mut cholesky = Cholesky::analyze(laplacian.pattern(), &Ordering::Amd)?;
        cholesky.factor(&laplacian)?;
        Ok(Self {
            rest: mesh.positions().to_vec(),
            triangles: mesh.triangles().to_vec(),
            half: cotangents.half().to_vec(),
            share: shares(&barycentric_areas(mesh), &piece),
            right: vec![[0.0; 3]; piece.len()],
            piece,
            factor: CompactFactor::new(&cholesky),
        })
    }

    /// The positions for a map per triangle, each piece about the middle that it has in `places`.
    pub(super) fn solve(&mut self, gradients: &[Matrix3<f64>], places: &[Point3<f64>]) -> Vec<Point3<f64>> {
        let mut x = self.shape(|t| gradients[t]);
        let mut shift = vec![Vector3::zeros(); x.len()];
        for (v, (x, place)) in x.iter().zip(places).enumerate() {
            shift[self.piece[v] as usize] += self.share[v] * (place - x);
        }
        for (x, p) in x.iter_mut().zip(&self.piece) {
            *x += shift[*p as usize];
        }
        x
    }

    /// The positions up to where the pieces are.
    pub(super) fn shape(&mut self, gradient: impl Fn(usize) -> Matrix3<f64>) -> Vec<Point3<f64>> {
        self.right.fill([0.0; 3]);
        for (t, (corners, half)) in self.triangles.iter().zip(&self.half).enumerate() {
            let map = gradient(t);
            for (k, h) in half.iter().enumerate() {
                let (a, b) = (corners[(k + 1) % 3] as usize, corners[(k + 2) % 3] as usize);
                let edge = map * (self.rest[a] - self.rest[b]) * *h;
                for c in 0..3 {
                    self.right[a][c] += edge[c];
                    self.right[b][c] -= edge[c];
                }
            }
        }
        self.factor.solve_3(&mut self.right);
        self.right.iter().map(|x| Point3::from(*x)).collect()
    }

    /// Places less the middles of their pieces.
    pub(super) fn centered(&self, x: &[Point3<f64>]) -> Vec<Vector3<f64>> {
        let mut middle = vec![Vector3::zeros(); x.len()];
        for (v, x) in x.iter().enumerate() {
            middle[self.piece[v] as usize] += self.share[v] * x.coords;
        }
        x.iter().zip(&self.piece).map(|(x, &p)| x.coords - middle[p as usize]).collect()
    }

    /// Adds the middles of pieces in `places`.
    pub(super) fn placed(&self, x: &mut [Point3<f64>], places: &[Point3<f64>]) {
        let mut middle = vec![Vector3::zeros(); x.len()];
        for (v, place) in places.iter().enumerate() {
            middle[self.piece[v] as usize] += self.share[v] * place.coords;
        }
        x.iter_mut().zip(&self.piece).for_each(|(x, &p)| *x += middle[p as usize]);
    }
}

/// Half cotangents at most: needles of 1:2000 keep theirs.
const LARGEST: f64 = 1e3;

/// Lowest vertex of each vertex's piece.
fn pieces(edges: &EdgeWeights) -> Vec<u32> {
    let mut sets = UnionFind::new(edges.vertex_count());
    for &[i, j] in edges.edges() {
        sets.join(i, j);
    }
    sets.roots()
}

/// Areas over those of the pieces; the same for all vertices of a piece without area.
fn shares(areas: &[f64], piece: &[u32]) -> Vec<f64> {
    let (mut total, mut count) = (vec![0.0; areas.len()], vec![0.0; areas.len()]);
    for (a, &p) in areas.iter().zip(piece) {
        total[p as usize] += a;
        count[p as usize] += 1.0;
    }
    let share =
        |(a, &p): (&f64, &u32)| if total[p as usize] > 0.0 { a / total[p as usize] } else { 1.0 / count[p as usize] };
    areas.iter().zip(piece).map(share).collect()
}
