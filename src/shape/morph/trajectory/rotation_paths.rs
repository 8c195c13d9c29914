//! Paths of the rotations of triangles from the identity, continuous over the surface.
//!
//! If all angles are well below π, `Rₜ(τ) = exp(τ log Rₜ)`. Otherwise the logarithm is not unique and discontinuous over the
//! surface. Then a triangle rotates relative to a neighbor `p`,
//!
//! ```text
//! Rₜ(τ) = Rₚ(τ) exp(τ log Rₚᵀ Rₜ),
//! ```
//!
//! along the minimum spanning tree of the differences between neighbors, rooted at the least rotation: a part twisted by two full
//! turns keeps them. Both cases are symmetric: the inverse rotations from the other end give the same interpolation.
//!
//! # Reference
//! D. Xu, H. Zhang, Q. Wang, H. Bao, *Poisson shape interpolation*, SPM 2005, for rotations relative to neighbors.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};

use crate::mesh::{HalfEdges, edge_groups};

/// Quantization of angles, rad, so that rounding does not change the tree.
const ANGLE_STEP: f64 = 1e-9;

/// Maximum angle for direct logarithms, at a margin from their discontinuity at π. Relative rotations depend slightly on the tree,
/// hence they are used only where necessary.
const MAX_DIRECT_ANGLE: f64 = 0.85 * PI;

/// The rotation path of every triangle.
#[derive(Clone, Debug)]
pub(super) struct RotationPaths {
    /// The neighbor to which the rotation is relative; itself for an absolute one.
    parent: Vec<u32>,
    /// Rotation vector at time 1.
    rotation_vector: Vec<Vector3<f64>>,
    /// Triangles in topological order, parents first.
    order: Vec<u32>,
    /// All angles are well below π.
    unique: bool,
}

impl RotationPaths {
    /// The paths to these rotations; a triangle without one follows its parent.
    pub(super) fn new(triangles: &[[u32; 3]], rotations: &[Option<UnitQuaternion<f64>>]) -> Self {
        let (tree, order) = tree(triangles, rotations);
        let unique = rotations.iter().flatten().all(|r| r.angle() < MAX_DIRECT_ANGLE);
        let mut this =
            Self { rotation_vector: vec![Vector3::zeros(); tree.len()], parent: tree.clone(), order, unique };
        let mut reached: Vec<UnitQuaternion<f64>> = vec![UnitQuaternion::identity(); tree.len()];
        for &t in &this.order {
            let (t, p) = (t as usize, tree[t as usize] as usize);
            reached[t] = rotations[t].unwrap_or(reached[p]);
            if unique || p == t {
                this.parent[t] = t as u32;
                this.rotation_vector[t] = reached[t].scaled_axis();
            } else {
                this.rotation_vector[t] = (reached[p].inverse() * reached[t]).scaled_axis();
            }
        }
        this
    }

    /// Whether all angles are well below π, so that there is one path.
    pub(super) fn is_unique(&self) -> bool {
        self.unique
    }

    /// `Rₜ(τ)` and `Rₜ(τ) Rₜ(1)⁻¹` for one time per triangle.
    pub(super) fn at(&self, times: &[f64]) -> Vec<[UnitQuaternion<f64>; 2]> {
        let Some(&time) = times.first() else { return Vec::new() };
        if times.iter().any(|t| *t != time) {
            return (0..times.len()).map(|t| self.of_chain(t, times[t])).collect();
        }
        let mut rotations = vec![[UnitQuaternion::identity(); 2]; times.len()];
        let mut whole = vec![UnitQuaternion::identity(); times.len()];
        for &t in &self.order {
            let (t, p) = (t as usize, self.parent[t as usize] as usize);
            let before = if p == t { UnitQuaternion::identity() } else { whole[p] };
            let ahead = if p == t { UnitQuaternion::identity() } else { rotations[p][0] };
            rotations[t] = step(&ahead, &before, &self.rotation_vector[t], time);
            whole[t] = before * UnitQuaternion::from_scaled_axis(self.rotation_vector[t]);
        }
        rotations
    }

    fn of_chain(&self, triangle: usize, time: f64) -> [UnitQuaternion<f64>; 2] {
        let mut chain = vec![triangle];
        while let Some(&t) = chain.last().filter(|&&t| self.parent[t] as usize != t) {
            chain.push(self.parent[t] as usize);
        }
        let (mut whole, mut at) = (UnitQuaternion::identity(), [UnitQuaternion::identity(); 2]);
        for t in chain.into_iter().rev() {
            at = step(&at[0], &whole, &self.rotation_vector[t], time);
            whole *= UnitQuaternion::from_scaled_axis(self.rotation_vector[t]);
        }
        at
    }
}

/// `Rₚ(τ) exp(τ δ)` and `Rₚ(τ) exp((τ − 1) δ) Rₚ⁻¹`.
fn step(
    ahead: &UnitQuaternion<f64>,
    before: &UnitQuaternion<f64>,
    rotation_vector: &Vector3<f64>,
    time: f64,
) -> [UnitQuaternion<f64>; 2] {
    let by = |fraction: f64| UnitQuaternion::from_scaled_axis(rotation_vector * fraction);
    [ahead * by(time), ahead * by(time - 1.0) * before.inverse()]
}

/// Minimum spanning forest (Prim): the parent of each triangle, itself at the roots, and the order of visits.
fn tree(triangles: &[[u32; 3]], rotations: &[Option<UnitQuaternion<f64>>]) -> (Vec<u32>, Vec<u32>) {
    let neighbors = neighbors(triangles);
    let least = |t: usize| rotations[t].as_ref().map_or(i64::MAX, |r| quantized(r.angle()));
    let mut roots: Vec<usize> = (0..triangles.len()).collect();
    roots.sort_by_key(|&t| least(t));
    let (mut from, mut order) = (vec![u32::MAX; triangles.len()], Vec::with_capacity(triangles.len()));
    let mut queue = BinaryHeap::new();
    for root in roots {
        queue.push(Reverse((0, root as u32, root as u32)));
        while let Some(Reverse((_, t, before))) = queue.pop() {
            if from[t as usize] != u32::MAX {
                continue;
            }
            from[t as usize] = before;
            order.push(t);
            for &u in neighbors[t as usize].iter().filter(|&&u| from[u as usize] == u32::MAX) {
                queue.push(Reverse((difference(rotations, t as usize, u as usize), u, t)));
            }
        }
    }
    (from, order)
}

/// Quantized angle between two neighbors; maximal for those without a rotation.
fn difference(rotations: &[Option<UnitQuaternion<f64>>], t: usize, u: usize) -> i64 {
    match (&rotations[t], &rotations[u]) {
        (Some(a), Some(b)) => quantized(a.angle_to(b)),
        _ => i64::MAX,
    }
}

fn quantized(angle: f64) -> i64 {
    (angle / ANGLE_STEP).round() as i64
}

/// The triangles with a common edge, for each triangle.
pub(in crate::morph) fn neighbors(triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut neighbors = vec![Vec::new(); triangles.len()];
    for edge in edge_groups(triangles.as_flattened()).iter() {
        for pair in edge.windows(2) {
            let [t, u] = [HalfEdges::triangle(pair[0].1), HalfEdges::triangle(pair[1].1)];
            neighbors[t as usize].push(u);
            neighbors[u as usize].push(t);
        }
    }
    neighbors
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// A strip of triangles.
    fn strip(n: u32) -> Vec<[u32; 3]> {
        (0..n).map(|t| if t % 2 == 0 { [t, t + 1, t + 2] } else { [t + 1, t, t + 2] }).collect()
    }

    #[test]
    fn a_strip_twisted_by_three_turns_is_twisted_by_half_of_them_at_half_time() {
        let axis = Vector3::new(1.0, -2.0, 0.5).normalize();
        for revolutions in [0.2, 3.0] {
            let angle = |t: u32| TAU * revolutions * (f64::from(t) - 20.0) / 99.0;
            let turned = |t: u32, share: f64| UnitQuaternion::from_scaled_axis(axis * (share * angle(t)));
            let rotations: Vec<_> = (0..100).map(|t| (t != 60).then(|| turned(t, 1.0))).collect();
            let paths = RotationPaths::new(&strip(100), &rotations);
            let varied: Vec<f64> = (0..100).map(|t| f64::from(t) / 99.0).collect();
            for times in [vec![0.5; 100], varied] {
                let found = paths.at(&times);
                for t in (0..100_u32).filter(|&t| t != 60) {
                    let [ahead, back] = &found[t as usize];
                    let time = times[t as usize];
                    assert!(ahead.angle_to(&turned(t, time)) < 1e-6, "{revolutions} {t}");
                    assert!(back.angle_to(&turned(t, time - 1.0)) < 1e-6, "{revolutions} {t}");
                }
                // The triangle without a rotation follows its neighbor.
                assert!(found[60][0].angle_to(&turned(60, times[60])) < TAU * revolutions / 99.0 + 1e-6);
            }
        }
    }
}
