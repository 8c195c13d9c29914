//! Laws of the solvers for any matrix, with dense algebra as oracle.

use nalgebra::{DMatrix, DVector};
use plumbline::num::run::Run;
use plumbline::num::sparse::{
    Eliminated, Factor, GeneralMatrix, Method, Multipliers, Ordering, Permutation, SparseBuilder, SparseError,
    backward_error, inverse_norm_1,
};

const METHODS: [Method; 5] = [Method::Cholesky, Method::SimplicialCholesky, Method::Ldlt, Method::Lu, Method::Qr];

fn matrix(rows: usize, columns: usize, entries: &[(usize, usize, f64)]) -> GeneralMatrix {
    let mut builder = SparseBuilder::new(rows, columns);
    for &(i, j, v) in entries {
        builder.add_entry(i, j, v);
    }
    builder.build().expect("inside")
}

fn dense(a: &GeneralMatrix) -> DMatrix<f64> {
    let mut dense = DMatrix::zeros(a.rows(), a.columns());
    a.entries().for_each(|(i, j, v)| dense[(i, j)] = v);
    dense
}

/// Random entries about the diagonal and far from it; `diagonal` is what keeps them definite.
fn random(n: usize, symmetric: bool, diagonal: f64, seed: u64) -> GeneralMatrix {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut entries: Vec<(usize, usize, f64)> = (0..n).map(|i| (i, i, diagonal)).collect();
    for i in 0..n {
        for j in [(i + 1) % n, (7 * i + 3) % n, (i * i) % n] {
            let v = rng.f64() - 0.5;
            if i != j {
                entries.push((i, j, v));
                entries.extend(symmetric.then_some((j, i, v)));
            }
        }
    }
    matrix(n, n, &entries)
}

fn right_hand_sides(rows: usize, columns: usize) -> Vec<f64> {
    (0..rows * columns).map(|k| (1.7 * k as f64).sin()).collect()
}

/// Largest difference to the dense least-squares solution, relative to it.
fn miss(a: &GeneralMatrix, b: &[f64], x: &[f64]) -> f64 {
    let svd = dense(a).svd(true, true);
    let columns = b.chunks(a.rows()).zip(x.chunks(a.columns()));
    let error = |(b, x): (&[f64], &[f64])| {
        let expected = svd.solve(&DVector::from_column_slice(b), 1e-14).expect("both sides computed");
        (DVector::from_column_slice(x) - &expected).amax() / expected.amax()
    };
    columns.map(error).fold(0.0, f64::max)
}

/// Largest difference to the solution by dense elimination with complete pivoting, relative to it, for square systems.
fn off(a: &GeneralMatrix, b: &[f64], x: &[f64]) -> f64 {
    let lu = dense(a).full_piv_lu();
    let error = |(b, x): (&[f64], &[f64])| {
        let expected = lu.solve(&DVector::from_column_slice(b)).expect("regular");
        (DVector::from_column_slice(x) - &expected).amax() / expected.amax()
    };
    b.chunks(a.rows()).zip(x.chunks(a.rows())).map(error).fold(0.0, f64::max)
}

fn orderings(n: usize) -> Vec<Ordering> {
    let backwards = Permutation::new((0..n as u32).rev().collect()).expect("a permutation");
    let positions = (0..n).map(|i| [i as f64, 0.0, 0.0]).collect();
    vec![
        Ordering::Natural,
        Ordering::Amd,
        Ordering::ReverseCuthillMcKee,
        Ordering::GraphDissection,
        Ordering::NestedDissection(positions),
        Ordering::Given(backwards),
    ]
}

#[test]
fn every_method_and_ordering_gives_the_dense_solution() {
    for n in [1, 2, 17, 120] {
        let a = random(n, true, 4.0, 5);
        let b = right_hand_sides(n, 3);
        for ordering in orderings(n) {
            for method in METHODS {
                let mut factor = a.factor(method, &ordering, &Run::default()).expect("definite");
                assert_eq!(factor.method(), method);
                let x = factor.solve(&b).expect("fits");
                assert!(miss(&a, &b, &x) < 1e-12, "n {n}, {method:?}, {ordering:?}");
            }
        }
    }
}

#[test]
fn the_automatic_choice_is_the_cheapest_that_works() {
    let cases = [
        (random(60, true, 4.0, 1), Method::Cholesky),
        (random(60, true, -4.0, 1), Method::Ldlt),
        (random(60, false, 4.0, 1), Method::Lu),
        (matrix(3, 2, &[(0, 0, 1.0), (1, 1, 2.0), (2, 0, 1.0), (2, 1, 1.0)]), Method::Qr),
        // A zero diagonal that pivoting within supernodes may not mend.
        (matrix(2, 2, &[(0, 1, 1.0), (1, 0, 1.0)]), Method::Ldlt),
    ];
    for (a, expected) in cases {
        let mut factor = a.factor(Method::Auto, &Ordering::Amd, &Run::default()).expect("regular");
        let b = right_hand_sides(a.rows(), 2);
        let x = factor.solve(&b).expect("fits");
        assert!(miss(&a, &b, &x) < 1e-11, "{expected:?}");
        let zero_diagonal = a.rows() == 2;
        assert!(factor.method() == expected || zero_diagonal && factor.method() == Method::Lu, "{:?}", factor.method());
    }
}

#[test]
fn the_transposed_system_is_solved_by_the_same_factor() {
    let a = random(50, false, 3.0, 9);
    let b = right_hand_sides(50, 1);
    let mut factor = a.factor(Method::Lu, &Ordering::Amd, &Run::default()).expect("regular");
    let x = factor.solve_transposed(&b).expect("LU offers it");
    assert!(miss(&a.transposed(), &b, &x) < 1e-12);
    assert!(a.factor(Method::Qr, &Ordering::Amd, &Run::default()).expect("regular").solve_transposed(&b).is_none());
}

#[test]
fn singular_and_unfit_matrices_are_refused_by_every_method() {
    // Unknown 2 is the sum of the others in every row.
    let entries = [(0, 0, 1.0), (1, 1, 1.0), (0, 2, 1.0), (1, 2, 1.0), (2, 0, 1.0), (2, 1, 1.0), (2, 2, 2.0)];
    let singular = matrix(3, 3, &entries);
    for method in METHODS.into_iter().chain([Method::Auto]) {
        let error = singular.factor(method, &Ordering::Natural, &Run::default()).expect_err("singular");
        let named = matches!(
            error,
            SparseError::Singular { .. } | SparseError::NotPositiveDefinite { .. } | SparseError::Undetermined { .. }
        );
        assert!(named, "{method:?}: {error}");
    }
    let empty_column = matrix(2, 2, &[(0, 0, 1.0), (1, 0, 1.0)]);
    for method in [Method::Lu, Method::Qr] {
        let error =
            empty_column.factor(method, &Ordering::Amd, &Run::default()).expect_err("nothing determines unknown 1");
        assert_eq!(error, SparseError::Undetermined { unknown: 1 });
    }
    let wide = matrix(2, 3, &[(0, 0, 1.0), (1, 1, 1.0), (1, 2, 1.0)]);
    let refused = |method| wide.factor(method, &Ordering::Amd, &Run::default()).expect_err("wide").to_string();
    assert_eq!(
        refused(Method::Auto),
        "2 equations do not determine 3 unknowns: add rows, or solve for the transposed matrix"
    );
    assert_eq!(refused(Method::Lu), "the matrix is 2×3, not square: use QR or the normal equations");
    let skew = matrix(2, 2, &[(0, 0, 1.0), (1, 1, 1.0), (1, 0, 0.5)]);
    assert_eq!(
        skew.factor(Method::Cholesky, &Ordering::Amd, &Run::default()).expect_err("not symmetric").to_string(),
        "the matrix is not symmetric: entry (1, 0) differs from its mirror image; use LU"
    );
    let mut factor = skew.factor(Method::Auto, &Ordering::Amd, &Run::default()).expect("regular");
    assert_eq!(factor.solve(&[1.0; 3]), Err(SparseError::Columns { given: 3, expected: 2 }));
}

/// A tall random matrix and its weights.
fn overdetermined() -> (GeneralMatrix, Vec<f64>) {
    let mut rng = fastrand::Rng::with_seed(2);
    let entries: Vec<_> =
        (0..90).flat_map(|i| [(i, i % 30, 3.0 + rng.f64()), (i, (5 * i + 2) % 30, rng.f64())]).collect();
    (matrix(90, 30, &entries), (0..90).map(|_| rng.f64() + 0.1).collect())
}

#[test]
fn weighted_least_squares_is_that_of_scaled_rows() {
    let (a, weights) = overdetermined();
    let b = right_hand_sides(90, 2);
    let scaled: Vec<_> = a.entries().map(|(i, j, v)| (i, j, v * weights[i].sqrt())).collect();
    let scaled_b: Vec<f64> = b.iter().enumerate().map(|(k, b)| b * weights[k % 90].sqrt()).collect();
    let mut normal = a.factor_ata(Some(&weights), &Ordering::Amd, &Run::default()).expect("determined");
    let scaled = matrix(90, 30, &scaled);
    assert!(miss(&scaled, &scaled_b, &normal.solve_ata(&b).expect("fits")) < 1e-12);
    normal.reweight(&[1.0; 90], &Run::default()).expect("determined");
    assert!(miss(&a, &b, &normal.solve_ata(&b).expect("fits")) < 1e-12);
    let qr =
        scaled.factor(Method::Qr, &Ordering::Amd, &Run::default()).expect("full rank").solve(&scaled_b).expect("fits");
    assert!(miss(&scaled, &scaled_b, &qr) < 1e-12);
}

#[test]
fn least_squares_names_what_no_row_determines_and_refuses_bad_weights() {
    let a = matrix(3, 3, &[(0, 0, 1.0), (1, 1, 1.0), (2, 0, 1.0), (2, 1, 2.0)]);
    let error = a.factor_ata(None, &Ordering::Amd, &Run::default()).expect_err("column 2 is empty");
    assert!(matches!(&error, SparseError::Singular { component } if component.unknowns == [2]), "{error}");
    let (a, mut weights) = overdetermined();
    weights[7] = -1.0;
    let error = a.factor_ata(Some(&weights), &Ordering::Amd, &Run::default()).expect_err("negative");
    assert_eq!(error.to_string(), "row 7 has weight -1 (expected a finite number, 0 or more)");
    let short = a.factor_ata(Some(&[1.0]), &Ordering::Amd, &Run::default()).expect_err("one weight");
    assert_eq!(short, SparseError::Columns { given: 1, expected: 90 });
}

#[test]
fn orthogonal_factors_keep_the_digits_that_normal_equations_lose() {
    // Monomials on [0, 1]: condition 10⁸ for degree 11, 10¹⁶ squared.
    let degree = 11;
    let entries: Vec<_> =
        (0..40).flat_map(|i| (0..=degree).map(move |j| (i, j, (i as f64 / 39.0).powi(j as i32)))).collect();
    let a = matrix(40, degree + 1, &entries);
    let expected = vec![1.0; degree + 1];
    let b = a.multiply(&expected);
    let worst = |x: Vec<f64>| x.iter().map(|x| (x - 1.0).abs()).fold(0.0, f64::max);
    let qr = worst(a.factor(Method::Qr, &Ordering::Amd, &Run::default()).expect("full rank").solve(&b).expect("fits"));
    let normal = a.factor_ata(None, &Ordering::Amd, &Run::default()).map(|mut f| worst(f.solve_ata(&b).expect("fits")));
    assert!(qr < 1e-6 && normal.as_ref().map_or(true, |miss| *miss > 100.0 * qr), "{qr} {normal:?}");
}

/// Laplacian of a chain, held by nothing.
fn chain(n: usize) -> GeneralMatrix {
    let edges = (1..n).flat_map(|i| [(i, i, 1.0), (i - 1, i - 1, 1.0), (i, i - 1, -1.0), (i - 1, i, -1.0)]);
    matrix(n, n, &edges.collect::<Vec<_>>())
}

#[test]
fn eliminated_values_are_kept_and_the_rest_is_in_balance() {
    let a = chain(9).symmetric().expect("symmetric");
    let positions = (0..9).map(|i| [f64::from(i), 0.0, 0.0]).collect();
    let given = Permutation::new((0..9).rev().collect()).expect("a permutation");
    for ordering in [Ordering::Amd, Ordering::NestedDissection(positions), Ordering::Given(given)] {
        let mut held = Eliminated::new(&a, &[8, 0], &ordering, &Run::default()).expect("held at both ends");
        let x = held.solve(&[0.0; 9], &[4.0, -4.0]).expect("fits");
        assert!(x.iter().enumerate().all(|(i, x)| (x - (i as f64 - 4.0)).abs() < 1e-13), "{x:?}");
    }
    let two = matrix(
        4,
        4,
        &[(0, 0, 1.0), (1, 1, 1.0), (0, 1, -1.0), (1, 0, -1.0), (2, 2, 1.0), (3, 3, 1.0), (3, 2, -1.0), (2, 3, -1.0)],
    );
    let error = Eliminated::new(&two.symmetric().expect("symmetric"), &[1], &Ordering::Amd, &Run::default())
        .expect_err("2 and 3 float");
    assert!(matches!(&error, SparseError::Singular { component } if component.unknowns == [2, 3]), "{error}");
    for bad in [&[9][..], &[3, 3]] {
        assert!(matches!(
            Eliminated::new(&a, bad, &Ordering::Amd, &Run::default()),
            Err(SparseError::OutOfRange { .. })
        ));
    }
    let mut held = Eliminated::new(&a, &[0], &Ordering::Amd, &Run::default()).expect("held");
    assert_eq!(held.solve(&[0.0; 9], &[]), Err(SparseError::Columns { given: 0, expected: 1 }));
}

#[test]
fn multipliers_hold_equations_and_are_the_forces_that_do() {
    // A chain that floats but for two equations: x₀ = 2, and the mean of the last two is 5.
    let a = chain(8);
    let c = matrix(2, 8, &[(0, 0, 1.0), (1, 6, 0.5), (1, 7, 0.5)]);
    let mut system = Multipliers::new(&a.symmetric().expect("symmetric"), &c, &Run::default()).expect("held");
    let b: Vec<f64> = (0..8).map(|i| 0.1 * f64::from(i)).collect();
    let solution = system.solve(&b, &[2.0, 5.0]).expect("fits");
    let held = c.multiply(&solution.x);
    assert!((held[0] - 2.0).abs() < 1e-12 && (held[1] - 5.0).abs() < 1e-12);
    let forces: Vec<f64> =
        a.multiply(&solution.x).iter().zip(c.multiply_transposed(&solution.multipliers)).map(|(f, l)| f + l).collect();
    assert!(forces.iter().zip(&b).all(|(f, b)| (f - b).abs() < 1e-12), "{forces:?}");
    let twice = matrix(2, 8, &[(0, 0, 1.0), (1, 0, 1.0)]);
    let error = Multipliers::new(&a.symmetric().expect("symmetric"), &twice, &Run::default())
        .expect_err("the same equation twice");
    assert!(matches!(error, SparseError::Undetermined { .. }), "{error}");
    let narrow = matrix(1, 7, &[(0, 0, 1.0)]);
    let error = Multipliers::new(&a.symmetric().expect("symmetric"), &narrow, &Run::default()).expect_err("7 columns");
    assert_eq!(error, SparseError::Columns { given: 7, expected: 8 });
}

#[test]
fn the_condition_estimate_is_a_close_lower_bound() {
    for (seed, diagonal) in [(1, 4.0), (2, 1.5), (3, 0.3), (4, 0.01)] {
        let a = random(40, seed % 2 == 0, diagonal, seed);
        let inverse = dense(&a).try_inverse().expect("regular");
        let exact = (0..40).map(|j| inverse.column(j).lp_norm(1)).fold(0.0, f64::max) * a.norm_1();
        let estimate =
            a.factor(Method::Auto, &Ordering::Amd, &Run::default()).expect("regular").condition(&a).expect("square");
        assert!(estimate <= exact * (1.0 + 1e-9) && 3.0 * estimate >= exact, "{exact:e} estimated {estimate:e}");
    }
    assert_eq!(inverse_norm_1(0, |_| vec![], |_| vec![]), 0.0);
    // An inverse that sends to nearly nothing what is constant, from either side: no climbing from there.
    let alternating = |b: &[f64], across: [f64; 4], along: [f64; 4]| {
        let share: f64 = along.iter().zip(b).map(|(w, b)| w * b).sum();
        across.iter().zip(b).map(|(v, b)| v * share + 1e-3 * b).collect::<Vec<f64>>()
    };
    let (v, w) = ([1.0, -1.0, 0.0, 0.0], [1.0, -1.0, 1.0, -1.0]);
    let hidden = inverse_norm_1(4, |b| alternating(b, v, w), |b| alternating(b, w, v));
    assert!(hidden <= 2.001 && hidden > 2.0 / 3.0, "2.001 estimated {hidden}");
    let diagonal = inverse_norm_1(3, |b| vec![b[0], b[1] / 0.01, b[2]], |b| vec![b[0], b[1] / 0.01, b[2]]);
    assert!((diagonal - 100.0).abs() < 1e-12);
}

#[test]
fn refinement_ends_at_the_rounding_of_the_data() {
    let a = random(80, false, 0.4, 11);
    let b = right_hand_sides(80, 1);
    let mut factor: Factor = a.factor(Method::Lu, &Ordering::Amd, &Run::default()).expect("regular");
    let mut x: Vec<f64> = factor.solve(&b).expect("fits").iter().map(|x| x * 1.001).collect();
    assert!(backward_error(&a, &b, &x) > 1e-5);
    let report = factor.refine(&a, &b, &mut x).expect("fits");
    assert!(report.steps >= 1 && report.backward_error < 1e-15, "{report:?}");
    assert_eq!(report.backward_error, backward_error(&a, &b, &x));
}

#[test]
fn renumbering_unknowns_renumbers_the_solution_and_nothing_else() {
    let a = random(70, true, 3.0, 21);
    let new: Vec<usize> = (0..70).map(|i| (29 * i + 4) % 70).collect();
    let renumbered: Vec<_> = a.entries().map(|(i, j, v)| (new[i], new[j], v)).collect();
    let renumbered = matrix(70, 70, &renumbered);
    let b = right_hand_sides(70, 1);
    let mut moved = vec![0.0; 70];
    (0..70).for_each(|i| moved[new[i]] = b[i]);
    for method in METHODS {
        let x = a.factor(method, &Ordering::Amd, &Run::default()).expect("definite").solve(&b).expect("fits");
        let y =
            renumbered.factor(method, &Ordering::Amd, &Run::default()).expect("definite").solve(&moved).expect("fits");
        assert!((0..70).all(|i| (y[new[i]] - x[i]).abs() < 1e-13), "{method:?}");
    }
}

/// A saddle point: a chain under equations, random ones and some of one unknown.
fn saddle(n: usize, equations: usize, seed: u64) -> GeneralMatrix {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut entries: Vec<_> = chain(n).entries().map(|(i, j, v)| (i, j, v * (1.0 + ((i + j) % 3) as f64))).collect();
    for k in 0..equations {
        let terms = if k % 3 == 0 { 1 } else { 4 };
        for t in 0..terms {
            let (j, v) = ((k * n / equations + 5 * t) % n, 0.5 + rng.f64());
            entries.extend([(n + k, j, v), (j, n + k, v)]);
        }
    }
    matrix(n + equations, n + equations, &entries)
}

#[test]
fn indefinite_systems_need_no_luck_with_their_diagonal() {
    let hollow = {
        let mut rng = fastrand::Rng::with_seed(8);
        let pairs = (0..90).flat_map(|i| [(i, (i + 1) % 90), (i, (i * 17 + 4) % 90)]).filter(|(i, j)| i != j);
        let entries: Vec<_> = pairs
            .flat_map(|(i, j)| {
                let v = rng.f64() - 0.5;
                [(i, j, v), (j, i, v)]
            })
            .collect();
        matrix(90, 90, &entries)
    };
    let tiny = matrix(3, 3, &[(0, 0, 1e-18), (1, 0, 1.0), (0, 1, 1.0), (2, 2, -2.0), (2, 1, 1.0), (1, 2, 1.0)]);
    let cases = [saddle(60, 20, 3), saddle(300, 90, 4), hollow, random(80, true, 1e-15, 6), tiny];
    for (case, a) in cases.iter().enumerate() {
        let b = right_hand_sides(a.rows(), 2);
        for ordering in orderings(a.rows()) {
            for method in [Method::Ldlt, Method::Lu] {
                let x = a.factor(method, &ordering, &Run::default()).expect("regular").solve(&b).expect("fits");
                assert!(off(a, &b, &x) < 1e-9, "case {case}, {method:?}, {ordering:?}: {}", off(a, &b, &x));
            }
        }
    }
}

#[test]
fn rows_may_have_to_move_far() {
    // A cycle and something beside it: every diagonal entry is zero or next to nothing.
    let mut rng = fastrand::Rng::with_seed(12);
    for (n, small) in [(2, 0.0), (50, 0.0), (120, 1e-13)] {
        let cycle = (0..n).flat_map(|i| [(i, (i + 1) % n, 2.0), (i, i, small)]);
        let far = (0..n / 2).map(|i| (i, (7 * i + 3) % n, rng.f64() - 0.5));
        let a = matrix(n, n, &cycle.chain(far).filter(|e| e.2 != 0.0).collect::<Vec<_>>());
        let b = right_hand_sides(n, 1);
        let mut factor = a.factor(Method::Lu, &Ordering::Amd, &Run::default()).expect("regular");
        assert!(off(&a, &b, &factor.solve(&b).expect("fits")) < 1e-11, "{n}");
        let x = factor.solve_transposed(&b).expect("LU offers it");
        assert!(off(&a.transposed(), &b, &x) < 1e-11, "{n}, transposed");
    }
}

#[test]
fn full_matrices_go_through_large_fronts() {
    let mut rng = fastrand::Rng::with_seed(31);
    let n = 100;
    let mut entries = Vec::new();
    for i in 0..n {
        entries.push((i, i, 60.0 + rng.f64()));
        for j in 0..i {
            let v = rng.f64() - 0.5;
            entries.extend([(i, j, v), (j, i, v)]);
        }
    }
    // And a chain hanging on it, so that the full part is also a parent.
    (n..n + 40).for_each(|i| entries.extend([(i, i, 3.0), (i, i - n, 1.0), (i - n, i, 1.0)]));
    let a = matrix(n + 40, n + 40, &entries);
    let indefinite = matrix(
        n + 40,
        n + 40,
        &entries.iter().map(|&(i, j, v)| (i, j, if i == j && i % 2 == 0 { -v } else { v })).collect::<Vec<_>>(),
    );
    let b = right_hand_sides(n + 40, 5);
    for method in METHODS {
        let x = a.factor(method, &Ordering::Amd, &Run::default()).expect("definite").solve(&b).expect("fits");
        assert!(off(&a, &b, &x) < 1e-12, "{method:?}");
    }
    for method in [Method::Ldlt, Method::Lu, Method::Qr] {
        let x = indefinite.factor(method, &Ordering::Amd, &Run::default()).expect("regular").solve(&b).expect("fits");
        assert!(off(&indefinite, &b, &x) < 1e-11, "{method:?}");
    }
}

#[test]
fn least_squares_leave_a_residual_that_no_column_sees() {
    let mut rng = fastrand::Rng::with_seed(77);
    for (m, n) in [(1, 1), (7, 3), (200, 50), (400, 20), (90, 90)] {
        let mut entries: Vec<_> = (0..n).map(|j| (j, j, 1.0 + rng.f64())).collect();
        entries.extend(
            (0..m)
                .flat_map(|i| [(i, i * 7 % n, 0.0), (i, (i * i + 3) % n, 0.0)])
                .map(|(i, j, _)| (i, j, rng.f64() - 0.5)),
        );
        let a = matrix(m, n, &entries);
        let b = right_hand_sides(m, 2);
        let x = a.factor(Method::Qr, &Ordering::Amd, &Run::default()).expect("full rank").solve(&b).expect("fits");
        assert!(miss(&a, &b, &x) < 1e-11, "{m}×{n}");
        for (b, x) in b.chunks(m).zip(x.chunks(n)) {
            let r: Vec<f64> = a.multiply(x).iter().zip(b).map(|(y, b)| b - y).collect();
            assert!(a.multiply_transposed(&r).iter().all(|g| g.abs() < 1e-12), "{m}×{n}");
        }
    }
    // Two equal columns; and one row too few for three columns that only it and another hold.
    let equal: Vec<_> = (0..6).flat_map(|i| [(i, 0, 1.0 + i as f64), (i, 1, 1.0 + i as f64), (i, 2, 1.0)]).collect();
    assert!(matrix(6, 3, &equal).factor(Method::Qr, &Ordering::Amd, &Run::default()).is_err());
    let starved = matrix(4, 3, &[(0, 0, 1.0), (1, 0, 2.0), (2, 0, 1.0), (3, 1, 1.0), (3, 2, 1.0)]);
    assert!(matches!(
        starved.factor(Method::Qr, &Ordering::Amd, &Run::default()),
        Err(SparseError::Undetermined { unknown: 1 | 2 })
    ));
}

#[test]
fn an_unconstrained_component_is_named_among_constrained_ones() {
    let mut entries: Vec<_> = chain(12).entries().collect();
    entries.push((0, 0, 1.0));
    entries.extend(chain(5).entries().map(|(i, j, v)| (i + 12, j + 12, v)));
    let error = matrix(17, 17, &entries)
        .factor(Method::Auto, &Ordering::Amd, &Run::default())
        .expect_err("the second chain floats");
    assert!(
        matches!(&error, SparseError::Singular { component } if component.unknowns == [12, 13, 14, 15, 16]),
        "{error}"
    );
}
