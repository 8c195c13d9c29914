//! Laws of the inter-frame motion, on scenes whose motion is known.

use std::io::Cursor;
use std::ops::Range;

use plumbline::math::{Homography, Point2, Similarity2, Vec2};
use plumbline::motion::{
    self, ClipMotion, FrameFlags, FrameInput, FrameMotion, FrameScale, MotionEstimator, MotionFileError, MotionOptions,
    MotionQuality, Pair, PlanarModel, ReadoutEstimator, RowMotion, Tier, TrackPoint,
};
use plumbline::time::{Timebase, Timestamp};
use plumbline::track::{FrameQuality, FrameTracks, Observation, TrackStore};

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

fn observe(id: usize, p: Point2) -> TrackPoint {
    TrackPoint { id: id as u32, x: p.x as f32, y: p.y as f32 }
}

fn push(estimator: &mut MotionEstimator, frame: usize, points: &[TrackPoint]) -> FrameMotion {
    push_flagged(estimator, frame, points, FrameFlags::default())
}

fn push_flagged(
    estimator: &mut MotionEstimator,
    frame: usize,
    points: &[TrackPoint],
    flags: FrameFlags,
) -> FrameMotion {
    estimator.push(FrameInput { pts: ticks(frame), flags, points })
}

fn estimator() -> MotionEstimator {
    MotionEstimator::new(WIDTH, HEIGHT, MotionOptions::default())
}

/// Largest distance between two maps over the frame's corners and center, px.
fn gap(a: &Homography, b: &Homography) -> f64 {
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
    let dlt = motion::homography_dlt(&exact, &weights).expect("general position");
    assert!(gap(&dlt, &h) < 1e-6, "direct linear transform: {}", gap(&dlt, &h));
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
    assert!(motion::homography_dlt(&on_line, &[1.0; 20]).is_none());
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
        let seen: Vec<TrackPoint> = points.iter().enumerate().map(|(id, p)| observe(id, *p)).collect();
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
    let mut large = MotionEstimator::new(2 * WIDTH, 2 * HEIGHT, MotionOptions::default());
    for frame in 0..25 {
        let seen = scene.next_frame();
        let doubled: Vec<TrackPoint> = seen.iter().map(|p| TrackPoint { x: 2.0 * p.x, y: 2.0 * p.y, ..*p }).collect();
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

    fn next_frame(&mut self) -> Vec<TrackPoint> {
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
    let cut = push_flagged(&mut estimator, 30, &seen, FrameFlags { cut_before: true, ..FrameFlags::default() });
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
    let again = push_flagged(&mut estimator, 4, &seen, FrameFlags { duplicate: true, ..FrameFlags::default() });
    assert_eq!((again.quality, again.homography), (MotionQuality::Duplicate, Homography::identity()));
    let next = push(&mut estimator, 5, &scene.next_frame());
    assert!(gap(&next.homography, &Scene::motion(4).to_homography()) < 0.5);
}

#[test]
fn nothing_to_see_is_said_and_never_panics() {
    let mut estimator = estimator();
    push(&mut estimator, 0, &[]);
    assert_eq!(push(&mut estimator, 1, &[]).quality, MotionQuality::Lost);
    let broken = [f32::NAN, f32::INFINITY, 1e30].map(|x| TrackPoint { id: 3, x, y: x });
    assert_eq!(push(&mut estimator, 2, &broken).quality, MotionQuality::Lost);
    let one_place = vec![TrackPoint { id: 0, x: 5.0, y: 5.0 }; 50];
    let one_place: Vec<_> = one_place.iter().enumerate().map(|(id, p)| TrackPoint { id: id as u32, ..*p }).collect();
    push(&mut estimator, 3, &one_place);
    assert_eq!(push(&mut estimator, 4, &one_place).quality, MotionQuality::Lost);
    let mut rng = fastrand::Rng::with_seed(1);
    for frame in 5..30 {
        let chaos: Vec<_> = (0..60).map(|id| TrackPoint { id, x: 640.0 * rng.f32(), y: 360.0 * rng.f32() }).collect();
        let m = push(&mut estimator, frame, &chaos);
        assert!(m.homography.is_finite() && gap(&m.homography, &Homography::identity()) < 400.0);
    }
}

fn clip(qualities: &[MotionQuality]) -> ClipMotion {
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

fn written(clip: &ClipMotion) -> String {
    let mut bytes = Vec::new();
    clip.write_json(&mut bytes).expect("finite motion");
    String::from_utf8(bytes).expect("JSON is text")
}

fn sample_clip() -> ClipMotion {
    use MotionQuality::{Lost, Measured, ShotStart};
    let mut clip = clip(&[ShotStart, Measured, Measured, Lost, Measured, ShotStart, Measured]);
    clip.rotation = 90;
    clip.pixel_aspect = (4, 3);
    clip.readout_s = Some(0.02);
    clip.other_blocks.insert("gyroscope".into(), serde_json::json!([{ "rad_s": [0.1, 0.0, -0.2] }]));
    clip
}

#[test]
fn a_motion_file_brings_back_what_was_written() {
    let clip = sample_clip();
    let back = ClipMotion::from_json(written(&clip).as_bytes()).expect("own file");
    assert_eq!(back, clip);
    assert_eq!(back.shown_size(), (360, 853));
    assert_eq!(written(&back), written(&clip));
}

#[test]
fn a_file_with_pixel_centers_at_integers_is_shifted() {
    let clip = sample_clip();
    let text = written(&clip).replace("\"pixel_centre\": 0.5", "\"pixel_centre\": 0");
    let shifted = ClipMotion::from_json(text.as_bytes()).expect("centers at integers are accepted");
    for (a, b) in clip.frames.iter().zip(&shifted.frames) {
        let p = Point2::new(100.0, 200.0);
        let half = Vec2::new(0.5, 0.5);
        let expected = a.homography.apply(p).expect("in front") + half;
        assert!((b.homography.apply(p + half).expect("in front") - expected).norm() < 1e-9);
        assert!((b.similarity.apply(p + half) - (a.similarity.apply(p) + half)).norm() < 1e-9);
    }
}

#[test]
fn a_file_without_similarities_gets_the_nearest_ones() {
    let text = written(&sample_clip());
    let cut = text.find(",\n\"planar_similarity\"").expect("the block is written");
    let clip = ClipMotion::from_json(format!("{}}}", &text[..cut]).as_bytes()).expect("the block is optional");
    let apart = gap(&clip.frames[1].similarity.to_homography(), &clip.frames[1].homography);
    assert!(apart > 0.1 && apart < 12.0, "{apart}");
}

#[test]
fn every_refusal_names_the_field_the_value_and_what_may_stand_there() {
    let good = written(&sample_clip());
    let cases = [
        ("\"version\": 1", "\"version\": 2", "motion file version 2 is not supported (expected 1)"),
        ("plumbline.motion", "other", "format \"other\" is not a motion file"),
        ("\"width\":640", "\"width\":4000000000", "source.width is 4000000000 (expected 1 to 65536 px)"),
        ("\"width\":640", "\"width\":0", "source.width is 0"),
        ("\"rotation\":90", "\"rotation\":45", "source.rotation is 45"),
        ("\"time_base\":[1,30000]", "\"time_base\":[1,0]", "source.time_base is [1, 0]"),
        ("\"pixel_aspect\":[4,3]", "\"pixel_aspect\":[0,3]", "source.pixel_aspect is [0, 3]"),
        ("\"pixel_centre\": 0.5", "\"pixel_centre\": 0.25", "pixel_centre is 0.25 (expected 0.5, or 0)"),
        ("\"readout_s\": 0.02", "\"readout_s\": 2", "readout_s is 2 (expected -0.1 to 0.1 s)"),
        ("\"pts\":1001", "\"pts\":0", "frames[1].pts is 0 (expected later than the frame before)"),
        ("\"shot\":1", "\"shot\":7", "frames[5].shot is 7"),
        ("\"planar\": [\n", "\"planar\": [\nnull,\n", "block \"planar\" has 8 entries for 7 frames"),
        ("[[1.01,0.012,4.0]", "[[1e999,0.012,4.0]", "not a motion file: number out of range"),
        ("[[1.01,0.012,4.0],[-0.008,0.995,-3.0]", "[[0,0,0],[0,0,0]", "planar[0] is "),
        ("[[1.01,0.012,4.0]", "[[null,0.012,4.0]", "not a motion file: invalid type: null"),
    ];
    for (from, to, message) in cases {
        assert!(good.contains(from), "{from} is not in the file");
        let error = ClipMotion::from_json(good.replacen(from, to, 1).as_bytes()).expect_err(to);
        assert!(error.to_string().contains(message), "{to}: {error}");
    }
}

/// Random points for every frame of a clip, the last of which stand on the edges of the picture.
fn tracked(clip: &ClipMotion) -> TrackStore {
    let mut rng = fastrand::Rng::with_seed(6);
    let mut store = TrackStore::new().expect("a temporary folder");
    for frame in &clip.frames {
        let mut seen: Vec<Observation> = (0..rng.u32(0..40))
            .map(|k| {
                let (x, y) = (640.0 * rng.f32(), 360.0 * rng.f32());
                Observation { id: 7 * k + rng.u32(0..7), x, y, background: rng.bool() }
            })
            .collect();
        seen.push(Observation { id: 900, x: 640.0, y: 0.0, background: false });
        let quality = FrameQuality::default();
        store.push(&FrameTracks { pts: frame.pts, observations: seen, quality }).expect("in range");
    }
    store
}

fn frames_of(store: &TrackStore) -> Vec<FrameTracks> {
    store.window(0..store.frames()).expect("stored")
}

fn written_with_tracks() -> (ClipMotion, TrackStore, String) {
    let clip = sample_clip();
    let store = tracked(&clip);
    let mut bytes = Vec::new();
    clip.write_json_with_tracks(&mut bytes, &store).expect("finite motion");
    (clip, store, String::from_utf8(bytes).expect("JSON is text"))
}

#[test]
fn points_come_back_from_a_motion_file_to_the_bit() {
    let (clip, store, text) = written_with_tracks();
    let (back, tracks) = ClipMotion::read_json(Cursor::new(&text)).expect("own file");
    assert_eq!(back, clip);
    assert_eq!(frames_of(&tracks.expect("tracks were written")), frames_of(&store));
    // Blocks in another order, as a program that sorts them writes.
    let sorted = serde_json::from_str::<serde_json::Value>(&text).expect("JSON").to_string();
    assert!(sorted.find("\"unit_px\"") > sorted.find("\"ids\""));
    let (_, tracks) = ClipMotion::read_json(Cursor::new(&sorted)).expect("the same in another order");
    assert_eq!(frames_of(&tracks.expect("tracks")), frames_of(&store));
    let (_, none) = ClipMotion::read_json(Cursor::new(&written(&clip))).expect("own file");
    assert!(none.is_none());
}

#[test]
fn points_in_another_unit_with_centers_at_integers_are_shifted() {
    let (_, store, text) = written_with_tracks();
    let step = 1.0 / 256.0;
    let mut file: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    file["pixel_centre"] = 0.into();
    file["tracks"]["unit_px"] = 0.5.into();
    for frame in file["tracks"]["frames"].as_array_mut().expect("frames") {
        for axis in ["x", "y"] {
            for v in frame[axis].as_array_mut().expect("positions") {
                *v = ((v.as_f64().expect("a number") * step - 0.5) / 0.5).into();
            }
        }
    }
    let (_, tracks) = ClipMotion::read_json(Cursor::new(file.to_string())).expect("another program's file");
    assert_eq!(frames_of(&tracks.expect("tracks")), frames_of(&store));
}

#[test]
fn points_that_cannot_be_are_refused_with_frame_and_line() {
    type Change<'a> = &'a dyn Fn(&mut serde_json::Value);
    let (_, _, text) = written_with_tracks();
    let file: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let refused = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut file = file.clone();
        change(&mut file["tracks"]);
        let text = serde_json::to_string_pretty(&file).expect("JSON");
        ClipMotion::read_json(Cursor::new(text)).expect_err("refused").to_string()
    };
    let cases: [(Change<'_>, &str); 9] = [
        (&|t| t["unit_px"] = 0.into(), "tracks.unit_px is 0 (expected above 0 up to 1)"),
        (&|t| drop(t.as_object_mut().expect("a block").remove("unit_px")), "missing field `unit_px`"),
        (&|t| drop(t["frames"].as_array_mut().expect("a list").pop()), "tracks.frames has 6 entries for 7 frames"),
        (
            &|t| t["frames"].as_array_mut().expect("a list").push(serde_json::json!({})),
            "tracks.frames[7]: one frame too many",
        ),
        (&|t| t["frames"][1]["ids"][0] = 950.into(), "tracks.frames[1]: ids[1] is"),
        (&|t| drop(t["frames"][1]["x"].as_array_mut().expect("a list").pop()), "tracks.frames[1]:"),
        (
            &|t| t["frames"][2]["y"][0] = (-9000).into(),
            "tracks.frames[2]: y[0] is -9000, or -35.15625 px (expected 0 to 360 px)",
        ),
        (&|t| t["frames"][2]["moving"] = serde_json::json!([901]), "tracks.frames[2]: moving holds 901"),
        (&|t| t["frames"][2]["x"][0] = "5".into(), "invalid type: string"),
    ];
    for (change, words) in cases {
        let error = refused(change);
        assert!(error.contains(words) && error.contains(" at line "), "{words}: {error}");
    }
}

#[test]
fn a_value_that_cannot_be_is_refused_with_its_line() {
    let good = written(&sample_clip());
    let line = 1 + good.lines().position(|l| l.contains("\"pts\":1001")).expect("the second frame");
    let error = ClipMotion::from_json(good.replacen("\"pts\":1001", "\"pts\":0", 1).as_bytes()).expect_err("no time");
    assert_eq!(error.to_string(), format!("line {line}: frames[1].pts is 0 (expected later than the frame before)"));
}

#[test]
fn a_block_that_stands_twice_is_refused() {
    let twice = written(&sample_clip()).replacen("\"readout_s\"", "\"readout_s\": 0.01,\n\"readout_s\"", 1);
    let error = ClipMotion::from_json(twice.as_bytes()).expect_err("which one").to_string();
    assert!(error.contains("the block \"readout_s\" stands there twice"), "{error}");
}

#[test]
fn motion_that_is_not_finite_is_not_written() {
    let mut clip = sample_clip();
    clip.frames[2].similarity.t.x = f64::NAN;
    let error = clip.write_json(Vec::new()).expect_err("NaN");
    assert!(matches!(&error, MotionFileError::Value { field, .. } if field == "motion of frame 2"), "{error}");
}

#[test]
fn damaged_files_are_refused_or_read_but_never_panic() {
    let good = written(&sample_clip()).into_bytes();
    let mut rng = fastrand::Rng::with_seed(11);
    for _ in 0..4000 {
        let mut bytes = good.clone();
        for _ in 0..rng.usize(1..6) {
            let at = rng.usize(..good.len());
            match rng.u8(..4) {
                _ if at >= bytes.len() => {}
                0 => bytes[at] = rng.u8(..),
                1 => bytes[at] = *rng.choice(b"0123456789-.e[]{},:\"n").expect("not empty"),
                2 => bytes.truncate(at.max(1)),
                _ => bytes.splice(at..at, good[at..(at + 20).min(good.len())].iter().copied()).for_each(drop),
            }
        }
        if let Ok(clip) = ClipMotion::from_json(&bytes) {
            assert!(clip.frames.iter().all(|f| f.homography.is_finite()));
            drop(written(&clip));
        }
    }
}

#[test]
fn the_schema_names_every_field_of_the_file() {
    let schema = serde_json::to_string(&motion::motion_file_schema()).expect("a schema is JSON");
    let planar = ["pixel_centre", "time_base", "readout_s", "planar", "planar_similarity", "verdict", "tier", "pts"];
    let in_space = ["cameras", "points", "reconstruction", "focal", "tracks", "unit_px", "ids", "moving"];
    for field in planar.into_iter().chain(in_space) {
        assert!(schema.contains(&format!("\"{field}\"")), "{field}");
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
        (found[0].tier, found[0].reason.clone())
    };
    let cases = [
        (stretch(Lost, PlanarModel::Identity, 0, 0.0, 0.0), Tier::Untouched, "in 0 % of the frames only"),
        (stretch(Measured, PlanarModel::Homography, 20, 0.5, 0.1), Tier::Similarity, "20 background points"),
        (stretch(Measured, PlanarModel::Homography, 300, 0.1, 0.1), Tier::Similarity, "on 10 % of the frame"),
        (stretch(Measured, PlanarModel::Similarity, 300, 0.5, 0.04), Tier::Similarity, "perspective shows in 0 %"),
        (stretch(Measured, PlanarModel::Homography, 300, 0.5, 0.04), Tier::Homography, "move as one plane"),
        (stretch(Measured, PlanarModel::Homography, 300, 0.5, 0.4), Tier::Mesh, "0.40 px beside any plane"),
    ];
    for ((tier, reason), expected, words) in cases {
        assert!(tier == expected && reason.contains(words), "{tier:?} because {reason:?}, not {expected:?} ({words})");
    }
}
