//! A closed surface without handles on the sphere, one to one; and two of them over it on each other.
//!
//! Vertices are taken out one by one by half-edge collapses until a tetrahedron is left ([`collapse`]), which lies on the sphere as it
//! is. Then they come back in reverse. A vertex lies inside the polygon of its neighbors as they were when it left; those neighbors
//! see the vertex into which it had collapsed, so that the part of the polygon from which all of it is seen is never empty, and the
//! vertex is put where the nearest side is farthest,
//!
//! ```text
//! max over |x| = 1   min_k  n_k · x,        n_k = pₖ × pₖ₊₁ / |pₖ × pₖ₊₁|.
//! ```
//!
//! Again and again all vertices are relaxed: each goes towards the mean of its neighbors, weighted by how much longer their edges are
//! on the sphere than on the surface, as far as no triangle around it turns over. The map is one to one throughout, by construction.
//!
//! # Reference
//! E. Praun, H. Hoppe, *Spherical parametrization and remeshing*, SIGGRAPH 2003.

mod collapse;
mod kernel;
mod overlay;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;

use super::super::MorphError;
use crate::mesh::{HalfEdges, TriMesh, numbered_components};
use collapse::{Removed, removals};
use kernel::deepest;
pub use overlay::over_spheres;

/// How surfaces are laid over each other by the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SphereOptions {
    /// Rounds in which landmarks are drawn to each other; those that have met end it early.
    pub rounds: usize,
}

impl Default for SphereOptions {
    fn default() -> Self {
        Self { rounds: 2000 }
    }
}

/// Rounds of relaxation whenever the number of vertices has grown by half, and at the end.
const SWEEPS: usize = 12;
const LAST_SWEEPS: usize = 60;

/// The smallest part of a straight step that is tried.
const SHORTEST: f64 = 1.0 / 64.0;

/// The unit vector of every vertex of a closed surface of genus 0: no triangle turned over, none on another.
///
/// # Errors
/// [`MorphError::Topology`] for an open surface, one in pieces or with handles; [`MorphError::Mesh`] where it is no manifold.
pub fn sphere_map(mesh: &TriMesh, which: &'static str) -> Result<Vec<Vector3<f64>>, MorphError> {
    check(mesh, which)?;
    let removed = removals(mesh).ok_or_else(|| topology(which, "cannot be reduced to a tetrahedron".to_owned()))?;
    let mut ball = Ball::new(mesh, &removed.left);
    let mut next = 8;
    for removed in removed.vertices.iter().rev() {
        ball.insert(removed)
            .ok_or_else(|| topology(which, format!("has no room on the sphere at vertex {}", removed.vertex)))?;
        if ball.order.len() >= next {
            next = next * 3 / 2;
            (0..SWEEPS).for_each(|_| ball.relax(&[]));
        }
    }
    (0..LAST_SWEEPS).for_each(|_| ball.relax(&[]));
    Ok(ball.at)
}

fn topology(which: &'static str, fault: String) -> MorphError {
    let advice = "the sphere serves closed surfaces without handles in one piece; take the method registration";
    MorphError::Topology { which, fault, advice }
}

fn check(mesh: &TriMesh, which: &'static str) -> Result<(), MorphError> {
    let half_edges = HalfEdges::new(mesh)?;
    let open = half_edges.boundary_edge_count();
    if open > 0 {
        return Err(topology(which, format!("is open: {open} edges have one triangle")));
    }
    let euler = mesh.vertex_count() as i64 - half_edges.edge_count() as i64 + mesh.triangle_count() as i64;
    let (_, pieces) = numbered_components(mesh.vertex_count(), mesh.triangles());
    if pieces != 1 {
        return Err(topology(which, format!("is in {pieces} pieces, vertices that no triangle names among them")));
    }
    if euler != 2 {
        return Err(topology(which, format!("has genus {}", (2 - euler) / 2)));
    }
    Ok(())
}

/// A surface, perhaps not yet all of it, on the sphere.
struct Ball<'m> {
    mesh: &'m TriMesh,
    at: Vec<Vector3<f64>>,
    /// Neighbors of each vertex, counterclockwise; empty while it is out.
    rings: Vec<Vec<u32>>,
    /// Vertices that are in.
    order: Vec<u32>,
}

impl<'m> Ball<'m> {
    /// The tetrahedron that is left.
    fn new(mesh: &'m TriMesh, left: &[(u32, Vec<u32>)]) -> Self {
        let n = mesh.vertex_count();
        let mut this = Self { mesh, at: vec![Vector3::zeros(); n], rings: vec![Vec::new(); n], order: Vec::new() };
        for (v, ring) in left {
            this.rings[*v as usize].clone_from(ring);
            this.order.push(*v);
        }
        // Counterclockwise from outside: the first vertex on top, its ring as it runs.
        let (top, ring) = &left[0];
        this.at[*top as usize] = Vector3::z();
        for (k, v) in ring.iter().enumerate() {
            let angle = k as f64 / 3.0 * std::f64::consts::TAU;
            this.at[*v as usize] = Vector3::new(angle.cos(), angle.sin(), -1.0 / 8.0_f64.sqrt()).normalize();
        }
        this
    }

    /// Puts a vertex back.
    fn insert(&mut self, removed: &Removed) -> Option<()> {
        let polygon: Vec<Vector3<f64>> = removed.ring.iter().map(|v| self.at[*v as usize]).collect();
        self.at[removed.vertex as usize] = deepest(&polygon)?;
        let (into, first, last) = (removed.ring[0], removed.ring[1], removed.ring[removed.ring.len() - 1]);
        let inner = &removed.ring[2..removed.ring.len() - 1];
        for v in inner {
            let ring = &mut self.rings[*v as usize];
            let place = ring.iter().position(|w| *w == into)?;
            ring[place] = removed.vertex;
        }
        // Around the vertex it went into, the inner ones give way to it.
        let ring = &mut self.rings[into as usize];
        ring.retain(|w| !inner.contains(w));
        let place = ring.iter().position(|w| *w == first)?;
        ring.insert(place + 1, removed.vertex);
        // The two at the ends gain it between that vertex and their inner neighbor.
        for (v, after) in [(first, true), (last, false)] {
            let ring = &mut self.rings[v as usize];
            let place = ring.iter().position(|w| *w == into)?;
            ring.insert(if after { place } else { place + 1 }, removed.vertex);
        }
        self.rings[removed.vertex as usize].clone_from(&removed.ring);
        self.order.push(removed.vertex);
        Some(())
    }

    /// Moves every vertex that is not held towards the weighted mean of its neighbors.
    fn relax(&mut self, held: &[bool]) {
        for k in 0..self.order.len() {
            let v = self.order[k];
            if held.get(v as usize) == Some(&true) {
                continue;
            }
            let (mut sum, mut total) = (Vector3::zeros(), 0.0);
            for &w in &self.rings[v as usize] {
                let on_surface = (self.mesh.positions()[v as usize] - self.mesh.positions()[w as usize]).norm();
                let on_ball = (self.at[v as usize] - self.at[w as usize]).norm();
                // Springs that are the stiffer the more an edge is stretched; none is slack.
                let weight = (on_ball / on_surface.max(f64::MIN_POSITIVE)).max(1e-300);
                sum += self.at[w as usize] * weight;
                total += weight;
            }
            if total.is_finite() && total > 0.0 {
                self.step(v, &(sum / total));
            }
        }
    }

    /// Moves a vertex towards a place, as far as nothing around it turns over; says whether it got there.
    fn step(&mut self, v: u32, to: &Vector3<f64>) -> bool {
        let from = self.at[v as usize];
        let mut share = 1.0;
        while share >= SHORTEST {
            if let Some(place) = (from + (to - from) * share).try_normalize(1e-12)
                && self.sees_its_ring(v, &place)
            {
                self.at[v as usize] = place;
                return share >= 1.0;
            }
            share *= 0.5;
        }
        false
    }

    fn sees_its_ring(&self, v: u32, place: &Vector3<f64>) -> bool {
        let ring = &self.rings[v as usize];
        (0..ring.len()).all(|k| {
            let (p, q) = (self.at[ring[k] as usize], self.at[ring[(k + 1) % ring.len()] as usize]);
            let normal = p.cross(&q);
            place.dot(&normal) > 1e-9 * normal.norm() * (p - q).norm()
        })
    }
}
