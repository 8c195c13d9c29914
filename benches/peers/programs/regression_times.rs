//! CPU time of a pose by rotational regression, full and reduced, on one humanoid at several resolutions:
//! `regression_times [CELL...]`.
//!
//! Learns from poses of its movements that dual quaternions made. Prints a line for each resolution: vertices, shapes, seconds
//! of a pose by all triangles (a solve), of what a pose means to the shapes (which does not know the surface), of the product
//! that makes positions of it, and of linear blending.

use std::error::Error;
use std::hint::black_box;

use nalgebra::Matrix4;
use plumbline::num::run::Run;
use plumbline::shape::character::humanoid::humanoid;
use plumbline::shape::character::regression::{Example, RegressionModel, RegressionOptions};
use plumbline::shape::character::skinning::{Skinner, SkinningMethod};
use plumbline::shape::character::{Character, Extrapolation};

/// Poses of each movement.
const POSES: u32 = 6;
/// Shapes for each joint in the mean.
const SHAPES: usize = 3;

pub(super) fn main() -> Result<(), Box<dyn Error>> {
    // On the one thread that measures.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(pool.install(|| measured().map_err(|e| e.to_string()))?)
}

fn measured() -> Result<(), Box<dyn Error>> {
    let cells: Vec<f64> = super::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let cells = if cells.is_empty() { vec![0.06, 0.03, 0.02] } else { cells };
    for cell in cells {
        let person = humanoid(cell)?;
        let mesh = person.model.mesh();
        let (skeleton, skin) = (&person.skeleton, &person.skin);
        let curved = Skinner::new(mesh, None, skeleton, skin, SkinningMethod::DualQuaternion, &Run::default())?;
        let linear = Skinner::new(mesh, None, skeleton, skin, SkinningMethod::LinearBlend, &Run::default())?;
        let samples = poses(&person)?;
        let example = |matrices: &Vec<Matrix4<f64>>| -> Result<Example, Box<dyn Error>> {
            Ok(Example { matrices: matrices.clone(), positions: curved.positions(matrices)? })
        };
        let examples: Vec<Example> = samples.iter().map(example).collect::<Result<_, _>>()?;
        let options = RegressionOptions::default();
        let (mut full, _) =
            RegressionModel::train(mesh, skeleton, skin.weights(), &examples, &options, &Run::default())?;
        let reduced = full.reduced(&samples, SHAPES, &Run::default())?;
        let pose = &samples[POSES as usize / 2];
        let told = serde_json::json!({
            "vertices": mesh.vertex_count(),
            "shapes": reduced.shape_count(),
            "full": least(10, || Ok(full.positions(pose)?.len()))?,
            "coordinates": least(1000, || Ok(size_of_val(&black_box(reduced.coordinates(pose)?))))?,
            "positions": least(10, || Ok(reduced.positions(pose)?.len()))?,
            "linear": least(200, || Ok(linear.positions(pose)?.len()))?,
        });
        {
            println!("{told}");
        }
    }
    Ok(())
}

/// Poses of all movements: how space moves with each joint.
fn poses(person: &Character) -> Result<Vec<Vec<Matrix4<f64>>>, Box<dyn Error>> {
    let mut found = Vec::new();
    for clip in &person.clips {
        let (first, last) = clip.span().unwrap_or((0.0, 0.0));
        for k in 0..POSES {
            let time = first + (last - first) * f64::from(k) / f64::from(POSES);
            let pose = clip.pose(&person.skeleton, time, Extrapolation::Constant)?;
            found.push(person.skin.joint_matrices(&person.skeleton.globals(&pose)?)?);
        }
    }
    Ok(found)
}

/// Seconds of one run: the least mean of nine rounds.
fn least(runs: u32, mut run: impl FnMut() -> Result<usize, Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    let mut least = f64::INFINITY;
    for _ in 0..9 {
        let began = cpu_seconds();
        for _ in 0..runs {
            black_box(run()?);
        }
        least = least.min((cpu_seconds() - began) / f64::from(runs));
    }
    Ok(least)
}

/// CPU time of this thread where the system tells it, wall time elsewhere.
fn cpu_seconds() -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|s| s.split_whitespace().next().and_then(|word| word.parse::<f64>().ok()));
    nanoseconds.map_or_else(
        || std::time::UNIX_EPOCH.elapsed().map_or(0.0, |d| d.as_secs_f64()),
        |nanoseconds| nanoseconds * 1e-9,
    )
}
