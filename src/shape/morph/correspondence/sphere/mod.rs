//! Bijective maps of closed surfaces of genus 0 to the sphere, and between two of them over the sphere.
//!
//! Vertices are removed one by one by half-edge collapses to a tetrahedron ([`collapse`]), which is mapped to the sphere directly.
//! Then they are reinserted in reverse order. A vertex is placed inside the spherical polygon of its ring at removal; the collapse
//! target is in the kernel of this polygon, which is therefore not empty, and the vertex is placed at its Chebyshev center,
//!
//! ```text
//! max over |x| = 1   min_k  n_k · x,        n_k = pₖ × pₖ₊₁ / |pₖ × pₖ₊₁|.
//! ```
//!
//! The vertex and its neighbors are then moved to reduce the stretch energy around them ([`stretch`]) until convergence; so are all
//! vertices whenever their number has grown by a quarter. No step may invert a triangle: the map is bijective throughout, by
//! construction. Relaxation without a stretch energy (springs that are the stiffer the longer they are) shrinks limbs to 10⁻¹⁶ of
//! their area, until vertices of a horse cannot be placed any more.
//!
//! Vertices may have target positions, so that one surface is laid out like another.
//!
//! # Reference
//! E. Praun, H. Hoppe, *Spherical parametrization and remeshing*, SIGGRAPH 2003.

mod collapse;
mod kernel;
mod overlay;
mod stretch;
#[cfg(test)]
mod tests;

use nalgebra::{Point3, Vector3};

use super::super::MorphError;
use super::super::rigid::nearest_similarity;
use super::connected_surface;
use crate::mesh::TriMesh;
use collapse::{Removed, removals};
use kernel::deepest;
pub use overlay::over_spheres;
use plumbline_num::run::{Run, Stopped};
use stretch::{Side, Target};

/// Minimum relaxation sweeps of all vertices whenever their number has grown by a quarter: crowded regions grow slowly at first.
const MIN_SWEEPS: usize = 60;
/// Maximum sweeps, while each decreases the energy by the fraction [`MIN_DECREASE`].
const MAX_SWEEPS: usize = 300;
const MIN_DECREASE: f64 = 1e-3;

/// Maximum relaxation sweeps around a reinserted vertex, while each decreases the energy by the fraction [`MIN_LOCAL_DECREASE`]: crowded
/// triangles grow by about half in each.
const MAX_LOCAL_SWEEPS: usize = 60;
const MIN_LOCAL_DECREASE: f64 = 0.05;

/// Minimum fraction of a step towards a landmark in the line search.
const MIN_STEP: f64 = 1.0 / 64.0;
/// Minimum fraction of a step of the stretch energy in the line search: steps of indefinite Hessians are far too long.
const MIN_DESCENT_STEP: f64 = 1e-6;

/// The unit vector of every vertex of a closed surface of genus 0, a bijective map without inverted triangles.
///
/// # Errors
/// [`MorphError::Topology`] for a surface with a boundary, several components or handles, or one that is not an oriented manifold;
/// [`MorphError::Interrupted`].
pub fn sphere_map(mesh: &TriMesh, which: &'static str, run: &Run) -> Result<Vec<Vector3<f64>>, MorphError> {
    Ok(SphereEmbedding::new(mesh, which, Vec::new(), &[], run)?.at)
}

fn topology(which: &'static str, fault: String) -> MorphError {
    let advice = "the sphere method needs a connected closed surface without handles; use the method registration";
    MorphError::Topology { which, fault, advice }
}

fn check(mesh: &TriMesh, which: &'static str) -> Result<(), MorphError> {
    let (half_edges, euler) = connected_surface(mesh, |fault| topology(which, fault))?;
    let open = half_edges.boundary_edge_count();
    if open > 0 {
        return Err(topology(which, format!("has a boundary: {open} edges have one triangle")));
    }
    if euler != 2 {
        return Err(topology(which, format!("has genus {}", (2 - euler) / 2)));
    }
    Ok(())
}

/// A surface on the sphere, during reinsertion in part.
struct SphereEmbedding<'m> {
    mesh: &'m TriMesh,
    at: Vec<Vector3<f64>>,
    /// Neighbors of each vertex, counterclockwise; empty while it is removed.
    rings: Vec<Vec<u32>>,
    /// Inserted vertices.
    order: Vec<u32>,
    /// Target of each vertex; may be empty.
    targets: Vec<Target>,
}

impl<'m> SphereEmbedding<'m> {
    /// The embedding of a surface, towards targets if there are any; vertices of `late` are removed last and reinserted first.
    fn new(
        mesh: &'m TriMesh,
        which: &'static str,
        targets: Vec<Target>,
        late: &[bool],
        run: &Run,
    ) -> Result<Self, MorphError> {
        check(mesh, which)?;
        let removed = removals(mesh, late, run)?
            .ok_or_else(|| topology(which, "cannot be reduced to a tetrahedron".to_owned()))?;
        let mut embedding = Self::tetrahedron(mesh, &removed.left);
        if !targets.is_empty() {
            let pairs: Vec<_> = embedding.order.iter().map(|v| (*v, targets[*v as usize].position)).collect();
            embedding.rotate_to(&pairs);
            embedding.targets = targets;
        }
        let mut next = 8;
        for removed in removed.vertices.iter().rev() {
            run.check()?;
            embedding.insert(removed).ok_or_else(|| {
                topology(which, format!("cannot be placed on the sphere at vertex {}", removed.vertex))
            })?;
            embedding.relax_around(removed);
            if embedding.order.len() >= next {
                next = next * 5 / 4;
                embedding.relax_all(run)?;
            }
        }
        embedding.relax_all(run)?;
        Ok(embedding)
    }

    /// The remaining tetrahedron.
    fn tetrahedron(mesh: &'m TriMesh, left: &[(u32, Vec<u32>)]) -> Self {
        let n = mesh.vertex_count();
        let mut this = Self {
            mesh,
            at: vec![Vector3::zeros(); n],
            rings: vec![Vec::new(); n],
            order: Vec::new(),
            targets: Vec::new(),
        };
        for (v, ring) in left {
            this.rings[*v as usize].clone_from(ring);
            this.order.push(*v);
        }
        // Counterclockwise from outside: the first vertex on top, its ring in order.
        let (top, ring) = &left[0];
        this.at[*top as usize] = Vector3::z();
        for (k, v) in ring.iter().enumerate() {
            let angle = k as f64 / 3.0 * std::f64::consts::TAU;
            this.at[*v as usize] = Vector3::new(angle.cos(), angle.sin(), -1.0 / 8.0_f64.sqrt()).normalize();
        }
        this
    }

    /// Reinserts a vertex.
    fn insert(&mut self, removed: &Removed) -> Option<()> {
        let polygon: Vec<Vector3<f64>> = removed.ring.iter().map(|v| self.at[*v as usize]).collect();
        self.at[removed.vertex as usize] = deepest(&polygon)?;
        let (into, first, last) = (removed.ring[0], removed.ring[1], removed.ring[removed.ring.len() - 1]);
        let inner = &removed.ring[2..removed.ring.len() - 1];
        for v in inner {
            let ring = &mut self.rings[*v as usize];
            let index = ring.iter().position(|w| *w == into)?;
            ring[index] = removed.vertex;
        }
        // In the ring of the collapse target it replaces the inner vertices.
        let ring = &mut self.rings[into as usize];
        ring.retain(|w| !inner.contains(w));
        let index = ring.iter().position(|w| *w == first)?;
        ring.insert(index + 1, removed.vertex);
        // In the rings of the two end vertices it is between the target and their inner neighbor.
        for (v, after) in [(first, true), (last, false)] {
            let ring = &mut self.rings[v as usize];
            let index = ring.iter().position(|w| *w == into)?;
            ring.insert(if after { index } else { index + 1 }, removed.vertex);
        }
        self.rings[removed.vertex as usize].clone_from(&removed.ring);
        self.order.push(removed.vertex);
        Some(())
    }

    /// Rotates the sphere to align these vertices with these directions, if they determine a rotation.
    fn rotate_to(&mut self, pairs: &[(u32, Vector3<f64>)]) {
        // A rotation about the center of the sphere: use every direction and its opposite.
        let both = |p: Vector3<f64>| [p, -p].map(Point3::from);
        let from: Vec<_> = pairs.iter().flat_map(|w| both(self.at[w.0 as usize])).collect();
        let to: Vec<_> = pairs.iter().flat_map(|w| both(w.1)).collect();
        let (map, rank) = nearest_similarity(&from, &to, &vec![1.0; from.len()], false);
        if rank > 1 {
            for v in &self.order {
                self.at[*v as usize] = (map.isometry.rotation * self.at[*v as usize]).normalize();
            }
        }
    }

    /// Relaxes a reinserted vertex and its neighbors.
    fn relax_around(&mut self, removed: &Removed) {
        let mut last = f64::INFINITY;
        for _ in 0..MAX_LOCAL_SWEEPS {
            let energy =
                self.relax_vertex(removed.vertex) + removed.ring.iter().map(|v| self.relax_vertex(*v)).sum::<f64>();
            if !(energy < (1.0 - MIN_LOCAL_DECREASE) * last) {
                break;
            }
            last = energy;
        }
    }

    /// Relaxes all vertices until convergence.
    fn relax_all(&mut self, run: &Run) -> Result<(), Stopped> {
        let mut last = f64::INFINITY;
        for sweep in 0..MAX_SWEEPS {
            run.check()?;
            let energy = self.relax(&[]);
            if sweep >= MIN_SWEEPS && !(energy < (1.0 - MIN_DECREASE) * last) {
                break;
            }
            last = energy;
        }
        Ok(())
    }

    /// Relaxes every vertex that is not fixed once; returns the previous energy, each triangle counted three times.
    fn relax(&mut self, fixed: &[bool]) -> f64 {
        let mut sum = 0.0;
        for k in 0..self.order.len() {
            let v = self.order[k];
            if fixed.get(v as usize) != Some(&true) {
                sum += self.relax_vertex(v);
            }
        }
        sum
    }

    /// A descent step of a vertex; returns the previous energy around it.
    fn relax_vertex(&mut self, v: u32) -> f64 {
        let (ring, x, p) =
            (&self.rings[v as usize], self.at[v as usize], |v: u32| self.mesh.positions()[v as usize].coords);
        let side = |k: usize| {
            let [a, b] = [ring[k], ring[(k + 1) % ring.len()]];
            Side::new([self.at[a as usize], self.at[b as usize]], [p(v), p(a), p(b)])
        };
        let sides: Vec<Side> = (0..ring.len()).map(side).collect();
        let target = self.targets.get(v as usize);
        let Some(((before, _), step)) = stretch::energy(&sides, target, &x).zip(stretch::step(&sides, target, &x))
        else {
            return 0.0;
        };
        let mut fraction = 1.0;
        while fraction >= MIN_DESCENT_STEP {
            if let Some(position) = (x + step * fraction).try_normalize(1e-12)
                && stretch::energy(&sides, target, &position).is_some_and(|e| e.0 < before)
                && self.is_valid(v, &position)
            {
                self.at[v as usize] = position;
                return before;
            }
            fraction *= 0.5;
        }
        before
    }

    /// Moves a vertex towards a position, as far as no triangle around it is inverted; true if it arrives.
    fn step(&mut self, v: u32, to: &Vector3<f64>) -> bool {
        let from = self.at[v as usize];
        let mut fraction = 1.0;
        while fraction >= MIN_STEP {
            if let Some(position) = (from + (to - from) * fraction).try_normalize(1e-12)
                && self.is_valid(v, &position)
            {
                self.at[v as usize] = position;
                return fraction >= 1.0;
            }
            fraction *= 0.5;
        }
        false
    }

    /// Whether no triangle around a vertex is inverted with the vertex at `position`.
    fn is_valid(&self, v: u32, position: &Vector3<f64>) -> bool {
        let ring = &self.rings[v as usize];
        (0..ring.len()).all(|k| {
            let (p, q) = (self.at[ring[k] as usize], self.at[ring[(k + 1) % ring.len()] as usize]);
            let normal = p.cross(&q);
            position.dot(&normal) > 1e-9 * normal.norm() * (p - q).norm()
        })
    }
}
