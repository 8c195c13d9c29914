//! An open surface without an inside becomes a thin solid.
//!
//! A plane, a ribbon or a Möbius strip bounds no volume: there is no middle to find, and no telling which loops go round a hole. Such a sheet is
//! laid double, `h` apart along its normals, and closed along its rim: the boundary of a thickened sheet, which has as many
//! handles as the sheet has independent loops. Both sides of a triangle are followed over the edges to those of its neighbors (the
//! orientation double cover), so that a strip with one side gives a closed surface too.
//!
//! Whether an open surface is a sheet or a solid with holes is asked of its vertices: a little inward from one, the winding number is one half
//! on a plane, and one on a closed surface.
//!
//! # Reference
//! A. Jacobson, L. Kavan, O. Sorkine-Hornung, *Robust inside-outside segmentation using generalized winding numbers*, SIGGRAPH 2013; A. van
//! Oosterom, J. Strackee, *The solid angle of a plane triangle*, IEEE Trans. Biomed. Eng. 30 (1983).

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use crate::mesh::TriMesh;
use plumbline_num::spatial::UnionFind;

/// Half the thickness of a sheet, in radii of the sphere of equal area.
const THICKNESS: f64 = 0.1;
/// Vertices that are asked.
const ASKED: usize = 60;
/// How far inward.
const BESIDE: f64 = 0.02;
/// Mean winding number of a solid at least: halfway between a plane and a closed surface.
const SOLID: f64 = 0.75;

/// True where an open surface has an inside all the same.
pub(super) fn is_solid(surface: &TriMesh, normals: &[Vector3<f64>]) -> bool {
    let every = surface.vertex_count().div_ceil(ASKED).max(1);
    let asked = surface.positions().iter().zip(normals).step_by(every).filter(|(_, n)| n.norm() > 0.5);
    let numbers: Vec<f64> = asked.map(|(p, n)| winding_number(surface, &(p - n * BESIDE))).collect();
    numbers.iter().sum::<f64>() >= SOLID * numbers.len() as f64
}

/// How often the surface goes round a point: its signed solid angle over `4π`.
pub(super) fn winding_number(surface: &TriMesh, p: &Point3<f64>) -> f64 {
    let half_angle = |t: usize| {
        let [a, b, c] = surface.corners(t).map(|q| q - p);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let volume = a.dot(&b.cross(&c));
        volume.atan2(la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb)
    };
    (0..surface.triangle_count()).map(half_angle).sum::<f64>() / std::f64::consts::TAU
}

/// The surface of a thickened sheet, and the vertex of the sheet that each of its vertices is over; `None` where more than two
/// triangles meet at an edge.
pub(super) fn thickened(sheet: &TriMesh) -> Option<(TriMesh, Vec<u32>)> {
    // Corner k of triangle t has the number 6t + k on its front and 6t + 3 + k on its back.
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
                // Neighbors of one orientation run along their edge in opposite directions.
                let turned = a == b;
                if !turned {
                    second.reverse();
                }
                for ((t, k), (u, l)) in first.into_iter().zip(second) {
                    let (same, opposite) = if turned { (back(u, l), front(u, l)) } else { (front(u, l), back(u, l)) };
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
    let place = |(v, n): (&u32, &Vector3<f64>)| {
        let p: Point3<f64> = sheet.positions()[*v as usize];
        p + n.try_normalize(1e-9).unwrap_or_default() * THICKNESS
    };
    let positions = over.iter().zip(&normals).map(place).collect();
    Some((TriMesh::new(positions, triangles).ok()?, over))
}
