//! KLT at the analysis size: 1000 points forward and backward between two pictures, one thread.
//!
//! The limit is arithmetic: one step of a 21×21 window reads 22 rows and does about 15 vector operations per row, 330 with
//! AVX-512; a point takes some 30 steps and 8 templates there and back.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use plumbline::image::{Plane, Pyramid};
use plumbline::video::track::track;

fn waves(dx: f64, dy: f64) -> Pyramid {
    let mut rng = fastrand::Rng::with_seed(1);
    let image = Plane::from_fn(640, 360, |x, y| {
        let (x, y) = (x as f64 - dx, y as f64 - dy);
        let v = (0.31 * x + 0.15 * y).sin() + (0.27 * y - 0.18 * x).cos() + (0.041 * x).sin() * (0.053 * y).cos();
        (128.0 + 38.0 * v) as u8 + rng.u8(..3)
    });
    let mut pyramid = Pyramid::new();
    pyramid.rebuild(image.as_ref(), 4);
    pyramid
}

fn klt(c: &mut Criterion) {
    let (prev, next) = (waves(0.0, 0.0), waves(5.3, -3.8));
    let points: Vec<[f32; 2]> =
        (0..1000).map(|i| [20.5 + 15.0 * (i % 40) as f32, 20.5 + 13.0 * (i / 40) as f32]).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let mut matches = Vec::new();
    c.bench_function("klt, 1000 points there and back, 640x360", |b| {
        pool.install(|| {
            b.iter(|| matches = track(black_box(&prev), &next, &points, &points));
        });
    });
    let kept = matches.iter().flatten().count();
    let sum: f64 = matches.iter().flatten().map(|m| f64::from(m.position[0]) + f64::from(m.position[1])).sum();
    let moved = sum
        - points.iter().zip(&matches).filter(|(_, m)| m.is_some()).map(|(p, _)| f64::from(p[0] + p[1])).sum::<f64>();
    assert!(kept > 900, "{kept} points kept");
    assert!((moved / kept as f64 - 1.5).abs() < 0.05, "mean motion {}", moved / kept as f64);
}

criterion_group!(benches, klt);
criterion_main!(benches);
