//! `mesh.morph`: the shapes between two meshes.

use serde_json::json;

use super::morphing::pair::{Pair, quality_json};
use super::morphing::shapes::Shapes;
use super::morphing::{report_line, write_report};
use super::prelude::*;
use super::values::Posed;
use plumbline_shape::morph::correspondence::CorrespondenceMethod;
use plumbline_shape::morph::{Trajectory, TrajectoryOptions};

/// Settings of `mesh.morph`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MorphSettings {
    /// Corresponding points of both meshes, for meshes that are not two poses of one (`plumbline schema landmarks`, .cons
    /// or .yml)
    #[schemars(extend("format" = "path"))]
    pub landmarks: Option<String>,
    /// Shapes, both meshes among them
    #[schemars(range(min = 2, max = 9999))]
    pub frames: u32,
    /// How shapes lie between the meshes.
    #[serde(flatten)]
    pub options: TrajectoryOptions,
    /// Maximum number of iterations that push a shape out of itself where it passes through itself
    #[schemars(range(min = 0, max = 1000))]
    pub untangle: u32,
    /// How the first mesh is laid over the second
    pub over: CorrespondenceMethod,
    /// Add vertices until no feature of the second mesh is missed by more than this fraction of its size; none if left out
    #[schemars(range(min = 0.0001, max = 1.0))]
    pub refine: Option<f64>,
    /// Also write a report, with the self-intersections of every shape: NAME.html or NAME.json
    #[schemars(extend("format" = "path", "report" = true))]
    pub report: Option<String>,
}

impl Default for MorphSettings {
    fn default() -> Self {
        Self {
            landmarks: None,
            frames: 9,
            options: TrajectoryOptions::default(),
            untangle: 8,
            over: CorrespondenceMethod::default(),
            refine: None,
            report: None,
        }
    }
}

impl Stage for MorphSettings {
    const KIND: &'static str = "mesh.morph";
    const ALIASES: &'static [&'static str] = &["morph"];
    const SUMMARY: &'static str = "finds the shapes between two meshes, as rigid towards both as can be";
    const INPUTS: &'static [Port] = &[
        Port::one("mesh", PortType::Mesh, "the mesh at time 0, whose faces all shapes have"),
        Port::one("other", PortType::Mesh, "the mesh at time 1"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the shapes")];
    type Input = (Posed, Posed);
    type Output = (Posed,);

    fn conflicts(&self) -> Vec<Conflict> {
        let by_landmarks = [("over", self.over != CorrespondenceMethod::default()), ("refine", self.refine.is_some())];
        let asked = by_landmarks.into_iter().filter(|(_, is_given)| *is_given && self.landmarks.is_none());
        let message =
            "without landmarks the meshes are two poses of one, and neither is laid over the other".to_owned();
        asked
            .map(|(key, _)| Conflict { key, message: message.clone(), help: "give `landmarks`, or leave it out" })
            .collect()
    }

    fn reads(&self) -> Vec<&str> {
        self.landmarks.iter().map(String::as_str).collect()
    }

    fn writes(&self) -> Vec<String> {
        self.report.iter().cloned().collect()
    }

    fn run(&self, (first, second): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let pair = Pair::new(context, [first, second], self.landmarks.as_ref(), self.over, self.refine)?;
        // The trajectory, from one factorization, sampled at even times.
        let mut trajectory = Trajectory::new(&pair.first, &pair.second, &self.options, &context.job.run())?;
        let mut shapes = Shapes::new(&pair, self.report.is_some());
        for k in 0..self.frames {
            context.job.check_cancel()?;
            let time = f64::from(k) / f64::from((self.frames - 1).max(1));
            let x = match self.untangle {
                0 => trajectory.at(time, &context.job.run())?,
                iterations => {
                    let untangled = trajectory.untangled(time, iterations as usize, &context.job.run())?;
                    shapes.untested |= untangled.intersections.is_none();
                    untangled.positions
                }
            };
            trajectory.check_extent(time, &x)?;
            let linear = trajectory.linear(time);
            shapes.add(Some(time), time, &x, &linear, &context.job.run())?;
        }
        // What the user should know, and the report.
        if let Some(fault) = shapes.fault() {
            context.warn(fault);
        }
        let angle = trajectory.global_rotation().norm().to_degrees();
        report_line(
            context,
            format!("{} shapes, rotated by {angle:.1}° as a whole{}", self.frames, shapes.intersections()),
        );
        let report = json!({
            "version": 1,
            "landmarks": self.landmarks,
            "turn_deg": angle,
            "correspondence": pair.quality.as_ref().map(quality_json),
            "shapes": shapes.report,
        });
        let poses = shapes.poses;
        write_report(context, self.report.as_ref(), &report)?;
        Ok((pair.posed(poses),))
    }
}
