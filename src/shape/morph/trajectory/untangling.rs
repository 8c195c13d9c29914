//! Removal of self-intersections and folds by contact forces.
//!
//! Where an edge crosses a triangle, its end of less depth is moved back to the triangle's plane and the triangle in the opposite
//! direction. Where a triangle opposes those around it and rotations are not unique, the corner opposite its longest edge is moved back
//! across that edge, and the edge in the opposite direction. Displacements accumulate to forces `f` over the iterations (Uzawa's method), and the surface deforms elastically
//! towards both ends of the trajectory:
//!
//! ```text
//! f ← f + α W d,        L x = Σ ± h ((1 − τ) Pₜ a + τ Qₜ b) + f,        α = min(1, dᵀW d / dᵀW L⁻¹W d)
//! ```
//!
//! with the displacements `d` and the sums `W` of the edge weights at each vertex. `W⁻¹` is the compliance of a vertex among vertices that
//! stay; many that are pushed together yield far more, and `α` is the length at which the surface moves by what the contacts ask. With
//! `α` = 1 the forces grow without end there: at a quarter of the way from Homer to a cheburashka an arm became a wing, of fewer
//! intersections. The faults of a shape are its pairs of triangles that intersect and its triangles that fold; those of both poses are
//! neither changed nor counted. The iterate of fewest faults is kept, so that their number never increases.
//!
//! Where linear interpolation has fewer faults, patches around the intersections follow it: their edges become those of linear
//! interpolation, with or without the global motion, and their boundary stays. The patches grow until there are no more faults than in
//! linear interpolation, or they cover most of the surface.

use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};

use super::super::MorphError;
use super::super::elastic_solve::ElasticSolve;
use super::super::folds::{folds, normals_around};
use super::super::intersections::{crossings, self_intersections};
use super::{Trajectory, opposite_edges};
use crate::mesh::{TriMesh, neighbors_of_vertices};
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::numbered_components;

/// Overshoot of a displacement past the plane as a fraction of the depth: without it contacts converge to the plane from inside.
const OVERSHOOT: f64 = 0.1;

/// Widths of the patches around intersections, in rings, doubled for each trial.
const RINGS: [usize; 5] = [2, 4, 8, 16, 32];

/// A shape from which self-intersections were removed.
#[derive(Clone, Debug, PartialEq)]
pub struct Untangled {
    /// The vertices.
    pub positions: Vec<Point3<f64>>,
    /// Numbers of intersecting pairs of triangles before and after, without those of both poses; `None` where they were not tested.
    pub intersections: Option<[usize; 2]>,
}

/// Pairs of triangles of a shape that intersect, and triangles that fold.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Faults {
    pairs: BTreeSet<[u32; 2]>,
    folds: BTreeSet<u32>,
}

impl Faults {
    fn count(&self) -> usize {
        self.pairs.len() + self.folds.len()
    }

    fn common(&self, other: &Self) -> Self {
        Self { pairs: &self.pairs & &other.pairs, folds: &self.folds & &other.folds }
    }

    fn without(&self, other: &Self) -> Self {
        Self { pairs: &self.pairs - &other.pairs, folds: &self.folds - &other.folds }
    }
}

/// A shape and its faults.
type Faulty = (Vec<Point3<f64>>, Faults);

impl Trajectory {
    /// The shape at a time with self-intersections and folds removed in at most `iterations`; as it is where [`self_intersections`] of it
    /// or of a pose would take too many tests.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn untangled(&mut self, time: f64, iterations: usize, run: &Run) -> Result<Untangled, Stopped> {
        let start = self.at(time, run)?;
        let Some(faults) = self.faults(&start, run)? else {
            return Ok(Untangled { positions: start, intersections: None });
        };
        let before = faults.pairs.len();
        if faults.count() == 0 || iterations == 0 || time == 0.0 || time == 1.0 {
            return Ok(Untangled { positions: start, intersections: Some([before; 2]) });
        }
        let (x, faults) = self.pushed(time, iterations, &start, faults, run)?;
        // Linear interpolation that cannot be tested is not taken.
        let straight = match faults.pairs.len() {
            0 => None,
            _ => self.faults(&self.linear(time), run)?.map(|faults| faults.count()),
        };
        let (positions, faults) = self.linearized(time, straight.unwrap_or(usize::MAX), x, faults, run)?;
        Ok(Untangled { positions, intersections: Some([before, faults.pairs.len()]) })
    }

    /// Faults of a shape, without those of both poses; `None` where they, or those of a pose, would take too many tests.
    fn faults(&self, x: &[Point3<f64>], run: &Run) -> Result<Option<Faults>, Stopped> {
        let own = if let Some(own) = self.own_faults.get() {
            own
        } else {
            let own = match (self.faults_of(&self.first, run)?, self.faults_of(&self.second, run)?) {
                (Some(first), Some(second)) => Some(first.common(&second)),
                _ => None,
            };
            self.own_faults.get_or_init(|| own)
        };
        let Some(own) = own else { return Ok(None) };
        Ok(self.faults_of(x, run)?.map(|faults| faults.without(own)))
    }

    /// Faults of a shape; `None` where that would take too many tests.
    fn faults_of(&self, x: &[Point3<f64>], run: &Run) -> Result<Option<Faults>, Stopped> {
        let Ok(mesh) = TriMesh::new(x.to_vec(), self.triangles.clone()) else { return Ok(None) };
        let Some(pairs) = self_intersections(&mesh, run)? else { return Ok(None) };
        // Beside a sharp edge triangles may oppose those around them in a sound shape. Shapes between poses with unique rotations are sound.
        let folds = if self.rotations.is_unique() { BTreeSet::new() } else { folds(&self.triangles, x) };
        Ok(Some(Faults { pairs: pairs.into_iter().collect(), folds }))
    }

    /// The best iterate of contact forces.
    fn pushed(
        &mut self,
        time: f64,
        iterations: usize,
        start: &[Point3<f64>],
        faults: Faults,
        run: &Run,
    ) -> Result<Faulty, Stopped> {
        let times = vec![time; self.triangles.len()];
        let mut forces = vec![Vector3::zeros(); start.len()];
        let weights = self.solve.diagonal();
        let (mut x, mut now) = (start.to_vec(), faults.clone());
        let mut best = (start.to_vec(), faults);
        for _ in 0..iterations {
            let Ok(mesh) = TriMesh::new(x.clone(), self.triangles.clone()) else { break };
            let wanted = pushes(&mesh, &now);
            let step: Vec<Vector3<f64>> = wanted.iter().zip(&weights).map(|(d, w)| d * *w).collect();
            let length = self.step_length(&step, &wanted);
            forces.iter_mut().zip(step).for_each(|(force, step)| *force += step * length);
            let edges = self.rigid_edges(&times, &x);
            self.solve.follow_pushed(|t| edges[t], &forces, &mut x);
            self.align_components(&mut x, start);
            let Some(found) = self.faults(&x, run)? else { break };
            now = found;
            if now.count() < best.1.count() {
                best = (x.clone(), now.clone());
            }
            if now.count() == 0 {
                break;
            }
        }
        Ok(best)
    }

    /// The fraction of a step of forces that moves the surface as far as `wanted`, in the mean over the forces; at most 1.
    fn step_length(&mut self, step: &[Vector3<f64>], wanted: &[Vector3<f64>]) -> f64 {
        let origin = vec![Point3::origin(); step.len()];
        let mut moved = origin.clone();
        self.solve.follow_pushed(|_| [Vector3::zeros(); 3], step, &mut moved);
        self.solve.center(&mut moved, &origin, &self.weights);
        let asked: f64 = step.iter().zip(wanted).map(|(f, d)| f.dot(d)).sum();
        let done: f64 = step.iter().zip(&moved).map(|(f, u)| f.dot(&u.coords)).sum();
        if done > asked { asked / done } else { 1.0 }
    }

    /// Linear interpolation in patches around intersections, until there are no more faults than `enough`.
    fn linearized(
        &self,
        time: f64,
        enough: usize,
        x: Vec<Point3<f64>>,
        faults: Faults,
        run: &Run,
    ) -> Result<Faulty, Stopped> {
        if faults.count() <= enough {
            return Ok((x, faults));
        }
        let straight = [self.guess(&vec![time; x.len()]), self.linear(time)];
        let around = neighbors_of_vertices(x.len(), &self.triangles);
        let (mut best, mut patch) = ((x.clone(), faults.clone()), vec![false; x.len()]);
        let mut now = faults;
        for (straight, rings) in straight.iter().flat_map(|s| RINGS.map(|rings| (s, rings))) {
            for v in now.pairs.iter().flatten().flat_map(|t| self.triangles[*t as usize]) {
                patch[v as usize] = true;
            }
            let wide = grown(&patch, &around, rings);
            if 2 * wide.iter().filter(|inside| **inside).count() > wide.len() {
                continue;
            }
            let Some(moved) = self.with_linear_patch(&wide, straight, &x, run)? else { break };
            let Some(found) = self.faults(&moved, run)? else { break };
            now = found;
            if now.count() < best.1.count() {
                best = (moved, now.clone());
            }
            if best.1.count() <= enough {
                break;
            }
        }
        Ok(best)
    }

    /// `x` with the edges of `guess` in a patch; the other vertices stay.
    fn with_linear_patch(
        &self,
        patch: &[bool],
        guess: &[Point3<f64>],
        x: &[Point3<f64>],
        run: &Run,
    ) -> Result<Option<Vec<Point3<f64>>>, Stopped> {
        let (component, count) = numbered_components(x.len(), &self.triangles);
        let mut fixed: Vec<bool> = patch.iter().map(|inside| !inside).collect();
        // A component inside the patch is fixed at one vertex.
        let mut constrained = vec![false; count];
        (0..x.len()).filter(|&v| fixed[v]).for_each(|v| constrained[component[v] as usize] = true);
        for v in 0..x.len() {
            fixed[v] |= !std::mem::replace(&mut constrained[component[v] as usize], true);
        }
        let half = self.solve.half().to_vec();
        let mut solve = match ElasticSolve::new(&self.triangles, half, x, Some(&fixed), run) {
            Ok(solve) => solve,
            Err(MorphError::Interrupted(stopped)) => return Err(stopped),
            Err(_) => return Ok(None),
        };
        let mut moved = x.to_vec();
        solve.follow(|t| self.edges(guess, t), &mut moved);
        Ok(Some(moved))
    }
}

/// A vertex set dilated by a number of rings.
fn grown(patch: &[bool], around: &[Vec<u32>], rings: usize) -> Vec<bool> {
    let mut wide = patch.to_vec();
    let mut rim: Vec<u32> = (0..patch.len() as u32).filter(|v| patch[*v as usize]).collect();
    for _ in 0..rings {
        let next = rim.iter().flat_map(|v| &around[*v as usize]).copied();
        rim = next.filter(|w| !std::mem::replace(&mut wide[*w as usize], true)).collect();
    }
    wide
}

/// The mean displacement that contacts and folds ask of each vertex.
fn pushes(mesh: &TriMesh, faults: &Faults) -> Vec<Vector3<f64>> {
    let mut sums = vec![(Vector3::zeros(), 0.0); mesh.vertex_count()];
    let mut add = |v: u32, push: Vector3<f64>| {
        let sum = &mut sums[v as usize];
        *sum = (sum.0 + push, sum.1 + 1.0);
    };
    for &[t, u] in &faults.pairs {
        for crossing in crossings(mesh, t as usize, u as usize) {
            let Some(normal) = mesh.area_normal(crossing.triangle as usize).try_normalize(0.0) else { continue };
            let corner = mesh.corners(crossing.triangle as usize)[0];
            let depths = crossing.edge.map(|v| normal.dot(&(mesh.positions()[v as usize] - corner)));
            let end = usize::from(depths[1].abs() < depths[0].abs());
            let push = normal * (-depths[end] * (1.0 + OVERSHOOT) * 0.5);
            add(crossing.edge[end], push);
            mesh.triangles()[crossing.triangle as usize].iter().for_each(|v| add(*v, -push));
        }
    }
    if !faults.folds.is_empty() {
        let around = normals_around(mesh.triangles(), mesh.positions());
        for &t in &faults.folds {
            let Some((corner, push)) = across_edge(&mesh.corners(t as usize), &around[t as usize]) else { continue };
            for (k, v) in mesh.triangles()[t as usize].into_iter().enumerate() {
                add(v, if k == corner { push } else { -push });
            }
        }
    }
    sums.into_iter().map(|(sum, count)| if count > 0.0 { sum / count } else { sum }).collect()
}

/// The corner of a folded triangle that lies beyond its opposite edge, the longest in the plane of those around, and its displacement
/// half way back across that edge.
fn across_edge(corners: &[Point3<f64>; 3], around: &Vector3<f64>) -> Option<(usize, Vector3<f64>)> {
    let edges = opposite_edges(corners).map(|e| e - around * around.dot(&e));
    let corner = (0..3).max_by(|a, b| edges[*a].norm_squared().total_cmp(&edges[*b].norm_squared()))?;
    let inward = around.cross(&edges[corner]).try_normalize(0.0)?;
    let depth = -around.dot(&edges[0].cross(&edges[1])) / edges[corner].norm();
    Some((corner, inward * (depth * (1.0 + OVERSHOOT) * 0.5)))
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::mesh::shapes;

    fn found(mesh: &TriMesh) -> Faults {
        let pairs = self_intersections(mesh, &Run::default()).expect("a run that never stops").expect("few tests");
        Faults { pairs: pairs.into_iter().collect(), folds: folds(mesh.triangles(), mesh.positions()) }
    }

    #[test]
    fn a_tip_behind_a_triangle_and_the_triangle_are_moved_towards_each_other() {
        // The tip is 0.1 below the plane, its base 1 above.
        let p = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [1.0, 1.0, -0.1], [0.9, 1.0, 1.0], [1.1, 1.2, 1.0]];
        let mesh = TriMesh::new(p.map(Point3::from).to_vec(), vec![[0, 1, 2], [3, 4, 5]]).unwrap();
        let pushes = pushes(&mesh, &found(&mesh));
        assert!((pushes[3] - Vector3::new(0.0, 0.0, 0.055)).norm() < 1e-12, "{}", pushes[3]);
        assert!(pushes[..3].iter().all(|d| (d + Vector3::new(0.0, 0.0, 0.055)).norm() < 1e-12));
        assert!(pushes[4..].iter().all(|d| *d == Vector3::zeros()));
    }

    #[test]
    fn a_corner_beyond_an_edge_and_the_edge_are_moved_back_across_each_other() {
        let corners = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, -0.1, 0.0]].map(Point3::from);
        let (corner, push) = across_edge(&corners, &Vector3::z()).unwrap();
        assert_eq!(corner, 2);
        assert!((push - Vector3::new(0.0, 0.055, 0.0)).norm() < 1e-12, "{push}");
    }

    #[test]
    fn folds_count_between_unlike_shapes_alone() {
        let plane = shapes::plane(8);
        let middle = |p: &Point3<f64>| p.x > 0.3 && p.x < 0.7 && p.y > 0.3 && p.y < 0.7;
        // The middle is turned over in one pose: which way round it went is not known.
        let over = |p: &Point3<f64>| if middle(p) { Point3::new(p.x, 1.0 - p.y, 0.0) } else { *p };
        let over = plane.with_positions(plane.positions().iter().map(over).collect()).unwrap();
        let mut x = plane.positions().to_vec();
        let inner = (0..x.len()).find(|v| nalgebra::distance(&x[*v], &Point3::new(0.5, 0.5, 0.0)) < 1e-9);
        x[inner.expect("a vertex in the middle")] += Vector3::new(0.15, 0.01, 0.0);
        let run = Run::default();
        for (second, is_counted) in [(&plane, false), (&over, true)] {
            let trajectory =
                Trajectory::new(&plane, second, &super::super::TrajectoryOptions::default(), &run).unwrap();
            let faults = trajectory.faults(&x, &run).expect("a run that never stops").expect("few tests");
            assert!(faults.pairs.is_empty());
            assert_eq!(!faults.folds.is_empty(), is_counted);
        }
    }

    /// A trajectory between equal poses, and a shape with a tip through the other side.
    fn pierced(mesh: &TriMesh, tip: usize, through: Vector3<f64>) -> (Trajectory, Vec<Point3<f64>>, Faults) {
        let trajectory =
            Trajectory::new(mesh, mesh, &super::super::TrajectoryOptions::default(), &Run::default()).unwrap();
        let mut x = mesh.positions().to_vec();
        x[tip] += through;
        let faults = trajectory.faults(&x, &Run::default()).expect("a run that never stops").expect("few tests");
        assert!(!faults.pairs.is_empty());
        (trajectory, x, faults)
    }

    #[test]
    fn intersections_absent_from_linear_interpolation_are_removed_locally() {
        let ball = shapes::icosphere(4);
        let top = (0..ball.vertex_count()).max_by(|a, b| ball.positions()[*a].z.total_cmp(&ball.positions()[*b].z));
        let (trajectory, x, faults) = pierced(&ball, top.unwrap(), Vector3::new(0.0, 0.0, -2.2));
        let (straight, left) =
            trajectory.linearized(0.5, 0, x.clone(), faults.clone(), &Run::default()).expect("a run that never stops");
        assert_eq!(left, Faults::default());
        for (p, q) in straight.iter().zip(ball.positions()) {
            assert!((p - q).norm() < 1e-9);
        }
        // No more faults than in linear interpolation: unchanged.
        let kept = trajectory.linearized(0.5, faults.count(), x.clone(), faults.clone(), &Run::default());
        assert_eq!(kept.expect("a run that never stops"), (x, faults));
    }

    #[test]
    fn intersections_of_both_poses_are_kept() {
        let ball = shapes::icosphere(2);
        let both = shapes::disjoint(&[ball.clone(), ball.clone()]);
        // Two balls moved into each other, which `disjoint` set apart.
        let apart = both.positions()[ball.vertex_count()] - ball.positions()[0];
        let off = apart - Vector3::new(0.313, 0.217, 0.119);
        let apart = |(v, p): (usize, &Point3<f64>)| if v < ball.vertex_count() { *p } else { p - off };
        let through = both.with_positions(both.positions().iter().enumerate().map(apart).collect()).unwrap();
        assert!(!found(&through).pairs.is_empty());
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.8, 0.5).normalize() * 2.9);
        let second = through.with_positions(through.positions().iter().map(|p| rotation * p).collect()).unwrap();
        let mut trajectory =
            Trajectory::new(&through, &second, &super::super::TrajectoryOptions::default(), &Run::default()).unwrap();
        let exact = trajectory.at(0.3, &Run::default()).expect("a run that never stops");
        let untangled = trajectory.untangled(0.3, 20, &Run::default()).expect("a run that never stops");
        assert_eq!(untangled, Untangled { positions: exact, intersections: Some([0, 0]) });
    }

    #[test]
    fn a_patch_may_be_a_small_component_but_not_most_of_the_surface() {
        let small = shapes::icosphere(1);
        let (alone, x, faults) = pierced(&small, 0, -2.5 * small.positions()[0].coords);
        assert_eq!(alone.linearized(0.5, 0, x.clone(), faults, &Run::default()).expect("a run that never stops").0, x);
        let both = shapes::disjoint(&[small, shapes::icosphere(4)]);
        let (low, high) = shapes::icosphere(1).bounding_box().unwrap();
        let middle = nalgebra::center(&low, &high) + (both.positions()[0] - shapes::icosphere(1).positions()[0]);
        let (trajectory, x, faults) = pierced(&both, 0, (middle - both.positions()[0]) * 2.5);
        let (_, left) = trajectory.linearized(0.5, 0, x, faults, &Run::default()).expect("a run that never stops");
        assert_eq!(left, Faults::default());
    }
}
