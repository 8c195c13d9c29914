//! Laws of retargeting.

use super::*;
use plumbline_image::Plane;
use plumbline_num::math::PointMap;
use plumbline_num::run::Run;
use proptest::prelude::*;

const SOURCE: (usize, usize) = (640, 420);

/// Importance that varies over the picture, smoothly, from seed to seed.
fn importance(seed: u64) -> Importance {
    let mut rng = fastrand::Rng::with_seed(seed);
    let spots: Vec<[f32; 3]> = (0..4).map(|_| [rng.f32() * 64.0, rng.f32() * 42.0, 4.0 + 8.0 * rng.f32()]).collect();
    let at = |x: usize, y: usize| {
        let spot = |s: &[f32; 3]| (-((x as f32 - s[0]).powi(2) + (y as f32 - s[1]).powi(2)) / s[2].powi(2)).exp();
        (0.03 + spots.iter().map(spot).sum::<f32>()).min(1.0)
    };
    Importance::from_plane(Plane::from_fn(64, 42, at)).expect("in range")
}

fn line(name: &str, a: (f64, f64), b: (f64, f64), orientation: Orientation) -> Line {
    Line { name: name.into(), points: vec![Point2::new(a.0, a.1), Point2::new(b.0, b.1)], orientation }
}

fn random_lines(seed: u64, count: usize) -> Vec<Line> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut point = || (rng.f64() * 700.0 - 30.0, rng.f64() * 480.0 - 30.0);
    (0..count).map(|i| line(&format!("line {i}"), point(), point(), Orientation::Free)).collect()
}

fn solved(out: (usize, usize), importance: &Importance, lines: &[Line], faces: &[Face]) -> Retargeted {
    retarget(SOURCE, out, importance, lines, faces, &RetargetOptions::default(), &Run::default())
        .expect("a sound picture")
}

/// Largest distance of the border from where it must be, px; exact means 0.
fn border_error(mesh: &GridMesh, size: (f64, f64)) -> f64 {
    let error = |i: usize, v: &Point2| {
        let (col, row) = (i % (mesh.cols + 1), i / (mesh.cols + 1));
        let x = if col == 0 { v.x.abs() } else { (v.x - size.0).abs() };
        let y = if row == 0 { v.y.abs() } else { (v.y - size.1).abs() };
        let beside = if col == 0 || col == mesh.cols { x } else { 0.0 };
        beside.max(if row == 0 || row == mesh.rows { y } else { 0.0 })
    };
    mesh.vertices.iter().enumerate().map(|(i, v)| error(i, v)).fold(0.0, f64::max)
}

/// Largest distance of a mesh from the plain resize, px.
fn off_plain(mesh: &GridMesh, size: (usize, usize)) -> f64 {
    let at = |i: usize| {
        let (col, row) = (i % (mesh.cols + 1), i / (mesh.cols + 1));
        let (s, t) = (col as f64 / mesh.cols as f64, row as f64 / mesh.rows as f64);
        Point2::new(s * size.0 as f64, t * size.1 as f64)
    };
    mesh.vertices.iter().enumerate().map(|(i, v)| (v - at(i)).amax()).fold(0.0, f64::max)
}

#[test]
fn the_identity_costs_nothing_and_moves_nothing() {
    let lines = random_lines(4, 10);
    let found = solved(SOURCE, &importance(1), &lines, &[]);
    assert!(found.energies[0] < 1e-12, "{:?}", found.energies);
    assert!(off_plain(&found.warp.mesh, SOURCE) < 1e-9, "{}", off_plain(&found.warp.mesh, SOURCE));
    let p = Point2::new(123.4, 321.0);
    assert!((found.warp.field.map(p).expect("inside") - p).norm() < 1e-6);
}

#[test]
fn a_uniform_resize_costs_nothing() {
    for out in [(320, 210), (1280, 840), (64, 42)] {
        let found = solved(out, &importance(2), &random_lines(5, 10), &[]);
        assert!(found.energies[0] < 1e-12 && found.warp.iterations <= 1, "{:?}", found.energies);
        assert!(off_plain(&found.warp.mesh, out) < 1e-9);
    }
}

#[test]
fn where_everything_matters_alike_the_resize_is_plain() {
    for out in [(384, 420), (896, 420), (640, 252), (300, 400)] {
        let found = solved(out, &Importance::even(), &[], &[]);
        let off = off_plain(&found.warp.mesh, out);
        assert!(off < 1e-6 * 640.0, "{out:?}: off by {off} px");
    }
}

#[test]
fn horizontal_and_vertical_lines_stay_exactly_so() {
    let lines = [
        line("horizon", (0.0, 200.0), (640.0, 200.0), Orientation::Horizontal),
        line("slanting horizon", (30.0, 310.0), (600.0, 321.0), Orientation::Horizontal),
        line("mast", (222.0, 40.0), (222.0, 390.0), Orientation::Vertical),
        line("leaning mast", (401.0, 60.0), (410.0, 250.0), Orientation::Vertical),
    ];
    for out in [(384, 420), (900, 420), (640, 260)] {
        let found = solved(out, &importance(3), &lines, &[]);
        assert!(found.released.is_empty(), "{:?}", found.released);
        for report in &found.warp.lines {
            let turned = report.angle_error.expect("a direction was given");
            assert!(report.max_px < 1e-4 && turned.abs() < 1e-6, "{}: {report:?}", report.name);
        }
        assert_eq!(found.warp.mesh.folded_cells(), 0);
    }
}

#[test]
fn a_line_at_a_given_angle_takes_it() {
    let tilted = line("roof", (200.0, 100.0), (330.0, 160.0), Orientation::Angle(0.4));
    let found = solved((400, 420), &importance(6), &[tilted], &[]);
    let report = &found.warp.lines[0];
    assert!((report.angle - 0.4).abs() < 1e-5 && report.max_px < 1e-3, "{report:?}");
}

#[test]
fn oblique_lines_stay_straight_where_columns_would_bend_them() {
    let mut worst = [0.0_f64; 2];
    for seed in 0..6 {
        let lines = random_lines(seed, 12);
        for (refine, worst) in [false, true].into_iter().zip(&mut worst) {
            let options = RetargetOptions { refine, ..RetargetOptions::default() };
            let found =
                retarget(SOURCE, (384, 420), &importance(seed), &lines, &[], &options, &Run::default()).expect("sound");
            let bend = |r: &LineReport| r.max_px / r.length_px.max(1.0);
            *worst = found.warp.lines.iter().map(bend).fold(*worst, f64::max);
        }
    }
    assert!(worst[1] < 1e-3 && worst[0] > 1e-2, "refined {} of the length, columns alone {}", worst[1], worst[0]);
}

#[test]
fn no_mesh_nearby_costs_less() {
    let lines = random_lines(8, 3);
    let out = (384.0, 420.0);
    let mut retargeter =
        Retargeter::new(SOURCE, importance(8), lines, Vec::new(), RetargetOptions::default()).expect("sound");
    retargeter.solve((384, 420), &Run::default()).expect("sound");
    let prepared = retargeter.prepared.as_mut().expect("solved");
    let settings = Settings { bending: 0.3, least: 0.3, most: 1.5, max_iterations: 200, tolerance: 1e-12 };
    let straight =
        prepared.lines.iter().filter_map(|l| Straight::new(virtual_points(l, &prepared.grid), l.orientation));
    let mut energy =
        ScaleAndStretch::new(prepared.grid, prepared.weights.clone(), straight.collect(), settings).expect("sound");
    let mut mesh = plain_resize(&prepared.grid, out);
    let best = *energy.minimize(&mut mesh, out, &Run::default()).expect("sound").energies.last().expect("one at least");
    let mut rng = fastrand::Rng::with_seed(1);
    for _ in 0..300 {
        let mut other = mesh.clone();
        let (col, row) = (1 + rng.usize(..mesh.cols - 1), 1 + rng.usize(..mesh.rows - 1));
        let by = Vec2::new(rng.f64() - 0.5, rng.f64() - 0.5) * 0.2;
        other.vertices[row * (mesh.cols + 1) + col] += by;
        let cost = energy.cost_of(&other, out);
        assert!(cost > best * (1.0 - 1e-7), "{cost} below {best}");
    }
}

#[test]
fn important_objects_keep_their_proportions() {
    let object = |x: usize, y: usize| (20..30).contains(&x) && (10..34).contains(&y);
    let plane = Plane::from_fn(64, 42, |x, y| if object(x, y) { 1.0 } else { 0.03 });
    let found = solved((384, 420), &Importance::from_plane(plane).expect("in range"), &[], &[]);
    let grid = grid_over(640.0, 420.0, 1200);
    let at = |x: f64, y: f64| found.warp.mesh.at(grid.locate(Point2::new(x, y)).expect("inside"));
    let (width, height) = (at(300.0, 220.0).x - at(200.0, 220.0).x, at(250.0, 340.0).y - at(250.0, 100.0).y);
    let ratio = (width / 100.0) / (height / 240.0);
    assert!((ratio - 1.0).abs() < 0.05, "plainly resized it would be 0.6 as wide, and is {ratio}");
}

#[test]
fn faces_keep_their_shape_whatever_else_matters() {
    let rect = Rect { min: Point2::new(420.0, 150.0), max: Point2::new(500.0, 230.0) };
    let found = solved((384, 420), &importance(11), &[], &[Face { rect, score: 12.0 }]);
    let grid = grid_over(640.0, 420.0, 1200);
    let at = |s: f64, t: f64| found.warp.mesh.at(grid.locate(rect.at(s, t)).expect("inside"));
    for (s, t) in [(0.0, 0.5), (0.5, 0.0), (0.5, 0.5), (0.7, 0.7)] {
        let (across, down) = ((at(s + 0.3, t) - at(s, t)).norm(), (at(s, t + 0.3) - at(s, t)).norm());
        assert!((across / down - 1.0).abs() < 0.05, "at ({s}, {t}): {}", across / down);
    }
}

#[test]
fn extreme_aspect_ratios_crop_to_important_objects_and_then_warp() {
    let plane = Plane::from_fn(64, 42, |x, _| if (46..54).contains(&x) { 1.0 } else { 0.03 });
    let found = solved((160, 420), &Importance::from_plane(plane).expect("in range"), &[], &[]);
    let window = found.window;
    assert!((window.width() - 320.0).abs() < 1e-9, "0.25 of the width is 0.5 of half of it: {window:?}");
    assert!(window.min.x <= 460.0 && window.max.x >= 540.0, "{window:?}");
    let at = |x: f64, y: f64| found.warp.field.map(Point2::new(x, y)).expect("inside");
    assert!((at(0.0, 0.0) - window.min).norm() < 1e-6 && (at(160.0, 420.0) - window.max).norm() < 1e-6);
}

#[test]
fn a_line_whose_constraint_fails_is_reported_and_the_others_are_straight() {
    let mut lines = random_lines(21, 4);
    lines.push(line("impossible", (100.0, 0.0), (500.0, 420.0), Orientation::Horizontal));
    let found = solved((384, 420), &importance(21), &lines, &[]);
    assert_eq!(found.released, ["impossible"]);
    assert!(found.warp.lines[..4].iter().all(|r| !r.is_bent()), "{:?}", found.warp.lines);
    assert_eq!(found.warp.mesh.folded_cells(), 0);
}

#[test]
fn points_duplicates_and_lines_outside_are_harmless() {
    let mut lines = random_lines(22, 2);
    lines.extend(lines.clone());
    lines.push(line("point", (50.0, 50.0), (50.0, 50.0), Orientation::Vertical));
    lines.push(line("outside", (-50.0, -50.0), (-10.0, 500.0), Orientation::Free));
    lines.push(Line { points: Vec::new(), ..line("empty", (0.0, 0.0), (1.0, 1.0), Orientation::Free) });
    let found = solved((384, 420), &importance(22), &lines, &[]);
    assert!(found.warp.lines.iter().all(|r| !r.is_bent()) && found.released.is_empty());
    assert_eq!((found.warp.lines[5].shown, found.warp.lines[6].shown), (0.0, 0.0));
}

#[test]
fn a_size_dragged_ends_where_the_same_size_asked_at_once_does() {
    let new = || Retargeter::new(SOURCE, importance(5), random_lines(5, 5), Vec::new(), RetargetOptions::default());
    let (mut dragged, mut fresh) = (new().expect("sound"), new().expect("sound"));
    for width in [600, 150, 500, 410] {
        dragged.solve((width, 420), &Run::default()).expect("sound");
    }
    let [a, b] = [&mut dragged, &mut fresh].map(|r| r.solve((400, 420), &Run::default()).expect("sound").warp.mesh);
    assert_eq!(a, b);
}

#[test]
fn what_cannot_be_used_is_refused_with_the_reason() {
    let ask = |source, out, lines: &[Line], options: &RetargetOptions| {
        retarget(source, out, &Importance::even(), lines, &[], options, &Run::default())
            .expect_err("refused")
            .to_string()
    };
    let plain = RetargetOptions::default();
    assert_eq!(ask((0, 5), (5, 5), &[], &plain), "the picture has 0×5 px (expected 1 to 65535 each way)");
    assert_eq!(ask(SOURCE, (5, 0), &[], &plain), "target size 5×0 px is invalid (expected 1 to 65535 each way)");
    assert_eq!(
        ask(SOURCE, (100_000, 9), &[], &plain),
        "target size 100000×9 px is invalid (expected 1 to 65535 each way)"
    );
    let nan = line("eaves", (f64::NAN, 0.0), (1.0, 1.0), Orientation::Free);
    assert_eq!(ask(SOURCE, (5, 5), &[nan], &plain), "line \"eaves\" has a point that is not finite; mark it again");
    let options = RetargetOptions { min_scale: 1.0, ..plain };
    assert_eq!(ask(SOURCE, (5, 5), &[], &options), "min_scale 1 is invalid (expected above 0, below 1)");
    let options = RetargetOptions { crop_below: f64::NAN, ..plain };
    assert_eq!(ask(SOURCE, (5, 5), &[], &options), "crop_below NaN is invalid (expected 0 to 1)");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn any_picture_and_size_has_an_exact_border_no_fold_and_energies_that_never_rise(
        seed in 0..u64::MAX, width in 1..1400_usize, height in 1..1400_usize, count in 0..12_usize, given in 0..4_usize,
    ) {
        let mut lines = random_lines(seed, count);
        let orientations = [Orientation::Free, Orientation::Horizontal, Orientation::Vertical, Orientation::Angle(0.3)];
        if let Some(line) = lines.first_mut() {
            line.orientation = orientations[given];
        }
        let options = RetargetOptions { cells: 300, ..RetargetOptions::default() };
        let found = retarget(SOURCE, (width, height), &importance(seed), &lines, &[], &options, &Run::default()).expect("sound");
        prop_assert_eq!(border_error(&found.warp.mesh, (width as f64, height as f64)), 0.0);
        prop_assert_eq!(found.warp.mesh.folded_cells(), 0);
        prop_assert!(found.energies.windows(2).all(|e| e[1] < e[0]), "{:?}", found.energies);
        let corner = found.warp.field.map(Point2::new(width as f64, height as f64)).expect("inside");
        prop_assert!((corner - found.window.max).norm() < 1e-5, "{corner} for {:?}", found.window);
    }
}
