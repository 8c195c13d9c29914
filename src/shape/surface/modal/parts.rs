//! Parts that move almost rigidly in the low modes.
//!
//! ```text
//! min Σ_v m_v Σ_k ‖u_k(v) − a_k − b_k × x_v‖² / λ_k      over a partition of the vertices, (a_k, b_k) for each part
//! ```
//!
//! A mode counts by `1/λ`, how far the same push would move along it. Given a partition the best motions are a small
//! least-squares problem per part; given the motions, parts are grown from seeds over the surface, the vertex that fits
//! best first, so that each stays connected. The two alternate (Lloyd); parts are added one by one at the vertex that fits
//! worst.
//!
//! # Reference
//! Q. Huang, M. Wicke, B. Adams, L. Guibas, *Shape decomposition using modal analysis*, Computer Graphics Forum 28 (2009);
//! D. Cohen-Steiner, P. Alliez, M. Desbrun, *Variational shape approximation*, SIGGRAPH 2004 (growing from seeds).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::{Matrix3, Vector3};

use super::Modes;
use crate::mesh::operators::barycentric_areas;
use crate::mesh::{TriMesh, neighbors_of_vertices};
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::components;

/// Rounds of Lloyd's alternation after each part that is added: the others have little to give.
const ROUNDS: usize = 4;
/// Rounds at the end at most; it stops when nothing changes.
const LAST_ROUNDS: usize = 30;
/// Of no part yet.
const NONE: u32 = u32::MAX;

/// How many parts there are to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PartCount {
    /// This many, and no fewer than the surface has pieces.
    Exactly(usize),
    /// As few as leave no more than this share of the motion unexplained, in (0, 1), and not more than `most`.
    Unexplained {
        /// Share of the sum that is minimized, against one part per piece.
        share: f64,
        /// Most parts.
        most: usize,
    },
}

/// How parts are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartsOptions {
    /// How many.
    pub count: PartCount,
}

impl Default for PartsOptions {
    fn default() -> Self {
        Self { count: PartCount::Unexplained { share: 0.05, most: 32 } }
    }
}

/// A partition of the vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// Part of each vertex. Vertices of no triangle are parts of their own.
    pub of_vertex: Vec<u32>,
    /// Number of parts.
    pub count: usize,
    /// Share of the motion that rigid parts leave unexplained, after each number of parts tried: the last is that of the
    /// result, the first belongs to one part per piece of the surface and is 1.
    pub unexplained: Vec<f64>,
}

/// The best rigid velocities of one part in all modes, about its middle.
#[derive(Clone, Debug)]
struct Motion {
    middle: Vector3<f64>,
    shifts: Vec<Vector3<f64>>,
    turns: Vec<Vector3<f64>>,
}

struct Field<'a> {
    mesh: &'a TriMesh,
    mass: Vec<f64>,
    /// `u_k(v) / √λ_k`, all modes of a vertex side by side.
    scaled: Vec<Vector3<f64>>,
    modes: usize,
    neighbors: Vec<Vec<u32>>,
}

/// Parts of a surface that move almost rigidly in `modes`.
///
/// # Errors
/// [`Stopped`].
///
/// # Panics
/// Where the modes are those of another mesh.
pub fn parts(mesh: &TriMesh, modes: &Modes, options: &PartsOptions, run: &Run) -> Result<Parts, Stopped> {
    let field = Field::new(mesh, modes);
    let mut part = pieces(mesh);
    let mut count = part.iter().max().map_or(0, |&p| p as usize + 1);
    let whole = field.unexplained(&part, &field.motions(&part, count));
    let (most, share) = match options.count {
        PartCount::Exactly(n) => (n, 0.0),
        PartCount::Unexplained { share, most } => (most, share),
    };
    let mut unexplained = vec![1.0];
    while count < most && unexplained.last().is_some_and(|&u| u > share) && whole > 0.0 {
        let motions = field.motions(&part, count);
        let Some(seed) = field.worst(&part, &motions) else { break };
        field.split(&mut part, seed, count);
        count += 1;
        field.settle(&mut part, count, ROUNDS, run)?;
        unexplained.push(field.unexplained(&part, &field.motions(&part, count)) / whole);
    }
    field.settle(&mut part, count, LAST_ROUNDS, run)?;
    if let Some(last) = unexplained.last_mut().filter(|_| whole > 0.0) {
        *last = field.unexplained(&part, &field.motions(&part, count)) / whole;
    }
    Ok(Parts { of_vertex: part, count, unexplained })
}

/// Connected pieces, numbered.
fn pieces(mesh: &TriMesh) -> Vec<u32> {
    let lowest = components(mesh.vertex_count(), mesh.triangles());
    let mut names = lowest.clone();
    names.sort_unstable();
    names.dedup();
    lowest.iter().map(|p| names.binary_search(p).expect("every piece is listed") as u32).collect()
}

impl<'a> Field<'a> {
    fn new(mesh: &'a TriMesh, modes: &Modes) -> Self {
        let n = mesh.vertex_count();
        assert!(modes.vectors.iter().all(|u| u.len() == n), "one displacement per vertex");
        let neighbors = neighbors_of_vertices(n, mesh.triangles());
        let mut scaled = Vec::with_capacity(n * modes.values.len());
        for v in 0..n {
            let of_vertex = modes.vectors.iter().zip(&modes.values);
            scaled
                .extend(of_vertex.map(|(u, &value)| if value > 0.0 { u[v] / value.sqrt() } else { Vector3::zeros() }));
        }
        Self { mass: barycentric_areas(mesh), mesh, scaled, modes: modes.values.len(), neighbors }
    }

    fn at(&self, v: usize) -> &[Vector3<f64>] {
        &self.scaled[v * self.modes..(v + 1) * self.modes]
    }

    fn motions(&self, part: &[u32], count: usize) -> Vec<Motion> {
        let mut members = vec![Vec::new(); count];
        part.iter().zip(0_u32..).for_each(|(&p, v)| members[p as usize].push(v));
        members.iter().map(|of| self.motion(of)).collect()
    }

    /// Least squares of a rigid velocity per mode.
    fn motion(&self, vertices: &[u32]) -> Motion {
        let place = |v: u32| self.mesh.positions()[v as usize].coords;
        let mass = |v: u32| self.mass[v as usize];
        let total: f64 = vertices.iter().map(|&v| mass(v)).sum();
        let mut found = Motion {
            middle: Vector3::zeros(),
            shifts: vec![Vector3::zeros(); self.modes],
            turns: vec![Vector3::zeros(); self.modes],
        };
        if !(total > 0.0) {
            return found;
        }
        found.middle = vertices.iter().map(|&v| place(v) * mass(v)).sum::<Vector3<f64>>() / total;
        let mut inertia = Matrix3::zeros();
        for &v in vertices {
            let x = place(v) - found.middle;
            inertia += (Matrix3::identity() * x.norm_squared() - x * x.transpose()) * mass(v);
            for (k, u) in self.at(v as usize).iter().enumerate() {
                found.shifts[k] += u * (mass(v) / total);
                found.turns[k] += x.cross(u) * mass(v);
            }
        }
        // A line of vertices has no turn about itself.
        let inverse = inertia.pseudo_inverse(1e-9 * inertia.trace().max(f64::MIN_POSITIVE));
        let inverse = inverse.unwrap_or_else(|_| Matrix3::zeros());
        found.turns.iter_mut().for_each(|turn| *turn = inverse * *turn);
        found
    }

    /// Squared misfit of a vertex to a motion, per mass.
    fn misfit(&self, v: usize, motion: &Motion) -> f64 {
        let x = self.mesh.positions()[v].coords - motion.middle;
        let rigid = motion.shifts.iter().zip(&motion.turns).map(|(a, b)| a + b.cross(&x));
        self.at(v).iter().zip(rigid).map(|(u, r)| (u - r).norm_squared()).sum()
    }

    fn unexplained(&self, part: &[u32], motions: &[Motion]) -> f64 {
        let misfit = |(v, &p): (usize, &u32)| self.mass[v] * self.misfit(v, &motions[p as usize]);
        part.iter().enumerate().map(misfit).sum()
    }

    /// The vertex that fits its part worst; `None` where all fit.
    fn worst(&self, part: &[u32], motions: &[Motion]) -> Option<usize> {
        let misfits = part.iter().enumerate().map(|(v, &p)| (v, self.misfit(v, &motions[p as usize])));
        misfits.filter(|m| m.1 > 0.0).max_by(|a, b| a.1.total_cmp(&b.1)).map(|m| m.0)
    }

    /// Gives the vertices around `seed` to a new part: as many as would make parts of a third of the mean size.
    fn split(&self, part: &mut [u32], seed: usize, new: usize) {
        let wanted = (part.len() / (3 * (new + 1))).max(4);
        let (mut queue, old) = (vec![seed as u32], part[seed]);
        part[seed] = new as u32;
        let mut next = 0;
        while next < queue.len() && queue.len() < wanted {
            for &w in &self.neighbors[queue[next] as usize] {
                if part[w as usize] == old {
                    part[w as usize] = new as u32;
                    queue.push(w);
                }
            }
            next += 1;
        }
    }

    /// Alternates fits and growing; stops where nothing changes.
    fn settle(&self, part: &mut Vec<u32>, count: usize, rounds: usize, run: &Run) -> Result<(), Stopped> {
        let mut best = (self.unexplained(part, &self.motions(part, count)), part.clone());
        for _ in 0..rounds {
            run.check()?;
            let grown = self.grow(part, &self.motions(part, count));
            if grown == *part {
                break;
            }
            *part = grown;
            let now = self.unexplained(part, &self.motions(part, count));
            if now < best.0 {
                best = (now, part.clone());
            }
        }
        *part = best.1;
        Ok(())
    }

    /// Grows each part anew from its vertex that fits it best, which may lie in the midst or not.
    fn grow(&self, part: &[u32], motions: &[Motion]) -> Vec<u32> {
        let mut seeds = vec![(f64::INFINITY, NONE); motions.len()];
        for (v, &p) in part.iter().enumerate() {
            let misfit = self.misfit(v, &motions[p as usize]);
            if misfit < seeds[p as usize].0 || seeds[p as usize].1 == NONE {
                seeds[p as usize] = (misfit, v as u32);
            }
        }
        let mut grown = vec![NONE; part.len()];
        let mut queue = BinaryHeap::new();
        // Bits of numbers that are not negative are in the order of the numbers.
        let offer = |v: u32, p: u32| Reverse((self.misfit(v as usize, &motions[p as usize]).to_bits(), v, p));
        for (p, &(_, v)) in seeds.iter().enumerate().filter(|(_, s)| s.1 != NONE) {
            queue.push(Reverse((0, v, p as u32)));
        }
        while let Some(Reverse((_, v, p))) = queue.pop() {
            if grown[v as usize] != NONE {
                continue;
            }
            grown[v as usize] = p;
            queue.extend(
                self.neighbors[v as usize].iter().filter(|&&w| grown[w as usize] == NONE).map(|&w| offer(w, p)),
            );
        }
        grown
    }
}
