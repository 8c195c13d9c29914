use std::cell::Cell;
use std::io;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::*;
use crate::motion::MotionQuality;
use crate::stabilize::{ModelChoice, PathMethod, TrackingOptions};
use plumbline_image::{Layout, PixelFormat};
use plumbline_num::math::{Point2, PointMap, Vec2};
use plumbline_num::run::{Budget, Interrupt, Progress, Stopped};
use plumbline_num::time::Timebase;

const SIZE: (usize, usize) = (320, 180);
const FRAMES: usize = 40;

/// A textured wall, recorded by a camera that drifts and trembles.
struct Wall {
    frames: usize,
    /// Frame that cannot be read.
    broken: Option<usize>,
    /// Frame at which the reader stops the run.
    stops: Option<(usize, Interrupt)>,
    /// How often the clip was opened.
    opened: Cell<usize>,
}

impl Wall {
    fn new(frames: usize) -> Self {
        Self { frames, broken: None, stops: None, opened: Cell::new(0) }
    }

    /// Where the camera looks in frame `t`, px of the wall.
    fn camera(t: usize) -> Vec2 {
        let tremor = [0.0, 5.0, -3.0, 4.0, -5.0, 2.0, -4.0];
        Vec2::new(1.5 * t as f64 + tremor[t % 7], 0.5 * t as f64 + tremor[(t + 3) % 5])
    }

    /// Gray level of the wall: smooth spots of random brightness, 8 px apart.
    fn shade(x: f64, y: f64) -> u8 {
        let spot = |i: i64, j: i64| {
            let mixed = (i.wrapping_mul(0x9e37_79b9) ^ j.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0xc2b2_ae35);
            ((mixed >> 16) & 0xff) as f64
        };
        let (u, v) = (x / 8.0, y / 8.0);
        let (i, j) = (u.floor() as i64, v.floor() as i64);
        let (a, b) = (u - u.floor(), v - v.floor());
        let row = |j: i64| spot(i, j) * (1.0 - a) + spot(i + 1, j) * a;
        (row(j) * (1.0 - b) + row(j + 1) * b) as u8
    }

    fn frame(t: usize) -> Frame {
        let mut frame = Frame::new(PixelFormat::opaque(Layout::Gray, 8), SIZE.0, SIZE.1);
        frame.pts = Timestamp(t as i64);
        let at = Self::camera(t);
        let mut luma = frame.plane8_mut(0).expect("8 bit");
        for y in 0..SIZE.1 {
            for (x, v) in luma.row_mut(y).iter_mut().enumerate() {
                *v = Self::shade(x as f64 + at.x, y as f64 + at.y);
            }
        }
        frame
    }
}

impl FrameSource for Wall {
    type Error = io::Error;

    fn info(&self) -> ClipInfo {
        let frames = Some(self.frames as u64);
        ClipInfo { frames, ..ClipInfo::new(SIZE.0, SIZE.1, Timebase { num: 1, den: 30 }) }
    }

    fn frames(&self) -> Result<impl Iterator<Item = Result<Frame, io::Error>>, io::Error> {
        self.opened.set(self.opened.get() + 1);
        Ok((0..self.frames).map(|t| {
            if let Some((_, interrupt)) = self.stops.as_ref().filter(|(at, _)| *at == t) {
                interrupt.stop();
            }
            if self.broken == Some(t) {
                Err(io::Error::other(format!("frame {t} is torn")))
            } else {
                Ok(Self::frame(t))
            }
        }))
    }
}

fn stabilizer() -> Stabilizer {
    Stabilizer::new(StabilizerOptions::default()).expect("the defaults are in range")
}

fn analysis() -> Analysis {
    stabilizer().analyze(&Wall::new(FRAMES), &Run::default()).expect("a clip with texture")
}

/// RMS of the second difference of positions, px.
fn unrest(positions: &[Vec2]) -> f64 {
    let second = positions.windows(3).map(|p| (p[2] - 2.0 * p[1] + p[0]).norm_squared());
    (second.sum::<f64>() / (positions.len() - 2) as f64).sqrt()
}

#[test]
fn the_maps_of_a_plan_remove_the_shake() {
    let (source, analysis) = (Wall::new(FRAMES), analysis());
    let plan = stabilizer().plan(&analysis, &Run::default()).expect("a path");
    let mut maps = plan.maps().expect("a grid");
    let center = Point2::new(SIZE.0 as f64 / 2.0, SIZE.1 as f64 / 2.0);
    let mut shown = Vec::new();
    for (t, frame) in source.frames().expect("opens").enumerate() {
        let map = maps.next(&frame.expect("a frame")).expect("a map");
        shown.push(map.map(center).expect("inside").coords + Wall::camera(t));
    }
    let recorded: Vec<Vec2> = (0..FRAMES).map(Wall::camera).collect();
    assert!(unrest(&shown) < 0.1 * unrest(&recorded), "{} of {}", unrest(&shown), unrest(&recorded));

    let summary = plan.summary();
    let shake = summary.shake.expect("the motion was measured");
    assert!(shake.before.px > 2.0 && shake.after.px < 0.5 * shake.before.px, "{shake:?}");
    assert!(summary.min_crop >= 0.8 - 1e-6 && summary.min_crop <= summary.mean_crop, "{summary:?}");
    assert_eq!(summary.segments.last().map(|s| s.frames.end), Some(FRAMES));
    assert!(summary.segments.iter().all(|s| !s.reason.is_empty()));
}

#[test]
fn a_map_out_of_order_equals_the_map_in_order() {
    let analysis = analysis();
    let mut stabilizer = stabilizer();
    for mode in [ModelChoice::Mesh, ModelChoice::Subspace, ModelChoice::Similarity] {
        let mut options = StabilizerOptions::default();
        options.warp.mode = mode;
        stabilizer.set_options(options).expect("in range");
        let plan = stabilizer.plan(&analysis, &Run::default()).expect("a path");
        let mut maps = plan.maps().expect("a grid");
        for t in 0..FRAMES {
            let frame = Wall::frame(t);
            let in_order = maps.next(&frame).expect("a map");
            if t % 13 != 5 {
                continue;
            }
            let alone = plan.map(t, Some(&frame)).expect("a map");
            for p in [(20.0, 30.0), (160.0, 90.0), (300.0, 170.0)].map(|(x, y)| Point2::new(x, y)) {
                assert_eq!(in_order.map(p), alone.map(p), "{mode}, frame {t}");
            }
        }
        let beyond = plan.map(FRAMES, None).expect_err("no such frame");
        assert_eq!(beyond.to_string(), format!("the clip has more frames than were analyzed ({FRAMES})"));
    }
}

#[test]
fn planning_again_reads_no_frame_and_follows_the_new_options() {
    let source = Wall::new(FRAMES);
    let mut stabilizer = stabilizer();
    let analysis = stabilizer.analyze(&source, &Run::default()).expect("a clip with texture");
    assert_eq!(source.opened.get(), 1);
    let first = stabilizer.plan(&analysis, &Run::default()).expect("a path");
    let mut options = stabilizer.options().clone().with_keep(0.6);
    options.path.path = PathMethod::Tripod;
    stabilizer.set_options(options).expect("in range");
    let second = stabilizer.plan(&analysis, &Run::default()).expect("a path");
    assert_eq!(source.opened.get(), 1, "nothing is read again");
    assert_ne!(first.path().crop, second.path().crop);
    let again = stabilizer.plan(&analysis, &Run::default()).expect("a path");
    assert_eq!(second.path().crop, again.path().crop, "the same options give the same plan");
}

#[test]
fn an_interrupted_call_stops_at_the_next_frame() {
    let interrupt = Interrupt::new();
    let source = Wall { stops: Some((5, interrupt.clone())), ..Wall::new(1_000_000) };
    let run = Run::with_interrupt(&interrupt);
    let stopped = stabilizer().analyze(&source, &run).expect_err("stopped");
    assert!(matches!(stopped, StabilizeError::Interrupted(Stopped::Interrupted)), "{stopped}");
    let stopped = stabilizer().plan(&analysis(), &run).expect_err("stopped");
    assert!(matches!(stopped, StabilizeError::Interrupted(Stopped::Interrupted)), "{stopped}");
}

#[test]
fn a_call_stops_when_its_time_is_used_up() {
    let run = Run { budget: Budget::time(Duration::ZERO), ..Run::default() };
    let late = stabilizer().analyze(&Wall::new(FRAMES), &run).expect_err("no time");
    assert!(matches!(late, StabilizeError::Interrupted(Stopped::OutOfTime)), "{late}");
}

#[test]
fn the_progress_of_an_analysis_rises_to_its_end() {
    let heard = Arc::new(Mutex::new(Vec::new()));
    let listener = Arc::clone(&heard);
    let progress = Progress::new(move |f| listener.lock().expect("no thread panics here").push(f));
    let run = Run { progress, ..Run::default() };
    let mut options = StabilizerOptions::default();
    options.motion.cameras = false;
    let stabilizer = Stabilizer::new(options).expect("in range");
    stabilizer.analyze(&Wall::new(10), &run).expect("a clip with texture");
    let heard = heard.lock().expect("no thread panics here");
    assert!(heard.len() >= 10 && heard.is_sorted() && heard.last() == Some(&1.0), "{heard:?}");
}

#[test]
fn errors_report_cause_and_fault() {
    let analyze = |source: &Wall| stabilizer().analyze(source, &Run::default()).expect_err("refused");
    let torn = analyze(&Wall { broken: Some(3), ..Wall::new(FRAMES) });
    assert!(matches!(&torn, StabilizeError::Frames(source) if source.to_string() == "frame 3 is torn"), "{torn}");
    let empty = analyze(&Wall::new(0));
    assert!(matches!(&empty, StabilizeError::Input(text) if text.contains("no frame")), "{empty}");
    let mut options = StabilizerOptions::default();
    options.track.mask = Some("no/such/mask.png".into());
    let masked = Stabilizer::new(options).expect("in range").analyze(&Wall::new(FRAMES), &Run::default());
    let masked = masked.expect_err("no mask");
    assert!(matches!(&masked, StabilizeError::Input(text) if text.contains("no/such/mask.png")), "{masked}");
    let mut options = StabilizerOptions::default();
    options.path.path_file = Some("path.json".into());
    let unaligned =
        Analysis { motion: Arc::new(ClipMotion { cameras: None, ..analysis().motion().clone() }), ..analysis() };
    let unaligned = Stabilizer::new(options).expect("in range").plan(&unaligned, &Run::default());
    assert!(matches!(unaligned, Err(StabilizeError::PathFileWithoutCameras)));
    let narrow = Stabilizer::new(StabilizerOptions::default().with_keep(1.5)).expect_err("too much");
    assert_eq!(narrow.to_string(), "keep 1.5 is invalid (expected 0.3 to 1)");
    assert!(matches!(narrow, StabilizeError::Options(_)), "{narrow:?}");
}

#[test]
fn a_motion_file_gives_the_plan_that_tracking_gave() {
    let analysis = analysis();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("motion.json");
    let mut bytes = Vec::new();
    analysis.motion().write_json_with_tracks(&mut bytes, &analysis.tracks().store).expect("in memory");
    std::fs::write(&path, bytes).expect("a small file");
    let source = Wall::new(FRAMES);
    let imported = stabilizer().import(&path, &source, &Run::default()).expect("its own format");
    assert_eq!(imported.motion().frames.len(), FRAMES);
    assert!(imported.motion().frames.iter().skip(1).all(|f| f.quality == MotionQuality::Measured));
    let crops = |analysis: &Analysis| stabilizer().plan(analysis, &Run::default()).expect("a path").path().crop.clone();
    let off = crops(&analysis).iter().zip(crops(&imported)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 1e-6, "{off}");
    let longer = stabilizer().import(&path, &Wall::new(FRAMES + 1), &Run::default()).expect_err("another clip");
    assert!(longer.to_string().ends_with("it belongs to another clip or span"), "{longer}");
}

/// The motion file of a clip, with its points.
fn motion_file((motion, tracks): (ClipMotion, Tracks)) -> Vec<u8> {
    let mut bytes = Vec::new();
    motion.write_json_with_tracks(&mut bytes, &tracks.store).expect("memory");
    bytes
}

#[test]
fn windows_tracked_apart_in_any_order_give_the_motion_file_of_one_pass_bit_for_bit() {
    let (source, options) = (Wall::new(60), TrackingOptions::default());
    let windows = AnalysisWindows::new(20, 16).expect("in range");
    let mut one_pass = ClipTracker::in_windows(&source.info(), &options, windows, None).expect("no mask");
    for t in 0..source.frames {
        one_pass.push(&Wall::frame(t)).expect("room for tracks");
    }
    let one_pass = motion_file(one_pass.finish().expect("frames"));
    let tracked = |window: usize| {
        let mut tracker = WindowTracker::new(&source.info(), &options, windows, window).expect("no mask");
        tracker.frames().filter(|t| *t < source.frames).for_each(|t| tracker.push(&Wall::frame(t)));
        let mut file = Vec::new();
        tracker.finish().write(&mut file).expect("memory");
        file
    };
    let files: Vec<Vec<u8>> = (0..windows.count(source.frames)).rev().map(tracked).collect();
    assert_eq!(files.len(), 3);
    let mut joiner = WindowJoiner::new(&source.info(), &options, windows, None).expect("a temporary folder");
    for file in files.iter().rev() {
        joiner.push(WindowTracks::read(&file[..]).expect("just written")).expect("in order");
    }
    assert!(motion_file(joiner.finish().expect("frames")) == one_pass);
    let whole = AnalysisWindows::new(60, 16).expect("in range");
    let mut undivided = ClipTracker::in_windows(&source.info(), &options, whole, None).expect("no mask");
    (0..60).for_each(|t| assert!(!undivided.push(&Wall::frame(t)).expect("room for tracks")));
    assert!(motion_file(undivided.finish().expect("frames")) != one_pass, "the borders are there");
}

#[test]
fn a_clip_is_analyzed_by_its_windows() {
    let (stabilizer, source, run) = (stabilizer(), Wall::new(FRAMES), Run::default());
    let window = stabilizer.analyze_window(&source, 0, &run).expect("frames");
    let joined = stabilizer.join(&source.info(), [Ok(window.clone())], &run).expect("one window");
    assert!(joined.motion() == stabilizer.analyze(&source, &run).expect("frames").motion());
    let beyond = stabilizer.analyze_window(&source, 1, &run).expect_err("a short clip").to_string();
    assert_eq!(beyond, "the clip has no frame in analysis window 1: its last one is 39");
    let other = ClipInfo::new(64, 64, Timebase { num: 1, den: 30 });
    let other = stabilizer.join(&other, [Ok(window)], &run).expect_err("another size").to_string();
    assert_eq!(other, "analysis window 0 is of a clip of (320, 180) px (expected (64, 64))");
    let none = stabilizer.join(&source.info(), [], &run).expect_err("no window").to_string();
    assert_eq!(none, "the clip has no frame that could be decoded");
}
