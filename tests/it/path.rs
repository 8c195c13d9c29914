//! Laws of the virtual path, on motion made here.

use plumbline::num::math::{Point2, Similarity2, Vec2};
use plumbline::num::run::Run;
use plumbline::video::path::{Clip, InterFrame, PathKind, PathOptions, SegmentOutcome, VirtualPath, Zoom, plan};

const SIZE: (u32, u32) = (640, 360);
const FPS: f64 = 30.0;
const KINDS: [PathKind; 5] =
    [PathKind::Optimal, PathKind::Gaussian, PathKind::Linear, PathKind::Parabolic, PathKind::Tripod];

/// A camera path by its pose per frame: position of the scene in the frame, px, angle, log of scale.
#[derive(Clone, Copy)]
struct View {
    x: f64,
    y: f64,
    angle: f64,
    zoom: f64,
}

impl View {
    fn frame_from_scene(self, size: (u32, u32)) -> Similarity2 {
        let unit = f64::from(size.0) / f64::from(SIZE.0);
        let center = Point2::new(f64::from(size.0) / 2.0, f64::from(size.1) / 2.0);
        Similarity2::about(center, self.angle, self.zoom.exp(), Vec2::new(self.x, self.y) * unit)
    }
}

fn motion(views: &[View], size: (u32, u32)) -> Vec<InterFrame> {
    let step = |pair: &[View]| {
        let before = pair[0].frame_from_scene(size).inverse().expect("scale > 0");
        pair[1].frame_from_scene(size) * before
    };
    std::iter::once(Similarity2::IDENTITY)
        .chain(views.windows(2).map(step))
        .map(|similarity| InterFrame { similarity, homography: similarity.to_homography(), reliable: true })
        .collect()
}

fn plan_of(views: &[View], options: &PathOptions) -> VirtualPath {
    plan_steps(&motion(views, SIZE), SIZE, options)
}

fn plan_steps(motion: &[InterFrame], (width, height): (u32, u32), options: &PathOptions) -> VirtualPath {
    let times_s: Vec<f64> = (0..motion.len()).map(|t| t as f64 / FPS).collect();
    let shot = 0..motion.len();
    let shots = std::slice::from_ref(&shot);
    plan(&Clip { width, height, times_s: &times_s, motion, shots, beyond: &[] }, options, &Run::default())
        .expect("a valid clip")
}

/// A walk: drift, steps at 1.9 Hz, tremor, all from a seeded generator.
fn walk(frames: usize, strength: f64, seed: u64) -> Vec<View> {
    let mut random = fastrand::Rng::with_seed(seed);
    let phase = random.f64() * 6.0;
    let mut jitter = move || random.f64() - 0.5;
    (0..frames)
        .map(|t| {
            let s = t as f64 / FPS;
            let step = std::f64::consts::TAU * 1.9 * s + phase;
            View {
                x: 25.0 * s + strength * (8.0 * (step / 2.0).sin() + 4.0 * jitter()),
                y: 6.0 * (0.5 * s).sin() + strength * (6.0 * step.cos() + 4.0 * jitter()),
                angle: strength * (0.012 * (step / 2.0).cos() + 0.004 * jitter()),
                zoom: 0.01 * s + strength * 0.003 * jitter(),
            }
        })
        .collect()
}

/// `out_from_src` of frame `t` as it acts on points of the output: source px.
fn source_of(path: &VirtualPath, t: usize, out: Point2) -> Point2 {
    path.out_from_src[t].inverse().and_then(|h| h.apply(out)).expect("similarities are invertible")
}

fn window(path: &VirtualPath, t: usize, (w, h): (u32, u32)) -> [Point2; 4] {
    let (w, h) = (f64::from(w), f64::from(h));
    [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)].map(|(x, y)| source_of(path, t, Point2::new(x, y)))
}

/// Largest distance between the windows of two paths, px.
fn distance(a: &VirtualPath, b: &VirtualPath, size: (u32, u32)) -> f64 {
    let apart = |t| {
        let pairs = window(a, t, size).into_iter().zip(window(b, t, size));
        pairs.map(|(p, q)| (p - q).norm()).fold(0.0, f64::max)
    };
    (0..a.crop.len()).map(apart).fold(0.0, f64::max)
}

/// Scene point seen at the output's center, per frame: the viewer's path.
fn seen(path: &VirtualPath, views: &[View]) -> Vec<Vec2> {
    let center = Point2::new(f64::from(SIZE.0) / 2.0, f64::from(SIZE.1) / 2.0);
    let scene =
        |t: usize| views[t].frame_from_scene(SIZE).inverse().expect("scale > 0").apply(source_of(path, t, center));
    (0..views.len()).map(|t| scene(t).coords).collect()
}

/// RMS of second differences.
fn acceleration(path: &[Vec2]) -> f64 {
    let squares = path.windows(3).map(|p| (p[2] - 2.0 * p[1] + p[0]).norm_squared());
    (squares.sum::<f64>() / (path.len() - 2) as f64).sqrt()
}

fn every_kind() -> Vec<PathOptions> {
    let mut all = Vec::new();
    for kind in KINDS {
        for zoom in [Zoom::Fixed, Zoom::Adaptive] {
            for keep in [0.75, 0.95] {
                all.push(PathOptions { kind, zoom, keep, ..PathOptions::default() });
            }
        }
    }
    all
}

#[test]
fn the_crop_window_is_inside_every_frame() {
    for strength in [0.5, 4.0] {
        let views = walk(200, strength, 1);
        for options in every_kind() {
            let path = plan_of(&views, &options);
            for t in 0..views.len() {
                for p in window(&path, t, SIZE) {
                    let inside = (-1e-9..=640.0 + 1e-9).contains(&p.x) && (-1e-9..=360.0 + 1e-9).contains(&p.y);
                    assert!(inside, "{options:?}: frame {t} shows source point {p}");
                }
                assert!(path.crop[t] >= options.keep - 1e-4, "{options:?}: crop {} at frame {t}", path.crop[t]);
            }
        }
    }
}

#[test]
fn where_the_border_may_show_the_picture_keeps_its_scale_and_its_middle_is_covered() {
    let views = walk(200, 3.0, 2);
    for kind in KINDS {
        let options = PathOptions { kind, border_allows_outside: true, zoom: Zoom::None, ..PathOptions::default() };
        let path = plan_of(&views, &options);
        let mut leaves = false;
        for t in 0..views.len() {
            for (x, y) in [(0.1, 0.1), (0.9, 0.1), (0.9, 0.9), (0.1, 0.9)] {
                let p = source_of(&path, t, Point2::new(x * 640.0, y * 360.0));
                assert!(
                    (-1e-9..=640.000_000_001).contains(&p.x) && (-1e-9..=360.000_000_001).contains(&p.y),
                    "{kind:?} {t}: {p}"
                );
            }
            assert!((path.crop[t] - 1.0).abs() < 0.02, "{kind:?}: scale {}", path.crop[t]);
            leaves |= window(&path, t, SIZE).iter().any(|p| p.x < -1.0);
        }
        assert!(leaves, "{kind:?} never used the border");
    }
}

#[test]
fn a_steady_pan_and_a_still_camera_come_out_unchanged() {
    let pan =
        |v: f64| (0..90).map(move |t| View { x: v * f64::from(t), y: 0.3 * v * f64::from(t), angle: 0.0, zoom: 0.0 });
    for speed in [0.0, 0.5, 9.0] {
        for kind in [PathKind::Optimal, PathKind::Gaussian, PathKind::Linear, PathKind::Parabolic] {
            let views: Vec<View> = pan(speed).collect();
            let path = plan_of(&views, &PathOptions { kind, ..PathOptions::default() });
            assert!(path.crop.iter().all(|c| *c == 1.0), "{kind:?} at {speed} px per frame");
            assert_eq!(path.segments[0].outcome, SegmentOutcome::Unchanged);
            assert_eq!(path.segments[0].reason, "already steady");
        }
    }
}

#[test]
fn shake_on_a_steady_pan_is_removed_and_the_pan_kept() {
    let views: Vec<View> =
        walk(240, 1.0, 3).iter().enumerate().map(|(t, v)| View { x: v.x + 2.0 * t as f64, ..*v }).collect();
    let path = plan_of(&views, &PathOptions::default());
    let still: Vec<Vec2> = views
        .iter()
        .map(|v| v.frame_from_scene(SIZE).inverse().expect("scale > 0").apply(Point2::new(320.0, 180.0)).coords)
        .collect();
    let (before, after) = (acceleration(&still), acceleration(&seen(&path, &views)));
    assert!(after < 0.05 * before, "acceleration {before} became {after}");
    let travel = |p: &[Vec2]| (p[200] - p[40]).x;
    let ratio = travel(&seen(&path, &views)) / travel(&still);
    assert!((ratio - 1.0).abs() < 0.1, "the pan's length changed by {ratio}");
}

#[test]
fn the_resolution_scales_the_path_and_nothing_else() {
    let views = walk(120, 1.0, 4);
    let options = PathOptions::default();
    let small = plan_of(&views, &options);
    let large = plan_steps(&motion(&views, (1920, 1080)), (1920, 1080), &options);
    for t in 0..views.len() {
        for (p, q) in window(&small, t, SIZE).into_iter().zip(window(&large, t, (1920, 1080))) {
            assert!((p * 3.0 - q).norm() < 0.02, "frame {t}: {p} against {q}");
        }
    }
}

#[test]
fn a_film_run_backwards_gets_the_same_path_backwards() {
    // Displacements only: turned frames measure the same residual in axes that differ by one step's rotation.
    let views: Vec<View> = walk(150, 1.0, 5).iter().map(|v| View { angle: 0.0, zoom: 0.0, ..*v }).collect();
    let backwards: Vec<View> = views.iter().rev().copied().collect();
    let (forward, mut reversed) =
        (plan_of(&views, &PathOptions::default()), plan_of(&backwards, &PathOptions::default()));
    reversed.out_from_src.reverse();
    reversed.crop.reverse();
    let apart = distance(&forward, &reversed, SIZE);
    assert!(apart < 0.05, "{apart} px");
}

#[test]
fn shots_do_not_know_of_each_other() {
    let (a, b) = (motion(&walk(90, 1.0, 6), SIZE), motion(&walk(120, 2.0, 7), SIZE));
    let options = PathOptions::default();
    let (alone_a, alone_b) = (plan_steps(&a, SIZE, &options), plan_steps(&b, SIZE, &options));
    let mut both = a;
    // What a tracker reports across the cut must not matter.
    both.push(InterFrame { similarity: Similarity2::about(Point2::origin(), 2.0, 3.0, Vec2::new(900.0, 5.0)), ..b[0] });
    both.extend(&b[1..]);
    let times_s: Vec<f64> = (0..210).map(|t| f64::from(t) / FPS).collect();
    let clip =
        Clip { width: 640, height: 360, times_s: &times_s, motion: &both, shots: &[0..90, 90..210], beyond: &[] };
    let together = plan(&clip, &options, &Run::default()).expect("a valid clip");
    let (first, second) = together.out_from_src.split_at(90);
    let near = |x: &[plumbline::num::math::Homography], y: &VirtualPath| {
        x.iter().zip(&y.out_from_src).all(|(p, q)| (p.matrix() - q.matrix()).abs().max() < 1e-3)
    };
    assert!(near(first, &alone_a) && near(second, &alone_b));
    assert_eq!(together.segments.len(), 2);
}

#[test]
fn the_size_of_the_window_changes_slowly_or_not_at_all() {
    let mut views = walk(300, 0.3, 8);
    let wild = walk(300, 4.0, 9);
    views[120..180].copy_from_slice(&wild[120..180]);
    let fixed = plan_of(&views, &PathOptions { zoom: Zoom::Fixed, ..PathOptions::default() });
    let spread = fixed.crop.iter().fold((1.0_f64, 0.0_f64), |(lo, hi), c| (lo.min(*c), hi.max(*c)));
    assert!(spread.1 - spread.0 < 0.01, "fixed zoom ran over {spread:?}");
    let adaptive = plan_of(&views, &PathOptions::default());
    let fastest = adaptive.crop.windows(2).map(|c| (c[1] - c[0]).abs() * FPS).fold(0.0, f64::max);
    assert!(fastest < 0.04, "the zoom ran at {fastest} per second");
    let mean = |c: &[f64]| c.iter().sum::<f64>() / c.len() as f64;
    assert!(mean(&adaptive.crop[270..]) > mean(&adaptive.crop[130..170]) + 0.02, "calm passages should show more");
}

#[test]
fn a_tripod_shows_no_motion_while_the_frame_allows_it() {
    let views: Vec<View> =
        walk(200, 1.0, 10).iter().enumerate().map(|(t, v)| View { x: v.x - 25.0 * t as f64 / FPS, ..*v }).collect();
    let path = plan_of(&views, &PathOptions { kind: PathKind::Tripod, ..PathOptions::default() });
    let still = seen(&path, &views);
    for p in &still {
        assert!((p - still[0]).norm() < 1e-6, "moved by {}", (p - still[0]).norm());
    }
}

#[test]
fn on_a_line_the_viewer_moves_evenly_and_on_a_parabola_evenly_faster() {
    let views = walk(200, 0.7, 10);
    let options = |kind| PathOptions { kind, keep: 0.6, ..PathOptions::default() };
    let (line, parabola) = (PathKind::Linear, PathKind::Parabolic);
    let [line, parabola] = [line, parabola].map(|kind| seen(&plan_of(&views, &options(kind)), &views));
    let change = |path: &[Vec2]| path.windows(2).map(|p| p[1] - p[0]).collect::<Vec<Vec2>>();
    let (speed, faster) = (change(&line), change(&change(&parabola)));
    for of in [&speed, &faster] {
        assert!(of.iter().all(|v| (v - of[0]).norm() < 1e-6), "from {} to {}", of[0], of[of.len() - 1]);
    }
    assert!((speed[0].x + 25.0 / FPS).abs() < 0.3 && faster[0].norm() > 1e-5, "the camera's own drift is kept");
}

#[test]
fn under_a_locked_horizon_the_picture_does_not_rotate_while_the_frame_allows_it() {
    let views: Vec<View> =
        walk(200, 1.0, 14).iter().enumerate().map(|(t, v)| View { x: v.x - 25.0 * t as f64 / FPS, ..*v }).collect();
    for kind in KINDS {
        let path = plan_of(&views, &PathOptions { kind, horizon_lock: true, keep: 0.6, ..PathOptions::default() });
        assert_eq!(path.segments[0].outcome, SegmentOutcome::Smoothed, "{kind:?}: {}", path.segments[0].reason);
        let angle = |t: usize| {
            let from = views[t].frame_from_scene(SIZE).inverse().expect("scale > 0");
            let across = from.apply(source_of(&path, t, Point2::new(640.0, 180.0)))
                - from.apply(source_of(&path, t, Point2::new(0.0, 180.0)));
            across.y.atan2(across.x)
        };
        let angles: Vec<f64> = (0..views.len()).map(angle).collect();
        let turned = angles.iter().map(|a| (a - angles[0]).abs()).fold(0.0, f64::max);
        assert!(turned < 1e-9, "{kind:?}: turned by {turned}");
        assert!(path.crop.iter().all(|c| *c >= 0.6), "{kind:?}");
        let free = plan_of(&views, &PathOptions { kind: PathKind::Optimal, ..PathOptions::default() });
        assert!(distance(&path, &free, SIZE) > 1.0);
    }
}

#[test]
fn a_horizon_that_the_frame_cannot_level_is_leveled_as_far_as_it_goes() {
    let steep: Vec<View> = walk(150, 1.0, 4).into_iter().map(|v| View { angle: 20.0 * v.angle, ..v }).collect();
    for kind in KINDS {
        let path = plan_of(&steep, &PathOptions { kind, horizon_lock: true, ..PathOptions::default() });
        for t in 0..steep.len() {
            assert!(path.crop[t] >= 0.8 - 1e-6, "{kind:?}: a window of {}", path.crop[t]);
            for p in window(&path, t, SIZE) {
                let inside = (-1e-6..=640.000_001).contains(&p.x) && (-1e-6..=360.000_001).contains(&p.y);
                assert!(inside, "{kind:?} {t}: {p}");
            }
        }
    }
}

#[test]
fn no_window_is_smaller_than_allowed_however_the_camera_rotates_and_zooms() {
    let drifting = |strength: f64, turn: f64, zoom: f64| -> Vec<View> {
        let share = |t: usize| t as f64 / 150.0 - 0.5;
        let moved =
            |(t, v): (usize, View)| View { angle: v.angle + turn * share(t), zoom: v.zoom + zoom * share(t), ..v };
        walk(150, strength, 4).into_iter().map(|v| View { x: 0.2 * v.x, ..v }).enumerate().map(moved).collect()
    };
    for (views, kind) in
        [drifting(2.0, 0.9, 0.6), drifting(0.3, 0.0, 0.24)].iter().flat_map(|views| KINDS.map(|kind| (views, kind)))
    {
        let path = plan_of(views, &PathOptions { kind, keep: 0.8, ..PathOptions::default() });
        assert_eq!(path.segments[0].outcome, SegmentOutcome::Smoothed, "{kind:?}: {}", path.segments[0].reason);
        let least = path.crop.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(least >= 0.8 - 1e-6, "{kind:?}: a window of {least}");
    }
}

#[test]
fn a_few_lost_frames_are_bridged() {
    let views = walk(150, 1.0, 11);
    let whole = plan_of(&views, &PathOptions::default());
    let mut steps = motion(&views, SIZE);
    for lost in [60, 61, 62] {
        steps[lost].reliable = false;
        steps[lost].similarity = Similarity2 { a: f64::NAN, ..Similarity2::IDENTITY };
    }
    let bridged = plan_steps(&steps, SIZE, &PathOptions::default());
    assert!(bridged.out_from_src.iter().all(plumbline::num::math::Homography::is_finite));
    let apart = distance(&whole, &bridged, SIZE);
    assert!(apart < 25.0, "{apart} px for three lost steps");
}

#[test]
fn a_clip_that_cannot_be_followed_is_left_as_it_is_and_says_so() {
    let mut steps = motion(&walk(100, 1.0, 12), SIZE);
    steps.iter_mut().skip(20).for_each(|s| s.reliable = false);
    let path = plan_steps(&steps, SIZE, &PathOptions::default());
    assert!(path.crop.iter().all(|c| *c == 1.0));
    assert_eq!(path.segments[0].reason, "motion could be followed in only 19 of 99 frames");
}

#[test]
fn uneven_timestamps_of_an_even_pan_are_no_shake() {
    let mut random = fastrand::Rng::with_seed(13);
    let mut time = 0.0;
    let times_s: Vec<f64> = (0..120)
        .map(|_| {
            time += if random.bool() { 1.0 / 30.0 } else { 1.0 / 15.0 };
            time
        })
        .collect();
    let tremble = |t: f64| 3.0 * (9.0 * t).sin();
    let views: Vec<View> =
        times_s.iter().map(|&t| View { x: 150.0 * t, y: tremble(t), angle: 0.0, zoom: 0.0 }).collect();
    let (steps, shot) = (motion(&views, SIZE), 0..120);
    let clip = Clip {
        width: 640,
        height: 360,
        times_s: &times_s,
        motion: &steps,
        shots: std::slice::from_ref(&shot),
        beyond: &[],
    };
    let path = plan(&clip, &PathOptions::default(), &Run::default()).expect("a valid clip");
    let seen_x: Vec<f64> = seen(&path, &views).iter().map(|p| p.x).collect();
    let off = (2..118).map(|t| (seen_x[t] - seen_x[2] + 150.0 * (times_s[t] - times_s[2])).abs()).fold(0.0, f64::max);
    assert!(off < 3.0, "the pan was bent by {off} px");
}

#[test]
fn invalid_requests_say_what_is_allowed() {
    let (steps, shot) = (motion(&walk(10, 1.0, 14), SIZE), 0..10);
    let times_s: Vec<f64> = (0..10).map(f64::from).collect();
    let clip = Clip {
        width: 640,
        height: 360,
        times_s: &times_s,
        motion: &steps,
        shots: std::slice::from_ref(&shot),
        beyond: &[],
    };
    let message = |clip: &Clip<'_>, o: PathOptions| plan(clip, &o, &Run::default()).expect_err("invalid").to_string();
    let d = PathOptions::default();
    let cases = [
        (message(&clip, PathOptions { keep: f64::NAN, ..d }), "keep NaN is invalid (expected 0.3 to 1)"),
        (message(&clip, PathOptions { smoothness_s: 60.0, ..d }), "smoothness 60 is invalid (expected 0.05 to 30)"),
        (message(&Clip { height: 0, ..clip }, d), "frame size 640x0 is invalid (expected at least 1x1)"),
        (
            message(&Clip { shots: &[0..4, 5..10], ..clip }, d),
            "the clip has 10 timestamps, 10 motions and shots that cover 0 frames: expected equal numbers and shots in order",
        ),
        (
            message(&clip, PathOptions { zoom: Zoom::None, ..d }),
            "zoom `none` leaves no room to move the picture: allow the border to show, or choose zoom `fixed` or `adaptive`",
        ),
    ];
    for (got, expected) in cases {
        assert_eq!(got, expected);
    }
}

#[test]
fn a_sideways_shake_gets_the_path_of_the_independent_bounded_least_squares_reference() {
    // Constants printed by tests/oracle/path.py.
    let expected = [
        (0, -26.166_819),
        (10, 28.188_126),
        (25, -6.719_213),
        (40, 32.0),
        (60, 8.591_549),
        (77, -14.296_363),
        (95, 9.482_054),
        (119, 9.681_799),
    ];
    let x = |t: f64| 45.0 * (0.21 * t).sin() + 12.0 * (1.3 * t).sin() + 2.0 * t;
    let views: Vec<View> = (0..120).map(|t| View { x: x(f64::from(t)), y: 0.0, angle: 0.0, zoom: 0.0 }).collect();
    let options = PathOptions { keep: 0.9, zoom: Zoom::None, border_allows_outside: true, ..PathOptions::default() };
    let path = plan_of(&views, &options);
    for (t, p) in expected {
        let got = source_of(&path, t, Point2::new(320.0, 180.0)).x - 320.0;
        assert!((got - p).abs() < 0.02, "frame {t}: {got} against {p}");
    }
}
