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
    /// A shape that would take too many tests ends the count.
    pub(crate) untested: bool,
}

impl<'p> Shapes<'p> {
    pub(crate) fn new(pair: &'p Pair, count: bool) -> Self {
        Self { pair, poses: Vec::new(), report: Vec::new(), most: [0, 0], worse: 0, count, untested: false }
    }

    pub(crate) fn add(
        &mut self,
        end: Option<f64>,
        time: f64,
        x: &[Point3<f64>],
        linear: &[Point3<f64>],
        run: &Run,
    ) -> Result<(), RunError> {
        if self.count && !self.untested {
            let count = |x: &[Point3<f64>]| {
                let mesh = self.pair.first.with_positions(x.to_vec()).map_err(|e| not_finite(&e))?;
                Ok::<_, RunError>(self_intersections(&mesh, run)?.map(|pairs| pairs.len()))
            };
            let counts = [count(x)?, count(linear)?];
            self.report.push(json!({"time": time, "self_intersections": counts[0], "of_linear_blending": counts[1]}));
            match counts {
                [Some(ours), Some(linear)] => {
                    self.most = [self.most[0].max(ours), self.most[1].max(linear)];
                    self.worse += usize::from(ours > linear);
                }
                _ => self.untested = true,
            }
        }
        self.poses.push(self.pair.written(end, x));
        Ok(())
    }

    /// What the user should know of the shapes.
    pub(crate) fn fault(&self) -> Option<String> {
        if self.untested {
            let reason = "triangles lie so close to one another that it would take too many tests";
            return Some(format!("self-intersections of the shapes are neither counted nor removed: {reason}"));
        }
        let more = "shapes pass through themselves at more positions than on straight paths; more iterations of `untangle` may help";
        (self.worse > 0).then(|| format!("{} of {} {more}", self.worse, self.poses.len()))
    }

    pub(crate) fn intersections(&self) -> String {
        let [ours, linear] = self.most;
        let line = format!(", at most {ours} pairs of faces intersect ({linear} on straight paths)");
        if self.count && !self.untested { line } else { String::new() }
    }
}
