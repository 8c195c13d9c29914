//! A mesh at several resolutions, each a subset of the vertices of the one before: for solving coarse first.
//!
//! Level 0 is the mesh; each level holds about a quarter of the vertices of the finer one. Vertices go by half-edge collapses
//! `u → v` in passes: each pass takes the cheapest vertices of which no two are neighbors, so that the ring of each is whole
//! when it goes and whole again when it comes back. The ring says where it comes back to, by a local frame:
//!
//! ```text
//! x_u′ = x_u + Σ w_j (x_j′ − x_j) + (R_u − I)(x_u − Σ w_j x_j)
//! R_u  = nearest rotation to  Σ w_j (x_j′ − x̄′)(x_j − x̄)ᵀ / Σ w_j ‖x_j − x̄‖²  +  ε Σ w_j R_j
//! ```
//!
//! with mean value weights `w` (sum 1), hence: the rest shape comes back as it was, a rigid motion rigidly, a linear map of
//! a plane linearly, and detail turns with what bears it. The second term of `R_u` decides where the ring is a line.
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

/// Vertices of a level over those of the next coarser one. Less makes more levels to visit, more leaves each start worse.
const RATIO: f64 = 4.0;
/// Share of the vertices, cheapest first, that a pass looks at. All of them would take dear ones while cheap ones wait for
/// their neighbors; few make many passes.
const SHARE_PER_PASS: f64 = 0.6;
/// ε: small, so that a bent ring decides itself; a line of vertices needs any positive value.
const INHERITED: f64 = 0.1;

/// A vertex that the next coarser level lacks, and where in `Step::ring` its neighbors are.
#[derive(Clone, Debug)]
struct Removal {
    vertex: u32,
    ring: std::ops::Range<u32>,
}

/// What leads from one level to the next coarser one; numbers are those of the finer one.
#[derive(Clone, Debug, Default)]
struct Step {
    /// Number of each vertex of the coarser level.
    kept: Vec<u32>,
    /// In the order of going.
    removals: Vec<Removal>,
    /// Neighbors at the time, and their weights (sum 1).
    ring: Vec<(u32, f64)>,
}

/// A mesh at several resolutions.
#[derive(Clone, Debug)]
pub struct Hierarchy {
    meshes: Vec<TriMesh>,
    vertices: Vec<Vec<u32>>,
    steps: Vec<Step>,
}

/// Where the vertices of a level are, and how the surface around each has turned.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelPose {
    /// A position per vertex.
    pub positions: Vec<Point3<f64>>,
    /// A rotation from the rest shape per vertex.
    pub rotations: Vec<Matrix3<f64>>,
}

impl Hierarchy {
    /// Levels from `mesh` down to about `coarsest` vertices; fewer levels where nothing more can go.
    ///
    /// Vertices in `keep` (handles) stay on every level, except those all of whose neighbors are in `keep` too: of a held
    /// region the rim stays, the midst thins out. Works on any triangles; non-manifold edges stay as they are, vertices of no
    /// triangle are on level 0 alone unless kept.
    ///
    /// # Errors
    /// [`Stopped`].
    ///
    /// # Panics
    /// Where `keep` names a vertex that does not exist.
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

    /// Vertices of level 0 that are on this level, ascending: the `i`-th is the level's vertex `i`.
    pub fn vertices(&self, level: usize) -> &[u32] {
        &self.vertices[level]
    }

    /// Adds a level of about `wanted` vertices; `false`, and nothing added, where hardly any vertex can go.
    fn coarsen(
        &mut self,
        mesh: &TriMesh,
        collapser: &mut Collapser<'_>,
        wanted: usize,
        run: &Run,
    ) -> Result<bool, Stopped> {
        let finer = self.vertices.last().expect("level 0 is always there");
        let mut number = vec![u32::MAX; mesh.vertex_count()];
        for (i, &v) in finer.iter().enumerate() {
            number[v as usize] = i as u32;
        }
        let (mut step, mut left) = (Step::default(), finer.clone());
        while left.len() > wanted {
            let gone = step.pass(mesh, collapser, &number, &left, left.len() - wanted, run)?;
            if gone.is_empty() {
                break;
            }
            left.retain(|v| gone.binary_search(v).is_err());
        }
        // A level that is nearly as large as the last costs a solve and gains nothing.
        if left.len() as f64 > 0.8 * finer.len() as f64 {
            return Ok(false);
        }
        step.kept = left.iter().map(|&v| number[v as usize]).collect();
        self.steps.push(step);
        self.meshes.push(compact(mesh, &left, collapser));
        self.vertices.push(left);
        Ok(true)
    }

    /// Rotations of the vertices of a level from the rest shape to `positions`: of each the one that carries the edges around
    /// it best.
    ///
    /// # Panics
    /// Where the number of positions is not that of the level's vertices.
    pub fn rotations(&self, level: usize, positions: &[Point3<f64>]) -> Vec<Matrix3<f64>> {
        let (mesh, rest) = (&self.meshes[level], self.meshes[level].positions());
        assert_eq!(positions.len(), rest.len(), "one position per vertex of the level");
        let mut sums = vec![Matrix3::zeros(); rest.len()];
        let mut sizes = vec![0.0; rest.len()];
        for &[a, b, c] in mesh.triangles() {
            for [i, j, k] in [[a, b, c], [b, c, a], [c, a, b]].map(|t| t.map(|v| v as usize)) {
                let (e, f) = (rest[j] - rest[i], rest[k] - rest[i]);
                let [to_j, to_k] = mean_value(&e, &f, 0.0);
                let turned = (positions[j] - positions[i]) * e.transpose() * to_j
                    + (positions[k] - positions[i]) * f.transpose() * to_k;
                sums[i] += turned;
                sizes[i] += to_j * e.norm_squared() + to_k * f.norm_squared();
            }
        }
        // Less than what any bend does, but it keeps a line of vertices from turning about itself.
        let still =
            |(sum, size): (&Matrix3<f64>, &f64)| nearest_rotation(&(sum + Matrix3::identity() * (1e-13 * size)));
        sums.iter().zip(&sizes).map(still).collect()
    }

    /// Positions of the vertices of `level` from those of `level + 1`.
    ///
    /// # Panics
    /// For the coarsest level, and where the number of positions is not that of the coarser level's vertices.
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
            fine.bring_back(removal.vertex as usize, ring, rest);
        }
        fine
    }
}

impl LevelPose {
    /// Puts a vertex back into its ring.
    fn bring_back(&mut self, u: usize, ring: &[(u32, f64)], rest: &[Point3<f64>]) {
        let (mut middle, mut shift) = (Vector3::zeros(), Vector3::zeros());
        for &(j, w) in ring {
            let j = j as usize;
            middle += (rest[j] - rest[u]) * w;
            shift += (self.positions[j] - rest[j]) * w;
        }
        let (mut frame, mut inherited, mut size) = (Matrix3::zeros(), Matrix3::zeros(), 0.0);
        for &(j, w) in ring {
            let j = j as usize;
            let e = rest[j] - rest[u] - middle;
            let turned = e + (self.positions[j] - rest[j]) - shift;
            frame += turned * e.transpose() * w;
            size += e.norm_squared() * w;
            inherited += self.rotations[j] * w;
        }
        if size > 0.0 {
            inherited = inherited * INHERITED + frame / size;
        }
        let r = nearest_rotation(&inherited);
        self.positions[u] = rest[u] + shift + (middle - r * middle);
        self.rotations[u] = r;
    }
}

impl Step {
    /// Takes up to `most` vertices out of `left`, no two of them neighbors; returns them in ascending order.
    fn pass(
        &mut self,
        mesh: &TriMesh,
        collapser: &mut Collapser<'_>,
        number: &[u32],
        left: &[u32],
        most: usize,
        run: &Run,
    ) -> Result<Vec<u32>, Stopped> {
        let mut gone: Vec<u32> = left.iter().copied().filter(|&v| collapser.is_loose(v as usize)).collect();
        gone.retain(|&v| !collapser.is_pinned(v as usize));
        for &v in &gone {
            self.record(mesh, collapser, number, v);
        }
        let mut offers: Vec<(f64, u32, u32)> = Vec::with_capacity(left.len());
        for &u in left {
            run.check()?;
            offers.extend(collapser.best(u as usize).map(|(v, price)| (price, u, v)));
        }
        offers.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let looked_at = ((offers.len() as f64 * SHARE_PER_PASS).ceil() as usize).min(offers.len());
        let mut touched = vec![false; mesh.vertex_count()];
        for &(_, u, v) in &offers[..looked_at] {
            run.check()?;
            if gone.len() >= most {
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
            gone.push(u);
        }
        gone.sort_unstable();
        Ok(gone)
    }

    /// Writes down the ring of a vertex that is about to go.
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

/// Share of one triangle in the mean value weights of the two edges `e` and `f` from a vertex: `tan(θ/2)/‖e‖`, `tan(θ/2)/‖f‖`,
/// with lengths of `floor` at least. Zero where there is no angle.
fn mean_value(e: &Vector3<f64>, f: &Vector3<f64>, floor: f64) -> [f64; 2] {
    let (of_e, of_f) = (e.norm().max(floor), f.norm().max(floor));
    // tan(θ/2) = sin θ / (1 + cos θ), which a folded triangle takes to infinity.
    let tangent = e.cross(f).norm() / (of_e * of_f + e.dot(f)).max(1e-6 * of_e * of_f);
    let weights = [tangent / of_e, tangent / of_f];
    if weights.iter().all(|w| w.is_finite()) { weights } else { [0.0; 2] }
}

/// The mesh that is left, its vertices renumbered.
fn compact(mesh: &TriMesh, left: &[u32], collapser: &Collapser<'_>) -> TriMesh {
    let mut number = vec![0; mesh.vertex_count()];
    for (i, &v) in left.iter().enumerate() {
        number[v as usize] = i as u32;
    }
    let triangles = collapser.triangles().map(|t| t.map(|v| number[v as usize])).collect();
    let positions = left.iter().map(|&v| mesh.positions()[v as usize]).collect();
    TriMesh::new(positions, triangles).expect("positions of a mesh, and triangles between vertices that are left")
}

#[cfg(test)]
mod tests;
