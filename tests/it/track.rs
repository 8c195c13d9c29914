//! Synthetic truth for tracking: a textured plane seen through known homographies.

use plumbline::image::feature::Mask;
use plumbline::image::{Frame, Layout, PixelFormat, Plane};
use plumbline::num::math::{Homography, Point2, Similarity2, Vec2};
use plumbline::num::time::Timestamp;
use plumbline::video::track::{
    AnalysisWindows, FrameTracks, Observation, TrackError, TrackJoiner, TrackOptions, TrackStore, Tracker,
};
use plumbline_testkit::plane::texture;

const W: usize = 640;
const H: usize = 360;

/// The plane seen through `frame_from_plane`.
fn seen(frame_from_plane: &Homography, seed: u64) -> Plane<u8> {
    let plane_from_frame = frame_from_plane.inverse().expect("a camera in front of the plane");
    Plane::from_fn(W, H, |x, y| {
        let p = plane_from_frame.apply(Point2::new(x as f64 + 0.5, y as f64 + 0.5));
        texture(p.expect("no horizon in the picture"), seed).round() as u8
    })
}

/// Camera `i` of a hand-held sequence with a little perspective.
fn hand_held(i: usize) -> Homography {
    let t = i as f64;
    let shift = Vec2::new(11.0 * (0.7 * t).sin(), 8.0 * (0.9 * t + 1.0).sin());
    let moved =
        Similarity2::about(Point2::new(320.0, 180.0), 0.015 * (0.8 * t).sin(), 1.0 + 0.012 * (0.5 * t).sin(), shift);
    let tilt =
        nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 2e-5 * (0.6 * t).sin(), 1e-5 * (0.4 * t).cos(), 1.0);
    Homography::new(tilt) * moved.to_homography()
}

fn translated(dx: f64, dy: f64) -> Homography {
    Similarity2 { a: 1.0, b: 0.0, t: Vec2::new(dx, dy) }.to_homography()
}

fn tracker() -> Tracker {
    Tracker::new(W, H, TrackOptions::default(), None).expect("default settings")
}

fn run(tracker: &mut Tracker, pictures: &[Plane<u8>]) -> Vec<FrameTracks> {
    (0..).zip(pictures).map(|(i, p)| tracker.push_luma(p.as_ref(), Timestamp(i))).collect()
}

/// Points that two frames share, in both.
fn shared(a: &FrameTracks, b: &FrameTracks) -> Vec<(Observation, Observation)> {
    let in_b = |o: &Observation| b.observations.binary_search_by_key(&o.id, |o| o.id).ok().map(|k| b.observations[k]);
    a.observations.iter().filter_map(|o| Some((*o, in_b(o)?))).collect()
}

/// Distances between where shared points were found and where `b_from_a` puts them, ascending, px.
fn misses(a: &FrameTracks, b: &FrameTracks, b_from_a: &Homography) -> Vec<f64> {
    let miss = |(p, q): (Observation, Observation)| {
        let truth = b_from_a.apply(Point2::new(p.x.into(), p.y.into())).expect("in front");
        (truth - Point2::new(q.x.into(), q.y.into())).norm()
    };
    let mut misses: Vec<f64> = shared(a, b).into_iter().map(miss).collect();
    misses.sort_by(f64::total_cmp);
    misses
}

#[test]
fn points_follow_the_true_homography_to_a_twentieth_of_a_pixel() {
    let cameras: Vec<Homography> = (0..8).map(hand_held).collect();
    let tracks = run(&mut tracker(), &cameras.iter().map(|h| seen(h, 1)).collect::<Vec<_>>());
    for i in 1..cameras.len() {
        let truth = cameras[i] * cameras[i - 1].inverse().expect("regular");
        let misses = misses(&tracks[i - 1], &tracks[i], &truth);
        assert!(misses.len() > 300, "frame {i}: {} of {} points", misses.len(), tracks[i - 1].observations.len());
        let (median, worst) = (misses[misses.len() / 2], misses[misses.len() * 99 / 100]);
        assert!(median < 0.05 && worst < 0.5, "frame {i}: median {median}, p99 {worst}");
    }
    let long = misses(&tracks[0], &tracks[7], &(cameras[7] * cameras[0].inverse().expect("regular")));
    assert!(
        long.len() > 150 && long[long.len() / 2] < 0.15,
        "{} tracks, median drift {}",
        long.len(),
        long[long.len() / 2]
    );
}

#[test]
fn a_rotation_of_five_degrees_is_followed() {
    let turned = Similarity2::about(Point2::new(320.0, 180.0), 0.087, 1.03, Vec2::new(4.0, -6.0)).to_homography();
    let tracks = run(&mut tracker(), &[seen(&Homography::identity(), 2), seen(&turned, 2)]);
    let misses = misses(&tracks[0], &tracks[1], &turned);
    let (median, most) = (misses[misses.len() / 2], misses[misses.len() * 9 / 10]);
    // The window does not turn with the picture: at its edge, 10 px out, a turn of 0.087 rad is 0.9 px.
    assert!(misses.len() > 200 && median < 0.3 && most < 0.9, "{} points, median {median}, p90 {most}", misses.len());
}

#[test]
fn a_pan_of_a_sixth_of_the_width_per_frame_is_followed() {
    for (dx, dy) in [(64.0, 0.0), (-107.0, 12.0), (5.0, 58.0)] {
        let pictures: Vec<_> = (0..3).map(|i| seen(&translated(dx * f64::from(i), dy * f64::from(i)), 3)).collect();
        let tracks = run(&mut tracker(), &pictures);
        for i in 1..3 {
            let misses = misses(&tracks[i - 1], &tracks[i], &translated(dx, dy));
            let fair = tracks[i - 1].observations.len() * 6 / 10;
            assert!(
                misses.len() > fair,
                "({dx}, {dy}): {} points of {}",
                misses.len(),
                tracks[i - 1].observations.len()
            );
            assert!(misses[misses.len() * 9 / 10] < 0.2 && !tracks[i].quality.cut_before);
        }
    }
}

#[test]
fn points_that_an_object_covers_are_dropped() {
    let disc = |i: usize| {
        let mut picture = seen(&translated(2.0 * i as f64, 0.0), 4);
        for y in 100..260 {
            for x in 60 + 25 * i..180 + 25 * i {
                picture.as_mut().row_mut(y)[x] =
                    texture(Point2::new(x as f64 - 25.0 * i as f64 + 5000.0, y as f64), 9) as u8;
            }
        }
        picture
    };
    let tracks = run(&mut tracker(), &(0..4).map(disc).collect::<Vec<_>>());
    for i in 1..4 {
        let moved = shared(&tracks[i - 1], &tracks[i]).into_iter().map(|(p, q)| (q.x - p.x, q.y - p.y));
        let stray = moved.filter(|(dx, dy)| (dx - 2.0).hypot(*dy) > 0.7 && (dx - 25.0).hypot(*dy) > 0.7).count();
        assert!(stray <= 6, "{stray} points follow neither the ground nor the object");
    }
}

#[test]
fn a_repeated_frame_repeats_its_positions_exactly_and_a_slow_creep_adds_up() {
    let still = [seen(&hand_held(0), 1), seen(&hand_held(1), 1), seen(&hand_held(1), 1), seen(&hand_held(2), 1)];
    let tracks = run(&mut tracker(), &still);
    assert!(tracks[2].quality.duplicate && tracks[2].observations == tracks[1].observations);
    assert!(!tracks[1].quality.duplicate && !tracks[3].quality.duplicate);
    assert_eq!(tracks[2].pts, Timestamp(2));

    let creep: Vec<_> = (0..60).map(|i| seen(&translated(0.02 * f64::from(i), 0.0), 1)).collect();
    let tracks = run(&mut tracker(), &creep);
    let misses = misses(&tracks[0], &tracks[59], &translated(0.02 * 59.0, 0.0));
    assert!(misses[misses.len() / 2] < 0.1, "median {}", misses[misses.len() / 2]);
}

#[test]
fn tracks_bridge_black_frames_and_a_flash() {
    let black = || Plane::from_fn(W, H, |_, _| 16);
    let flash = || {
        let picture = seen(&hand_held(3), 1);
        Plane::from_fn(W, H, |x, y| 255 - (255 - picture.as_ref().row(y)[x]) / 9)
    };
    for (name, between) in
        [("black", vec![black(), black()]), ("flash", vec![flash()]), ("two flashes", vec![flash(), flash()])]
    {
        let mut pictures: Vec<_> = (0..3).map(|i| seen(&hand_held(i), 1)).collect();
        let gap = between.len();
        pictures.extend(between);
        pictures.extend((3..5).map(|i| seen(&hand_held(i), 1)));
        let tracks = run(&mut tracker(), &pictures);
        let truth = hand_held(3) * hand_held(2).inverse().expect("regular");
        let misses = misses(&tracks[2], &tracks[3 + gap], &truth);
        assert!(misses.len() > 250 && misses[misses.len() / 2] < 0.05, "{name}: {} tracks go on", misses.len());
        let after = tracks[3 + gap].quality;
        assert!(after.bridged as usize == gap && !after.cut_before, "{name}: {after:?}");
        assert_eq!(tracks[4 + gap].quality.bridged, 0);
        if name == "black" {
            assert!(tracks[3].quality.black && tracks[3].observations.is_empty());
        }
    }
}

#[test]
fn a_cut_begins_new_tracks_and_a_quick_pan_does_not() {
    let first = (0..3).map(|i| seen(&hand_held(i), 1));
    let second = (3..6).map(|i| {
        let picture = seen(&hand_held(i), 5);
        Plane::from_fn(W, H, |x, y| picture.as_ref().row(y)[x] / 3)
    });
    let tracks = run(&mut tracker(), &first.chain(second).collect::<Vec<_>>());
    let cuts: Vec<usize> = (0..6).filter(|i| tracks[*i].quality.cut_before).collect();
    assert_eq!(cuts, [3]);
    assert!(shared(&tracks[2], &tracks[3]).is_empty() && shared(&tracks[3], &tracks[4]).len() > 250);
    assert!(tracks.iter().all(|t| t.quality.bridged == 0));
}

#[test]
fn a_blurred_frame_is_distinguished_from_its_neighbors() {
    let smeared = |i: usize| {
        let parts: Vec<_> = (0..9).map(|k| seen(&(translated(1.5 * f64::from(k), 0.0) * hand_held(i)), 1)).collect();
        Plane::from_fn(W, H, |x, y| (parts.iter().map(|p| u32::from(p.as_ref().row(y)[x])).sum::<u32>() / 9) as u8)
    };
    let pictures: Vec<_> = (0..8).map(|i| if i == 5 { smeared(i) } else { seen(&hand_held(i), 1) }).collect();
    let mut joiner = TrackJoiner::new(AnalysisWindows::default(), (W, H), W);
    let tracks = run(&mut tracker(), &pictures).into_iter().filter_map(|t| joiner.push(0, t).expect("in order"));
    let mut tracks: Vec<_> = tracks.collect();
    tracks.extend(joiner.finish());
    let blurred: Vec<usize> = (0..8).filter(|i| tracks[*i].quality.blurred).collect();
    let sharpness: Vec<f32> = tracks.iter().map(|t| t.quality.sharpness).collect();
    assert_eq!(blurred, [5], "{sharpness:?}");
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let pictures: Vec<_> = (0..4).map(|i| seen(&hand_held(i), 1)).collect();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| run(&mut tracker(), &pictures))
    };
    let one = with(1);
    assert!(one[3].observations.len() > 300 && one == with(3));
}

#[test]
fn points_are_spread_and_their_ids_are_unique_and_ascend() {
    let pictures: Vec<_> = (0..6).map(|i| seen(&hand_held(i), 1)).collect();
    let tracks = run(&mut tracker(), &pictures);
    for t in &tracks {
        assert!(t.observations.is_sorted_by(|a, b| a.id < b.id));
        let share = t.observations.len() as f64 / TrackOptions::default().points as f64;
        assert!((0.75..=1.5).contains(&share), "{share} of the points asked for");
        for quarter in 0..4 {
            let here = |o: &&Observation| (o.x / 160.0) as usize == quarter;
            assert!(t.observations.iter().filter(here).count() > 50);
        }
    }
}

#[test]
fn positions_are_those_of_the_source_frame() {
    let (w, h) = (1930, 1070);
    let frame = |dx: f64| {
        let mut frame = Frame::new(PixelFormat::opaque(Layout::Yuv420, 10), w, h);
        let mut luma = frame.plane16_mut(0).expect("own memory");
        for y in 0..h {
            for (x, v) in luma.row_mut(y).iter_mut().enumerate() {
                *v = (4.0 * texture(Point2::new((x as f64 + 0.5 - dx) / 3.0, (y as f64 + 0.5) / 3.0), 6)) as u16;
            }
        }
        frame
    };
    let mut tracker = Tracker::new(w, h, TrackOptions::default(), None).expect("default settings");
    let (a, b) = (tracker.push(&frame(0.0)), tracker.push(&frame(7.5)));
    let misses = misses(&a, &b, &translated(7.5, 0.0));
    assert!(
        misses.len() > 300 && misses[misses.len() / 2] < 0.15,
        "median {} px of the source",
        misses[misses.len() / 2]
    );
    assert!(a.observations.iter().any(|o| o.x > 1800.0 && o.y > 950.0));
    let other = Frame::new(PixelFormat::opaque(Layout::Gray, 8), 64, 64);
    assert!(tracker.push(&other).quality.black, "a frame of another size shows nothing of this clip");
}

#[test]
fn masked_parts_hold_no_points_even_when_points_move_into_them() {
    let drawn = Plane::from_fn(W, H, |x, _| if x > 400 { 255 } else { 0 });
    let mask = Mask::from_plane(drawn.as_ref(), W, H, 10).expect("most is left");
    let mut tracker = Tracker::new(W, H, TrackOptions::default(), Some(mask)).expect("sizes agree");
    let pictures: Vec<_> = (0..4).map(|i| seen(&translated(20.0 * f64::from(i), 0.0), 1)).collect();
    for t in run(&mut tracker, &pictures) {
        assert!(t.observations.len() > 150 && t.observations.iter().all(|o| o.x <= 391.5));
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let small = Mask::from_plane(Plane::new(8, 8).as_ref(), 8, 8, 0).expect("nothing masked");
    let refused = |options, mask| Tracker::new(W, H, options, mask).expect_err("refused").to_string();
    let default = TrackOptions::default();
    assert_eq!(refused(TrackOptions { points: 3, ..default }, None), "3 points are invalid (expected 16 to 100000)");
    assert_eq!(
        refused(TrackOptions { analysis_side: 9, ..default }, None),
        TrackError::AnalysisSide { side: 9 }.to_string()
    );
    assert_eq!(
        refused(default, Some(small)),
        "the mask is (8, 8) px, the analysis picture (640, 360) px; make it with TrackOptions::analysis_size"
    );
}

#[test]
fn what_the_tracker_says_survives_the_store() {
    let tracks = run(&mut tracker(), &(0..3).map(|i| seen(&hand_held(i), 1)).collect::<Vec<_>>());
    let mut store = TrackStore::new().expect("a temporary folder");
    for t in &tracks {
        store.push(t).expect("every position of the tracker can be stored");
    }
    let read = store.window(0..3).expect("stored");
    for (a, b) in tracks.iter().zip(&read) {
        assert!(a.quality == b.quality && a.observations.len() == b.observations.len());
        assert!(misses(a, b, &Homography::identity()).iter().all(|m| *m < 0.003));
    }
}

#[test]
fn pictures_of_a_few_pixels_do_no_harm() {
    for (w, h) in [(1, 1), (2, 5), (16, 9), (640, 3)] {
        let mut tracker = Tracker::new(w, h, TrackOptions::default(), None).expect("default settings");
        let mut rng = fastrand::Rng::with_seed(1);
        for i in 0..3 {
            let picture = Plane::from_fn(w, h, |_, _| rng.u8(..));
            assert!(tracker.push_luma(picture.as_ref(), Timestamp(i)).observations.len() < 200);
        }
    }
}
