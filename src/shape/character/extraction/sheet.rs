//! Thickens an open surface without an inside.
//!
//! A plane, a ribbon or a Möbius strip bounds no volume: it has no medial axis, and loops around holes are undefined. Such a sheet is doubled,
//! `h` apart along its normals, and closed along its boundary: a thickened sheet with as many handles as the sheet has independent loops.
//! The sides of a triangle are followed over edges to those of its neighbors (orientation double cover), so that a one-sided strip gives a
//! closed surface, too.
//!
//! Sheets are distinguished from solids with holes by sampling the winding number slightly inward and slightly outward of vertices: one half
//! and minus one half at a plane, one and zero at a closed surface. Where a fraction of the triangles is missing all are that fraction of it.
//!
//! # Reference
//! A. Jacobson, L. Kavan, O. Sorkine-Hornung, *Robust inside-outside segmentation using generalized winding numbers*, SIGGRAPH 2013; A. van
//! Oosterom, J. Strackee, *The solid angle of a plane triangle*, IEEE Trans. Biomed. Eng. 30 (1983).

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use super::caps;
use crate::mesh::TriMesh;
use plumbline_num::run::Run;
use plumbline_num::spatial::UnionFind;

/// Half the thickness of a sheet, in radii of the sphere of equal area (2.5 node spacings).
const THICKNESS: f64 = 0.1;
/// Number of sampled vertices.
const SAMPLES: usize = 60;
/// Offset of the samples, inward and outward.
const SAMPLE_OFFSET: f64 = 0.02;
/// Smallest mean winding number inside a solid, beside its drop across the surface: midway between a plane and a closed surface.
const MIN_SOLID_WINDING: f64 = 0.75;

/// Smallest fraction of the edges of a solid with a triangle on either side. Where triangles are missing at random it is the fraction that is
/// left. Triangles that meet at vertices alone have no such edge, and each would get a cap of its own.
const MIN_PAIRED: f64 = 0.25;

/// Whether an open surface bounds a volume; meaningless once the run has ended.
pub(super) fn is_solid(surface: &TriMesh, normals: &[Vector3<f64>], run: &Run) -> bool {
    let edges = 3 * surface.triangle_count();
    if ((edges - caps::boundary(surface.triangles()).len()) as f64) < MIN_PAIRED * edges as f64 {
        return false;
    }
    let every = surface.vertex_count().div_ceil(SAMPLES).max(1);
    let asked = surface.positions().iter().zip(normals).step_by(every).filter(|(_, n)| n.norm() > 0.5);
    let (mut inside, mut outside) = (0.0, 0.0);
    for (p, n) in asked {
        if run.check().is_err() {
            break;
        }
        inside += winding_number(surface, &(p - n * SAMPLE_OFFSET));
        outside += winding_number(surface, &(p + n * SAMPLE_OFFSET));
    }
    inside >= MIN_SOLID_WINDING * (inside - outside)
}

/// Generalized winding number of a surface about a point: its signed solid angle over `4π`.
pub(super) fn winding_number(surface: &TriMesh, p: &Point3<f64>) -> f64 {
    let half_angle = |t: usize| {
        let [a, b, c] = surface.corners(t).map(|q| q - p);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let volume = a.dot(&b.cross(&c));
        volume.atan2(la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb)
    };
    (0..surface.triangle_count()).map(half_angle).sum::<f64>() / std::f64::consts::TAU
}

/// The thickened surface, and the sheet vertex of each of its vertices; `None` if more than two triangles share an edge.
pub(super) fn thickened(sheet: &TriMesh) -> Option<(TriMesh, Vec<u32>)> {
    // Corner k of triangle t has the index 6t + k on its front and 6t + 3 + k on its back.
    let front = |t: usize, k: usize| (6 * t + k) as u32;
    let back = |t: usize, k: usize| (6 * t + 3 + k) as u32;
    let mut at_edge: HashMap<(u32, u32), Vec<(usize, usize)>> = HashMap::new();
    for (t, c) in sheet.triangles().iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (c[k], c[(k + 1) % 3]);
            at_edge.entry((a.min(b), a.max(b))).or_default().push((t, k));
        }
    }
    let mut joined = UnionFind::new(6 * sheet.triangle_count());
    for sides in at_edge.values() {
        let ends = |(t, k): (usize, usize)| (sheet.triangles()[t][k], [(t, k), (t, (k + 1) % 3)]);
        match *sides.as_slice() {
            [side] => {
                for (t, k) in ends(side).1 {
                    joined.join(front(t, k), back(t, k));
                }
            }
            [one, other] => {
                let ((a, first), (b, mut second)) = (ends(one), ends(other));
                // Consistently oriented neighbors traverse their edge in opposite directions.
                let opposed = a == b;
                if !opposed {
                    second.reverse();
                }
                for ((t, k), (u, l)) in first.into_iter().zip(second) {
                    let (same, opposite) = if opposed { (back(u, l), front(u, l)) } else { (front(u, l), back(u, l)) };
                    joined.join(front(t, k), same);
                    joined.join(back(t, k), opposite);
                }
            }
            _ => return None,
        }
    }
    let mut number = HashMap::new();
    let (mut over, mut normals): (Vec<u32>, Vec<Vector3<f64>>) = (Vec::new(), Vec::new());
    let mut triangles = Vec::with_capacity(2 * sheet.triangle_count());
    for (t, c) in sheet.triangles().iter().enumerate() {
        let normal = sheet.area_normal(t);
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            let corners = [0, 1, 2].map(|k| {
                let root = joined.root((6 * t + 3 * side + k) as u32);
                let v = *number.entry(root).or_insert_with(|| {
                    over.push(c[k]);
                    normals.push(Vector3::zeros());
                    over.len() as u32 - 1
                });
                normals[v as usize] += normal * sign;
                v
            });
            triangles.push(if side == 0 { corners } else { [corners[0], corners[2], corners[1]] });
        }
    }
    let position = |(v, n): (&u32, &Vector3<f64>)| {
        let p: Point3<f64> = sheet.positions()[*v as usize];
        p + n.try_normalize(1e-9).unwrap_or_default() * THICKNESS
    };
    let positions = over.iter().zip(&normals).map(position).collect();
    Some((TriMesh::new(positions, triangles).ok()?, over))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_ball_of_which_half_is_left_is_solid_and_triangles_that_meet_at_vertices_alone_are_not() {
        let solid = |mesh: &TriMesh| is_solid(mesh, &mesh.vertex_normals(), &Run::default());
        let ball = shapes::icosphere(4);
        let mut random = fastrand::Rng::with_seed(5);
        let half = ball.triangles().iter().copied().filter(|_| random.bool()).collect();
        let half = TriMesh::new(ball.positions().to_vec(), half).unwrap();
        assert!(solid(&ball) && solid(&half));
        assert!(!solid(&shapes::plane(9)));
        // Every triangle of the coarser ball became four, of which the middle one is left: its corners are in its neighbors' middle ones.
        let coarse = shapes::icosphere(3).vertex_count() as u32;
        let middles = ball.triangles().iter().copied().filter(|t| t.iter().all(|v| *v >= coarse)).collect();
        let middles = TriMesh::new(ball.positions().to_vec(), middles).unwrap();
        assert_eq!(4 * middles.triangle_count(), ball.triangle_count());
        assert!(!solid(&middles));
    }
}
