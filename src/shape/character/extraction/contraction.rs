//! The surface shrinks until it is a curve.
//!
//! Each round solves, in the least-squares sense, for positions `x'` of the vertices from the positions `x` of the round before,
//!
//! ```text
//! E = Σᵢ w_Lᵢ² ‖(L x')ᵢ‖²  +  Σᵢ mᵢ w_Hᵢ² ‖x'ᵢ − xᵢ‖²  +  Σᵢ mᵢ w_M² ‖x'ᵢ − cᵢ‖²
//! w_Lᵢ = w_L s_Lᵗ ρᵢ² / √(aᵢ ā),   w_Hᵢ² = w_H² aᵢ / Aᵢ,   mᵢ = aᵢ / ā
//! ```
//!
//! with `L` the cotangent Laplacian of the surface as it is in round `t`, `aᵢ` the area that a vertex stood for at first and `Aᵢ` what is
//! left of it, `ā` the mean of the former, `ρᵢ` the radius of the shape about the vertex and `cᵢ` the center of its medial ball. The
//! first term makes the surface flat in the mean: it moves along its mean-curvature normal, thin parts inward. The second
//! holds each round back, the more the less area is left; the third keeps what has shrunk in the middle of the shape, and
//! branches from growing shorter. The normal equations
//!
//! `(Lᵀ W_L² L + M (W_H² + w_M²)) x' = M (W_H² x + w_M² c)`
//!
//! are sparse and positive definite: one factorization and three right-hand sides per round.
//!
//! After each round edges that have become short collapse under the link condition, so that systems grow smaller as the surface
//! does. A merged vertex stands for the area of both, at the mean of both centers. A round with an unchanged surface uses the
//! analysis of the round before.
//!
//! Departures from Au et al.: `w_L` counts in units of the local radius, so that fingers and trunks contract in the same rounds, and
//! grows by 1.2 a round instead of 2; vertices merge, and are drawn to medial centers, as in Tagliasacchi et al. (there Voronoi
//! poles); weights of edges are not negative, which Laplacians of slivers would need to be linearly precise; instead vertices whose
//! area is gone are contracted no more, or limbs would be drawn in along themselves. Pinned vertices have a weight that holds
//! them in place.
//!
//! # Reference
//! O. K.-C. Au, C.-L. Tai, H.-K. Chu, D. Cohen-Or, T.-Y. Lee, *Skeleton extraction by mesh contraction*, SIGGRAPH 2008, section
//! 4; A. Tagliasacchi, I. Alhashim, M. Olson, H. Zhang, *Mean curvature skeletons*, SGP 2012, sections 3 and 4.

use nalgebra::{Point3, Vector3};

use super::complex::Complex;
use super::error::ExtractionError;
use super::medial::Ball;
use super::normal_equations::NormalEquations;
use super::order::Cost;
use plumbline_num::run::{Run, Stopped};

/// Weights and bounds of the contraction; lengths in the unit of the normalized model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Weights {
    pub(super) contraction: f64,
    pub(super) hold: f64,
    pub(super) medial: f64,
    /// Growth of the contraction weight per round.
    pub(super) growth: f64,
    /// Edges shorter than this collapse.
    pub(super) short: f64,
    /// And shorter than this share of the radius of the shape.
    pub(super) short_of_radius: f64,
    pub(super) rounds: usize,
    /// It ends when a round takes less than this share of the first area away.
    pub(super) still: f64,
}

/// A vertex whose triangles have shrunk to this share of their area is part of the curve: it is contracted no more. At 300 limbs
/// lose their tips, at 10 palms and ears stay sheets.
const FROZEN: f64 = 30.0;
/// Bound of the weight by which shrunken vertices hold to their place.
const FIRMEST: f64 = 1e6;
/// Weight of pinned vertices over the others.
const PINNED: f64 = 1e6;

/// A vertex has left its neighbors where the nearest is farther than this many times its longest edge before. At 1 tips are called
/// back that are on their way along a limb.
const LEFT: f64 = 3.0;

/// A surface on its way to a curve.
pub(super) struct Contraction {
    pub(super) complex: Complex,
    /// Where each vertex is drawn to.
    centers: Vec<Point3<f64>>,
    /// Area that each vertex stands for.
    pub(super) mass: Vec<f64>,
    /// Radius of the shape around each vertex.
    radii: Vec<f64>,
    pinned: Vec<bool>,
    weights: Weights,
    first_area: f64,
    area: f64,
    round: usize,
    system: Option<NormalEquations>,
}

impl Contraction {
    pub(super) fn new(complex: Complex, balls: &[Ball], pinned: Vec<bool>, weights: Weights) -> Self {
        let mut mass = vec![0.0; complex.positions.len()];
        for t in complex.faces() {
            let [a, b, c] = t.map(|v| complex.positions[v as usize]);
            let third = (b - a).cross(&(c - a)).norm() / 6.0;
            for v in &t {
                mass[*v as usize] += third;
            }
        }
        let area = complex.area();
        let centers = balls.iter().map(|b| b.center).collect();
        let radii = balls.iter().map(|b| b.radius).collect();
        Self { complex, centers, mass, radii, pinned, weights, first_area: area, area, round: 0, system: None }
    }

    /// Share of the first area that is left.
    pub(super) fn area_left(&self) -> f64 {
        if self.first_area > 0.0 { self.area / self.first_area } else { 0.0 }
    }

    /// One round; true where it was the last.
    pub(super) fn step(&mut self, run: &Run) -> Result<bool, ExtractionError> {
        self.solve(run)?;
        if self.collapse_short(run)? {
            self.system = None;
        }
        let area = self.complex.area();
        let lost = self.area - area;
        self.area = area;
        self.round += 1;
        Ok(lost.abs() < self.weights.still * self.first_area || self.round >= self.weights.rounds)
    }

    fn solve(&mut self, run: &Run) -> Result<(), ExtractionError> {
        let mut system = match self.system.take() {
            Some(system) => system,
            None => NormalEquations::analyze(&self.complex)?,
        };
        let n = system.vertices.len();
        let mean = system.vertices.iter().map(|v| self.mass[*v as usize]).sum::<f64>() / n as f64;
        let w = &self.weights;
        let (hold, medial) = (w.hold * w.hold, w.medial * w.medial);
        let ring = self.ring_areas();
        let strength = w.contraction * w.growth.powi(self.round as i32);
        let shrunk = |v: u32| self.mass[v as usize] / ring[v as usize].max(1e-300);
        let row = |v: &u32| {
            if shrunk(*v) > FROZEN {
                return 0.0;
            }
            let m = self.mass[*v as usize];
            strength * self.radii[*v as usize].powi(2) / (m * mean).sqrt()
        };
        let rows: Vec<f64> = system.vertices.iter().map(row).collect();
        let (mut diagonal, mut rhs) = (vec![0.0; n], vec![0.0; 3 * n]);
        for (i, &v) in system.vertices.iter().enumerate() {
            let v = v as usize;
            let m = (self.mass[v] / mean).max(1e-6);
            let x = self.complex.positions[v].coords;
            let (weight, wanted) = if self.pinned[v] {
                (PINNED, x * PINNED)
            } else {
                let hold = hold * shrunk(v as u32).clamp(1.0, FIRMEST);
                (m * (hold + medial), x * (m * hold) + self.centers[v].coords * (m * medial))
            };
            diagonal[i] = weight;
            for k in 0..3 {
                rhs[k * n + i] = wanted[k];
            }
        }
        system.set(&self.complex, &rows, &diagonal);
        system.solve_in_place(&mut rhs, run)?;
        let mut moved = self.complex.positions.clone();
        for (i, &v) in system.vertices.iter().enumerate() {
            let place = Vector3::new(rhs[i], rhs[n + i], rhs[2 * n + i]);
            if place.iter().all(|c| c.is_finite()) && !self.pinned[v as usize] {
                moved[v as usize] = Point3::from(place);
            }
        }
        self.call_back(&system, &mut moved);
        self.complex.positions = moved;
        self.system = Some(system);
        Ok(())
    }

    /// Brings vertices that have left all their neighbors back among them: what stands for next to no area is the cheapest to move where
    /// slivers about it are to be flattened.
    fn call_back(&self, system: &NormalEquations, moved: &mut [Point3<f64>]) {
        let brought_back = |(i, &v): (usize, &u32)| {
            let around = system.around(i).map(|j| system.vertices[j] as usize);
            let length = |of: &[Point3<f64>], u: usize| nalgebra::distance(&of[v as usize], &of[u]);
            let before = around.clone().map(|u| length(&self.complex.positions, u)).fold(0.0, f64::max);
            let nearest = around.clone().map(|u| length(moved, u)).fold(f64::INFINITY, f64::min);
            if self.pinned[v as usize] || nearest == f64::INFINITY || nearest <= LEFT * before {
                return None;
            }
            let sum: Vector3<f64> = around.clone().map(|u| moved[u].coords).sum();
            Some((v, Point3::from(sum / around.count() as f64)))
        };
        let lost: Vec<(u32, Point3<f64>)> = system.vertices.iter().enumerate().filter_map(brought_back).collect();
        for (v, place) in lost {
            moved[v as usize] = place;
        }
    }

    fn ring_areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.complex.positions.len()];
        for t in self.complex.faces() {
            let [a, b, c] = t.map(|v| self.complex.positions[v as usize]);
            let third = (b - a).cross(&(c - a)).norm() / 6.0;
            for v in &t {
                areas[*v as usize] += third;
            }
        }
        areas
    }

    /// Collapses short edges, the shortest first; true where there was one.
    fn collapse_short(&mut self, run: &Run) -> Result<bool, Stopped> {
        let mut scratch = [Vec::new(), Vec::new()];
        let mut any = false;
        loop {
            let mut edges = self.short_edges();
            edges.sort_unstable();
            let mut progress = false;
            for (_, a, b) in edges {
                run.check()?;
                let alive = self.complex.is_alive(a) && self.complex.is_alive(b);
                if !alive
                    || self.length(a, b) > self.short(a, b)
                    || (self.pinned[a as usize] && self.pinned[b as usize])
                {
                    continue;
                }
                if self.complex.link_condition(a, b, &mut scratch) {
                    self.merge(a, b);
                    progress = true;
                }
            }
            any |= progress;
            if !progress {
                return Ok(any);
            }
        }
    }

    /// Length below which an edge collapses.
    fn short(&self, a: u32, b: u32) -> f64 {
        let radius = self.radii[a as usize].min(self.radii[b as usize]);
        self.weights.short.min(self.weights.short_of_radius * radius)
    }

    fn length(&self, a: u32, b: u32) -> f64 {
        nalgebra::distance(&self.complex.positions[a as usize], &self.complex.positions[b as usize])
    }

    fn short_edges(&self) -> Vec<(Cost, u32, u32)> {
        let mut edges = Vec::new();
        for [a, b, c] in self.complex.faces() {
            for (a, b) in [(a, b), (b, c), (c, a)] {
                let length = self.length(a, b);
                if length < self.short(a, b) {
                    edges.push((Cost::new(length), a.min(b), a.max(b)));
                }
            }
        }
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    fn merge(&mut self, a: u32, b: u32) {
        let (gone, kept) = if self.pinned[a as usize] { (b, a) } else { (a, b) };
        let (g, k) = (gone as usize, kept as usize);
        let sum = self.mass[g] + self.mass[k];
        let share = if sum > 0.0 { self.mass[g] / sum } else { 0.5 };
        if !self.pinned[k] {
            let toward = self.complex.positions[g] - self.complex.positions[k];
            self.complex.positions[k] += toward * share;
            let toward = self.centers[g] - self.centers[k];
            self.centers[k] += toward * share;
            self.radii[k] += (self.radii[g] - self.radii[k]) * share;
        }
        self.mass[k] = sum;
        self.complex.collapse(gone, kept);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_vertex_that_has_left_its_neighbors_comes_back_among_them() {
        let ball = shapes::icosphere(2);
        let complex = Complex::new(ball.positions().to_vec(), ball.triangles().to_vec());
        let balls = vec![Ball { center: Point3::origin(), radius: 1.0 }; ball.vertex_count()];
        let weights = Weights {
            contraction: 1.0,
            hold: 0.1,
            medial: 0.3,
            growth: 1.2,
            short: 0.03,
            short_of_radius: 0.3,
            rounds: 3,
            still: 1e-4,
        };
        let mut pinned = vec![false; ball.vertex_count()];
        pinned[9] = true;
        let contraction = Contraction::new(complex, &balls, pinned, weights);
        let system = NormalEquations::analyze(&contraction.complex).unwrap();
        let halved: Vec<_> = ball.positions().iter().map(|p| Point3::from(p.coords * 0.5)).collect();
        let mut moved = halved.clone();
        for far in [5, 9] {
            moved[far] = Point3::new(7.0, 0.0, 1.0);
        }
        contraction.call_back(&system, &mut moved);
        assert_eq!(moved[9], Point3::new(7.0, 0.0, 1.0), "what is pinned stays");
        assert!(nalgebra::distance(&moved[5], &halved[5]) < 0.1, "{}", moved[5]);
        let others = (0..halved.len()).filter(|v| ![5, 9].contains(v));
        assert!(others.into_iter().all(|v| moved[v] == halved[v]));
    }
}
