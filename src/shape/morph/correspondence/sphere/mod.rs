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
//! It and its neighbors then go, again and again, to where the surface around them is least stretched ([`stretch`]), until what was crowded has
//! room; all vertices do so whenever their number has grown by a quarter. No triangle around them may turn over: the map is one to one
//! throughout, by construction. Relaxation that does not weigh crowding instead (springs that are the stiffer the longer they are) shrinks
//! limbs to 10⁻¹⁶ of their area, and the vertices of a horse find no place any more.
//!
//! Vertices may have places where they are wanted, so that one surface is laid out as another is.
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
use crate::mesh::{HalfEdges, TriMesh};
use collapse::{Removed, removals};
use kernel::deepest;
pub use overlay::over_spheres;
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::numbered_components;
use stretch::{Side, Wish};

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

/// Rounds of relaxation of all vertices whenever their number has grown by a quarter: at least, and at most while each gains [`GAIN`].
const SWEEPS: usize = 60;
const MAX_SWEEPS: usize = 300;
const GAIN: f64 = 1e-3;

/// Rounds around a vertex that came back, at most while each gains [`ROOM`]: what is crowded grows by about half in each.
const AROUND: usize = 60;
const ROOM: f64 = 0.05;

/// The smallest part of a step towards a landmark that is tried, and of one to where less is stretched.
const MIN_STEP: f64 = 1.0 / 64.0;
const MIN_SETTLING: f64 = 1e-6;

/// The unit vector of every vertex of a closed surface of genus 0: no triangle turned over, none on another.
///
/// # Errors
/// [`MorphError::Topology`] for an open surface, one in pieces or with handles, or no oriented manifold;
/// [`MorphError::Interrupted`].
pub fn sphere_map(mesh: &TriMesh, which: &'static str, run: &Run) -> Result<Vec<Vector3<f64>>, MorphError> {
    Ok(Ball::laid_out(mesh, which, Vec::new(), &[], run)?.at)
}

fn topology(which: &'static str, fault: String) -> MorphError {
    let advice = "the sphere serves closed surfaces without handles in one piece; take the method registration";
    MorphError::Topology { which, fault, advice }
}

fn check(mesh: &TriMesh, which: &'static str) -> Result<(), MorphError> {
    let half_edges = HalfEdges::new(mesh).map_err(|e| topology(which, format!("is no oriented manifold: {e}")))?;
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
    /// Where each vertex is wanted; empty where none is.
    wishes: Vec<Wish>,
}

impl<'m> Ball<'m> {
    /// A whole surface, as its wishes say where there are any; vertices of `late` are the last to go and the first to come back.
    fn laid_out(
        mesh: &'m TriMesh,
        which: &'static str,
        wishes: Vec<Wish>,
        late: &[bool],
        run: &Run,
    ) -> Result<Self, MorphError> {
        check(mesh, which)?;
        let removed = removals(mesh, late, run)?
            .ok_or_else(|| topology(which, "cannot be reduced to a tetrahedron".to_owned()))?;
        let mut ball = Self::new(mesh, &removed.left);
        if !wishes.is_empty() {
            let wanted: Vec<_> = ball.order.iter().map(|v| (*v, wishes[*v as usize].place)).collect();
            ball.turn(&wanted);
            ball.wishes = wishes;
        }
        let mut next = 8;
        for removed in removed.vertices.iter().rev() {
            run.check()?;
            ball.insert(removed)
                .ok_or_else(|| topology(which, format!("has no room on the sphere at vertex {}", removed.vertex)))?;
            ball.make_room(removed);
            if ball.order.len() >= next {
                next = next * 5 / 4;
                ball.spread(run)?;
            }
        }
        ball.spread(run)?;
        Ok(ball)
    }

    /// The tetrahedron that is left.
    fn new(mesh: &'m TriMesh, left: &[(u32, Vec<u32>)]) -> Self {
        let n = mesh.vertex_count();
        let mut this = Self {
            mesh,
            at: vec![Vector3::zeros(); n],
            rings: vec![Vec::new(); n],
            order: Vec::new(),
            wishes: Vec::new(),
        };
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

    /// Turns all so that these vertices are nearest to these places; not at all where places are too few to say how.
    fn turn(&mut self, wanted: &[(u32, Vector3<f64>)]) {
        // About the center of the sphere: every place and its opposite.
        let both = |place: Vector3<f64>| [place, -place].map(Point3::from);
        let from: Vec<_> = wanted.iter().flat_map(|w| both(self.at[w.0 as usize])).collect();
        let to: Vec<_> = wanted.iter().flat_map(|w| both(w.1)).collect();
        let (map, rank) = nearest_similarity(&from, &to, &vec![1.0; from.len()], false);
        if rank > 1 {
            for v in &self.order {
                self.at[*v as usize] = (map.isometry.rotation * self.at[*v as usize]).normalize();
            }
        }
    }

    /// Moves a vertex that came back and its neighbors until what is crowded there has room.
    fn make_room(&mut self, removed: &Removed) {
        let mut last = f64::INFINITY;
        for _ in 0..AROUND {
            let energy = self.settle(removed.vertex) + removed.ring.iter().map(|v| self.settle(*v)).sum::<f64>();
            if !(energy < (1.0 - ROOM) * last) {
                break;
            }
            last = energy;
        }
    }

    /// Relaxes all until little is gained.
    fn spread(&mut self, run: &Run) -> Result<(), Stopped> {
        let mut last = f64::INFINITY;
        for sweep in 0..MAX_SWEEPS {
            run.check()?;
            let energy = self.relax(&[]);
            if sweep >= SWEEPS && !(energy < (1.0 - GAIN) * last) {
                break;
            }
            last = energy;
        }
        Ok(())
    }

    /// Moves every vertex that is not held to where the surface around it is stretched least; returns how much it was, each triangle three times.
    fn relax(&mut self, held: &[bool]) -> f64 {
        let mut sum = 0.0;
        for k in 0..self.order.len() {
            let v = self.order[k];
            if held.get(v as usize) != Some(&true) {
                sum += self.settle(v);
            }
        }
        sum
    }

    /// Moves a vertex to where the surface around it is stretched less; returns how much it was.
    fn settle(&mut self, v: u32) -> f64 {
        let (ring, x, p) =
            (&self.rings[v as usize], self.at[v as usize], |v: u32| self.mesh.positions()[v as usize].coords);
        let side = |k: usize| {
            let [a, b] = [ring[k], ring[(k + 1) % ring.len()]];
            Side::new([self.at[a as usize], self.at[b as usize]], [p(v), p(a), p(b)])
        };
        let sides: Vec<Side> = (0..ring.len()).map(side).collect();
        let wish = self.wishes.get(v as usize);
        let Some(((before, _), step)) = stretch::energy(&sides, wish, &x).zip(stretch::step(&sides, wish, &x)) else {
            return 0.0;
        };
        let mut share = 1.0;
        while share >= MIN_SETTLING {
            if let Some(place) = (x + step * share).try_normalize(1e-12)
                && stretch::energy(&sides, wish, &place).is_some_and(|e| e.0 < before)
                && self.sees_its_ring(v, &place)
            {
                self.at[v as usize] = place;
                return before;
            }
            share *= 0.5;
        }
        before
    }

    /// Moves a vertex towards a place, as far as nothing around it turns over; says whether it got there.
    fn step(&mut self, v: u32, to: &Vector3<f64>) -> bool {
        let from = self.at[v as usize];
        let mut share = 1.0;
        while share >= MIN_STEP {
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
