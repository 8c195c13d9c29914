//! Bijective maps of surfaces of disk topology to the unit disk, and between two of them over the disk.
//!
//! The boundary is mapped to the circle by arc length, and every interior vertex is a convex combination of its neighbors (Tutte),
//!
//! ```text
//! Σ_j w_ij (u_i − u_j) = 0,      w_ij = max(cotangent weight, MIN_WEIGHT) > 0,
//! ```
//!
//! which inverts no triangle. Then vertices are relaxed toward the mean of their neighbors, weighted by the ratio of edge lengths on
//! the disk and on the surface, as far as no triangle around them is inverted: this enlarges crowded regions.
//!
//! To map one surface to another, the first disk is rotated to align the landmarks, landmarks on both boundaries are matched along
//! the circle, and interior ones are moved in steps while the other vertices relax. Boundaries map to each other.
//!
//! # Reference
//! W. T. Tutte, *How to draw a graph*, Proc. London Math. Soc. 13 (1963); M. Floater, *Parametrization and smooth approximation of surface
//! triangulations*, CAGD 14 (1997).

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector2};

use super::super::MorphError;
use super::super::bvh::{Bvh, CORNERS, SurfacePoint};
use super::{MAX_LANDMARK_ITERATIONS, connected_surface};
use crate::mesh::operators::{CotangentRule, Cotangents, EdgeWeights, factored_laplacian};
use crate::mesh::{HalfEdges, TriMesh};
use plumbline_num::energy::ConstrainedLaplacian;
use plumbline_num::run::{Run, Stopped};
use plumbline_num::sparse::Ordering;

/// Minimum edge weight: far below those of regular triangles (about 1), far above values that let vertices of slivers coincide.
const MIN_WEIGHT: f64 = 0.02;
/// Relaxation sweeps of a new disk: later ones change little.
const SWEEPS: usize = 60;
/// Minimum fraction of a step in the line search.
const MIN_STEP: f64 = 1.0 / 64.0;
/// Distance on the disk below which a landmark is at its target, for exact vertices in the result.
const COINCIDENT: f64 = 1e-12;

/// The position of every vertex on the unit disk, boundary on the circle, from angle 0. No triangle is inverted.
///
/// # Errors
/// [`MorphError::Topology`] for a surface that is closed, has several boundaries, handles or components, is not an oriented manifold,
/// or has parts that degenerate on the disk; [`MorphError::Interrupted`].
pub fn disk_map(mesh: &TriMesh, which: &'static str, run: &Run) -> Result<Vec<Vector2<f64>>, MorphError> {
    let rim = rim(mesh, which)?;
    let angles = arc_length_angles(mesh, &rim);
    Ok(Disk::new(mesh, which, &rim, &angles, run)?.at)
}

/// Maps the vertices of `first` to points on `second`, over the disk.
///
/// # Errors
/// As [`disk_map`]; also [`MorphError::Topology`] if the landmarks have different orders along the two boundaries.
pub fn over_disks(
    first: &TriMesh,
    second: &TriMesh,
    landmarks: &[(u32, u32)],
    run: &Run,
) -> Result<Vec<SurfacePoint>, MorphError> {
    let [rim_first, rim_second] = [rim(first, "first")?, rim(second, "second")?];
    let goal_angles = arc_length_angles(second, &rim_second);
    let goal = Disk::new(second, "second", &rim_second, &goal_angles, run)?.at;
    let angles = arc_length_angles(first, &rim_first);
    let initial = Disk::new(first, "first", &rim_first, &angles, run)?.at;
    let aligned: Vec<f64> = angles.iter().map(|a| a + best_rotation(&initial, &goal, landmarks)).collect();
    let angles = matched_angles(&rim_first, &aligned, &rim_second, &goal_angles, landmarks)?;
    let mut disk = Disk::new(first, "first", &rim_first, &angles, run)?;
    disk.move_landmarks(&goal, landmarks, run)?;
    located(&disk.at, second, &goal, landmarks, run)
}

fn topology(which: &'static str, fault: String) -> MorphError {
    let advice =
        "the disk method needs a connected surface with one boundary and without handles; use the method registration";
    MorphError::Topology { which, fault, advice }
}

/// The boundary loop, with the surface on its left.
fn rim(mesh: &TriMesh, which: &'static str) -> Result<Vec<u32>, MorphError> {
    let (half_edges, euler) = connected_surface(mesh, |fault| topology(which, fault))?;
    let loops = half_edges.boundary_loops();
    let [rim] = &loops[..] else { return Err(topology(which, format!("has {} boundaries", loops.len()))) };
    if euler != 1 {
        return Err(topology(which, format!("has one boundary, but {} handles", (1 - euler) / 2)));
    }
    Ok(rim.clone())
}

/// The angle of each boundary vertex by arc length, ascending from 0.
fn arc_length_angles(mesh: &TriMesh, rim: &[u32]) -> Vec<f64> {
    let point = |k: usize| mesh.positions()[rim[k % rim.len()] as usize];
    let lengths: Vec<f64> = (0..rim.len()).map(|k| (point(k + 1) - point(k)).norm()).collect();
    let whole: f64 = lengths.iter().sum();
    // No two vertices coincide.
    let min_length = (1e-6 * whole / rim.len() as f64).max(f64::MIN_POSITIVE);
    let whole: f64 = lengths.iter().map(|l| l.max(min_length)).sum();
    let mut passed = 0.0;
    let angle = |l: &f64| {
        let at = passed / whole * TAU;
        passed += l.max(min_length);
        at
    };
    lengths.iter().map(angle).collect()
}

/// The angle that aligns the landmarks best.
fn best_rotation(from: &[Vector2<f64>], to: &[Vector2<f64>], landmarks: &[(u32, u32)]) -> f64 {
    let pairs = landmarks.iter().map(|l| (from[l.0 as usize], to[l.1 as usize]));
    let (sine, cosine) = pairs.fold((0.0, 0.0), |(s, c), (a, b)| (s + a.perp(&b), c + a.dot(&b)));
    f64::atan2(sine, cosine)
}

/// Angles of the first boundary with its landmarks at the angles of the second, linearly interpolated between them.
fn matched_angles(
    rim: &[u32],
    angles: &[f64],
    other: &[u32],
    other_angles: &[f64],
    landmarks: &[(u32, u32)],
) -> Result<Vec<f64>, MorphError> {
    let on = |rim: &[u32], v: u32| rim.iter().position(|w| *w == v);
    let mut fixed: Vec<(usize, f64)> =
        landmarks.iter().filter_map(|l| Some((on(rim, l.0)?, other_angles[on(other, l.1)?]))).collect();
    fixed.sort_by_key(|f| f.0);
    let Some(&(first, begin)) = fixed.first() else { return Ok(angles.to_vec()) };
    // One period, from the first landmark back to it.
    let ahead = |angle: f64, from: f64| (angle - from).rem_euclid(TAU);
    let from = |k: usize| ahead(angles[k], angles[first]);
    let mut knots: Vec<(f64, f64)> = fixed.iter().map(|&(k, to)| (from(k), ahead(to, begin))).collect();
    knots.push((TAU, TAU));
    if knots.windows(2).any(|w| !(w[1].1 > w[0].1)) {
        let fault = "has landmarks on its boundary in another order than on that of the second";
        return Err(topology("first", fault.to_owned()));
    }
    let warped = |k: usize| {
        let at = from(k);
        let after = knots.partition_point(|n| n.0 <= at).clamp(1, knots.len() - 1);
        let ((a, p), (b, q)) = (knots[after - 1], knots[after]);
        begin + p + (at - a) / (b - a) * (q - p)
    };
    Ok((0..rim.len()).map(warped).collect())
}

/// A surface on the disk.
struct Disk<'m> {
    mesh: &'m TriMesh,
    at: Vec<Vector2<f64>>,
    /// Neighbors of each interior vertex, counterclockwise; empty for boundary vertices.
    rings: Vec<Vec<u32>>,
}

impl<'m> Disk<'m> {
    fn new(mesh: &'m TriMesh, which: &'static str, rim: &[u32], angles: &[f64], run: &Run) -> Result<Self, MorphError> {
        let half_edges = HalfEdges::new(mesh)?;
        let inside = |v: u32| if half_edges.is_boundary(v) { Vec::new() } else { half_edges.neighbors(v).collect() };
        let rings = (0..mesh.vertex_count() as u32).map(inside).collect();
        let mut disk = Self { mesh, at: embedded(mesh, rim, angles, run)?, rings };
        if let Some(t) = disk.inverted() {
            return Err(topology(which, format!("is degenerate on the disk at triangle {t}")));
        }
        for _ in 0..SWEEPS {
            run.check()?;
            disk.relax(&[]);
        }
        Ok(disk)
    }

    fn inverted(&self) -> Option<usize> {
        let area = |[a, b, c]: [Vector2<f64>; 3]| (b - a).perp(&(c - a));
        self.mesh.triangles().iter().position(|t| !(area(t.map(|v| self.at[v as usize])) > 0.0))
    }

    /// Moves every interior vertex that is not fixed toward the weighted mean of its neighbors.
    fn relax(&mut self, fixed: &[bool]) {
        for v in 0..self.at.len() {
            if self.rings[v].is_empty() || fixed.get(v) == Some(&true) {
                continue;
            }
            let (mut sum, mut total) = (Vector2::zeros(), 0.0);
            for &w in &self.rings[v] {
                let on_surface = (self.mesh.positions()[v] - self.mesh.positions()[w as usize]).norm();
                let on_disk = (self.at[v] - self.at[w as usize]).norm();
                let weight = (on_disk / on_surface.max(f64::MIN_POSITIVE)).max(1e-300);
                sum += self.at[w as usize] * weight;
                total += weight;
            }
            // Not finite for an edge without length: no step is valid then.
            self.step(v, &(sum / total));
        }
    }

    /// Moves a vertex toward a position, as far as no triangle around it is inverted; true if it arrives.
    fn step(&mut self, v: usize, to: &Vector2<f64>) -> bool {
        let from = self.at[v];
        let mut step = 1.0;
        while step >= MIN_STEP {
            let position = if step < 1.0 { from + (to - from) * step } else { *to };
            if self.is_valid(v, &position) {
                self.at[v] = position;
                return step >= 1.0;
            }
            step *= 0.5;
        }
        false
    }

    /// Whether no triangle around a vertex is inverted with the vertex at `position`.
    fn is_valid(&self, v: usize, position: &Vector2<f64>) -> bool {
        let ring = &self.rings[v];
        (0..ring.len()).all(|k| {
            let (p, q) = (self.at[ring[k] as usize], self.at[ring[(k + 1) % ring.len()] as usize]);
            (q - p).perp(&(position - p)) > 1e-9 * (q - p).norm_squared()
        })
    }

    /// Moves interior landmarks to their targets.
    fn move_landmarks(&mut self, goal: &[Vector2<f64>], landmarks: &[(u32, u32)], run: &Run) -> Result<(), Stopped> {
        let mut fixed = vec![false; self.at.len()];
        let inside: Vec<(usize, usize)> = landmarks.iter().map(|l| (l.0 as usize, l.1 as usize)).collect();
        let inside: Vec<_> = inside.into_iter().filter(|l| !self.rings[l.0].is_empty()).collect();
        for l in &inside {
            fixed[l.0] = true;
        }
        for _ in 0..MAX_LANDMARK_ITERATIONS {
            run.check()?;
            let mut arrived = true;
            for &(v, w) in &inside {
                if (self.at[v] - goal[w]).norm() > COINCIDENT {
                    arrived &= self.step(v, &goal[w]);
                }
            }
            if arrived {
                break;
            }
            self.relax(&fixed);
        }
        Ok(())
    }
}

/// Tutte's embedding with the boundary at these angles.
fn embedded(mesh: &TriMesh, rim: &[u32], angles: &[f64], run: &Run) -> Result<Vec<Vector2<f64>>, MorphError> {
    let n = mesh.vertex_count();
    let mut at: Vec<Option<Vector2<f64>>> = vec![None; n];
    for (v, angle) in rim.iter().zip(angles) {
        at[*v as usize] = Some(Vector2::new(angle.cos(), angle.sin()));
    }
    let weights = EdgeWeights::cotangent(n, &Cotangents::new(mesh, CotangentRule::Clamped));
    let edges = weights.iter().map(|(i, j, w)| (i, j, w.max(MIN_WEIGHT)));
    let laplacian = ConstrainedLaplacian::new(n, edges, |v| at[v].is_some())?;
    let positions = mesh.positions().iter().map(|p| p.coords.into()).collect();
    let mut solver = factored_laplacian(laplacian, &Ordering::NestedDissection(positions), run)?;
    Ok(solver.interpolate(|v| at[v].unwrap_or_default().into()).into_iter().map(Vector2::from).collect())
}

/// Points on the second surface of points on the disk.
fn located(
    at: &[Vector2<f64>],
    second: &TriMesh,
    goal: &[Vector2<f64>],
    landmarks: &[(u32, u32)],
    run: &Run,
) -> Result<Vec<SurfacePoint>, MorphError> {
    let flat = second.with_positions(goal.iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect())?;
    let bvh = Bvh::new(&flat);
    let mut vertex_of = vec![None; at.len()];
    for &(v, w) in landmarks {
        if (at[v as usize] - goal[w as usize]).norm() <= COINCIDENT {
            vertex_of[v as usize] = Some(w);
        }
    }
    let point = |(v, p): (usize, &Vector2<f64>)| {
        run.check()?;
        let nearest =
            bvh.nearest(&Point3::new(p.x, p.y, 0.0), |_| true).ok_or(MorphError::Empty { which: "second" })?;
        let corner = |w: u32| second.triangles()[nearest.triangle as usize].iter().position(|c| *c == w);
        let weights = vertex_of[v].and_then(corner).map_or(nearest.weights, |k| CORNERS[k]);
        Ok(SurfacePoint::on(second, nearest.triangle, weights))
    };
    at.iter().enumerate().map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{CorrespondenceMethod, CorrespondenceOptions, correspond};
    use super::*;
    use crate::mesh::shapes;

    /// What of a surface lies above a height.
    fn above(mesh: &TriMesh, height: f64) -> TriMesh {
        let up = |v: &u32| mesh.positions()[*v as usize].z > height;
        let kept: Vec<[u32; 3]> = mesh.triangles().iter().copied().filter(|t| t.iter().all(up)).collect();
        let mut number = vec![None; mesh.vertex_count()];
        let mut positions = Vec::new();
        for v in kept.iter().flatten() {
            number[*v as usize].get_or_insert_with(|| {
                positions.push(mesh.positions()[*v as usize]);
                positions.len() as u32 - 1
            });
        }
        let renumbered = kept.iter().map(|t| t.map(|v| number[v as usize].expect("named"))).collect();
        TriMesh::new(positions, renumbered).unwrap()
    }

    fn disks() -> Vec<TriMesh> {
        let egg = shapes::icosphere(3);
        let long =
            egg.with_positions(egg.positions().iter().map(|p| Point3::new(p.x, p.y, 3.0 * p.z)).collect()).unwrap();
        vec![
            shapes::one_triangle(),
            shapes::plane(7),
            shapes::spiked_plane(8, 4, 0.5),
            above(&egg, 0.1),
            above(&egg, -0.8),
            above(&long, 0.0),
            above(&shapes::cactus(12), 0.2),
            sheared(9.0),
        ]
    }

    /// A plane sheared so that nearly all edges have negative cotangent weights or none.
    fn sheared(by: f64) -> TriMesh {
        let plane = shapes::plane(7);
        let position = |p: &Point3<f64>| Point3::new(p.x + by * p.y, p.y, 0.0);
        plane.with_positions(plane.positions().iter().map(position).collect()).unwrap()
    }

    #[test]
    fn deep_interiors_have_at_least_a_twentieth_of_their_area_fraction() {
        let egg = shapes::icosphere(3);
        let long =
            egg.with_positions(egg.positions().iter().map(|p| Point3::new(p.x, p.y, 3.0 * p.z)).collect()).unwrap();
        let mesh = above(&long, 0.0);
        let at = disk_map(&mesh, "first", &Run::default()).unwrap();
        for (t, v) in mesh.triangles().iter().enumerate() {
            let [a, b, c] = v.map(|v| at[v as usize]);
            let on_disk = (b - a).perp(&(c - a)) / TAU;
            assert!(on_disk > 0.05 * mesh.area_normal(t).norm() / mesh.area(), "triangle {t}");
        }
    }

    #[test]
    fn the_disk_is_rotated_to_align_interior_landmarks() {
        // The same surface, its vertices in the reverse order: its boundary begins elsewhere.
        let first = above(&shapes::icosphere(3), 0.1);
        let n = first.vertex_count() as u32;
        let positions = first.positions().iter().rev().copied().collect();
        let second = TriMesh::new(positions, first.triangles().iter().map(|t| t.map(|v| n - 1 - v)).collect()).unwrap();
        let open = HalfEdges::new(&first).unwrap();
        let inside: Vec<(u32, u32)> = (0..n).filter(|v| !open.is_boundary(*v)).map(|v| (v, n - 1 - v)).collect();
        let laid = over_disks(&first, &second, &inside, &Run::default()).unwrap();
        for (on, p) in laid.iter().zip(first.positions()) {
            assert!((on.point - p).norm() < 1e-6, "{} off", (on.point - p).norm());
        }
    }

    #[test]
    fn maps_to_the_disk_are_bijective() {
        for (k, mesh) in disks().iter().enumerate() {
            let at = disk_map(mesh, "first", &Run::default()).unwrap();
            let area = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|v| at[v as usize]);
                0.5 * (b - a).perp(&(c - a))
            };
            assert!(mesh.triangles().iter().all(|t| area(t) > 0.0), "{k}");
            // All triangles together are the polygon of the boundary, so that none lies on another.
            let rim = rim(mesh, "first").unwrap();
            let corner = |i: usize| at[rim[i % rim.len()] as usize];
            let polygon: f64 = (0..rim.len()).map(|i| 0.5 * corner(i).perp(&corner(i + 1))).sum();
            assert!((mesh.triangles().iter().map(area).sum::<f64>() - polygon).abs() < 1e-9, "{k}");
            assert!(rim.iter().all(|v| (at[*v as usize].norm() - 1.0).abs() < 1e-12));
        }
    }

    #[test]
    fn the_map_of_a_surface_to_itself_over_the_disk_is_the_identity() {
        for mesh in disks() {
            let landmarks: Vec<(u32, u32)> = (0..mesh.vertex_count() as u32).step_by(7).map(|v| (v, v)).collect();
            let laid =
                correspond(&mesh, &mesh, &landmarks, &CorrespondenceMethod::Disk.into(), &Run::default()).unwrap();
            for (p, q) in laid.mapped.positions().iter().zip(mesh.positions()) {
                assert!((p - q).norm() < 1e-6 * mesh.diagonal());
            }
            assert_eq!((laid.quality.flipped, laid.quality.landmark_error), (0, 0.0));
        }
    }

    #[test]
    fn boundaries_map_to_each_other_and_landmarks_coincide() {
        let (first, second) = (shapes::plane(9), above(&shapes::icosphere(4), 0.0));
        let nearest = |mesh: &TriMesh, to: [f64; 3]| {
            let far = |v: &u32| (mesh.positions()[*v as usize] - Point3::from(to)).norm();
            (0..mesh.vertex_count() as u32).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap()
        };
        // Corners of the plane on the equator, turned by a third of a circle; its center beside the pole.
        let landmark = |p: [f64; 2], q: [f64; 3]| (nearest(&first, [p[0], p[1], 0.0]), nearest(&second, q));
        let on_equator = |degrees: f64| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let rim = rim(&second, "second").unwrap();
            let far = |v: &&u32| (second.positions()[**v as usize] - Point3::new(cosine, sine, 0.0)).norm();
            *rim.iter().min_by(|a, b| far(a).total_cmp(&far(b))).unwrap()
        };
        let mut landmarks = vec![landmark([0.5, 0.5], [0.3, 0.0, 0.95])];
        for (corner, angle) in [([0.0, 0.0], 120.0), ([1.0, 0.0], 200.0), ([1.0, 1.0], 310.0), ([0.0, 1.0], 390.0)] {
            landmarks.push((nearest(&first, [corner[0], corner[1], 0.0]), on_equator(angle)));
        }
        let method = CorrespondenceOptions::from(CorrespondenceMethod::Disk);
        let laid = correspond(&first, &second, &landmarks, &method, &Run::default()).unwrap();
        assert_eq!((laid.quality.landmark_error, laid.quality.collapsed), (0.0, 0));
        // A triangle with all corners on the jagged rim of the second spans it as a chord, and may face anywhere.
        let edge = HalfEdges::new(&first).unwrap();
        let chords = first.triangles().iter().filter(|t| t.iter().all(|v| edge.is_boundary(*v))).count();
        assert!(laid.quality.flipped <= chords && chords == 2, "{:?}", laid.quality);
        let open = HalfEdges::new(&second).unwrap();
        for v in rim(&first, "first").unwrap() {
            let on = &laid.points[v as usize];
            let corners = second.triangles()[on.triangle as usize];
            let inner = corners.iter().zip(on.weights).filter(|(c, w)| !open.is_boundary(**c) && *w > 1e-9);
            assert_eq!(inner.count(), 0, "vertex {v} left the boundary");
        }
        let crossed = [landmarks[0], (landmarks[1].0, landmarks[2].1), (landmarks[2].0, landmarks[1].1), landmarks[3]];
        let refused = correspond(&first, &second, &crossed, &method, &Run::default()).unwrap_err().to_string();
        assert!(refused.contains("in another order"), "{refused}");
    }

    #[test]
    fn surfaces_of_other_topology_are_rejected() {
        let message = |mesh: &TriMesh| disk_map(mesh, "second", &Run::default()).unwrap_err().to_string();
        assert!(message(&shapes::icosphere(1)).contains("the second mesh has 0 boundaries"));
        assert!(message(&shapes::tube(8, 4, 1.0, 2.0)).contains("has 2 boundaries"));
        let torus = shapes::holed_torus(1, 10);
        let open = TriMesh::new(torus.positions().to_vec(), torus.triangles()[1..].to_vec()).unwrap();
        assert!(message(&open).contains("has one boundary, but 1 handles"));
        let two = shapes::disjoint(&[shapes::plane(2), shapes::plane(2)]);
        assert!(message(&two).contains("has 2 connected components"));
    }
}
