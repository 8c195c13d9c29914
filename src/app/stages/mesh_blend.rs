//! `mesh.blend`: two meshes mixed as painted.

use nalgebra::Point3;
use serde_json::json;

use super::mesh_morph::MorphSettings;
use super::morphing::pair::{Pair, quality_json};
use super::morphing::shapes::Shapes;
use super::morphing::{of_file, report_line, write_report};
use super::prelude::*;
use super::values::Posed;
use crate::pipeline::paths::to_path;
use plumbline_shape::morph::correspondence::CorrespondenceMethod;
use plumbline_shape::morph::paint::Paint;
use plumbline_shape::morph::{Trajectory, TrajectoryOptions, time_field};

/// Settings of `mesh.blend`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BlendSettings {
    /// Times painted on the first mesh (`plumbline schema paint` describes the file)
    #[schemars(extend("format" = "path"))]
    pub paint: String,
    /// Corresponding points of both meshes, for meshes that are not two poses of one (`plumbline schema landmarks`, .cons
    /// or .yml)
    #[schemars(extend("format" = "path"))]
    pub landmarks: Option<String>,
    /// Iterations that make the shape more rigid towards both meshes
    #[serde(alias = "rounds")]
    #[schemars(range(min = 0, max = 10_000), extend("aliases" = ["rounds"]))]
    pub iterations: u32,
    /// Shapes from the first mesh to the blend, as NAME_0000.EXT and so on; 1: the blend alone
    #[schemars(range(min = 1, max = 9999))]
    pub frames: u32,
    /// Also write a report, with the self-intersections of every shape: NAME.html or NAME.json
    #[schemars(extend("format" = "path", "report" = true))]
    pub report: Option<String>,
}

impl Default for BlendSettings {
    fn default() -> Self {
        Self {
            paint: String::new(),
            landmarks: None,
            iterations: TrajectoryOptions::default().iterations as u32,
            frames: 1,
            report: None,
        }
    }
}

impl Stage for BlendSettings {
    const KIND: &'static str = "mesh.blend";
    const ALIASES: &'static [&'static str] = &["blend"];
    const SUMMARY: &'static str = "mixes two meshes, each position as far from one to the other as is painted there";
    const INPUTS: &'static [Port] = MorphSettings::INPUTS;
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the blend")];
    const REQUIRED: &'static [&'static str] = &["paint"];
    type Input = (Posed, Posed);
    type Output = (Posed,);

    fn reads(&self) -> Vec<&str> {
        std::iter::once(&self.paint).chain(&self.landmarks).map(String::as_str).collect()
    }

    fn writes(&self) -> Vec<String> {
        self.report.iter().cloned().collect()
    }

    fn run(&self, (first, second): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let pair = Pair::new(context, [first, second], self.landmarks.as_ref(), CorrespondenceMethod::default(), None)?;
        // Painted times, extended to all vertices.
        let in_paint = of_file(&self.paint);
        let paint = Paint::read(&to_path(&self.paint)).map_err(&in_paint)?;
        let painted = paint.of_mesh(pair.model.mesh()).map_err(&in_paint)?;
        let times = time_field(&pair.first, &pair.gathered(&painted), paint.elsewhere(), &context.job.run())?;
        // Shapes at fractions of these times.
        let options = TrajectoryOptions { iterations: self.iterations as usize, full_rotations: 0 };
        let mut trajectory = Trajectory::new(&pair.first, &pair.second, &options, &context.job.run())?;
        let mut shapes = Shapes::new(&pair, self.report.is_some());
        for k in 1..=self.frames {
            context.job.check_cancel()?;
            // Several shapes start at the first mesh.
            let fraction = if self.frames == 1 { 1.0 } else { f64::from(k - 1) / f64::from(self.frames - 1) };
            let now: Vec<f64> = times.iter().map(|t| t * fraction).collect();
            let straight = pair.first.positions().iter().zip(pair.second.positions()).zip(&now);
            let linear: Vec<Point3<f64>> = straight.map(|((a, b), t)| a + (b - a) * *t).collect();
            let x = trajectory.blend(&now, &context.job.run())?;
            shapes.add((fraction == 0.0).then_some(0.0), fraction, &x, &linear, &context.job.run())?;
        }
        // The summary and the report.
        let (low, high) = times.iter().fold((f64::MAX, f64::MIN), |(l, h), t| (l.min(*t), h.max(*t)));
        report_line(context, format!("times from {low:.2} to {high:.2}{}", shapes.intersections()));
        let report = json!({
            "version": 1,
            "paint": self.paint,
            "landmarks": self.landmarks,
            "correspondence": pair.quality.as_ref().map(quality_json),
            "shapes": shapes.report,
        });
        let poses = shapes.poses;
        write_report(context, self.report.as_ref(), &report)?;
        Ok((pair.posed(poses),))
    }
}
