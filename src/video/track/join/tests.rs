//! Windows of synthetic clips against the same clip tracked in one: a textured plane under a camera in a hand.

use super::*;
use crate::track::{FrameQuality, TrackOptions, Tracker};
use plumbline_image::Plane;
use plumbline_num::math::{Point2, Similarity2, Vec2};
use plumbline_num::time::Timestamp;

const W: usize = 320;
const H: usize = 180;

/// Smooth value noise in [−1, 1]: lattice values blended by a smooth step.
fn noise(x: f64, y: f64, seed: u64) -> f64 {
    let (i, j) = (x.floor(), y.floor());
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (a, b) = (smooth(x - i), smooth(y - j));
    let at = |di: f64, dj: f64| {
        let key = ((i + di) as i64 as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
            ^ ((j + dj) as i64 as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
        let mut k = key ^ seed.wrapping_mul(0x1656_67b1_9e37_79f9);
        k = (k ^ (k >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        k = (k ^ (k >> 29)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((k >> 40) as f64 / f64::from(1 << 23)) - 1.0
    };
    let (top, bottom) = (at(0.0, 0.0) * (1.0 - a) + at(1.0, 0.0) * a, at(0.0, 1.0) * (1.0 - a) + at(1.0, 1.0) * a);
    top * (1.0 - b) + bottom * b
}

/// The textured plane `seed` seen through `frame_from_plane`.
fn seen(frame_from_plane: &Similarity2, seed: u64) -> Plane<u8> {
    let plane_from_frame = frame_from_plane.inverse().expect("a camera in front of the plane");
    Plane::from_fn(W, H, |x, y| {
        let p = plane_from_frame.apply(Point2::new(x as f64 + 0.5, y as f64 + 0.5));
        let octave = |size: f64, k: u64| noise(p.x / size, p.y / size, seed * 16 + k);
        let gray: f64 = 125.0 + 55.0 * octave(61.0, 0) + 45.0 * octave(17.0, 1) + 35.0 * octave(6.0, 2);
        gray.clamp(0.0, 255.0).round() as u8
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
const WINDOWS: AnalysisWindows = AnalysisWindows { length: 24, warm_up: 16 };

/// The pictures of each window, tracked by a tracker of its own.
fn in_windows(windows: AnalysisWindows, pictures: &[Plane<u8>]) -> Vec<(usize, Vec<FrameTracks>)> {
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

/// The clip as one window.
fn undivided(pictures: &[Plane<u8>]) -> Vec<FrameTracks> {
    let whole = AnalysisWindows { length: pictures.len(), ..WINDOWS };
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
    assert_eq!(undivided(&pictures), tracked);
}

#[test]
fn long_tracks_keep_their_ids_and_their_motion_across_borders() {
    let cameras: Vec<_> = (0..60).map(hand_held).collect();
    let pictures: Vec<_> = cameras.iter().map(|h| seen(h, 1)).collect();
    let (clip, whole) = (joined(WINDOWS, in_windows(WINDOWS, &pictures)), undivided(&pictures));
    assert_eq!(clip.len(), 60);
    for border in [24, 48] {
        for i in border - 1..=border + 1 {
            let truth = cameras[i] * cameras[i - 1].inverse().expect("regular");
            let misses = misses(&clip[i - 1], &clip[i], &truth);
            let expected = shared(&whole[i - 1], &whole[i]).len();
            assert!(10 * misses.len() > 9 * expected, "frame {i}: {} points of {expected}", misses.len());
            let (median, worst) = (misses[misses.len() / 2], misses[misses.len() * 99 / 100]);
            assert!(median < 0.05 && worst < 0.5, "frame {i}: median {median}, p99 {worst}");
        }
        let over = |clip: &[FrameTracks]| shared(&clip[border - 12], &clip[border + 12]).len();
        assert!(5 * over(&clip) > 3 * over(&whole), "{} of {} tracks cross the border", over(&clip), over(&whole));
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
    let tracked = in_windows(WINDOWS, &pictures);
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

/// What happens to a clip over some frames: picture `i` of the clip, `k` frames after the beginning of the event.
type Event = fn(usize, usize) -> Option<Plane<u8>>;

#[test]
fn events_at_every_offset_from_a_border_are_classified_as_by_an_undivided_tracker() {
    let black: Event = |_, k| (k < 5).then(|| Plane::from_fn(W, H, |_, _| 16));
    let long_black: Event = |_, k| (k < 13).then(|| Plane::from_fn(W, H, |_, _| 16));
    let flash: Event = |_, k| {
        (k < 2).then(|| {
            let picture = seen(&hand_held(3), 1);
            Plane::from_fn(W, H, |x, y| 255 - (255 - picture.as_ref().row(y)[x]) / 9)
        })
    };
    let still: Event = |i, k| (k < 4).then(|| seen(&hand_held(i - k), 1));
    let cut: Event = |i, _| {
        let picture = seen(&hand_held(i), 5);
        Some(Plane::from_fn(W, H, |x, y| picture.as_ref().row(y)[x] / 3))
    };
    // A flash directly after black: the longest that the tracker remembers.
    let both: Event = |_, k| match k {
        0..10 => Some(Plane::from_fn(W, H, |_, _| 16)),
        10 => {
            let picture = seen(&hand_held(3), 1);
            Some(Plane::from_fn(W, H, |x, y| 255 - (255 - picture.as_ref().row(y)[x]) / 9))
        }
        _ => None,
    };
    const BORDER: usize = 24;
    let plain: Vec<_> = (0..BORDER + 16).map(|i| seen(&hand_held(i), 1)).collect();
    for (name, event) in
        [("black", black), ("long black", long_black), ("flash", flash), ("still", still), ("cut", cut), ("both", both)]
    {
        for start in BORDER - WINDOWS.warm_up - 2..BORDER + 3 {
            let picture = |i: usize| i.checked_sub(start).and_then(|k| event(i, k)).unwrap_or_else(|| plain[i].clone());
            let pictures: Vec<_> = (0..plain.len()).map(picture).collect();
            let (clip, whole) = (joined(WINDOWS, in_windows(WINDOWS, &pictures)), undivided(&pictures));
            assert_eq!(verdicts(&clip), verdicts(&whole), "{name} at {start}");
            let changed =
                verdicts(&whole)[start..].iter().any(|q| q.black || q.duplicate || q.cut_before || q.bridged > 0);
            assert!(changed, "{name} at {start} is noticed at all");
            for i in start.max(1)..clip.len() {
                let pairs = |clip: &[FrameTracks]| shared(&clip[i - 1], &clip[i]).len();
                assert!(10 * pairs(&clip) >= 9 * pairs(&whole), "{name} at {start}: {} pairs at {i}", pairs(&clip));
            }
        }
    }
}

#[test]
fn windows_out_of_order_or_of_another_clip_are_refused() {
    let pictures: Vec<_> = (0..30).map(|i| seen(&hand_held(i), 1)).collect();
    let tracked = in_windows(WINDOWS, &pictures);
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
        "a frame of analysis window 0 follows frame 24 of the clip (expected window 1)"
    );
    let mut late = of(1).into_iter().map(|(window, t)| (window, t.clone())).collect::<Vec<_>>();
    late.iter_mut().for_each(|(_, t)| t.pts = Timestamp(t.pts.0 + 1));
    let late: Vec<_> = late.iter().map(|(window, t)| (*window, t)).collect();
    assert_eq!(
        refused(&[of(0), late].concat()),
        "the warm-up of analysis window 1 has other times than the end of window 0; analyze both again"
    );
    assert!(refused(&[of(0), of(1)[1..].to_vec()].concat()).contains("has other times"), "a frame is missing");
}
