//! Laws of structure from motion as a whole, on shots made up.

use plumbline::camera::CameraPose;
use plumbline::num::math::Point2;
use std::ops::Range;

use plumbline::num::run::{Run, Stopped};
use plumbline::num::time::{Timebase, Timestamp};
use plumbline::video::motion::sfm::{
    Reconstruction, Segment, SfmOptions, SfmVerdict, TrackTable, Windows, reconstruct, reconstruct_shot,
};
use plumbline::video::motion::{ClipMotion, FrameMotion, MotionQuality};
use plumbline::video::stabilize::{CameraMotionOptions, CameraRecovery, Tracks};
use plumbline::video::track::{FrameQuality, FrameTracks, Observation, TrackStore};

use crate::support::shots::{Course, PathError, Shot, ShotOptions, path_error};

type Frames = Vec<Vec<(u32, Point2)>>;

const ROLLING: SfmOptions = SfmOptions { focal: None, rolling_shutter: true };

fn solved(frames: Frames) -> Reconstruction {
    reconstruct(&TrackTable::new(640, 360, frames), &ROLLING, &Run::default()).expect("a run that never stops")
}

fn noisy(seed: u64, course: Course) -> Shot {
    Shot::new(&ShotOptions { seed, course, frames: 40, noise_px: 0.2, outliers: 0.03, ..ShotOptions::default() })
}

fn error(found: &Reconstruction, shot: &Shot) -> PathError {
    path_error(&found.scene.poses, &shot.truth.poses)
}

#[test]
fn exact_tracks_of_a_walk_give_every_camera_exactly_focal_length_unknown() {
    let shot = Shot::new(&ShotOptions { seed: 21, frames: 40, ..ShotOptions::default() });
    let found = solved(shot.frames());
    assert_eq!((found.verdict, found.figures.registered), (SfmVerdict::ThreeD, 40), "{}", found.reason);
    let error = error(&found, &shot);
    assert!(error.position < 1e-4, "{error:?}");
    assert!((found.scene.intrinsics.focal / 576.0 - 1.0).abs() < 1e-3, "{}", found.scene.intrinsics.focal);
}

#[test]
fn noise_and_outliers_leave_a_walk_within_the_bars() {
    for seed in [22, 23] {
        let shot = noisy(seed, Course::Walk);
        let found = solved(shot.frames());
        assert_eq!((found.verdict, found.figures.registered), (SfmVerdict::ThreeD, 40), "{}", found.reason);
        let error = error(&found, &shot);
        assert!(error.position < 0.005 && error.frame_to_frame < 2e-4, "seed {seed}: {error:?}");
        assert_eq!(found.scene.readout, 0.0, "a global shutter has no readout");
    }
}

#[test]
fn the_resolution_changes_nothing_but_the_focal_length() {
    let shot = noisy(22, Course::Walk);
    let larger = shot.frames().into_iter().map(|f| f.into_iter().map(|(id, p)| (id, p * 3.0)).collect());
    let larger = reconstruct(&TrackTable::new(1920, 1080, larger.collect::<Frames>()), &ROLLING, &Run::default())
        .expect("a run that never stops");
    let found = solved(shot.frames());
    assert_eq!((larger.verdict, larger.figures.registered), (SfmVerdict::ThreeD, 40), "{}", larger.reason);
    let apart = path_error(&larger.scene.poses, &found.scene.poses);
    assert!(apart.position < 1e-4 && apart.rotation < 1e-5, "{apart:?}");
    assert!((larger.scene.intrinsics.focal / found.scene.intrinsics.focal - 3.0).abs() < 1e-4);
}

#[test]
fn a_rolling_shutter_is_found_without_prior_knowledge() {
    let shot = Shot::new(&ShotOptions { seed: 24, frames: 40, readout: 0.6, noise_px: 0.1, ..ShotOptions::default() });
    let found = solved(shot.frames());
    assert!((found.scene.readout - 0.6).abs() < 0.06, "{}", found.scene.readout);
    assert!(error(&found, &shot).frame_to_frame < 2e-4, "{:?}", error(&found, &shot));
}

#[test]
fn a_rotating_camera_gets_rotations_and_no_invented_translation() {
    for seed in [25, 26] {
        let shot = noisy(seed, Course::Rotation);
        let found = solved(shot.frames());
        assert_eq!((found.verdict, found.figures.registered), (SfmVerdict::RotationOnly, 40), "{}", found.reason);
        assert!(found.scene.poses.iter().flatten().all(|p| p.translation.norm() == 0.0));
        let error = error(&found, &shot);
        assert!(error.rotation < 0.1_f64.to_radians(), "seed {seed}: {error:?}");
        assert!((found.scene.intrinsics.focal / 576.0 - 1.0).abs() < 0.02, "{}", found.scene.intrinsics.focal);
    }
}

#[test]
fn a_standing_camera_has_no_path() {
    let still: Vec<(u32, Point2)> =
        (0..200).map(|i| (i, Point2::new(f64::from(i % 20) * 31.0 + 10.0, f64::from(i / 20) * 34.0 + 12.0))).collect();
    let found = solved(vec![still; 30]);
    assert_eq!(found.verdict, SfmVerdict::RotationOnly, "{}", found.reason);
    let first = found.scene.poses[0].expect("known");
    assert!(found.scene.poses.iter().flatten().all(|p| p.rotation.angle_to(&first.rotation) < 1e-6));
}

#[test]
fn points_that_all_wander_by_themselves_give_no_cameras() {
    let mut random = fastrand::Rng::with_seed(27);
    let mut at: Vec<Point2> = (0..200).map(|_| Point2::new(640.0 * random.f64(), 360.0 * random.f64())).collect();
    let frames = (0..40).map(|_| {
        for p in &mut at {
            *p += plumbline::num::math::Vec2::new(random.f64() - 0.5, random.f64() - 0.5) * 16.0;
        }
        (0..).zip(at.iter().copied()).collect()
    });
    let found = solved(frames.collect());
    assert_eq!(found.verdict, SfmVerdict::Failed, "{}", found.reason);
}

#[test]
fn no_frames_one_frame_two_frames_and_empty_frames_are_called_too_few_points() {
    let shot = noisy(28, Course::Walk);
    let frames = shot.frames();
    for few in [Vec::new(), frames[..1].to_vec(), frames[..2].to_vec(), vec![Vec::new(); 20]] {
        let count = few.len();
        let found = solved(few);
        assert_eq!(found.verdict, SfmVerdict::TooFewPoints, "{count} frames: {}", found.reason);
        assert_eq!(found.scene.poses, vec![None; count]);
    }
}

#[test]
fn a_focal_length_that_grows_is_not_taken_for_one_camera() {
    for course in [Course::Side, Course::Walk, Course::Rotation] {
        let shot = Shot::new(&ShotOptions { seed: 29, course, frames: 40, noise_px: 0.1, ..ShotOptions::default() });
        let mut frames = shot.frames();
        for (k, frame) in frames.iter_mut().enumerate() {
            let factor = 1.0 + 0.4 * k as f64 / 40.0;
            let center = Point2::new(320.0, 180.0);
            for (_, p) in frame {
                *p = center + (*p - center) * factor;
            }
        }
        let found = solved(frames);
        assert_eq!(found.verdict, SfmVerdict::Zoom, "{course:?}: {}", found.reason);
    }
}

#[test]
fn frames_without_points_in_the_middle_have_no_camera_and_the_others_do() {
    let shot = noisy(30, Course::Walk);
    let mut frames = shot.frames();
    frames[18..21].iter_mut().for_each(Vec::clear);
    let found = solved(frames);
    assert_eq!(found.verdict, SfmVerdict::ThreeD, "{}", found.reason);
    assert!((18..21).all(|f| found.scene.poses[f].is_none()));
    assert_eq!(found.figures.registered, 37);
    assert!(error(&found, &shot).position < 0.01, "{:?}", error(&found, &shot));
}

#[test]
fn every_third_frame_alone_is_enough() {
    let shot = Shot::new(&ShotOptions { seed: 31, frames: 90, noise_px: 0.2, ..ShotOptions::default() });
    let frames: Frames = shot.frames().into_iter().step_by(3).collect();
    let truth: Vec<_> = shot.truth.poses.iter().copied().step_by(3).collect();
    let found = solved(frames);
    assert_eq!((found.verdict, found.figures.registered), (SfmVerdict::ThreeD, 30), "{}", found.reason);
    assert!(path_error(&found.scene.poses, &truth).position < 0.005);
}

#[test]
fn of_two_halves_without_common_tracks_one_is_solved_and_the_verdict_says_so() {
    let shot = noisy(32, Course::Walk);
    let mut frames = shot.frames();
    frames[25..].iter_mut().flatten().for_each(|p| p.0 += 1_000_000);
    let found = solved(frames);
    assert_eq!(found.verdict, SfmVerdict::Failed, "25 of 40 frames are not the shot: {}", found.reason);
    assert!(found.scene.poses[25..].iter().all(Option::is_none), "the halves have no common coordinates");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let shot = noisy(33, Course::Walk);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| solved(shot.frames()))
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(one.scene, three.scene);
    assert_eq!(one.figures, three.figures);
}

/// A source of frames that cannot be read.
#[derive(Debug, PartialEq)]
struct Gone;

impl From<Stopped> for Gone {
    fn from(stopped: Stopped) -> Self {
        panic!("a run that never stops: {stopped}")
    }
}

/// Solves a shot in windows; how many frames were held at once at most.
fn in_windows(frames: &Frames, windows: &Windows) -> (Vec<Segment>, usize) {
    let mut most = 0;
    let read = |range: Range<usize>| {
        most = most.max(range.len());
        Ok::<_, Gone>(TrackTable::new(640, 360, frames[range].to_vec()))
    };
    let segments = reconstruct_shot(0..frames.len(), read, &ROLLING, windows, &Run::default()).expect("in memory");
    (segments, most)
}

fn poses(segments: &[Segment]) -> Vec<Option<CameraPose>> {
    segments.iter().flat_map(|s| &s.cameras).map(|c| c.map(|c| c.pose)).collect()
}

#[test]
fn windows_give_the_cameras_of_one_solve_and_no_jump_where_they_meet() {
    let shot =
        Shot::new(&ShotOptions { seed: 34, frames: 130, noise_px: 0.2, outliers: 0.03, ..ShotOptions::default() });
    let frames = shot.frames();
    let (whole, _) = in_windows(&frames, &Windows::default());
    let (parted, most) = in_windows(&frames, &Windows { longest: 80, length: 80, overlap: 30 });
    assert_eq!((whole.len(), parted.len(), most), (1, 1, 80), "{:?}", parted.iter().map(|s| &s.reason));
    assert_eq!((parted[0].verdict, parted[0].figures.registered), (SfmVerdict::ThreeD, 130), "{}", parted[0].reason);
    let (one, two) = (path_error(&poses(&whole), &shot.truth.poses), path_error(&poses(&parted), &shot.truth.poses));
    assert!(two.position < 0.01 && two.frame_to_frame < 2e-4, "{two:?} beside {one:?}");
    let apart = path_error(&poses(&parted), &poses(&whole));
    assert!(apart.position < 0.01 && apart.frame_to_frame < 1e-4, "{apart:?}");
}

#[test]
fn cameras_of_windows_do_not_depend_on_who_solves_which() {
    let shot = Shot::new(&ShotOptions { seed: 34, frames: 130, noise_px: 0.2, ..ShotOptions::default() });
    let mut store = TrackStore::new().expect("a temporary file");
    let frames = shot.frames().into_iter().enumerate().map(|(k, points)| {
        let observation = |(id, p): (u32, Point2)| Observation { id, x: p.x as f32, y: p.y as f32, background: true };
        let inside = |o: &Observation| o.x >= 0.0 && o.y >= 0.0;
        let observations = points.into_iter().map(observation).filter(inside).collect();
        let quality = if k == 0 { MotionQuality::ShotStart } else { MotionQuality::Measured };
        store
            .push(&FrameTracks { pts: Timestamp(k as i64), observations, quality: FrameQuality::default() })
            .expect("stored");
        FrameMotion::still(Timestamp(k as i64), quality)
    });
    let timebase = Timebase { num: 1, den: 30 };
    let motion = ClipMotion::new(640, 360, timebase, frames.collect());
    let tracks = Tracks { store, width: 640, height: 360, timebase };
    let windows = Windows { longest: 60, length: 60, overlap: 25 };
    let (options, run) = (CameraMotionOptions::default(), Run::default());
    let recovery = CameraRecovery::in_windows(&motion, &options, None, &windows);
    let by = |cuts: &[usize]| {
        let starts: Vec<Range<usize>> = cuts.windows(2).map(|w| w[0]..w[1]).collect();
        let part = |starts: &Range<usize>| {
            // A task has the tracks of its own part alone.
            let frames = recovery.support(starts);
            Tracks::of_parts([tracks.part(frames)], &motion).expect("of this clip")
        };
        let leading = starts.iter().flat_map(|s| recovery.leading(&part(s), s.clone(), &run).expect("never stopped"));
        let leading: Vec<_> = leading.collect();
        let others = |s: &Range<usize>| recovery.following(&part(s), s.clone(), &leading, &run).expect("never stopped");
        let mut found: Vec<_> = starts.iter().rev().flat_map(others).collect();
        assert_eq!((leading.len(), found.len()), (1, 2));
        found.extend(leading.iter().cloned());
        recovery.join(found).expect("all windows")
    };
    let whole = by(&[0, 130]);
    assert!(whole.frames.iter().flatten().count() > 120 && whole.shots.len() == 1, "{:?}", whole.shots);
    assert!(by(&[0, 30, 60, 130]) == whole && by(&[0, 1, 2, 129, 130]) == whole);
    let missing = recovery.join(recovery.leading(&tracks, 0..130, &run).expect("never stopped"));
    assert!(missing.expect_err("two windows are missing").to_string().contains("not of this clip"));
}

#[test]
fn an_unannounced_cut_splits_the_shot_into_segments_with_cameras_of_their_own() {
    let longer = ShotOptions { seed: 36, course: Course::Side, frames: 55, noise_px: 0.2, ..ShotOptions::default() };
    let (first, second) = (noisy(35, Course::Walk), Shot::new(&longer));
    let mut frames = first.frames();
    frames.truncate(26);
    frames.extend(second.frames().into_iter().map(|f| f.into_iter().map(|(id, p)| (id + 1_000_000, p)).collect()));
    frames.extend(vec![Vec::new(); 5]);
    let (segments, _) = in_windows(&frames, &Windows::default());
    let told: Vec<_> = segments.iter().map(|s| (s.frames.clone(), s.verdict)).collect();
    assert!(segments.windows(2).all(|w| w[0].frames.end == w[1].frames.start), "{told:?}");
    assert_eq!(segments.last().map(|s| s.frames.end), Some(86), "{told:?}");
    let solved: Vec<&Segment> = segments.iter().filter(|s| s.verdict == SfmVerdict::ThreeD).collect();
    assert!(solved.iter().any(|s| s.frames.start < 3 && (24..28).contains(&s.frames.end)), "{told:?}");
    assert!(solved.iter().any(|s| (24..30).contains(&s.frames.start) && s.frames.end > 75), "{told:?}");
    assert!(solved.iter().all(|s| s.frames.len() >= 25));
}

#[test]
fn a_source_that_cannot_be_read_is_reported() {
    let read = |_: Range<usize>| Err(Gone);
    assert_eq!(reconstruct_shot(0..50, read, &ROLLING, &Windows::default(), &Run::default()), Err(Gone));
}
