//! From a clip's motion to its virtual path: shot by shot, in windows of time.

use std::ops::Range;

use super::chain::Chain;
use super::optimal::{Cameras, Program, Sizing};
use super::pose::{C64, Pose, Stage, settle};
use super::{Clip, PathError, PathKind, PathOptions, Segment, SegmentOutcome, VirtualPath, Zoom, ideal};
use plumbline_num::math::{Homography, Similarity2};
use plumbline_num::optim::qp::QpError;
use plumbline_num::run::{Run, Stopped};

/// Length (s) of the windows of time; half of each is look-ahead. Decisions reach as far as the zoom takes to change,
/// a few seconds, so half a window ahead leaves no trace of where it ends.
const WINDOW_S: f64 = 16.0;

/// Bounds of the same in frames, so that memory stays bounded at any frame rate.
const WINDOW_FRAMES: (f64, f64) = (240.0, 960.0);

/// Longest time constant (s) of the smooth path from which the solver starts: beyond, pans lead it far outside the frame.
const MAX_REFERENCE_S: f64 = 0.5;

/// Time constant (s) at which a program that stalls is given up.
const MIN_S: f64 = 0.05;

/// RMS shake (units of half the diagonal) below which a shot stands still: 0.1 px at 1080p.
const STEADY: f64 = 1e-4;

/// Least room that the smallest window must leave in the frame, as a share of it. With less there is nothing to decide, and
/// the program's feasible points are so few that no interior-point method finds them.
const ROOM: f64 = 2e-3;

/// Below this share of reliable steps the motion of a shot is guesswork.
const MIN_RELIABLE: f64 = 0.3;

/// Share of the output that counts as its middle.
const MIDDLE: f64 = 1e-3;

/// The virtual path of a clip.
///
/// # Errors
/// [`PathError::Option`], [`PathError::Size`], [`PathError::Lengths`] and [`PathError::NoRoom`] for invalid input. A shot
/// whose program the solver does not solve is left as it is, and its segment says so. [`PathError::Interrupted`].
pub fn plan(clip: &Clip<'_>, options: &PathOptions, run: &Run) -> Result<VirtualPath, PathError> {
    validate(clip, options)?;
    let stage = Stage::new(clip.width, clip.height);
    Ok(plan_shots(clip, &stage, options.window(), |shot| shot_path(clip, options, &stage, shot, run), run)?)
}

/// The virtual path that shows `wanted` (`out_from_src` per frame): exactly where the border may show, else held inside the
/// frame with as large a window as allowed.
///
/// # Errors
/// As for [`plan`]; [`PathError::Lengths`] also for another number of wanted maps.
pub fn plan_along(
    clip: &Clip<'_>,
    options: &PathOptions,
    wanted: &[Similarity2],
    run: &Run,
) -> Result<VirtualPath, PathError> {
    validate(clip, options)?;
    expect_one_per_frame(clip, wanted.len())?;
    let stage = Stage::new(clip.width, clip.height);
    // Where the border may show, only the middle of the output must lie on the frame: nothing is moved for more.
    let window = if options.border_allows_outside { MIDDLE } else { options.window() };
    let mut plan = plan_shots(
        clip,
        &stage,
        window,
        |shot| {
            let chain = Chain::of_shot(clip, &stage, shot.clone());
            let ideal: Vec<Pose> = wanted[shot.clone()].iter().map(|w| window_of(&stage, w)).collect();
            let path =
                if options.border_allows_outside { Ok(ideal) } else { follow(&chain, &stage, options, &ideal, run) };
            let path = path.map_err(|e| format!("the given path cannot be followed: {e}"))?;
            Ok((path, "the path that was given".to_owned()))
        },
        run,
    )?;
    let followed = plan.segments.iter_mut().filter(|s| s.outcome == SegmentOutcome::Smoothed);
    followed.for_each(|s| s.outcome = SegmentOutcome::Given);
    Ok(plan)
}

/// `src_from_out` of a map that is wanted.
pub(super) fn window_of(stage: &Stage, out_from_src: &Similarity2) -> Pose {
    out_from_src.inverse().map_or(Pose::IDENTITY, |s| stage.pose(s))
}

pub(super) fn expect_one_per_frame(clip: &Clip<'_>, covered: usize) -> Result<(), PathError> {
    let (times, motions) = (clip.times_s.len(), clip.motion.len());
    if covered == times { Ok(()) } else { Err(PathError::Lengths { times, motions, covered }) }
}

pub(super) fn plan_shots(
    clip: &Clip<'_>,
    stage: &Stage,
    window: f64,
    shot_path: impl Fn(Range<usize>) -> ShotPath,
    run: &Run,
) -> Result<VirtualPath, Stopped> {
    let mut plan =
        VirtualPath { out_from_src: Vec::new(), crop: Vec::new(), cameras: Vec::new(), segments: Vec::new() };
    for shot in clip.shots {
        let found = shot_path(shot.clone());
        // A shot that was stopped is no shot without a path.
        run.check()?;
        let segment = match found {
            Ok((path, reason)) => {
                for pose in path {
                    let (pose, out_from_src) = settle(stage, pose, window);
                    plan.out_from_src.push(out_from_src);
                    plan.crop.push(pose.z.norm());
                }
                Segment { frames: shot.clone(), outcome: SegmentOutcome::Smoothed, reason }
            }
            Err(reason) => {
                plan.out_from_src.extend(shot.clone().map(|_| Homography::identity()));
                plan.crop.extend(shot.clone().map(|_| 1.0));
                Segment { frames: shot.clone(), outcome: SegmentOutcome::Unchanged, reason }
            }
        };
        plan.segments.push(segment);
    }
    Ok(plan)
}

/// The smoothed poses of a shot and what to say of them, or why it is left as it is.
pub(super) type ShotPath = Result<(Vec<Pose>, String), String>;

pub(super) fn shot_path(
    clip: &Clip<'_>,
    options: &PathOptions,
    stage: &Stage,
    shot: Range<usize>,
    run: &Run,
) -> ShotPath {
    if shot.len() < 3 {
        return Err(format!("shot of {} frames, too short to smooth", shot.len()));
    }
    let steps = shot.len() - 1;
    let reliable = clip.motion[shot.start + 1..shot.end].iter().filter(|m| m.reliable).count();
    if (reliable as f64) < MIN_RELIABLE * steps as f64 {
        return Err(format!("motion could be followed in only {reliable} of {steps} frames"));
    }
    let chain = Chain::of_shot(clip, stage, shot.clone());
    let before = mean(&chain.shake());
    if before < STEADY * STEADY && options.kind != PathKind::Tripod {
        return Err("already steady".to_owned());
    }
    if options.smallest_window() > 1.0 - ROOM {
        return Err("the least crop leaves no room to move".to_owned());
    }
    let path = kind_path(&chain, stage, options, run).map_err(|e| format!("no path was found: {e}"))?;
    let after = mean(&chain.seen_through(&path).shake());
    if after.partial_cmp(&before) != Some(std::cmp::Ordering::Less) {
        return Err("smoothing would not have made it steadier".to_owned());
    }
    Ok((path, format!("shake lowered to {:.0} %", 100.0 * (after / before).sqrt())))
}

/// The path of the kind wanted, level where that is wanted.
fn kind_path(chain: &Chain, stage: &Stage, options: &PathOptions, run: &Run) -> Result<Vec<Pose>, QpError> {
    let ideal = match options.kind {
        PathKind::Optimal if !options.level => return optimal(chain, stage, options, run),
        // Where it leads, at one size: a window that no longer turns with the frame has other corners.
        PathKind::Optimal => {
            optimal(chain, stage, options, run)?.into_iter().map(|p| Pose { z: p.z / p.z.norm(), ..p }).collect()
        }
        PathKind::Gaussian => ideal::gaussian(chain, options.smoothness_s),
        PathKind::Linear => ideal::polynomial(chain, 1),
        PathKind::Parabolic => ideal::polynomial(chain, 2),
        PathKind::Tripod => ideal::tripod(chain),
    };
    follow(chain, stage, options, &if options.level { ideal::leveled(chain, &ideal) } else { ideal }, run)
}

/// The path that balances shake, acceleration and crop.
fn optimal(chain: &Chain, stage: &Stage, options: &PathOptions, run: &Run) -> Result<Vec<Pose>, QpError> {
    let strength = chain.shake_strength();
    let about = ideal::gaussian(chain, options.smoothness_s.min(MAX_REFERENCE_S));
    let mut program = Program {
        chain,
        stage,
        strength: &strength,
        ideal: None,
        about: &about,
        smoothness_s: options.smoothness_s,
        min_crop: options.min_crop,
        sizing: sizing(options),
        window: options.window(),
    };
    let path = in_windows(&program, run)?;
    if program.sizing == Sizing::Shared && windows(chain).len() > 1 {
        // Every window of time has chosen its own size; the shot gets their mean, at which all were nearly content.
        program.sizing = Sizing::Pinned(mean(&path.iter().map(|p| p.z.re).collect::<Vec<f64>>()));
        return in_windows(&program, run);
    }
    Ok(path)
}

fn sizing(options: &PathOptions) -> Sizing {
    if options.border_allows_outside {
        return Sizing::Pinned(1.0);
    }
    match options.zoom {
        Zoom::Adaptive => Sizing::Adaptive,
        Zoom::Fixed | Zoom::None => Sizing::Shared,
    }
}

/// The given path at the largest window that fits all of it, or held inside the frame at the smallest allowed.
pub(super) fn follow(
    chain: &Chain,
    stage: &Stage,
    options: &PathOptions,
    ideal: &[Pose],
    run: &Run,
) -> Result<Vec<Pose>, QpError> {
    let window = options.window();
    let fits = ideal.iter().map(|&p| stage.widest(p)).fold(1.0, f64::min) / window;
    let size = if options.border_allows_outside { 1.0 } else { fits.max(options.min_crop) };
    let ideal: Vec<Pose> =
        ideal.iter().map(|p| attainable(stage, Pose { z: p.z * size, d: p.d }, options.min_crop, window)).collect();
    if ideal.iter().all(|&p| stage.overhang(p, window) <= 1e-9) {
        return Ok(ideal);
    }
    let strength = chain.shake_strength();
    let program = Program {
        chain,
        stage,
        strength: &strength,
        ideal: Some(&ideal),
        about: &ideal,
        smoothness_s: options.smoothness_s,
        min_crop: options.min_crop,
        sizing: if options.border_allows_outside { Sizing::Pinned(size) } else { Sizing::Followed },
        window,
    };
    in_windows(&program, run)
}

/// The pose nearest to `ideal` whose window is no smaller than allowed and would fit the frame with [`ROOM`] around it if it
/// stood in its middle: with the size held, the angle gives way. It stands no further off than half a diagonal: beyond,
/// only the direction matters, and numbers of many sizes of frames would be all that the solver sees.
fn attainable(stage: &Stage, ideal: Pose, min_crop: f64, window: f64) -> Pose {
    const HALVINGS: usize = 40;
    let size = ideal.z.norm().clamp(min_crop, 1.0 / window);
    let turned = |share: f64| C64::from_polar(1.0, share * ideal.z.arg());
    let needed = size * window / (1.0 - ROOM);
    let fits = |share: f64| stage.widest(Pose { z: turned(share), d: C64::new(0.0, 0.0) }) >= needed;
    let (mut inside, mut outside) = (0.0, 1.0);
    if fits(1.0) {
        inside = 1.0;
    } else {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            *if fits(middle) { &mut inside } else { &mut outside } = middle;
        }
    }
    Pose { z: turned(inside) * size, d: ideal.d / ideal.d.norm().max(1.0) }
}

/// Solves the shot. Where the solver stalls, with half the time constant: the weights of the accelerations, the largest
/// numbers by far, fall to a sixteenth.
fn in_windows(program: &Program<'_>, run: &Run) -> Result<Vec<Pose>, QpError> {
    let mut program = *program;
    loop {
        match window_by_window(&program, run) {
            Err(QpError::Stalled { .. }) if program.smoothness_s > MIN_S => program.smoothness_s /= 2.0,
            done => return done,
        }
    }
}

/// Of each window the first half is kept, its last two frames start the next.
fn window_by_window(program: &Program<'_>, run: &Run) -> Result<Vec<Pose>, QpError> {
    let mut done = Cameras::default();
    for frames in windows(program.chain) {
        let decided = done.path.len() - frames.start;
        let head = Cameras { path: done.path[frames.start..].to_vec(), ideal: done.ideal[frames.start..].to_vec() };
        let part = program.solve(frames.clone(), &head, run)?;
        let keep = if frames.end == program.chain.len() { frames.len() } else { frames.len() / 2 };
        done.path.extend(&part.path[decided..keep]);
        done.ideal.extend(&part.ideal[decided..keep]);
    }
    Ok(done.path)
}

/// Overlapping ranges of frames; each but the first starts two frames before what its predecessor keeps ends.
fn windows(chain: &Chain) -> Vec<Range<usize>> {
    let length = chain.frames(WINDOW_S).clamp(WINDOW_FRAMES.0, WINDOW_FRAMES.1) as usize;
    let n = chain.len();
    let mut ranges = Vec::new();
    let mut start = 0;
    while n - start > length + length / 2 {
        ranges.push(start..start + length);
        start += length / 2 - 2;
    }
    ranges.push(start..n);
    ranges
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

pub(super) fn validate(clip: &Clip<'_>, options: &PathOptions) -> Result<(), PathError> {
    for (option, value, low, high) in [
        ("smoothness", options.smoothness_s, 0.05, 30.0),
        ("min-crop", options.min_crop, 0.3, 1.0),
        ("reserve", options.reserve, 0.0, 0.1),
    ] {
        if !(value >= low && value <= high) {
            return Err(PathError::Option { option, value, low, high });
        }
    }
    if options.zoom == Zoom::None && !options.border_allows_outside {
        return Err(PathError::NoRoom);
    }
    if clip.width == 0 || clip.height == 0 {
        return Err(PathError::Size { width: clip.width, height: clip.height });
    }
    let covered = clip.shots.iter().try_fold(0, |end, s| (s.start == end && s.end > end).then_some(s.end));
    let (times, motions) = (clip.times_s.len(), clip.motion.len());
    if times != motions || covered != Some(times) {
        return Err(PathError::Lengths { times, motions, covered: covered.unwrap_or(0) });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::InterFrame;
    use plumbline_num::math::Vec2;

    /// A minute and a half of walking: drift, steps, tremor.
    fn long_walk(frames: usize) -> Vec<InterFrame> {
        let mut random = fastrand::Rng::with_seed(21);
        let mut at = Vec2::zeros();
        (0..frames)
            .map(|t| {
                let s = t as f64 / 10.0;
                let tremor = Vec2::new(random.f64() - 0.5, random.f64() - 0.5) * 6.0;
                let step = Vec2::new(9.0 * (6.0 * s).sin(), 6.0 * (12.0 * s).cos());
                let to = Vec2::new(20.0 * s + 60.0 * (0.3 * s).sin(), 10.0 * (0.7 * s).cos()) + step + tremor;
                let similarity = Similarity2 { t: to - at, ..Similarity2::IDENTITY };
                at = to;
                InterFrame { similarity, homography: similarity.to_homography(), reliable: true }
            })
            .collect()
    }

    #[test]
    fn windows_of_time_leave_no_trace_in_the_path() {
        let motion = long_walk(900);
        let times_s: Vec<f64> = (0..900).map(|t| f64::from(t) / 10.0).collect();
        let shot = 0..900;
        let clip =
            Clip { width: 640, height: 360, times_s: &times_s, motion: &motion, shots: std::slice::from_ref(&shot) };
        let stage = Stage::new(640, 360);
        let chain = Chain::of_shot(&clip, &stage, 0..900);
        assert!(windows(&chain).len() > 3, "{:?}", windows(&chain));
        let strength = chain.shake_strength();
        let program = Program {
            chain: &chain,
            stage: &stage,
            strength: &strength,
            ideal: None,
            about: &ideal::gaussian(&chain, 0.5),
            smoothness_s: 0.5,
            min_crop: 0.8,
            sizing: Sizing::Adaptive,
            window: 1.0,
        };
        let pieces = in_windows(&program, &Run::default()).expect("solvable");
        let whole = program.solve(0..900, &Cameras::default(), &Run::default()).expect("solvable").path;
        let apart = pieces.iter().zip(&whole).map(|(p, q)| (p.d - q.d).norm() + (p.z - q.z).norm()).fold(0.0, f64::max);
        assert!(apart < 1e-3, "{apart} of half the diagonal");
    }

    #[test]
    fn every_kind_of_path_is_found_at_every_setting_however_far_the_camera_goes() {
        let motion = long_walk(300);
        let times_s: Vec<f64> = (0..300).map(|t| f64::from(t) / 30.0).collect();
        let shot = 0..300;
        let clip =
            Clip { width: 640, height: 360, times_s: &times_s, motion: &motion, shots: std::slice::from_ref(&shot) };
        let kinds = [PathKind::Optimal, PathKind::Gaussian, PathKind::Linear, PathKind::Parabolic, PathKind::Tripod];
        let kinds = kinds.map(|kind| [(kind, false), (kind, true)]);
        for (kind, level) in kinds.into_iter().flatten() {
            for (smoothness_s, min_crop, outside) in settings([0.5, 5.0, 30.0], [0.3, 0.8, 1.0]) {
                let border_allows_outside = outside;
                let options = PathOptions {
                    kind,
                    smoothness_s,
                    min_crop,
                    border_allows_outside,
                    level,
                    ..PathOptions::default()
                };
                let path = plan(&clip, &options, &Run::default()).expect("valid input");
                let reason = &path.segments[0].reason;
                assert!(!reason.contains("no path"), "{options:?}: {reason}");
            }
        }
    }

    /// Every smoothness with every crop, once inside the frame and once beyond it.
    fn settings(smoothness: [f64; 3], crops: [f64; 3]) -> Vec<(f64, f64, bool)> {
        let with = |s: f64| crops.into_iter().flat_map(move |c| [(s, c, false), (s, c, true)]);
        smoothness.into_iter().flat_map(with).collect()
    }

    #[test]
    fn windows_cover_a_shot_and_stay_short() {
        for n in [3, 200, 2_000, 100_000] {
            let chain = Chain { step: vec![Pose::IDENTITY; n], rate: vec![1.0; n], fps: 30.0 };
            let ranges = windows(&chain);
            assert_eq!((ranges[0].start, ranges[ranges.len() - 1].end), (0, n));
            for pair in ranges.windows(2) {
                assert_eq!(pair[1].start + 2, pair[0].start + pair[0].len() / 2);
            }
            assert!(ranges.iter().all(|r| r.len() <= 1_440), "{ranges:?}");
        }
    }
}
