//! Camera paths in space of a given shape: line, parabola, tripod, orbit, dolly.
//!
//! From the recovered cameras of a shot, centers `c_t` and rotations `R_t` at the times `τ_t`, with the mean rotation
//! `R̄ = argmin Σ |Log(R_t Rᵀ)|²` and `l_t = Log(R_t R̄ᵀ)` unwrapped (no jumps of 2π):
//!
//! ```text
//! linear      c̄, l̄: the polynomials of degree 1 over time nearest to c_t and l_t       R̄_t = Exp(l̄(τ_t)) R̄
//! parabolic   the same of degree 2
//! tripod      c̄ = argmin Σ |c_t − c| (geometric median),                               R̄_t = R̄
//! dolly       c̄ = m + e s̄(τ_t),  m = mean of c_t,  e: direction of their largest variance,
//!             s̄: polynomial of degree 1 nearest to eᵀ(c_t − m),                        R̄_t = R̄
//! orbit       see `orbit.rs`
//! ```
//!
//! A gap in the cameras does not divide a path: one shape is fitted to the whole shot.
//!
//! # References
//! F. Liu, M. Gleicher, H. Jin, A. Agarwala: *Content-preserving warps for 3D video stabilization*, SIGGRAPH 2009, section 4
//! (linear and parabolic paths, fitted to the recovered one). E. Weiszfeld: *Sur le point pour lequel la somme des distances
//! de n points donnés est minimum*, Tôhoku Math. J. 43, 1937 (geometric median).

use nalgebra::{Matrix3, SymmetricEigen, UnitQuaternion};

use super::orbit::orbit;
use super::regression::polynomial;
use plumbline_camera::{CameraPose, Point3, Vec3};

/// Limit on the iterations of the mean rotation and of Weiszfeld's median, which converge before it: the first stops by
/// [`TOLERANCE`], the second changes no longer.
const MAX_ITERATIONS: usize = 60;

/// Step, rad, below which the mean of rotations has converged: fifty times the rounding of a unit quaternion.
const TOLERANCE: f64 = 1e-14;

/// Floor of the distance in Weiszfeld's weights `1 / distance`, as a fraction of the spread: keeps the weight of a position at
/// the median itself finite, far below any accuracy of the positions.
const MIN_DISTANCE_RATIO: f64 = 1e-9;

/// Shape of a path in space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathShape {
    /// Constant velocity and constant angular velocity.
    Linear,
    /// Constant acceleration.
    Parabolic,
    /// No motion.
    Tripod,
    /// A circle about the point of interest.
    Orbit,
    /// A straight line at constant speed, constant view direction.
    Dolly,
}

/// A reconstructed point and its visibility.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenPoint {
    /// Position, world coordinates.
    pub position: Point3,
    /// Number of frames that observe it.
    pub frames: usize,
    /// Mean distance from the image center, in half diagonals.
    pub off_center: f64,
}

/// Camera centers and rotations (`cam_from_world`) over time.
pub(super) struct CameraRun {
    pub(super) times_s: Vec<f64>,
    pub(super) centers: Vec<Vec3>,
    pub(super) rotations: Vec<UnitQuaternion<f64>>,
}

/// The cameras of a shot fitted to a path of the given shape (`None` where the input has none), and the shape used: without a
/// point of interest an orbit falls back to a line.
pub fn shaped_poses(
    shape: PathShape,
    times_s: &[f64],
    poses: &[Option<CameraPose>],
    points: &[SeenPoint],
) -> (Vec<Option<CameraPose>>, PathShape) {
    let known = || times_s.iter().zip(poses).filter_map(|(time, pose)| Some((time, pose.as_ref()?)));
    let cameras = CameraRun {
        times_s: known().map(|(time, _)| *time).collect(),
        centers: known().map(|(_, pose)| pose.center().coords).collect(),
        rotations: known().map(|(_, pose)| pose.rotation).collect(),
    };
    if cameras.times_s.is_empty() {
        return (vec![None; poses.len()], shape);
    }
    let orbit_poses = if shape == PathShape::Orbit { orbit(&cameras, points) } else { None };
    let (path, shape) = match (shape, orbit_poses) {
        (PathShape::Orbit, Some(orbit_poses)) => (orbit_poses, shape),
        (PathShape::Linear | PathShape::Orbit, _) => (cameras.polynomial(1), PathShape::Linear),
        (PathShape::Parabolic, _) => (cameras.polynomial(2), shape),
        (PathShape::Tripod, _) => (cameras.tripod(), shape),
        (PathShape::Dolly, _) => (cameras.dolly(), shape),
    };
    let mut path = path.into_iter();
    (poses.iter().map(|pose| pose.and_then(|_| path.next())).collect(), shape)
}

impl CameraRun {
    fn len(&self) -> usize {
        self.times_s.len()
    }

    fn polynomial(&self, degree: usize) -> Vec<CameraPose> {
        let (mean, logs) = about_mean(&self.rotations);
        let centers = polynomial(&self.times_s, &self.centers, degree);
        let rotations = polynomial(&self.times_s, &logs, degree);
        let pose = |(center, log): (Vec3, Vec3)| looking(center, UnitQuaternion::from_scaled_axis(log) * mean);
        centers.into_iter().zip(rotations).map(pose).collect()
    }

    fn tripod(&self) -> Vec<CameraPose> {
        vec![looking(median(&self.centers), about_mean(&self.rotations).0); self.len()]
    }

    fn dolly(&self) -> Vec<CameraPose> {
        let (middle, axes) = principal_axes(&self.centers);
        let along: Vec<f64> = self.centers.iter().map(|c| axes[0].dot(&(c - middle))).collect();
        let rotation = about_mean(&self.rotations).0;
        let fitted = polynomial(&self.times_s, &along, 1);
        fitted.into_iter().map(|s| looking(middle + axes[0] * s, rotation)).collect()
    }
}

pub(super) fn looking(center: Vec3, rotation: UnitQuaternion<f64>) -> CameraPose {
    CameraPose::looking_from(Point3::from(center), rotation)
}

/// The mean rotation and the unwrapped rotation vectors relative to it; at least one rotation is given.
pub(super) fn about_mean(rotations: &[UnitQuaternion<f64>]) -> (UnitQuaternion<f64>, Vec<Vec3>) {
    let mut mean = rotations[rotations.len() / 2];
    let mut logs = unwrapped_logs(rotations, &mean);
    let mut last = f64::INFINITY;
    for _ in 0..MAX_ITERATIONS {
        let step: Vec3 = logs.iter().sum::<Vec3>() / logs.len() as f64;
        // Near an angle of 2π the logarithm amplifies its components across the axis, rounding included: a step that does not
        // shrink is noise.
        if !(step.norm() > TOLERANCE && step.norm() < 0.5 * last) {
            break;
        }
        last = step.norm();
        mean = UnitQuaternion::new_normalize((UnitQuaternion::from_scaled_axis(step) * mean).into_inner());
        logs = unwrapped_logs(rotations, &mean);
    }
    (mean, logs)
}

/// `Log(R_t R̄ᵀ)`, from the middle to both ends each nearest to its neighbor: a vector of length `a` and those of length
/// `a + 2πk` in its direction are the same rotation.
fn unwrapped_logs(rotations: &[UnitQuaternion<f64>], mean: &UnitQuaternion<f64>) -> Vec<Vec3> {
    let mut logs: Vec<Vec3> = rotations.iter().map(|r| (r * mean.inverse()).scaled_axis()).collect();
    let near = |log: Vec3, neighbor: &Vec3| {
        let angle = log.norm();
        if !(angle > 0.0) {
            return log;
        }
        let axis = log / angle;
        let revolutions = ((neighbor.dot(&axis) - angle) / std::f64::consts::TAU).round();
        log + axis * (revolutions * std::f64::consts::TAU)
    };
    let middle = logs.len() / 2;
    for t in middle + 1..logs.len() {
        logs[t] = near(logs[t], &logs[t - 1]);
    }
    for t in (0..middle).rev() {
        logs[t] = near(logs[t], &logs[t + 1]);
    }
    logs
}

/// The geometric median.
pub(super) fn median(positions: &[Vec3]) -> Vec3 {
    let mean = positions.iter().sum::<Vec3>() / positions.len() as f64;
    let spread = positions.iter().map(|p| (p - mean).norm()).fold(0.0, f64::max);
    if !(spread > 0.0) {
        return mean;
    }
    (0..MAX_ITERATIONS).fold(mean, |at, _| {
        let weight = |p: &Vec3| 1.0 / (p - at).norm().max(MIN_DISTANCE_RATIO * spread);
        let total: f64 = positions.iter().map(weight).sum();
        positions.iter().map(|p| p * weight(p)).sum::<Vec3>() / total
    })
}

/// Mean of the positions and their principal axes by decreasing variance.
pub(super) fn principal_axes(positions: &[Vec3]) -> (Vec3, [Vec3; 3]) {
    let mean = positions.iter().sum::<Vec3>() / positions.len() as f64;
    let scatter: Matrix3<f64> = positions.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
    let eigen = SymmetricEigen::new(scatter);
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    (mean, order.map(|k| eigen.eigenvectors.column(k).into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPES: [PathShape; 5] =
        [PathShape::Linear, PathShape::Parabolic, PathShape::Tripod, PathShape::Orbit, PathShape::Dolly];

    fn times(n: usize) -> Vec<f64> {
        (0..n).map(|t| t as f64 / 30.0 + if t % 3 == 0 { 0.004 } else { 0.0 }).collect()
    }

    fn shaped(shape: PathShape, times: &[f64], poses: &[CameraPose]) -> Vec<CameraPose> {
        let poses: Vec<_> = poses.iter().copied().map(Some).collect();
        shaped_poses(shape, times, &poses, &[]).0.into_iter().map(|p| p.expect("a camera")).collect()
    }

    fn apart(a: &[CameraPose], b: &[CameraPose]) -> f64 {
        let one =
            |(a, b): (&CameraPose, &CameraPose)| a.rotation.angle_to(&b.rotation) + (a.center() - b.center()).norm();
        a.iter().zip(b).map(one).fold(0.0, f64::max)
    }

    /// A camera whose position and rotation angle about one axis are polynomials of time; the total angle exceeds 2π.
    fn moving(times: &[f64], acceleration: f64) -> Vec<CameraPose> {
        let start = UnitQuaternion::from_scaled_axis(Vec3::new(0.3, -0.8, 0.2));
        let pose = |t: &f64| {
            let curved = acceleration * t * t;
            let log = Vec3::new(0.6, -0.48, 0.64) * (4.0 * t + curved);
            looking(Vec3::new(2.0 * t, 1.0 - t, curved), UnitQuaternion::from_scaled_axis(log) * start)
        };
        times.iter().map(pose).collect()
    }

    #[test]
    fn constant_velocity_and_constant_acceleration_are_reproduced_exactly() {
        let times = times(71);
        let (even, accelerated) = (moving(&times, 0.0), moving(&times, 0.5));
        assert!(apart(&shaped(PathShape::Linear, &times, &even), &even) < 1e-9);
        assert!(apart(&shaped(PathShape::Parabolic, &times, &even), &even) < 1e-9);
        let off = apart(&shaped(PathShape::Parabolic, &times, &accelerated), &accelerated);
        assert!(off < 1e-9, "{off}");
        assert!(apart(&shaped(PathShape::Linear, &times, &accelerated), &accelerated) > 0.1);
    }

    #[test]
    fn the_dolly_path_is_a_straight_line_at_constant_speed_and_rotation() {
        let times = times(60);
        let look = UnitQuaternion::from_scaled_axis(Vec3::new(0.1, 2.0, -0.4));
        let even: Vec<_> = times.iter().map(|t| looking(Vec3::new(3.0 - t, 2.0 * t, 0.5 * t), look)).collect();
        assert!(apart(&shaped(PathShape::Dolly, &times, &even), &even) < 1e-9);
        let fitted = shaped(PathShape::Dolly, &times, &moving(&times, 0.5));
        let speed = |k: usize| (fitted[k + 1].center() - fitted[k].center()) / (times[k + 1] - times[k]);
        for k in 0..times.len() - 1 {
            assert!((speed(k) - speed(0)).norm() < 1e-9, "at {k}: {} and {}", speed(k), speed(0));
            assert!(fitted[k].rotation.angle_to(&fitted[0].rotation) < 1e-12);
        }
        assert!(speed(0).norm() > 0.5);
    }

    #[test]
    fn the_tripod_is_one_camera_robust_to_a_few_outliers() {
        let times = times(41);
        let mut poses = vec![looking(Vec3::new(1.0, 2.0, 3.0), UnitQuaternion::identity()); 41];
        for (k, outlier) in poses.iter_mut().take(10).enumerate() {
            *outlier = looking(Vec3::new(50.0 + k as f64, 0.0, 0.0), UnitQuaternion::identity());
        }
        let still = shaped(PathShape::Tripod, &times, &poses);
        assert!(still.iter().all(|p| p == &still[0]));
        assert!((still[0].center() - poses[20].center()).norm() < 1e-6, "{}", still[0].center());
    }

    #[test]
    fn the_mean_rotation_is_that_of_a_swing_about_it() {
        let middle = UnitQuaternion::from_scaled_axis(Vec3::new(1.0, -2.0, 0.4));
        let swing = |k: i32| UnitQuaternion::from_scaled_axis(Vec3::new(0.1, 0.25, -0.2) * f64::from(k)) * middle;
        let (mean, logs) = about_mean(&[-2, 2, 1, 0, -1].map(swing));
        assert!(mean.angle_to(&middle) < 1e-12);
        assert!((logs[1] - 2.0 * Vec3::new(0.1, 0.25, -0.2)).norm() < 1e-12);
    }

    #[test]
    fn a_gap_leaves_a_gap_in_one_path() {
        let times = times(60);
        let even = moving(&times, 0.0);
        let gappy: Vec<_> = even.iter().enumerate().map(|(t, p)| (!(20..33).contains(&t)).then_some(*p)).collect();
        let (path, _) = shaped_poses(PathShape::Linear, &times, &gappy, &[]);
        for (t, (path, own)) in path.iter().zip(&gappy).enumerate() {
            assert_eq!(path.is_some(), own.is_some(), "frame {t}");
            let off = path.zip(*own).map_or(0.0, |(a, b)| apart(&[a], &[b]));
            assert!(off < 1e-9, "frame {t} is {off} off");
        }
    }

    #[test]
    fn few_frames_and_cameras_at_one_position_give_finite_paths() {
        let points = [SeenPoint { position: Point3::new(0.0, 0.0, 4.0), frames: 3, off_center: 0.1 }];
        for n in 0..6 {
            let still = vec![Some(CameraPose::identity()); n];
            let moved: Vec<_> = moving(&times(n), 0.5).into_iter().map(Some).collect();
            for (shape, poses) in SHAPES.iter().flat_map(|s| [(*s, &still), (*s, &moved)]) {
                for points in [&points[..], &[]] {
                    let (path, _) = shaped_poses(shape, &times(n), poses, points);
                    let finite = |p: &Option<CameraPose>| {
                        p.is_some_and(|p| p.translation.iter().chain(p.rotation.coords.iter()).all(|v| v.is_finite()))
                    };
                    assert!(path.len() == n && path.iter().all(finite), "{shape:?} of {n} frames: {path:?}");
                }
            }
        }
        let none = shaped_poses(PathShape::Orbit, &[0.0, 1.0], &[None, None], &points).0;
        assert_eq!(none, [None, None]);
    }
}
