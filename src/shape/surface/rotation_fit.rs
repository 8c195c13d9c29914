//! The rotation that fits a covariance matrix best:
//!
//! ```text
//! R = argmax over SO(3) of tr(R S),      S = Σ c xᵀ,   which minimizes   Σ w |x − R e|²  for  c = w e.
//! ```
//!
//! With `S = U Σ Vᵀ` it is `R = V diag(1, 1, ±1) Uᵀ`. Four cells at a time are fitted by Newton's method on the unit
//! quaternions, with the previous rotation as initial guess: with `M = R S`
//!
//! ```text
//! H ω = a,   H = tr(M) I − (M + Mᵀ)/2,   a = axial(M − Mᵀ),   R ← exp[ω]ₓ R,
//! ```
//!
//! which converges quadratically: one or two steps near convergence of the outer iteration. The eigenvalues of `H` are the sums
//! of pairs of (signed) singular values; *all are positive only at the global maximum*, so positive definiteness certifies the
//! result, reflections included. Otherwise a singular value decomposition by one-sided Jacobi rotations is used; where the
//! maximum is not unique, the result is the rotation nearest to the previous one.
//!
//! # Reference
//! W. Kabsch, *A solution for the best rotation to relate two sets of vectors*, Acta Cryst. A32 (1976); for Newton's method
//! for rotation fitting M. Müller, J. Bender, N. Chentanez, M. Macklin, *A robust method to extract the rotational part of
//! deformations*, MIG 2016, whose fixed-point step `H = |tr M| I` has no certificate and converges linearly.

#![allow(clippy::inline_always)] // A kernel is compiled for wide registers only as far as it is inlined.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::lanes::{LANES, Lanes};

/// Step angle below which the fit has converged, rad: the remaining error is its square, below the rounding of `f64`.
const STEP_TOLERANCE: f64 = 3e-8;

/// Maximum Newton steps before the decomposition is used. Cells near convergence need one or two, others up to five.
const MAX_NEWTON_STEPS: usize = 8;

/// Minimum `det H` relative to `(tr H)³` for the certificate: below it some rotation is nearly undetermined.
const MIN_DETERMINANT: f64 = 1e-10;

/// Singular values below this fraction of the largest are rounding and determine no direction.
const RANK_TOLERANCE: f64 = 1e-13;

/// Maximum Jacobi sweeps; 3×3 matrices need four or five.
const MAX_JACOBI_SWEEPS: usize = 30;

/// Four covariances, row by row.
pub(super) type Covariances = [[Lanes; 3]; 3];

/// Four unit quaternions `[i, j, k, w]`.
pub(super) type Quaternions = [Lanes; 4];

/// Fits four rotations in place, from the initial guesses `rotations`; returns the four values of `tr(R S)`.
#[inline(always)]
pub(super) fn fit(s: &Covariances, rotations: &mut Quaternions) -> Lanes {
    for _ in 0..MAX_NEWTON_STEPS {
        let m = product(&matrices(rotations), s);
        let trace = m[0][0] + m[1][1] + m[2][2];
        let a = [m[1][2] - m[2][1], m[2][0] - m[0][2], m[0][1] - m[1][0]];
        let Some(omega) = newton(&m, trace, &a) else { break };
        *rotations = rotated(rotations, &omega);
        let squared = omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2];
        if squared.largest() < STEP_TOLERANCE * STEP_TOLERANCE {
            let half = Lanes::splat(0.5);
            return trace + half * (a[0] * omega[0] + a[1] * omega[1] + a[2] * omega[2]);
        }
    }
    decompose(s, rotations)
}

/// `H⁻¹ a`, or `None` where `H` of some lane is not safely positive definite.
#[inline(always)]
fn newton(m: &Covariances, trace: Lanes, a: &[Lanes; 3]) -> Option<[Lanes; 3]> {
    let half = Lanes::splat(-0.5);
    let (xx, yy, zz) = (m[1][1] + m[2][2], m[0][0] + m[2][2], m[0][0] + m[1][1]);
    let (xy, xz, yz) = (half * (m[0][1] + m[1][0]), half * (m[0][2] + m[2][0]), half * (m[1][2] + m[2][1]));
    // Cofactors of the symmetric H.
    let (cxx, cxy, cxz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let (cyy, cyz, czz) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
    let det = xx * cxx + xy * cxy + xz * cxz;
    let sum = trace + trace;
    let enough = Lanes::splat(MIN_DETERMINANT) * sum * sum * sum;
    // Sylvester: leading minors. `xx > 0` follows for the last two.
    let certified = xx.above(Lanes::splat(0.0)) & czz.above(Lanes::splat(0.0)) & det.above(enough);
    if !certified {
        return None;
    }
    let inverse = Lanes::splat(1.0) / det;
    Some([
        inverse * (cxx * a[0] + cxy * a[1] + cxz * a[2]),
        inverse * (cxy * a[0] + cyy * a[1] + cyz * a[2]),
        inverse * (cxz * a[0] + cyz * a[1] + czz * a[2]),
    ])
}

/// Rotation matrices of unit quaternions, row by row.
#[inline(always)]
pub(super) fn matrices(&[i, j, k, w]: &Quaternions) -> Covariances {
    let (one, two) = (Lanes::splat(1.0), Lanes::splat(2.0));
    let (ti, tj, tk) = (two * i, two * j, two * k);
    let (ii, jj, kk) = (ti * i, tj * j, tk * k);
    let (ij, ik, jk) = (ti * j, ti * k, tj * k);
    let (wi, wj, wk) = (ti * w, tj * w, tk * w);
    [[one - jj - kk, ij - wk, ik + wj], [ij + wk, one - ii - kk, jk - wi], [ik - wj, jk + wi, one - ii - jj]]
}

#[inline(always)]
pub(super) fn product(a: &Covariances, b: &Covariances) -> Covariances {
    let entry = |r: usize, c: usize| a[r][0] * b[0][c] + a[r][1] * b[1][c] + a[r][2] * b[2][c];
    let row = |r: usize| [entry(r, 0), entry(r, 1), entry(r, 2)];
    [row(0), row(1), row(2)]
}

/// `(1, ω/2) q`, normalized: the rotation by `ω` to third order, exactly a rotation at any size.
#[inline(always)]
fn rotated(&[i, j, k, w]: &Quaternions, omega: &[Lanes; 3]) -> Quaternions {
    let half = Lanes::splat(0.5);
    let [x, y, z] = [half * omega[0], half * omega[1], half * omega[2]];
    let q = [
        i + (w * x + y * k - z * j),
        j + (w * y + z * i - x * k),
        k + (w * z + x * j - y * i),
        w - (x * i + y * j + z * k),
    ];
    let norm = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    let inverse = Lanes::splat(1.0) / norm;
    [q[0] * inverse, q[1] * inverse, q[2] * inverse, q[3] * inverse]
}

/// Fits each lane by decomposition.
#[inline(never)]
fn decompose(s: &Covariances, rotations: &mut Quaternions) -> Lanes {
    let mut traces = [0.0; LANES];
    for (lane, trace) in traces.iter_mut().enumerate() {
        let s = Matrix3::from_fn(|r, c| s[r][c].0[lane]);
        let q = Quaternion::new(rotations[3].0[lane], rotations[0].0[lane], rotations[1].0[lane], rotations[2].0[lane]);
        let fitted = best_rotation(&s, &UnitQuaternion::new_unchecked(q));
        for (k, rotation) in rotations.iter_mut().enumerate() {
            rotation.0[lane] = fitted.coords[k];
        }
        *trace = (fitted.to_rotation_matrix().matrix() * s).trace();
    }
    Lanes(traces)
}

/// The rotation that maximizes `tr(R S)`; where several do, one near `last`.
pub(super) fn best_rotation(s: &Matrix3<f64>, last: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let scale = s.amax();
    if !(scale > 0.0 && scale.is_finite()) {
        return *last;
    }
    // The covariance after rotation by `last`.
    let m = last.to_rotation_matrix().matrix() * (s / scale);
    let (first, second) = leading_directions(&m);
    let remaining = match second {
        Some((u, v)) => {
            let from = Matrix3::from_columns(&[first.0, u, first.0.cross(&u)]);
            let to = Matrix3::from_columns(&[first.1, v, first.1.cross(&v)]);
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(to * from.transpose()))
        }
        None => shortest_rotation(&first.0, &first.1),
    };
    UnitQuaternion::new_normalize((remaining * last).into_inner())
}

/// Left and right singular vectors of the largest singular value, and of the second where it is not rounding.
fn leading_directions(m: &Matrix3<f64>) -> (Direction, Option<Direction>) {
    let (mut w, mut v) = (*m, Matrix3::identity());
    for _ in 0..MAX_JACOBI_SWEEPS {
        let rotated = [(0, 1), (0, 2), (1, 2)].map(|(p, q)| orthogonalize(&mut w, &mut v, p, q));
        if !rotated.contains(&true) {
            break;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| w.column(b).norm_squared().total_cmp(&w.column(a).norm_squared()));
    let [first, second, _] = order;
    let largest = w.column(first).norm();
    let u1 = w.column(first) / largest;
    let v1: Vector3<f64> = v.column(first).into();
    let orthogonal = w.column(second) - u1 * u1.dot(&w.column(second));
    let length = orthogonal.norm();
    let second = (length > RANK_TOLERANCE * largest).then(|| (orthogonal / length, v.column(second).into()));
    ((u1, v1), second)
}

/// Left and right singular vector.
type Direction = (Vector3<f64>, Vector3<f64>);

/// Makes columns `p` and `q` of `w = m v` orthogonal by rotating both; false where they are.
fn orthogonalize(w: &mut Matrix3<f64>, v: &mut Matrix3<f64>, p: usize, q: usize) -> bool {
    let (wp, wq) = (w.column(p).into_owned(), w.column(q).into_owned());
    let (alpha, beta, gamma) = (wp.norm_squared(), wq.norm_squared(), wp.dot(&wq));
    if gamma.abs() <= f64::EPSILON * (alpha * beta).sqrt() {
        return false;
    }
    let zeta = (beta - alpha) / (2.0 * gamma);
    let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
    let cosine = 1.0 / tangent.hypot(1.0);
    let sine = cosine * tangent;
    for matrix in [w, v] {
        let (a, b) = (matrix.column(p).into_owned(), matrix.column(q).into_owned());
        matrix.set_column(p, &(a * cosine - b * sine));
        matrix.set_column(q, &(a * sine + b * cosine));
    }
    true
}

/// The smallest rotation from one unit vector to another.
fn shortest_rotation(from: &Vector3<f64>, to: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(from, to).unwrap_or_else(|| {
        let least = from.iamin();
        let across = from.cross(&Vector3::ith(least, 1.0));
        UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_normalize(across), std::f64::consts::PI)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random_matrix(rng: &mut fastrand::Rng) -> Matrix3<f64> {
        Matrix3::from_fn(|_, _| 2.0 * rng.f64() - 1.0)
    }

    fn random_rotation(rng: &mut fastrand::Rng) -> UnitQuaternion<f64> {
        let [a, b, c, d] = [(); 4].map(|()| rng.f64() - 0.5);
        UnitQuaternion::new_normalize(Quaternion::new(a, b, c, d))
    }

    /// Violation of optimality: `M = R S` must be symmetric, and no sum of two of its eigenvalues negative.
    fn fault(rotation: &UnitQuaternion<f64>, s: &Matrix3<f64>) -> f64 {
        let m = rotation.to_rotation_matrix().matrix() * s;
        let least = (Matrix3::identity() * m.trace() - (m + m.transpose()) / 2.0).symmetric_eigenvalues().min();
        (m - m.transpose()).amax().max(-least) / s.amax()
    }

    fn fitted(s: &[Matrix3<f64>; 4], last: UnitQuaternion<f64>) -> ([UnitQuaternion<f64>; 4], [f64; 4]) {
        let lanes = |f: &dyn Fn(usize) -> f64| Lanes(std::array::from_fn(f));
        let covariances = std::array::from_fn(|r| std::array::from_fn(|c| lanes(&|l| s[l][(r, c)])));
        let mut rotations: Quaternions = std::array::from_fn(|k| Lanes::splat(last.coords[k]));
        let traces = fit(&covariances, &mut rotations);
        let quaternion =
            |l: usize| Quaternion::new(rotations[3].0[l], rotations[0].0[l], rotations[1].0[l], rotations[2].0[l]);
        (std::array::from_fn(|l| UnitQuaternion::new_unchecked(quaternion(l))), traces.0)
    }

    #[test]
    fn any_covariance_is_fitted_as_well_as_its_singular_values_allow() {
        let mut rng = fastrand::Rng::with_seed(7);
        for case in 0..2000 {
            // Full rank, both determinants, planes, needles and lines.
            let thin = [1.0, 1e-3, 1e-6, 1e-9, 0.0][case % 5];
            let squeeze = Matrix3::from_diagonal(&Vector3::new(1.0, thin, [thin, thin * thin, 1.0][case % 3]));
            let s = [(); 4].map(|()| random_matrix(&mut rng) * squeeze * random_matrix(&mut rng));
            let (rotations, traces) = fitted(&s, random_rotation(&mut rng));
            for l in 0..4 {
                assert!(fault(&rotations[l], &s[l]) < 3e-14, "{case}: {}", fault(&rotations[l], &s[l]));
                let expected = (rotations[l].to_rotation_matrix().matrix() * s[l]).trace();
                assert!((traces[l] - expected).abs() < 1e-14 * s[l].amax());
                // As good as any other decomposition finds.
                let svd = s[l].svd(false, false).singular_values;
                let least = svd.min() * if s[l].determinant() < 0.0 { 2.0 } else { 0.0 };
                assert!((expected - (svd.sum() - least)).abs() < 1e-6 * s[l].amax());
                assert!((rotations[l].norm() - 1.0).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn a_rotation_is_recovered_exactly_from_any_initial_guess() {
        let mut rng = fastrand::Rng::with_seed(3);
        for scale in [1e-150, 1e-6, 1.0, 1e6, 1e90] {
            for _ in 0..50 {
                let (rotation, shape) = (random_rotation(&mut rng), random_matrix(&mut rng));
                // S = Σ c (R c)ᵀ
                let s = shape * shape.transpose() * rotation.to_rotation_matrix().matrix().transpose() * scale;
                let (found, _) = fitted(&[s; 4], random_rotation(&mut rng));
                assert!(found[2].angle_to(&rotation) < 1e-7, "{}", found[2].angle_to(&rotation));
            }
        }
    }

    #[test]
    fn without_a_covariance_the_previous_rotation_stays() {
        let last = random_rotation(&mut fastrand::Rng::with_seed(5));
        let (rotations, traces) = fitted(&[Matrix3::zeros(); 4], last);
        assert_eq!((rotations[0], traces[0]), (last, 0.0));
        // Rank one: the rotation about the direction stays too.
        let axis = Vector3::new(0.3, -0.5, 0.8).normalize();
        let image = last * axis;
        let (rotations, _) = fitted(&[axis * image.transpose(); 4], last);
        assert!(rotations[3].angle_to(&last) < 1e-12);
        // To the opposite direction: half a rotation.
        let (rotations, traces) = fitted(&[-axis * image.transpose(); 4], last);
        assert!((rotations[0] * axis + image).norm() < 1e-12 && (traces[0] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn one_bad_lane_does_not_touch_the_others() {
        let mut rng = fastrand::Rng::with_seed(11);
        let good = random_matrix(&mut rng);
        let (alone, _) = fitted(&[good; 4], UnitQuaternion::identity());
        let mixed = [good, Matrix3::zeros(), -Matrix3::identity(), Matrix3::repeat(f64::NAN)];
        let (rotations, traces) = fitted(&mixed, UnitQuaternion::identity());
        assert!(rotations[0].angle_to(&alone[0]) < 1e-7);
        assert!((traces[2] - 1.0).abs() < 1e-13);
        assert!(rotations.iter().all(|q| q.coords.iter().all(|c| c.is_finite())));
    }
}
