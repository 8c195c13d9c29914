//! Bundle adjustment of a whole shot: 150 frames of 700 points followed for some 30 frames each, one thread.
//!
//! The limit is arithmetic: a track of L frames takes 3·(6L)²/2 multiply-adds to eliminate, 0.35·10⁹ for all; the factor of 900
//! unknowns another 0.12·10⁹; an observation some 400 for its derivatives and their products.

use criterion::{Criterion, criterion_group, criterion_main};
use plumbline::num::energy::Loss;
use plumbline::num::optim::levenberg_marquardt::DampingOptions;
use plumbline::num::run::Run;
use plumbline::video::motion::sfm::bundle::{BundleOptions, Freedom, RobustFit, adjust};
use plumbline::video::motion::sfm::{Observation, Scene, ScenePoint, TrackTable};
use synthetic::{Disturbance, Shot, ShotOptions};

/// The synthetic shots of the unit tests.
#[path = "../src/video/motion/sfm/tests/synthetic/mod.rs"]
#[allow(dead_code, unused_imports)] // path errors and tables of tracks are for tests
mod synthetic;

/// Iterations per run: what is paid once is spread as in a real run.
const ITERATIONS: usize = 10;

fn options(readout: Freedom) -> BundleOptions {
    let damping = DampingOptions { tolerance: 0.0, max_iterations: ITERATIONS, ..DampingOptions::default() };
    let fit = RobustFit { losses: vec![Loss::Huber(2.0)], damping, ..RobustFit::default() };
    BundleOptions {
        fit,
        focal: Freedom::Free,
        k1: Freedom::Near { value: 0.0, sigma: 0.1 },
        readout,
        uncertainty: false,
        ..BundleOptions::default()
    }
}

fn bundle(c: &mut Criterion) {
    let near = Disturbance { rotation: 0.001, shift: 0.001, depth_factor: 1.05, focal_factor: 1.01 };
    let mut group = c.benchmark_group("bundle, 150 frames x 700 observations, 10 iterations");
    group.sample_size(10);
    for (name, readout, freedom) in [("global shutter", 0.0, Freedom::Fixed), ("rolling shutter", 0.6, Freedom::Free)] {
        let made = ShotOptions {
            seed: 1,
            frames: 150,
            per_frame: 700,
            lifetime: 60.0,
            noise_px: 0.3,
            readout,
            ..ShotOptions::default()
        };
        let shot = Shot::new(&made);
        let start = shot.start(&near, 1);
        group.bench_function(name, |b| {
            b.iter(|| {
                adjust(&mut start.clone(), &shot.observations, &options(freedom), &Run::default())
                    .expect("a sound problem")
            });
        });
    }
    group.finish();
}

criterion_group!(benches, bundle);
criterion_main!(benches);
