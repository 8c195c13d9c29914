//! Contact forces that push a shape out of itself.
//!
//! Where an edge passes through a triangle, the end that is less deep behind it is pushed back to the triangle's plane, the triangle
//! the other way. Pushes add up to forces `f` from round to round (Uzawa's method), and the surface gives way elastically to both
//! ends of the trajectory:
//!
//! ```text
//! f ← f + W d,        L x = Σ ± h ((1 − τ) Pₜ a + τ Qₜ b) + f
//! ```
//!
//! `d` are the pushes and `W` the weights of each vertex's edges. The best of all rounds is kept, so that there is never more
//! intersection than before. Pairs of triangles that intersect in both poses are theirs, and left alone and not counted.
//!
//! Where a shape on straight ways would intersect itself less, as where folds turn over, what is around the intersections goes straight too:
//! its edges become those of the straight ways, carried along by the motion of the whole or, where that does not help, not, and its rim stays;
//! in growing patches, until there is no more intersection than on straight ways, or the patches would be most of the surface.

use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};

use super::super::MorphError;
use super::super::elastic_solve::ElasticSolve;
use super::super::intersections::{passages, self_intersections};
use super::Trajectory;
use super::frames::opposite_edges;
use crate::mesh::{TriMesh, neighbors_of_vertices};
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::numbered_components;

/// By how much an end is pushed past the plane, as a share of how deep it is.
const BEYOND: f64 = 0.1;

/// Rings around intersections that go straight, from the first try to the last.
const RINGS: [usize; 5] = [2, 4, 8, 16, 32];

impl Trajectory {
    /// A shape at a time, pushed out of itself in at most so many rounds, and how many pairs of triangles intersect before and after.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn untangled(
        &mut self,
        time: f64,
        rounds: usize,
        run: &Run,
    ) -> Result<(Vec<Point3<f64>>, [usize; 2]), Stopped> {
        let start = self.at(time, run)?;
        let pairs = self.intersections(&start, run)?;
        let before = pairs.len();
        if pairs.is_empty() || rounds == 0 || time == 0.0 || time == 1.0 {
            return Ok((start, [before; 2]));
        }
        let (x, pairs) = self.pushed(time, rounds, &start, pairs, run)?;
        let straight = if pairs.is_empty() { 0 } else { self.intersections(&self.linear(time), run)?.len() };
        let (x, pairs) = self.straightened(time, straight, x, pairs, run)?;
        Ok((x, [before, pairs.len()]))
    }

    /// Pairs of triangles that intersect in a shape, but not in both poses.
    fn intersections(&self, x: &[Point3<f64>], run: &Run) -> Result<Vec<[u32; 2]>, Stopped> {
        let all = |x: &[Point3<f64>]| {
            let mesh = TriMesh::new(x.to_vec(), self.triangles.clone());
            mesh.map_or_else(|_| Ok(Vec::new()), |mesh| self_intersections(&mesh, run))
        };
        let own = if let Some(own) = self.own_intersections.get() {
            own
        } else {
            let of_second: BTreeSet<[u32; 2]> = all(&self.second)?.into_iter().collect();
            let own = all(&self.first)?.into_iter().filter(|pair| of_second.contains(pair)).collect();
            self.own_intersections.get_or_init(|| own)
        };
        let mut pairs = all(x)?;
        pairs.retain(|pair| !own.contains(pair));
        Ok(pairs)
    }

    /// The best shape of all rounds of pushes, and its intersections.
    fn pushed(
        &mut self,
        time: f64,
        rounds: usize,
        start: &[Point3<f64>],
        pairs: Vec<[u32; 2]>,
        run: &Run,
    ) -> Result<Tangled, Stopped> {
        let times = vec![time; self.triangles.len()];
        let mut forces = vec![Vector3::zeros(); start.len()];
        let weights = self.solve.diagonal();
        let (mut x, mut now) = (start.to_vec(), pairs.clone());
        let mut best = (start.to_vec(), pairs);
        for _ in 0..rounds {
            let Ok(mesh) = TriMesh::new(x.clone(), self.triangles.clone()) else { break };
            for (v, push) in pushes(&mesh, &now).into_iter().enumerate() {
                forces[v] += push * weights[v];
            }
            let edges = self.rigid_edges(&times, &x);
            self.solve.follow_pushed(|t| edges[t], &forces, &mut x);
            self.settle(&mut x, start);
            now = self.intersections(&x, run)?;
            if now.len() < best.1.len() {
                best = (x.clone(), now.clone());
            }
            if now.is_empty() {
                break;
            }
        }
        Ok(best)
    }

    /// Patches around intersections go straight until there are no more than `enough`, or it does not help.
    fn straightened(
        &self,
        time: f64,
        enough: usize,
        x: Vec<Point3<f64>>,
        pairs: Vec<[u32; 2]>,
        run: &Run,
    ) -> Result<Tangled, Stopped> {
        if pairs.len() <= enough {
            return Ok((x, pairs));
        }
        let straight = [self.guess(&vec![time; x.len()]), self.linear(time)];
        let around = neighbors_of_vertices(x.len(), &self.triangles);
        let (mut best, mut patch) = ((x.clone(), pairs.clone()), vec![false; x.len()]);
        let mut now = pairs;
        for (straight, rings) in straight.iter().flat_map(|s| RINGS.map(|rings| (s, rings))) {
            for v in now.iter().flatten().flat_map(|t| self.triangles[*t as usize]) {
                patch[v as usize] = true;
            }
            let wide = grown(&patch, &around, rings);
            if 2 * wide.iter().filter(|inside| **inside).count() > wide.len() {
                continue;
            }
            let Some(moved) = self.gone_straight(&wide, straight, &x, run)? else { break };
            now = self.intersections(&moved, run)?;
            if now.len() < best.1.len() {
                best = (moved, now.clone());
            }
            if best.1.len() <= enough {
                break;
            }
        }
        Ok(best)
    }

    /// `x` with the edges of `guess` in a patch, and the rest of it where it is.
    fn gone_straight(
        &self,
        patch: &[bool],
        guess: &[Point3<f64>],
        x: &[Point3<f64>],
        run: &Run,
    ) -> Result<Option<Vec<Point3<f64>>>, Stopped> {
        let (piece, pieces) = numbered_components(x.len(), &self.triangles);
        let mut held: Vec<bool> = patch.iter().map(|inside| !inside).collect();
        // A piece of which nothing stays is held by one vertex.
        let mut stays = vec![false; pieces];
        (0..x.len()).filter(|&v| held[v]).for_each(|v| stays[piece[v] as usize] = true);
        for v in 0..x.len() {
            held[v] |= !std::mem::replace(&mut stays[piece[v] as usize], true);
        }
        let half = self.solve.half().to_vec();
        let mut solve = match ElasticSolve::held(&self.triangles, half, x, &held, run) {
            Ok(solve) => solve,
            Err(MorphError::Interrupted(stopped)) => return Err(stopped),
            Err(_) => return Ok(None),
        };
        let mut moved = x.to_vec();
        solve.follow(|t| opposite_edges(&self.corners(guess, t)), &mut moved);
        Ok(Some(moved))
    }
}

/// A shape, and its pairs of triangles that intersect.
type Tangled = (Vec<Point3<f64>>, Vec<[u32; 2]>);

/// A set of vertices with so many rings around it.
fn grown(patch: &[bool], around: &[Vec<u32>], rings: usize) -> Vec<bool> {
    let mut wide = patch.to_vec();
    let mut rim: Vec<u32> = (0..patch.len() as u32).filter(|v| patch[*v as usize]).collect();
    for _ in 0..rings {
        let next = rim.iter().flat_map(|v| &around[*v as usize]).copied();
        rim = next.filter(|w| !std::mem::replace(&mut wide[*w as usize], true)).collect();
    }
    wide
}

/// The mean push of each vertex.
fn pushes(mesh: &TriMesh, pairs: &[[u32; 2]]) -> Vec<Vector3<f64>> {
    let mut sums = vec![(Vector3::zeros(), 0.0); mesh.vertex_count()];
    for &[t, u] in pairs {
        for passage in passages(mesh, t as usize, u as usize) {
            let Some(normal) = mesh.area_normal(passage.triangle as usize).try_normalize(0.0) else { continue };
            let corner = mesh.corners(passage.triangle as usize)[0];
            let depths = passage.edge.map(|v| normal.dot(&(mesh.positions()[v as usize] - corner)));
            let end = usize::from(depths[1].abs() < depths[0].abs());
            let push = normal * (-depths[end] * (1.0 + BEYOND) * 0.5);
            let mut add = |v: u32, push: Vector3<f64>| {
                let sum = &mut sums[v as usize];
                *sum = (sum.0 + push, sum.1 + 1.0);
            };
            add(passage.edge[end], push);
            mesh.triangles()[passage.triangle as usize].iter().for_each(|v| add(*v, -push));
        }
    }
    sums.into_iter().map(|(sum, count)| if count > 0.0 { sum / count } else { sum }).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_tip_behind_a_triangle_is_pushed_to_it_and_the_triangle_the_other_way() {
        // The tip is 0.1 below the plane, its base 1 above.
        let p = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [1.0, 1.0, -0.1], [0.9, 1.0, 1.0], [1.1, 1.2, 1.0]];
        let mesh = TriMesh::new(p.map(Point3::from).to_vec(), vec![[0, 1, 2], [3, 4, 5]]).unwrap();
        let pushes = pushes(&mesh, &self_intersections(&mesh, &Run::default()).expect("a run that never stops"));
        assert!((pushes[3] - Vector3::new(0.0, 0.0, 0.055)).norm() < 1e-12, "{}", pushes[3]);
        assert!(pushes[..3].iter().all(|d| (d + Vector3::new(0.0, 0.0, 0.055)).norm() < 1e-12));
        assert!(pushes[4..].iter().all(|d| *d == Vector3::zeros()));
    }

    /// At rest, so that straight ways stay; a tip goes through the other side.
    fn pierced(mesh: &TriMesh, tip: usize, through: Vector3<f64>) -> (Trajectory, Vec<Point3<f64>>, Vec<[u32; 2]>) {
        let trajectory =
            Trajectory::new(mesh, mesh, &super::super::TrajectoryOptions::default(), &Run::default()).unwrap();
        let mut x = mesh.positions().to_vec();
        x[tip] += through;
        let pairs = trajectory.intersections(&x, &Run::default()).expect("a run that never stops");
        assert!(!pairs.is_empty());
        (trajectory, x, pairs)
    }

    #[test]
    fn what_straight_ways_do_not_pierce_goes_straight_and_the_rest_stays() {
        let ball = shapes::icosphere(4);
        let top = (0..ball.vertex_count()).max_by(|a, b| ball.positions()[*a].z.total_cmp(&ball.positions()[*b].z));
        let (trajectory, x, pairs) = pierced(&ball, top.unwrap(), Vector3::new(0.0, 0.0, -2.2));
        let (straight, left) =
            trajectory.straightened(0.5, 0, x.clone(), pairs.clone(), &Run::default()).expect("a run that never stops");
        assert!(left.is_empty());
        for (p, q) in straight.iter().zip(ball.positions()) {
            assert!((p - q).norm() < 1e-9);
        }
        // No worse than straight ways are: left alone.
        let enough = pairs.len();
        assert_eq!(
            trajectory.straightened(0.5, enough, x.clone(), pairs, &Run::default()).expect("a run that never stops"),
            (x.clone(), trajectory.intersections(&x, &Run::default()).expect("a run that never stops"))
        );
    }

    #[test]
    fn a_shape_that_intersects_itself_in_both_poses_turns_as_it_is() {
        let ball = shapes::icosphere(2);
        let both = shapes::disjoint(&[ball.clone(), ball.clone()]);
        // Two balls moved into each other, which `disjoint` set apart.
        let apart = both.positions()[ball.vertex_count()] - ball.positions()[0];
        let off = apart - Vector3::new(0.313, 0.217, 0.119);
        let place = |(v, p): (usize, &Point3<f64>)| if v < ball.vertex_count() { *p } else { p - off };
        let through = both.with_positions(both.positions().iter().enumerate().map(place).collect()).unwrap();
        assert!(!self_intersections(&through, &Run::default()).expect("a run that never stops").is_empty());
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.8, 0.5).normalize() * 2.9);
        let second = through.with_positions(through.positions().iter().map(|p| turn * p).collect()).unwrap();
        let mut trajectory =
            Trajectory::new(&through, &second, &super::super::TrajectoryOptions::default(), &Run::default()).unwrap();
        let exact = trajectory.at(0.3, &Run::default()).expect("a run that never stops");
        assert_eq!(trajectory.untangled(0.3, 20, &Run::default()).expect("a run that never stops"), (exact, [0, 0]));
    }

    #[test]
    fn a_small_piece_goes_straight_as_a_whole_but_not_most_of_the_surface() {
        let small = shapes::icosphere(1);
        let (alone, x, pairs) = pierced(&small, 0, -2.5 * small.positions()[0].coords);
        assert_eq!(alone.straightened(0.5, 0, x.clone(), pairs, &Run::default()).expect("a run that never stops").0, x);
        let both = shapes::disjoint(&[small, shapes::icosphere(4)]);
        let (low, high) = shapes::icosphere(1).bounding_box().unwrap();
        let middle = nalgebra::center(&low, &high) + (both.positions()[0] - shapes::icosphere(1).positions()[0]);
        let (trajectory, x, pairs) = pierced(&both, 0, (middle - both.positions()[0]) * 2.5);
        assert!(
            trajectory.straightened(0.5, 0, x, pairs, &Run::default()).expect("a run that never stops").1.is_empty()
        );
    }
}
