//! Subspace smoothing: short trajectories are near a low-rank subspace, and smoothing its modes smooths all of them alike.
//!
//! Trajectories `y_k(τ)` (x and y apart) over the window `τ ∈ [t − w, t + w]`, in output px, with mean `μ(τ)` over the tracks,
//!
//! ```text
//! y_k = μ + E c_k + ε,      E: the r leading eigenvectors of Σ_k (y_k − μ)(y_k − μ)ᵀ over the tracks that span the window
//! q_k = κᵀ (μ + E ĉ_k),     ĉ_k = (E_Pᵀ E_P + σ² Λ⁻¹)⁻¹ E_Pᵀ (y_k − μ)_P
//! ```
//!
//! `κ` are the weights of the local linear regression at `t` ([`super::trajectory`]), `P` the frames in which the track was
//! observed, `Λ` the variances of the modes and `σ²` the residual variance: the conditional mean of probabilistic PCA. A track
//! observed for half of the window is completed by the others instead of being smoothed from its half alone; noise outside
//! the subspace is left out. Under an affine camera the rank is 4; in perspective and over about a second rank 9 captures all
//! but noise, with a changing focal length or a rolling shutter too.
//!
//! # Reference
//! F. Liu, M. Gleicher, J. Wang, H. Jin, A. Agarwala: *Subspace video stabilization*, ACM TOG 30(1), 2011, sections 3 and 4
//! (rank 9, windows of trajectories). M. E. Tipping, C. M. Bishop: *Probabilistic principal component analysis*, 1999.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

/// Rank of the subspace, that of the paper.
const RANK: usize = 9;
/// Tracks that must span the window, per mode: each gives two trajectories, so that six samples determine a mode.
const SPANNING_PER_MODE: usize = 3;
/// Floor of the noise variance, px²: tracks are not more accurate than a twentieth of a pixel.
const MIN_NOISE: f64 = 0.0025;

/// The modes of one window, and their regression at its center.
pub(super) struct Subspace {
    mean: [DVector<f64>; 2],
    /// `E`, one row per frame of the window.
    modes: DMatrix<f64>,
    /// `σ² Λ⁻¹`.
    noise_ratio: DVector<f64>,
    /// `κᵀ μ` and `κᵀ E`.
    mean_now: [f64; 2],
    modes_now: DVector<f64>,
}

impl Subspace {
    /// The modes of the trajectories `spanning`, each with its x and y at every frame of the window, and their regression by
    /// the weights `kernel` of those frames; `None` where there are too few of them.
    pub(super) fn of(spanning: &[[Vec<f64>; 2]], kernel: &[f64]) -> Option<Self> {
        let (frames, rows) = (kernel.len(), 2 * spanning.len());
        let rank = RANK.min(frames.saturating_sub(1));
        if rank == 0 || spanning.len() < SPANNING_PER_MODE * rank {
            return None;
        }
        let mean = [0, 1].map(|axis| {
            let sum = |t: usize| spanning.iter().map(|y| y[axis][t]).sum::<f64>() / spanning.len() as f64;
            DVector::from_fn(frames, |t, _| sum(t))
        });
        let centered = DMatrix::from_fn(frames, rows, |t, k| spanning[k / 2][k % 2][t] - mean[k % 2][t]);
        let covariance = &centered * centered.transpose() / rows as f64;
        let total = covariance.trace();
        let eigen = SymmetricEigen::try_new(covariance, f64::EPSILON, 0)?;
        let mut order: Vec<usize> = (0..frames).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let variances: Vec<f64> = order[..rank].iter().map(|&i| eigen.eigenvalues[i].max(0.0)).collect();
        let left = (total - variances.iter().sum::<f64>()) / (frames - rank) as f64;
        let noise = left.max(MIN_NOISE);
        let modes = DMatrix::from_fn(frames, rank, |t, k| eigen.eigenvectors[(t, order[k])]);
        let noise_ratio = DVector::from_iterator(rank, variances.iter().map(|v| noise / v.max(noise * f64::EPSILON)));
        let kernel = DVector::from_column_slice(kernel);
        let mean_now = [kernel.dot(&mean[0]), kernel.dot(&mean[1])];
        let modes_now = modes.tr_mul(&kernel);
        Some(Self { mean, modes, noise_ratio, mean_now, modes_now })
    }

    /// `q` of a trajectory observed at some frames of the window: frame, x, y.
    pub(super) fn smoothed(&self, seen: &[(usize, [f64; 2])]) -> Option<[f64; 2]> {
        let rank = self.modes.ncols();
        let mut normal = DMatrix::from_diagonal(&self.noise_ratio);
        let mut right = DMatrix::zeros(rank, 2);
        for (frame, y) in seen {
            let row = self.modes.row(*frame);
            normal.ger(1.0, &row.transpose(), &row.transpose(), 1.0);
            for (axis, (y, mean)) in y.iter().zip(&self.mean).enumerate() {
                right.column_mut(axis).axpy(y - mean[*frame], &row.transpose(), 1.0);
            }
        }
        let coefficients = Cholesky::new(normal)?.solve(&right);
        Some([0, 1].map(|axis| self.mean_now[axis] + self.modes_now.dot(&coefficients.column(axis))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAMES: usize = 31;

    /// Kernel of the plain mean.
    fn mean() -> Vec<f64> {
        vec![1.0 / FRAMES as f64; FRAMES]
    }

    /// Trajectories of points at several depths under a shaking camera: four modes, and noise.
    fn tracks(count: usize, noise: f64) -> Vec<[Vec<f64>; 2]> {
        let mut random = fastrand::Rng::with_seed(8);
        let mut unit = move || random.f64() - 0.5;
        let point = |unit: &mut dyn FnMut() -> f64| {
            let (x, y, w) = (600.0 * unit(), 300.0 * unit(), 1.0 + unit());
            let at = |t: usize, along: f64, phase: f64| along + w * 8.0 * (0.7 * t as f64 + phase).sin();
            let mut line = |along: f64, phase: f64| {
                (0..FRAMES).map(|t| at(t, along * (1.0 + 0.002 * t as f64), phase) + noise * unit()).collect()
            };
            [line(x, 0.0), line(y, 1.0)]
        };
        (0..count).map(|_| point(&mut unit)).collect()
    }

    fn whole(track: &[Vec<f64>; 2], frames: std::ops::Range<usize>) -> Vec<(usize, [f64; 2])> {
        frames.map(|t| (t, [track[0][t], track[1][t]])).collect()
    }

    #[test]
    fn a_trajectory_in_the_subspace_is_smoothed_as_by_itself() {
        let tracks = tracks(60, 0.0);
        let subspace = Subspace::of(&tracks, &mean()).expect("enough tracks");
        for track in &tracks {
            let alone = [0, 1].map(|axis| track[axis].iter().sum::<f64>() / FRAMES as f64);
            let shared = subspace.smoothed(&whole(track, 0..FRAMES)).expect("regular");
            assert!((shared[0] - alone[0]).abs() < 0.01 && (shared[1] - alone[1]).abs() < 0.01, "{shared:?} {alone:?}");
        }
    }

    #[test]
    fn half_a_trajectory_is_completed_by_what_the_others_do() {
        let tracks = tracks(60, 0.2);
        let subspace = Subspace::of(&tracks, &mean()).expect("enough tracks");
        let (mut shared_error, mut alone_error) = (0.0, 0.0);
        for track in &tracks {
            let truth = track[0].iter().sum::<f64>() / FRAMES as f64;
            let half = whole(track, 0..FRAMES / 2);
            let shared = subspace.smoothed(&half).expect("regular");
            let alone = half.iter().map(|(_, y)| y[0]).sum::<f64>() / half.len() as f64;
            shared_error += (shared[0] - truth).abs() / 60.0;
            alone_error += (alone - truth).abs() / 60.0;
        }
        assert!(shared_error < 0.2 * alone_error, "{shared_error} against {alone_error}");
    }

    #[test]
    fn few_tracks_span_no_subspace() {
        assert!(Subspace::of(&tracks(SPANNING_PER_MODE * RANK - 1, 0.1), &mean()).is_none());
        assert!(Subspace::of(&[], &[]).is_none());
    }
}
