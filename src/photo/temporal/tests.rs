use super::*;
use plumbline_image::Plane;
use plumbline_image::feature::Importance;
use plumbline_num::math::{PointMap, Vec2};
use plumbline_num::run::Run;
use proptest::prelude::*;

const SIZE: (usize, usize) = (1920, 1080);
const TALL: (usize, usize) = (608, 1080);

/// A spot of importance around `(s, t)`, shares of the picture, on a dull ground.
fn spot(s: f64, t: f64) -> Importance {
    let off = |x: usize, y: usize| ((x as f64 + 0.5) / 96.0 - s).abs().max(0.6 * ((y as f64 + 0.5) / 54.0 - t).abs());
    Importance::from_plane(Plane::from_fn(96, 54, |x, y| if off(x, y) < 0.08 { 1.0 } else { 0.1 })).expect("in [0, 1]")
}

/// Moments every five of `frames` frames, with the spot where `place` says.
fn moments(frames: usize, place: impl Fn(usize) -> f64) -> ClipImportance {
    let mut importance = ClipImportance::new(SIZE);
    (0..frames).step_by(5).for_each(|f| importance.push(f, &spot(place(f), 0.5)));
    importance
}

#[test]
fn importance_comes_back_from_its_bytes_and_from_no_others() {
    let importance = moments(20, |f| 0.02 * f as f64);
    let bytes = importance.to_bytes();
    assert_eq!(ClipImportance::from_bytes(&bytes).as_ref(), Some(&importance));
    assert!(importance.is_of(SIZE) && !importance.is_of(TALL));
    for end in 0..bytes.len() {
        let whole = end >= 16 && (end - 16) * 4 % (bytes.len() - 16) == 0;
        assert_eq!(ClipImportance::from_bytes(&bytes[..end]).is_some(), whole, "{end}");
    }
    // No columns, far too many, and moments out of order.
    for (at, value) in [(0, 0_u64), (8, 1 << 60), (16, 100)] {
        let mut wrong = bytes.clone();
        wrong[at..at + 8].copy_from_slice(&value.to_le_bytes());
        assert!(ClipImportance::from_bytes(&wrong).is_none());
    }
}

fn times(frames: usize) -> Vec<f64> {
    (0..frames).map(|f| f as f64 / 30.0).collect()
}

fn solve(
    importance: &ClipImportance,
    shots: &[Range<usize>],
    motion: &[Similarity2],
    out: (usize, usize),
) -> ClipGrids {
    let times_s = times(shots.last().expect("a shot").end);
    let clip = ClipData { size: SIZE, times_s: &times_s, shots, motion, shown_from_src: &[], judged: None };
    retarget_clip(&clip, importance, out, &ClipRetargetOptions::default(), &Run::default()).expect("it can be solved")
}

fn still(frames: usize) -> Vec<Similarity2> {
    vec![Similarity2::IDENTITY; frames]
}

#[test]
fn constant_importance_gives_a_constant_grid() {
    for out in [TALL, (1080, 1080), (1920, 400), (1000, 1080)] {
        let whole = 0..150;
        let grids = solve(&moments(150, |_| 0.7), std::slice::from_ref(&whole), &still(150), out);
        let first = grids.frame(0);
        for frame in 1..160 {
            let now = grids.frame(frame);
            assert_eq!(now.window, first.window, "{out:?}, frame {frame}");
            let off = now.x.iter().zip(&first.x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-6, "{out:?}, frame {frame}: {off}");
        }
    }
}

#[test]
fn the_window_follows_important_objects_without_a_jerk() {
    // It rests, walks across the picture in four seconds, and rests again.
    let place = |f: usize| 0.2 + 0.6 * ((f as f64 - 120.0) / 120.0).clamp(0.0, 1.0);
    let whole = 0..360;
    let grids = solve(&moments(360, place), std::slice::from_ref(&whole), &still(360), TALL);
    let windows: Vec<Rect> = (0..360).map(|f| grids.frame(f).window).collect();
    for (f, window) in windows.iter().enumerate() {
        let x = place(f) * 1920.0;
        assert!(window.min.x + 40.0 < x && x < window.max.x - 40.0, "frame {f}: {x} in {window:?}");
        assert!(window.min.x >= 0.0 && window.max.x <= 1920.0 + 1e-9 && window.height() == 1080.0);
    }
    let starts: Vec<f64> = windows.iter().map(|w| w.min.x).collect();
    let speed: Vec<f64> = starts.windows(2).map(|s| s[1] - s[0]).collect();
    let fastest = speed.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let jerkiest = speed.windows(2).map(|v| (v[1] - v[0]).abs()).fold(0.0, f64::max);
    assert!(fastest < 0.4 * 1920.0 / 30.0 * 1.001, "{fastest} px per frame");
    assert!(jerkiest < 0.6, "{jerkiest} px per frame²");
    assert!(speed[..60].iter().chain(&speed[300..]).all(|v| v.abs() < 0.35), "it rests where what matters rests");
}

#[test]
fn flicker_does_not_move_the_window() {
    let noise = |f: usize| 0.5 + 0.02 * if f.is_multiple_of(10) { 1.0 } else { -1.0 };
    let whole = 0..150;
    let grids = solve(&moments(150, noise), std::slice::from_ref(&whole), &still(150), TALL);
    let starts: Vec<f64> = (0..150).map(|f| grids.frame(f).window.min.x).collect();
    let (least, most) =
        (starts.iter().copied().fold(f64::MAX, f64::min), starts.iter().copied().fold(f64::MIN, f64::max));
    assert!(most - least < 2.0, "it wanders by {} px", most - least);
}

#[test]
fn importance_is_carried_along_the_camera() {
    // Judged once, at the first moment; then the camera pans to the left, the scene moves to the right.
    let pan = Similarity2 { t: Vec2::new(4.0, 0.0), ..Similarity2::IDENTITY };
    let mut importance = ClipImportance::new(SIZE);
    importance.push(0, &spot(0.3, 0.5));
    importance.push(15, &Importance::from_plane(Plane::from_fn(4, 4, |_, _| 0.1)).expect("in [0, 1]"));
    let (times_s, whole) = (times(16), 0..16);
    let clip =
        ClipData { size: SIZE, times_s: &times_s, shots: &[], motion: &[pan; 16], shown_from_src: &[], judged: None };
    let at = |clip: &ClipData<'_>| {
        let followed = Followed::new(clip, &importance, &whole, 0.4);
        let profile = strip_profile(&followed.moments[1], true, 96);
        let mut sorted = profile.clone();
        sorted.sort_by(f64::total_cmp);
        let (mut sum, mut total) = (0.0, 0.0);
        for (i, v) in profile.iter().enumerate() {
            let above = (v - 1.2 * sorted[48]).max(0.0);
            sum += (i as f64 + 0.5) / 96.0 * above;
            total += above;
        }
        sum / total * 1920.0
    };
    assert!((at(&clip) - (0.3 * 1920.0 + 60.0)).abs() < 8.0, "{}", at(&clip));
    // What shows the source shows its importance too.
    let shown = [Similarity2 { t: Vec2::new(-100.0, 0.0), ..Similarity2::IDENTITY }.to_homography(); 16];
    let steadied = at(&ClipData { shown_from_src: &shown, ..clip });
    assert!((steadied - (0.3 * 1920.0 - 40.0)).abs() < 8.0, "{steadied}");
}

#[test]
fn shots_know_nothing_of_each_other() {
    let place = |f: usize| if f < 60 { 0.2 } else { 0.8 };
    let both = solve(&moments(120, place), &[0..60, 60..120], &still(120), TALL);
    let whole = 0..60;
    let alone = solve(&moments(60, |_| 0.2), std::slice::from_ref(&whole), &still(60), TALL);
    for f in 0..60 {
        assert_eq!(both.frame(f), alone.frame(f), "frame {f}");
    }
    assert!(both.frame(60).window.min.x - both.frame(59).window.min.x > 500.0, "a cut is a cut");
}

#[test]
fn a_shot_without_a_moment_keeps_the_middle() {
    let grids = solve(&moments(60, |_| 0.2), &[0..60, 60..63], &still(63), TALL);
    let window = grids.frame(61).window;
    assert!((window.center().x - 960.0).abs() < 10.0, "{window:?}");
    assert_eq!(
        solve(&ClipImportance::new(SIZE), std::slice::from_ref(&(0..1)), &still(1), TALL).frame(0).window.height(),
        1080.0
    );
}

#[test]
fn the_map_goes_through_the_edges_of_rows_and_columns_and_its_jacobian_is_its_derivative() {
    let whole = 0..30;
    let grid = solve(&moments(30, |_| 0.4), std::slice::from_ref(&whole), &still(30), (900, 700)).frame(7);
    let (map, n) = (grid.map(), grid.x.len() - 1);
    for (i, x) in grid.x.iter().enumerate() {
        let src = map.map(Point2::new(*x, 0.0)).expect("defined");
        let expected = grid.window.min.x + grid.window.width() * i as f64 / n as f64;
        assert!((src.x - expected).abs() < 1e-9 * 1920.0 && (src.y - grid.window.min.y).abs() < 1e-9);
    }
    for p in
        [(-20.0, 900.0), (13.0, 77.0), (450.3, 350.2), (899.0, 699.0), (950.0, -3.0)].map(|(x, y)| Point2::new(x, y))
    {
        let j = map.jacobian(p).expect("defined");
        for (k, d) in [Vec2::new(1e-4, 0.0), Vec2::new(0.0, 1e-4)].into_iter().enumerate() {
            let numeric = (map.map(p + d).expect("defined") - map.map(p - d).expect("defined")) / 2e-4;
            assert!((j.column(k) - numeric).norm() < 1e-5, "{p}: {} against {numeric}", j.column(k));
        }
    }
}

#[test]
fn impossible_sizes_and_options_are_refused() {
    let (times_s, importance) = (times(10), moments(10, |_| 0.5));
    let clip = ClipData {
        size: SIZE,
        times_s: &times_s,
        shots: std::slice::from_ref(&(0..10)),
        motion: &[],
        shown_from_src: &[],
        judged: None,
    };
    let refused = |out, options| {
        retarget_clip(&clip, &importance, out, &options, &Run::default()).expect_err("refused").to_string()
    };
    let options = ClipRetargetOptions::default();
    assert!(refused((0, 5), options).contains("target size 0×5"));
    assert!(refused(TALL, ClipRetargetOptions { crop_below: f64::NAN, ..options }).contains("crop_below NaN"));
    assert!(refused(TALL, ClipRetargetOptions { min_scale: 1.0, ..options }).contains("min_scale 1"));
    assert!(refused(TALL, ClipRetargetOptions { follow_s: 0.0, ..options }).contains("follow_s 0"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn any_clip_has_grids_without_folds_exact_borders_and_windows_inside(
        seed in 0..u64::MAX, width in 64..3000_usize, height in 64..3000_usize,
    ) {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut importance = ClipImportance::new(SIZE);
        for frame in (0..60).step_by(4) {
            let plane = Plane::from_fn(48, 27, |_, _| rng.f32().powi(3));
            importance.push(frame, &Importance::from_plane(plane).expect("in [0, 1]"));
        }
        let motion: Vec<Similarity2> = (0..60)
            .map(|_| Similarity2 { t: Vec2::new(30.0 * rng.f64() - 15.0, 10.0 * rng.f64()), ..Similarity2::IDENTITY })
            .collect();
        let grids = solve(&importance, &[0..23, 23..60], &motion, (width, height));
        for frame in 0..60 {
            let grid = grids.frame(frame);
            let mesh = grid.mesh();
            prop_assert_eq!(mesh.folded_cells(), 0);
            prop_assert_eq!(mesh.vertices[0], Point2::origin());
            prop_assert_eq!(mesh.vertices[mesh.vertices.len() - 1], Point2::new(width as f64, height as f64));
            prop_assert!(grid.window.min.x >= 0.0 && grid.window.max.x <= 1920.0 && grid.window.max.y <= 1080.0);
            let map = grid.map();
            for k in 0..200 {
                let p = Point2::new(width as f64 * k as f64 / 199.0, height as f64 * k as f64 / 199.0);
                let j = map.jacobian(p).expect("defined");
                prop_assert!(j[(0, 0)] > 0.0 && j[(1, 1)] > 0.0, "{} at {}", j, p);
            }
        }
    }
}
