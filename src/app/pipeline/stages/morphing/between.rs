//! `morph` and `blend`: shapes between two meshes.

use std::sync::Arc;

use nalgebra::Point3;
use serde_json::{Value as Json, json};

use super::pair::{Pair, quality_json};
use super::{morph_error, of_file, tell, write_report};
use crate::pipeline::kinds::{BlendSettings, MorphSettings, OverWish};
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use crate::pipeline::stages::mesh::Posed;
use plumbline_num::run::Run;
use plumbline_shape::morph::intersections::self_intersections;
use plumbline_shape::morph::paint::Paint;
use plumbline_shape::morph::{Trajectory, TrajectoryOptions, time_field};

/// Shapes, evenly from one mesh to the other.
pub(super) fn morph(context: &mut Context<'_, '_>, stage: usize, settings: &MorphSettings) -> Result<(), RunError> {
    let pair = Pair::new(context, stage, settings.landmarks.as_ref(), settings.over, settings.refine)?;
    let options = TrajectoryOptions { rounds: settings.rounds as usize, whole_turns: settings.whole_turns };
    let mut trajectory =
        Trajectory::new(&pair.first, &pair.second, &options, &context.job.run()).map_err(morph_error)?;
    let mut shapes = Shapes::new(&pair, settings.report.is_some());
    for k in 0..settings.frames {
        context.job.check_cancel()?;
        let time = f64::from(k) / f64::from((settings.frames - 1).max(1));
        let x = match settings.untangle {
            0 => trajectory.at(time, &context.job.run())?,
            rounds => trajectory.untangled(time, rounds as usize, &context.job.run())?.0,
        };
        let linear = trajectory.linear(time);
        shapes.add(Some(time), time, &x, &linear, &context.job.run())?;
    }
    if let Some(worse) = shapes.worse_than_linear() {
        context.warn(worse);
    }
    let turn = trajectory.turn_of_whole().norm().to_degrees();
    tell(context, format!("{} shapes, turning by {turn:.1}° as a whole{}", settings.frames, shapes.intersections()));
    let report = json!({
        "version": 1,
        "landmarks": settings.landmarks,
        "turn_deg": turn,
        "correspondence": pair.quality.as_ref().map(quality_json),
        "shapes": shapes.told,
    });
    let poses = shapes.poses;
    finish(context, stage, &pair, poses, settings.report.as_ref(), &report)
}

/// A shape in which every place has the time that is painted there.
pub(super) fn blend(context: &mut Context<'_, '_>, stage: usize, settings: &BlendSettings) -> Result<(), RunError> {
    let pair = Pair::new(context, stage, settings.landmarks.as_ref(), OverWish::default(), None)?;
    let in_paint = of_file(&settings.paint);
    let paint = Paint::read(settings.paint.as_ref()).map_err(&in_paint)?;
    let painted = paint.of_mesh(pair.model.mesh()).map_err(&in_paint)?;
    let times = time_field(&pair.first, &pair.gathered(&painted), paint.elsewhere(), &context.job.run())
        .map_err(morph_error)?;
    let options = TrajectoryOptions { rounds: settings.rounds as usize, whole_turns: 0 };
    let mut trajectory =
        Trajectory::new(&pair.first, &pair.second, &options, &context.job.run()).map_err(morph_error)?;
    let mut shapes = Shapes::new(&pair, settings.report.is_some());
    for k in 1..=settings.frames {
        context.job.check_cancel()?;
        // Several shapes start at the first mesh.
        let share = if settings.frames == 1 { 1.0 } else { f64::from(k - 1) / f64::from(settings.frames - 1) };
        let now: Vec<f64> = times.iter().map(|t| t * share).collect();
        let straight = pair.first.positions().iter().zip(pair.second.positions()).zip(&now);
        let linear: Vec<Point3<f64>> = straight.map(|((a, b), t)| a + (b - a) * *t).collect();
        let x = trajectory.blend(&now, &context.job.run())?;
        shapes.add((share == 0.0).then_some(0.0), share, &x, &linear, &context.job.run())?;
    }
    let (low, high) = times.iter().fold((f64::MAX, f64::MIN), |(l, h), t| (l.min(*t), h.max(*t)));
    tell(context, format!("times from {low:.2} to {high:.2}{}", shapes.intersections()));
    let report = json!({
        "version": 1,
        "paint": settings.paint,
        "landmarks": settings.landmarks,
        "correspondence": pair.quality.as_ref().map(quality_json),
        "shapes": shapes.told,
    });
    let poses = shapes.poses;
    finish(context, stage, &pair, poses, settings.report.as_ref(), &report)
}

/// Shapes as they are written, and what is told of them.
struct Shapes<'p> {
    pair: &'p Pair,
    poses: Vec<Vec<Point3<f64>>>,
    told: Vec<Json>,
    /// Most intersections of a shape, and of one on straight ways.
    most: [usize; 2],
    /// Shapes that pass through themselves more often than those on straight ways.
    worse: usize,
    /// Intersections are counted, which takes as long as a shape.
    count: bool,
}

impl<'p> Shapes<'p> {
    fn new(pair: &'p Pair, count: bool) -> Self {
        Self { pair, poses: Vec::new(), told: Vec::new(), most: [0, 0], worse: 0, count }
    }

    fn add(
        &mut self,
        end: Option<f64>,
        time: f64,
        x: &[Point3<f64>],
        linear: &[Point3<f64>],
        run: &Run,
    ) -> Result<(), RunError> {
        if self.count {
            let count = |x: &[Point3<f64>]| {
                let mesh = self.pair.first.with_positions(x.to_vec()).map_err(|e| RunError::Internal(e.to_string()))?;
                Ok::<_, RunError>(self_intersections(&mesh, run)?.len())
            };
            let counts = [count(x)?, count(linear)?];
            self.most = [self.most[0].max(counts[0]), self.most[1].max(counts[1])];
            self.worse += usize::from(counts[0] > counts[1]);
            self.told.push(json!({"time": time, "self_intersections": counts[0], "of_linear_blending": counts[1]}));
        }
        self.poses.push(self.pair.written(end, x));
        Ok(())
    }

    fn worse_than_linear(&self) -> Option<String> {
        let more =
            "shapes pass through themselves in more places than on straight ways; more rounds of `untangle` may help";
        (self.worse > 0).then(|| format!("{} of {} {more}", self.worse, self.poses.len()))
    }

    fn intersections(&self) -> String {
        let [ours, linear] = self.most;
        let told = format!(", at most {ours} pairs of faces intersect ({linear} on straight ways)");
        if self.count { told } else { String::new() }
    }
}

fn finish(
    context: &mut Context<'_, '_>,
    stage: usize,
    pair: &Pair,
    poses: Vec<Vec<Point3<f64>>>,
    path: Option<&String>,
    report: &Json,
) -> Result<(), RunError> {
    write_report(context, path, report)?;
    let posed = Posed { model: Arc::clone(&pair.model), poses: Arc::new(poses), handles: Arc::default() };
    context.values.put(stage, "mesh", posed);
    Ok(())
}
