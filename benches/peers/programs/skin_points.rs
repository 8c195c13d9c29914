//! Skins points: `skin_points REST WEIGHTS MATRICES METHOD [--single] [--repeat K] [-o POSITIONS]`.
//!
//! All files are 64-bit numbers, little-endian: REST three per vertex, WEIGHTS one per vertex and joint (row by row, zeros where
//! a vertex does not follow), MATRICES sixteen per joint (row by row). METHOD is `lbs` or `dqs`. Prints one JSON object: CPU
//! seconds of one pose (the least of five means over K), vertices per second.

use std::error::Error;
use std::path::{Path, PathBuf};

use clap::Parser;
use nalgebra::{Matrix4, Point3};
use plumbline::num::math::Trs;
use plumbline::num::run::Run;
use plumbline::shape::character::skinning::{PackedSkin, Skinner, SkinningMethod};
use plumbline::shape::character::{Joint, Skeleton, Skin, SkinWeights};
use plumbline::shape::mesh::TriMesh;

#[derive(Parser)]
struct Arguments {
    rest: PathBuf,
    weights: PathBuf,
    matrices: PathBuf,
    #[arg(value_parser = ["lbs", "dqs"])]
    method: String,
    /// In single precision, four joints per vertex
    #[arg(long)]
    single: bool,
    #[arg(long, default_value_t = 1)]
    repeat: usize,
    #[arg(short)]
    out: Option<PathBuf>,
}

pub(super) fn main() -> Result<(), Box<dyn Error>> {
    let a = Arguments::parse_from(super::args());
    let points = numbers(&a.rest)?.chunks_exact(3).map(|p| Point3::new(p[0], p[1], p[2])).collect();
    let matrices: Vec<Matrix4<f64>> = numbers(&a.matrices)?.chunks_exact(16).map(Matrix4::from_row_slice).collect();
    let mesh = TriMesh::new(points, Vec::new())?;
    let table = numbers(&a.weights)?;
    let row = |r: &[f64]| (0..).zip(r.to_vec()).collect::<Vec<(u32, f64)>>();
    let weights = SkinWeights::new(matrices.len(), table.chunks_exact(matrices.len()).map(row))?;
    let skin = Skin::new(weights, vec![Matrix4::identity(); matrices.len()])?;
    let (x, seconds) =
        if a.single { single(&a, &mesh, &skin, &matrices)? } else { double(&a, &mesh, &skin, &matrices)? };
    let rate = mesh.vertex_count() as f64 / seconds;
    {
        println!("{}", serde_json::json!({"seconds": seconds, "vertices_per_second": rate}));
    }
    if let Some(path) = &a.out {
        let bytes: Vec<u8> = x.iter().flat_map(|c| c.to_le_bytes()).collect();
        std::fs::write(path, bytes)?;
    }
    Ok(())
}

fn double(a: &Arguments, mesh: &TriMesh, skin: &Skin, m: &[Matrix4<f64>]) -> Result<(Vec<f64>, f64), Box<dyn Error>> {
    let root = |j| Joint { name: format!("{j}"), parent: None, rest: Trs::identity(), limits: None };
    let skeleton = Skeleton::new((0..m.len()).map(root).collect())?;
    let method = if a.method == "lbs" { SkinningMethod::LinearBlend } else { SkinningMethod::DualQuaternion };
    let skinner = Skinner::new(mesh, None, &skeleton, skin, method, &Run::default())?;
    let mut x = Vec::new();
    let least = timed(a.repeat, || {
        skinner.positions_into(m, &mut x)?;
        Ok(())
    })?;
    Ok((x.iter().flat_map(|p| [p.x, p.y, p.z]).collect(), least))
}

fn single(a: &Arguments, mesh: &TriMesh, skin: &Skin, m: &[Matrix4<f64>]) -> Result<(Vec<f64>, f64), Box<dyn Error>> {
    let packed = PackedSkin::new(mesh, skin)?;
    let mut x = vec![[0.0_f32; 3]; packed.vertex_count()];
    let mut from = Point3::origin();
    let least = timed(a.repeat, || {
        from = if a.method == "lbs" { packed.linear_blend(m, &mut x)? } else { packed.dual_quaternion(m, &mut x)? };
        Ok(())
    })?;
    let place = |x: &[f32; 3]| [0, 1, 2].map(|k| from[k] + f64::from(x[k]));
    Ok((x.iter().flat_map(place).collect(), least))
}

fn numbers(path: &Path) -> Result<Vec<f64>, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let (whole, rest) = bytes.as_chunks::<8>();
    if !rest.is_empty() {
        return Err(format!("{}: not 64-bit numbers", path.display()).into());
    }
    Ok(whole.iter().map(|b| f64::from_le_bytes(*b)).collect())
}

/// Seconds of one run: the least mean of five rounds.
fn timed(runs: usize, mut run: impl FnMut() -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    let mut least = f64::INFINITY;
    for _ in 0..5 {
        let began = cpu_seconds();
        for _ in 0..runs.max(1) {
            run()?;
        }
        least = least.min((cpu_seconds() - began) / runs.max(1) as f64);
    }
    Ok(least)
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
