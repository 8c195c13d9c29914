//! The orbit: a circle about the point of interest at constant angular velocity.
//!
//! The point of interest `p` is the geometric median of the points near the image center that are seen longest. The centers
//! are projected to the plane of their two largest variances and a circle `(m, r)` is fitted by Pratt's method,
//! `min Σ (A|x|² + Bx + Cy + D)²` under `B² + C² − 4AD = 1`. With `φ̄` the least-squares line over time of the angles `φ_t`
//! about `m`, and `L(c)` the rotation that looks from `c` at `p` with the circle's axis upright,
//!
//! ```text
//! c̄_t = m + r (e₁ cos φ̄(τ_t) + e₂ sin φ̄(τ_t)),      R̄_t = Ō L(c̄_t),      Ō: mean of R_t L(c_t)ᵀ
//! ```
//!
//! `Ō` keeps the mean image position of the point of interest, which is seldom the center.
//!
//! # Reference
//! V. Pratt: *Direct least-squares fitting of algebraic surfaces*, SIGGRAPH 1987; the Newton steps for its least eigenvalue
//! as in N. Chernov, *Circular and linear regression*, 2010, section 5.5. Unlike the simpler algebraic fits it does not
//! shrink short arcs.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2};

use super::camera_path::{CameraRun, SeenPoint, about_mean, looking, median, principal_axes};
use super::regression::polynomial;
use plumbline_camera::{CameraPose, Vec3};

/// Mean distance from the image center, in half diagonals, up to which a point counts as central: the inner sixth of the area
/// of a circle through the corners.
const MAX_OFF_CENTER: f64 = 0.4;

/// Fraction of the central points, seen longest, whose median is the point of interest: the subject is followed, the
/// background behind it changes.
const LONGEST_SEEN_FRACTION: f64 = 0.25;

/// Radius, in extents of the path, beyond which the path is straight: the arc then deviates from its chord by less than 1 %.
const MAX_RADIUS: f64 = 50.0;

/// Least angle, rad, between view and circle axis, and least distance from the point of interest in radii, at which an upright
/// view is defined: 1e-6 keeps half of the digits of a cross product.
const MIN_ANGLE: f64 = 1e-6;

/// Limit on Newton's iterations of the fit, which stops earlier, once the residual no longer falls.
const MAX_ITERATIONS: usize = 50;

/// The cameras on their orbit; `None` where there is no point of interest, or no circle fits the centers.
pub(super) fn orbit(cameras: &CameraRun, points: &[SeenPoint]) -> Option<Vec<CameraPose>> {
    let interest = interest(points)?;
    let (mean, [e1, e2, axis]) = principal_axes(&cameras.centers);
    let flat: Vec<Vector2<f64>> =
        cameras.centers.iter().map(|c| Vector2::new(e1.dot(&(c - mean)), e2.dot(&(c - mean)))).collect();
    let (middle, radius) = circle(&flat)?;
    let angles = unwrapped(flat.iter().map(|p| (p.y - middle.y).atan2(p.x - middle.x)));
    let look = |center: &Vec3| looking_at(&(interest - center), &axis, MIN_ANGLE * radius);
    let offsets = cameras.centers.iter().zip(&cameras.rotations).map(|(c, r)| Some(r * look(c)?.inverse()));
    let offset = about_mean(&offsets.collect::<Option<Vec<_>>>()?).0;
    let pose = |angle: f64| {
        let at = middle + radius * Vector2::new(angle.cos(), angle.sin());
        let center = mean + e1 * at.x + e2 * at.y;
        Some(looking(center, offset * look(&center)?))
    };
    polynomial(&cameras.times_s, &angles, 1).into_iter().map(pose).collect()
}

/// The point that the camera looks at.
fn interest(points: &[SeenPoint]) -> Option<Vec3> {
    let mut around: Vec<&SeenPoint> = points.iter().filter(|s| s.off_center <= MAX_OFF_CENTER).collect();
    around.sort_by_key(|s| std::cmp::Reverse(s.frames));
    let least = around.get((LONGEST_SEEN_FRACTION * around.len() as f64) as usize)?.frames;
    let longest: Vec<Vec3> = around.iter().take_while(|s| s.frames >= least).map(|s| s.position.coords).collect();
    Some(median(&longest))
}

/// The rotation of a camera that looks along `view` with `up` upright.
fn looking_at(view: &Vec3, up: &Vec3, nearest: f64) -> Option<UnitQuaternion<f64>> {
    let z = view.try_normalize(nearest)?;
    let x = z.cross(up).try_normalize(MIN_ANGLE)?;
    let y = z.cross(&x);
    let rows = Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]);
    Some(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows)))
}

/// Angles without jumps of 2π.
fn unwrapped(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut last = None;
    let unwrap = |angle: f64| {
        let revolutions = last.map_or(0.0, |last: f64| ((last - angle) / std::f64::consts::TAU).round());
        *last.insert(angle + revolutions * std::f64::consts::TAU)
    };
    angles.map(unwrap).collect()
}

/// Center and radius of the circle fitted to points whose mean is the origin; `None` for collinear or coincident points.
fn circle(points: &[Vector2<f64>]) -> Option<(Vector2<f64>, f64)> {
    let n = points.len() as f64;
    let moment = |of: &dyn Fn(&Vector2<f64>) -> f64| points.iter().map(of).sum::<f64>() / n;
    let square = |p: &Vector2<f64>| p.norm_squared();
    let (xx, yy, xy) = (moment(&|p| p.x * p.x), moment(&|p| p.y * p.y), moment(&|p| p.x * p.y));
    let (xz, yz, zz) = (moment(&|p| p.x * square(p)), moment(&|p| p.y * square(p)), moment(&|p| square(p).powi(2)));
    let (z, det) = (xx + yy, xx * yy - xy * xy);
    // Newton's method from zero finds the smallest root that is not negative of a₀ + a₁η + a₂η² + 4η⁴.
    let a2 = 4.0 * det - 3.0 * z * z - zz;
    let a1 = zz * z + 4.0 * det * z - xz * xz - yz * yz - z.powi(3);
    let a0 = xz * xz * yy + yz * yz * xx - zz * det - 2.0 * xz * yz * xy + z * z * det;
    let value = |x: f64| a0 + x * (a1 + x * (a2 + 4.0 * x * x));
    let mut root = 0.0;
    for _ in 0..MAX_ITERATIONS {
        let next: f64 = root - value(root) / (a1 + root * (2.0 * a2 + 16.0 * root * root));
        if !(next > 0.0 && value(next).abs() < value(root).abs()) {
            break;
        }
        root = next;
    }
    let below = 2.0 * (root * root - root * z + det);
    let middle = Vector2::new(xz * (yy - root) - yz * xy, yz * (xx - root) - xz * xy) / below;
    let radius = (middle.norm_squared() + z + 2.0 * root).sqrt();
    let extent = points.iter().map(Vector2::norm).fold(0.0, f64::max);
    (radius > 0.0 && radius <= MAX_RADIUS * extent).then_some((middle, radius))
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_camera::Point3;

    /// Upright cameras on a circle about a point at a constant image position.
    fn circling(n: usize, from: f64, to: f64) -> (CameraRun, Vec<SeenPoint>) {
        let interest = Vec3::new(0.3, -0.2, 1.0);
        let up = -Vec3::y();
        let offset = UnitQuaternion::from_scaled_axis(Vec3::new(0.05, -0.1, 0.0));
        let centers: Vec<Vec3> = (0..n)
            .map(|t| {
                let angle = from + (to - from) * t as f64 / (n as f64 - 1.0);
                Vec3::new(1.0 + 3.0 * angle.cos(), -0.2, 3.0 * angle.sin())
            })
            .collect();
        let look = |c: &Vec3| offset * looking_at(&(interest - c), &up, 0.0).expect("upright");
        let rotations = centers.iter().map(look).collect();
        let times_s = (0..n).map(|t| t as f64 / 25.0).collect();
        let seen =
            |position: Vec3, frames, off_center| SeenPoint { position: Point3::from(position), frames, off_center };
        let mut points = vec![seen(interest, 50, 0.1); 9];
        points.extend(vec![seen(Vec3::new(9.0, 9.0, 9.0), 90, 0.8); 30]);
        points.extend(vec![seen(Vec3::new(-9.0, 9.0, 9.0), 4, 0.1); 20]);
        (CameraRun { times_s, centers, rotations }, points)
    }

    #[test]
    fn cameras_on_a_circle_are_their_own_orbit() {
        for (from, to) in [(0.0, 1.0), (2.0, 7.5), (0.5, -6.0)] {
            let (cameras, points) = circling(60, from, to);
            let orbit = orbit(&cameras, &points).expect("an orbit");
            for (t, pose) in orbit.iter().enumerate() {
                let off =
                    (pose.center().coords - cameras.centers[t]).norm() + pose.rotation.angle_to(&cameras.rotations[t]);
                assert!(off < 1e-6, "{from} to {to}: frame {t} is {off} off");
            }
        }
    }

    #[test]
    fn a_shaky_arc_becomes_a_circle_at_constant_speed() {
        let mut random = fastrand::Rng::with_seed(7);
        let (mut cameras, points) = circling(90, 0.0, 1.5);
        for center in &mut cameras.centers {
            *center += 0.03 * Vec3::from_fn(|_, _| random.f64() - 0.5);
        }
        let orbit = orbit(&cameras, &points).expect("an orbit");
        let chord = |k: usize| (orbit[k + 1].center() - orbit[k].center()).norm();
        assert!((0..89).all(|k| (chord(k) / chord(0) - 1.0).abs() < 1e-6), "even speed");
        for (pose, own) in orbit.iter().zip(&cameras.centers) {
            let off = (pose.center().coords - own).norm();
            assert!(off < 0.05, "{off} from the camera, which shakes by 0.03");
        }
    }

    #[test]
    fn a_circle_is_found_in_a_short_and_noisy_arc() {
        let mut random = fastrand::Rng::with_seed(8);
        let mut noise = || 0.005 * (random.f64() - 0.5);
        let at = |k: i32| f64::from(k) / 400.0;
        let mut points: Vec<_> =
            (0..200).map(|k| Vector2::new(2.0 * at(k).cos() - 2.0 + noise(), 2.0 * at(k).sin() + noise())).collect();
        let mean = points.iter().sum::<Vector2<f64>>() / 200.0;
        for point in &mut points {
            *point -= mean;
        }
        let (middle, radius) = circle(&points).expect("a circle");
        let off = (middle + mean - Vector2::new(-2.0, 0.0)).norm();
        assert!((radius - 2.0).abs() < 0.1 && off < 0.1, "{off} off, radius {radius}");
    }

    #[test]
    fn collinear_and_coincident_points_give_no_circle() {
        let line: Vec<_> = (-20..=20).map(|k| Vector2::new(f64::from(k), 2.0 * f64::from(k))).collect();
        assert_eq!(circle(&line), None);
        let bent: Vec<_> = line.iter().map(|p| p + Vector2::new(0.0, 1e-6 * p.x * p.x)).collect();
        assert_eq!(circle(&bent), None, "as good as a line");
        assert_eq!(circle(&[Vector2::zeros(); 5]), None);
        assert_eq!(circle(&[Vector2::zeros()]), None);
        assert_eq!(circle(&[]), None);
    }

    #[test]
    fn without_points_around_the_middle_there_is_no_orbit() {
        let (cameras, mut points) = circling(30, 0.0, 1.0);
        assert!(orbit(&cameras, &[]).is_none());
        for seen in &mut points {
            seen.off_center = 0.9;
        }
        assert!(orbit(&cameras, &points).is_none());
    }
}
