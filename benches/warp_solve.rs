//! One frame's content-preserving warp: 64×36 cells, 300 points.
//!
//! The limit is arithmetic. The nested-dissection factor of the 65×37 grid stores 95 thousand complex entries, 39 a column;
//! `Σ cⱼ²` complex multiply-adds are some 6 million, 24 MFLOP, and each solve adds 2 × 95 thousand of them. At the 16 to 32
//! GFLOP/s that one core sustains in double precision this is 0.8 to 1.5 ms. Passing the factor (1.5 MB, in cache) three
//! times costs 0.1 ms, assembly of 2304 cells some 0.1 ms.
//!
//! `real` is the same system with x and y as separate unknowns, for comparison.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use plumbline::image::grid::Grid;
use plumbline::image::warp::{ContentPreserving, ContentPreservingOptions, PointPair};
use plumbline::num::energy::{Complex, Ordering, QuadraticEnergy, Scalar};
use plumbline::num::math::{Homography, Point2, Vec2};
use plumbline::num::run::Run;

const GRID: Grid = Grid { cols: 64, rows: 36, width: 1920.0, height: 1080.0 };

fn points() -> Vec<PointPair> {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut point = || {
        let src = Point2::new(rng.f64() * GRID.width, rng.f64() * GRID.height);
        PointPair { src, dst: src + Vec2::new(6.0 * (src.y / 170.0).sin(), 4.0 * (src.x / 230.0).cos()), weight: 1.0 }
    };
    (0..300).map(|_| point()).collect()
}

fn pre_warp() -> Homography {
    Homography::new(nalgebra::Matrix3::new(1.02, 0.01, 3.0, -0.01, 0.99, -2.0, 1e-6, -2e-6, 1.0))
}

/// A regular system with the pattern of the warp, `per` scalar unknowns a vertex.
fn system<T: Scalar>(per: usize) -> QuadraticEnergy<T> {
    let spread = |v: usize| (0..per).map(move |k| per * v + k);
    let cells: Vec<Vec<usize>> =
        (0..GRID.cell_count()).map(|c| GRID.corners(c).into_iter().flat_map(spread).collect()).collect();
    let n = per * GRID.vertex_count();
    let position = |i: usize| GRID.vertex(i / per);
    let ordering = Ordering::NestedDissection((0..n).map(position).map(|p| [p.x, p.y, 0.0]).collect());
    let mut energy = QuadraticEnergy::new(n, cells.iter().map(|c| &c[..]), &ordering).expect("valid elements");
    energy.add_everywhere(1e-3, T::real(1.0));
    for c in 0..GRID.cell_count() {
        for k in 0..4 * per {
            let coefficients: Vec<T> =
                (0..4 * per).map(|j| T::real(if j == k { 1.0 } else { -1.0 / (4.0 * per as f64 - 1.0) })).collect();
            energy.add(c, 1.0, &coefficients, T::real(0.0));
        }
    }
    energy
}

fn bench(c: &mut Criterion) {
    let (w, h) = (GRID.width, GRID.height);
    let mut warp = ContentPreserving::new(64, 36, w, h, ContentPreservingOptions::default()).expect("valid grid");
    let (points, pre_warp) = (points(), pre_warp());
    let mut mesh = warp.grid().to_mesh();
    let checksum = |mesh: &plumbline::image::grid::GridMesh| mesh.vertices.iter().map(|v| v.x + v.y).sum::<f64>();
    let (first, report) = warp.solve(&pre_warp, &points, &[]).expect("regular");
    assert!(report.raised == 0 && report.rms_px < 0.9 * report.prewarp_rms_px, "{report:?}");
    c.bench_function("warp frame (pre-warp, assemble, factor, solve)", |b| {
        b.iter(|| warp.solve_into(black_box(&pre_warp), &points, &[], &mut mesh).expect("regular"));
    });
    assert_eq!(checksum(&mesh), checksum(&first), "the same input gives the same mesh");

    let mut complex = system::<Complex>(1);
    c.bench_function("factor and solve, complex", |b| {
        b.iter(|| black_box(complex.minimize(&Run::default()).expect("regular")[0]));
    });
    let mut real = system::<f64>(2);
    c.bench_function("factor and solve, real", |b| {
        b.iter(|| black_box(real.minimize(&Run::default()).expect("regular")[0]));
    });
    let one = |x: f64| assert!((x - 1.0).abs() < 1e-6, "the constant is the minimizer, not {x}");
    complex.solution().iter().for_each(|x| one(x.re));
    real.solution().iter().for_each(|&x| one(x));

    c.bench_function("analyze", |b| {
        b.iter(|| ContentPreserving::new(64, 36, w, h, ContentPreservingOptions::default()).expect("valid grid"));
    });
}

criterion_group!(benches, bench);
criterion_main!(benches);
