//! Laws of rectangles, on walls with known lines cut out of their frames.

use proptest::prelude::*;

use super::*;
use crate::Orientation;
use plumbline_image::still::frame_of_rgb;
use plumbline_image::{Frame, Plane, analysis_luma};
use plumbline_num::math::Vec2;
use plumbline_num::run::Run;

const SIZE: (usize, usize) = (640, 400);

/// Noise as compression leaves it, −4 to 4.
fn noise(x: usize, y: usize) -> i32 {
    (((x * 7919 + y * 104_729) ^ (x * y * 31)) % 9) as i32 - 4
}

/// A wall of bricks under a pale sky, on white where it is not shown.
fn wall(shown: &dyn Fn(f64, f64) -> bool) -> Frame {
    let (w, h) = SIZE;
    let mut samples = Vec::with_capacity(3 * w * h);
    for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
        let (bx, by) = ((x + 20 * (y / 24 % 2)) % 48 < 3, y % 24 < 3);
        let color: [i32; 3] = match () {
            () if !shown(x as f64 + 0.5, y as f64 + 0.5) => [253; 3],
            () if y < 130 => [205, 222, 236],
            () if bx || by => [190, 185, 175],
            () => [150, 80 + (x % 11) as i32, 60],
        };
        samples.extend(color.map(|v| (v + noise(x, y)).clamp(0, 255) as u8));
    }
    frame_of_rgb(&samples, w, h).expect("as many as it takes")
}

fn lines() -> Vec<Line> {
    let line = |name: &str, a: (f64, f64), b: (f64, f64)| Line {
        name: name.to_owned(),
        points: vec![Point2::new(a.0, a.1), Point2::new(b.0, b.1)],
        orientation: Orientation::Free,
    };
    vec![
        line("eaves", (90.0, 130.0), (560.0, 130.0)),
        line("course", (100.0, 240.0), (540.0, 240.0)),
        line("pipe", (200.0, 120.0), (200.0, 330.0)),
        line("post", (470.0, 100.0), (470.0, 320.0)),
        line("rail", (150.0, 310.0), (450.0, 160.0)),
    ]
}

fn made(frame: &Frame, lines: &[Line], options: &RectangleOptions) -> (Rectangled, Outline) {
    let outline = Outline::of_frame(frame).expect("a border");
    let mut luma = Plane::new(0, 0);
    assert!(analysis_luma(frame, 960, &mut luma));
    let size = (frame.width, frame.height);
    let input = RectangleInput { size, outline: &outline, luma: luma.as_ref(), lines, faces: &[] };
    (rectangle(&input, options, &Run::default()).expect("a rectangle"), outline)
}

/// Which pixels are shown.
type Shown = fn(f64, f64) -> bool;

/// Outlines as stitching leaves them.
fn outlines() -> [(&'static str, Shown); 4] {
    [
        ("arcs", |x, y| {
            let bow = (x / 640.0 * std::f64::consts::TAU).sin().abs();
            y > 8.0 + 50.0 * bow && y < 385.0 - 30.0 * bow && x > 20.0 + 0.05 * y && x < 625.0 - 0.08 * y
        }),
        ("steps", |x, y| {
            let step = 14.0 * (x / 160.0).floor();
            y > 10.0 + step && y < 330.0 + step && x > 12.0 && x < 628.0
        }),
        ("turned", |x, y| {
            let (u, v) = (x - 320.0 + 0.12 * (y - 200.0), y - 200.0 - 0.12 * (x - 320.0));
            u.abs() < 285.0 && v.abs() < 150.0
        }),
        ("waist", |x, y| (y - 200.0).abs() < 110.0 + 80.0 * ((x - 320.0) / 320.0).powi(2) && (x - 320.0).abs() < 300.0),
    ]
}

#[test]
fn the_result_is_full_has_no_folds_and_keeps_lines_straight() {
    for (name, shown) in outlines() {
        let (made, _) = made(&wall(&shown), &lines(), &RectangleOptions::default());
        assert!(made.outside == 0.0, "{name}: {} from outside", made.outside);
        assert_eq!(made.warp.mesh.folded_cells(), 0, "{name}");
        assert_eq!(made.warp.lines.len(), 5, "{name}");
        for line in &made.warp.lines {
            assert!(line.max_px <= 0.003 * line.length_px, "{name}: {line:?}");
        }
        for s in made.stretch {
            assert!((s - 1.0).abs() < 0.01, "{name}: {:?}", made.stretch);
        }
    }
}

#[test]
fn without_the_line_terms_the_same_lines_bend() {
    let options = RectangleOptions { straightness: 0.0, ..RectangleOptions::default() };
    let (made, _) = made(&wall(&outlines()[0].1), &lines(), &options);
    let worst = made.warp.lines.iter().map(|l| l.max_px / l.length_px).fold(0.0, f64::max);
    assert!(worst > 0.003, "{worst}");
}

#[test]
fn more_is_kept_than_by_the_largest_rectangle() {
    for (name, shown) in outlines() {
        let frame = wall(&shown);
        let (made, outline) = made(&frame, &lines(), &RectangleOptions::default());
        let shown_px = (made.warp.size.0 * made.warp.size.1) as f64;
        let inside = outline.inside_fraction() * (SIZE.0 * SIZE.1) as f64;
        assert!((shown_px / inside - 1.0).abs() < 0.12, "{name}: {shown_px} px of {inside}");
    }
}

#[test]
fn a_plain_frame_is_cut_away_and_nothing_else_happens() {
    let frame = wall(&|x, y| (60.0..580.0).contains(&x) && (40.0..360.0).contains(&y));
    let (made, outline) = made(&frame, &lines(), &RectangleOptions::default());
    assert!(!outline.is_stitched());
    let bounds = outline.bounds_px();
    // The outline is known to a block on each side.
    let blocks = 2.0 * outline.block as f64;
    assert!((made.warp.size.0 as f64 - bounds.width()).abs() <= blocks, "{:?} of {bounds:?}", made.warp.size);
    for p in [(90.0, 70.0), (300.0, 200.0), (500.0, 320.0)].map(|(x, y)| Point2::new(x, y)) {
        let moved = (made.warp.forward)(p).expect("shown") - (p - bounds.min.coords);
        assert!(moved.norm() < 3.0, "{p} moved by {moved}");
    }
}

#[test]
fn the_field_and_the_forward_map_are_inverse() {
    let (made, _) = made(&wall(&outlines()[2].1), &[], &RectangleOptions::default());
    for (x, y) in [(320.0, 200.0), (150.0, 120.0), (500.0, 300.0)] {
        let src = Point2::new(x, y);
        let back = made.warp.field.map((made.warp.forward)(src).expect("shown")).expect("covered");
        assert!((back - src).norm() < 1e-6, "{src} came back as {back}");
    }
}

#[test]
fn shape_and_size_are_as_asked() {
    let frame = wall(&outlines()[0].1);
    for (shape, aspect) in [(RectangleShape::Aspect(1.5), 1.5), (RectangleShape::Exact(300, 150), 2.0)] {
        let (made, _) = made(&frame, &lines(), &RectangleOptions { shape, ..RectangleOptions::default() });
        let (w, h) = made.warp.size;
        assert!((w as f64 / h as f64 - aspect).abs() < 0.01, "{shape:?}: {w}×{h}");
        assert!(made.outside == 0.0 && made.warp.mesh.folded_cells() == 0);
    }
}

#[test]
fn stitched_pictures_are_distinguished_from_disks_frames_and_photos() {
    let outline = |shown: &dyn Fn(f64, f64) -> bool| Outline::of_frame(&wall(shown));
    for (name, shown) in outlines() {
        assert!(outline(&shown).expect("a border").is_stitched(), "{name}");
    }
    let disk = |r: f64| move |x: f64, y: f64| (x - 320.0).hypot(y - 200.0) < r;
    for r in [180.0, 260.0, 320.0] {
        let disk = outline(&disk(r)).expect("a border");
        assert!(disk.is_round() && !disk.is_stitched(), "{r}");
    }
    let sky = outline(&|_, y| y > 60.0).expect("white above");
    assert!(!sky.is_stitched() && !sky.is_round(), "a white sky is no border");
}

/// A wall whose light falls off towards the corners, down to black beyond a distance from the center; `edge` is the width of the
/// fall, px.
fn vignetted(center: (f64, f64), radius: f64, edge: f64) -> Frame {
    let (w, h) = SIZE;
    let lit = wall(&|_, _| true);
    let light = |x: usize, y: usize| {
        let r = (x as f64 + 0.5 - center.0).hypot((y as f64 + 0.5 - center.1) * 1.4);
        ((radius - r) / edge).clamp(0.0, 1.0)
    };
    let pixels = plumbline_image::still::rgb_of_frame(&lit).expect("a still frame");
    let dimmed = pixels.iter().enumerate().flat_map(|(k, p)| {
        let fall = light(k % w, k / w);
        p.map(|v| (f64::from(v) * fall + 2.0) as u8)
    });
    frame_of_rgb(&dimmed.collect::<Vec<u8>>(), w, h).expect("as many as it takes")
}

#[test]
fn dark_corners_are_no_border_of_a_stitched_picture_and_a_cut_of_their_shape_is() {
    for edge in [80.0, 160.0, 300.0] {
        let dark = Outline::of_frame(&vignetted((330.0, 210.0), 310.0, edge));
        assert!(dark.is_none_or(|outline| !outline.is_stitched()), "{edge}");
    }
    // The same shape, squeezed so that it is no circle, cut off at once.
    let cut = Outline::of_frame(&vignetted((330.0, 210.0), 310.0, 0.5)).expect("a border");
    assert!(cut.is_stitched(), "{}", cut.step);
}

#[test]
fn a_disk_with_dark_things_at_its_rim_is_a_disk() {
    let dark = |x: f64, y: f64| (x - 190.0).hypot(y - 100.0) < 30.0 || (x - 490.0).hypot(y - 230.0) < 24.0;
    let outline = Outline::of_frame(&wall(&|x, y| (x - 320.0).hypot(y - 200.0) < 180.0 && !dark(x, y)));
    let outline = outline.expect("a border");
    assert!(outline.is_round() && !outline.is_stitched());
}

#[test]
fn a_pale_sky_beside_a_white_border_is_not_taken_for_it() {
    let shown = outlines()[0].1;
    let outline = Outline::of_frame(&wall(&shown)).expect("a border");
    let truth = (0..SIZE.0 * SIZE.1).filter(|k| shown((k % SIZE.0) as f64, (k / SIZE.0) as f64)).count();
    let share = truth as f64 / (SIZE.0 * SIZE.1) as f64;
    assert!(
        outline.inside_fraction() < share && outline.inside_fraction() > share - 0.03,
        "{} of {share}",
        outline.inside_fraction()
    );
}

#[test]
fn a_transparent_border_counts_whatever_its_color() {
    let frame = wall(&|_, _| true);
    let format = plumbline_image::PixelFormat { alpha: true, ..frame.format };
    let mut clear = Frame::new(format, frame.width, frame.height);
    let shown = outlines()[3].1;
    for (plane, y) in (0..4).flat_map(|p| (0..SIZE.1).map(move |y| (p, y))) {
        let row = frame.plane8(plane.min(2)).expect("8 bit").row(y).to_vec();
        let mut out = clear.plane8_mut(plane).expect("8 bit");
        for (x, v) in out.row_mut(y).iter_mut().enumerate() {
            *v = if plane < 3 { row[x] } else { 255 * u8::from(shown(x as f64 + 0.5, y as f64 + 0.5)) };
        }
    }
    assert!(Outline::of_frame(&clear).expect("a border").is_stitched());
    assert!(Outline::of_frame(&frame).is_none_or(|o| o.inside_fraction() > 0.5 && !o.is_stitched()));
}

#[test]
fn options_out_of_range_are_refused() {
    let frame = wall(&outlines()[0].1);
    let outline = Outline::of_frame(&frame).expect("a border");
    let luma = Plane::from_fn(4, 4, |_, _| 0);
    let input = RectangleInput { size: SIZE, outline: &outline, luma: luma.as_ref(), lines: &[], faces: &[] };
    for options in [
        RectangleOptions { shape: RectangleShape::Aspect(f64::NAN), ..RectangleOptions::default() },
        RectangleOptions { shape: RectangleShape::Exact(0, 10), ..RectangleOptions::default() },
        RectangleOptions { cells: 3, ..RectangleOptions::default() },
        RectangleOptions { straightness: -1.0, ..RectangleOptions::default() },
    ] {
        assert!(matches!(rectangle(&input, &options, &Run::default()), Err(PhotoError::Option { .. })), "{options:?}");
    }
}

#[test]
fn a_speck_in_a_white_frame_is_refused() {
    let frame = wall(&|x, y| (x - 320.0).hypot(y - 200.0) < 40.0);
    let outline = Outline::of_frame(&frame).expect("a border");
    let luma = Plane::from_fn(4, 4, |_, _| 0);
    let input = RectangleInput { size: SIZE, outline: &outline, luma: luma.as_ref(), lines: &[], faces: &[] };
    let error = rectangle(&input, &RectangleOptions::default(), &Run::default()).expect_err("a speck");
    assert!(error.to_string().contains("of the picture lies inside its border (expected at least 20)"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn nothing_folds_and_nothing_from_outside_is_shown_whatever_is_cut_away(
        cuts in prop::collection::vec((0.0..1.0_f64, -0.6..0.6_f64, 0.0..60.0_f64), 1..5),
        ends in prop::collection::vec((100.0..540.0_f64, 100.0..300.0_f64, 100.0..540.0_f64, 100.0..300.0_f64), 0..6),
    ) {
        // Bites into the upper and lower side, and a turn of the left one.
        let shown = |x: f64, y: f64| {
            let bite = |(at, _, deep): &(f64, f64, f64)| deep * (-((x - 640.0 * at) / 90.0).powi(2)).exp();
            let deep = cuts.iter().map(bite).fold(0.0, f64::max);
            let left = 15.0 + 40.0 * (cuts[0].1 * (y - 200.0) / 200.0).max(0.0);
            y > 10.0 + deep && y < 390.0 - 0.5 * deep && x > left && x < 630.0
        };
        let lines: Vec<Line> = ends.iter().map(|&(a, b, c, d)| Line {
            name: "any".to_owned(),
            points: vec![Point2::new(a, b), Point2::new(c, d) + Vec2::new(1.0, 0.0)],
            orientation: Orientation::Free,
        }).collect();
        let options = RectangleOptions { cells: 600, ..RectangleOptions::default() };
        let (made, _) = made(&wall(&shown), &lines, &options);
        prop_assert_eq!(made.warp.mesh.folded_cells(), 0);
        prop_assert_eq!(made.outside, 0.0);
        prop_assert!(made.warp.lines.iter().all(|l| l.max_px.is_finite()));
    }
}
