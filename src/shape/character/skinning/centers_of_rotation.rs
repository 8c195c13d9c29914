//! Skinning with optimized centers of rotation:
//!
//! ```text
//! x'ᵢ = R (xᵢ − cᵢ) + Σⱼ wⱼ Mⱼ cᵢ        R the normalized sum of the joints' quaternions
//!
//!       Σ_t s(wᵢ, w_t) A_t b_t                                        (a_j b_k − a_k b_j)²
//! cᵢ = ────────────────────────        s(a, b) = Σ_{j<k} a_j a_k b_j b_k exp(− ──────────────────)     σ = 0.1
//!       Σ_t s(wᵢ, w_t) A_t                                                    σ²
//! ```
//!
//! `cᵢ` is the centroid of the surface weighted by similarity `s` to the weights of vertex `i` (triangles `t` with area `A`, centroid `b`,
//! mean weights `w_t`): rotation about it neither collapses nor bulges. It is independent of the pose. A vertex with a single influence
//! is its own center.
//!
//! A term of `s` depends on two weights only. For each pair of joints the triangles are therefore binned by these two weights; a bin acts
//! as one triangle with the mean weights of its members, exact to second order in the bin width `σ/16`. The sum over triangles becomes a
//! sum over occupied bins.
//!
//! # Reference
//! B. H. Le, J. K. Hodgins, *Real-time skeletal skinning with optimized centers of rotation*, ACM TOG 35 (2016). Departures: bins
//! instead of the paper's search in vertex clusters; a separate scale phase, as with dual quaternions.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::super::{Influence, SkinWeights};
use super::dual_quaternion::{Motions, Parts, blend, moved, moved_along};
use super::linear_blend::Affine;
use super::{Jet, PosedMethod, Posing};
use crate::mesh::TriMesh;
use plumbline_num::run::{Run, Stopped};

/// Bandwidth of the similarity, as in the paper.
const SIGMA: f64 = 0.1;
/// Bins per unit of weight: a bin is `σ/16` wide, so that its second-order error is far below the bandwidth.
const BINS: f64 = 160.0;
/// Exponents beyond this are skipped: e⁻³⁰ is below 1e-13 of a term.
const MAX_EXPONENT: f64 = 30.0;

/// Triangles with similar weights for two joints: sums of area, and of area times weights and centroid.
#[derive(Clone, Copy, Debug, Default)]
struct Bin {
    area: f64,
    weights: [f64; 2],
    middle: Vector3<f64>,
}

/// The center of rotation of each vertex, in the bind pose.
///
/// # Errors
/// [`Stopped`].
///
/// # Panics
/// If the number of rows of weights differs from the number of vertices.
pub fn centers_of_rotation(mesh: &TriMesh, weights: &SkinWeights, run: &Run) -> Result<Vec<Point3<f64>>, Stopped> {
    assert_eq!(mesh.vertex_count(), weights.vertex_count(), "one row of weights per vertex");
    // Relative to the center of the model, so that sums of positions keep their digits.
    let middle = mesh.bounding_box().map_or(Vector3::zeros(), |(low, high)| nalgebra::center(&low, &high).coords);
    let bins = binned(mesh, weights, &middle);
    let center = |(v, p): (usize, &Point3<f64>)| {
        run.check()?;
        let (mut sum, mut total) = (Vector3::zeros(), 0.0);
        for (j, k, a) in pairs(weights.row(v)) {
            for bin in bins.get(&(j, k)).into_iter().flatten() {
                let likeness = likeness(a, bin.weights) * bin.area;
                sum += likeness * bin.middle;
                total += likeness;
            }
        }
        Ok(if total > 0.0 { Point3::from(sum / total + middle) } else { *p })
    };
    mesh.positions().iter().enumerate().map(center).collect()
}

/// One term of `s`.
#[inline]
fn likeness(a: [f64; 2], b: [f64; 2]) -> f64 {
    let across = (a[0] * b[1] - a[1] * b[0]) / SIGMA;
    if across * across > MAX_EXPONENT { 0.0 } else { a[0] * a[1] * b[0] * b[1] * (-across * across).exp() }
}

/// Pairs of joints of a row, the lower index first, and their weights.
fn pairs(row: &[Influence]) -> impl Iterator<Item = (u32, u32, [f64; 2])> + '_ {
    row.iter().enumerate().flat_map(move |(n, a)| {
        row[n + 1..].iter().map(move |b| {
            let (low, high) = if a.joint < b.joint { (a, b) } else { (b, a) };
            (low.joint, high.joint, [low.weight, high.weight])
        })
    })
}

/// Means of the occupied bins for each pair of joints.
fn binned(mesh: &TriMesh, weights: &SkinWeights, middle: &Vector3<f64>) -> BTreeMap<(u32, u32), Vec<Bin>> {
    let mut bins: BTreeMap<(u32, u32), BTreeMap<[u16; 2], Bin>> = BTreeMap::new();
    for (t, corners) in mesh.triangles().iter().enumerate() {
        let area = 0.5 * mesh.area_normal(t).norm();
        let [a, b, c] = mesh.corners(t).map(|p| p.coords - middle);
        let centroid = (a + b + c) / 3.0;
        for (j, k, w) in pairs(&mean_weights(weights, corners)) {
            let cell = w.map(|w| (w * BINS) as u16);
            let bin = bins.entry((j, k)).or_default().entry(cell).or_default();
            bin.area += area;
            bin.weights[0] += area * w[0];
            bin.weights[1] += area * w[1];
            bin.middle += area * centroid;
        }
    }
    let mean = |bin: &Bin| {
        let inverse = 1.0 / bin.area;
        Bin { area: bin.area, weights: bin.weights.map(|w| w * inverse), middle: bin.middle * inverse }
    };
    let occupied = |bins: BTreeMap<_, Bin>| bins.values().filter(|b| b.area > 0.0).map(mean).collect();
    bins.into_iter().map(|(pair, bins)| (pair, occupied(bins))).collect()
}

/// Mean weights of a triangle's corners.
fn mean_weights(weights: &SkinWeights, corners: &[u32; 3]) -> Vec<Influence> {
    let mut mean: Vec<Influence> = Vec::with_capacity(12);
    for influence in corners.iter().flat_map(|&c| weights.row(c as usize)) {
        let weight = influence.weight / 3.0;
        match mean.iter_mut().find(|i| i.joint == influence.joint) {
            Some(same) => same.weight += weight,
            None => mean.push(Influence { joint: influence.joint, weight }),
        }
    }
    mean
}

/// The method in one pose.
pub(super) struct CentersPose<'a> {
    posing: Posing<'a>,
    centers: &'a [Point3<f64>],
    slopes: &'a [[Vector3<f64>; 2]],
    motions: Motions,
    /// The rigid motions as matrices.
    matrices: Vec<Affine>,
}

impl<'a> CentersPose<'a> {
    pub(super) fn new(posing: Posing<'a>, centers: &'a [Point3<f64>], slopes: &'a [[Vector3<f64>; 2]]) -> Self {
        let motions = Motions::new(posing.matrices, posing.pivots);
        let matrices = motions.rigid.iter().map(as_matrix).collect();
        Self { posing, centers, slopes, motions, matrices }
    }
}

fn as_matrix(q: &Parts) -> Affine {
    let origin = moved(q, &Point3::origin());
    let columns = [0, 1, 2].map(|k| moved(q, &Point3::from(Vector3::ith(k, 1.0))) - origin);
    Affine(std::array::from_fn(|k| if k < 9 { columns[k / 3][k % 3] } else { origin[k - 9] }))
}

/// The rotation part.
fn rotation(mut q: Parts) -> Parts {
    q[4..].fill(0.0);
    q
}

impl PosedMethod for CentersPose<'_> {
    fn position(&self, vertex: usize) -> Point3<f64> {
        let Posing { rest, weights, .. } = self.posing;
        let row = weights.row(vertex);
        let p = self.motions.scaled(row, &rest.position(vertex));
        let c = self.motions.scaled(row, &self.centers[vertex]);
        let q = rotation(blend(&self.motions.rigid, row));
        let arm = moved(&q, &Point3::from(p - c));
        Affine::blend(&self.matrices, row).apply(&c) + arm.coords
    }

    fn jet(&self, vertex: usize) -> Jet {
        let Posing { rest, weights, .. } = self.posing;
        let (row, slopes) = (weights.row(vertex), rest.slopes(vertex));
        let p = self.motions.scaled_jet(row, slopes, &rest.position(vertex), rest.tangents(vertex));
        let c = self.motions.scaled_jet(row, slopes, &self.centers[vertex], self.slopes[vertex]);
        let q = rotation(blend(&self.motions.rigid, row));
        let arm = Point3::from(p.position - c.position);
        let rotated = moved(&q, &arm);
        let center = Affine::jet(&self.matrices, row, slopes, &c.position, c.along);
        let along = std::array::from_fn(|k| {
            let dq = rotation(self.motions.blend_along(row, slopes, k));
            let swung = moved_along(&q, &dq, &arm.coords, &(p.along[k] - c.along[k]), &rotated.coords);
            swung + center.along[k]
        });
        Jet { position: center.position + rotated.coords, along }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::tube;
    use super::*;

    /// The paper's sum over all triangles.
    fn slowly(mesh: &TriMesh, weights: &SkinWeights, v: usize) -> Point3<f64> {
        let (mut sum, mut total) = (Vector3::zeros(), 0.0);
        for (t, corners) in mesh.triangles().iter().enumerate() {
            let mean = mean_weights(weights, corners);
            let area = 0.5 * mesh.area_normal(t).norm();
            let [a, b, c] = mesh.corners(t).map(|p| p.coords);
            let weight = |j: u32| mean.iter().find(|i| i.joint == j).map_or(0.0, |i| i.weight);
            for (j, k, w) in pairs(weights.row(v)) {
                let s = likeness(w, [weight(j), weight(k)]) * area;
                sum += s * (a + b + c) / 3.0;
                total += s;
            }
        }
        if total > 0.0 { Point3::from(sum / total) } else { mesh.positions()[v] }
    }

    #[test]
    fn centers_agree_with_the_paper_and_lie_on_the_axis_of_a_limb() {
        let (mesh, _, skin) = tube(3, 24, 60);
        let centers = centers_of_rotation(&mesh, skin.weights(), &Run::default()).expect("a run that never stops");
        for v in (0..mesh.vertex_count()).step_by(37) {
            let exact = slowly(&mesh, skin.weights(), v);
            assert!((centers[v] - exact).norm() < 1e-3, "{v}: {} {exact}", centers[v]);
            if skin.weights().row(v).len() > 1 {
                assert!(centers[v].y.hypot(centers[v].z) < 1e-2, "{v}: {}", centers[v]);
            }
        }
    }

    #[test]
    fn centers_move_with_the_model() {
        let (mesh, _, skin) = tube(3, 12, 30);
        let at = Vector3::new(1e5, -2e5, 3e5);
        let there = mesh.with_positions(mesh.positions().iter().map(|p| p + at).collect()).expect("finite");
        let (here, there) = (
            centers_of_rotation(&mesh, skin.weights(), &Run::default()).expect("a run that never stops"),
            centers_of_rotation(&there, skin.weights(), &Run::default()).expect("a run that never stops"),
        );
        for (a, b) in here.iter().zip(&there) {
            assert!((b - a - at).norm() < 1e-8, "{a} {b}");
        }
    }
}
