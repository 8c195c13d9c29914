//! From a clip's motion to its virtual path: shot by shot, in windows of time.

use std::ops::Range;

use super::chain::Chain;
use super::optimal::{Cameras, Program, Sizing, zoom_speeds};
use super::pose::{C64, FrameUnits, Pose, Room, settle};
use super::{Clip, Margins, PathError, PathKind, PathOptions, Segment, SegmentOutcome, VirtualPath, Zoom, ideal};
use plumbline_num::math::{Homography, Similarity2};
use plumbline_num::optim::qp::QpError;
use plumbline_num::run::{Run, Stopped};

/// Length (s) of the windows of time; half of each is look-ahead. Decisions reach as far as the zoom takes to change,
/// a few seconds, so half a window ahead leaves no trace of where it ends.
const WINDOW_S: f64 = 16.0;

/// Bounds of the same in frames, so that memory stays bounded at any frame rate.
const WINDOW_FRAMES: (f64, f64) = (240.0, 960.0);

/// Longest time constant (s) of the smooth path about which the program is stated: beyond, pans lead it far outside the frame.
const MAX_REFERENCE_S: f64 = 0.5;

/// Shortest time constant (s) tried after the solver stalls: the lower bound of the option itself.
const MIN_SMOOTHNESS_S: f64 = 0.05;

/// RMS shake (units of half the diagonal) below which a shot is static: 0.1 px at 1080p.
const STEADY: f64 = 1e-4;

/// Least margin that the smallest window must leave in the frame, as a fraction of it. With less the feasible set has so little
/// interior that no interior-point method finds it.
const MIN_MARGIN: f64 = 2e-3;

/// Least fraction of frames with reliable motion: with less than a third, bridged gaps would dominate the path of the shot.
const MIN_RELIABLE: f64 = 0.3;

/// Size of the window that stands for the center of the output, as a fraction of it: small against any crop, but with an
/// interior, which the solver needs.
const CENTER: f64 = 1e-3;

/// The virtual path of a clip.
///
/// # Errors
/// [`PathError::Options`], [`PathError::Input`] for invalid input. A shot whose program cannot be solved is left unchanged, and
/// its segment reports it. [`PathError::Interrupted`].
pub fn plan(clip: &Clip<'_>, options: &PathOptions, run: &Run) -> Result<VirtualPath, PathError> {
    validate(clip, options)?;
    let units = FrameUnits::new(clip.width, clip.height);
    Ok(plan_shots(clip, &units, options.window(), |shot| shot_path(clip, options, &units, shot, run), run)?)
}

/// The virtual path that shows `target` (`out_from_src` per frame): exactly where the border may show, otherwise constrained to
/// the frame with the largest window allowed.
///
/// # Errors
/// As for [`plan`]; [`PathError::Input`] also for a different number of target maps.
pub fn plan_along(
    clip: &Clip<'_>,
    options: &PathOptions,
    target: &[Similarity2],
    run: &Run,
) -> Result<VirtualPath, PathError> {
    validate(clip, options)?;
    expect_one_per_frame(clip, target.len())?;
    let units = FrameUnits::new(clip.width, clip.height);
    // Where the border may show, only the center of the output must lie on the frame.
    let window = if options.border_allows_outside { CENTER } else { options.window() };
    let mut plan = plan_shots(
        clip,
        &units,
        window,
        |shot| {
            let chain = Chain::of_shot(clip, &units, shot.clone());
            let ideal: Vec<Pose> = target[shot.clone()].iter().map(|w| window_of(&units, w)).collect();
            let rooms = rooms(clip, &units, &shot);
            let path = if options.border_allows_outside {
                Ok(ideal)
            } else {
                follow(&chain, &units, &rooms, options, &ideal, run)
            };
            let path = path.map_err(|e| format!("the given path cannot be followed: {e}"))?;
            Ok((path, "follows the given path".to_owned()))
        },
        run,
    )?;
    let followed = plan.segments.iter_mut().filter(|s| s.outcome == SegmentOutcome::Smoothed);
    followed.for_each(|s| s.outcome = SegmentOutcome::Given);
    Ok(plan)
}

/// `src_from_out` of a target map.
pub(super) fn window_of(units: &FrameUnits, out_from_src: &Similarity2) -> Pose {
    out_from_src.inverse().map_or(Pose::IDENTITY, |s| units.pose(s))
}

pub(super) fn expect_one_per_frame(clip: &Clip<'_>, covered: usize) -> Result<(), PathError> {
    let (times, motions) = (clip.times_s.len(), clip.motion.len());
    if times == motions && covered == times {
        return Ok(());
    }
    Err(PathError::Input(format!(
        "the clip has {times} timestamps, {motions} motions and shots that cover {covered} frames: expected equal numbers and \
         shots in order"
    )))
}

pub(super) fn plan_shots(
    clip: &Clip<'_>,
    units: &FrameUnits,
    window: f64,
    shot_path: impl Fn(Range<usize>) -> ShotPath,
    run: &Run,
) -> Result<VirtualPath, Stopped> {
    let mut plan =
        VirtualPath { out_from_src: Vec::new(), crop: Vec::new(), cameras: Vec::new(), segments: Vec::new() };
    for shot in clip.shots {
        let found = shot_path(shot.clone());
        // An interrupted shot must not be reported as one without a path.
        run.check()?;
        let segment = match found {
            Ok((path, reason)) => {
                for (pose, room) in path.into_iter().zip(rooms(clip, units, shot)) {
                    let (pose, out_from_src) = settle(units, pose, window, &room);
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

/// What the window of each frame of a shot must stay in.
pub(super) fn rooms(clip: &Clip<'_>, units: &FrameUnits, shot: &Range<usize>) -> Vec<Room> {
    shot.clone().map(|t| units.room(&clip.beyond.get(t).copied().unwrap_or_default())).collect()
}

/// The smoothed poses of a shot and a remark for the user, or the reason why it stays unchanged.
pub(super) type ShotPath = Result<(Vec<Pose>, String), String>;

pub(super) fn shot_path(
    clip: &Clip<'_>,
    options: &PathOptions,
    units: &FrameUnits,
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
    let chain = Chain::of_shot(clip, units, shot.clone());
    let before = mean(&chain.shake());
    if before < STEADY * STEADY && options.kind != PathKind::Tripod {
        return Err("already steady".to_owned());
    }
    if options.smallest_window() > 1.0 - MIN_MARGIN {
        return Err("the least crop leaves no room to move".to_owned());
    }
    let path = kind_path(&chain, units, &rooms(clip, units, &shot), options, run)
        .map_err(|e| format!("no path was found: {e}"))?;
    let after = mean(&chain.seen_through(&path).shake());
    if after.partial_cmp(&before) != Some(std::cmp::Ordering::Less) {
        return Err("smoothing would not have made it steadier".to_owned());
    }
    Ok((path, format!("shake lowered to {:.0} %", 100.0 * (after / before).sqrt())))
}

/// The path of the kind in the options, leveled if requested.
fn kind_path(
    chain: &Chain,
    units: &FrameUnits,
    rooms: &[Room],
    options: &PathOptions,
    run: &Run,
) -> Result<Vec<Pose>, QpError> {
    let ideal = match options.kind {
        PathKind::Optimal if !options.horizon_lock => return optimal(chain, units, rooms, options, run),
        // Its centers at one size: a window that no longer rotates with the frame has other corners.
        PathKind::Optimal => {
            optimal(chain, units, rooms, options, run)?.into_iter().map(|p| Pose { z: p.z / p.z.norm(), ..p }).collect()
        }
        PathKind::Gaussian => ideal::gaussian(chain, options.smoothness_s),
        PathKind::Linear => ideal::polynomial(chain, 1),
        PathKind::Parabolic => ideal::polynomial(chain, 2),
        PathKind::Tripod => ideal::tripod(chain),
    };
    let ideal = if options.horizon_lock { ideal::leveled(chain, &ideal) } else { ideal };
    follow(chain, units, rooms, options, &ideal, run)
}

/// The path that balances shake, acceleration and crop.
fn optimal(
    chain: &Chain,
    units: &FrameUnits,
    rooms: &[Room],
    options: &PathOptions,
    run: &Run,
) -> Result<Vec<Pose>, QpError> {
    let strength = chain.shake_strength();
    let about = ideal::gaussian(chain, options.smoothness_s.min(MAX_REFERENCE_S));
    let zoom_speeds = zoom_speeds(&chain.seen_through(&about));
    let mut program = Program {
        chain,
        units,
        rooms,
        strength: &strength,
        ideal: None,
        about: &about,
        smoothness_s: options.smoothness_s,
        min_crop: options.keep,
        sizing: sizing(options, &zoom_speeds),
        window: options.window(),
    };
    let path = in_windows(&program, run)?;
    if program.sizing == Sizing::Shared && windows(chain).len() > 1 {
        // Each window of time has its own optimal size; the shot gets their mean, which is nearly optimal for all.
        program.sizing = Sizing::Pinned(mean(&path.iter().map(|p| p.z.re).collect::<Vec<f64>>()));
        return in_windows(&program, run);
    }
    Ok(path)
}

fn sizing<'a>(options: &PathOptions, zoom_speeds: &'a [f64]) -> Sizing<'a> {
    if options.border_allows_outside {
        return Sizing::Pinned(1.0);
    }
    match options.zoom {
        Zoom::Adaptive => Sizing::Adaptive(zoom_speeds),
        Zoom::Fixed | Zoom::None => Sizing::Shared,
    }
}

/// The given path at the largest window that fits all of it, or constrained to the rooms at the smallest allowed.
pub(super) fn follow(
    chain: &Chain,
    units: &FrameUnits,
    rooms: &[Room],
    options: &PathOptions,
    ideal: &[Pose],
    run: &Run,
) -> Result<Vec<Pose>, QpError> {
    let window = options.window();
    let fits = ideal.iter().zip(rooms).map(|(&p, room)| units.widest(p, room)).fold(1.0, f64::min) / window;
    let size = if options.border_allows_outside { 1.0 } else { fits.max(options.keep) };
    let ideal: Vec<Pose> =
        ideal.iter().map(|p| attainable(units, Pose { z: p.z * size, d: p.d }, options.keep, window)).collect();
    if ideal.iter().zip(rooms).all(|(&p, room)| units.overhang(p, window, room) <= 1e-9) {
        return Ok(ideal);
    }
    let strength = chain.shake_strength();
    let program = Program {
        chain,
        units,
        rooms,
        strength: &strength,
        ideal: Some(&ideal),
        about: &ideal,
        smoothness_s: options.smoothness_s,
        min_crop: options.keep,
        sizing: if options.border_allows_outside { Sizing::Pinned(size) } else { Sizing::Followed },
        window,
    };
    in_windows(&program, run)
}

/// The pose nearest to `ideal` whose window, if centered, fits the frame with [`MIN_MARGIN`] around it and is no smaller than
/// allowed: the size is kept and the angle reduced. The displacement is limited to half a diagonal: beyond, only its direction
/// matters, and large numbers would degrade the conditioning of the program.
fn attainable(units: &FrameUnits, ideal: Pose, min_crop: f64, window: f64) -> Pose {
    // An angle of π to the last of 40 bits: far below what moves a corner by a pixel.
    const HALVINGS: usize = 40;
    let size = ideal.z.norm().clamp(min_crop, 1.0 / window);
    let rotated = |fraction: f64| C64::from_polar(1.0, fraction * ideal.z.arg());
    let needed = size * window / (1.0 - MIN_MARGIN);
    let frame = units.room(&Margins::default());
    let fits = |fraction: f64| units.widest(Pose { z: rotated(fraction), d: C64::new(0.0, 0.0) }, &frame) >= needed;
    let (mut inside, mut outside) = (0.0, 1.0);
    if fits(1.0) {
        inside = 1.0;
    } else {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            *if fits(middle) { &mut inside } else { &mut outside } = middle;
        }
    }
    Pose { z: rotated(inside) * size, d: ideal.d / ideal.d.norm().max(1.0) }
}

/// Solves the shot. Where the solver stalls, it is tried again with half the time constant: the weights of the accelerations,
/// by far the largest numbers, fall to a sixteenth.
fn in_windows(program: &Program<'_>, run: &Run) -> Result<Vec<Pose>, QpError> {
    let mut program = *program;
    loop {
        match window_by_window(&program, run) {
            Err(QpError::Stalled { .. }) if program.smoothness_s > MIN_SMOOTHNESS_S => program.smoothness_s /= 2.0,
            done => return done,
        }
    }
}

/// Of each window the first half is kept; its last two frames are the fixed head of the next.
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
    options.check()?;
    if clip.width == 0 || clip.height == 0 {
        let size = format!("{}x{}", clip.width, clip.height);
        return Err(PathError::Input(format!("frame size {size} is invalid (expected at least 1x1)")));
    }
    let covered = clip.shots.iter().try_fold(0, |end, s| (s.start == end && s.end > end).then_some(s.end));
    expect_one_per_frame(clip, covered.unwrap_or(0))
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
    fn solving_in_windows_of_time_gives_the_path_of_the_whole_shot() {
        let motion = long_walk(900);
        let times_s: Vec<f64> = (0..900).map(|t| f64::from(t) / 10.0).collect();
        let shot = 0..900;
        let clip = Clip {
            width: 640,
            height: 360,
            times_s: &times_s,
            motion: &motion,
            shots: std::slice::from_ref(&shot),
            beyond: &[],
        };
        let units = FrameUnits::new(640, 360);
        let chain = Chain::of_shot(&clip, &units, 0..900);
        assert!(windows(&chain).len() > 3, "{:?}", windows(&chain));
        let strength = chain.shake_strength();
        let about = ideal::gaussian(&chain, 0.5);
        let zoom_speeds = zoom_speeds(&chain.seen_through(&about));
        let program = Program {
            chain: &chain,
            units: &units,
            rooms: &rooms(&clip, &units, &shot),
            strength: &strength,
            ideal: None,
            about: &about,
            smoothness_s: 0.5,
            min_crop: 0.8,
            sizing: Sizing::Adaptive(&zoom_speeds),
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
        let clip = Clip {
            width: 640,
            height: 360,
            times_s: &times_s,
            motion: &motion,
            shots: std::slice::from_ref(&shot),
            beyond: &[],
        };
        let kinds = [PathKind::Optimal, PathKind::Gaussian, PathKind::Linear, PathKind::Parabolic, PathKind::Tripod];
        let kinds = kinds.map(|kind| [(kind, false), (kind, true)]);
        for (kind, horizon_lock) in kinds.into_iter().flatten() {
            for (smoothness_s, keep, outside) in settings([0.5, 5.0, 30.0], [0.3, 0.8, 1.0]) {
                let border_allows_outside = outside;
                let options = PathOptions {
                    kind,
                    smoothness_s,
                    keep,
                    border_allows_outside,
                    horizon_lock,
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
