//! Relative pose of two calibrated cameras from five rays.
//!
//! Five correspondences leave a four-dimensional space of matrices `E = x E₁ + y E₂ + z E₃ + E₄` with `x₂ᵀ E x₁ = 0`. An
//! essential matrix also satisfies the ten cubic equations
//!
//! ```text
//! det E = 0,      E Eᵀ E − ½ tr(E Eᵀ) E = 0.
//! ```
//!
//! Elimination of the ten monomials of higher order in `x`, `y` leaves three equations `a(z) x + b(z) y + c(z) = 0`, whose
//! determinant is a polynomial of degree ten in `z`. Each of its real roots gives one solution.
//!
//! Departure from the paper: each solution is refined by Newton's method on the cubic equations in the homogeneous
//! coordinates of the four-dimensional space. This restores the digits lost in the elimination and for solutions near
//! `E₄ = 0`.
//!
//! # Reference
//! D. Nistér, *An efficient solution to the five-point relative pose problem*, PAMI 26(6), 2004.

use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, Vector3, Vector4};

use super::correspondence::{Correspondence, matrix_of_rows};
use super::null_space::null_space;
use super::polynomial::real_roots;

/// Maximum number of Newton steps per solution. A simple root starts with at least three correct digits and doubles
/// them in each step; near a double root each step only halves the error.
const POLISH_STEPS: usize = 24;

/// Maximum residual of the cubic equations, for `‖E‖ = √2`, of an accepted solution.
const ACCEPTED: f64 = 1e-11;

/// Distance of two matrices of norm √2 below which they are the same solution, found twice: the root of the rounding error,
/// to which a double root is determined.
const SAME: f64 = 1e-8;

/// Unit vectors of the Householder reflections applied to the basis. The null-space basis is aligned with the
/// coordinate axes, and the essential matrices of cameras with hardly any rotation have almost no component along its
/// last matrix, which the elimination divides by. The second reflection handles the samples for which the first one
/// produces such a component.
const MIRRORS: [[f64; 4]; 2] = [[0.36, 0.48, 0.64, 0.48], [0.8, -0.4, 0.2, 0.4]];

type Quadratic = [f64; 10];
type Cubic = SVector<f64, 20>;
type Equations = SMatrix<f64, 10, 20>;

// Monomials of degree ≤ 2: x² y² z² xy xz yz x y z 1. Variable 3 is the constant 1.
const LINEAR_TIMES_LINEAR: [[usize; 4]; 4] = [[0, 3, 4, 6], [3, 1, 5, 7], [4, 5, 2, 8], [6, 7, 8, 9]];

// Monomials of degree ≤ 3 in the order of the paper:
// x³ y³ x²y xy² x²z x² y²z y² xyz xy | xz² xz x yz² yz y z³ z² z 1.
const QUADRATIC_TIMES_LINEAR: [[usize; 4]; 10] = [
    [0, 2, 4, 5],
    [3, 1, 6, 7],
    [10, 13, 16, 17],
    [2, 3, 8, 9],
    [4, 8, 10, 11],
    [8, 6, 13, 14],
    [5, 9, 11, 12],
    [9, 7, 14, 15],
    [11, 14, 17, 18],
    [12, 15, 18, 19],
];

/// All essential matrices, scaled to singular values `(1, 1, 0)`, that satisfy five correspondences in normalized
/// image coordinates. Pushed to `solutions`: at most ten, none if the five are linearly dependent.
pub fn five_point(sample: &[Correspondence; 5], solutions: &mut Vec<Matrix3<f64>>) {
    let Some(axes) = null_space::<5, 4>(&sample.map(|c| c.epipolar_row())) else { return };
    let start = solutions.len();
    for mirror in MIRRORS {
        push_solutions(&mirrored(&axes, mirror).map(|b| matrix_of_rows(&b)), start, solutions);
        // A real polynomial of even degree has an even number of real roots: an odd number of solutions means that
        // some were lost.
        if (solutions.len() - start).is_multiple_of(2) {
            break;
        }
    }
}

/// The basis reflected in the plane perpendicular to the unit coefficient vector `u`.
fn mirrored(axes: &[SVector<f64, 9>; 4], u: [f64; 4]) -> [SVector<f64, 9>; 4] {
    let along = axes.iter().zip(u).map(|(a, c)| a * c).sum::<SVector<f64, 9>>();
    std::array::from_fn(|k| axes[k] - along * (2.0 * u[k]))
}

/// Appends the solutions from one basis that are not yet in `solutions[start..]`.
fn push_solutions(basis: &[Matrix3<f64>; 4], start: usize, solutions: &mut Vec<Matrix3<f64>>) {
    let Some(reduced) = eliminated(cubic_equations(basis)) else { return };
    let system = hidden_variable_system(&reduced);
    for &z in real_roots(&determinant(&system)).as_slice() {
        let Some(v) = back_substituted(&system, z).and_then(|v| polished(basis, v)) else { continue };
        let e = combined(basis, &v) * std::f64::consts::SQRT_2;
        let again = |other: &Matrix3<f64>| (other - e).norm().min((other + e).norm()) < SAME;
        if !solutions[start..].iter().any(again) {
            solutions.push(e);
        }
    }
}

/// `Σ vₖ Eₖ`; of unit norm for unit `v`, because the basis is orthonormal.
fn combined(basis: &[Matrix3<f64>; 4], v: &Vector4<f64>) -> Matrix3<f64> {
    basis[0] * v[0] + basis[1] * v[1] + basis[2] * v[2] + basis[3] * v[3]
}

/// Entry `(i, j)` of `E` as a polynomial of degree one.
fn entry(basis: &[Matrix3<f64>; 4], i: usize, j: usize) -> [f64; 4] {
    basis.map(|b| b[(i, j)])
}

fn add_product(sum: &mut Quadratic, a: &[f64; 4], b: &[f64; 4], factor: f64) {
    for (p, &u) in a.iter().enumerate() {
        for (q, &v) in b.iter().enumerate() {
            sum[LINEAR_TIMES_LINEAR[p][q]] += factor * u * v;
        }
    }
}

fn add_cubic_product(sum: &mut Cubic, a: &Quadratic, b: &[f64; 4]) {
    for (p, &u) in a.iter().enumerate() {
        for (q, &v) in b.iter().enumerate() {
            sum[QUADRATIC_TIMES_LINEAR[p][q]] += u * v;
        }
    }
}

/// The ten cubic equations, one per row.
#[allow(clippy::needless_range_loop)] // the indices are those of the formula
fn cubic_equations(basis: &[Matrix3<f64>; 4]) -> Equations {
    let e: [[[f64; 4]; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| entry(basis, i, j)));
    let mut outer = [[[0.0; 10]; 3]; 3]; // E Eᵀ
    for i in 0..3 {
        for j in i..3 {
            for k in 0..3 {
                add_product(&mut outer[i][j], &e[i][k], &e[j][k], 1.0);
            }
            outer[j][i] = outer[i][j];
        }
    }
    let half_trace: Quadratic = std::array::from_fn(|m| 0.5 * (outer[0][0][m] + outer[1][1][m] + outer[2][2][m]));
    for (i, row) in outer.iter_mut().enumerate() {
        row[i].iter_mut().zip(half_trace).for_each(|(v, t)| *v -= t);
    }
    let mut equations = Equations::zeros();
    for i in 0..3 {
        for j in 0..3 {
            let mut cubic = Cubic::zeros();
            for k in 0..3 {
                add_cubic_product(&mut cubic, &outer[i][k], &e[k][j]);
            }
            equations.set_row(3 * i + j, &cubic.transpose());
        }
    }
    equations.set_row(9, &determinant_of_entries(&e).transpose());
    equations
}

fn determinant_of_entries(e: &[[[f64; 4]; 3]; 3]) -> Cubic {
    let mut det = Cubic::zeros();
    for j in 0..3 {
        let (k, l) = ((j + 1) % 3, (j + 2) % 3);
        let mut minor = [0.0; 10];
        add_product(&mut minor, &e[1][k], &e[2][l], 1.0);
        add_product(&mut minor, &e[1][l], &e[2][k], -1.0);
        add_cubic_product(&mut det, &minor, &e[0][j]);
    }
    det
}

/// Gauss–Jordan elimination with row pivoting of the first ten monomials; returns the coefficients of the last ten.
/// `None` if singular.
fn eliminated(mut a: Equations) -> Option<SMatrix<f64, 10, 10>> {
    for k in 0..10 {
        let pivot = (k..10).max_by(|&i, &j| a[(i, k)].abs().total_cmp(&a[(j, k)].abs())).expect("rows remain");
        a.swap_rows(k, pivot);
        let inverse = 1.0 / a[(k, k)];
        if !inverse.is_finite() {
            return None;
        }
        // Only rows 4 to 9 are used afterwards: the rows above are not reduced.
        for i in (4..k).chain(k + 1..10) {
            let factor = a[(i, k)] * inverse;
            for j in k + 1..20 {
                a[(i, j)] -= factor * a[(k, j)];
            }
        }
        for j in k + 1..20 {
            a[(k, j)] *= inverse;
        }
    }
    Some(a.fixed_columns::<10>(10).into_owned())
}

/// Three rows `(a(z), b(z), c(z))` of degrees 3, 3, 4, coefficients ascending: rows `e − z f`, `g − z h`, `i − z j` of the
/// paper.
type HiddenVariableSystem = [[[f64; 5]; 3]; 3];

fn hidden_variable_system(r: &SMatrix<f64, 10, 10>) -> HiddenVariableSystem {
    std::array::from_fn(|k| {
        let (e, f) = (4 + 2 * k, 5 + 2 * k);
        // Columns: xz² xz x | yz² yz y | z³ z² z 1, descending in z.
        let difference = |first: usize, terms: usize| {
            let mut c = [0.0; 5];
            for power in 0..terms {
                let column = first + terms - 1 - power;
                c[power] += r[(e, column)];
                c[power + 1] -= r[(f, column)];
            }
            c
        };
        [difference(0, 3), difference(3, 3), difference(6, 4)]
    })
}

fn multiplied<const N: usize>(a: &[f64], b: &[f64], sum: &mut [f64; N], factor: f64) {
    for (i, &u) in a.iter().enumerate() {
        for (j, &v) in b.iter().enumerate() {
            sum[i + j] += factor * u * v;
        }
    }
}

/// The determinant of the three rows, of degree ten, coefficients ascending.
fn determinant(s: &HiddenVariableSystem) -> [f64; 11] {
    let mut det = [0.0; 11];
    for k in 0..3 {
        let (l, m) = ((k + 1) % 3, (k + 2) % 3);
        let mut minor = [0.0; 7];
        multiplied(&s[l][0][..4], &s[m][1][..4], &mut minor, 1.0);
        multiplied(&s[m][0][..4], &s[l][1][..4], &mut minor, -1.0);
        multiplied(&minor, &s[k][2], &mut det, 1.0);
    }
    det
}

/// The unit vector along `(x, y, z, 1)` for a root `z`.
fn back_substituted(s: &HiddenVariableSystem, z: f64) -> Option<Vector4<f64>> {
    let at = |c: &[f64; 5]| c.iter().rev().fold(0.0, |sum, k| sum * z + k);
    let rows = s.map(|row| Vector3::new(at(&row[0]), at(&row[1]), at(&row[2])));
    let crossed = [rows[0].cross(&rows[1]), rows[1].cross(&rows[2]), rows[2].cross(&rows[0])];
    let n = crossed.iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    Vector4::new(n.x, n.y, n.z * z, n.z).try_normalize(0.0).filter(|v| v.iter().all(|c| c.is_finite()))
}

/// Newton's method on `E Eᵀ E − ½ tr(E Eᵀ) E = 0` over the unit sphere of the null space.
fn polished(basis: &[Matrix3<f64>; 4], mut v: Vector4<f64>) -> Option<Vector4<f64>> {
    let mut residual = f64::INFINITY;
    for _ in 0..POLISH_STEPS {
        let e = combined(basis, &v);
        let (outer, inner) = (e * e.transpose(), e.transpose() * e);
        let r = outer * e - 0.5 * outer.trace() * e;
        residual = r.norm();
        if residual < 1e-15 {
            break;
        }
        // The row v of the normal matrix excludes steps along v, under which the equations are homogeneous.
        let mut normal: Matrix4<f64> = v * v.transpose();
        let mut gradient = Vector4::zeros();
        let slopes = basis.map(|d| {
            let twisted = e * d.transpose();
            d * inner + twisted * e + outer * d - twisted.trace() * e - 0.5 * outer.trace() * d
        });
        for i in 0..4 {
            gradient[i] = slopes[i].dot(&r);
            for j in 0..4 {
                normal[(i, j)] += slopes[i].dot(&slopes[j]);
            }
        }
        v = (v - normal.cholesky()?.solve(&gradient)).normalize();
    }
    (residual < ACCEPTED).then_some(v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::tests::synthetic_views::{TwoViews, random_pose};

    fn sample(seed: u64) -> (TwoViews, [Correspondence; 5]) {
        let mut rng = fastrand::Rng::with_seed(seed);
        let views = TwoViews::general(random_pose(&mut rng, 0.5, 1.0), 5, &mut rng);
        let five = std::array::from_fn(|k| views.correspondences[k]);
        (views, five)
    }

    fn distance(a: &Matrix3<f64>, b: &Matrix3<f64>) -> f64 {
        (a - b).norm().min((a + b).norm())
    }

    #[test]
    fn every_solution_is_essential_and_one_is_the_truth() {
        let mut missed = 0;
        for seed in 0..2000 {
            let (views, five) = sample(seed);
            let mut solutions = Vec::new();
            five_point(&five, &mut solutions);
            assert!(solutions.len() <= 10);
            for e in &solutions {
                let outer = e * e.transpose();
                assert!((outer * e - 0.5 * outer.trace() * e).norm() < 1e-10 && e.determinant().abs() < 1e-10);
                assert!(five.iter().all(|c| c.second.dot(&(e * c.first)).abs() < 1e-10), "seed {seed}");
            }
            let best = solutions.iter().map(|e| distance(e, &views.essential())).fold(f64::INFINITY, f64::min);
            // Near a double root half of the digits of both solutions are lost, by any method.
            missed += usize::from(!(best < 1e-6));
        }
        assert_eq!(missed, 0);
    }

    #[test]
    fn no_real_solution_is_missed_against_the_eigenvalues_of_the_companion_matrix() {
        let mut differing = 0;
        for seed in 0..300 {
            let (_, five) = sample(seed);
            let basis = null_space::<5, 4>(&five.map(|c| c.epipolar_row())).expect("general position");
            let reduced = eliminated(cubic_equations(&basis.map(|b| matrix_of_rows(&b)))).expect("general position");
            let p = determinant(&hidden_variable_system(&reduced));
            let mut companion = SMatrix::<f64, 10, 10>::zeros();
            for k in 0..10 {
                companion[(k, 9)] = -p[k] / p[10];
                if k > 0 {
                    companion[(k, k - 1)] = 1.0;
                }
            }
            let eigen = companion.complex_eigenvalues();
            let real = eigen.iter().filter(|l| l.im.abs() < 1e-7 * l.norm()).count();
            let mut solutions = Vec::new();
            five_point(&five, &mut solutions);
            differing += usize::from(solutions.len() != real);
        }
        // Nearly double roots may be counted once or twice by either method.
        assert!(differing <= 3, "{differing} of 300");
    }

    #[test]
    fn pure_forward_motion_and_a_plane_are_no_exceptions() {
        let mut rng = fastrand::Rng::with_seed(9);
        for _ in 0..200 {
            let mut pose = random_pose(&mut rng, 0.1, 1.0);
            pose.translation = plumbline_camera::Vec3::new(0.0, 0.0, -1.0);
            for views in [TwoViews::general(pose, 5, &mut rng), TwoViews::planar(pose, 5, &mut rng)] {
                let mut solutions = Vec::new();
                five_point(&std::array::from_fn(|k| views.correspondences[k]), &mut solutions);
                let best = solutions.iter().map(|e| distance(e, &views.essential())).fold(f64::INFINITY, f64::min);
                assert!(best < 1e-5, "{best}");
            }
        }
    }

    #[test]
    fn repeated_points_have_no_solution() {
        let (_, mut five) = sample(1);
        five[4] = five[0];
        let mut solutions = Vec::new();
        five_point(&five, &mut solutions);
        assert!(solutions.is_empty());
    }
}
