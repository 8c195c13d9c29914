//! Laws of the inter-frame motion, on scenes whose motion is known.

use std::ops::Range;

use plumbline::num::math::{Homography, Point2, Similarity2, Vec2};
use plumbline::num::time::{Timebase, Timestamp};
use plumbline::video::motion::{
    self, ClipMotion, FrameMotion, FrameScale, MotionEstimator, MotionModel, MotionQuality, Pair, PlanarModel,
    ReadoutEstimator, RowMotion,
};
use plumbline::video::track::{FrameQuality, FrameTracks, Observation};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 360;

/// Points spread over a rectangle of the frame, px.
fn scatter(n: usize, x: Range<f64>, y: Range<f64>, seed: u64) -> Vec<Point2> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut at = |r: &Range<f64>| r.start + rng.f64() * (r.end - r.start);
    (0..n).map(|_| Point2::new(at(&x), at(&y))).collect()
}

fn whole_frame(n: usize, seed: u64) -> Vec<Point2> {
    scatter(n, 5.0..635.0, 5.0..355.0, seed)
}

fn pairs(points: &[Point2], map: impl Fn(Point2) -> Point2) -> Vec<Pair> {
    points.iter().map(|&p| Pair { previous: p, this: map(p) }).collect()
}

fn perspective() -> Homography {
    Homography::new(nalgebra::Matrix3::new(1.01, 0.012, 4.0, -0.008, 0.995, -3.0, 1.2e-5, -2.0e-5, 1.0))
}

/// A hand's jerks, up to about 6 px and 0.4 degrees from frame to frame.
fn shake(frame: usize) -> Similarity2 {
    let t = frame as f64;
    let shift = Vec2::new(4.0 * (0.9 * t).sin() + 1.5 * (2.3 * t).cos(), 3.0 * (1.1 * t + 0.4).sin() + (1.9 * t).sin());
    Similarity2::about(Point2::new(320.0, 180.0), 0.006 * (0.7 * t).sin(), 1.0 + 0.002 * (0.5 * t).cos(), shift)
}

fn ticks(n: usize) -> Timestamp {
    Timestamp(i64::try_from(n).expect("test clips are short"))
}

fn observe(id: usize, p: Point2) -> Observation {
    Observation { id: id as u32, x: p.x as f32, y: p.y as f32, background: true }
}

fn push(estimator: &mut MotionEstimator, frame: usize, points: &[Observation]) -> FrameMotion {
    push_flagged(estimator, frame, points, FrameQuality::default())
}

fn push_flagged(
    estimator: &mut MotionEstimator,
    frame: usize,
    points: &[Observation],
    quality: FrameQuality,
) -> FrameMotion {
    estimator.push(&FrameTracks { pts: ticks(frame), observations: points.to_vec(), quality })
}

fn estimator() -> MotionEstimator {
    MotionEstimator::new(WIDTH, HEIGHT)
}

/// Largest distance between two maps over the frame's corners and center, px.
pub(crate) fn gap(a: &Homography, b: &Homography) -> f64 {
    let probes = [(0.0, 0.0), (640.0, 0.0), (0.0, 360.0), (640.0, 360.0), (320.0, 180.0)];
    let at = |h: &Homography, (x, y)| h.apply(Point2::new(x, y)).expect("maps of the whole frame");
    probes.iter().map(|&p| (at(a, p) - at(b, p)).norm()).fold(0.0, f64::max)
}

#[test]
fn noiseless_motion_is_recovered_exactly() {
    let points = whole_frame(40, 1);
    let weights = vec![1.0; 40];
    let scale = FrameScale::new(WIDTH, HEIGHT);
    let s = shake(3);
    let found = motion::similarity(&pairs(&points, |p| s.apply(p)), &weights).expect("40 points");
    assert!(gap(&found.to_homography(), &s.to_homography()) < 1e-9);
    let h = perspective();
    let exact = pairs(&points, |p| h.apply(p).expect("in front"));
    let refined = motion::homography(&exact, &weights, &Homography::identity(), 0.0, &scale, 20).expect("regular");
    assert!(gap(&refined, &h) < 1e-9, "least squares: {}", gap(&refined, &h));
    let corners = [0, 7, 20, 33].map(|k| exact[k]);
    let four = motion::homography_of_four(corners, &scale).expect("general position");
    assert!(gap(&four, &h) < 1e-6, "four points: {}", gap(&four, &h));
}

#[test]
fn points_on_a_line_determine_no_homography() {
    let line: Vec<Point2> = (0..20).map(|k| Point2::new(10.0 * f64::from(k), 5.0 * f64::from(k) + 3.0)).collect();
    let on_line = pairs(&line, |p| p + Vec2::new(1.0, 2.0));
    let four = [0, 5, 11, 19].map(|k| on_line[k]);
    assert!(motion::homography_of_four(four, &FrameScale::new(WIDTH, HEIGHT)).is_none());
    assert!(
        motion::similarity(&pairs(&[Point2::new(1.0, 1.0); 5], |p| p), &[1.0; 5]).is_none(),
        "one point five times"
    );
}

#[test]
fn the_prior_pulls_unsupported_perspective_towards_a_similarity() {
    let scale = FrameScale::new(WIDTH, HEIGHT);
    let h = perspective();
    let exact = pairs(&whole_frame(40, 1), |p| h.apply(p).expect("in front"));
    let weights = vec![1.0 / 40.0; 40];
    let bend = |kappa: f64| {
        let fit = motion::homography(&exact, &weights, &Homography::identity(), kappa, &scale, 20).expect("regular");
        let m = scale.normalized_map(&fit);
        (m[(0, 0)] - m[(1, 1)]).hypot(m[(0, 1)] + m[(1, 0)]).hypot(m[(2, 0)]).hypot(m[(2, 1)])
    };
    assert!(bend(0.1) < 0.9 * bend(0.0) && bend(10.0) < 0.05 * bend(0.0) && bend(1e4) < 1e-4);
}

#[test]
fn constant_motion_is_measured_in_every_frame() {
    let step = Similarity2::about(Point2::new(320.0, 180.0), 0.002, 1.001, Vec2::new(2.0, -1.0));
    let mut points = whole_frame(200, 2);
    let mut estimator = estimator();
    for frame in 0..10 {
        let seen: Vec<Observation> = points.iter().enumerate().map(|(id, p)| observe(id, *p)).collect();
        let m = push(&mut estimator, frame, &seen);
        if frame > 0 {
            // Positions are stored as f32: half a unit in the last place at 640 px is 3e-5 px.
            assert!(gap(&m.homography, &step.to_homography()) < 1e-4, "frame {frame}");
            assert!(gap(&m.similarity.to_homography(), &step.to_homography()) < 1e-4, "frame {frame}");
            assert_eq!((m.quality, m.model), (MotionQuality::Measured, PlanarModel::Similarity));
            assert!(m.coverage > 0.6 && m.inliers == 200, "{m:?}");
        }
        for p in &mut points {
            *p = step.apply(*p);
        }
    }
}

#[test]
fn supported_perspective_is_kept() {
    let points = whole_frame(300, 4);
    let mut estimator = estimator();
    push(&mut estimator, 0, &points.iter().enumerate().map(|(id, p)| observe(id, *p)).collect::<Vec<_>>());
    let h = perspective();
    let seen = points.iter().enumerate().map(|(id, p)| observe(id, h.apply(*p).expect("in front")));
    let m = push(&mut estimator, 1, &seen.collect::<Vec<_>>());
    assert_eq!(m.model, PlanarModel::Homography);
    // The prior on perspective costs something even where the points are exact.
    assert!(gap(&m.homography, &h) < 0.01, "{}", gap(&m.homography, &h));
}

#[test]
fn the_order_of_the_points_does_not_matter() {
    let mut scene = Scene::new(30..60);
    let (mut one, mut other) = (estimator(), estimator());
    for frame in 0..20 {
        let seen = scene.next_frame();
        let mut shuffled = seen.clone();
        fastrand::Rng::with_seed(frame as u64).shuffle(&mut shuffled);
        assert_eq!(push(&mut one, frame, &seen), push(&mut other, frame, &shuffled), "frame {frame}");
    }
}

#[test]
fn a_picture_twice_as_large_moves_twice_as_far() {
    let mut scene = Scene::new(5..60);
    let mut small = estimator();
    let mut large = MotionEstimator::new(2 * WIDTH, 2 * HEIGHT);
    for frame in 0..25 {
        let seen = scene.next_frame();
        let doubled: Vec<Observation> = seen.iter().map(|p| Observation { x: 2.0 * p.x, y: 2.0 * p.y, ..*p }).collect();
        let (a, b) = (push(&mut small, frame, &seen), push(&mut large, frame, &doubled));
        let mut expected = *a.homography.matrix();
        (0..2).for_each(|k| {
            expected[(k, 2)] *= 2.0;
            expected[(2, k)] /= 2.0;
        });
        assert!(gap(&Homography::new(expected), &b.homography) < 1e-6, "frame {frame}");
        assert_eq!((a.model, a.inliers), (b.model, b.inliers), "frame {frame}");
    }
}

/// A shaken still world of 160 points with a blob of 240 points, coherent and in the middle of the frame, that stands still at
/// first and walks off at 3 px per frame during `walking`; noise of 0.1 px on every position.
struct Scene {
    frame: usize,
    walking: Range<usize>,
    still: Vec<Point2>,
    blob: Vec<Point2>,
    rng: fastrand::Rng,
}

impl Scene {
    const STILL: usize = 160;

    fn new(walking: Range<usize>) -> Self {
        let blob = scatter(240, 170.0..430.0, 60.0..320.0, 6);
        Self { frame: 0, walking, still: whole_frame(Self::STILL, 5), blob, rng: fastrand::Rng::with_seed(9) }
    }

    fn motion(frame: usize) -> Similarity2 {
        shake(frame)
    }

    fn next_frame(&mut self) -> Vec<Observation> {
        if self.frame > 0 {
            let m = Self::motion(self.frame);
            let own = if self.walking.contains(&self.frame) { Vec2::new(3.0, 0.4) } else { Vec2::zeros() };
            self.still.iter_mut().for_each(|p| *p = m.apply(*p));
            self.blob.iter_mut().for_each(|p| *p = m.apply(*p) + own);
        }
        self.frame += 1;
        let rng = &mut self.rng;
        let mut noisy = |p: &Point2| {
            // Sum of three uniform numbers: deviation 0.5, scaled to 0.1 px.
            let mut noise = || 0.2 * (rng.f64() + rng.f64() + rng.f64() - 1.5);
            Point2::new(p.x + noise(), p.y + noise())
        };
        self.still.iter().chain(&self.blob).enumerate().map(|(id, p)| observe(id, noisy(p))).collect()
    }
}

#[test]
fn a_subject_with_three_fifths_of_the_points_does_not_steer_the_motion() {
    for start in [1, 5, 20] {
        let mut scene = Scene::new(start..start + 40);
        let mut estimator = estimator();
        for frame in 0..start + 45 {
            let seen = scene.next_frame();
            let m = push(&mut estimator, frame, &seen);
            if frame > 0 {
                let error = gap(&m.homography, &Scene::motion(frame).to_homography());
                assert!(error < 0.5, "walking from {start}: frame {frame} is off by {error:.2} px");
            }
            if (start + 15..start + 40).contains(&frame) {
                let (still, blob) = estimator.background().split_at(Scene::STILL);
                let share = |b: &[bool]| b.iter().filter(|b| **b).count() as f64 / b.len() as f64;
                assert!(share(still) > 0.95 && share(blob) < 0.05, "frame {frame}: {} {}", share(still), share(blob));
            }
        }
    }
}

#[test]
fn a_new_shot_starts_from_rest_and_forgets_the_old_one() {
    let mut scene = Scene::new(5..40);
    let mut estimator = estimator();
    for frame in 0..30 {
        push(&mut estimator, frame, &scene.next_frame());
    }
    let seen = scene.next_frame();
    let cut = push_flagged(&mut estimator, 30, &seen, FrameQuality { cut_before: true, ..FrameQuality::default() });
    assert_eq!((cut.quality, cut.homography), (MotionQuality::ShotStart, Homography::identity()));
    assert!(estimator.background_pairs().is_empty());
    assert!(estimator.background().iter().all(|b| *b), "the blob's past is forgotten");
}

#[test]
fn a_repeated_frame_moves_exactly_nothing() {
    let mut scene = Scene::new(5..40);
    let mut estimator = estimator();
    for frame in 0..3 {
        push(&mut estimator, frame, &scene.next_frame());
    }
    let seen = scene.next_frame();
    push(&mut estimator, 3, &seen);
    let again = push_flagged(&mut estimator, 4, &seen, FrameQuality { duplicate: true, ..FrameQuality::default() });
    assert_eq!((again.quality, again.homography), (MotionQuality::Duplicate, Homography::identity()));
    let next = push(&mut estimator, 5, &scene.next_frame());
    assert!(gap(&next.homography, &Scene::motion(4).to_homography()) < 0.5);
}

#[test]
fn nothing_to_see_is_said_and_never_panics() {
    let mut estimator = estimator();
    push(&mut estimator, 0, &[]);
    assert_eq!(push(&mut estimator, 1, &[]).quality, MotionQuality::Lost);
    let broken = [f32::NAN, f32::INFINITY, 1e30].map(|x| Observation { id: 3, x, y: x, background: true });
    assert_eq!(push(&mut estimator, 2, &broken).quality, MotionQuality::Lost);
    let one_place: Vec<_> = (0..50).map(|id| observe(id, Point2::new(5.0, 5.0))).collect();
    push(&mut estimator, 3, &one_place);
    assert_eq!(push(&mut estimator, 4, &one_place).quality, MotionQuality::Lost);
    let mut rng = fastrand::Rng::with_seed(1);
    for frame in 5..30 {
        let mut anywhere = || Point2::new(640.0 * rng.f64(), 360.0 * rng.f64());
        let chaos: Vec<_> = (0..60).map(|id| observe(id, anywhere())).collect();
        let m = push(&mut estimator, frame, &chaos);
        assert!(m.homography.is_finite() && gap(&m.homography, &Homography::identity()) < 400.0);
    }
}

/// A clip whose measured frames move by [`shake`] and [`perspective`].
pub(crate) fn clip(qualities: &[MotionQuality]) -> ClipMotion {
    let frame = |(k, q): (usize, &MotionQuality)| {
        let mut m = FrameMotion::still(ticks(1001 * k), *q);
        if *q == MotionQuality::Measured {
            m.similarity = shake(k);
            m.homography = perspective();
            m.model = PlanarModel::Homography;
        }
        m
    };
    let frames = qualities.iter().enumerate().map(frame).collect();
    ClipMotion::new(WIDTH, HEIGHT, Timebase { num: 1, den: 30_000 }, frames)
}

#[test]
fn short_gaps_are_bridged_and_long_ones_are_not() {
    use MotionQuality::{Bridged, Lost, Measured, ShotStart};
    let mut qualities = vec![ShotStart, Measured];
    qualities.extend([Lost; 10]);
    qualities.push(Measured);
    qualities.extend([Lost; 11]);
    qualities.extend([ShotStart, Lost, Lost]);
    let clip = clip(&qualities);
    assert_eq!(clip.shots, vec![0..24, 24..27]);
    assert!(clip.frames[2..12].iter().all(|f| f.quality == Bridged));
    assert!(clip.frames[13..24].iter().all(|f| f.quality == Lost && f.homography == Homography::identity()));
    assert!(clip.frames[25..].iter().all(|f| f.quality == Lost), "a shot without any motion stays untouched");
    let center = Point2::new(320.0, 180.0);
    let x = |k: usize| clip.frames[k].similarity.apply(center).x - center.x;
    for k in 2..12 {
        let expected = x(1) + (x(12) - x(1)) * (k - 1) as f64 / 11.0;
        assert!((x(k) - expected).abs() < 1e-9, "frame {k}: shift {} instead of {expected}", x(k));
    }
}

/// Where the camera's shake has moved a scene point at time `t`, in frames: a band of sines up to 6 Hz at 30 frames/s.
fn shaken(p: Point2, t: f64) -> Point2 {
    let wave = |f: f64, phase: f64| (f * t + phase).sin();
    let shift = Vec2::new(
        9.0 * wave(0.35, 0.1) + 4.0 * wave(0.83, 1.0) + 2.0 * wave(1.2, 2.0),
        7.0 * wave(0.41, 0.6) + 4.0 * wave(0.71, 0.2) + 2.0 * wave(1.15, 1.3),
    );
    Similarity2::about(Point2::new(320.0, 180.0), 0.01 * wave(0.5, 0.3), 1.0, shift).apply(p)
}

/// The pixel at which a rolling shutter shows the scene point `p` in frame `t`.
fn shown(p: Point2, t: f64, readout: f64) -> Point2 {
    let mut q = shaken(p, t);
    for _ in 0..30 {
        q = shaken(p, t + (q.y / f64::from(HEIGHT) - 0.5) * readout);
    }
    q
}

#[test]
fn the_readout_is_found_and_a_global_shutter_has_none() {
    let points = whole_frame(150, 8);
    for readout in [0.0, 0.3, 0.6, 0.95, -0.5] {
        let mut estimator = estimator();
        let mut evidence = ReadoutEstimator::new(HEIGHT);
        for frame in 0..90 {
            let seen = points.iter().enumerate().map(|(id, p)| observe(id, shown(*p, frame as f64, readout)));
            let m = push(&mut estimator, frame, &seen.collect::<Vec<_>>());
            if m.quality == MotionQuality::Measured {
                evidence.push(&m.similarity, estimator.background_pairs());
            }
        }
        let found = evidence.estimate().map_or(0.0, |r| r.frames);
        assert!((found - readout).abs() <= 0.1 * readout.abs(), "readout {readout} came out as {found}");
    }
}

#[test]
fn row_motion_brings_points_to_the_center_rows_time() {
    let (readout, p, t) = (0.8, Point2::new(500.0, 40.0), 13.0);
    let step = |k: f64| {
        let moved =
            whole_frame(30, 3).into_iter().map(|s| Pair { previous: shaken(s, t + k - 1.0), this: shaken(s, t + k) });
        let moved: Vec<Pair> = moved.collect();
        motion::similarity(&moved, &vec![1.0; moved.len()]).expect("30 points").to_homography()
    };
    let rows = RowMotion::new([-1.0, 0.0, 1.0, 2.0].map(step), readout, HEIGHT).expect("similarities are regular");
    let seen = shown(p, t, readout);
    let (before, after) = ((seen - shaken(p, t)).norm(), (rows.center_time(seen) - shaken(p, t)).norm());
    assert!(after < 0.05 * before, "{before:.2} px of wobble left {after:.2} px");
    assert_eq!(rows.displacement(Point2::new(77.0, 180.0)), Vec2::zeros(), "the center row needs no correction");
}

#[test]
fn the_verdict_says_which_family_is_supported_and_why() {
    use MotionQuality::{Lost, Measured, ShotStart};
    let stretch = |quality, model, inliers, coverage, residual_px| {
        let mut clip = clip(&[ShotStart; 1]);
        clip.frames.extend((1..60).map(|k| FrameMotion {
            model,
            inliers,
            coverage,
            residual_px,
            ..FrameMotion::still(Timestamp(k), quality)
        }));
        clip.shots[0] = 0..60;
        let found = motion::verdicts(&clip);
        assert_eq!((found.len(), found[0].frames.clone()), (1, 0..60));
        (found[0].model, found[0].reason.clone())
    };
    let cases = [
        (stretch(Lost, PlanarModel::Identity, 0, 0.0, 0.0), MotionModel::Untouched, "in 0 % of the frames only"),
        (stretch(Measured, PlanarModel::Homography, 20, 0.5, 0.1), MotionModel::Similarity, "20 background points"),
        (stretch(Measured, PlanarModel::Homography, 300, 0.1, 0.1), MotionModel::Similarity, "on 10 % of the frame"),
        (
            stretch(Measured, PlanarModel::Similarity, 300, 0.5, 0.04),
            MotionModel::Similarity,
            "perspective shows in 0 %",
        ),
        (stretch(Measured, PlanarModel::Homography, 300, 0.5, 0.04), MotionModel::Homography, "move as one plane"),
        (stretch(Measured, PlanarModel::Homography, 300, 0.5, 0.4), MotionModel::Mesh, "0.40 px beside any plane"),
    ];
    for ((model, reason), expected, words) in cases {
        assert!(
            model == expected && reason.contains(words),
            "{model:?} because {reason:?}, not {expected:?} ({words})"
        );
    }
}
