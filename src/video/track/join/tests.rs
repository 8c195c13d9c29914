//! Windows of synthetic clips against the same clip tracked in one: a textured plane under a camera in a hand.

use super::*;
use crate::track::{FrameQuality, TrackOptions, Tracker};
use plumbline_image::Plane;
use plumbline_num::math::{Point2, Similarity2, Vec2};
use plumbline_num::time::Timestamp;
use plumbline_testkit::plane::texture;
use rayon::prelude::*;

const W: usize = 320;
const H: usize = 180;

/// The textured plane `seed` seen through `frame_from_plane`.
fn seen(frame_from_plane: &Similarity2, seed: u64) -> Plane<u8> {
    let plane_from_frame = frame_from_plane.inverse().expect("a camera in front of the plane");
    Plane::from_fn(W, H, |x, y| {
        let p = plane_from_frame.apply(Point2::new(x as f64 + 0.5, y as f64 + 0.5));
        texture(p, seed).round() as u8
    })
}

/// Camera `i` of a hand-held sequence.
fn hand_held(i: usize) -> Similarity2 {
    let t = i as f64;
    let shift = Vec2::new(9.0 * (0.7 * t).sin(), 6.0 * (0.9 * t + 1.0).sin());
    let center = Point2::new(W as f64 / 2.0, H as f64 / 2.0);
    Similarity2::about(center, 0.015 * (0.8 * t).sin(), 1.0 + 0.012 * (0.5 * t).sin(), shift)
}

fn tracker() -> Tracker {
    let options = TrackOptions { points: 300, analysis_side: W };
    Tracker::new(W, H, options, None).expect("in range")
}

/// Points that two frames share, in both.
fn shared<'a>(a: &'a FrameTracks, b: &'a FrameTracks) -> Vec<(&'a Observation, &'a Observation)> {
    a.observations.iter().filter_map(|o| Some((o, position(b, o.id)?))).collect()
}

/// Distances between where shared points were found and where `b_from_a` puts them, ascending, px.
fn misses(a: &FrameTracks, b: &FrameTracks, b_from_a: &Similarity2) -> Vec<f64> {
    let miss = |(p, q): (&Observation, &Observation)| {
        let truth = b_from_a.apply(Point2::new(p.x.into(), p.y.into()));
        (truth - Point2::new(q.x.into(), q.y.into())).norm()
    };
    let mut misses: Vec<f64> = shared(a, b).into_iter().map(miss).collect();
    misses.sort_by(f64::total_cmp);
    misses
}

/// Short windows, so that a few pictures have several borders.
const WINDOWS: AnalysisWindows = AnalysisWindows::SHORT;

/// The pictures of each window, tracked by a tracker of its own.
fn in_windows(windows: AnalysisWindows, pictures: &[&Plane<u8>]) -> Vec<(usize, Vec<FrameTracks>)> {
    let tracked = |window: usize| {
        let read = windows.read(window);
        let mut tracker = tracker();
        let frames = (read.start..read.end.min(pictures.len()))
            .map(|i| tracker.push_luma(pictures[i].as_ref(), Timestamp(i as i64)))
            .collect();
        (window, frames)
    };
    (0..windows.count(pictures.len())).map(tracked).collect()
}

fn joiner(windows: AnalysisWindows) -> TrackJoiner {
    TrackJoiner::new(windows, (W, H), W)
}

/// The clip of windows that are pushed one behind the other.
fn joined(windows: AnalysisWindows, tracked: Vec<(usize, Vec<FrameTracks>)>) -> Vec<FrameTracks> {
    let mut joiner = joiner(windows);
    let mut clip = Vec::new();
    for (window, frames) in tracked {
        for tracks in frames {
            clip.extend(joiner.push(window, tracks).expect("in order"));
        }
    }
    clip.extend(joiner.finish());
    clip
}

fn refs(pictures: &[Plane<u8>]) -> Vec<&Plane<u8>> {
    pictures.iter().collect()
}

/// The clip as one window.
fn undivided(pictures: &[&Plane<u8>]) -> Vec<FrameTracks> {
    let whole = AnalysisWindows::new(pictures.len().max(16), 16).expect("in range");
    joined(whole, in_windows(whole, pictures))
}

fn verdicts(clip: &[FrameTracks]) -> Vec<FrameQuality> {
    clip.iter().map(|t| t.quality).collect()
}

#[test]
fn a_clip_of_one_window_is_what_its_tracker_says() {
    let pictures: Vec<_> = (0..6).map(|i| seen(&hand_held(i), 1)).collect();
    let mut tracker = tracker();
    let tracked: Vec<_> = (0..).zip(&pictures).map(|(i, p)| tracker.push_luma(p.as_ref(), Timestamp(i))).collect();
    assert_eq!(undivided(&refs(&pictures)), tracked);
}

#[test]
fn long_tracks_keep_their_ids_and_their_motion_across_borders() {
    let cameras: Vec<_> = (0..60).map(hand_held).collect();
    let pictures: Vec<_> = cameras.iter().map(|h| seen(h, 1)).collect();
    let (clip, whole) = (joined(WINDOWS, in_windows(WINDOWS, &refs(&pictures))), undivided(&refs(&pictures)));
    assert_eq!(clip.len(), 60);
    for border in [WINDOWS.length(), 2 * WINDOWS.length()] {
        for i in border - 1..=border + 1 {
            let truth = cameras[i] * cameras[i - 1].inverse().expect("regular");
            let misses = misses(&clip[i - 1], &clip[i], &truth);
            let expected = shared(&whole[i - 1], &whole[i]).len();
            assert!(10 * misses.len() > 9 * expected, "frame {i}: {} points of {expected}", misses.len());
            let (median, worst) = (misses[misses.len() / 2], misses[misses.len() * 99 / 100]);
            assert!(median < 0.05 && worst < 0.5, "frame {i}: median {median}, p99 {worst}");
        }
        let over = |clip: &[FrameTracks]| shared(&clip[border - 12], &clip[border + 12]).len();
        assert!(2 * over(&clip) > over(&whole), "{} of {} tracks cross the border", over(&clip), over(&whole));
        let truth = cameras[border + 8] * cameras[border - 8].inverse().expect("regular");
        let drift = misses(&clip[border - 8], &clip[border + 8], &truth);
        assert!(drift[drift.len() / 2] < 0.2, "median {}", drift[drift.len() / 2]);
    }
    for t in &clip {
        assert!(t.observations.is_sorted_by(|a, b| a.id < b.id), "unique and ascending");
    }
}

#[test]
fn the_order_in_which_windows_are_tracked_does_not_change_a_bit() {
    let pictures: Vec<_> = (0..60).map(|i| seen(&hand_held(i), 1)).collect();
    let tracked = in_windows(WINDOWS, &refs(&pictures));
    let one_behind_the_other = joined(WINDOWS, tracked.clone());
    // Frame by frame, as a single pass over the clip has them: the next window's warm-up between the frames of the former.
    let mut joiner = joiner(WINDOWS);
    let mut streamed = Vec::new();
    for i in 0..pictures.len() {
        for window in WINDOWS.of(i).filter(|w| *w < tracked.len()) {
            let tracks = tracked[window].1[i - WINDOWS.read(window).start].clone();
            streamed.extend(joiner.push(window, tracks).expect("in order"));
        }
    }
    streamed.extend(joiner.finish());
    assert!(streamed == one_behind_the_other && streamed.len() == 60);
}

/// The pictures that events are made of, by frame.
struct Pictures {
    plain: Vec<Plane<u8>>,
    /// Of another scene, darker.
    other: Vec<Plane<u8>>,
    black: Plane<u8>,
    flash: Plane<u8>,
}

impl Pictures {
    fn new(frames: usize) -> Self {
        let other = |i| {
            let picture = seen(&hand_held(i), 5);
            Plane::from_fn(W, H, |x, y| picture.as_ref().row(y)[x] / 3)
        };
        let lit = seen(&hand_held(3), 1);
        Self {
            plain: (0..frames).map(|i| seen(&hand_held(i), 1)).collect(),
            other: (0..frames).map(other).collect(),
            black: Plane::from_fn(W, H, |_, _| 16),
            flash: Plane::from_fn(W, H, |x, y| 255 - (255 - lit.as_ref().row(y)[x]) / 9),
        }
    }
}

/// What a clip shows in frame `i`, `k` frames after the event began; `None` where it is over.
type Event = for<'a> fn(&'a Pictures, usize, usize) -> Option<&'a Plane<u8>>;

const EVENTS: [(&str, Event); 6] = [
    ("black", |p, _, k| (k < 5).then_some(&p.black)),
    ("black that is not bridged", |p, _, k| (k < 12).then_some(&p.black)),
    ("flash", |p, _, k| (k < 2).then_some(&p.flash)),
    ("still", |p, i, k| (k < 4).then(|| &p.plain[i - k])),
    ("cut", |p, i, _| Some(&p.other[i])),
    // The longest that a tracker remembers.
    ("flash after black", |p, _, k| [&p.black; 10].into_iter().chain([&p.flash]).nth(k)),
];

#[test]
fn events_at_every_offset_from_a_border_are_classified_as_by_an_undivided_tracker() {
    let pictures = Pictures::new(2 * WINDOWS.length());
    let border = WINDOWS.length();
    let starts = border - WINDOWS.warm_up() - 2..border + 3;
    let cases: Vec<_> = EVENTS.into_iter().flat_map(|event| starts.clone().map(move |start| (event, start))).collect();
    cases.par_iter().for_each(|&((name, event), start)| {
        let shown = |i: usize| i.checked_sub(start).and_then(|k| event(&pictures, i, k)).unwrap_or(&pictures.plain[i]);
        let clip: Vec<&Plane<u8>> = (0..border + 12).map(shown).collect();
        let (joined, whole) = (joined(WINDOWS, in_windows(WINDOWS, &clip)), undivided(&clip));
        assert_eq!(verdicts(&joined), verdicts(&whole), "{name} at {start}");
        let noticed = |q: &FrameQuality| q.black || q.duplicate || q.cut_before || q.bridged > 0;
        assert!(verdicts(&whole)[start..].iter().any(noticed), "{name} at {start}");
        for i in start.max(1)..joined.len() {
            let pairs = |clip: &[FrameTracks]| shared(&clip[i - 1], &clip[i]).len();
            let (found, expected) = (pairs(&joined), pairs(&whole));
            assert!(10 * found >= 9 * expected, "{name} at {start}: {found} of {expected} pairs at {i}");
        }
    });
}

#[test]
fn windows_out_of_order_or_of_another_clip_are_refused() {
    let pictures: Vec<_> = (0..30).map(|i| seen(&hand_held(i), 1)).collect();
    let tracked = in_windows(WINDOWS, &refs(&pictures));
    let refused = |frames: &[(usize, &FrameTracks)]| {
        let mut joiner = joiner(WINDOWS);
        let mut pushed = frames.iter().map(|(window, tracks)| joiner.push(*window, (*tracks).clone()));
        pushed.find_map(Result::err).expect("refused").to_string()
    };
    let of = |window: usize| tracked[window].1.iter().map(move |t| (window, t)).collect::<Vec<_>>();
    assert_eq!(
        refused(&[&of(0)[..3], &of(1)].concat()),
        "a frame of analysis window 1 follows frame 3 of the clip (expected window 0)"
    );
    assert_eq!(
        refused(&[of(0), of(0)].concat()),
        "a frame of analysis window 0 follows frame 20 of the clip (expected window 1)"
    );
    let mut late = of(1).into_iter().map(|(window, t)| (window, t.clone())).collect::<Vec<_>>();
    for (_, t) in &mut late {
        t.pts = Timestamp(t.pts.0 + 1);
    }
    let late: Vec<_> = late.iter().map(|(window, t)| (*window, t)).collect();
    assert_eq!(
        refused(&[of(0), late].concat()),
        "the warm-up of analysis window 1 has other times than the end of window 0; analyze both again"
    );
    assert!(refused(&[of(0), of(1)[1..].to_vec()].concat()).contains("has other times"), "a frame is missing");
}
