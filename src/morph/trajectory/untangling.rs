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
//! intersection than before. Pairs of triangles that intersect in one of the two poses are theirs, and left alone and not counted.

use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};

use super::super::intersections::{passages, self_intersections};
use super::Trajectory;
use crate::mesh::TriMesh;

/// By how much an end is pushed past the plane, as a share of how deep it is.
const BEYOND: f64 = 0.1;

impl Trajectory {
    /// A shape at a time, pushed out of itself in at most so many rounds, and how many pairs of triangles intersect before and after.
    pub fn untangled(&mut self, time: f64, rounds: usize) -> (Vec<Point3<f64>>, [usize; 2]) {
        let start = self.at(time);
        let times = vec![time; self.triangles.len()];
        let mut forces = vec![Vector3::zeros(); start.len()];
        let weights = self.solve.diagonal();
        let (mut x, mut best, mut counts) = (start.clone(), start.clone(), None);
        for round in 0..=rounds {
            let Ok(mesh) = TriMesh::new(x.clone(), self.triangles.clone()) else { break };
            let mut pairs = self_intersections(&mesh);
            pairs.retain(|pair| !self.own_intersections().contains(pair));
            let [before, least] = counts.unwrap_or([pairs.len(); 2]);
            if pairs.len() < least {
                best.clone_from(&x);
            }
            counts = Some([before, least.min(pairs.len())]);
            if pairs.is_empty() || round == rounds || time == 0.0 || time == 1.0 {
                break;
            }
            for (v, push) in pushes(&mesh, &pairs).into_iter().enumerate() {
                forces[v] += push * weights[v];
            }
            let edges = self.rigid_edges(&times, &x);
            self.solve.follow_pushed(|t| edges[t], &forces, &mut x);
            self.settle(&mut x, &start);
        }
        (best, counts.unwrap_or_default())
    }
}

impl Trajectory {
    /// Pairs of triangles that intersect in one of the poses.
    fn own_intersections(&mut self) -> &BTreeSet<[u32; 2]> {
        let (poses, triangles) = ([&self.first, &self.second], &self.triangles);
        self.intersecting.get_or_insert_with(|| {
            let meshes = poses.into_iter().filter_map(|x| TriMesh::new(x.clone(), triangles.clone()).ok());
            meshes.flat_map(|mesh| self_intersections(&mesh)).collect()
        })
    }
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
    use super::*;

    #[test]
    fn a_tip_behind_a_triangle_is_pushed_to_it_and_the_triangle_the_other_way() {
        // The tip is 0.1 below the plane, its base 1 above.
        let p = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [1.0, 1.0, -0.1], [0.9, 1.0, 1.0], [1.1, 1.2, 1.0]];
        let mesh = TriMesh::new(p.map(Point3::from).to_vec(), vec![[0, 1, 2], [3, 4, 5]]).unwrap();
        let pushes = pushes(&mesh, &self_intersections(&mesh));
        assert!((pushes[3] - Vector3::new(0.0, 0.0, 0.055)).norm() < 1e-12, "{}", pushes[3]);
        assert!(pushes[..3].iter().all(|d| (d + Vector3::new(0.0, 0.0, 0.055)).norm() < 1e-12));
        assert!(pushes[4..].iter().all(|d| *d == Vector3::zeros()));
    }
}
