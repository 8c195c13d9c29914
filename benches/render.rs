//! Rendering a 1080p frame through a similarity and a mesh, and making the lattice.
//!
//! Runs on one thread, so that figures are core time. Every case checks the sum of its output first: a kernel that got
//! fast by being wrong fails here. The physical limit is memory: 3.1 MB read and 3.1 MB written per 8-bit frame, about
//! 0.6 ms at 10 GB/s.
#![allow(missing_docs)] // made by `criterion_group!`

use criterion::{Criterion, criterion_group, criterion_main};
use plumbline::image::grid::GridMesh;
use plumbline::image::render::{Border, Interpolation, RenderOptions, Renderer};
use plumbline::image::warp::{Lattice, WarpField};
use plumbline::image::{Frame, Layout, PixelFormat};
use plumbline::num::math::{Point2, Similarity2, Vec2};

const WIDTH: usize = 1920;
const HEIGHT: usize = 1080;

/// Waves of all scales, so that neither kernels nor caches meet anything special.
fn scene(bits: u8) -> Frame {
    let format = PixelFormat::opaque(Layout::Yuv420, bits);
    let mut frame = Frame::new(format, WIDTH, HEIGHT);
    let max = f64::from((1_u32 << bits) - 1);
    for i in 0..3 {
        let (w, h) = format.plane_size(i, WIDTH, HEIGHT);
        for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
            let (u, v) = (x as f64, y as f64);
            let wave = (0.9 * u).sin() * (0.7 * v).cos() + (0.013 * u + 0.031 * v).sin();
            let value = (0.5 + 0.2 * wave) * max;
            match frame.plane8_mut(i) {
                Some(mut plane) => plane.row_mut(y)[x] = value as u8,
                None => frame.plane16_mut(i).expect("own memory").row_mut(y)[x] = value as u16,
            }
        }
    }
    frame
}

/// What a stabiliser does to a frame: a little rotation, zoom and shift.
fn similarity() -> Similarity2 {
    Similarity2::about(Point2::new(960.0, 540.0), 0.012, 1.08, Vec2::new(11.3, -7.6))
}

/// The same with bends of a few pixels, on the grid of a content-preserving warp.
fn mesh() -> GridMesh {
    let vertex = |k: usize| {
        let p = Point2::new((k % 65) as f64 * 30.0, (k / 65) as f64 * 30.0);
        let bend = Vec2::new((0.006 * p.y + 0.002 * p.x).sin(), (0.005 * p.x).cos());
        similarity().apply(p) + 2.0 * bend
    };
    GridMesh { cols: 64, rows: 36, vertices: (0..65 * 37).map(vertex).collect() }
}

fn checksum(frame: &Frame) -> u64 {
    let sum8 = |i| frame.plane8(i).map(|p| (0..p.height()).flat_map(|y| p.row(y)).map(|&v| u64::from(v)).sum::<u64>());
    let sum16 =
        |i| frame.plane16(i).map(|p| (0..p.height()).flat_map(|y| p.row(y)).map(|&v| u64::from(v)).sum::<u64>());
    (0..frame.format.planes()).map(|i| sum8(i).or_else(|| sum16(i)).expect("own memory")).sum()
}

fn render(c: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let rigid = WarpField::from_forward_homography(&similarity().to_homography()).expect("regular");
    let bent = WarpField::from_forward_mesh(&mesh(), WIDTH as f64, HEIGHT as f64).expect("well formed");
    let fields = [("similarity", &rigid), ("mesh", &bent)].map(|(name, f)| (name, Lattice::new(f, WIDTH, HEIGHT)));
    for bits in [8, 10] {
        let src = scene(bits);
        let mean = checksum(&src) as f64;
        let mut dst = Frame::new(src.format, WIDTH, HEIGHT);
        for (name, lattice) in &fields {
            for interpolation in [Interpolation::Bicubic, Interpolation::Lanczos3] {
                let renderer = Renderer::new(RenderOptions { interpolation, border: Border::Replicate });
                renderer.render(&src, lattice, &mut dst).expect("sizes and formats agree");
                assert!((checksum(&dst) as f64 / mean - 1.0).abs() < 0.02, "{name} {bits} bit lost its content");
                c.bench_function(&format!("render 1080p {bits} bit {interpolation:?} {name}"), |b| {
                    pool.install(|| b.iter(|| renderer.render(&src, lattice, &mut dst)));
                });
            }
        }
    }
}

fn lattice(c: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let bent = WarpField::from_forward_mesh(&mesh(), WIDTH as f64, HEIGHT as f64).expect("well formed");
    assert_eq!(Lattice::new(&bent, WIDTH, HEIGHT).step(), 16);
    c.bench_function("lattice 1080p mesh 64x36", |b| {
        pool.install(|| b.iter(|| Lattice::new(&bent, WIDTH, HEIGHT)));
    });
}

criterion_group!(benches, render, lattice);
criterion_main!(benches);
