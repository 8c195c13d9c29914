//! Global positioning: centers of cameras with known rotations from the directions of their observations, without an
//! initial guess.
//!
//! A camera `i` with center `c_i` observes the point `X_j` in the direction `v_ij` (world axes, unit length). The
//! centers and points minimize
//!
//! ```text
//! Σ ρ(‖v_ij − d_ij (X_j − c_i)‖²),    d_ij ≥ 0,
//! ```
//!
//! The energy contains no baselines between pairs of cameras, and far points have no more weight than near ones. For
//! fixed `d_ij` it is linear least squares with the same matrix for all three coordinates; eliminating the points
//! leaves a weighted graph Laplacian of the cameras. The search alternates between both, from `d_ij = 1` (all points
//! at one distance). It ends with Levenberg–Marquardt steps in which each `d_ij` is eliminated: `d = v·y/‖y‖²`, `y = X
//! − c`, with the residual derivative `−d (1 − y yᵀ/‖y‖²)`.
//!
//! Departure from the paper: it uses random initial positions and a general nonlinear solver.
//!
//! # Reference
//! L. Pan, D. Baráth, M. Pollefeys, J. Schönberger, *Global structure-from-motion revisited*, ECCV 2024, section 3.2.

use nalgebra::{DMatrix, DVector, Matrix3};

use plumbline_camera::Vec3;
use plumbline_num::energy::Loss;
use plumbline_num::math::median;
use plumbline_num::optim::levenberg_marquardt::{DampedProblem, DampingOptions, minimize};
use plumbline_num::run::{Run, Stopped};

/// Iterations of alternation: they bring the cameras near the solution, the last search converges.
const ITERATIONS: usize = 60;
/// Huber threshold on the length of the residual, which is at most the `sin` of an angle: the value of the paper.
const HUBER: f64 = 0.1;
/// Minimum `d`, relative to that of a typical point: limits the influence of a point behind its camera.
const MIN_DISTANCE: f64 = 1e-3;
/// Damping and termination of the last search; residuals are in radians.
const LAST: DampingOptions = DampingOptions { lambda: 1e-4, tolerance: 1e-7, floor: 0.0, max_iterations: 25 };

/// Bearing of a point from a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bearing {
    pub(super) camera: usize,
    /// `v`, unit length, in world axes.
    pub(super) direction: Vec3,
}

/// Centers of `cameras` cameras from the bearings of each point. Gauge: the first center is the origin, points are at
/// a distance of about 1. `None` if the bearings do not connect the cameras.
pub(super) fn centers_of_bearings(
    cameras: usize,
    points: &[Vec<Bearing>],
    run: &Run,
) -> Result<Option<Vec<Vec3>>, Stopped> {
    let mut positions = Positions { centers: vec![Vec3::zeros(); cameras], points: vec![Vec3::zeros(); points.len()] };
    let mut scales: Vec<Vec<f64>> = points.iter().map(|p| vec![1.0; p.len()]).collect();
    for iteration in 0..ITERATIONS {
        if iteration > 0 {
            positions.rescale(points, &mut scales);
        }
        run.check()?;
        if positions.solve(points, &scales).is_none() {
            return Ok(None);
        }
    }
    let mut problem = Positioning::new(points, positions);
    let cost = problem.cost(&problem.present);
    minimize(&mut problem, cost, &LAST, run)?;
    let centers = problem.present.centers;
    Ok(centers.iter().all(|c| c.iter().all(|v| v.is_finite())).then_some(centers))
}

#[derive(Clone, Debug)]
struct Positions {
    centers: Vec<Vec3>,
    points: Vec<Vec3>,
}

impl Positions {
    /// Updates `d` of every bearing and normalizes the typical distance to 1.
    fn rescale(&mut self, points: &[Vec<Bearing>], scales: &mut [Vec<f64>]) {
        let mut distances: Vec<f64> = Vec::new();
        for (position, seen) in self.points.iter().zip(points) {
            distances.extend(seen.iter().map(|b| (position - self.centers[b.camera]).norm()));
        }
        if let Some(typical) = median(&mut distances).filter(|d| *d > 0.0) {
            self.centers.iter_mut().chain(&mut self.points).for_each(|p| *p /= typical);
        }
        for ((position, seen), scales) in self.points.iter().zip(points).zip(scales) {
            for (b, d) in seen.iter().zip(scales) {
                *d = scale(&(position - self.centers[b.camera]), &b.direction);
            }
        }
    }

    /// Solves for centers and points with `d` fixed.
    fn solve(&mut self, points: &[Vec<Bearing>], scales: &[Vec<f64>]) -> Option<()> {
        let n = self.centers.len();
        let (mut laplacian, mut right) = (DMatrix::<f64>::zeros(n, n), DMatrix::<f64>::zeros(n, 3));
        let weights = |(j, seen): (usize, &Vec<Bearing>)| -> Vec<(usize, f64, Vec3)> {
            let term = |(b, d): (&Bearing, &f64)| {
                let residual = b.direction - *d * (self.points[j] - self.centers[b.camera]);
                (b.camera, Loss::Huber(HUBER).weight(residual.norm_squared()) * d * d, b.direction / *d)
            };
            seen.iter().zip(&scales[j]).map(term).collect()
        };
        let terms: Vec<Vec<(usize, f64, Vec3)>> = points.iter().enumerate().map(weights).collect();
        for of_point in &terms {
            let total: f64 = of_point.iter().map(|t| t.1).sum();
            let mean = of_point.iter().map(|(_, a, away)| *a * away).sum::<Vec3>() / total;
            for (i, a, away) in of_point {
                laplacian[(*i, *i)] += a;
                for (k, b, _) in of_point {
                    laplacian[(*i, *k)] -= a * b / total;
                }
                let pull = *a * (mean - away);
                (0..3).for_each(|c| right[(*i, c)] += pull[c]);
            }
        }
        // Gauge: the first camera is fixed at the origin.
        let free = laplacian.view((1, 1), (n - 1, n - 1)).into_owned();
        let found = free.cholesky()?.solve(&right.rows(1, n - 1).into_owned());
        for i in 1..n {
            self.centers[i] = Vec3::new(found[(i - 1, 0)], found[(i - 1, 1)], found[(i - 1, 2)]);
        }
        for (position, of_point) in self.points.iter_mut().zip(&terms) {
            let total: f64 = of_point.iter().map(|t| t.1).sum();
            *position = of_point.iter().map(|(i, a, away)| *a * (self.centers[*i] + away)).sum::<Vec3>() / total;
        }
        Some(())
    }
}

/// The optimal `d` for `y`, at least [`MIN_DISTANCE`].
fn scale(y: &Vec3, direction: &Vec3) -> f64 {
    let best = direction.dot(y) / y.norm_squared();
    if best > MIN_DISTANCE { best } else { MIN_DISTANCE }
}

/// The last search, with every `d` eliminated.
struct Positioning<'a> {
    points: &'a [Vec<Bearing>],
    present: Positions,
    trial: Positions,
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Per point: its own block, its gradient, and the coupling to each of its cameras.
    blocks: Vec<(Matrix3<f64>, Vec3, Vec<Matrix3<f64>>)>,
}

impl<'a> Positioning<'a> {
    fn new(points: &'a [Vec<Bearing>], present: Positions) -> Self {
        let size = 3 * present.centers.len();
        let (hessian, gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
        Self { points, trial: present.clone(), present, hessian, gradient, blocks: Vec::new() }
    }

    fn cost(&self, at: &Positions) -> f64 {
        let error = |position: &Vec3, b: &Bearing| {
            let y = position - at.centers[b.camera];
            0.5 * Loss::Huber(HUBER).value((b.direction - scale(&y, &b.direction) * y).norm_squared())
        };
        at.points
            .iter()
            .zip(self.points)
            .map(|(position, seen)| seen.iter().map(|b| error(position, b)).sum::<f64>())
            .sum()
    }
}

impl DampedProblem for Positioning<'_> {
    fn linearize(&mut self) {
        self.hessian.fill(0.0);
        self.gradient.fill(0.0);
        self.blocks.clear();
        for (position, seen) in self.present.points.iter().zip(self.points) {
            let (mut own, mut slope, mut couplings) = (Matrix3::zeros(), Vec3::zeros(), Vec::with_capacity(seen.len()));
            for b in seen {
                let y = position - self.present.centers[b.camera];
                let d = scale(&y, &b.direction);
                let residual = b.direction - d * y;
                let weight = Loss::Huber(HUBER).weight(residual.norm_squared()) * d;
                let across = Matrix3::identity() - y * y.transpose() / y.norm_squared();
                let block = weight * d * across;
                let pull = weight * (across * residual);
                own += block;
                slope -= pull;
                couplings.push(block);
                let mut view = self.hessian.fixed_view_mut::<3, 3>(3 * b.camera, 3 * b.camera);
                view += block;
                let mut rows = self.gradient.fixed_rows_mut::<3>(3 * b.camera);
                rows += pull;
            }
            self.blocks.push((own, slope, couplings));
        }
    }

    fn propose(&mut self, lambda: f64) -> Option<f64> {
        let size = self.gradient.len();
        let mut reduced = self.hessian.clone();
        for k in 0..size {
            reduced[(k, k)] *= 1.0 + lambda;
        }
        // Eliminate the points (Schur complement), keeping their inverse blocks for the back substitution.
        let mut right = -&self.gradient;
        let mut inverses = Vec::with_capacity(self.blocks.len());
        for ((own, slope, couplings), seen) in self.blocks.iter().zip(self.points) {
            let inverse = (own + lambda * Matrix3::from_diagonal(&own.diagonal())).try_inverse()?;
            for (b, left) in seen.iter().zip(couplings) {
                let lifted = left * inverse;
                let mut rows = right.fixed_rows_mut::<3>(3 * b.camera);
                rows -= lifted * slope;
                for (c, other) in seen.iter().zip(couplings) {
                    let mut view = reduced.fixed_view_mut::<3, 3>(3 * b.camera, 3 * c.camera);
                    view -= lifted * other;
                }
            }
            inverses.push(inverse);
        }
        // Gauge: the first camera is fixed at the origin; the scale is constrained by the damping alone.
        let free = reduced.view((3, 3), (size - 3, size - 3)).into_owned();
        let step = free.cholesky()?.solve(&right.rows(3, size - 3).into_owned());
        let step =
            |camera: usize| if camera == 0 { Vec3::zeros() } else { step.fixed_rows::<3>(3 * camera - 3).into_owned() };
        // Trial centers, then points by back substitution, with the decrease that the damped model predicts.
        let mut predicted = 0.0;
        for i in 1..self.present.centers.len() {
            let (moved, diagonal) = (step(i), self.hessian.fixed_view::<3, 3>(3 * i, 3 * i).diagonal());
            predicted += gain(lambda, &diagonal, &moved, &self.gradient.fixed_rows::<3>(3 * i).into_owned());
            self.trial.centers[i] = self.present.centers[i] + moved;
        }
        for (j, ((own, slope, couplings), inverse)) in self.blocks.iter().zip(inverses).enumerate() {
            let pulled: Vec3 = self.points[j].iter().zip(couplings).map(|(b, c)| c * step(b.camera)).sum();
            let moved = inverse * (pulled - slope);
            predicted += gain(lambda, &own.diagonal(), &moved, slope);
            self.trial.points[j] = self.present.points[j] + moved;
        }
        Some(predicted)
    }

    fn trial_cost(&mut self) -> f64 {
        self.cost(&self.trial)
    }

    fn accept(&mut self) {
        self.present.clone_from(&self.trial);
    }
}

/// Decrease that the damped model predicts for a block of the step.
fn gain(lambda: f64, diagonal: &Vec3, step: &Vec3, gradient: &Vec3) -> f64 {
    0.5 * step.dot(&(lambda * diagonal.component_mul(step) - gradient))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::tests::synthetic::{Course, Shot, ShotOptions, path_error};
    use plumbline_camera::{CameraPose, Point3};

    /// Bearings in every fourth frame of a synthetic shot, with the true camera rotations.
    fn bearings(shot: &Shot) -> Vec<Vec<Bearing>> {
        let mut points = vec![Vec::new(); shot.truth.points.len()];
        for o in shot.observations.iter().filter(|o| o.frame % 4 == 0) {
            let rotation = shot.truth.poses[o.frame as usize].expect("true").rotation;
            let ray = shot.truth.intrinsics.ray(o.pixel).expect("no fold").normalize();
            let direction = rotation.inverse() * ray;
            points[o.point as usize].push(Bearing { camera: o.frame as usize / 4, direction });
        }
        points.retain(|p| p.len() > 1);
        points
    }

    fn error(shot: &Shot, centers: &[Vec3]) -> f64 {
        let truth: Vec<_> = shot.truth.poses.iter().step_by(4).copied().collect();
        let found: Vec<_> = centers
            .iter()
            .zip(&truth)
            .map(|(c, t)| Some(CameraPose::looking_from(Point3::from(*c), t.expect("true").rotation)))
            .collect();
        path_error(&found, &truth).position
    }

    #[test]
    fn exact_bearings_give_the_centers_and_noisy_ones_nearly() {
        for (course, noise_px, outliers, most) in
            [(Course::Walk, 0.0, 0.0, 1e-4), (Course::Side, 0.0, 0.0, 1e-4), (Course::Walk, 0.2, 0.03, 0.02)]
        {
            let shot = Shot::new(&ShotOptions { seed: 6, course, noise_px, outliers, ..ShotOptions::default() });
            let centers = centers_of_bearings(15, &bearings(&shot), &Run::default())
                .expect("a run that never stops")
                .expect("connected");
            assert!(error(&shot, &centers) < most, "{course:?}, {noise_px} px: {}", error(&shot, &centers));
            assert_eq!(centers[0], Vec3::zeros());
        }
    }

    #[test]
    fn cameras_without_common_points_are_not_positioned() {
        let shot = Shot::new(&ShotOptions { seed: 6, ..ShotOptions::default() });
        assert!(
            centers_of_bearings(16, &bearings(&shot), &Run::default()).expect("a run that never stops").is_none(),
            "the last one sees nothing"
        );
    }
}
