//! Tips of a surface: prominent maxima of the geodesic distance from its center.
//!
//! The center is the vertex with the least sum of distances to a few mutually far vertices. Vertices are visited in descending order of the
//! distance `d` from the center (superlevel-set filtration): a vertex without a higher neighbor starts a component; when two components
//! meet at a saddle at `d`, the one with the lower maximum `d'` ends, with persistence `d' − d`. Maxima of sufficient persistence are
//! tips: bumps do not count, however many there are.
//!
//! Lengths may be scaled per vertex. In units of the local radius of the shape slim limbs are long and persistent even if they turn aside or
//! back.
//!
//! # Reference
//! H. Edelsbrunner, D. Letscher, A. Zomorodian, *Topological persistence and simplification*, Discrete Comput. Geom. 28 (2002); distances
//! are along edges (E. W. Dijkstra 1959).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::complex::Complex;
use super::order::Cost;

/// Number of far vertices that determine the center.
const FAR_VERTICES: usize = 8;

/// Adjacent vertices of each vertex.
type Around = Vec<Vec<u32>>;

/// A local maximum of the distance.
pub(super) struct Maximum {
    pub(super) vertex: u32,
    /// Persistence: height above the saddle at which its component ends; infinite for the global maximum.
    pub(super) persistence: f64,
}

/// A surface with its geodesic center.
pub(super) struct GeodesicExtrema<'a> {
    complex: &'a Complex,
    around: Around,
    middle: Option<u32>,
}

impl<'a> GeodesicExtrema<'a> {
    pub(super) fn new(complex: &'a Complex) -> Self {
        let mut around = vec![Vec::new(); complex.positions.len()];
        complex.vertices().for_each(|v| complex.neighbors(v, &mut around[v as usize]));
        let middle = complex.vertices().next().map(|first| middle(complex, &around, first));
        Self { complex, around, middle }
    }

    /// All maxima, with lengths in the `unit` at each vertex.
    pub(super) fn maxima(&self, unit: &dyn Fn(u32) -> f64) -> Vec<Maximum> {
        let Some(middle) = self.middle else { return Vec::new() };
        let height = distances(self.complex, &self.around, middle, unit);
        maxima(self.complex, &self.around, &height)
    }
}

/// The vertex with the least sum of distances to a few mutually far vertices.
fn middle(complex: &Complex, around: &Around, first: u32) -> u32 {
    let distances = |from: u32| distances(complex, around, from, &|_| 1.0);
    let mut sum = vec![0.0; complex.positions.len()];
    let mut nearest = distances(first);
    for _ in 0..FAR_VERTICES {
        let from = distances(farthest(complex, &nearest));
        for v in complex.vertices().map(|v| v as usize) {
            sum[v] += from[v];
            nearest[v] = nearest[v].min(from[v]);
        }
    }
    complex.vertices().min_by_key(|v| (Cost::new(sum[*v as usize]), *v)).unwrap_or(first)
}

fn farthest(complex: &Complex, distance: &[f64]) -> u32 {
    let by = |v: &u32| (Cost::new(distance[*v as usize]), Reverse(*v));
    complex.vertices().max_by_key(by).expect("there is a first vertex")
}

/// Lengths of shortest paths along edges; edge lengths are divided by the mean unit of their ends.
fn distances(complex: &Complex, around: &Around, from: u32, unit: &dyn Fn(u32) -> f64) -> Vec<f64> {
    let mut distance = vec![f64::INFINITY; complex.positions.len()];
    distance[from as usize] = 0.0;
    let mut heap = BinaryHeap::from([Reverse((Cost::new(0.0), from))]);
    let mut done = vec![false; complex.positions.len()];
    while let Some(Reverse((_, v))) = heap.pop() {
        if std::mem::replace(&mut done[v as usize], true) {
            continue;
        }
        for &u in &around[v as usize] {
            let length = nalgebra::distance(&complex.positions[v as usize], &complex.positions[u as usize]);
            let there = distance[v as usize] + 2.0 * length / (unit(v) + unit(u));
            if there < distance[u as usize] {
                distance[u as usize] = there;
                heap.push(Reverse((Cost::new(there), u)));
            }
        }
    }
    distance
}

/// The maximum of the component that contains `v` (union–find without compression).
fn hill_of(top: &[u32], into: &[u32], v: u32) -> u32 {
    let mut hill = top[v as usize];
    while into[hill as usize] != hill {
        hill = into[hill as usize];
    }
    hill
}

fn maxima(complex: &Complex, around: &Around, height: &[f64]) -> Vec<Maximum> {
    let mut order: Vec<u32> = complex.vertices().filter(|v| height[*v as usize].is_finite()).collect();
    order.sort_by_key(|v| (Reverse(Cost::new(height[*v as usize])), *v));
    let mut top = vec![u32::MAX; complex.positions.len()];
    let mut into: Vec<u32> = (0..complex.positions.len() as u32).collect();
    let mut maxima = Vec::new();
    if let Some(highest) = order.first() {
        maxima.push(Maximum { vertex: *highest, persistence: f64::INFINITY });
    }
    for &v in &order {
        let mut hills: Vec<u32> = around[v as usize]
            .iter()
            .filter(|u| top[**u as usize] != u32::MAX)
            .map(|u| hill_of(&top, &into, *u))
            .collect();
        hills.sort_by_key(|t| (Reverse(Cost::new(height[*t as usize])), *t));
        hills.dedup();
        let Some(highest) = hills.first().copied() else {
            top[v as usize] = v;
            continue;
        };
        top[v as usize] = highest;
        for &lower in &hills[1..] {
            maxima.push(Maximum { vertex: lower, persistence: height[lower as usize] - height[v as usize] });
            into[lower as usize] = highest;
        }
    }
    maxima
}
