//! The image side of analysis at 1080p: luma reduction 3:1, the pyramid at analysis size and at full size, corners.
//!
//! The limit is memory: 1080p luma is 2.07 MB, read once; at 10 GB/s that takes 0.2 ms.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use plumbline::image::feature::CornerDetector;
use plumbline::image::{Frame, Layout, PixelFormat, Plane, PlaneRef, Pyramid, analysis_luma};

/// Overlapping rectangles under a little noise.
fn picture(width: usize, height: usize) -> Plane<u8> {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut plane = Plane::from_fn(width, height, |_, _| 100);
    for _ in 0..800 {
        let (x, y, gray) = (rng.usize(0..width), rng.usize(0..height), rng.u8(..250));
        let (w, h) = (rng.usize(4..width / 12), rng.usize(4..height / 8));
        for row in y..(y + h).min(height) {
            plane.as_mut().row_mut(row)[x..(x + w).min(width)].fill(gray);
        }
    }
    Plane::from_fn(width, height, |x, y| plane.as_ref().row(y)[x] + rng.u8(..5))
}

/// FNV-1a over the rows.
fn checksum(plane: PlaneRef<'_, u8>) -> u64 {
    let bytes = (0..plane.height()).flat_map(|y| plane.row(y));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, v| (hash ^ u64::from(*v)).wrapping_mul(0x0100_0000_01b3))
}

fn luma(c: &mut Criterion) {
    let mut frame = Frame::new(PixelFormat::opaque(Layout::Yuv420, 8), 1920, 1080);
    let source = picture(1920, 1080);
    for y in 0..1080 {
        frame.plane8_mut(0).expect("8 bit").row_mut(y).copy_from_slice(source.as_ref().row(y));
    }
    for (name, side, sum) in [("3:1", 640, 0xc5dd_53ea_d3f1_5e0d), ("general ratio", 852, 0xd33b_aa5e_427b_b29c)] {
        let mut out = Plane::new(0, 0);
        assert!(analysis_luma(&frame, side, &mut out));
        assert_eq!(checksum(out.as_ref()), sum, "{:#x}", checksum(out.as_ref()));
        c.bench_function(&format!("analysis luma of 1920x1080, {name}"), |b| {
            b.iter(|| assert!(analysis_luma(black_box(&frame), side, &mut out)));
        });
    }
}

fn pyramid(c: &mut Criterion) {
    for (width, height, sum) in [(640, 360, 0x151d_e790_7e7e_54e7), (1920, 1080, 0x3893_ffc3_97af_beb4)] {
        let (image, mut pyramid) = (picture(width, height), Pyramid::new());
        pyramid.rebuild(image.as_ref(), 4);
        let got = checksum(pyramid.levels()[3].interior());
        assert_eq!(got, sum, "{got:#x}");
        c.bench_function(&format!("pyramid, 4 levels, {width}x{height}"), |b| {
            b.iter(|| pyramid.rebuild(black_box(image.as_ref()), 4));
        });
    }
}

fn corners(c: &mut Criterion) {
    let mut pyramid = Pyramid::new();
    pyramid.rebuild(picture(640, 360).as_ref(), 1);
    let (mut detector, mut found) = (CornerDetector::default(), Vec::new());
    let mut run = || {
        found.clear();
        detector.top_up(black_box(&pyramid.levels()[0]), &[], 3, None, &mut found);
        found.len()
    };
    assert_eq!(run(), 422, "three in nearly each of 144 buckets");
    c.bench_function("corners, every bucket, 640x360", |b| b.iter(&mut run));
}

criterion_group!(benches, luma, pyramid, corners);
criterion_main!(benches);
