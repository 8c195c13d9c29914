//! Harmonic interpolation of the handle rotations over the surface.
//!
//! ```text
//! R_v = R_ref exp[u_v]ₓ,     L u = 0 between the handles,     u = log(R_refᵀ R) on them
//! ```
//!
//! with `R_ref` the rotation of the largest patch of handles of the same connected component. Where all handles have the same
//! rotation, `u` vanishes and every vertex has it exactly. Rotations that are not given are fitted to the targets of each
//! connected patch of handles; rotations that a patch does not determine are those fitted to all handles of the component.
//!
//! # Reference
//! R. Zayer, C. Rössl, Z. Karni, H.-P. Seidel, *Harmonic guidance for surface deformation*, Computer Graphics Forum 24
//! (2005), with the logarithm instead of interpolated quaternions.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::HandlePose;
use super::bound::Bound;
use super::handle_laplacian::HandleLaplacian;
use super::lanes::Lanes;
use super::rotation_fit::best_rotation;
use plumbline_num::spatial::numbered_components;

/// The connected patches of handles.
#[derive(Debug)]
pub(super) struct Patches {
    /// Patch of each handle.
    patch: Vec<usize>,
    /// Connected component (its lowest vertex) of each patch.
    component: Vec<u32>,
    /// Handles per patch.
    size: Vec<usize>,
}

impl Patches {
    pub(super) fn new(bound: &Bound) -> Self {
        let handles = bound.unknowns.handles.vertices();
        let mut edges = Vec::new();
        let mut number = vec![usize::MAX; bound.rest.len()];
        handles.iter().enumerate().for_each(|(k, &v)| number[v as usize] = k);
        for &[a, b, c] in bound.metrics.rest().triangles() {
            for (v, w) in [(a, b), (b, c), (c, a)] {
                let (v, w) = (number[v as usize], number[w as usize]);
                if v != usize::MAX && w != usize::MAX {
                    edges.push([v as u32, w as u32, w as u32]);
                }
            }
        }
        let (patch, count) = numbered_components(handles.len(), &edges);
        let patch: Vec<usize> = patch.into_iter().map(|p| p as usize).collect();
        let (mut component, mut size) = (vec![0; count], vec![0; count]);
        for (&p, &v) in patch.iter().zip(handles) {
            component[p] = bound.unknowns.component[v as usize];
            size[p] += 1;
        }
        Self { patch, component, size }
    }

    /// Rotation of every vertex for a pose: the given or fitted handle rotations, interpolated.
    pub(super) fn rotations(
        &self,
        bound: &Bound,
        system: &mut HandleLaplacian,
        pose: &HandlePose,
        targets: &[Lanes],
    ) -> Vec<UnitQuaternion<f64>> {
        match pose.rotations() {
            Some(given) => self.interpolated(bound, system, given),
            None => self.interpolated(bound, system, &self.fitted(bound, targets)),
        }
    }

    /// Largest rotation of a handle against the reference of its component, in radians.
    pub(super) fn largest_rotation(&self, bound: &Bound, pose: &HandlePose, targets: &[Lanes]) -> f64 {
        let fitted;
        let rotations = if let Some(given) = pose.rotations() {
            given
        } else {
            fitted = self.fitted(bound, targets);
            &fitted
        };
        let reference = self.references(bound, rotations);
        let angle = |(k, r): (usize, &UnitQuaternion<f64>)| {
            relative(&reference[self.component[self.patch[k]] as usize], r).norm()
        };
        rotations.iter().enumerate().map(angle).fold(0.0, f64::max)
    }

    /// The pose at a fraction of the way from rest: each patch along the screw motion of its fitted rotation and its centroid, with the
    /// same fraction of what its targets differ from that motion.
    pub(super) fn partway(&self, bound: &Bound, pose: &HandlePose, targets: &[Lanes], fraction: f64) -> HandlePose {
        if fraction == 1.0 {
            return pose.clone();
        }
        let vertices = bound.unknowns.handles.vertices();
        let rest = |k: usize| Vector3::from(bound.rest[vertices[k] as usize].xyz());
        let target = |k: usize| Vector3::from(targets[k].xyz());
        let mut centroids = vec![(Vector3::zeros(), Vector3::zeros()); self.size.len()];
        for (k, &patch) in self.patch.iter().enumerate() {
            let (from, to) = &mut centroids[patch];
            *from += rest(k) / self.size[patch] as f64;
            *to += target(k) / self.size[patch] as f64;
        }
        let rotations = self.fitted(bound, targets);
        let position = |k: usize| {
            let (from, to) = centroids[self.patch[k]];
            let motion = Screw::new(&rotations[k], from, to);
            motion.moved(rest(k), fraction) + fraction * (target(k) - motion.moved(rest(k), 1.0))
        };
        let positions = (0..vertices.len()).map(|k| bound.uncentered(position(k))).collect();
        let partway = HandlePose::new(positions);
        match pose.rotations() {
            Some(given) => partway.with_rotations(given.iter().map(|r| r.powf(fraction)).collect()),
            None => partway,
        }
    }

    /// Rotation of each handle: that of its patch, fitted to the targets.
    fn fitted(&self, bound: &Bound, targets: &[Lanes]) -> Vec<UnitQuaternion<f64>> {
        let component_of = |k: usize| self.component[self.patch[k]] as usize;
        let of_components = procrustes(bound, targets, bound.rest.len(), component_of, |_| UnitQuaternion::identity());
        let of_patches = procrustes(
            bound,
            targets,
            self.size.len(),
            |k| self.patch[k],
            |p| of_components[self.component[p] as usize],
        );
        self.patch.iter().map(|&p| of_patches[p]).collect()
    }

    /// Rotation of every vertex, interpolated between the handles; identity on components without one.
    fn interpolated(
        &self,
        bound: &Bound,
        system: &mut HandleLaplacian,
        rotations: &[UnitQuaternion<f64>],
    ) -> Vec<UnitQuaternion<f64>> {
        let reference = self.references(bound, rotations);
        let logs: Vec<Lanes> = (0..rotations.len())
            .map(|k| {
                let of_component = &reference[self.component[self.patch[k]] as usize];
                Lanes::point(relative(of_component, &rotations[k]).into())
            })
            .collect();
        let mut field = vec![Lanes::ZERO; bound.rest.len()];
        if logs.iter().any(|&u| u != Lanes::ZERO) {
            for (&v, &u) in bound.unknowns.handles.vertices().iter().zip(&logs) {
                field[v as usize] = u;
            }
            let zero = vec![Lanes::ZERO; bound.rest.len()];
            let pull = system.pull(&field, &logs);
            system.solve(&zero, &pull, &mut field);
        }
        let rotation = |(u, &component): (&Lanes, &u32)| {
            reference[component as usize] * UnitQuaternion::from_scaled_axis(Vector3::from(u.xyz()))
        };
        field.iter().zip(&bound.unknowns.component).map(rotation).collect()
    }

    /// Rotation of the largest patch of each component, indexed by the component's lowest vertex.
    fn references(&self, bound: &Bound, rotations: &[UnitQuaternion<f64>]) -> Vec<UnitQuaternion<f64>> {
        let mut reference = vec![UnitQuaternion::identity(); bound.rest.len()];
        let mut largest = vec![0; bound.rest.len()];
        for (k, &patch) in self.patch.iter().enumerate() {
            let component = self.component[patch] as usize;
            if self.size[patch] > largest[component] {
                largest[component] = self.size[patch];
                reference[component] = rotations[k];
            }
        }
        reference
    }
}

/// Angle below which a screw motion is a translation, in radians: its axis is far away.
const MIN_SCREW_ANGLE: f64 = 1e-6;

/// A screw motion: a rotation about an axis with a translation along it (Chasles).
struct Screw {
    /// Axis times angle.
    log: Vector3<f64>,
    /// A point on the axis.
    center: Vector3<f64>,
    translation: Vector3<f64>,
}

impl Screw {
    /// The motion of a rotation that moves a point `from` to `to`.
    fn new(rotation: &UnitQuaternion<f64>, from: Vector3<f64>, to: Vector3<f64>) -> Self {
        let (log, shift) = (rotation.scaled_axis(), to - from);
        let angle = log.norm();
        if angle < MIN_SCREW_ANGLE {
            return Self { log, center: from, translation: shift };
        }
        let axis = log / angle;
        let translation = axis * axis.dot(&shift);
        let across = shift - translation;
        let center = from + 0.5 * (across + axis.cross(&across) / (0.5 * angle).tan());
        Self { log, center, translation }
    }

    /// Position of a point after a fraction of the motion.
    fn moved(&self, p: Vector3<f64>, fraction: f64) -> Vector3<f64> {
        let rotation = UnitQuaternion::from_scaled_axis(fraction * self.log);
        self.center + rotation * (p - self.center) + fraction * self.translation
    }
}

/// The rotation that fits the targets of all handles best.
pub(super) fn overall_rotation(bound: &Bound, targets: &[Lanes]) -> UnitQuaternion<f64> {
    procrustes(bound, targets, 1, |_| 0, |_| UnitQuaternion::identity())[0]
}

/// `log(Rᵀ_from R_to)` with an angle of at most π; exactly zero for equal rotations.
fn relative(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> Vector3<f64> {
    if from == to { Vector3::zeros() } else { (from.inverse() * to).scaled_axis() }
}

/// The best rotation of each group of handles from rest to the targets, near `last(group)` where the group does not determine
/// it.
fn procrustes(
    bound: &Bound,
    targets: &[Lanes],
    groups: usize,
    group_of: impl Fn(usize) -> usize,
    last: impl Fn(usize) -> UnitQuaternion<f64>,
) -> Vec<UnitQuaternion<f64>> {
    let vertices = bound.unknowns.handles.vertices();
    let points = |k: usize| (Vector3::from(bound.rest[vertices[k] as usize].xyz()), Vector3::from(targets[k].xyz()));
    let mut sums = vec![(0.0, Vector3::zeros(), Vector3::zeros()); groups];
    for k in 0..vertices.len() {
        let (p, x) = points(k);
        let sum = &mut sums[group_of(k)];
        *sum = (sum.0 + 1.0, sum.1 + p, sum.2 + x);
    }
    let mut covariances = vec![Matrix3::zeros(); groups];
    for k in 0..vertices.len() {
        let ((p, x), group) = (points(k), group_of(k));
        let (count, sum_p, sum_x) = sums[group];
        covariances[group] += (p - sum_p / count) * (x - sum_x / count).transpose();
    }
    covariances.iter().enumerate().map(|(g, s)| best_rotation(s, &last(g))).collect()
}
