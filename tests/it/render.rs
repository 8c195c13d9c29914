//! Laws of sampling a frame through a warp field.

use std::sync::Arc;

use plumbline::image::grid::GridMesh;
use plumbline::image::render::{
    Border, FillOptions, FillReport, Filler, Interpolation, RenderError, RenderOptions, Renderer,
};
use plumbline::image::warp::{Lattice, WarpField};
use plumbline::image::{ColorDescription, Frame, Layout, PixelFormat};
use plumbline::num::math::{Homography, Point2, Similarity2, Vec2};
use plumbline::num::run::Run;

const KERNELS: [Interpolation; 3] = [Interpolation::Bilinear, Interpolation::Bicubic, Interpolation::Lanczos3];
const BORDERS: [Border; 3] = [Border::Black, Border::Replicate, Border::Mirror];
const LAYOUTS: [Layout; 7] =
    [Layout::Gray, Layout::Yuv420, Layout::Yuv422, Layout::Yuv440, Layout::Yuv411, Layout::Yuv444, Layout::Gbr];

fn get(frame: &Frame, plane: usize, x: usize, y: usize) -> i32 {
    match frame.plane8(plane) {
        Some(p) => i32::from(p.row(y)[x]),
        None => i32::from(frame.plane16(plane).expect("own memory").row(y)[x]),
    }
}

fn set(frame: &mut Frame, plane: usize, x: usize, y: usize, v: i32) {
    if frame.format.bits == 8 {
        frame.plane8_mut(plane).expect("own memory").row_mut(y)[x] = u8::try_from(v).expect("8 bit");
    } else {
        frame.plane16_mut(plane).expect("own memory").row_mut(y)[x] = u16::try_from(v).expect("16 bit");
    }
}

/// A frame whose sample `(x, y)` of plane `i` is `f(i, x, y)`.
fn frame(format: PixelFormat, (w, h): (usize, usize), mut f: impl FnMut(usize, usize, usize) -> i32) -> Frame {
    let mut out = Frame::new(format, w, h);
    for i in 0..format.planes() {
        let (pw, ph) = format.plane_size(i, w, h);
        for (x, y) in (0..ph).flat_map(|y| (0..pw).map(move |x| (x, y))) {
            set(&mut out, i, x, y, f(i, x, y));
        }
    }
    out
}

/// Independent values over the whole range: the hardest frame to copy.
fn noise(format: PixelFormat, size: (usize, usize)) -> Frame {
    let mut rng = fastrand::Rng::with_seed(7);
    frame(format, size, |_, _, _| rng.i32(0..1 << format.bits))
}

fn samples(frame: &Frame, plane: usize) -> Vec<i32> {
    let (w, h) = frame.format.plane_size(plane, frame.width, frame.height);
    (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).map(|(x, y)| get(frame, plane, x, y)).collect()
}

fn shift(x: f64, y: f64) -> WarpField {
    let forward = Similarity2 { t: Vec2::new(x, y), ..Similarity2::IDENTITY };
    WarpField::from_forward_homography(&forward.to_homography()).expect("regular")
}

fn turn(size: (usize, usize), angle: f64, scale: f64) -> WarpField {
    let center = Point2::new(size.0 as f64 / 2.0, size.1 as f64 / 2.0);
    let forward = Similarity2::about(center, angle, scale, Vec2::new(3.3, -2.6));
    WarpField::from_forward_homography(&forward.to_homography()).expect("regular")
}

fn rendered(renderer: &Renderer, src: &Frame, field: &WarpField) -> Frame {
    let mut dst = Frame::new(src.format, src.width, src.height);
    let lattice = Lattice::new(field, src.width, src.height);
    renderer.render(src, &lattice, &mut dst).expect("sizes and formats agree");
    dst
}

fn assert_same(a: &Frame, b: &Frame, what: &str) {
    for i in 0..a.format.planes() {
        assert!(samples(a, i) == samples(b, i), "{what}: plane {i} of {:?} differs", a.format);
    }
}

#[test]
fn the_identity_copies_every_layout_and_depth_bit_for_bit() {
    for (layout, bits) in LAYOUTS.into_iter().flat_map(|l| [8, 9, 10, 12, 16].map(|b| (l, b))) {
        let src = noise(PixelFormat { layout, bits, alpha: bits == 10 }, (61, 37));
        for interpolation in KERNELS {
            let renderer = Renderer::new(RenderOptions { interpolation, border: Border::Black });
            assert_same(&rendered(&renderer, &src, &WarpField::identity()), &src, &format!("{interpolation:?}"));
        }
    }
}

#[test]
fn a_shift_by_whole_pixels_moves_bits() {
    for bits in [8, 10, 16] {
        let src = noise(PixelFormat::opaque(Layout::Yuv420, bits), (80, 46));
        for interpolation in KERNELS {
            let renderer = Renderer::new(RenderOptions { interpolation, border: Border::Mirror });
            let dst = rendered(&renderer, &src, &shift(6.0, -4.0));
            for (x, y) in [(6, 0), (40, 20), (79, 41)] {
                assert_eq!(get(&dst, 0, x, y), get(&src, 0, x - 6, y + 4));
                assert_eq!(get(&dst, 1, x / 2, y / 2), get(&src, 1, x / 2 - 3, y / 2 + 2));
            }
        }
    }
}

#[test]
fn a_shift_by_half_a_pixel_of_a_ramp_is_exact() {
    let src =
        frame(PixelFormat::opaque(Layout::Gray, 10), (96, 40), |_, x, y| i32::try_from(8 * x + 2 * y).expect("small"));
    for interpolation in KERNELS {
        let dst =
            rendered(&Renderer::new(RenderOptions { interpolation, border: Border::Black }), &src, &shift(0.5, 0.5));
        for (x, y) in (5..35).flat_map(|y| (5..90).map(move |x| (x, y))) {
            let expected = i32::try_from(8 * x + 2 * y).expect("small") - 5;
            // The window of the sinc reproduces constants and not lines: its ramp errs by a hundredth of a step.
            assert_eq!(get(&dst, 0, x, y), expected, "{interpolation:?} at ({x}, {y})");
        }
    }
}

#[test]
fn chroma_follows_luma_under_every_siting() {
    // One ramp of the plane, `v = 20 + 2 X + 3 Y` at the luma position (X, Y), sampled by luma and by sited chroma.
    let (w, h) = (160, 90);
    for offset in [[0.0, 0.5], [0.5, 0.5], [0.0, 0.0], [0.5, 0.0]] {
        for layout in [Layout::Yuv420, Layout::Yuv422, Layout::Yuv440, Layout::Yuv411] {
            let format = PixelFormat::opaque(layout, 12);
            let at = |i: usize, x: usize, y: usize| {
                let (sx, sy) = format.subsampling(i);
                let along =
                    |log2: u32, k: usize, o: f32| (k << log2) as f64 + 0.5 + if log2 > 0 { f64::from(o) } else { 0.0 };
                Point2::new(along(sx, x, offset[0]), along(sy, y, offset[1]))
            };
            let value = |p: Point2| 20.0 + 4.0 * p.x + 6.0 * p.y;
            let mut src = frame(format, (w, h), |i, x, y| value(at(i, x, y)).round() as i32);
            src.color = ColorDescription { chroma_offset: offset, ..ColorDescription::default() };
            let forward = Similarity2::about(Point2::new(80.0, 45.0), 0.05, 1.15, Vec2::new(1.3, 0.7));
            let field = WarpField::from_forward_homography(&forward.to_homography()).expect("regular");
            let options = RenderOptions { interpolation: Interpolation::Bicubic, border: Border::Replicate };
            let dst = rendered(&Renderer::new(options), &src, &field);
            let back = forward.inverse().expect("regular");
            for i in 0..3 {
                let (pw, ph) = format.plane_size(i, w, h);
                for (x, y) in (8..ph - 8).flat_map(|y| (6..pw - 6).map(move |x| (x, y))) {
                    let expected = value(back.apply(at(i, x, y)));
                    let off = (f64::from(get(&dst, i, x, y)) - expected).abs();
                    // Rounding of source and result (½ each, the kernel's gain 1.25 on the first) and 1/512 px of 24 per px.
                    assert!(off < 1.3, "{layout:?} {offset:?}: plane {i} ({x}, {y}) is {off} off");
                }
            }
        }
    }
}

#[test]
fn simd_and_portable_code_agree_bit_for_bit() {
    let size = (149, 83);
    let bent = GridMesh {
        cols: 4,
        rows: 3,
        vertices: (0..20)
            .map(|k| {
                Point2::new((k % 5) as f64 * 37.25 + (k * k % 7) as f64, (k / 5) as f64 * 27.7 - (k * k % 5) as f64)
            })
            .collect(),
    };
    let undefined = Homography::new(nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -0.01, 0.0, 1.0));
    let fields = [
        turn(size, 0.02, 1.05),
        turn(size, -0.2, 0.7),
        turn(size, 3.0, 1.0),
        shift(500.0, 0.25),
        WarpField::from_forward_mesh(&bent, 149.0, 83.0).expect("well formed"),
        WarpField { chain: vec![plumbline::image::warp::Map::Homography(undefined)] },
    ];
    for (bits, interpolation) in [8, 10, 16].into_iter().flat_map(|b| KERNELS.map(|k| (b, k))) {
        let src = noise(PixelFormat { layout: Layout::Yuv420, bits, alpha: true }, size);
        for (k, (field, border)) in fields.iter().flat_map(|f| BORDERS.map(|b| (f, b))).enumerate() {
            let options = RenderOptions { interpolation, border };
            let (a, b) =
                (rendered(&Renderer::new(options), &src, field), rendered(&Renderer::portable(options), &src, field));
            assert_same(&a, &b, &format!("{bits} bit {interpolation:?} {border:?} case {k}"));
        }
    }
}

#[test]
fn the_number_of_threads_does_not_show() {
    let src = noise(PixelFormat::opaque(Layout::Yuv420, 8), (203, 131));
    let field = turn((203, 131), 0.03, 1.1);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("few threads");
        pool.install(|| rendered(&Renderer::new(RenderOptions::default()), &src, &field))
    };
    assert_same(&on(1), &on(3), "1 and 3 threads");
}

#[test]
fn constant_frames_stay_constant_under_any_field() {
    let src = frame(PixelFormat::opaque(Layout::Yuv420, 8), (120, 70), |i, _, _| [200, 90, 33][i]);
    for interpolation in KERNELS {
        let renderer = Renderer::new(RenderOptions { interpolation, border: Border::Replicate });
        assert_same(&rendered(&renderer, &src, &turn((120, 70), 0.1, 0.8)), &src, "constant");
    }
}

#[test]
fn black_borders_are_black_of_the_format_and_transparent() {
    let cases = [
        (Layout::Yuv420, 8, None, [16, 128, 128]),
        (Layout::Yuv444, 10, Some(false), [64, 512, 512]),
        (Layout::Yuv420, 8, Some(true), [0, 128, 128]),
        (Layout::Gbr, 8, None, [0, 0, 0]),
    ];
    for (layout, bits, full_range, expected) in cases {
        let mut src = noise(PixelFormat { layout, bits, alpha: true }, (64, 48));
        src.color.full_range = full_range;
        let renderer = Renderer::new(RenderOptions { interpolation: Interpolation::Bicubic, border: Border::Black });
        let dst = rendered(&renderer, &src, &shift(20.0, 0.0));
        let found = [0, 1, 2].map(|i| get(&dst, i, 1, 20 >> dst.format.subsampling(i).1));
        assert_eq!(found, expected, "{layout:?} {full_range:?}");
        assert_eq!(get(&dst, 3, 1, 20), 0);
    }
}

#[test]
fn borders_repeat_or_reflect_the_edge() {
    let src = noise(PixelFormat::opaque(Layout::Gray, 8), (64, 48));
    let of = |border| {
        let renderer = Renderer::new(RenderOptions { interpolation: Interpolation::Bicubic, border });
        rendered(&renderer, &src, &shift(10.0, 0.0))
    };
    let (replicated, mirrored) = (of(Border::Replicate), of(Border::Mirror));
    for y in 0..48 {
        assert_eq!(get(&replicated, 0, 3, y), get(&src, 0, 0, y));
        assert_eq!(get(&mirrored, 0, 3, y), get(&src, 0, 6, y), "index -7 is sample 6");
    }
}

#[test]
fn time_and_color_pass_through() {
    let mut src = noise(PixelFormat::opaque(Layout::Gray, 8), (32, 32));
    src.pts = plumbline::num::time::Timestamp(42);
    src.color.transfer = 16;
    let dst = rendered(&Renderer::new(RenderOptions::default()), &src, &WarpField::identity());
    assert_eq!((dst.pts, dst.color), (src.pts, src.color));
}

#[test]
fn frames_that_do_not_fit_are_refused_with_the_reason() {
    let format = PixelFormat::opaque(Layout::Gray, 8);
    let (src, lattice) = (noise(format, (32, 32)), Lattice::new(&WarpField::identity(), 32, 32));
    let refusal = |src: &Frame, mut dst: Frame| -> RenderError {
        Renderer::new(RenderOptions::default()).render(src, &lattice, &mut dst).expect_err("must not fit")
    };
    let size = refusal(&src, Frame::new(format, 33, 32)).to_string();
    assert_eq!(
        size,
        "the lattice covers (32, 32) px and the destination has (33, 32); sample the field for the frame's size"
    );
    let deeper = refusal(&src, Frame::new(PixelFormat::opaque(Layout::Gray, 10), 32, 32));
    assert!(matches!(deeper, RenderError::Format { .. }), "{deeper}");
    let empty = refusal(&Frame::new(format, 0, 32), Frame::new(format, 32, 32)).to_string();
    assert_eq!(empty, "frame of 0×32 px cannot be rendered (expected 1 to 16384 each)");
}

/// A scene larger than the frame, seen with its upper left corner at `(u, v)` and brighter by `gain`.
fn view(size: (usize, usize), u: f64, v: f64, gain: f64) -> Frame {
    frame(PixelFormat::opaque(Layout::Yuv420, 8), size, |i, x, y| {
        let s = if i == 0 { 1.0 } else { 2.0 };
        let (x, y) = (s * x as f64 + u, s * y as f64 + v);
        let wave = (0.21 * x + 0.1 * y).sin() + (0.17 * y - 0.05 * x).cos() + (0.011 * x * y / 40.0).sin();
        (110.0 + 25.0 * wave + gain) as i32
    })
}

/// Largest difference of two frames but for the rows at their upper and lower edges, which no neighbor reaches.
fn largest_difference(a: &Frame, b: &Frame, plane: usize) -> i32 {
    let (w, h) = a.format.plane_size(plane, a.width, a.height);
    let inner = |f: &Frame| samples(f, plane)[4 * w..(h - 4) * w].to_vec();
    inner(a).iter().zip(inner(b)).map(|(a, b)| (a - b).abs()).max().expect("not empty")
}

/// The frame seen from (0, 0), stabilised to a view at (−24, 0), and a neighbor that saw the scene at (−40, 0), which the
/// motion knows but for an error of `(dx, dy)`.
fn fill_with(neighbor: Frame, (dx, dy): (f64, f64)) -> (Frame, FillReport) {
    let (size, options) = ((256, 160), RenderOptions { interpolation: Interpolation::Bicubic, border: Border::Mirror });
    let renderer = Renderer::new(options);
    let own = Lattice::new(&shift(24.0, 0.0), size.0, size.1);
    let mut filler = Filler::new(FillOptions::default());
    filler.push(Arc::new(neighbor));
    filler.push(Arc::new(view(size, 0.0, 0.0, 0.0)));
    assert_eq!(filler.pop(true).map(|(n, _)| n), Some(0));
    let (_, this) = filler.pop(true).expect("two frames");
    let mut dst = rendered(&renderer, &this, &shift(24.0, 0.0));
    let motion = |n: usize| (n == 0).then(|| shift(-40.0 + dx, dy));
    let report = filler.fill(&renderer, &own, &mut dst, motion, &Run::default()).expect("formats and sizes agree");
    (dst, report)
}

#[test]
fn a_neighbor_shows_what_the_frame_did_not_see() {
    let truth = view((256, 160), -24.0, 0.0, 0.0);
    let (filled, report) = fill_with(view((256, 160), -40.0, 0.0, 0.0), (0.0, 0.0));
    for plane in 0..3 {
        assert!(
            largest_difference(&filled, &truth, plane) <= 3,
            "plane {plane}: {}",
            largest_difference(&filled, &truth, plane)
        );
    }
    assert_eq!(report.used, 1);
    assert!(report.uncovered > 0.09 && report.uncovered < 0.2, "{report:?}");
}

#[test]
fn a_brighter_neighbor_is_toned_down_to_the_frame() {
    let truth = view((256, 160), -24.0, 0.0, 0.0);
    let (filled, report) = fill_with(view((256, 160), -40.0, 0.0, 18.0), (0.0, 0.0));
    assert_eq!(report.used, 1);
    assert!(largest_difference(&filled, &truth, 0) <= 3, "{}", largest_difference(&filled, &truth, 0));
}

#[test]
fn a_neighbor_of_another_scene_is_left_out() {
    // Waves of other lengths and directions: those of `view` itself would be found again a few pixels away.
    let other = frame(PixelFormat::opaque(Layout::Yuv420, 8), (256, 160), |_, x, y| {
        let (x, y) = (x as f64, y as f64);
        (110.0 + 35.0 * ((0.33 * x - 0.24 * y).sin() + (0.41 * y + 0.02 * x * y / 9.0).cos())) as i32
    });
    let (filled, report) = fill_with(other, (0.0, 0.0));
    assert_eq!((report.used, report.left), (0, report.uncovered));
    let renderer = Renderer::new(RenderOptions { interpolation: Interpolation::Bicubic, border: Border::Mirror });
    assert_same(&filled, &rendered(&renderer, &view((256, 160), 0.0, 0.0, 0.0), &shift(24.0, 0.0)), "untouched");
}

#[test]
fn a_motion_that_is_off_by_pixels_is_put_right_on_the_overlap() {
    let truth = view((256, 160), -24.0, 0.0, 0.0);
    let (filled, report) = fill_with(view((256, 160), -40.0, 0.0, 0.0), (1.7, -1.2));
    assert_eq!(report.used, 1);
    assert!(largest_difference(&filled, &truth, 0) <= 5, "{}", largest_difference(&filled, &truth, 0));
}

#[test]
fn a_neighbor_is_not_shown_where_it_disagrees() {
    let mut neighbor = view((256, 160), -40.0, 0.0, 0.0);
    let mut rng = fastrand::Rng::with_seed(2);
    // Something else stands in the lower half of the neighbor.
    for (x, y) in (80..160).flat_map(|y| (0..256).map(move |x| (x, y))) {
        set(&mut neighbor, 0, x, y, rng.i32(20..230));
    }
    let (filled, report) = fill_with(neighbor, (0.0, 0.0));
    let truth = view((256, 160), -24.0, 0.0, 0.0);
    // Half of it, and the blocks above that share a window with the lower half.
    assert!(report.left > 0.5 * report.uncovered && report.left < 0.8 * report.uncovered, "{report:?}");
    let renderer = Renderer::new(RenderOptions { interpolation: Interpolation::Bicubic, border: Border::Mirror });
    let border = rendered(&renderer, &view((256, 160), 0.0, 0.0, 0.0), &shift(24.0, 0.0));
    for x in 0..12 {
        assert!((get(&filled, 0, x, 40) - get(&truth, 0, x, 40)).abs() <= 4, "shown where it agrees");
        let (shown, border) = (get(&filled, 0, x, 120), get(&border, 0, x, 120));
        assert!((shown - border).abs() <= 8, "the border, at the tone beside it, where it does not: {shown} {border}");
    }
}

#[test]
fn a_frame_that_covers_everything_is_not_touched() {
    let renderer = Renderer::new(RenderOptions::default());
    let field = turn((256, 160), 0.0, 1.3);
    let mut filler = Filler::new(FillOptions::default());
    filler.push(Arc::new(view((256, 160), 5.0, 0.0, 0.0)));
    let (_, this) = filler.pop(true).expect("one frame");
    let mut dst = rendered(&renderer, &this, &field);
    let report = filler
        .fill(&renderer, &Lattice::new(&field, 256, 160), &mut dst, |_| None, &Run::default())
        .expect("sizes agree");
    assert_eq!(report, FillReport::default());
    assert_same(&dst, &rendered(&renderer, &this, &field), "covered");
}
