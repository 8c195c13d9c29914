//! Shapes between two meshes, as they are written and reported.

use nalgebra::Point3;
use serde_json::{Value as Json, json};

use super::pair::Pair;
use crate::pipeline::run_error::RunError;
use crate::stages::values::not_finite;
use plumbline_num::run::Run;
use plumbline_shape::morph::intersections::self_intersections;

/// Shapes as they are written, and the report on them.
pub(crate) struct Shapes<'p> {
    pair: &'p Pair,
    pub(crate) poses: Vec<Vec<Point3<f64>>>,
    pub(crate) report: Vec<Json>,
    /// Most intersections of a shape, and of one on straight paths.
    most: [usize; 2],
    /// Shapes that pass through themselves more often than those on straight paths.
    worse: usize,
    /// Intersections are counted, which takes as long as a shape.
    count: bool,
}

impl<'p> Shapes<'p> {
    pub(crate) fn new(pair: &'p Pair, count: bool) -> Self {
        Self { pair, poses: Vec::new(), report: Vec::new(), most: [0, 0], worse: 0, count }
    }

    pub(crate) fn add(
        &mut self,
        end: Option<f64>,
        time: f64,
        x: &[Point3<f64>],
        linear: &[Point3<f64>],
        run: &Run,
    ) -> Result<(), RunError> {
        if self.count {
            let count = |x: &[Point3<f64>]| {
                let mesh = self.pair.first.with_positions(x.to_vec()).map_err(|e| not_finite(&e))?;
                Ok::<_, RunError>(self_intersections(&mesh, run)?.len())
            };
            let counts = [count(x)?, count(linear)?];
            self.most = [self.most[0].max(counts[0]), self.most[1].max(counts[1])];
            self.worse += usize::from(counts[0] > counts[1]);
            self.report.push(json!({"time": time, "self_intersections": counts[0], "of_linear_blending": counts[1]}));
        }
        self.poses.push(self.pair.written(end, x));
        Ok(())
    }

    pub(crate) fn worse_than_linear(&self) -> Option<String> {
        let more = "shapes pass through themselves at more positions than on straight paths; more iterations of `untangle` may help";
        (self.worse > 0).then(|| format!("{} of {} {more}", self.worse, self.poses.len()))
    }

    pub(crate) fn intersections(&self) -> String {
        let [ours, linear] = self.most;
        let line = format!(", at most {ours} pairs of faces intersect ({linear} on straight paths)");
        if self.count { line } else { String::new() }
    }
}
