//! Contraction of the surface to a curve.
//!
//! Each iteration solves, in the least-squares sense, for positions `x'` from those of the last iteration `x`:
//!
//! ```text
//! E = Σᵢ w_Lᵢ² ‖(L x')ᵢ‖²  +  Σᵢ mᵢ w_Hᵢ² ‖x'ᵢ − xᵢ‖²  +  Σᵢ mᵢ w_M² ‖x'ᵢ − cᵢ‖²
//! w_Lᵢ = w_L s_Lᵗ ρᵢ² / √(aᵢ ā),   w_Hᵢ² = w_H² aᵢ / Aᵢ,   mᵢ = aᵢ / ā
//! ```
//!
//! with `L` the current cotangent Laplacian in iteration `t`, `aᵢ` the initial area of a vertex and `Aᵢ` its current one, `ā` the mean of the
//! former, `ρᵢ` the local radius of the shape and `cᵢ` the center of the medial ball. The first term drives the surface to zero mean
//! curvature: thin parts move inward along their normals. The second damps the motion, more as area is lost; the third keeps the
//! contracted parts on the medial axis and prevents branches from shortening. The normal equations
//!
//! `(Lᵀ W_L² L + M (W_H² + w_M²)) x' = M (W_H² x + w_M² c)`
//!
//! are sparse and positive definite: one factorization and three right-hand sides per iteration.
//!
//! After each iteration short edges collapse under the link condition, so that systems shrink with the surface. A merged vertex has the
//! summed area and the mean center. If no edge collapsed, the symbolic analysis is reused.
//!
//! Departures from Au et al.: `w_L` is in units of the local radius, so that fingers and trunks contract in the same iterations, and grows by
//! 1.2 per iteration instead of 2; vertices merge and are attracted by medial centers, as in Tagliasacchi et al. (there Voronoi poles);
//! edge weights are clamped to be non-negative, which sacrifices linear precision at slivers; vertices that lost their area are not
//! contracted further, or limbs would shrink along their axes. Pinned vertices have a large weight.
//!
//! # Reference
//! O. K.-C. Au, C.-L. Tai, H.-K. Chu, D. Cohen-Or, T.-Y. Lee, *Skeleton extraction by mesh contraction*, SIGGRAPH 2008, section
//! 4; A. Tagliasacchi, I. Alhashim, M. Olson, H. Zhang, *Mean curvature skeletons*, SGP 2012, sections 3 and 4.

use nalgebra::{Point3, Vector3};

use super::ExtractionOptions;
use super::budget::Budget;
use super::complex::Complex;
use super::medial::Ball;
use super::normal_equations::NormalEquations;
use super::order::Cost;
use crate::character::CharacterError;
use plumbline_num::run::{Run, Stopped};

/// Growth factor of the contraction weight per iteration; Au et al. use 2.
const CONTRACTION_GROWTH: f64 = 1.2;
/// Length below which edges collapse: three quarters of the node spacing. Shorter ones would vanish in resampling.
const COLLAPSE_LENGTH: f64 = 0.03;
/// The same in local radii, for limbs thinner than a tenth of the sphere of equal area: about twenty edges remain around them.
const COLLAPSE_RADII: f64 = 0.3;
/// Loss of area per iteration, relative to the initial area, below which the contraction has converged: twelve further iterations would
/// remove about a thousandth of the area.
const MIN_AREA_LOSS: f64 = 1e-4;
/// Ratio of initial to current area at which a vertex is part of the curve and is not contracted further. At 300 limbs lose their tips, at
/// 10 palms and ears stay sheets.
const MAX_AREA_RATIO: f64 = 30.0;
/// Upper bound of the relative attraction weight of contracted vertices: keeps the system well conditioned.
const MAX_ATTRACTION_RATIO: f64 = 1e6;
/// Weight of pinned vertices relative to others.
const PIN_WEIGHT: f64 = 1e6;

/// Largest number of multiplications of a factorization: about a second. Six thousand vertices of which each is near each other, as where
/// hundreds of sheets meet, would take seventy billion. Such a surface is not contracted further.
const MAX_MULTIPLICATIONS: f64 = 5e9;

/// Distance from the nearest neighbor, in lengths of the longest edge before, at which a vertex has escaped. At 1 tips that move along a limb
/// are called back.
const MAX_ESCAPE_RATIO: f64 = 3.0;

/// A surface being contracted.
pub(super) struct Contraction<'o> {
    pub(super) complex: Complex,
    /// Medial center of each vertex.
    centers: Vec<Point3<f64>>,
    /// Area of each vertex, accumulated by merges.
    pub(super) mass: Vec<f64>,
    /// Local radius of the shape at each vertex.
    radii: Vec<f64>,
    pinned: Vec<bool>,
    options: &'o ExtractionOptions,
    first_area: f64,
    area: f64,
    iteration: usize,
    system: Option<NormalEquations>,
}

impl<'o> Contraction<'o> {
    pub(super) fn new(mut complex: Complex, balls: &[Ball], pinned: Vec<bool>, options: &'o ExtractionOptions) -> Self {
        let area = complex.area();
        complex.budget = Budget::new(complex.triangles.len());
        let centers = balls.iter().map(|b| b.center).collect();
        let radii = balls.iter().map(|b| b.radius).collect();
        let mass = ring_areas(&complex);
        Self { complex, centers, mass, radii, pinned, options, first_area: area, area, iteration: 0, system: None }
    }

    /// Fraction of the initial area that is left.
    pub(super) fn area_left(&self) -> f64 {
        if self.first_area > 0.0 { self.area / self.first_area } else { 0.0 }
    }

    /// One iteration; whether it has converged.
    pub(super) fn step(&mut self, run: &Run) -> Result<bool, CharacterError> {
        self.solve(run)?;
        if self.collapse_short(run)? {
            self.system = None;
        }
        let area = self.complex.area();
        let lost = self.area - area;
        self.area = area;
        self.iteration += 1;
        Ok(lost.abs() < MIN_AREA_LOSS * self.first_area)
    }

    fn solve(&mut self, run: &Run) -> Result<(), CharacterError> {
        let mut system = match self.system.take() {
            Some(system) => system,
            None => match NormalEquations::analyze(&self.complex, MAX_MULTIPLICATIONS)? {
                Some(system) => system,
                None => return Ok(()),
            },
        };
        if system.multiplications() > MAX_MULTIPLICATIONS {
            self.system = Some(system);
            return Ok(());
        }
        let n = system.vertices.len();
        let mean = system.vertices.iter().map(|v| self.mass[*v as usize]).sum::<f64>() / n as f64;
        let w = self.options;
        let (attraction, medial) = (w.attraction * w.attraction, w.medial * w.medial);
        let ring = ring_areas(&self.complex);
        let strength = w.contraction * CONTRACTION_GROWTH.powi(self.iteration as i32);
        let shrunk = |v: u32| self.mass[v as usize] / ring[v as usize].max(1e-300);
        let row = |v: &u32| {
            if shrunk(*v) > MAX_AREA_RATIO {
                return 0.0;
            }
            let m = self.mass[*v as usize];
            strength * self.radii[*v as usize].powi(2) / (m * mean).sqrt()
        };
        let rows: Vec<f64> = system.vertices.iter().map(row).collect();
        let (mut diagonal, mut rhs, mut before) = (vec![0.0; n], vec![0.0; 3 * n], vec![0.0; 3 * n]);
        for (i, &v) in system.vertices.iter().enumerate() {
            let v = v as usize;
            let m = (self.mass[v] / mean).max(1e-6);
            let x = self.complex.positions[v].coords;
            let (weight, wanted) = if self.pinned[v] {
                (PIN_WEIGHT, x * PIN_WEIGHT)
            } else {
                let attraction = attraction * shrunk(v as u32).clamp(1.0, MAX_ATTRACTION_RATIO);
                (m * (attraction + medial), x * (m * attraction) + self.centers[v].coords * (m * medial))
            };
            diagonal[i] = weight;
            for k in 0..3 {
                rhs[k * n + i] = wanted[k];
                before[k * n + i] = x[k];
            }
        }
        system.set(&self.complex, &rows, &diagonal);
        if !system.solve_in_place(&mut rhs, &before, run)? {
            // The surface stays as it is: no area is lost, and the contraction ends.
            self.system = Some(system);
            return Ok(());
        }
        let mut moved = self.complex.positions.clone();
        for (i, &v) in system.vertices.iter().enumerate() {
            let position = Vector3::new(rhs[i], rhs[n + i], rhs[2 * n + i]);
            if position.iter().all(|c| c.is_finite()) && !self.pinned[v as usize] {
                moved[v as usize] = Point3::from(position);
            }
        }
        self.return_escaped(&system, &mut moved);
        self.complex.positions = moved;
        self.system = Some(system);
        Ok(())
    }

    /// Returns vertices that escaped all their neighbors to the neighbors' mean: moving a vertex of almost no area is the cheapest way to flatten
    /// slivers around it.
    fn return_escaped(&self, system: &NormalEquations, moved: &mut [Point3<f64>]) {
        let brought_back = |(i, &v): (usize, &u32)| {
            let around = system.around(i).map(|j| system.vertices[j] as usize);
            let length = |of: &[Point3<f64>], u: usize| nalgebra::distance(&of[v as usize], &of[u]);
            let before = around.clone().map(|u| length(&self.complex.positions, u)).fold(0.0, f64::max);
            let nearest = around.clone().map(|u| length(moved, u)).fold(f64::INFINITY, f64::min);
            if self.pinned[v as usize] || nearest == f64::INFINITY || nearest <= MAX_ESCAPE_RATIO * before {
                return None;
            }
            let sum: Vector3<f64> = around.clone().map(|u| moved[u].coords).sum();
            Some((v, Point3::from(sum / around.count() as f64)))
        };
        let lost: Vec<(u32, Point3<f64>)> = system.vertices.iter().enumerate().filter_map(brought_back).collect();
        for (v, position) in lost {
            moved[v as usize] = position;
        }
    }

    /// Collapses short edges, the shortest first; whether there was one.
    fn collapse_short(&mut self, run: &Run) -> Result<bool, Stopped> {
        let mut scratch = Vec::new();
        let mut any = false;
        loop {
            let mut progress = false;
            self.complex.budget.visit(self.complex.triangles.len());
            for (_, a, b) in self.short_edges() {
                run.check()?;
                if self.complex.budget.is_spent() {
                    return Ok(any | progress);
                }
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
        COLLAPSE_LENGTH.min(COLLAPSE_RADII * radius)
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

/// A third of the area around each vertex.
fn ring_areas(complex: &Complex) -> Vec<f64> {
    let mut areas = vec![0.0; complex.positions.len()];
    for t in complex.faces() {
        let [a, b, c] = t.map(|v| complex.positions[v as usize]);
        let third = (b - a).cross(&(c - a)).norm() / 6.0;
        for v in &t {
            areas[*v as usize] += third;
        }
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn an_escaped_vertex_returns_to_its_neighbors() {
        let ball = shapes::icosphere(2);
        let complex = Complex::new(ball.positions().to_vec(), ball.triangles().to_vec());
        let balls = vec![Ball { center: Point3::origin(), radius: 1.0 }; ball.vertex_count()];
        let options = ExtractionOptions::default();
        let mut pinned = vec![false; ball.vertex_count()];
        pinned[9] = true;
        let contraction = Contraction::new(complex, &balls, pinned, &options);
        let system = NormalEquations::analyze(&contraction.complex, MAX_MULTIPLICATIONS).unwrap().unwrap();
        let halved: Vec<_> = ball.positions().iter().map(|p| Point3::from(p.coords * 0.5)).collect();
        let mut moved = halved.clone();
        for far in [5, 9] {
            moved[far] = Point3::new(7.0, 0.0, 1.0);
        }
        contraction.return_escaped(&system, &mut moved);
        assert_eq!(moved[9], Point3::new(7.0, 0.0, 1.0), "what is pinned stays");
        assert!(nalgebra::distance(&moved[5], &halved[5]) < 0.1, "{}", moved[5]);
        let others = (0..halved.len()).filter(|v| ![5, 9].contains(v));
        assert!(others.into_iter().all(|v| moved[v] == halved[v]));
    }
}
