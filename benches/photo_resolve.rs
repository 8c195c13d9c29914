//! What a display asks while a line or a size is dragged: the solve again, everything else kept.
//!
//! A wide-angle picture with 24 and with 70 lines on the default grid: one line moves by two pixels a frame and comes back.
//! The time is that of one factor of the grid's matrix (some 3 ms) and as many solves as lines share unknowns, two each; the
//! warp for the display (crop, inverse grid) is timed apart. A picture of 1200 × 800 px with lines takes a new width.
//!
//! Each bench first checks that the solve is the right one: lines straight, nothing folded, and the sheet's checksum is that
//! of a solve from the start.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use plumbline::camera::{FieldAxis, FieldOfView, Lens, Projection, Vec3};
use plumbline::image::Plane;
use plumbline::image::feature::Importance;
use plumbline::image::grid::GridMesh;
use plumbline::num::math::{Point2, Rect, Vec2};
use plumbline::num::run::Run;
use plumbline::photo::rectify::{Rectifier, RectifyInput, RectifyOptions};
use plumbline::photo::retarget::{RetargetOptions, Retargeter};
use plumbline::photo::{Line, Orientation};

const SIZE: (f64, f64) = (1200.0, 900.0);

fn lens() -> Lens {
    let fov = FieldOfView::degrees(110.0, FieldAxis::Horizontal);
    Lens::from_field_of_view(Projection::Equidistant, fov, SIZE).expect("a lens")
}

/// Edges of a room along its three directions.
fn room(lens: &Lens, count: usize) -> Vec<Line> {
    let mut rng = fastrand::Rng::with_seed(7);
    let mut lines = Vec::new();
    while lines.len() < count {
        let axis = rng.usize(0..3);
        let mut from = Vec3::new(3.0 * rng.f64() - 1.5, 2.0 * rng.f64() - 1.0, rng.f64() + 0.7);
        let mut to = from;
        let half = 0.25 + 0.6 * rng.f64();
        (from[axis], to[axis]) = (from[axis] - half, to[axis] + half);
        let at = |k: usize| lens.project(&(from + (to - from) * (k as f64 / 19.0)));
        let points: Vec<Point2> =
            (0..20).filter_map(at).filter(|p| Rect::of_size(SIZE.0, SIZE.1).contains(*p)).collect();
        if points.len() >= 6 && from.z > 0.3 {
            let orientation = if axis == 1 { Orientation::Vertical } else { Orientation::Free };
            lines.push(Line { name: lines.len().to_string(), points, orientation });
        }
    }
    lines
}

fn checksum(mesh: &GridMesh) -> f64 {
    mesh.vertices.iter().enumerate().map(|(i, v)| (v.x + 2.0 * v.y) * (1.0 + (i % 7) as f64)).sum()
}

fn moved(lines: &[Line], by: f64) -> Vec<Line> {
    let mut lines = lines.to_vec();
    lines[3].points.iter_mut().for_each(|p| *p += Vec2::new(0.5 * by, by));
    lines
}

fn lines(c: &mut Criterion) {
    let lens = lens();
    for count in [24, 70] {
        let marked = room(&lens, count);
        let input =
            |lines| RectifyInput { lens: &lens, lines, soft_lines: &[], found: false, faces: &[], saliency: None };
        let options = RectifyOptions::default();
        let mut view = Rectifier::new(&input(&marked), &options, &Run::default()).expect("a view");
        let there = moved(&marked, 2.0);
        view.follow(&there, &Run::default()).expect("solved");
        let anew = Rectifier::new(&input(&there), &options, &Run::default()).expect("a view");
        let (followed, solved) = (checksum(view.sheet()), checksum(anew.sheet()));
        let size: f64 = anew.sheet().vertices.iter().map(|v| v.coords.norm()).sum();
        assert!((followed - solved).abs() < 1e-3 * size, "{followed} for {solved}");
        let warp = view.warp().expect("a warp");
        assert!(warp.mesh.folded_cells() == 0 && warp.lines.iter().all(|l| !l.is_bent()));
        let mut back = false;
        c.bench_function(&format!("follow a line among {count}"), |b| {
            b.iter(|| {
                back = !back;
                view.follow(black_box(if back { &marked } else { &there }), &Run::default()).expect("solved");
            });
        });
        c.bench_function(&format!("solve for {count} lines from the start"), |b| {
            b.iter(|| view.solve(black_box(&marked), &Run::default()).expect("solved"));
        });
        c.bench_function(&format!("warp of a sheet with {count} lines"), |b| {
            b.iter(|| black_box(view.warp().expect("a warp")));
        });
    }
}

fn sizes(c: &mut Criterion) {
    let (w, h) = (1200, 800);
    let matters = |x: usize, y: usize| (x as f64 - 400.0).hypot(y as f64 - 450.0) < 180.0;
    let importance = Plane::from_fn(w, h, |x, y| if matters(x, y) { 1.0 } else { 0.1 });
    let importance = Importance::from_plane(importance).expect("in [0, 1]");
    let line = |name: &str, a: (f64, f64), b: (f64, f64)| Line {
        name: name.to_owned(),
        points: vec![Point2::new(a.0, a.1), Point2::new(b.0, b.1)],
        orientation: Orientation::Free,
    };
    let lines = vec![
        line("roof", (100.0, 200.0), (700.0, 90.0)),
        line("street", (50.0, 780.0), (1150.0, 600.0)),
        line("pole", (900.0, 100.0), (960.0, 700.0)),
    ];
    let options = RetargetOptions::default();
    let mut picture = Retargeter::new((w, h), importance, lines, Vec::new(), options).expect("a picture");
    let mut width = 800;
    let solved = picture.solve((width, h), &Run::default()).expect("solved");
    assert!(solved.warp.mesh.folded_cells() == 0 && solved.warp.lines.iter().all(|l| !l.is_bent()));
    c.bench_function("a new width", |b| {
        b.iter(|| {
            width = 780 + (width + 7) % 40;
            black_box(picture.solve((width, h), &Run::default()).expect("solved"));
        });
    });
}

criterion_group!(benches, lines, sizes);
criterion_main!(benches);
