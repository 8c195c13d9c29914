//! Laws of the energy core, with dense algebra as oracle.

use nalgebra::{DMatrix, DVector, Matrix2};
use plumbline::num::energy::{
    Complex, ConstrainedLaplacian, Convergence, EnergyError, FIXED, FactoredLaplacian, Loss, Ordering, QuadraticEnergy,
};
use plumbline::num::math::Vec2;
use plumbline::num::run::Run;
use plumbline::num::sparse::SparseError;

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

const CORNERS: [usize; 3] = [0, COLS - 1, N - 1];

fn weighted() -> impl Iterator<Item = (usize, usize, f64)> + Clone {
    edges().into_iter().enumerate().map(|(k, (i, j))| (i, j, edge_weight(k)))
}

/// `Σ w ‖(xᵢ − xⱼ) − (restᵢ − restⱼ)‖²` with fixed corners.
fn springs(ordering: &Ordering) -> FactoredLaplacian {
    let laplacian = ConstrainedLaplacian::new(N, weighted(), |i| CORNERS.contains(&i)).expect("in range");
    laplacian.factor(ordering, &Run::default()).expect("constrained at the corners")
}

/// The minimizer for edges of these vectors and fixed values.
fn solve(
    solver: &mut FactoredLaplacian,
    edge: impl Fn(usize, usize) -> Vec2,
    value: impl Fn(usize) -> Vec2,
) -> Vec<Vec2> {
    let mut sums = vec![Vec2::zeros(); N];
    for (i, j, w) in weighted() {
        sums[i] += w * edge(i, j);
        sums[j] -= w * edge(i, j);
    }
    for &(unknown, vertex, w) in solver.coupling() {
        sums[solver.free()[unknown as usize] as usize] += w * value(vertex as usize);
    }
    let mut b: Vec<[f64; 2]> = solver.free().iter().map(|&i| sums[i as usize].into()).collect();
    solver.solve(&mut b);
    let unknowns = solver.unknowns().iter().enumerate();
    unknowns.map(|(i, &k)| if k == FIXED { value(i) } else { b[k as usize].into() }).collect()
}

fn at_rest(i: usize, j: usize) -> Vec2 {
    rest(i) - rest(j)
}

fn energy(x: &[Vec2], edge: impl Fn(usize, usize) -> Vec2) -> f64 {
    weighted().map(|(i, j, w)| w * (x[i] - x[j] - edge(i, j)).norm_squared()).sum()
}

fn bent(i: usize) -> Vec2 {
    rest(i) + Vec2::new((i as f64).sin(), 0.3 * i as f64)
}

fn close(x: &[Vec2], y: &[Vec2]) -> bool {
    x.iter().zip(y).all(|(x, y)| (x - y).norm() < 1e-12 * N as f64)
}

#[test]
fn the_minimizer_is_the_dense_one() {
    let x = solve(&mut springs(&Ordering::Amd), at_rest, bent);
    let free: Vec<usize> = (0..N).filter(|i| !CORNERS.contains(i)).collect();
    let (mut a, mut b) = (DMatrix::<f64>::zeros(edges().len(), N), DMatrix::<f64>::zeros(edges().len(), 2));
    for (k, (i, j)) in edges().into_iter().enumerate() {
        let w = edge_weight(k).sqrt();
        (a[(k, i)], a[(k, j)]) = (w, -w);
        b.set_row(k, &((rest(i) - rest(j)) * w).transpose());
    }
    for i in CORNERS {
        let column = a.column(i) * bent(i).transpose();
        b -= column;
    }
    let a = DMatrix::from_columns(&free.iter().map(|&i| a.column(i)).collect::<Vec<_>>());
    let expected = a.svd(true, true).solve(&b, 1e-12).expect("full rank");
    for (k, &i) in free.iter().enumerate() {
        let err = (x[i].transpose() - expected.row(k)).norm();
        assert!(err < 1e-12 * N as f64, "unknown {i}: {err}");
    }
    for &i in &CORNERS {
        assert_eq!(x[i], bent(i), "fixed values are kept exactly");
    }
}

#[test]
fn at_the_minimum_every_step_costs() {
    let x = solve(&mut springs(&Ordering::Amd), at_rest, bent);
    let least = energy(&x, at_rest);
    for i in (0..N).filter(|i| !CORNERS.contains(i)) {
        for step in [Vec2::new(0.1, 0.0), Vec2::new(-0.1, 0.0), Vec2::new(0.0, 0.1), Vec2::new(0.0, -0.1)] {
            let mut y = x.clone();
            y[i] += step;
            assert!(energy(&y, at_rest) > least + 1e-3, "unknown {i}");
        }
    }
}

#[test]
fn translation_of_the_given_values_translates_the_rest() {
    let mut solver = springs(&Ordering::Amd);
    let x = solve(&mut solver, at_rest, bent);
    let shift = Vec2::new(3.0, -8.0);
    let y = solve(&mut solver, at_rest, |i| bent(i) + shift);
    let worst = x.iter().zip(&y).map(|(x, y)| (y - x - shift).norm()).fold(0.0, f64::max);
    assert!(worst < 1e-12 * N as f64, "{worst}");
    assert!(energy(&solve(&mut solver, at_rest, rest), at_rest) < 1e-24, "the rest shape costs nothing");
}

/// A soft constraint of growing weight approaches the hard one, and is the term `μ |x − t|²` on the way.
#[test]
fn a_soft_constraint_pulls_by_its_weight() {
    let hard = solve(&mut springs(&Ordering::Amd), |_, _| Vec2::zeros(), bent);
    let mut last = f64::INFINITY;
    for weight in [1.0, 1e3, 1e6, 1e9] {
        let soft = CORNERS.into_iter().map(|i| (i, i, weight));
        let laplacian = ConstrainedLaplacian::new(N, weighted().chain(soft), |_| false).expect("in range");
        let mut solver = laplacian.factor(&Ordering::Amd, &Run::default()).expect("constrained");
        let mut x: Vec<[f64; 2]> = vec![[0.0; 2]; N];
        for &i in &CORNERS {
            x[i] = (weight * bent(i)).into();
        }
        solver.solve(&mut x);
        let x: Vec<Vec2> = x.into_iter().map(Vec2::from).collect();
        let cost = |x: &[Vec2]| {
            let pull = CORNERS.iter().map(|&i| weight * (x[i] - bent(i)).norm_squared());
            energy(x, |_, _| Vec2::zeros()) + pull.sum::<f64>()
        };
        for i in 0..N {
            let mut y = x.clone();
            y[i] += Vec2::new(0.01, -0.01);
            assert!(cost(&y) > cost(&x), "weight {weight}, vertex {i}");
        }
        let apart = x.iter().zip(&hard).map(|(x, y)| (x - y).norm()).fold(0.0, f64::max);
        assert!(apart < 0.5 * last, "weight {weight}: {apart}");
        last = apart;
    }
    assert!(last < 1e-6, "{last}");
}

/// Rows over few of `2 N` scalar unknowns that mix x with y: unknowns, coefficients, weight, right-hand side.
fn mixed_rows() -> Vec<(Vec<usize>, Vec<f64>, f64, f64)> {
    let mut rows = vec![];
    for (k, (i, j)) in edges().into_iter().enumerate() {
        let (u, v, w) = (0.3, 0.8, edge_weight(k));
        let next = (j + 3) % N;
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
    rows
}

#[test]
fn a_quadratic_energy_has_the_dense_minimizer_and_allocates_nothing() {
    let rows = mixed_rows();
    let (mut a, mut b) = (DMatrix::<f64>::identity(2 * N, 2 * N) * 0.01, DVector::repeat(2 * N, 0.005));
    for (used, coefficients, w, target) in &rows {
        for (&i, p) in used.iter().zip(coefficients) {
            b[i] += w * p * target;
            used.iter().zip(coefficients).for_each(|(&j, q)| a[(i, j)] += w * p * q);
        }
    }
    let x = a.cholesky().expect("positive definite").solve(&b);
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
    let worst = x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-10 && y.iter().any(|y| (y - 0.5).abs() > 1.0), "{worst}");
    let count = allocations_of(|| {
        fill(&mut fast);
        fast.minimize(&Run::default()).expect("regular");
    });
    assert_eq!(count, 0, "refilling, factoring and solving allocate nothing");
}

#[test]
fn solves_of_a_factored_laplacian_allocate_nothing_after_the_first() {
    let mut solver = springs(&Ordering::Amd);
    let mut b = vec![[1.0, 2.0]; solver.free().len()];
    solver.solve(&mut b);
    assert_eq!(allocations_of(|| solver.solve(&mut b)), 0);
    let mut one = vec![1.0; b.len()];
    solver.solve_scalar(&mut one);
    assert_eq!(allocations_of(|| solver.solve_scalar(&mut one)), 0);
}

#[test]
fn refilling_with_other_weights_equals_a_new_energy() {
    let elements: Vec<[usize; 2]> = edges().into_iter().map(|(i, j)| [i.min(j), i.max(j)]).collect();
    let new = || QuadraticEnergy::<f64>::new(N, elements.iter().map(|e| &e[..]), &Ordering::Amd).expect("in range");
    let fill = |energy: &mut QuadraticEnergy<f64>, factor: f64, without: Option<usize>| {
        energy.clear();
        for k in (0..elements.len()).filter(|k| Some(*k) != without) {
            energy.add(k, factor * edge_weight(k), &[1.0, -1.0], k as f64);
        }
        energy.add_everywhere(0.1, 0.0);
    };
    let mut used = new();
    fill(&mut used, 1.0, None);
    used.minimize(&Run::default()).expect("regular");
    fill(&mut used, 3.0, Some(4));
    let mut fresh = new();
    fill(&mut fresh, 3.0, Some(4));
    let x = used.minimize(&Run::default()).expect("regular").to_vec();
    assert_eq!(x, fresh.minimize(&Run::default()).expect("regular"));
}

#[test]
fn positions_of_the_vertices_give_another_order_and_the_same_solution() {
    let positions: Vec<[f64; 3]> = (0..N).map(rest).map(|p| [p.x, p.y, 0.0]).collect();
    let x = solve(&mut springs(&Ordering::Amd), at_rest, bent);
    assert!(close(&x, &solve(&mut springs(&Ordering::NestedDissection(positions)), at_rest, bent)));
}

#[test]
fn a_complex_unknown_is_a_point_of_the_plane() {
    // Each edge is wanted as its rotated and scaled rest edge: one complex row, or two real ones.
    let elements: Vec<[usize; 2]> = edges().into_iter().map(|(i, j)| [i.min(j), i.max(j)]).collect();
    let both: Vec<[usize; 4]> = elements.iter().map(|[i, j]| [2 * i, 2 * i + 1, 2 * j, 2 * j + 1]).collect();
    let mut complex =
        QuadraticEnergy::<Complex>::new(N, elements.iter().map(|e| &e[..]), &Ordering::Amd).expect("in range");
    let mut real = QuadraticEnergy::<f64>::new(2 * N, both.iter().map(|e| &e[..]), &Ordering::Amd).expect("in range");
    for k in 0..elements.len() {
        let (a, b, w) = (Complex::new(0.6, 0.8), bent(k % N), edge_weight(k));
        complex.add(k, w, &[a, Complex::new(-1.0, 0.0)], Complex::new(b.x, b.y));
        real.add(k, w, &[a.re, -a.im, -1.0, 0.0], b.x);
        real.add(k, w, &[a.im, a.re, 0.0, -1.0], b.y);
    }
    complex.add_everywhere(0.01, Complex::new(0.5, 0.5));
    real.add_everywhere(0.01, 0.5);
    let x = complex.minimize(&Run::default()).expect("regular").to_vec();
    let y = real.minimize(&Run::default()).expect("regular");
    let worst = x.iter().zip(y.as_chunks().0).map(|(x, [re, im])| (x.re - re).hypot(x.im - im)).fold(0.0, f64::max);
    assert!(worst < 1e-10, "{worst}");
}

#[test]
fn bad_energies_are_refused_with_their_reason() {
    let factor = |laplacian: ConstrainedLaplacian, ordering: &Ordering| {
        laplacian.factor(ordering, &Run::default()).map(|_| ()).expect_err("refused")
    };
    let free = |terms: &[(usize, usize, f64)]| {
        ConstrainedLaplacian::new(N, weighted().chain(terms.iter().copied()), |_| false).expect("in range")
    };
    let SparseError::Singular { component } = factor(free(&[]), &Ordering::Amd) else { panic!("nothing is fixed") };
    assert_eq!(component.unknowns, (0..N).collect::<Vec<_>>());
    let two = weighted().chain([(N, N + 1, 1.0), (N + 1, N + 2, 1.0)]);
    let two = ConstrainedLaplacian::new(N + 3, two, |i| CORNERS.contains(&i)).expect("in range");
    let SparseError::Singular { component } = factor(two, &Ordering::Amd) else { panic!("three vertices are free") };
    assert_eq!(component.unknowns, [N, N + 1, N + 2]);
    assert!(matches!(factor(free(&[(1, 1, -200.0)]), &Ordering::Amd), SparseError::NotPositiveDefinite { .. }));
    assert!(matches!(factor(free(&[(1, 1, f64::NAN)]), &Ordering::Amd), SparseError::NotFinite { .. }));
    let beyond = ConstrainedLaplacian::new(N, [(0, N, 1.0)].into_iter(), |_| false).expect_err("beyond");
    assert_eq!(beyond, SparseError::OutOfRange { index: N, unknowns: N });
    let short = factor(free(&[(0, 0, 1.0)]), &Ordering::NestedDissection(vec![[0.0; 3]; 3]));
    assert_eq!(short, SparseError::OutOfRange { index: 3, unknowns: N });
    let mut energy = QuadraticEnergy::<f64>::new(2, [&[0, 1][..]].into_iter(), &Ordering::Amd).expect("in range");
    energy.add(0, 1.0, &[1.0, -1.0], 0.0);
    assert!(matches!(energy.minimize(&Run::default()), Err(EnergyError::Solve(SparseError::Singular { .. }))));
    energy.add(0, 1.0, &[f64::NAN, 0.0], 0.0);
    assert!(matches!(energy.minimize(&Run::default()), Err(EnergyError::Solve(SparseError::NotFinite { .. }))));
}

/// Rotation nearest to a 2×2 matrix.
fn rotation(m: Matrix2<f64>) -> Matrix2<f64> {
    let angle = (m[(1, 0)] - m[(0, 1)]).atan2(m[(0, 0)] + m[(1, 1)]);
    Matrix2::new(angle.cos(), -angle.sin(), angle.sin(), angle.cos())
}

/// As rigid as possible: the edges of each vertex rotate by the rotation that fits them best.
fn rotations(x: &[Vec2]) -> Vec<Matrix2<f64>> {
    let mut covariance = vec![Matrix2::zeros(); N];
    for (i, j, w) in weighted() {
        let moment = w * (x[i] - x[j]) * at_rest(i, j).transpose();
        covariance[i] += moment;
        covariance[j] += moment;
    }
    covariance.into_iter().map(rotation).collect()
}

/// `Σ w |(xᵢ − xⱼ) − Rᵥ (restᵢ − restⱼ)|²` over edges and both of their ends `v`.
fn rigidity(x: &[Vec2], rotations: &[Matrix2<f64>]) -> f64 {
    let of = |v: usize| energy(x, |i, j| rotations[if v == 0 { i } else { j }] * at_rest(i, j));
    of(0) + of(1)
}

#[test]
fn alternation_never_raises_the_energy_and_finds_a_rigid_motion() {
    let mut solver = springs(&Ordering::Amd);
    let motion = rotation(Matrix2::new(0.6, -0.8, 0.8, 0.6));
    let mut x: Vec<Vec2> = (0..N).map(|i| if CORNERS.contains(&i) { motion * rest(i) } else { rest(i) }).collect();
    let criterion = Convergence { max_iterations: 5000, tolerance: 1e-9 };
    let mut fitted = rotations(&x);
    let mut energies = vec![rigidity(&x, &fitted)];
    while energies.len() <= criterion.max_iterations && !criterion.reached(&energies) {
        // The minimizer for the mean of both ends' rotations is that of the energy.
        let edge = |i: usize, j: usize| 0.5 * (fitted[i] + fitted[j]) * at_rest(i, j);
        x = solve(&mut solver, edge, |i| motion * rest(i));
        fitted = rotations(&x);
        energies.push(rigidity(&x, &fitted));
    }
    for pair in energies.windows(2) {
        assert!(pair[1] <= pair[0] * (1.0 + 1e-12) + 1e-24, "{pair:?}");
    }
    let worst = (0..N).map(|i| (x[i] - motion * rest(i)).norm()).fold(0.0, f64::max);
    assert!(worst < 1e-4, "{worst}, {} iterations", energies.len() - 1);
}

#[test]
fn a_criterion_is_checked_and_compares_the_last_two_energies() {
    let two = Convergence { max_iterations: 2, tolerance: 0.0 };
    assert!(two.check().is_ok());
    for bad in [Convergence { max_iterations: 0, ..two }, Convergence { tolerance: f64::NAN, ..two }] {
        assert!(matches!(bad.check(), Err(EnergyError::Option { .. })));
    }
    let tenth = Convergence { tolerance: 0.1, ..two };
    assert!(!tenth.reached(&[5.0]) && !tenth.reached(&[5.0, 1.0]) && tenth.reached(&[5.0, 1.0, 0.95]));
    assert!(two.reached(&[1.0, 1.0]) && two.reached(&[1.0, f64::NAN]));
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

/// Minimizes `Σ ρ(|xᵢ − bᵢ|²) + Σ |xᵢ₋₁ − 2xᵢ + xᵢ₊₁ − kᵢ|²` of a chain by reweighting; the energy after each iteration.
fn reweighted(loss: Option<Loss>, observed: &[Vec2], bend: impl Fn(usize) -> Vec2, x: &mut [Vec2]) -> Vec<f64> {
    let n = observed.len();
    let elements: Vec<Vec<usize>> = (0..n).map(|i| vec![i]).chain((1..n - 1).map(|i| vec![i - 1, i, i + 1])).collect();
    let mut chain =
        QuadraticEnergy::<Complex>::new(n, elements.iter().map(|e| &e[..]), &Ordering::Natural).expect("in range");
    let complex = |p: Vec2| Complex::new(p.x, p.y);
    let cost = |x: &[Vec2]| {
        let data = (0..n).map(|i| (x[i] - observed[i]).norm_squared()).map(|s| loss.map_or(s, |l| l.value(s)));
        let smooth = (1..n - 1).map(|i| (x[i - 1] - 2.0 * x[i] + x[i + 1] - bend(i)).norm_squared());
        data.sum::<f64>() + smooth.sum::<f64>()
    };
    let mut energies = vec![cost(x)];
    let criterion = Convergence { max_iterations: 300, tolerance: 1e-10 };
    while energies.len() <= criterion.max_iterations && !criterion.reached(&energies) {
        chain.clear();
        for i in 0..n {
            let weight = loss.map_or(1.0, |l| l.weight((x[i] - observed[i]).norm_squared()));
            chain.add(i, weight, &[Complex::new(1.0, 0.0)], complex(observed[i]));
        }
        for i in 1..n - 1 {
            chain.add(n + i - 1, 1.0, &[1.0, -2.0, 1.0].map(|a| Complex::new(a, 0.0)), complex(bend(i)));
        }
        let solved = chain.minimize(&Run::default()).expect("regular");
        x.iter_mut().zip(solved).for_each(|(x, z)| *x = Vec2::new(z.re, z.im));
        energies.push(cost(x));
    }
    energies
}

#[test]
fn robust_terms_ignore_outliers_and_never_raise_their_energy() {
    // A smooth chain observed at every link; a few observations are wild.
    let n = 40;
    let truth = |i: usize| Vec2::new(0.1 * i as f64, (i as f64 / 9.0).sin());
    let wild = |i: usize| i % 9 == 4;
    let observed: Vec<Vec2> =
        (0..n).map(|i| truth(i) + if wild(i) { Vec2::new(5.0, -7.0) } else { Vec2::zeros() }).collect();
    let bend = |i: usize| truth(i - 1) - truth(i) * 2.0 + truth(i + 1);
    let worst = |x: &[Vec2]| (0..n).map(|i| (x[i] - truth(i)).norm()).fold(0.0, f64::max);
    let mut x = vec![Vec2::zeros(); n];
    reweighted(None, &observed, bend, &mut x);
    assert!(worst(&x) > 1.0, "least squares follows outliers: {}", worst(&x));
    // Geman–McClure is not convex: its initial guess is the solution with Cauchy's loss.
    for (loss, bound) in LOSSES.into_iter().zip([0.2, 0.03, 0.01]) {
        let energies = reweighted(Some(loss), &observed, bend, &mut x);
        assert!(worst(&x) < bound, "{loss:?} is off by {}", worst(&x));
        for pair in energies.windows(2) {
            assert!(pair[1] <= pair[0] * (1.0 + 1e-12), "{loss:?}: {pair:?}");
        }
    }
}

#[test]
fn both_coordinates_of_a_plane_term_have_one_robust_weight() {
    let points = [(0.0, 0.0), (0.0, 0.1), (3.0, 4.0)].map(|(x, y)| Vec2::new(x, y));
    let mut energy = QuadraticEnergy::<Complex>::new(1, [&[0][..]].into_iter().cycle().take(3), &Ordering::Natural)
        .expect("in range");
    let loss = Loss::Cauchy(0.5);
    let mut x = Vec2::new(1.0, 1.0);
    for _ in 0..300 {
        energy.clear();
        for (k, p) in points.iter().enumerate() {
            energy.add(k, loss.weight((x - p).norm_squared()), &[Complex::new(1.0, 0.0)], Complex::new(p.x, p.y));
        }
        let z = energy.minimize(&Run::default()).expect("regular")[0];
        x = Vec2::new(z.re, z.im);
    }
    let cost = |x: Vec2| points.iter().map(|p| loss.value((x - p).norm_squared())).sum::<f64>();
    for step in [Vec2::new(1e-3, 0.0), Vec2::new(-1e-3, 0.0), Vec2::new(0.0, 1e-3), Vec2::new(0.0, -1e-3)] {
        assert!(cost(x + step) > cost(x), "{x:?}");
    }
    assert!(x.norm() < 0.3, "the far point hardly pulls: {x:?}");
}
