//! Laws of the energy core, with dense algebra as oracle.

use nalgebra::{DMatrix, DVector, Matrix2, Vector1, Vector2};
use plumbline::num::energy::{
    Convergence, EnergyError, FixedSet, LeastSquares, LocalGlobal, Loss, Ordering, PlaneExpr, QuadraticEnergy,
    Reweighted, Term, Value,
};
use plumbline::num::math::Vec2;
use plumbline::num::run::Run;

use crate::allocations::allocations_of;

const COLS: usize = 7;
const ROWS: usize = 5;
const N: usize = COLS * ROWS;

fn rest(i: usize) -> Vec2 {
    Vec2::new((i % COLS) as f64, (i / COLS) as f64)
}

/// Edges of a grid with one diagonal per cell.
fn edges() -> Vec<(usize, usize)> {
    let mut edges = vec![];
    for i in 0..N {
        let (x, y) = (i % COLS, i / COLS);
        if x + 1 < COLS {
            edges.push((i, i + 1));
        }
        if y + 1 < ROWS {
            edges.push((i, i + COLS));
        }
        if x + 1 < COLS && y + 1 < ROWS {
            edges.push((i, i + COLS + 1));
        }
    }
    edges
}

fn edge_weight(k: usize) -> f64 {
    0.5 + (k % 5) as f64 / 3.0
}

/// `Σ w ‖(xᵢ − xⱼ) − (restᵢ − restⱼ)‖²` and its terms.
fn springs() -> (LeastSquares<2>, Vec<Term>) {
    let mut e = LeastSquares::<2>::new(N);
    let terms = edges()
        .into_iter()
        .enumerate()
        .map(|(k, (i, j))| e.add(edge_weight(k), e.var(i) - e.var(j) - (rest(i) - rest(j))))
        .collect();
    (e, terms)
}

fn corners() -> FixedSet {
    FixedSet::new([N - 1, 0, COLS - 1, 0])
}

fn bent(i: usize) -> Vec2 {
    rest(i) + Vec2::new((i as f64).sin(), 0.3 * i as f64)
}

#[test]
fn the_minimizer_is_the_dense_one() {
    let (e, _) = springs();
    let fixed = corners();
    let mut factored = e.factor(&fixed, &Run::default()).expect("held at the corners");
    let x = factored.solve(&factored.targets(), &fixed.values(bent)).expect("same set");
    let free: Vec<usize> = (0..N).filter(|i| !fixed.unknowns().contains(i)).collect();
    let (mut a, mut b) = (DMatrix::<f64>::zeros(edges().len(), N), DMatrix::<f64>::zeros(edges().len(), 2));
    for (k, (i, j)) in edges().into_iter().enumerate() {
        let w = edge_weight(k).sqrt();
        (a[(k, i)], a[(k, j)]) = (w, -w);
        b.set_row(k, &((rest(i) - rest(j)) * w).transpose());
    }
    for &i in fixed.unknowns() {
        let column = a.column(i) * bent(i).transpose();
        b -= column;
    }
    let a = DMatrix::from_columns(&free.iter().map(|&i| a.column(i)).collect::<Vec<_>>());
    let expected = a.svd(true, true).solve(&b, 1e-12).expect("full rank");
    for (k, &i) in free.iter().enumerate() {
        let err = (x[i].transpose() - expected.row(k)).norm();
        assert!(err < 1e-12 * N as f64, "unknown {i}: {err}");
    }
    fixed.unknowns().iter().for_each(|&i| assert_eq!(x[i], bent(i), "given values are kept exactly"));
}

#[test]
fn at_the_minimum_every_step_costs() {
    let (e, _) = springs();
    let mut factored = e.factor(&corners(), &Run::default()).expect("regular");
    let targets = factored.targets();
    let x = factored.solve(&targets, &corners().values(bent)).expect("same set");
    let least = factored.energy(&targets, &x);
    for i in (0..N).filter(|i| !corners().unknowns().contains(i)) {
        for step in [Vec2::new(0.1, 0.0), Vec2::new(-0.1, 0.0), Vec2::new(0.0, 0.1), Vec2::new(0.0, -0.1)] {
            let mut y = x.clone();
            y[i] += step;
            assert!(factored.energy(&targets, &y) > least + 1e-3, "unknown {i}");
        }
    }
}

#[test]
fn translation_of_the_given_values_translates_the_rest() {
    let (e, _) = springs();
    let mut factored = e.factor(&corners(), &Run::default()).expect("regular");
    let targets = factored.targets();
    let x = factored.solve(&targets, &corners().values(bent)).expect("same set");
    let shift = Vec2::new(3.0, -8.0);
    let y = factored.solve(&targets, &corners().values(|i| bent(i) + shift)).expect("same set");
    let worst = x.iter().zip(&y).map(|(x, y)| (y - x - shift).norm()).fold(0.0, f64::max);
    assert!(worst < 1e-12 * N as f64, "{worst}");
    let at_rest = factored.solve(&targets, &corners().values(rest)).expect("same set");
    assert!(factored.energy(&targets, &at_rest) < 1e-24, "the rest shape costs nothing");
}

#[test]
fn the_clear_and_the_fast_path_agree() {
    // D = 1 with terms that mix x and y; the fast path takes the same rows as elements.
    let mut clear = LeastSquares::<1>::new(2 * N);
    let mut rows: Vec<(Vec<usize>, Vec<f64>, f64, f64)> = vec![];
    for (k, (i, j)) in edges().into_iter().enumerate() {
        let (u, v, w) = (0.3, 0.8, edge_weight(k));
        let side = clear.point(j) - clear.point(i);
        let next = (j + 3) % N;
        clear.add2(w, clear.point(next) - (clear.point(i) + u * side.clone() + v * side.r90()) - bent(k % N));
        // x: xₙ − (1−u) xᵢ − u xⱼ − v (yⱼ − yᵢ);  y: yₙ − (1−u) yᵢ − u yⱼ + v (xⱼ − xᵢ)
        for (own, other, sign, b) in [(0, 1, 1.0, bent(k % N).x), (1, 0, -1.0, bent(k % N).y)] {
            let mut row = vec![0.0; 2 * N];
            row[2 * next + own] += 1.0;
            row[2 * i + own] -= 1.0 - u;
            row[2 * j + own] -= u;
            row[2 * j + other] -= sign * v;
            row[2 * i + other] += sign * v;
            let used: Vec<usize> = (0..2 * N).filter(|&c| row[c] != 0.0).collect();
            rows.push((used.clone(), used.iter().map(|&c| row[c]).collect(), w, b));
        }
    }
    for i in 0..N {
        clear.add2(0.01, clear.point(i) - Vec2::new(0.5, 0.5));
    }
    let none = FixedSet::none();
    let mut factored = clear.factor(&none, &Run::default()).expect("held by targets");
    let x = factored.solve(&factored.targets(), &none.values(|_| Vector1::zeros())).expect("same set");

    let mut fast =
        QuadraticEnergy::<f64>::new(2 * N, rows.iter().map(|r| &r.0[..]), &Ordering::Natural).expect("in range");
    let fill = |fast: &mut QuadraticEnergy<f64>| {
        fast.clear();
        for (e, (_, coefficients, w, b)) in rows.iter().enumerate() {
            fast.add(e, *w, coefficients, *b);
        }
        fast.add_everywhere(0.01, 0.5);
    };
    fill(&mut fast);
    let y = fast.minimize(&Run::default()).expect("regular");
    let worst = x.iter().zip(y).map(|(x, y)| (x.x - y).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-10 && y.iter().any(|y| (y - 0.5).abs() > 1.0), "{worst}");
    let count = allocations_of(|| {
        fill(&mut fast);
        fast.minimize(&Run::default()).expect("regular");
    });
    assert_eq!(count, 0, "the fast path allocates nothing");
}

#[test]
fn solves_and_reweightings_allocate_nothing() {
    let (e, _) = springs();
    let fixed = corners();
    let mut factored = e.factor(&fixed, &Run::default()).expect("regular");
    let (targets, values) = (factored.targets(), fixed.values(bent));
    let mut x = vec![Value::<2>::zeros(); N];
    factored.solve_into(&targets, &values, &mut x).expect("same set");
    let count = allocations_of(|| {
        factored.reweight(|_, w| 2.0 * w, &Run::default()).expect("regular");
        factored.solve_into(&targets, &values, &mut x).expect("same set");
    });
    assert_eq!(count, 0);
}

#[test]
fn reweighting_equals_a_new_energy() {
    let (e, terms) = springs();
    let mut factored = e.factor(&corners(), &Run::default()).expect("regular");
    factored.reweight(|t, w| if t == terms[4] { 0.0 } else { w * 3.0 }, &Run::default()).expect("regular");
    let mut other = LeastSquares::<2>::new(N);
    for (k, (i, j)) in edges().into_iter().enumerate().filter(|&(k, _)| k != 4) {
        other.add(3.0 * edge_weight(k), other.var(i) - other.var(j) - (rest(i) - rest(j)));
    }
    let mut fresh = other.factor(&corners(), &Run::default()).expect("regular");
    let values = corners().values(bent);
    let x = factored.solve(&factored.targets(), &values).expect("same set");
    let y = fresh.solve(&fresh.targets(), &values).expect("same set");
    assert!(x.iter().zip(&y).all(|(x, y)| (x - y).norm() < 1e-12 * N as f64));
}

#[test]
fn placed_unknowns_give_the_same_solution() {
    let (e, _) = springs();
    let positions: Vec<[f64; 3]> = (0..N).map(rest).map(|p| [p.x, p.y, 0.0]).collect();
    let values = corners().values(bent);
    let mut a = e.factor(&corners(), &Run::default()).expect("regular");
    let mut b = e.factor_placed(&corners(), &positions, &Run::default()).expect("regular");
    let (x, y) = (a.solve(&a.targets(), &values).expect("ok"), b.solve(&b.targets(), &values).expect("ok"));
    assert!(x.iter().zip(&y).all(|(x, y)| (x - y).norm() < 1e-12 * N as f64));
}

#[test]
fn expressions_keep_the_algebra_of_vectors() {
    let mut e = LeastSquares::<1>::new(4);
    let n = Vec2::new(0.6, 0.8);
    let p: PlaneExpr = e.point(0);
    // (2p − q·2 + k)·n with p = (3, 1), q = (1, 1): 2·2·0.6 + 0 + k·n.
    let t = e.add(1.0, (2.0 * p.clone() - e.point(1) * 2.0 + Vec2::new(1.0, 2.0)).dot(n));
    let r = e.add2(1.0, -p.r90() + Vec2::new(0.5, 0.0));
    let all = FixedSet::new(0..4);
    let mut factored = e.factor(&all, &Run::default()).expect("nothing is free");
    let x = factored.solve(&factored.targets(), &all.values(|i| Vector1::new([3.0, 1.0, 1.0, 1.0][i]))).expect("ok");
    let squared = |t| factored.squared_residual(t, &factored.targets(), &x);
    assert!((squared(t) - (2.4_f64 + 0.6 + 1.6).powi(2)).abs() < 1e-12, "{}", squared(t));
    // −R₉₀ (3, 1) = (−1, 3)
    assert!((squared(r) - (0.25 + 9.0)).abs() < 1e-12, "{}", squared(r));
    assert!((factored.energy(&factored.targets(), &x) - squared(t) - squared(r)).abs() < 1e-12);
}

#[test]
fn bad_energies_are_refused_with_their_reason() {
    let (e, _) = springs();
    let error = |r: Result<_, EnergyError>| {
        r.map(|_: plumbline::num::energy::Factored<2>| ()).expect_err("refused").to_string()
    };
    assert_eq!(
        error(e.factor(&FixedSet::none(), &Run::default())),
        "nothing holds the component of 35 unknown(s) that contains unknown 0: fix one of them or give it a target"
    );
    let mut two = LeastSquares::<2>::new(N + 3);
    for (i, j) in edges().into_iter().chain([(N, N + 1), (N + 1, N + 2)]) {
        two.add(1.0, two.var(i) - two.var(j));
    }
    assert_eq!(
        two.factor(&corners(), &Run::default()).expect_err("floats"),
        EnergyError::Unconstrained { unknowns: vec![N, N + 1, N + 2] }
    );
    let mut bad = LeastSquares::<2>::new(3);
    bad.add(1.0, bad.var(0));
    bad.add(-2.0, bad.var(1));
    assert_eq!(
        error(bad.factor(&FixedSet::none(), &Run::default())),
        "term 1 has weight -2 (expected a finite number, 0 or more)"
    );
    let mut nan = LeastSquares::<2>::new(3);
    nan.add(1.0, nan.var(0) - Vector2::new(f64::NAN, 0.0));
    assert_eq!(
        error(nan.factor(&FixedSet::none(), &Run::default())),
        "term 0 has a coefficient or target that is not finite"
    );
    let mut beyond = LeastSquares::<2>::new(3);
    beyond.add(1.0, beyond.var(3));
    assert_eq!(
        error(beyond.factor(&FixedSet::none(), &Run::default())),
        "unknown 3 does not exist (the energy has 3, numbered from 0)"
    );
    let mut factored = e.factor(&corners(), &Run::default()).expect("regular");
    let other = FixedSet::new([1]).values(bent);
    assert_eq!(
        factored.solve(&factored.targets(), &other).expect_err("another set").to_string(),
        "1 fixed value(s) do not belong to the fixed set of 3"
    );
    let few =
        LeastSquares::<2>::new(3).factor(&FixedSet::new(0..3), &Run::default()).expect("nothing is free").targets();
    assert_eq!(
        factored.solve(&few, &corners().values(bent)).expect_err("another energy").to_string(),
        format!("0 target(s) do not belong to an energy of {} row(s)", edges().len())
    );
    assert!(matches!(factored.reweight(|_, _| f64::NAN, &Run::default()), Err(EnergyError::Weight { term: 0, .. })));
    assert!(matches!(factored.reweight(|_, _| 0.0, &Run::default()), Err(EnergyError::Unconstrained { .. })));
}

/// Rotation nearest to a 2×2 matrix.
fn rotation(m: Matrix2<f64>) -> Matrix2<f64> {
    let angle = (m[(1, 0)] - m[(0, 1)]).atan2(m[(0, 0)] + m[(1, 1)]);
    Matrix2::new(angle.cos(), -angle.sin(), angle.sin(), angle.cos())
}

/// As-rigid-as-possible: each unknown's edges turn by one rotation.
fn arap() -> (LeastSquares<2>, Vec<(usize, usize, Term)>) {
    let mut e = LeastSquares::<2>::new(N);
    let mut directed = vec![];
    for (i, j) in edges() {
        for (i, j) in [(i, j), (j, i)] {
            let term = e.add(1.0, e.var(i) - e.var(j) - (rest(i) - rest(j)));
            directed.push((i, j, term));
        }
    }
    (e, directed)
}

fn fit_rotations(
    directed: &[(usize, usize, Term)],
) -> impl FnMut(&[Value<2>], &mut plumbline::num::energy::Targets<2>) + '_ {
    move |x, targets| {
        let mut covariance = vec![Matrix2::zeros(); N];
        for &(i, j, _) in directed {
            covariance[i] += (x[i] - x[j]) * (rest(i) - rest(j)).transpose();
        }
        for &(i, j, term) in directed {
            targets[term] = rotation(covariance[i]) * (rest(i) - rest(j));
        }
    }
}

#[test]
fn alternation_never_raises_the_energy_and_finds_a_rigid_motion() {
    let (e, directed) = arap();
    let ends = FixedSet::new([0, COLS - 1]);
    let mut factored = e.factor(&ends, &Run::default()).expect("regular");
    let turn = rotation(Matrix2::new(0.6, -0.8, 0.8, 0.6));
    let mut x: Vec<Vec2> = (0..N).map(rest).collect();
    let criterion = Convergence { max_iterations: 5000, tolerance: 1e-9 };
    let report = LocalGlobal::new(&mut factored)
        .minimize(&ends.values(|i| turn * rest(i)), &mut x, &criterion, fit_rotations(&directed), &Run::default())
        .expect("regular");
    assert!(report.converged && report.iterations + 1 == report.energies.len(), "{report:?}");
    for pair in report.energies.windows(2) {
        assert!(pair[1] <= pair[0] * (1.0 + 1e-12) + 1e-24, "{pair:?}");
    }
    let worst = (0..N).map(|i| (x[i] - turn * rest(i)).norm()).fold(0.0, f64::max);
    assert!(worst < 1e-4, "{worst}, {} rounds", report.iterations);
}

#[test]
fn running_out_of_iterations_is_reported() {
    let (e, directed) = arap();
    let ends = FixedSet::new([0, COLS - 1]);
    let mut factored = e.factor(&ends, &Run::default()).expect("regular");
    let mut x: Vec<Vec2> = (0..N).map(rest).collect();
    let values = ends.values(|i| 1.5 * bent(i));
    let mut driver = LocalGlobal::new(&mut factored);
    let two = Convergence { max_iterations: 2, tolerance: 0.0 };
    let report = driver.minimize(&values, &mut x, &two, fit_rotations(&directed), &Run::default()).expect("regular");
    assert!(!report.converged && report.iterations == 2, "{report:?}");
    for bad in [Convergence { max_iterations: 0, ..two }, Convergence { tolerance: f64::NAN, ..two }] {
        let refused = driver.minimize(&values, &mut x, &bad, fit_rotations(&directed), &Run::default());
        assert!(matches!(refused, Err(EnergyError::Option { .. })));
    }
}

const LOSSES: [Loss; 3] = [Loss::Huber(0.2), Loss::Cauchy(0.2), Loss::GemanMcClure(0.2)];

#[test]
fn a_loss_is_the_square_of_small_residuals_and_its_weight_the_derivative() {
    for loss in LOSSES {
        assert!((loss.value(1e-10) / 1e-10 - 1.0).abs() < 1e-8 && (loss.weight(0.0) - 1.0).abs() < 1e-15, "{loss:?}");
        for s in [1e-3, 0.03, 0.05, 0.2, 7.0] {
            let h = 1e-6 * s;
            let numeric = (loss.value(s + h) - loss.value(s - h)) / (2.0 * h);
            assert!((loss.weight(s) - numeric).abs() < 1e-8, "{loss:?} at {s}: {} and {numeric}", loss.weight(s));
            assert!(loss.value(s) <= s * (1.0 + 1e-12));
        }
    }
}

#[test]
fn robust_terms_ignore_outliers_and_never_raise_their_energy() {
    // A smooth chain observed at every link; a few observations are wild.
    let n = 40;
    let truth = |i: usize| Vec2::new(0.1 * i as f64, (i as f64 / 9.0).sin());
    let wild = |i: usize| i % 9 == 4;
    let mut e = LeastSquares::<2>::new(n);
    let observed: Vec<Term> = (0..n)
        .map(|i| truth(i) + if wild(i) { Vec2::new(5.0, -7.0) } else { Vec2::zeros() })
        .enumerate()
        .map(|(i, b)| e.add(1.0, e.var(i) - b))
        .collect();
    for i in 1..n - 1 {
        let bend = truth(i - 1) - truth(i) * 2.0 + truth(i + 1);
        e.add(1.0, e.var(i - 1) - 2.0 * e.var(i) + e.var(i + 1) - bend);
    }
    let none = FixedSet::none();
    let values = none.values(|_| Vec2::zeros());
    let mut factored = e.factor(&none, &Run::default()).expect("regular");
    let targets = factored.targets();
    let worst = |x: &[Vec2]| (0..n).map(|i| (x[i] - truth(i)).norm()).fold(0.0, f64::max);
    let quadratic = factored.solve(&targets, &values).expect("regular");
    assert!(worst(&quadratic) > 1.0, "least squares follows outliers: {}", worst(&quadratic));
    let mut start = quadratic.clone();
    for (loss, bound) in LOSSES.into_iter().zip([0.2, 0.03, 0.01]) {
        let convergence = Convergence { max_iterations: 300, tolerance: 1e-10 };
        let driver = Reweighted { loss, terms: &observed, convergence };
        let mut x = start.clone();
        let report = driver.minimize(&mut factored, &targets, &values, &mut x, &Run::default()).expect("regular");
        assert!(worst(&x) < bound, "{loss:?} is off by {}", worst(&x));
        for pair in report.energies.windows(2) {
            assert!(pair[1] <= pair[0] * (1.0 + 1e-12), "{loss:?}: {pair:?}");
        }
        let again = factored.solve(&targets, &values).expect("regular");
        assert!(again.iter().zip(&quadratic).all(|(a, q)| (a - q).norm() < 1e-12), "first weights are back");
        start = x; // Geman–McClure is not convex: it starts where Cauchy ended
    }
    let bad = Reweighted { loss: Loss::Huber(-1.0), terms: &observed, convergence: Convergence::default() };
    let refused = bad.minimize(&mut factored, &targets, &values, &mut start, &Run::default()).expect_err("refused");
    assert_eq!(refused.to_string(), "loss scale -1 is invalid (expected above 0, finite)");
}

#[test]
fn both_coordinates_of_a_plane_term_have_one_robust_weight() {
    let mut e = LeastSquares::<1>::new(2);
    let terms: Vec<Term> =
        [(0.0, 0.0), (0.0, 0.1), (3.0, 4.0)].map(|(x, y)| e.add2(1.0, e.point(0) - Vec2::new(x, y))).to_vec();
    let mut factored = e.factor(&FixedSet::none(), &Run::default()).expect("regular");
    let targets = factored.targets();
    let values = FixedSet::none().values(|_| Vector1::zeros());
    let mut x = vec![Vector1::zeros(); 2];
    let driver = Reweighted { loss: Loss::Cauchy(0.5), terms: &terms, convergence: Convergence::default() };
    let report = driver.minimize(&mut factored, &targets, &values, &mut x, &Run::default()).expect("regular");
    let robust: f64 = [(0.0, 0.0), (0.0, 0.1), (3.0, 4.0)]
        .iter()
        .map(|(px, py)| Loss::Cauchy(0.5).value((x[0].x - px).powi(2) + (x[1].x - py).powi(2)))
        .sum();
    assert!((report.energies.last().expect("some") - robust).abs() < 1e-12);
    let step = DVector::from_vec(vec![x[0].x, x[1].x]).norm();
    assert!(step < 0.3, "the far point hardly pulls: {step}");
}
