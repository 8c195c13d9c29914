//! Segmentation into parts that move almost rigidly in the low modes.
//!
//! ```text
//! min Σ_v m_v Σ_k ‖u_k(v) − a_k − b_k × x_v‖² / λ_k      over a partition of the vertices, (a_k, b_k) for each part
//! ```
//!
//! A mode is weighted by its compliance `1/λ`. For a given partition the best motions are a small least-squares problem per part;
//! for given motions, parts grow from seeds over the surface in the order of the residuals of the vertices, so that each stays
//! connected. The two steps alternate (Lloyd); parts are added one at a time at the vertex with the largest residual.
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
use plumbline_num::math::Lists;
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::numbered_components;

/// Lloyd iterations after each added part: the partition changes again with the next part.
const ITERATIONS_PER_PART: usize = 4;
/// Maximum Lloyd iterations at the end, until nothing changes.
const FINAL_ITERATIONS: usize = 30;
/// No part yet.
const NONE: u32 = u32::MAX;

/// Number of parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PartCount {
    /// This many, but at least one per connected component.
    Exactly(usize),
    /// The fewest parts that leave at most a fraction of the motion unexplained.
    Unexplained {
        /// Maximum ratio of the minimized sum to that of one part per component, in (0, 1).
        fraction: f64,
        /// Maximum number of parts.
        max: usize,
    },
}

/// Options of the segmentation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartsOptions {
    /// Number of parts.
    pub count: PartCount,
}

impl Default for PartsOptions {
    fn default() -> Self {
        Self { count: PartCount::Unexplained { fraction: 0.05, max: 32 } }
    }
}

/// A partition of the vertices into near-rigid parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// Part of each vertex. Vertices of no triangle are parts of their own.
    pub of_vertex: Vec<u32>,
    /// Number of parts.
    pub count: usize,
    /// Fraction of the motion not explained by rigid parts, for each number of parts tried: 1 for one part per component first, the
    /// value of the result last.
    pub unexplained: Vec<f64>,
}

/// The best rigid velocities of one part in all modes, about its centroid.
#[derive(Clone, Debug)]
struct Motion {
    centroid: Vector3<f64>,
    linear: Vec<Vector3<f64>>,
    angular: Vec<Vector3<f64>>,
}

/// The modes as a vector field on the surface.
struct Field<'a> {
    mesh: &'a TriMesh,
    mass: Vec<f64>,
    /// `u_k(v) / √λ_k`, all modes of a vertex contiguous.
    scaled: Vec<Vector3<f64>>,
    modes: usize,
    neighbors: Vec<Vec<u32>>,
}

/// The parts of a surface that move almost rigidly in `modes`.
///
/// # Errors
/// [`Stopped`].
///
/// # Panics
/// If the modes are those of another mesh.
pub fn parts(mesh: &TriMesh, modes: &Modes, options: &PartsOptions, run: &Run) -> Result<Parts, Stopped> {
    let field = Field::new(mesh, modes);
    let (mut part, mut count) = numbered_components(mesh.vertex_count(), mesh.triangles());
    let whole = field.unexplained(&part, &field.motions(&part, count));
    let (max, fraction) = match options.count {
        PartCount::Exactly(n) => (n, 0.0),
        PartCount::Unexplained { fraction, max } => (max, fraction),
    };
    let mut unexplained = vec![1.0];
    while count < max && unexplained.last().is_some_and(|&u| u > fraction) && whole > 0.0 {
        let motions = field.motions(&part, count);
        let Some(seed) = field.worst(&part, &motions) else { break };
        field.split(&mut part, seed, count);
        count += 1;
        field.lloyd(&mut part, count, ITERATIONS_PER_PART, run)?;
        unexplained.push(field.unexplained(&part, &field.motions(&part, count)) / whole);
    }
    field.lloyd(&mut part, count, FINAL_ITERATIONS, run)?;
    if let Some(last) = unexplained.last_mut().filter(|_| whole > 0.0) {
        *last = field.unexplained(&part, &field.motions(&part, count)) / whole;
    }
    Ok(Parts { of_vertex: part, count, unexplained })
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
        Lists::new(count, part.iter().copied().zip(0..)).iter().map(|members| self.motion(members)).collect()
    }

    /// The least-squares rigid velocities of a set of vertices.
    fn motion(&self, vertices: &[u32]) -> Motion {
        let position = |v: u32| self.mesh.positions()[v as usize].coords;
        let mass = |v: u32| self.mass[v as usize];
        let total: f64 = vertices.iter().map(|&v| mass(v)).sum();
        let mut found = Motion {
            centroid: Vector3::zeros(),
            linear: vec![Vector3::zeros(); self.modes],
            angular: vec![Vector3::zeros(); self.modes],
        };
        if !(total > 0.0) {
            return found;
        }
        found.centroid = vertices.iter().map(|&v| position(v) * mass(v)).sum::<Vector3<f64>>() / total;
        let mut inertia = Matrix3::zeros();
        for &v in vertices {
            let x = position(v) - found.centroid;
            inertia += (Matrix3::identity() * x.norm_squared() - x * x.transpose()) * mass(v);
            for (k, u) in self.at(v as usize).iter().enumerate() {
                found.linear[k] += u * (mass(v) / total);
                found.angular[k] += x.cross(u) * mass(v);
            }
        }
        // The rotation of collinear vertices about their line is undetermined.
        let inverse = inertia.pseudo_inverse(1e-9 * inertia.trace().max(f64::MIN_POSITIVE));
        let inverse = inverse.unwrap_or_else(|_| Matrix3::zeros());
        found.angular.iter_mut().for_each(|angular| *angular = inverse * *angular);
        found
    }

    /// Squared residual of a vertex for a motion, per mass.
    fn residual(&self, v: usize, motion: &Motion) -> f64 {
        let x = self.mesh.positions()[v].coords - motion.centroid;
        let rigid = motion.linear.iter().zip(&motion.angular).map(|(a, b)| a + b.cross(&x));
        self.at(v).iter().zip(rigid).map(|(u, r)| (u - r).norm_squared()).sum()
    }

    fn unexplained(&self, part: &[u32], motions: &[Motion]) -> f64 {
        let residual = |(v, &p): (usize, &u32)| self.mass[v] * self.residual(v, &motions[p as usize]);
        part.iter().enumerate().map(residual).sum()
    }

    /// The vertex with the largest residual; `None` if all are 0.
    fn worst(&self, part: &[u32], motions: &[Motion]) -> Option<usize> {
        let residuals = part.iter().enumerate().map(|(v, &p)| (v, self.residual(v, &motions[p as usize])));
        residuals.filter(|m| m.1 > 0.0).max_by(|a, b| a.1.total_cmp(&b.1)).map(|m| m.0)
    }

    /// Assigns the vertices around `seed` to a new part: up to a third of the mean size of a part.
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

    /// Lloyd iterations; keeps the best partition.
    fn lloyd(&self, part: &mut Vec<u32>, count: usize, iterations: usize, run: &Run) -> Result<(), Stopped> {
        let mut best = (self.unexplained(part, &self.motions(part, count)), part.clone());
        for _ in 0..iterations {
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

    /// Grows each part again from its vertex with the least residual.
    fn grow(&self, part: &[u32], motions: &[Motion]) -> Vec<u32> {
        let mut seeds = vec![(f64::INFINITY, NONE); motions.len()];
        for (v, &p) in part.iter().enumerate() {
            let residual = self.residual(v, &motions[p as usize]);
            if residual < seeds[p as usize].0 || seeds[p as usize].1 == NONE {
                seeds[p as usize] = (residual, v as u32);
            }
        }
        let mut grown = vec![NONE; part.len()];
        let mut queue = BinaryHeap::new();
        // The bits of non-negative numbers have the order of the numbers.
        let candidate = |v: u32, p: u32| Reverse((self.residual(v as usize, &motions[p as usize]).to_bits(), v, p));
        for (p, &(_, v)) in seeds.iter().enumerate().filter(|(_, s)| s.1 != NONE) {
            queue.push(Reverse((0, v, p as u32)));
        }
        while let Some(Reverse((_, v, p))) = queue.pop() {
            if grown[v as usize] != NONE {
                continue;
            }
            grown[v as usize] = p;
            queue.extend(
                self.neighbors[v as usize].iter().filter(|&&w| grown[w as usize] == NONE).map(|&w| candidate(w, p)),
            );
        }
        grown
    }
}
