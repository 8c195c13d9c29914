//! Rotations of the handles spread over the surface, harmonically.
//!
//! ```text
//! R_v = R_ref exp[u_v]ₓ,     L u = 0 between the handles,     u = log(R_refᵀ R) on them
//! ```
//!
//! with `R_ref` the rotation of the largest patch of handles of the same part of the surface. Where all handles share one
//! rotation, `u` vanishes and every vertex has it exactly. Rotations that are not given are fitted to the targets: of each
//! connected patch of handles by itself as far as it shows its rotation, the rest from all handles of the part together.
//!
//! # Reference
//! R. Zayer, C. Rössl, Z. Karni, H.-P. Seidel, *Harmonic guidance for surface deformation*, Computer Graphics Forum 24
//! (2005), with the logarithm in place of interpolated quaternions.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::HandlePose;
use super::bound::Bound;
use super::held_laplacian::HeldLaplacian;
use super::lanes::Lanes;
use super::rotation_fit::best_rotation;
use plumbline_num::spatial::UnionFind;

/// Connected patches of handles: computed once per set.
#[derive(Debug)]
pub(super) struct Patches {
    /// Patch of each handle.
    patch: Vec<usize>,
    /// Part of the surface (its lowest vertex) that each patch lies on.
    part: Vec<u32>,
    /// Handles per patch.
    size: Vec<usize>,
}

impl Patches {
    pub(super) fn new(bound: &Bound) -> Self {
        let handles = bound.held.handles.vertices();
        let mut sets = UnionFind::new(handles.len());
        let mut number = vec![usize::MAX; bound.rest.len()];
        handles.iter().enumerate().for_each(|(k, &v)| number[v as usize] = k);
        for &[a, b, c] in bound.gauge.rest().triangles() {
            for (v, w) in [(a, b), (b, c), (c, a)] {
                let (v, w) = (number[v as usize], number[w as usize]);
                if v != usize::MAX && w != usize::MAX {
                    sets.join(v as u32, w as u32);
                }
            }
        }
        let roots = sets.roots();
        let mut name = vec![usize::MAX; handles.len()];
        let (mut part, mut size) = (Vec::new(), Vec::new());
        for (k, &r) in roots.iter().enumerate() {
            if r as usize == k {
                name[k] = part.len();
                part.push(bound.held.part[handles[k] as usize]);
                size.push(0);
            }
            size[name[r as usize]] += 1;
        }
        Self { patch: roots.iter().map(|&r| name[r as usize]).collect(), part, size }
    }

    /// Rotation of every vertex for a pose: those given, or fitted, spread over the surface.
    pub(super) fn turns(
        &self,
        bound: &Bound,
        system: &mut HeldLaplacian,
        pose: &HandlePose,
        targets: &[Lanes],
    ) -> Vec<UnitQuaternion<f64>> {
        match pose.rotations() {
            Some(given) => self.spread(bound, system, given),
            None => self.spread(bound, system, &self.fitted(bound, targets)),
        }
    }

    /// Rotation of each handle: of its patch, fitted to the targets.
    fn fitted(&self, bound: &Bound, targets: &[Lanes]) -> Vec<UnitQuaternion<f64>> {
        let places = |k: usize| {
            let v = bound.held.handles.vertices()[k] as usize;
            (Vector3::from(bound.rest[v].xyz()), Vector3::from(targets[k].xyz()))
        };
        let part_of = |k: usize| self.part[self.patch[k]] as usize;
        let of_parts = procrustes(bound.rest.len(), self.patch.len(), part_of, places, |_| UnitQuaternion::identity());
        let of_patches = procrustes(
            self.size.len(),
            self.patch.len(),
            |k| self.patch[k],
            places,
            |p| of_parts[self.part[p] as usize],
        );
        self.patch.iter().map(|&p| of_patches[p]).collect()
    }

    /// Rotation of every vertex, from those of the handles; identity on parts without one.
    fn spread(
        &self,
        bound: &Bound,
        system: &mut HeldLaplacian,
        turns: &[UnitQuaternion<f64>],
    ) -> Vec<UnitQuaternion<f64>> {
        let reference = self.references(bound, turns);
        let logs: Vec<Lanes> = (0..turns.len())
            .map(|k| {
                let of_part = &reference[self.part[self.patch[k]] as usize];
                Lanes::point(relative(of_part, &turns[k]).into())
            })
            .collect();
        let mut field = vec![Lanes::ZERO; bound.rest.len()];
        if logs.iter().any(|&u| u != Lanes::ZERO) {
            for (&v, &u) in bound.held.handles.vertices().iter().zip(&logs) {
                field[v as usize] = u;
            }
            let zero = vec![Lanes::ZERO; bound.rest.len()];
            let pull = system.pull(&field, &logs);
            system.solve(&zero, &pull, &mut field);
        }
        let turn = |(u, &part): (&Lanes, &u32)| {
            reference[part as usize] * UnitQuaternion::from_scaled_axis(Vector3::from(u.xyz()))
        };
        field.iter().zip(&bound.held.part).map(turn).collect()
    }

    /// Rotation of the largest patch of each part, by the part's lowest vertex.
    fn references(&self, bound: &Bound, turns: &[UnitQuaternion<f64>]) -> Vec<UnitQuaternion<f64>> {
        let mut reference = vec![UnitQuaternion::identity(); bound.rest.len()];
        let mut largest = vec![0; bound.rest.len()];
        for (k, &patch) in self.patch.iter().enumerate() {
            let part = self.part[patch] as usize;
            if self.size[patch] > largest[part] {
                largest[part] = self.size[patch];
                reference[part] = turns[k];
            }
        }
        reference
    }
}

/// The rotation that carries all handles best.
pub(super) fn overall_turn(bound: &Bound, targets: &[Lanes]) -> UnitQuaternion<f64> {
    let places = |k: usize| {
        let v = bound.held.handles.vertices()[k] as usize;
        (Vector3::from(bound.rest[v].xyz()), Vector3::from(targets[k].xyz()))
    };
    procrustes(1, targets.len(), |_| 0, places, |_| UnitQuaternion::identity())[0]
}

/// `log(Rᵀ_from R_to)` with an angle of at most π; exactly zero for equal rotations.
fn relative(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> Vector3<f64> {
    if from == to { Vector3::zeros() } else { (from.inverse() * to).scaled_axis() }
}

/// The rotation about their centers that fits the targets of each group of handles best, near `last(group)` where the
/// group does not show it.
fn procrustes(
    groups: usize,
    handles: usize,
    group_of: impl Fn(usize) -> usize,
    places: impl Fn(usize) -> (Vector3<f64>, Vector3<f64>),
    last: impl Fn(usize) -> UnitQuaternion<f64>,
) -> Vec<UnitQuaternion<f64>> {
    let mut sums = vec![(0.0, Vector3::zeros(), Vector3::zeros()); groups];
    for k in 0..handles {
        let (p, x) = places(k);
        let sum = &mut sums[group_of(k)];
        *sum = (sum.0 + 1.0, sum.1 + p, sum.2 + x);
    }
    let mut covariances = vec![Matrix3::zeros(); groups];
    for k in 0..handles {
        let ((p, x), group) = (places(k), group_of(k));
        let (count, sum_p, sum_x) = sums[group];
        covariances[group] += (p - sum_p / count) * (x - sum_x / count).transpose();
    }
    covariances.iter().enumerate().map(|(g, s)| best_rotation(s, &last(g))).collect()
}
