//! `mesh.modes`: the softest deformations of a surface, and its near-rigid parts.

use std::fmt::Write as _;

use nalgebra::Vector3;
use serde_json::json;

use super::npz::{Array, write_npz};
use super::prelude::*;
use super::values::Posed;
use crate::pipeline::paths::to_path;
use plumbline_shape::surface::SolvableMesh;
use plumbline_shape::surface::modal::{Modes, ModesOptions, PartCount, Parts, PartsOptions, modes, parts};

/// Settings of `mesh.modes`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MeshModesSettings {
    /// How many modes beside the rigid motions
    #[schemars(range(min = 1, max = 1000))]
    pub count: u32,
    /// How modes are computed.
    #[serde(flatten)]
    pub options: ModesOptions,
    /// Number of parts; as many as the motion needs if left out
    #[schemars(range(min = 1, max = 10_000))]
    pub part_count: Option<u32>,
    /// The NumPy archive of modes to write: values, vectors, residuals
    #[schemars(extend("format" = "path"))]
    pub modes: Option<String>,
    /// The file of near-rigid parts to write, as JSON
    #[schemars(extend("format" = "path"))]
    pub parts: Option<String>,
}

impl Default for MeshModesSettings {
    fn default() -> Self {
        Self { count: 20, options: ModesOptions::default(), part_count: None, modes: None, parts: None }
    }
}

impl Stage for MeshModesSettings {
    const KIND: &'static str = "mesh.modes";
    const SUMMARY: &'static str = "finds how a surface bends most easily, and the parts that stay almost rigid in that";
    const INPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh at rest")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the files")];
    type Input = (Posed,);
    type Output = (Written,);

    fn writes(&self) -> Vec<String> {
        self.modes.iter().chain(&self.parts).cloned().collect()
    }

    fn run(&self, (posed,): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        if self.modes.is_none() && self.parts.is_none() {
            let name = context.name();
            return Err(RunError::Usage(format!("`{name}` would write nothing; name `modes`, `parts` or both")));
        }
        let mesh = posed.model.mesh();
        let solvable = SolvableMesh::new(mesh, &context.job.run())?;
        let found = modes(&solvable.mesh, self.count as usize, &self.options, &context.job.run())?;
        context.job.check_cancel()?;
        let options = PartsOptions {
            count: self.part_count.map_or(PartsOptions::default().count, |n| PartCount::Exactly(n as usize)),
        };
        let divided = self.parts.as_ref().map(|_| parts(&solvable.mesh, &found, &options, &context.job.run()));
        let divided = divided.transpose()?;
        report_modes(context, &solvable, &found, divided.as_ref(), self);
        if let Some(path) = self.modes.as_deref().map(to_path) {
            context.fill_file(&path, |out| write_npz(out, &arrays(&found, &solvable)))?;
        }
        if let (Some(path), Some(divided)) = (self.parts.as_deref().map(to_path), &divided) {
            context.write_file(&path, format!("{}\n", parts_json(divided, &solvable)))?;
        }
        Ok((Written,))
    }
}

fn report_modes(
    context: &mut Context<'_, '_>,
    solvable: &SolvableMesh,
    found: &Modes,
    divided: Option<&Parts>,
    settings: &MeshModesSettings,
) {
    let range = match found.values.as_slice() {
        [] => String::new(),
        [first, .., last] => format!(", values {first:.3e} to {last:.3e}"),
        [only] => format!(", value {only:.3e}"),
    };
    let mut line = format!("{} beside {} rigid motions{range}", found.values.len(), found.rigid);
    if let Some(divided) = divided {
        let left = divided.unexplained.last().copied().unwrap_or(1.0);
        let _ = write!(line, "; {} parts leave {:.1} % of the motion unexplained", divided.count, 100.0 * left);
    }
    if let Some(surface) = &mut context.summary.surface {
        surface.repairs = solvable.report.changes().collect();
        surface.modes = Some(line);
    }
    if !found.converged {
        let worst = found.residuals.iter().copied().fold(0.0, f64::max);
        context.warn(format!("not all modes are exact: the largest residual is {worst:.1e}"));
    }
    if found.values.len() < settings.count as usize {
        context.warn(format!("the surface has no more than {} modes", found.values.len()));
    }
}

/// `values` (#modes), `vectors` (#modes × #V × 3) by the vertices of the file, `residuals` (#modes).
fn arrays(found: &Modes, solvable: &SolvableMesh) -> Vec<Array<'static>> {
    let (count, vertices) = (found.values.len(), solvable.vertex_of_source.len());
    let still = Vector3::zeros();
    let of_file = |mode: &Vec<Vector3<f64>>| -> Vec<f64> {
        let moved = solvable.vertex_of_source.iter().map(|v| v.map_or(&still, |v| &mode[v as usize]));
        moved.flat_map(|u| [u.x, u.y, u.z]).collect()
    };
    let vectors = found.vectors.iter().flat_map(of_file).collect();
    vec![
        Array { name: "values", shape: vec![count], values: found.values.clone() },
        Array { name: "vectors", shape: vec![count, vertices, 3], values: vectors },
        Array { name: "residuals", shape: vec![count], values: found.residuals.clone() },
    ]
}

/// The part of each vertex of the file; null where it is on no triangle.
fn parts_json(divided: &Parts, solvable: &SolvableMesh) -> serde_json::Value {
    let of_vertex: Vec<Option<u32>> =
        solvable.vertex_of_source.iter().map(|v| v.map(|v| divided.of_vertex[v as usize])).collect();
    json!({
        "format": "plumbline.parts",
        "version": 1,
        "count": divided.count,
        "unexplained": divided.unexplained,
        "of_vertex": of_vertex,
    })
}
