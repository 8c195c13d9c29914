//! Sharpness of what the renderer makes of real video, against Lanczos-3 summed in floating point under the same maps.

use plumbline::image::render::{RenderOptions, Renderer};
use plumbline::image::warp::{Lattice, WarpField};
use plumbline::image::{Frame, Layout, PixelFormat};
use plumbline::media::{Input, ReadOptions, VideoReader};
use plumbline::num::math::{Point2, PointMap, Similarity2, Vec2};

use crate::support::clips::real_clip;

const CLIPS: [&str; 9] = [
    "campus-vertical.mp4",
    "desk-roll.mp4",
    "forest-run.mp4",
    "hippo.mp4",
    "nus-regular-0.m4v",
    "nus-regular-1.m4v",
    "nus-regular-6.m4v",
    "room-720p.mp4",
    "street-quickpan.mp4",
];

/// Luma of a frame in the middle of the clip's first second, at most 640×360 of it.
fn luma(name: &str) -> Option<Frame> {
    let path = real_clip(name)?;
    let input = Input::parse(path.to_str()?).ok()?;
    let mut reader = VideoReader::open(&input, &ReadOptions::default()).ok()?;
    for _ in 0..12 {
        reader.next_frame().ok()?;
    }
    let frame = reader.next_frame().ok()??;
    let mut cut = Frame::new(PixelFormat::opaque(Layout::Gray, 8), frame.width.min(640), frame.height.min(360));
    for y in 0..cut.height {
        let width = cut.width;
        cut.plane8_mut(0)?.row_mut(y).copy_from_slice(&frame.plane8(0)?.row(y)[..width]);
    }
    Some(cut)
}

fn lanczos(x: f64) -> f64 {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) };
    if x.abs() < 3.0 { sinc(x) * sinc(x / 3.0) } else { 0.0 }
}

/// The frame at `p` by direct summation; edge samples go on for ever.
fn reference(frame: &Frame, p: Point2) -> f64 {
    let plane = frame.plane8(0).expect("8 bit");
    let (u, v) = (p.x - 0.5, p.y - 0.5);
    let weights = |u: f64| {
        let w: [f64; 6] = std::array::from_fn(|k| lanczos(u.floor() - 2.0 + k as f64 - u));
        w.map(|x| x / w.iter().sum::<f64>())
    };
    let at = |i: f64, k: usize, n: usize| (i.floor() - 2.0 + k as f64).clamp(0.0, n as f64 - 1.0) as usize;
    let (wx, wy) = (weights(u), weights(v));
    let row = |l: usize| {
        let row = plane.row(at(v, l, plane.height()));
        (0..6).map(|k| wx[k] * f64::from(row[at(u, k, plane.width())])).sum::<f64>()
    };
    (0..6).map(|l| wy[l] * row(l)).sum::<f64>().clamp(0.0, 255.0)
}

/// Mean squared difference of neighbors, a margin left out.
fn gradient_energy((width, height): (usize, usize), at: impl Fn(usize, usize) -> f64) -> f64 {
    let inner = (12..height - 12).flat_map(|y| (12..width - 12).map(move |x| (x, y)));
    inner.map(|(x, y)| (at(x + 1, y) - at(x, y)).powi(2) + (at(x, y + 1) - at(x, y)).powi(2)).sum()
}

/// Gradient energy of a default rendering relative to the reference.
fn sharpness(frame: &Frame, zoom: f64, angle: f64, t: Vec2) -> f64 {
    let (width, height) = (frame.width, frame.height);
    let center = Point2::new(width as f64 / 2.0, height as f64 / 2.0);
    let forward = Similarity2::about(center, angle, zoom, t).to_homography();
    let field = WarpField::from_forward_homography(&forward).expect("regular");
    let mut out = Frame::new(frame.format, width, height);
    let lattice = Lattice::new(&field, width, height);
    Renderer::new(RenderOptions::default()).render(frame, &lattice, &mut out).expect("sizes and formats agree");
    let place = |k: usize| Point2::new((k % width) as f64 + 0.5, (k / width) as f64 + 0.5);
    let ideal: Vec<f64> = (0..width * height).map(|k| reference(frame, field.map(place(k)).expect("affine"))).collect();
    let plane = out.plane8(0).expect("8 bit");
    let energy = gradient_energy((width, height), |x, y| f64::from(plane.row(y)[x]));
    energy / gradient_energy((width, height), |x, y| ideal[y * width + x])
}

#[test]
fn the_default_kernel_keeps_the_sharpness_of_lanczos_on_real_video() {
    let mut rng = fastrand::Rng::with_seed(11);
    for name in CLIPS {
        let Some(frame) = luma(name) else { continue };
        let warps = [1.0, 1.05, 1.12, 1.2].map(|zoom| {
            let t = Vec2::new(6.0 * rng.f64() - 3.0, 6.0 * rng.f64() - 3.0);
            sharpness(&frame, zoom, 0.06 * rng.f64() - 0.03, t)
        });
        let mean = warps.iter().sum::<f64>() / 4.0;
        eprintln!("{name}: gradient energy {mean:.3} of Lanczos-3's; at zoom 1, 1.05, 1.12, 1.2: {warps:.3?}");
        assert!((0.97..1.06).contains(&mean), "{name}: {mean}");
    }
}
