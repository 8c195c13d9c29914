//! Laws of the content-preserving warp, with the paper's sum evaluated naively and solved densely as oracle.

use nalgebra::{DMatrix, DVector, Matrix3};
use plumbline::image::grid::{Grid, GridMesh, Quad};
use plumbline::image::warp::{ContentPreserving, ContentPreservingOptions, PointPair, WarpError};
use plumbline::num::math::{Homography, Point2, Similarity2, Vec2};

use crate::allocations::allocations_of;

const W: f64 = 640.0;
const H: f64 = 360.0;

fn options() -> ContentPreservingOptions {
    ContentPreservingOptions::default()
}

fn solver(cols: usize, rows: usize) -> ContentPreserving {
    ContentPreserving::new(cols, rows, W, H, options()).expect("valid grid")
}

/// Length of a cell, px.
fn cell_px(grid: &Grid) -> f64 {
    (grid.width * grid.height / grid.cell_count() as f64).sqrt()
}

fn perspective() -> Homography {
    Homography::new(Matrix3::new(1.05, 0.03, 4.0, -0.02, 0.98, -6.0, 5e-5, -8e-5, 1.0))
}

/// Points spread over the frame; each goes where `f` sends it.
fn scatter(count: usize, seed: u64, f: impl Fn(Point2) -> Point2) -> Vec<PointPair> {
    let mut rng = fastrand::Rng::with_seed(seed);
    (0..count)
        .map(|_| Point2::new(rng.f64() * W, rng.f64() * H))
        .map(|src| PointPair { src, dst: f(src), weight: 1.0 })
        .collect()
}

fn largest_step(a: &GridMesh, b: &GridMesh) -> f64 {
    a.vertices.iter().zip(&b.vertices).map(|(p, q)| (p - q).norm()).fold(0.0, f64::max)
}

fn mapped(grid: &Grid, f: impl Fn(Point2) -> Point2) -> GridMesh {
    let vertices = (0..grid.vertex_count()).map(|i| f(grid.vertex(i))).collect();
    GridMesh { cols: grid.cols, rows: grid.rows, vertices }
}

fn homography(h: Homography) -> impl Fn(Point2) -> Point2 {
    move |p| h.apply(p).expect("in front")
}

/// A smooth deformation that no homography explains, some pixels large.
fn wave(p: Point2) -> Point2 {
    p + Vec2::new(4.0 * (p.y / 50.0).sin(), 3.0 * (p.x / 70.0).cos())
}

fn wavy_saliency(grid: &Grid) -> Vec<f64> {
    (0..grid.cell_count()).map(|c| 0.5 + 0.3 * ((c * 7) % 5) as f64 / 5.0).collect()
}

/// One row `√w (Σ aⱼ xⱼ − b)` over the real unknowns `x₀ y₀ x₁ y₁ …`, lengths in cells.
struct Row {
    terms: Vec<(usize, f64)>,
    b: f64,
    w: f64,
}

/// The sum as printed in the paper, term by term, for positions `V` (not displacements).
fn paper_rows(grid: &Grid, pre: Homography, points: &[PointPair], saliency: &[f64], alpha: f64, prox: f64) -> Vec<Row> {
    let unit = cell_px(grid);
    let hat: Vec<Vec2> = (0..grid.vertex_count()).map(|i| homography(pre)(grid.vertex(i)).coords / unit).collect();
    let mut rows = Vec::new();
    for point in points {
        let at = grid.locate(point.src).expect("inside");
        let corners = grid.corners(at.cell);
        let quad = Quad(corners.map(|i| Point2::from(hat[i])));
        let target = Point2::from(homography(pre)(point.src).coords / unit);
        let (s, t) = quad.inverse(target, (0.5, 0.5)).expect("inside its cell");
        let beta = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
        let total: f64 = points.iter().map(|p| p.weight).sum();
        let w = point.weight * 400.0 / total.max(50.0);
        for xy in 0..2 {
            let terms = corners.iter().zip(beta).map(|(&i, b)| (2 * i + xy, b)).collect();
            rows.push(Row { terms, b: point.dst[xy] / unit, w });
        }
    }
    for (cell, w_s) in saliency.iter().enumerate() {
        let [tl, tr, bl, br] = grid.corners(cell);
        // (V₁, V₂, V₃), right angle at V₂.
        let triangles = [
            (tr, tl, bl),
            (bl, tl, tr),
            (tl, tr, br),
            (br, tr, tl),
            (tl, bl, br),
            (br, bl, tl),
            (tr, br, bl),
            (bl, br, tr),
        ];
        for (v1, v2, v3) in triangles {
            let (e, d) = (hat[v3] - hat[v2], hat[v1] - hat[v2]);
            let r90 = Vec2::new(e.y, -e.x);
            let (u, v) = (d.dot(&e) / e.norm_squared(), d.dot(&r90) / e.norm_squared());
            let w = alpha * w_s;
            // x: V₁ − V₂ − u (V₃ − V₂) − v (V₃ − V₂)·(0, 1);  y: the same with (−1, 0)
            let (x, y) = (0, 1);
            let row = |own: usize, other: usize, sign: f64| Row {
                terms: vec![
                    (2 * v1 + own, 1.0),
                    (2 * v2 + own, u - 1.0),
                    (2 * v3 + own, -u),
                    (2 * v3 + other, -v * sign),
                    (2 * v2 + other, v * sign),
                ],
                b: 0.0,
                w,
            };
            rows.push(row(x, y, 1.0));
            rows.push(row(y, x, -1.0));
        }
    }
    let epsilon = prox * 400.0 / grid.vertex_count() as f64;
    for (i, v) in hat.iter().enumerate() {
        rows.extend((0..2).map(|xy| Row { terms: vec![(2 * i + xy, 1.0)], b: v[xy], w: epsilon }));
    }
    rows
}

/// Minimizer of the rows by dense normal equations and LU.
fn solve_densely(grid: &Grid, rows: &[Row]) -> GridMesh {
    let n = 2 * grid.vertex_count();
    let (mut a, mut rhs) = (DMatrix::<f64>::zeros(n, n), DVector::<f64>::zeros(n));
    for row in rows {
        for &(i, p) in &row.terms {
            rhs[i] += row.w * p * row.b;
            for &(j, q) in &row.terms {
                a[(i, j)] += row.w * p * q;
            }
        }
    }
    let x = a.lu().solve(&rhs).expect("regular") * cell_px(grid);
    let vertices = (0..grid.vertex_count()).map(|i| Point2::new(x[2 * i], x[2 * i + 1])).collect();
    GridMesh { cols: grid.cols, rows: grid.rows, vertices }
}

#[test]
fn without_points_the_mesh_is_the_pre_warp_exactly() {
    for pre in [Homography::identity(), perspective()] {
        let mut s = solver(64, 36);
        let (mesh, report) = s.solve(&pre, &[], &[]).expect("no points are fine");
        assert_eq!(mesh, mapped(s.grid(), homography(pre)));
        assert_eq!((report.points, report.raised, report.rms_px), (0, 0, 0.0));
    }
}

#[test]
fn identity_is_exact() {
    let mut s = solver(64, 36);
    let points = scatter(300, 1, |p| p);
    let (mesh, _) = s.solve(&Homography::identity(), &points, &[]).expect("regular");
    assert!(largest_step(&mesh, &s.grid().to_mesh()) < 1e-12 * W);
}

#[test]
fn a_homography_that_explains_all_points_is_reproduced() {
    let mut s = solver(64, 36);
    let points = scatter(300, 2, homography(perspective()));
    let (mesh, report) = s.solve(&perspective(), &points, &[]).expect("regular");
    let err = largest_step(&mesh, &mapped(s.grid(), homography(perspective())));
    assert!(err < 1e-9 * cell_px(s.grid()), "{err}");
    assert!(report.rms_px < 1e-9 && report.prewarp_rms_px < 1e-9);
}

#[test]
fn a_similarity_costs_no_energy_and_is_found_from_points_alone() {
    let free = ContentPreservingOptions { proximity: 1e-13, ..options() };
    let mut s = ContentPreserving::new(16, 9, W, H, free).expect("valid");
    let turn = Similarity2::about(Point2::new(W / 2.0, H / 2.0), 0.1, 1.1, Vec2::new(5.0, -3.0));
    let points = scatter(60, 3, |p| turn.apply(p));
    let (mesh, _) = s.solve(&Homography::identity(), &points, &[]).expect("regular");
    let err = largest_step(&mesh, &mapped(s.grid(), |p| turn.apply(p)));
    assert!(err < 1e-9 * cell_px(s.grid()), "{err}");
}

#[test]
fn the_mesh_minimizes_the_sum_printed_in_the_paper() {
    for (pre, alpha) in [(Homography::identity(), 20.0), (perspective(), 20.0), (perspective(), 3.0)] {
        let opts = ContentPreservingOptions { alpha, ..options() };
        let mut s = ContentPreserving::new(8, 5, W, H, opts).expect("valid");
        let mut points = scatter(70, 4, |p| wave(homography(pre)(p)));
        points.iter_mut().enumerate().for_each(|(k, p)| p.weight = 0.1 + 0.2 * (k % 7) as f64);
        let saliency = wavy_saliency(s.grid());
        let (mesh, report) = s.solve(&pre, &points, &saliency).expect("regular");
        let expected = solve_densely(s.grid(), &paper_rows(s.grid(), pre, &points, &saliency, alpha, opts.proximity));
        let err = largest_step(&mesh, &expected);
        assert!(err < 1e-9 * cell_px(s.grid()), "differs by {err} px");
        assert_eq!(report.raised, 0);
        assert!(largest_step(&mesh, &mapped(s.grid(), homography(pre))) > 1.0, "the test must move something");
    }
}

#[test]
fn resolution_does_not_matter() {
    let scale = 3.7;
    let points = scatter(200, 5, wave);
    let scaled: Vec<PointPair> =
        points.iter().map(|p| PointPair { src: p.src * scale, dst: p.dst * scale, ..*p }).collect();
    let (small, _) = solver(32, 18).solve(&Homography::identity(), &points, &[]).expect("regular");
    let mut s = ContentPreserving::new(32, 18, W * scale, H * scale, options()).expect("valid");
    let (large, _) = s.solve(&Homography::identity(), &scaled, &[]).expect("regular");
    let worst = small.vertices.iter().zip(&large.vertices).map(|(p, q)| (p * scale - q).norm()).fold(0.0, f64::max);
    assert!(worst < 1e-9 * W * scale, "{worst}");
}

#[test]
fn doubling_every_point_changes_nothing() {
    let points = scatter(200, 6, wave);
    let twice: Vec<PointPair> = points.iter().chain(&points).copied().collect();
    let (once, _) = solver(32, 18).solve(&Homography::identity(), &points, &[]).expect("regular");
    let (doubled, report) = solver(32, 18).solve(&Homography::identity(), &twice, &[]).expect("regular");
    assert_eq!(report.points, 400);
    assert!(largest_step(&once, &doubled) < 1e-10 * W);
}

#[test]
fn a_finer_grid_gives_nearly_the_same_warp() {
    let points = scatter(400, 7, |p| p + Vec2::new(4.0 * (p.y / 150.0).sin(), 3.0 * (p.x / 200.0).cos()));
    let (coarse, _) = solver(32, 18).solve(&Homography::identity(), &points, &[]).expect("regular");
    let (fine, _) = solver(64, 36).solve(&Homography::identity(), &points, &[]).expect("regular");
    let moved = largest_step(&coarse, &solver(32, 18).grid().to_mesh());
    let apart = (0..33 * 19).map(|i| {
        let (col, row) = (i % 33, i / 33);
        (coarse.vertices[i] - fine.vertices[2 * row * 65 + 2 * col]).norm()
    });
    let rms = (apart.map(|d| d * d).sum::<f64>() / (33.0 * 19.0)).sqrt();
    assert!(rms < 0.02 * moved, "rms {rms} px apart, where vertices move {moved} px");
}

#[test]
fn mirrored_input_gives_the_mirrored_mesh() {
    let flip = |p: Point2| Point2::new(W - p.x, p.y);
    let points = scatter(120, 8, wave);
    let flipped: Vec<PointPair> =
        points.iter().map(|p| PointPair { src: flip(p.src), dst: flip(p.dst), ..*p }).collect();
    let (a, _) = solver(16, 9).solve(&Homography::identity(), &points, &[]).expect("regular");
    let (b, _) = solver(16, 9).solve(&Homography::identity(), &flipped, &[]).expect("regular");
    let worst =
        (0..17 * 10).map(|i| (flip(a.vertices[i]) - b.vertices[i / 17 * 17 + 16 - i % 17]).norm()).fold(0.0, f64::max);
    assert!(worst < 1e-9 * W, "{worst}");
}

#[test]
fn one_displaced_point_moves_its_surroundings_smoothly() {
    let mut s = solver(64, 36);
    let mut points = scatter(399, 9, |p| p);
    let src = Point2::new(W / 2.0 + 3.0, H / 2.0 + 2.0);
    points.push(PointPair { src, dst: src + Vec2::new(12.0, 0.0), weight: 1.0 });
    let (mesh, report) = s.solve(&Homography::identity(), &points, &[]).expect("regular");
    let at = s.grid().locate(src).expect("inside");
    let moved = mesh.at(at) - src;
    assert!(moved.x > 0.05 && moved.x < 12.0 && moved.y.abs() < 0.05 * moved.x, "pulled by {moved}");
    assert_eq!((mesh.folded_cells(), report.raised), (0, 0));
    let pull = |i: usize| (mesh.vertices[i] - s.grid().vertex(i)).norm();
    let (near, far) = (pull(18 * 65 + 32), pull(18 * 65 + 48));
    assert!(near > 0.9 * moved.x && far < 0.5 * near && pull(0) < 0.1 * near, "{near}, {far}, corner {}", pull(0));
}

#[test]
fn folds_are_removed_by_stiffening() {
    let mut s = solver(32, 18);
    // Two dense columns of points that change places.
    let column = |from: f64, to: f64| {
        (0..120).map(move |k| 20.0 + 2.6 * k as f64).map(move |y| PointPair {
            src: Point2::new(from, y),
            dst: Point2::new(to, y),
            weight: 1.0,
        })
    };
    let points: Vec<PointPair> = column(300.0, 420.0).chain(column(340.0, 220.0)).collect();
    let (mesh, report) = s.solve(&Homography::identity(), &points, &[]).expect("regular");
    assert_eq!(mesh.folded_cells(), 0);
    assert!(report.raised > 0 && !report.reverted, "{report:?}");
    assert_eq!(report.alpha, 20.0 * 4_f64.powi(report.raised));
}

#[test]
fn targets_on_one_spot_leave_the_pre_warp() {
    let mut s = solver(16, 9);
    let spot = Point2::new(100.0, 100.0);
    let points = scatter(500, 10, |_| spot);
    let (mesh, report) = s.solve(&perspective(), &points, &[]).expect("regular");
    assert_eq!(mesh.folded_cells(), 0);
    if report.reverted {
        assert_eq!(mesh, mapped(s.grid(), homography(perspective())));
    }
}

#[test]
fn sources_on_one_spot_shift_the_mesh_without_folds() {
    let mut s = solver(16, 9);
    let src = Point2::new(320.0, 180.0);
    let points = vec![PointPair { src, dst: src + Vec2::new(10.0, 4.0), weight: 1.0 }; 200];
    let (mesh, _) = s.solve(&Homography::identity(), &points, &[]).expect("regular");
    assert_eq!(mesh.folded_cells(), 0);
    assert!(mesh.vertices.iter().all(|v| v.x.is_finite() && v.y.is_finite()));
}

#[test]
fn stiffer_cells_err_more_from_points_and_less_from_shape() {
    let points = scatter(300, 11, wave);
    let shape = |mesh: &GridMesh| -> f64 {
        (0..32 * 18)
            .map(|c| mesh.quad(c).0)
            .map(|[a, b, c, _]| ((c - a) - Vec2::new(-(b - a).y, (b - a).x)).norm_squared())
            .sum()
    };
    let mut last: Option<(f64, f64)> = None;
    for alpha in [0.01, 1.0, 20.0, 400.0, 1e6] {
        let opts = ContentPreservingOptions { alpha, ..options() };
        let mut s = ContentPreserving::new(32, 18, W, H, opts).expect("valid");
        let (mesh, report) = s.solve(&Homography::identity(), &points, &[]).expect("regular");
        if let Some((rms, bend)) = last {
            assert!(report.rms_px > rms && shape(&mesh) < bend, "at alpha {alpha}");
        } else {
            assert!(report.rms_px < 0.15 * report.prewarp_rms_px, "soft cells follow points: {report:?}");
        }
        last = Some((report.rms_px, shape(&mesh)));
    }
}

#[test]
fn salient_cells_keep_their_shape_better() {
    let points = scatter(300, 12, wave);
    let mut s = solver(32, 18);
    let left = |c: usize| c % 32 < 16;
    let saliency: Vec<f64> = (0..32 * 18).map(|c| if left(c) { 5.0 } else { 0.5 }).collect();
    let bend = |mesh: &GridMesh, side: bool| -> f64 {
        (0..32 * 18)
            .filter(|&c| left(c) == side)
            .map(|c| mesh.quad(c).0)
            .map(|[a, b, c, _]| ((c - a) - Vec2::new(-(b - a).y, (b - a).x)).norm_squared())
            .sum()
    };
    let (even, _) = s.solve(&Homography::identity(), &points, &[]).expect("regular");
    let (uneven, _) = s.solve(&Homography::identity(), &points, &saliency).expect("regular");
    assert!(bend(&uneven, true) < 0.5 * bend(&even, true));
    assert!(bend(&uneven, false) < 1.5 * bend(&even, false));
}

#[test]
fn a_used_solver_gives_the_same_as_a_new_one() {
    let mut used = solver(32, 18);
    let first = scatter(500, 13, wave);
    used.solve(&perspective(), &first, &wavy_saliency(&used.grid().clone())).expect("regular");
    let points = scatter(100, 14, wave);
    let (a, ra) = used.solve(&Homography::identity(), &points, &[]).expect("regular");
    let (b, rb) = solver(32, 18).solve(&Homography::identity(), &points, &[]).expect("regular");
    assert_eq!((a, ra), (b, rb));
}

#[test]
fn a_frame_allocates_nothing() {
    let mut s = solver(32, 18);
    let (points, saliency) = (scatter(300, 16, wave), wavy_saliency(s.grid()));
    let mut mesh = s.grid().to_mesh();
    s.solve_into(&perspective(), &points, &saliency, &mut mesh).expect("regular");
    let count = allocations_of(|| {
        s.solve_into(&Homography::identity(), &points, &saliency, &mut mesh).expect("regular");
    });
    assert_eq!(count, 0);
}

#[test]
fn points_outside_the_frame_and_weightless_ones_are_left_out() {
    let mut points = scatter(100, 15, wave);
    let (expected, _) = solver(16, 9).solve(&Homography::identity(), &points, &[]).expect("regular");
    let stray = PointPair { src: Point2::new(-4.0, 10.0), dst: Point2::new(90.0, 10.0), weight: 1.0 };
    points.push(stray);
    points.push(PointPair { src: Point2::new(4.0, 10.0), weight: 0.0, ..stray });
    let (mesh, report) = solver(16, 9).solve(&Homography::identity(), &points, &[]).expect("regular");
    assert_eq!(mesh, expected);
    assert_eq!((report.points, report.outside), (100, 1));
}

#[test]
fn bad_input_is_refused_with_its_reason() {
    let mut s = solver(16, 9);
    let identity = Homography::identity();
    let good = PointPair { src: Point2::new(5.0, 5.0), dst: Point2::new(6.0, 5.0), weight: 1.0 };
    let nan = PointPair { dst: Point2::new(f64::NAN, 1.0), ..good };
    let negative = PointPair { weight: -1.0, ..good };
    let error = |e: Result<_, WarpError>| e.map(|_: (GridMesh, _)| ()).expect_err("refused").to_string();
    assert_eq!(
        error(s.solve(&identity, &[good, nan], &[])),
        "point 1 is not usable: source (5, 5), target (NaN, 1), weight 1 (finite, weight 0 or more)"
    );
    assert!(error(s.solve(&identity, &[negative], &[])).contains("weight -1"));
    assert_eq!(
        error(s.solve(&identity, &[good], &[0.5; 7])),
        "saliency of cell 7 is NaN (expected 144 finite numbers above 0, or none)"
    );
    let mut saliency = vec![0.5; 144];
    saliency[3] = 0.0;
    assert!(error(s.solve(&identity, &[good], &saliency)).starts_with("saliency of cell 3 is 0"));
    let mirror = Homography::new(Matrix3::new(-1.0, 0.0, W, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0));
    assert_eq!(
        error(s.solve(&mirror, &[good], &[])),
        "the pre-warp does not map the image one to one: cell 0 folds or reaches infinity"
    );
    let horizon = Homography::new(Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0 / 300.0, 0.0, 1.0));
    assert!(error(s.solve(&horizon, &[good], &[])).contains("reaches infinity"));
    let new = |cols, width, opts| ContentPreserving::new(cols, 9, width, H, opts).map(|_| ()).expect_err("refused");
    assert_eq!(
        new(0, W, options()).to_string(),
        "a grid of 0×9 cells over 640×360 px is invalid (1 to 1024 cells each way, size above 0)"
    );
    assert!(new(16, f64::NAN, options()).to_string().starts_with("a grid of 16×"));
    let bad_alpha = ContentPreservingOptions { alpha: f64::NAN, ..options() };
    assert_eq!(new(16, W, bad_alpha).to_string(), "alpha NaN is invalid (expected above 0)");
    let bad_proximity = ContentPreservingOptions { proximity: 0.0, ..options() };
    assert_eq!(new(16, W, bad_proximity).to_string(), "proximity 0 is invalid (expected above 0, at most 1)");
}
