//! Intrinsic Delaunay triangulation by edge flips *in the surface*, not in space.
//!
//! Two triangles with a common edge unfold into a planar quadrilateral; where the angles opposite the edge sum to more than π,
//! the other diagonal replaces it. Only edge lengths and connectivity change; the metric of the surface does not. Every flip
//! lowers the harmonic index, hence the algorithm terminates; at its end every cotangent weight in the interior is ≥ 0. A
//! boundary edge cannot be flipped and keeps a negative weight if the angle opposite it is obtuse.
//!
//! # Reference
//! A. I. Bobenko, B. A. Springborn, *A discrete Laplace–Beltrami operator for simplicial surfaces*, Discrete &
//! Computational Geometry 38 (2007); M. Fisher, B. Springborn, P. Schröder, A. I. Bobenko, *An algorithm for the
//! construction of intrinsic Delaunay triangulations*, Computing 81 (2007).

use crate::mesh::{HalfEdges, edge_groups};

/// Tolerance of the Delaunay test: an edge is flipped if its weight is below minus this value, so that rounding does not flip
/// the diagonals of cocircular corners back and forth.
const NEGATIVE: f64 = 1e-11;

/// Maximum number of flips per half-edge of the mesh; a tenth is typical. A guard against endless flips by rounding.
const FLIPS_PER_EDGE: usize = 50;

/// Null index: a boundary edge, or one that must not be flipped. `u32::MAX` is no valid half-edge.
const BORDER: u32 = u32::MAX;

/// Triangles and squared edge lengths (opposite each corner) of the intrinsic Delaunay triangulation.
pub(super) fn flipped(triangles: &[[u32; 3]], squared_edges: Vec<[f64; 3]>) -> (Vec<[u32; 3]>, Vec<[f64; 3]>) {
    let mut surface = Surface { corners: triangles.to_vec(), squared: squared_edges, across: glue(triangles) };
    let mut stack: Vec<(u32, u8)> = (0..triangles.len() as u32).flat_map(|t| (0..3).map(move |k| (t, k))).collect();
    let mut left = FLIPS_PER_EDGE * stack.len();
    while let Some((t, k)) = stack.pop() {
        if left > 0 && surface.flip(t as usize, k as usize, &mut stack) {
            left -= 1;
        }
    }
    (surface.corners, surface.squared)
}

/// Intrinsic triangulation: vertices, squared edge lengths and adjacency of the triangles.
struct Surface {
    corners: Vec<[u32; 3]>,
    squared: Vec<[f64; 3]>,
    /// Corner `3 t + k` opposite the same edge in the adjacent triangle, or [`BORDER`]. Symmetric: `across[across[s]] = s`.
    across: Vec<[u32; 3]>,
}

/// Adjacency over the edges with exactly two incident triangles that traverse the edge in opposite directions.
fn glue(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let origins = triangles.as_flattened();
    let mut across = vec![[BORDER; 3]; triangles.len()];
    let opposite = across.as_flattened_mut();
    for edge in edge_groups(origins).iter() {
        if let &[(_, g), (_, h)] = edge
            && g / 3 != h / 3
            && origins[g as usize] != origins[h as usize]
        {
            let (a, b) = (HalfEdges::previous(g), HalfEdges::previous(h));
            (opposite[a as usize], opposite[b as usize]) = (b, a);
        }
    }
    across
}

impl Surface {
    /// `½ cot` of the angle at a corner, with the area by Heron's formula; not finite where the triangle is degenerate.
    fn half_cotangent(&self, t: usize, k: usize) -> f64 {
        let [a, b, c] = [self.squared[t][k], self.squared[t][(k + 1) % 3], self.squared[t][(k + 2) % 3]];
        let sixteen_area_squared = 4.0 * b * c - (b + c - a).powi(2);
        0.5 * (b + c - a) / sixteen_area_squared.max(0.0).sqrt()
    }

    /// Flips the edge opposite corner `k` of triangle `t` if its weight is negative, and pushes the four outer edges to the
    /// stack. Returns whether it was flipped.
    fn flip(&mut self, t: usize, k: usize, stack: &mut Vec<(u32, u8)>) -> bool {
        let other = self.across[t][k];
        if other == BORDER {
            return false;
        }
        let (u, l) = (other as usize / 3, other as usize % 3);
        if u == t || !(self.half_cotangent(t, k) + self.half_cotangent(u, l) < -NEGATIVE) {
            return false;
        }
        let (k1, k2, l1, l2) = ((k + 1) % 3, (k + 2) % 3, (l + 1) % 3, (l + 2) % 3);
        // t = (a, b, c) and u = (d, c, b) become (a, b, d) and (a, d, c).
        let ([a, b, c], d) = ([self.corners[t][k], self.corners[t][k1], self.corners[t][k2]], self.corners[u][l]);
        // Squared lengths of the four outer edges, and of the new diagonal.
        let (ab, ac) = (self.squared[t][k2], self.squared[t][k1]);
        let (bd, cd) = (self.squared[u][l1], self.squared[u][l2]);
        let ad = other_diagonal(self.squared[t][k], [ab, ac], [bd, cd]);
        // Adjacency of the outer edges, read before the tables are overwritten.
        let (past_ab, past_ac) = (self.across[t][k2], self.across[t][k1]);
        let (past_bd, past_cd) = (self.across[u][l1], self.across[u][l2]);
        (self.corners[t], self.squared[t]) = ([a, b, d], [bd, ad, ab]);
        (self.corners[u], self.squared[u]) = ([a, d, c], [cd, ac, ad]);
        let (t, u) = (t as u32, u as u32);
        self.join(3 * t, past_bd);
        self.join(3 * t + 2, past_ab);
        self.join(3 * u, past_cd);
        self.join(3 * u + 1, past_ac);
        self.join(3 * t + 1, 3 * u + 2);
        stack.extend([(t, 0), (t, 2), (u, 0), (u, 1)]);
        true
    }

    /// Makes two sides adjacent, in both directions.
    fn join(&mut self, side: u32, other: u32) {
        self.across[side as usize / 3][side as usize % 3] = other;
        if other != BORDER {
            self.across[other as usize / 3][other as usize % 3] = side;
        }
    }
}

/// Squared length of the other diagonal `ad` of two triangles unfolded about their common edge `bc`; all arguments are squared
/// lengths.
fn other_diagonal(bc: f64, [ab, ac]: [f64; 2], [bd, cd]: [f64; 2]) -> f64 {
    let foot = |to_b: f64, to_c: f64| 0.5 * (bc + to_b - to_c) / bc.sqrt();
    let (xa, xd) = (foot(ab, ac), foot(bd, cd));
    let height = |to_b: f64, x: f64| (to_b - x * x).max(0.0).sqrt();
    (xa - xd).powi(2) + (height(ab, xa) + height(bd, xd)).powi(2)
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use crate::mesh::TriMesh;
    use crate::mesh::operators::{CotangentRule, Cotangents, EdgeWeights};

    /// A flat grid whose squares are cut and then sheared, so that most diagonals are the long ones.
    fn sheared_grid(n: usize) -> TriMesh {
        let positions = (0..n * n).map(|v| {
            let (x, y) = ((v % n) as f64, (v / n) as f64);
            Point3::new(x + 2.3 * y, y, 0.0)
        });
        let cell = |x: usize, y: usize| {
            let v = (y * n + x) as u32;
            let m = n as u32;
            [[v, v + 1, v + m + 1], [v, v + m + 1, v + m]]
        };
        let triangles = (0..n - 1).flat_map(|y| (0..n - 1).flat_map(move |x| cell(x, y))).collect();
        TriMesh::new(positions.collect(), triangles).unwrap()
    }

    #[test]
    fn weights_are_not_negative_and_the_laplacian_still_knows_linear_functions() {
        let mesh = sheared_grid(9);
        let inside = |v: usize| (1..8).contains(&(v % 9)) && (1..8).contains(&(v / 9));
        let raw = EdgeWeights::cotangent(81, &Cotangents::new(&mesh, CotangentRule::Raw));
        assert!(raw.negative() > 50);
        let cotangents = Cotangents::new(&mesh, CotangentRule::IntrinsicDelaunay);
        let weights = EdgeWeights::cotangent(81, &cotangents);
        assert!(weights.iter().all(|(i, j, w)| w > -1e-9 || !inside(i) && !inside(j)));
        assert_eq!(cotangents.triangles().len(), mesh.triangle_count());
        let x: Vec<f64> = mesh.positions().iter().map(|p| 3.0 * p.x - p.y).collect();
        let mut lx = vec![0.0; 81];
        weights.laplacian().unwrap().multiply(&x, &mut lx);
        assert!((0..81).filter(|&v| inside(v)).all(|v| lx[v].abs() < 1e-12));
    }

    #[test]
    fn what_is_delaunay_stays_as_it_is() {
        let positions = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 1.7, 0.0], [3.0, 1.7, 0.5]];
        let mesh = TriMesh::new(positions.map(Point3::from).to_vec(), vec![[0, 1, 2], [1, 3, 2]]).unwrap();
        let cotangents = Cotangents::new(&mesh, CotangentRule::IntrinsicDelaunay);
        assert_eq!(cotangents.triangles(), mesh.triangles());
    }

    #[test]
    fn edges_of_three_triangles_and_of_clashing_ones_are_left_alone() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.1, 0.0], [0.5, -0.1, 0.0], [0.5, 0.0, 0.1]];
        let positions = positions.map(Point3::from).to_vec();
        for triangles in [vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]], vec![[0, 1, 2], [0, 1, 3]]] {
            let mesh = TriMesh::new(positions.clone(), triangles.clone()).unwrap();
            assert_eq!(Cotangents::new(&mesh, CotangentRule::IntrinsicDelaunay).triangles(), triangles);
        }
    }
}
