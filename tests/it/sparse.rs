//! Laws of the sparse solver, with dense algebra as oracle.

use std::sync::Arc;

use nalgebra::{Complex as C, DMatrix, DVector};
use plumbline::num::run::Run;
use plumbline::num::sparse::{Cholesky, Complex, Ordering, Pattern, Permutation, SparseError, SparseMatrix};

use crate::allocations::allocations_of;

/// Random Hermitian, positive definite matrix on a grid graph with some long edges, and the same densely.
fn random_hermitian(cols: usize, rows: usize, seed: u64) -> (SparseMatrix<Complex>, DMatrix<C<f64>>) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let n = cols * rows;
    let mut triplets = vec![];
    let mut dense = DMatrix::<C<f64>>::zeros(n, n);
    let mut couple = |i: usize, j: usize, triplets: &mut Vec<(usize, usize, Complex)>| {
        let (re, im) = (rng.f64() - 0.5, rng.f64() - 0.5);
        triplets.push((i, j, Complex::new(re, im)));
        dense[(i, j)] += C::new(re, im);
        dense[(j, i)] += C::new(re, -im);
    };
    for i in 0..n {
        let (x, y) = (i % cols, i / cols);
        if x + 1 < cols {
            couple(i, i + 1, &mut triplets);
        }
        if y + 1 < rows {
            couple(i, i + cols, &mut triplets); // given in the upper triangle
        }
        let far = (i * 31 + 5) % n;
        if i % 7 == 3 && far != i {
            couple(far, i, &mut triplets);
        }
    }
    for i in 0..n {
        let d = 6.0 + i as f64 / n as f64;
        triplets.push((i, i, Complex::new(d, 0.0)));
        dense[(i, i)] = C::new(d, 0.0);
    }
    (SparseMatrix::from_triplets(n, &triplets).expect("indices in range"), dense)
}

fn orderings(cols: usize, rows: usize) -> Vec<Ordering> {
    let n = cols * rows;
    let positions = (0..n).map(|i| [(i % cols) as f64, (i / cols) as f64, 0.0]).collect();
    let backwards = Permutation::new((0..n as u32).rev().collect()).expect("a permutation");
    vec![
        Ordering::Natural,
        Ordering::Amd,
        Ordering::NestedDissection(positions),
        Ordering::NestedDissection(vec![[0.0; 3]; n]),
        Ordering::Given(backwards),
    ]
}

#[test]
fn every_ordering_gives_the_dense_solution() {
    for (cols, rows) in [(1, 1), (5, 1), (7, 6), (13, 11)] {
        let (a, dense) = random_hermitian(cols, rows, 3);
        let n = cols * rows;
        let b: Vec<Complex> = (0..2 * n).map(|i| Complex::new((i as f64).sin(), (i as f64).cos())).collect();
        for ordering in orderings(cols, rows) {
            let mut cholesky = Cholesky::analyze(a.pattern(), &ordering).expect("sizes agree");
            cholesky.factor(&a, &Run::default()).expect("positive definite");
            let mut x = b.clone();
            cholesky.solve_in_place(&mut x);
            for (x, b) in x.chunks(n).zip(b.chunks(n)) {
                let b = DVector::from_iterator(n, b.iter().map(|z| C::new(z.re, z.im)));
                let expected = dense.clone().lu().solve(&b).expect("regular");
                let err =
                    x.iter().zip(expected.iter()).map(|(z, e)| (z.re - e.re).hypot(z.im - e.im)).fold(0.0, f64::max);
                assert!(err < 1e-13, "{cols}×{rows}, {ordering:?}: {err}");
            }
            // Half of a solve, of columns with one entry each: products of two are entries of the inverse.
            let inverse = dense.clone().try_inverse().expect("regular");
            let chosen = [0, n / 2, n - 1];
            let mut halves = vec![Complex::new(0.0, 0.0); 3 * n];
            chosen.iter().zip(halves.chunks_mut(n)).for_each(|(&i, y)| y[i] = Complex::new(1.0, 0.0));
            cholesky.half_solve_in_place(&mut halves);
            for (&i, y) in chosen.iter().zip(halves.chunks(n)) {
                for (&j, z) in chosen.iter().zip(halves.chunks(n)) {
                    let product: C<f64> = y.iter().zip(z).map(|(y, z)| C::new(y.re, -y.im) * C::new(z.re, z.im)).sum();
                    assert!((product - inverse[(i, j)]).norm() < 1e-13, "{cols}×{rows}, {ordering:?}: {i}, {j}");
                }
            }
        }
    }
}

#[test]
fn a_cut_between_layers_is_not_taken_where_one_across_them_touches_less() {
    // Two rings far apart, joined by rungs: their longest extent is along the rungs, and a cut there touches a whole ring.
    let n = 2000;
    let around = |k: usize| (k + 1) % n;
    let edges = (0..n).flat_map(|k| [(k, around(k)), (n + k, n + around(k)), (n + k, k), (n + k, around(k))]);
    let pattern = Arc::new(Pattern::new(2 * n, edges).expect("in range"));
    let turn = |k: usize| std::f64::consts::TAU * k as f64 / n as f64;
    let position = |i: usize| [turn(i % n).cos(), turn(i % n).sin(), (i / n) as f64 * 10.0];
    let ordering = Ordering::NestedDissection((0..2 * n).map(position).collect());
    // One cut through a ring is a dense front of 2000 unknowns, 2.7e9 multiplications.
    let flops = Cholesky::<f64>::analyze(&pattern, &ordering).expect("sizes agree").flops();
    assert!(flops < 100.0 * (2.0 * n as f64).powf(1.5), "{flops} multiplications");
}

/// Laplacian of a grid with diagonals plus `shift` on the diagonal.
fn laplacian(cols: usize, rows: usize, shift: f64) -> SparseMatrix<f64> {
    let mut triplets = vec![];
    for i in 0..cols * rows {
        triplets.push((i, i, shift));
        let mut edge = |j: usize| triplets.extend([(i, i, 1.0), (j, j, 1.0), (j, i, -1.0)]);
        if i % cols + 1 < cols {
            edge(i + 1);
        }
        if i / cols + 1 < rows {
            edge(i + cols);
        }
        if i % cols + 1 < cols && i / cols + 1 < rows {
            edge(i + cols + 1);
        }
        if i % cols > 0 && i / cols + 1 < rows {
            edge(i + cols - 1);
        }
    }
    SparseMatrix::from_triplets(cols * rows, &triplets).expect("in range")
}

#[test]
fn nested_dissection_fills_less_than_the_natural_order() {
    let a = laplacian(60, 60, 1.0);
    let stored = |o: &Ordering| Cholesky::<f64>::analyze(a.pattern(), o).expect("sizes agree").stored();
    let all: Vec<usize> = orderings(60, 60).iter().map(stored).collect();
    assert!(3 * all[2] < 2 * all[0], "natural {}, dissection {}", all[0], all[2]);
    assert!((all[2] as f64) < 1.2 * all[1] as f64, "minimum degree {}, dissection {}", all[1], all[2]);
}

#[test]
fn refactoring_and_solving_allocate_nothing() {
    let (a, b) = (laplacian(20, 20, 1.0), laplacian(20, 20, 0.3));
    let mut cholesky = Cholesky::analyze(a.pattern(), &Ordering::Amd).expect("valid");
    let mut x = vec![1.0; 3 * 400];
    // Once before: the kernels keep a packing buffer per thread.
    cholesky.factor(&b, &Run::default()).expect("regular");
    cholesky.solve_in_place(&mut x.clone());
    let count = allocations_of(|| {
        cholesky.factor(&a, &Run::default()).expect("regular");
        cholesky.factor(&b, &Run::default()).expect("regular");
        cholesky.solve_in_place(&mut x);
    });
    assert_eq!(count, 0);
    assert!(x.iter().all(|v| (v - 1.0 / 0.3).abs() < 1e-11), "constants solve (L + 0.3) x = 1");
}

#[test]
fn a_singular_system_names_its_component() {
    // Two grids side by side in one system; only the first is held.
    let first = laplacian(4, 3, 0.5);
    let second = laplacian(3, 3, 0.0);
    let mut triplets: Vec<(usize, usize, f64)> =
        first.pattern().entries().map(|(i, j, s)| (i, j, first.values()[s])).collect();
    triplets.extend(second.pattern().entries().map(|(i, j, s)| (i + 12, j + 12, second.values()[s])));
    for scale in [1e-12, 1.0, 1e12] {
        let scaled: Vec<_> = triplets.iter().map(|&(i, j, v)| (i, j, v * if i < 12 { scale } else { 1.0 })).collect();
        let a = SparseMatrix::from_triplets(21, &scaled).expect("in range");
        let mut cholesky = Cholesky::analyze(a.pattern(), &Ordering::Amd).expect("valid");
        let error = cholesky.factor(&a, &Run::default()).expect_err("the second grid floats");
        let SparseError::Singular { component } = &error else { panic!("{error}") };
        assert_eq!(component.unknowns, (12..21).collect::<Vec<_>>());
        assert_eq!(
            error.to_string(),
            "the system is singular: the component of 9 unknown(s) that contains unknown 12 has no constraint; \
             fix one of its unknowns or give it a weight"
        );
        let mut x = vec![1.0; 21];
        cholesky.solve_in_place(&mut x);
        assert!(x.iter().all(|v| v.is_nan()), "no solution may be mistaken for one");
    }
}

#[test]
fn weak_but_regular_systems_are_accepted() {
    // A light weight somewhere and heavy ones elsewhere do not make a system singular.
    let mut a = laplacian(10, 10, 0.0);
    let pattern = Arc::clone(a.pattern());
    for i in 0..100 {
        let s = pattern.slot(i, i).expect("diagonal");
        a.values_mut()[s] += if i == 37 { 1e-6 } else { 0.0 };
    }
    let mut cholesky = Cholesky::analyze(&pattern, &Ordering::Amd).expect("valid");
    cholesky.factor(&a, &Run::default()).expect("held by unknown 37");
    let mut x = vec![0.0; 100];
    x[37] = 1e-6;
    cholesky.solve_in_place(&mut x);
    assert!(x.iter().all(|v| (v - 1.0).abs() < 1e-6), "{x:?}");
}

#[test]
fn negative_matrices_and_nan_are_distinguished() {
    let refuse = |triplets: &[(usize, usize, f64)]| {
        let a = SparseMatrix::from_triplets(3, triplets).expect("in range");
        let mut cholesky = Cholesky::analyze(a.pattern(), &Ordering::Natural).expect("valid");
        cholesky.factor(&a, &Run::default()).expect_err("refused")
    };
    let indefinite = refuse(&[(0, 0, 1.0), (1, 1, 1.0), (1, 0, 2.0), (2, 2, 1.0)]);
    assert!(matches!(&indefinite, SparseError::NotPositiveDefinite { component } if component.unknowns == [0, 1]));
    let negative = refuse(&[(0, 0, 1.0), (1, 1, -1.0), (2, 2, 1.0)]);
    assert!(matches!(negative, SparseError::NotPositiveDefinite { .. }));
    let untouched = refuse(&[(0, 0, 1.0), (2, 2, 1.0)]);
    assert!(matches!(&untouched, SparseError::Singular { component } if component.unknowns == [1]), "{untouched}");
    let nan = refuse(&[(0, 0, 1.0), (1, 1, 1.0), (2, 1, f64::NAN), (2, 2, 1.0)]);
    assert_eq!(nan.to_string(), "entry (2, 1) of the matrix is not finite");
    let beyond = Pattern::new(3, [(0, 3)]).expect_err("out of range");
    assert_eq!(beyond.to_string(), "unknown 3 does not exist (the system has 3, numbered from 0)");
    let short = Cholesky::<f64>::analyze(laplacian(2, 2, 1.0).pattern(), &Ordering::NestedDissection(vec![]));
    assert!(matches!(short, Err(SparseError::OutOfRange { .. })));
}

#[test]
fn refinement_regains_the_digits_of_a_bad_start() {
    let a = laplacian(15, 15, 1e-7);
    let mut cholesky = Cholesky::analyze(a.pattern(), &Ordering::Amd).expect("valid");
    cholesky.factor(&a, &Run::default()).expect("regular");
    let b: Vec<f64> = (0..225).map(|i| (i as f64).sin()).collect();
    let (mut x, mut scratch) = (vec![1e3; 225], vec![0.0; 225]);
    let before = cholesky.refine(&a, &b, &mut x, &mut scratch);
    let after = cholesky.refine(&a, &b, &mut x, &mut scratch);
    assert!(after < 1e-8 * before, "{before} then {after}");
}

#[test]
fn only_permutations_are_permutations() {
    assert!(Permutation::new(vec![2, 0, 1]).is_some());
    for bad in [vec![0, 0, 1], vec![0, 1, 3]] {
        assert!(Permutation::new(bad).is_none());
    }
}
