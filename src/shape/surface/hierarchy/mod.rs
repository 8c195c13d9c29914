//! A multiresolution hierarchy of a mesh by vertex removal, with prolongation of deformations.
//!
//! Level 0 is the mesh; each level has about a quarter of the vertices of the finer one. Vertices are removed by half-edge
//! collapses `u → v` in passes: each pass removes an independent set of vertices of least cost, so that the one-ring of each is
//! complete when it is removed and when it is reinserted. Its position is prolonged from the one-ring in a local frame:
//!
//! ```text
//! x_u′ = x_u + Σ w_j (x_j′ − x_j) + (R_u − I)(x_u − Σ w_j x_j)
//! R_u  = nearest rotation to  Σ w_j (x_j′ − x̄′)(x_j − x̄)ᵀ / Σ w_j ‖x_j − x̄‖²  +  ε Σ w_j R_j
//! ```
//!
//! with mean value weights `w` (sum 1). Prolongation reproduces the rest shape, rigid motions, and linear maps of a plane; details
//! rotate with the surface below them. The second term of `R_u` decides where the ring is collinear.
//!
//! # Reference
//! J. Manson, S. Schaefer, *Hierarchical deformation of locally rigid meshes*, Computer Graphics Forum 30 (2011);
//! M. Garland, P. Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997; M. Floater, *Mean value
//! coordinates*, CAGD 20 (2003).

mod collapse;
mod quadric;

use nalgebra::{Matrix3, Point3, Vector3};

use crate::mesh::TriMesh;
use collapse::Collapser;
use plumbline_num::math::nearest_rotation;
use plumbline_num::run::{Run, Stopped};

/// Ratio of the vertex counts of successive levels. Smaller values give more levels to solve, larger ones worse initial guesses.
const RATIO: f64 = 4.0;
/// Fraction of the vertices, in order of cost, that a pass considers. With all of them costly vertices are removed while cheaper
/// ones are blocked by neighbors; small fractions need many passes.
const CANDIDATE_FRACTION: f64 = 0.6;
/// Maximum ratio of the vertex counts of a level and the next finer one.
const MAX_LEVEL_RATIO: f64 = 0.8;
/// ε: small, so that a non-collinear ring determines its rotation; a collinear one needs any positive value.
const INHERITED_WEIGHT: f64 = 0.1;

/// A removed vertex, and the range of its neighbors in `Step::ring`.
#[derive(Clone, Debug)]
struct Removal {
    vertex: u32,
    ring: std::ops::Range<u32>,
}

/// The removals between two levels; indices are those of the finer one.
#[derive(Clone, Debug, Default)]
struct Step {
    /// Fine index of each vertex of the coarser level.
    kept: Vec<u32>,
    /// In the order of removal.
    removals: Vec<Removal>,
    /// Neighbors at the time of removal, and their weights (sum 1).
    ring: Vec<(u32, f64)>,
}

/// A multiresolution hierarchy of a mesh.
#[derive(Clone, Debug)]
pub struct Hierarchy {
    meshes: Vec<TriMesh>,
    vertices: Vec<Vec<u32>>,
    steps: Vec<Step>,
}

/// Positions of the vertices of a level, and the rotations of the surface around them.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelPose {
    /// Position of each vertex.
    pub positions: Vec<Point3<f64>>,
    /// Rotation of each vertex from the rest shape.
    pub rotations: Vec<Matrix3<f64>>,
}

impl Hierarchy {
    /// Levels from `mesh` to about `coarsest` vertices; fewer where no more vertices can be removed.
    ///
    /// Vertices in `keep` (handles) stay on every level, except those whose neighbors are all in `keep` too: the boundary of a
    /// constrained region stays, its interior is thinned. Accepts any triangles; non-manifold edges stay, vertices of no triangle
    /// are on level 0 only unless kept.
    ///
    /// # Errors
    /// [`Stopped`].
    ///
    /// # Panics
    /// If `keep` has a vertex that does not exist.
    pub fn new(mesh: &TriMesh, keep: &[u32], coarsest: usize, run: &Run) -> Result<Self, Stopped> {
        let mut made = Self {
            meshes: vec![mesh.clone()],
            vertices: vec![(0..mesh.vertex_count() as u32).collect()],
            steps: vec![],
        };
        let mut collapser = Collapser::new(mesh, keep);
        let (n, target) = (mesh.vertex_count() as f64, coarsest.max(4) as f64);
        let steps = ((n / target).ln() / RATIO.ln()).round().max(1.0);
        for k in 1..=steps as usize {
            let wanted = (n * (target / n).powf(k as f64 / steps)).round();
            if n <= target || !made.coarsen(mesh, &mut collapser, wanted as usize, run)? {
                break;
            }
        }
        Ok(made)
    }

    /// Number of levels, ≥ 1; the last is the coarsest.
    pub fn levels(&self) -> usize {
        self.meshes.len()
    }

    /// The rest shape of a level.
    pub fn mesh(&self, level: usize) -> &TriMesh {
        &self.meshes[level]
    }

    /// Vertices of level 0 that are on this level, ascending: the `i`-th is vertex `i` of the level.
    pub fn vertices(&self, level: usize) -> &[u32] {
        &self.vertices[level]
    }

    /// Adds a level of about `wanted` vertices; `false` and no level if hardly any vertex can be removed.
    fn coarsen(
        &mut self,
        mesh: &TriMesh,
        collapser: &mut Collapser<'_>,
        wanted: usize,
        run: &Run,
    ) -> Result<bool, Stopped> {
        let finer = self.vertices.last().expect("level 0 always exists");
        let mut number = vec![u32::MAX; mesh.vertex_count()];
        for (i, &v) in finer.iter().enumerate() {
            number[v as usize] = i as u32;
        }
        let (mut step, mut remaining) = (Step::default(), finer.clone());
        while remaining.len() > wanted {
            let removed = step.pass(mesh, collapser, &number, &remaining, remaining.len() - wanted, run)?;
            if removed.is_empty() {
                break;
            }
            remaining.retain(|v| removed.binary_search(v).is_err());
        }
        // A level nearly as large as the previous one costs a solve without gain.
        if remaining.len() as f64 > MAX_LEVEL_RATIO * finer.len() as f64 {
            return Ok(false);
        }
        step.kept = remaining.iter().map(|&v| number[v as usize]).collect();
        self.steps.push(step);
        self.meshes.push(mesh.restricted(&remaining, collapser.triangles()));
        self.vertices.push(remaining);
        Ok(true)
    }

    /// Rotations of the vertices of a level from the rest shape to `positions`, fitted to the edges around each vertex.
    ///
    /// # Panics
    /// If the number of positions is not that of the level's vertices.
    pub fn rotations(&self, level: usize, positions: &[Point3<f64>]) -> Vec<Matrix3<f64>> {
        let (mesh, rest) = (&self.meshes[level], self.meshes[level].positions());
        assert_eq!(positions.len(), rest.len(), "one position per vertex of the level");
        let mut sums = vec![Matrix3::zeros(); rest.len()];
        let mut sizes = vec![0.0; rest.len()];
        for &[a, b, c] in mesh.triangles() {
            for [i, j, k] in [[a, b, c], [b, c, a], [c, a, b]].map(|t| t.map(|v| v as usize)) {
                let (e, f) = (rest[j] - rest[i], rest[k] - rest[i]);
                let [to_j, to_k] = mean_value(&e, &f, 0.0);
                let covariance = (positions[j] - positions[i]) * e.transpose() * to_j
                    + (positions[k] - positions[i]) * f.transpose() * to_k;
                sums[i] += covariance;
                sizes[i] += to_j * e.norm_squared() + to_k * f.norm_squared();
            }
        }
        // A regularization near rounding, for the undetermined rotation about a collinear ring.
        let fitted =
            |(sum, size): (&Matrix3<f64>, &f64)| nearest_rotation(&(sum + Matrix3::identity() * (1e-13 * size)));
        sums.iter().zip(&sizes).map(fitted).collect()
    }

    /// Positions of the vertices of `level` from those of `level + 1`.
    ///
    /// # Panics
    /// For the coarsest level, and if the number of positions is not that of the coarser level's vertices.
    pub fn prolong(&self, level: usize, coarse: &[Point3<f64>]) -> Vec<Point3<f64>> {
        let rotations = self.rotations(level + 1, coarse);
        self.prolong_pose(level, &LevelPose { positions: coarse.to_vec(), rotations }).positions
    }

    /// Positions and rotations of the vertices of `level` from those of `level + 1`.
    ///
    /// # Panics
    /// As [`Self::prolong`].
    pub fn prolong_pose(&self, level: usize, coarse: &LevelPose) -> LevelPose {
        let (step, rest) = (&self.steps[level], self.meshes[level].positions());
        assert_eq!(coarse.positions.len(), step.kept.len(), "one position per vertex of the coarser level");
        let mut fine = LevelPose { positions: rest.to_vec(), rotations: vec![Matrix3::identity(); rest.len()] };
        for (i, &v) in step.kept.iter().enumerate() {
            fine.positions[v as usize] = coarse.positions[i];
            fine.rotations[v as usize] = coarse.rotations[i];
        }
        for removal in step.removals.iter().rev() {
            let ring = &step.ring[removal.ring.start as usize..removal.ring.end as usize];
            fine.reinsert(removal.vertex as usize, ring, rest);
        }
        fine
    }
}

impl LevelPose {
    /// Prolongs to a vertex from its ring.
    fn reinsert(&mut self, u: usize, ring: &[(u32, f64)], rest: &[Point3<f64>]) {
        let (mut mean, mut shift) = (Vector3::zeros(), Vector3::zeros());
        for &(j, w) in ring {
            let j = j as usize;
            mean += (rest[j] - rest[u]) * w;
            shift += (self.positions[j] - rest[j]) * w;
        }
        let (mut frame, mut inherited, mut size) = (Matrix3::zeros(), Matrix3::zeros(), 0.0);
        for &(j, w) in ring {
            let j = j as usize;
            let e = rest[j] - rest[u] - mean;
            let moved = e + (self.positions[j] - rest[j]) - shift;
            frame += moved * e.transpose() * w;
            size += e.norm_squared() * w;
            inherited += self.rotations[j] * w;
        }
        if size > 0.0 {
            inherited = inherited * INHERITED_WEIGHT + frame / size;
        }
        let r = nearest_rotation(&inherited);
        self.positions[u] = rest[u] + shift + (mean - r * mean);
        self.rotations[u] = r;
    }
}

impl Step {
    /// Removes an independent set of up to `max` vertices of `remaining`; returns them in ascending order.
    fn pass(
        &mut self,
        mesh: &TriMesh,
        collapser: &mut Collapser<'_>,
        number: &[u32],
        remaining: &[u32],
        max: usize,
        run: &Run,
    ) -> Result<Vec<u32>, Stopped> {
        let mut removed: Vec<u32> = remaining.iter().copied().filter(|&v| collapser.is_loose(v as usize)).collect();
        removed.retain(|&v| !collapser.is_pinned(v as usize));
        for &v in &removed {
            self.record(mesh, collapser, number, v);
        }
        let mut candidates: Vec<(f64, u32, u32)> = Vec::with_capacity(remaining.len());
        for &u in remaining {
            run.check()?;
            candidates.extend(collapser.best(u as usize).map(|(v, cost)| (cost, u, v)));
        }
        candidates.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let considered = ((candidates.len() as f64 * CANDIDATE_FRACTION).ceil() as usize).min(candidates.len());
        let mut touched = vec![false; mesh.vertex_count()];
        for &(_, u, v) in &candidates[..considered] {
            run.check()?;
            if removed.len() >= max {
                break;
            }
            if touched[u as usize] || !collapser.allowed(u as usize, v as usize) {
                continue;
            }
            self.record(mesh, collapser, number, u);
            for &(w, _) in collapser.last_ring() {
                touched[w as usize] = true;
            }
            collapser.collapse(u as usize, v as usize);
            removed.push(u);
        }
        removed.sort_unstable();
        Ok(removed)
    }

    /// Records the ring of a vertex before its removal.
    fn record(&mut self, mesh: &TriMesh, collapser: &mut Collapser<'_>, number: &[u32], u: u32) {
        let start = self.ring.len();
        self.ring.extend(collapser.ring(u as usize).iter().map(|&(w, _)| (w, 0.0)));
        let ring = &mut self.ring[start..];
        let edge = |w: u32| mesh.positions()[w as usize] - mesh.positions()[u as usize];
        let floor = 1e-9 * ring.iter().map(|&(w, _)| edge(w).norm()).fold(0.0, f64::max);
        for pair in collapser.opposite(u as usize) {
            let weights = mean_value(&edge(pair[0]), &edge(pair[1]), floor);
            for (w, weight) in pair.iter().zip(weights) {
                ring.iter_mut().filter(|(v, _)| v == w).for_each(|(_, sum)| *sum += weight);
            }
        }
        let sum: f64 = ring.iter().map(|&(_, w)| w).sum();
        let even = 1.0 / ring.len() as f64;
        for (v, w) in ring.iter_mut() {
            *v = number[*v as usize];
            *w = if sum > 0.0 && sum.is_finite() { *w / sum } else { even };
        }
        self.removals.push(Removal { vertex: number[u as usize], ring: start as u32..self.ring.len() as u32 });
    }
}

/// Contribution of one triangle to the mean value weights of the two edges `e` and `f` from a vertex: `tan(θ/2)/‖e‖`, `tan(θ/2)/‖f‖`,
/// with lengths of at least `floor`. Zero for a degenerate triangle.
fn mean_value(e: &Vector3<f64>, f: &Vector3<f64>, floor: f64) -> [f64; 2] {
    let (of_e, of_f) = (e.norm().max(floor), f.norm().max(floor));
    // tan(θ/2) = sin θ / (1 + cos θ), unbounded for an angle of π.
    let tangent = e.cross(f).norm() / (of_e * of_f + e.dot(f)).max(1e-6 * of_e * of_f);
    let weights = [tangent / of_e, tangent / of_f];
    if weights.iter().all(|w| w.is_finite()) { weights } else { [0.0; 2] }
}

#[cfg(test)]
mod tests;
