//! The normal equations of all observations, in block structure.
//!
//! ```text
//! ⎡ A   W ⎤ ⎡ δ_c ⎤     ⎡ b ⎤     c: poses, then shared unknowns; banded by the lengths of tracks, with a border
//! ⎣ Wᵀ  C ⎦ ⎣ δ_p ⎦ = − ⎣ g ⎦     p: points; C is 3×3 block diagonal
//! ```
//!
//! A point couples its anchor's pose to the pose of every frame that observes it. The Jacobian with respect to the
//! anchor's pose is `G K`, with `G` the Jacobian with respect to the ray and `K = [[p]×, −w I]` one matrix per point;
//! sums over `G` therefore suffice.

use nalgebra::{Matrix3, Matrix6, Matrix6x3, SMatrix, SMatrixView, Vector3, Vector6};
use rayon::prelude::*;

use super::cameras::Cameras;
use super::layout::{Layout, POSE, Track};
use super::parameters::{Parameters, SHARED};
use super::residual::{Anchored, Linearized};
use super::robust_loss::RobustLoss;
use plumbline_camera::Vec3;
use plumbline_camera::rotation::skew;
use plumbline_num::sparse::BandedMatrix;

/// The blocks of one point.
#[derive(Clone, Debug)]
pub(super) struct PointBlock {
    /// `C`.
    pub(super) c: Matrix3<f64>,
    /// `g`.
    pub(super) g: Vec3,
    /// Rows of `W` of the shared unknowns.
    pub(super) shared: SMatrix<f64, SHARED, 3>,
    /// Offset of its rows of `W` in [`Normal::w`].
    pub(super) start: usize,
}

/// The normal equations.
#[derive(Clone, Debug)]
pub(super) struct Normal {
    pub(super) a: BandedMatrix,
    pub(super) b: Vec<f64>,
    /// Rows of `W`: per point, for its slots, `POSE · slots × 3`, column-major.
    pub(super) w: Vec<f64>,
    pub(super) points: Vec<PointBlock>,
    parts: Vec<Part>,
}

/// Contribution of the tracks of one part to `A` and `b`.
#[derive(Clone, Debug)]
struct Part {
    tracks: std::ops::Range<usize>,
    a: BandedMatrix,
    b: Vec<f64>,
}

/// A part and its points, during accumulation.
struct Sums<'a> {
    layout: &'a Layout,
    a: &'a mut BandedMatrix,
    b: &'a mut [f64],
    /// Rows of `W` of its points; index 0 here is `first_w` in the whole.
    w: &'a mut [f64],
    first_w: usize,
    /// Its points; index 0 here is `first` in the whole.
    points: &'a mut [PointBlock],
    first: usize,
}

/// Sums over the observations of one point from which the blocks of the anchor's pose are formed.
struct AnchorSums {
    k: SMatrix<f64, 3, POSE>,
    gg: Matrix3<f64>,
    gp: Matrix3<f64>,
    gs: SMatrix<f64, 3, SHARED>,
    gr: Vec3,
}

impl Normal {
    pub(super) fn new(layout: &Layout) -> Self {
        let mut start = 0;
        let points = layout.tracks.iter().map(|track| {
            let own = start;
            start += 3 * POSE * track.slots.len();
            let zero = Matrix3::zeros();
            PointBlock { c: zero, g: Vec3::zeros(), shared: zero, start: own }
        });
        let points = points.collect();
        let bandwidth = (POSE * layout.longest()).saturating_sub(1);
        let a = BandedMatrix::zeros(POSE * layout.free, bandwidth, SHARED);
        let b = vec![0.0; layout.unknowns()];
        let part = |tracks| Part { tracks, a: a.clone(), b: b.clone() };
        let parts = layout.parts().into_iter().map(part).collect();
        Self { a, b, w: vec![0.0; start], points, parts }
    }

    /// Accumulates the normal equations over all observations.
    pub(super) fn assemble(
        &mut self,
        layout: &Layout,
        cameras: &Cameras,
        parameters: &Parameters,
        robust_loss: &RobustLoss,
    ) {
        let (mut w, mut points, mut first_w) = (self.w.as_mut_slice(), self.points.as_mut_slice(), 0);
        let sums = self.parts.iter_mut().map(|part| {
            let end = points.get(part.tracks.len()).map_or(first_w + w.len(), |next| next.start);
            let (own_w, own) = (w.split_off_mut(..end - first_w), points.split_off_mut(..part.tracks.len()));
            let (w, points) = own_w.zip(own).expect("the parts cover the tracks once");
            let sums = Sums { layout, a: &mut part.a, b: &mut part.b, w, first_w, points, first: part.tracks.start };
            first_w = end;
            sums
        });
        let sums: Vec<Sums<'_>> = sums.collect();
        sums.into_par_iter().for_each(|mut sums| sums.assemble(cameras, parameters, robust_loss));
        self.a.clear();
        self.b.fill(0.0);
        for part in &self.parts {
            self.a.add(&part.a);
            self.b.iter_mut().zip(&part.b).for_each(|(sum, b)| *sum += b);
        }
    }

    /// `Wᵀ δ` of one point.
    pub(super) fn coupled(&self, index: usize, track: &Track, delta: &[f64]) -> Vec3 {
        let (rows, block) = (POSE * track.slots.len(), &self.points[index]);
        let (poses, shared) = delta.split_at(delta.len() - SHARED);
        let own = &poses[POSE * track.slots.start..][..rows];
        let column = |q: usize| &self.w[block.start + q * rows..][..rows];
        let dot = |q: usize| column(q).iter().zip(own).map(|(w, d)| w * d).sum::<f64>();
        let shared = SMatrixView::<f64, SHARED, 1>::from_slice(shared);
        Vector3::new(dot(0), dot(1), dot(2)) + block.shared.tr_mul(&shared)
    }
}

impl Sums<'_> {
    fn assemble(&mut self, cameras: &Cameras, parameters: &Parameters, robust_loss: &RobustLoss) {
        self.a.clear();
        self.b.fill(0.0);
        self.w.fill(0.0);
        let (layout, mut scratch) = (self.layout, Linearized::zero());
        for own in 0..self.points.len() {
            let (track, ray) = (&layout.tracks[self.first + own], &parameters.points[self.first + own]);
            let point = cameras.anchored(ray, track.anchor);
            self.add_point(own, track, (cameras, &point), robust_loss, &mut scratch);
        }
    }

    fn add_point(
        &mut self,
        index: usize,
        track: &Track,
        (cameras, point): (&Cameras, &Anchored),
        robust_loss: &RobustLoss,
        scratch: &mut Linearized,
    ) {
        let layout = self.layout;
        let anchor = layout.slot[track.anchor];
        let mut sums = AnchorSums::new(point);
        let block = &mut self.points[index];
        (block.c, block.g, block.shared) = (Matrix3::zeros(), Vec3::zeros(), Matrix3::zeros());
        for observation in &layout.observations[track.observations.clone()] {
            let weight = |squared| robust_loss.loss.weight(squared);
            let (eye, from) = (cameras.eye(observation.frame), (point, cameras.view(track.anchor)));
            if !eye.linearize(from, (observation.frame, observation.pixel), robust_loss.sigma, weight, scratch) {
                continue;
            }
            let block = &mut self.points[index];
            block.c += scratch.point.tr_mul(&scratch.point);
            block.g += scratch.point.tr_mul(&scratch.residual);
            block.shared += scratch.shared.tr_mul(&scratch.point);
            self.add_shared(scratch);
            if cameras.is_own_ray(observation.frame, track.anchor) {
                continue;
            }
            sums.add(scratch);
            self.add_poses(track, index, scratch, anchor.map(|slot| (slot, &sums.k)));
        }
        if let Some(slot) = anchor {
            self.add_anchor(slot, track, index, &sums);
        }
    }

    fn add_shared(&mut self, at: &Linearized) {
        let (square, gradient) = (at.shared.tr_mul(&at.shared), at.shared.tr_mul(&at.residual));
        for j in 0..SHARED {
            (j..SHARED).for_each(|i| *self.a.corner_mut(i, j) += square[(i, j)]);
            self.b[POSE * self.layout.free + j] += gradient[j];
        }
    }

    fn add_poses(
        &mut self,
        track: &Track,
        index: usize,
        at: &Linearized,
        anchor: Option<(usize, &SMatrix<f64, 3, POSE>)>,
    ) {
        let layout = self.layout;
        let anchor = anchor.map(|(slot, k)| (slot, at.ray * k));
        let poses = || at.poses().iter().filter_map(|(frame, j)| Some((layout.slot[*frame]?, j)));
        for (n, (slot, j)) in poses().enumerate() {
            self.add_gradient(slot, &j.tr_mul(&at.residual));
            self.add_square(slot, &j.tr_mul(j));
            self.add_border(slot, &at.shared.tr_mul(j));
            self.add_coupling(track, index, slot, &j.tr_mul(&at.point));
            for (other, j_other) in poses().take(n) {
                self.add_pair(slot, other, &j.tr_mul(j_other));
            }
            if let Some((anchor, j_anchor)) = &anchor {
                self.add_pair(slot, *anchor, &j.tr_mul(j_anchor));
            }
        }
    }

    fn add_anchor(&mut self, slot: usize, track: &Track, index: usize, sums: &AnchorSums) {
        self.add_gradient(slot, &sums.k.tr_mul(&sums.gr));
        self.add_square(slot, &(sums.k.transpose() * sums.gg * sums.k));
        self.add_border(slot, &(sums.gs.transpose() * sums.k));
        self.add_coupling(track, index, slot, &sums.k.tr_mul(&sums.gp));
    }

    fn add_gradient(&mut self, slot: usize, gradient: &Vector6<f64>) {
        self.b[POSE * slot..][..POSE].iter_mut().zip(gradient.iter()).for_each(|(b, g)| *b += g);
    }

    fn add_square(&mut self, slot: usize, m: &Matrix6<f64>) {
        for j in 0..POSE {
            let column = self.a.column_mut(POSE * slot + j);
            (j..POSE).for_each(|i| column[i - j] += m[(i, j)]);
        }
    }

    /// Adds `m` to the block (pose `row`, pose `column`) and its transpose to the opposite block.
    fn add_pair(&mut self, row: usize, column: usize, m: &Matrix6<f64>) {
        match row.cmp(&column) {
            std::cmp::Ordering::Equal => self.add_square(row, &(m + m.transpose())),
            std::cmp::Ordering::Less => self.add_lower(column, row, &m.transpose()),
            std::cmp::Ordering::Greater => self.add_lower(row, column, m),
        }
    }

    fn add_lower(&mut self, row: usize, column: usize, m: &Matrix6<f64>) {
        for j in 0..POSE {
            let below = POSE * (row - column) - j;
            let entries = &mut self.a.column_mut(POSE * column + j)[below..below + POSE];
            entries.iter_mut().zip(m.column(j).iter()).for_each(|(a, m)| *a += m);
        }
    }

    fn add_border(&mut self, slot: usize, m: &SMatrix<f64, SHARED, POSE>) {
        for j in 0..POSE {
            let entries = self.a.border_mut(POSE * slot + j);
            entries.iter_mut().zip(m.column(j).iter()).for_each(|(a, m)| *a += m);
        }
    }

    fn add_coupling(&mut self, track: &Track, index: usize, slot: usize, m: &Matrix6x3<f64>) {
        let rows = POSE * track.slots.len();
        let first = self.points[index].start - self.first_w + POSE * (slot - track.slots.start);
        for q in 0..3 {
            let entries = &mut self.w[first + q * rows..][..POSE];
            entries.iter_mut().zip(m.column(q).iter()).for_each(|(w, m)| *w += m);
        }
    }
}

impl AnchorSums {
    fn new(point: &Anchored) -> Self {
        let mut k = SMatrix::<f64, 3, POSE>::zeros();
        k.fixed_columns_mut::<3>(0).copy_from(&skew(&point.p));
        k.fixed_columns_mut::<3>(3).copy_from(&Matrix3::from_diagonal_element(-point.w));
        let zero = Matrix3::zeros();
        Self { k, gg: zero, gp: zero, gs: zero, gr: Vec3::zeros() }
    }

    fn add(&mut self, at: &Linearized) {
        self.gg += at.ray.tr_mul(&at.ray);
        self.gp += at.ray.tr_mul(&at.point);
        self.gs += at.ray.tr_mul(&at.shared);
        self.gr += at.ray.tr_mul(&at.residual);
    }
}
