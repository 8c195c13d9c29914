//! Deforms a mesh file: `deform_mesh MESH POSE METHOD [--solver S] [--start rest] [--bending B] [--smoothness A]
//! [--thickness H] [--alternating] [--iterations N] [--tolerance T] [--repeat K] [-o POSITIONS]`.
//!
//! A line of POSE holds a vertex, numbered from 0, and its three target coordinates; all are held exactly. Prints one JSON
//! object: CPU seconds of binding and deforming (means over K runs), peak memory, energies, report. POSITIONS gets a line per
//! vertex.

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Parser;
use nalgebra::Point3;
use plumbline::num::run::Run;
use plumbline::shape::mesh::{ReadLimits, read_model};
use plumbline::shape::surface::{
    Convergence, DeformOptions, Deformer, HandlePose, Handles, InitialGuess, Method, PrimoOptions, RotationEstimation,
    Solver,
};

#[derive(Parser)]
struct Arguments {
    mesh: PathBuf,
    pose: PathBuf,
    method: String,
    #[arg(long, default_value = "accelerated", value_parser = ["local-global", "accelerated", "gauss-newton"])]
    solver: String,
    #[arg(long, default_value = "auto", value_parser = ["auto", "coarse", "spread", "rest"])]
    start: String,
    #[arg(long, default_value_t = 1.0)]
    bending: f64,
    #[arg(long, default_value_t = 0.0)]
    smoothness: f64,
    #[arg(long, default_value_t = 3.0)]
    thickness: f64,
    #[arg(long)]
    alternating: bool,
    #[arg(long, default_value_t = 500)]
    iterations: usize,
    #[arg(long, default_value_t = 1e-6)]
    tolerance: f64,
    #[arg(long, default_value_t = 1)]
    repeat: usize,
    #[arg(short)]
    out: Option<PathBuf>,
}

pub(super) fn main() -> Result<(), Box<dyn Error>> {
    let a = Arguments::parse_from(super::args());
    let model = read_model(&a.mesh, &ReadLimits::default(), &Run::default())?;
    let (handles, pose) = read_pose(&a.pose)?;
    let method = Method::from_name(&a.method).ok_or("no such method")?;
    let solver = match a.solver.as_str() {
        "local-global" => Solver::LocalGlobal,
        "gauss-newton" => Solver::GaussNewton,
        _ => Solver::Accelerated,
    };
    let options = DeformOptions {
        solver,
        bending: a.bending,
        smoothness: a.smoothness,
        primo: PrimoOptions { thickness: a.thickness, ..PrimoOptions::default() },
        rotation_estimation: if a.alternating { RotationEstimation::Alternating } else { RotationEstimation::Spread },
        ..Default::default()
    };
    let start = match a.start.as_str() {
        "rest" => InitialGuess::Rest,
        "spread" => InitialGuess::Spread,
        "coarse" => InitialGuess::Coarse,
        _ => InitialGuess::Auto,
    };
    let convergence = Convergence { max_iterations: a.iterations, tolerance: a.tolerance };
    let (mut bind_s, mut deform_s, mut last) = (0.0, 0.0, None);
    for _ in 0..a.repeat.max(1) {
        let began = cpu_seconds();
        let mut bound = Deformer::new(method, model.mesh(), &handles, &options, &Run::default())?;
        let ready = cpu_seconds();
        last = Some(bound.deform(&pose, start, &convergence, &Run::default())?);
        bind_s += ready - began;
        deform_s += cpu_seconds() - ready;
    }
    let done = last.ok_or("nothing was run")?;
    let report = &done.report;
    let runs = a.repeat.max(1) as f64;
    let told = serde_json::json!({
        "vertices": done.positions.len(),
        "bind_s": bind_s / runs,
        "deform_s": deform_s / runs,
        "peak_mb": peak_megabytes(),
        "iterations": report.iterations,
        "energies": report.energies,
        "stop": report.stop.to_string(),
        "constraint_error": report.constraint_error,
        "worst_stretch": report.shape.worst_stretch,
        "rms_stretch": report.shape.rms_stretch,
        "flipped_faces": report.shape.flipped_faces,
        "volume_ratio": report.shape.volume_ratio,
        "negative_weights": report.negative_weights,
        "degenerate_faces": report.degenerate_faces,
        "held_still": report.fixed_components.len(),
    });
    {
        println!("{told}");
    }
    if let Some(out) = a.out {
        let mut text = String::new();
        for p in &done.positions {
            writeln!(text, "{:?} {:?} {:?}", p.x, p.y, p.z)?;
        }
        std::fs::write(out, text)?;
    }
    Ok(())
}

fn read_pose(path: &Path) -> Result<(Handles, HandlePose), Box<dyn Error>> {
    let mut held = Vec::new();
    for line in std::fs::read_to_string(path)?.lines() {
        let mut words = line.split_whitespace();
        let Some(vertex) = words.next() else { continue };
        let place: Vec<f64> = words.map(str::parse).collect::<Result<_, _>>()?;
        let &[x, y, z] = &place[..] else { return Err(format!("not a vertex and three coordinates: {line}").into()) };
        held.push((vertex.parse::<u32>()?, Point3::new(x, y, z)));
    }
    held.sort_by_key(|h| h.0);
    let handles = Handles::exact(held.iter().map(|h| h.0))?;
    Ok((handles, HandlePose::new(held.into_iter().map(|h| h.1).collect())))
}

/// CPU time of this process where the system tells it, wall time elsewhere.
fn cpu_seconds() -> f64 {
    let told = std::fs::read_to_string("/proc/self/schedstat").ok();
    let nanoseconds = told.and_then(|s| s.split_whitespace().next().and_then(|word| word.parse::<f64>().ok()));
    nanoseconds.map_or_else(
        || std::time::UNIX_EPOCH.elapsed().map_or(0.0, |d| d.as_secs_f64()),
        |nanoseconds| nanoseconds * 1e-9,
    )
}

/// Most memory that this process has held at once, where the system tells it.
fn peak_megabytes() -> Option<f64> {
    let told = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = told.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes / 1024.0)
}
