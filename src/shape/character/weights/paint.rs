//! Painted weights: a brush raises, lowers, evens or sets the weight of one joint.
//!
//! ```text
//! w_j ← w_j + f (ŵ_j − w_j)          f = strength · (1 − d² / r²)²,  d the distance from the center of the brush
//! w_k ← w_k (1 − w_j') / (1 − w_j)    for all other joints k: their ratios stay, the sum is 1
//! ```
//!
//! `ŵ` is 1 (add), 0 (subtract), the mean of the neighbors (smooth) or a given value (replace). A vertex that follows the painted joint
//! alone has no other joint to give weight to: it stays until its neighbors bring one in (smooth).

use nalgebra::Point3;

use super::super::{CharacterError, SkinWeights};
use crate::mesh::TriMesh;
use plumbline_num::options::OptionError;

/// What a brush does to the weight of its joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Brush {
    /// Raises it toward 1.
    Add,
    /// Lowers it toward 0.
    Subtract,
    /// Draws all weights toward the mean of the neighbors.
    Smooth,
    /// Draws it toward a value in 0 ..= 1.
    Replace(f64),
}

/// One touch of a brush.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrushStroke {
    /// The joint whose weight is painted.
    pub joint: u32,
    /// What happens to it.
    pub brush: Brush,
    /// Center of the brush at rest.
    pub center: Point3<f64>,
    /// Its radius, units of the model, above 0.
    pub radius: f64,
    /// Effect in the center, in 0 ..= 1.
    pub strength: f64,
    /// Largest number of joints per vertex, 1 or more.
    pub influences: usize,
}

impl BrushStroke {
    fn check(&self, joints: usize) -> Result<(), CharacterError> {
        if self.joint as usize >= joints {
            return Err(CharacterError::Input(format!("there is no joint {} (of {joints})", self.joint)));
        }
        OptionError::check(self.radius > 0.0 && self.radius.is_finite(), "radius", self.radius, "above 0")?;
        OptionError::check((0.0..=1.0).contains(&self.strength), "strength", self.strength, "0 to 1")?;
        OptionError::check(self.influences > 0, "influences", 0.0, "1 or more")?;
        if let Brush::Replace(value) = self.brush {
            OptionError::check((0.0..=1.0).contains(&value), "value", value, "0 to 1")?;
        }
        if self.center.coords.iter().all(|c| c.is_finite()) {
            return Ok(());
        }
        Err(CharacterError::Input(format!("the center {} of the brush is not finite", self.center)))
    }

    /// Effect at a position, in 0 ..= strength.
    fn effect(&self, p: &Point3<f64>) -> f64 {
        let inside = 1.0 - (p - self.center).norm_squared() / (self.radius * self.radius);
        if inside > 0.0 { self.strength * inside * inside } else { 0.0 }
    }
}

impl SkinWeights {
    /// The weights after one touch of a brush. `neighbors`: of each vertex ([`crate::mesh::neighbors_of_vertices`]), for
    /// [`Brush::Smooth`]. Rows outside the brush stay as they are; the others sum to 1 and have at most `influences` joints.
    ///
    /// ```
    /// use plumbline_shape::character::SkinWeights;
    /// use plumbline_shape::character::weights::{Brush, BrushStroke};
    /// use plumbline_shape::mesh::{neighbors_of_vertices, shapes};
    ///
    /// let ball = shapes::icosphere(2);
    /// let neighbors = neighbors_of_vertices(ball.vertex_count(), ball.triangles());
    /// let weights = SkinWeights::rigid(2, &vec![0; ball.vertex_count()])?;
    /// let center = ball.positions()[0];
    /// let stroke = BrushStroke { joint: 1, brush: Brush::Add, center, radius: 0.5, strength: 0.25, influences: 4 };
    /// let painted = weights.painted(&ball, &neighbors, &stroke)?;
    /// assert_eq!(painted.weight(0, 1), 0.25);
    /// # Ok::<(), plumbline_shape::character::CharacterError>(())
    /// ```
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for another mesh; [`CharacterError::Input`] and [`CharacterError::Option`] for a stroke out of range.
    pub fn painted(
        &self,
        mesh: &TriMesh,
        neighbors: &[Vec<u32>],
        stroke: &BrushStroke,
    ) -> Result<Self, CharacterError> {
        stroke.check(self.joint_count())?;
        let vertices = mesh.vertex_count();
        CharacterError::check_per_vertex("rows of weights", self.vertex_count(), vertices)?;
        CharacterError::check_per_vertex("lists of neighbors", neighbors.len(), vertices)?;
        let mut dense = vec![0.0; self.joint_count()];
        let row = |(v, p): (usize, &Point3<f64>)| -> Vec<(u32, f64)> {
            let effect = stroke.effect(p);
            let own = self.row(v).iter().map(|i| (i.joint, i.weight));
            match (effect > 0.0, stroke.brush) {
                (false, _) => own.collect(),
                (true, Brush::Smooth) => limited(self.evened(v, &neighbors[v], effect, &mut dense), stroke.influences),
                (true, _) => limited(drawn(own.collect(), stroke, effect), stroke.influences),
            }
        };
        Self::new(self.joint_count(), mesh.positions().iter().enumerate().map(row).collect::<Vec<_>>())
    }

    /// Weights drawn toward the mean of the neighbors. `dense` is zero before and after.
    fn evened(&self, v: usize, neighbors: &[u32], effect: f64, dense: &mut [f64]) -> Vec<(u32, f64)> {
        let mut joints: Vec<u32> = Vec::new();
        let mut add = |row: &[super::super::Influence], factor: f64| {
            for i in row {
                joints.push(i.joint);
                dense[i.joint as usize] += factor * i.weight;
            }
        };
        let effect = if neighbors.is_empty() { 0.0 } else { effect };
        add(self.row(v), 1.0 - effect);
        for &n in neighbors {
            add(self.row(n as usize), effect / neighbors.len() as f64);
        }
        joints.sort_unstable();
        joints.dedup();
        joints.into_iter().map(|j| (j, std::mem::take(&mut dense[j as usize]))).collect()
    }
}

/// The row with the weight of the joint drawn toward the brush's.
fn drawn(mut row: Vec<(u32, f64)>, stroke: &BrushStroke, effect: f64) -> Vec<(u32, f64)> {
    let target = match stroke.brush {
        Brush::Add => 1.0,
        Brush::Replace(value) => value,
        Brush::Subtract | Brush::Smooth => 0.0,
    };
    let old = row.iter().find(|i| i.0 == stroke.joint).map_or(0.0, |i| i.1);
    let rest: f64 = row.iter().filter(|i| i.0 != stroke.joint).map(|i| i.1).sum();
    // Nobody else to take it.
    let new = if rest > 0.0 { old + effect * (target - old) } else { 1.0 };
    row.retain(|i| i.0 != stroke.joint);
    for i in &mut row {
        i.1 *= (1.0 - new) / rest;
    }
    row.push((stroke.joint, new));
    row
}

/// The row with its largest weights only, which sum to 1, in order of the joints.
fn limited(mut row: Vec<(u32, f64)>, most: usize) -> Vec<(u32, f64)> {
    row.retain(|i| i.1 > 0.0);
    row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    row.truncate(most);
    let sum: f64 = row.iter().map(|i| i.1).sum();
    for i in &mut row {
        i.1 /= sum;
    }
    row.sort_unstable_by_key(|i| i.0);
    row
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{neighbors_of_vertices, shapes};

    /// A bar whose ends follow two joints, a third one nowhere.
    fn bar() -> (TriMesh, Vec<Vec<u32>>, SkinWeights) {
        let bar = shapes::bar([2, 2, 10], [1.0, 1.0, 5.0]);
        let neighbors = neighbors_of_vertices(bar.vertex_count(), bar.triangles());
        let row = |p: &Point3<f64>| if p.z < 2.5 { vec![(0, 0.75), (1, 0.25)] } else { vec![(1, 1.0)] };
        let weights = SkinWeights::new(3, bar.positions().iter().map(row).collect::<Vec<_>>()).unwrap();
        (bar, neighbors, weights)
    }

    fn stroke(brush: Brush) -> BrushStroke {
        BrushStroke { joint: 0, brush, center: Point3::new(0.5, 0.5, 2.5), radius: 1.5, strength: 0.5, influences: 4 }
    }

    #[test]
    fn rows_sum_to_one_and_those_outside_the_brush_stay() {
        let (mesh, neighbors, weights) = bar();
        for brush in [Brush::Add, Brush::Subtract, Brush::Smooth, Brush::Replace(0.3)] {
            let painted = weights.painted(&mesh, &neighbors, &stroke(brush)).unwrap();
            assert!(painted.sums().all(|s| (s - 1.0).abs() < 1e-12), "{brush:?}");
            let far = |v: &usize| (mesh.positions()[*v] - stroke(brush).center).norm() >= 1.5;
            assert!((0..mesh.vertex_count()).filter(far).all(|v| painted.row(v) == weights.row(v)), "{brush:?}");
            assert!((0..mesh.vertex_count()).any(|v| painted.row(v) != weights.row(v)), "{brush:?}");
        }
    }

    #[test]
    fn the_brush_moves_the_weight_by_its_effect_and_keeps_the_ratios_of_the_others() {
        let (mesh, neighbors, _) = bar();
        let even = SkinWeights::new(3, vec![vec![(0, 0.2), (1, 0.6), (2, 0.2)]; mesh.vertex_count()]).unwrap();
        let painted = even.painted(&mesh, &neighbors, &stroke(Brush::Replace(0.9))).unwrap();
        for (v, p) in mesh.positions().iter().enumerate() {
            let effect = stroke(Brush::Add).effect(p);
            assert!((painted.weight(v, 0) - (0.2 + effect * 0.7)).abs() < 1e-12);
            assert!((painted.weight(v, 1) - 3.0 * painted.weight(v, 2)).abs() < 1e-12, "three to one, as before");
        }
    }

    #[test]
    fn no_row_gets_more_joints_than_allowed_or_loses_its_last() {
        let (mesh, neighbors, weights) = bar();
        let third = BrushStroke { joint: 2, influences: 2, strength: 1.0, ..stroke(Brush::Add) };
        let painted = weights.painted(&mesh, &neighbors, &third).unwrap();
        assert!(painted.most_influences() <= 2 && painted.rows().all(|row| !row.is_empty()));
        let all = SkinWeights::rigid(3, &vec![0; mesh.vertex_count()]).unwrap();
        assert_eq!(all.painted(&mesh, &neighbors, &stroke(Brush::Subtract)).unwrap(), all, "nobody takes the weight");
    }

    #[test]
    fn strokes_out_of_range_are_refused() {
        let (mesh, neighbors, weights) = bar();
        let good = stroke(Brush::Add);
        let bad = [
            BrushStroke { joint: 3, ..good },
            BrushStroke { radius: 0.0, ..good },
            BrushStroke { radius: f64::NAN, ..good },
            BrushStroke { strength: 1.5, ..good },
            BrushStroke { influences: 0, ..good },
            BrushStroke { center: Point3::new(f64::NAN, 0.0, 0.0), ..good },
            BrushStroke { brush: Brush::Replace(-0.1), ..good },
        ];
        for stroke in bad {
            assert!(weights.painted(&mesh, &neighbors, &stroke).is_err(), "{stroke:?}");
        }
    }
}
