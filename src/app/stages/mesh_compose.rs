//! `mesh.compose`: one mesh made of parts of two.

use serde_json::json;

use super::morphing::{of_file, report_line, write_report};
use super::prelude::*;
use super::values::Posed;
use crate::pipeline::paths::to_path;
use plumbline_shape::mesh::{Model, RepairOptions, Repaired, repair};
use plumbline_shape::morph::composition::{Cut, SeamFile, compose};

/// Settings of `mesh.compose`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ComposeSettings {
    /// Cuts of both meshes and their joint (`plumbline schema seam` describes the file)
    #[schemars(extend("format" = "path"))]
    pub seam: String,
    /// Also write a report: NAME.html or NAME.json
    #[schemars(extend("format" = "path", "report" = true))]
    pub report: Option<String>,
}

impl Stage for ComposeSettings {
    const KIND: &'static str = "mesh.compose";
    const ALIASES: &'static [&'static str] = &["compose"];
    const SUMMARY: &'static str = "cuts two meshes and makes one of the parts, with a smooth transition";
    const INPUTS: &'static [Port] = &[
        Port::one("base", PortType::Mesh, "the mesh that stays where it is"),
        Port::one("part", PortType::Mesh, "the mesh of which a part is added"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the composed mesh")];
    const REQUIRED: &'static [&'static str] = &["seam"];
    type Input = (Posed, Posed);
    type Output = (Posed,);

    fn reads(&self) -> Vec<&str> {
        vec![&self.seam]
    }

    fn writes(&self) -> Vec<String> {
        self.report.iter().cloned().collect()
    }

    fn run(&self, (base, part): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let (base, part) = (base.mesh()?, part.mesh()?);
        // The seam, in vertices of the meshes as they were read.
        let in_seam = of_file(&self.seam);
        let file = SeamFile::read(&to_path(&self.seam)).map_err(&in_seam)?;
        let mut options = file.of_meshes(&base, &part).map_err(&in_seam)?;
        // Both repaired; the seam in vertices of what repair left.
        let [base, part] = [&base, &part].map(|mesh| repair(mesh, &RepairOptions::default(), &context.job.run()));
        let (base, part) = (base?, part?);
        if let Some(surface) = &mut context.summary.surface {
            surface.repairs = base.report.changes().chain(part.report.changes()).collect();
        }
        renumber(&mut options.base, &base, "base").map_err(&in_seam)?;
        renumber(&mut options.part, &part, "part").map_err(&in_seam)?;
        options.landmarks = options
            .landmarks
            .iter()
            .filter_map(|&(a, b)| base.vertex_of_source[a as usize].zip(part.vertex_of_source[b as usize]))
            .collect();
        // Cut, join, and report.
        let composed = compose(&base.mesh, &part.mesh, &options, &context.job.run())?;
        let degrees = composed.crease.to_degrees();
        report_line(
            context,
            format!(
                "a seam of {} vertices; the cuts were {:.2} % of the base's size apart; faces meet there at {degrees:.0}° at most",
                composed.seam.len(),
                100.0 * composed.gap
            ),
        );
        let report = json!({
            "version": 1,
            "seam": self.seam,
            "seam_vertices": composed.seam,
            "gap": composed.gap,
            "crease_deg": degrees,
            "scale": composed.base_from_part.scaling(),
        });
        write_report(context, self.report.as_ref(), &report)?;
        Ok((Posed::at_rest(Model::of_mesh(composed.mesh)),))
    }
}

/// Vertices of the file become those of the repaired mesh.
fn renumber(cut: &mut Cut, repaired: &Repaired, which: &'static str) -> Result<(), plumbline_shape::morph::MorphError> {
    let (Cut::Lasso { vertices, keep } | Cut::Loop { vertices, keep }) = cut else { return Ok(()) };
    for v in vertices.iter_mut().chain([keep]) {
        *v = repaired.vertex_of_source[*v as usize].ok_or_else(|| plumbline_shape::morph::MorphError::Seam {
            which,
            fault: format!("names vertex {v}, of which repair left nothing; name another"),
        })?;
    }
    Ok(())
}
