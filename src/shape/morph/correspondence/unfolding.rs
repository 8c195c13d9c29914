//! Removal of fold-overs from a map onto a surface.
//!
//! Vertices of flipped triangles move to the centroid of their neighbors and are projected to the surface again. The region around a
//! persistent fold grows by a ring every few iterations: a sufficiently large relaxed patch is fold-free like Tutte's embedding in
//! the plane, unless fixed vertices in it cross. The best iterate is kept.
//!
//! # Reference
//! W. T. Tutte, *How to draw a graph*, Proc. London Math. Soc. 13 (1963).

use nalgebra::{Point3, Vector3};

use super::super::MorphError;
use super::super::bvh::SurfacePoint;
use super::quality::{is_collapsed, is_flipped};
use super::registration::Target;
use crate::mesh::{TriMesh, neighbors_of_vertices};
use plumbline_num::math::Lists;
use plumbline_num::run::Run;

/// Maximum iterations. Most folds are removed in the first dozen: of a horse on a camel 349 of 16 843 triangles remain after the first
/// iteration and 56 after 17, in the ears and between the legs; later iterations add more than they remove.
const MAX_ITERATIONS: usize = 30;
/// Iterations per additional ring around a persistent fold.
const ITERATIONS_PER_RING: u32 = 4;
/// Maximum rings around a fold: wider patches of thin parts reach around them.
const MAX_RINGS: u32 = 5;

/// Removes folds from `points`, one per vertex of `mesh`; vertices in `fixed` stay. Where the searches of `target` are used up, the best
/// iterate so far is the last.
pub(super) fn unfold(
    mesh: &TriMesh,
    target: &Target<'_>,
    fixed: &[bool],
    points: &mut Vec<SurfacePoint>,
    run: &Run,
) -> Result<(), MorphError> {
    let mut best = points.clone();
    let unfolded = improve(mesh, target, fixed, points, &mut best, run);
    *points = best;
    match unfolded {
        Err(MorphError::Layered { .. }) => Ok(()),
        unfolded => unfolded,
    }
}

/// Iterations from `points`, the best of which becomes `best`.
fn improve(
    mesh: &TriMesh,
    target: &Target<'_>,
    fixed: &[bool],
    points: &mut [SurfacePoint],
    best: &mut [SurfacePoint],
    run: &Run,
) -> Result<(), MorphError> {
    let around = Neighborhood::new(mesh);
    let mut folds = Folds::new(mesh, target, points)?;
    let mut fewest = folds.count();
    for _ in 0..MAX_ITERATIONS {
        if fewest == 0 {
            break;
        }
        let region = folds.region(mesh, &around, fixed);
        // Information propagates one ring per sweep from the boundary of a region.
        for _ in 0..=folds.rings() {
            for &v in &region {
                run.check()?;
                points[v as usize] = around.centroid(v, target, points)?;
            }
        }
        folds.update(mesh, target, points, &around, &region)?;
        if folds.count() < fewest {
            fewest = folds.count();
            best.copy_from_slice(points);
        }
    }
    Ok(())
}

/// Neighbors and triangles of each vertex.
struct Neighborhood {
    vertices: Vec<Vec<u32>>,
    triangles: Lists<u32>,
}

impl Neighborhood {
    fn new(mesh: &TriMesh) -> Self {
        let vertices = neighbors_of_vertices(mesh.vertex_count(), mesh.triangles());
        Self { vertices, triangles: mesh.triangles_of_vertices() }
    }

    /// The closest facing surface point to the centroid of a vertex's neighbors.
    fn centroid(&self, v: u32, target: &Target<'_>, points: &[SurfacePoint]) -> Result<SurfacePoint, MorphError> {
        let ring = &self.vertices[v as usize];
        let sum: Vector3<f64> = ring.iter().map(|w| points[*w as usize].point.coords).sum();
        let normal = |w: &u32| target.normal(points[*w as usize].triangle).try_normalize(0.0).unwrap_or_default();
        let facing: Vector3<f64> = ring.iter().map(normal).sum();
        target.closest_facing(&Point3::from(sum / ring.len() as f64), &facing)
    }
}

/// Folded triangles with their ages.
struct Folds {
    /// Non-degenerate triangles of the first surface; others are never folded.
    counts: Vec<bool>,
    /// Iterations for which each triangle has been folded; 0 if it is not.
    age: Vec<u32>,
    /// Area of the first surface.
    size: f64,
}

impl Folds {
    fn new(mesh: &TriMesh, target: &Target<'_>, points: &[SurfacePoint]) -> Result<Self, MorphError> {
        let longest =
            |t: usize| mesh.corners(t).iter().map(|p| (p - mesh.corners(t)[0]).norm_squared()).fold(0.0, f64::max);
        let has_area = |t: usize| mesh.area_normal(t).norm() > 1e-9 * longest(t);
        let m = mesh.triangle_count();
        let mut folds = Self { counts: (0..m).map(has_area).collect(), age: vec![0; m], size: mesh.area() };
        for t in 0..m {
            folds.age[t] = u32::from(folds.is_folded(t, mesh, target, points)?);
        }
        Ok(folds)
    }

    fn count(&self) -> usize {
        self.age.iter().filter(|a| **a > 0).count()
    }

    /// Rings around the oldest fold.
    fn rings(&self) -> u32 {
        self.age.iter().max().map_or(0, |age| rings(*age))
    }

    fn is_folded(
        &self,
        t: usize,
        mesh: &TriMesh,
        target: &Target<'_>,
        points: &[SurfacePoint],
    ) -> Result<bool, MorphError> {
        let corners = mesh.triangles()[t].map(|v| points[v as usize].point);
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        let collapsed = is_collapsed(normal.norm() / target.area(), mesh.area_normal(t).norm() / self.size);
        Ok(self.counts[t] && (collapsed || is_flipped(&corners, &normal, target)?))
    }

    /// Vertices of folds and of the rings around them, without fixed ones; ascending.
    fn region(&self, mesh: &TriMesh, around: &Neighborhood, fixed: &[bool]) -> Vec<u32> {
        // Remaining rings around each vertex.
        let mut reach: Vec<Option<u32>> = vec![None; mesh.vertex_count()];
        let mut levels: Vec<Vec<u32>> = vec![Vec::new(); MAX_RINGS as usize + 1];
        for (t, age) in self.age.iter().enumerate().filter(|(_, a)| **a > 0) {
            for &v in &mesh.triangles()[t] {
                reach[v as usize] = reach[v as usize].max(Some(rings(*age)));
                levels[rings(*age) as usize].push(v);
            }
        }
        for level in (1..levels.len()).rev() {
            for v in std::mem::take(&mut levels[level]) {
                for &w in &around.vertices[v as usize] {
                    if reach[w as usize] < Some(level as u32 - 1) {
                        reach[w as usize] = Some(level as u32 - 1);
                        levels[level - 1].push(w);
                    }
                }
            }
        }
        (0..reach.len() as u32).filter(|v| reach[*v as usize].is_some() && !fixed[*v as usize]).collect()
    }

    /// Updates the triangles of moved vertices.
    fn update(
        &mut self,
        mesh: &TriMesh,
        target: &Target<'_>,
        points: &[SurfacePoint],
        around: &Neighborhood,
        moved: &[u32],
    ) -> Result<(), MorphError> {
        let mut touched = vec![false; self.age.len()];
        for t in moved.iter().flat_map(|v| around.triangles.of(*v as usize)) {
            touched[*t as usize] = true;
        }
        for t in (0..touched.len()).filter(|t| touched[*t]) {
            self.age[t] = if self.is_folded(t, mesh, target, points)? { self.age[t] + 1 } else { 0 };
        }
        Ok(())
    }
}

fn rings(age: u32) -> u32 {
    (age.saturating_sub(1) / ITERATIONS_PER_RING).min(MAX_RINGS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    /// A sphere mapped to itself with a mirrored patch at the pole: a fold of many triangles.
    fn mirrored(ball: &TriMesh, reach: f64) -> Vec<SurfacePoint> {
        let target = Target::new(ball, "second", 0).unwrap();
        let point = |p: &Point3<f64>| {
            let inside = p.z > 0.0 && p.x.hypot(p.y) < reach;
            let q = if inside { Point3::new(-p.x, p.y, p.z) } else { *p };
            target.closest_facing(&q, &q.coords).unwrap()
        };
        ball.positions().iter().map(point).collect()
    }

    #[test]
    fn a_mirrored_patch_unfolds_and_fixed_vertices_stay() {
        let ball = shapes::icosphere(4);
        let target = Target::new(&ball, "second", 0).unwrap();
        for (reach, low) in [(0.12, 0.6), (0.25, 0.6), (0.4, 0.6), (0.7, 0.4), (0.8, 0.3)] {
            let mut points = mirrored(&ball, reach);
            let before = Folds::new(&ball, &target, &points).unwrap().count();
            let mut fixed = vec![false; ball.vertex_count()];
            let far = (0..fixed.len()).filter(|v| ball.positions()[*v].z < low);
            for v in far {
                fixed[v] = true;
            }
            unfold(&ball, &target, &fixed, &mut points, &Run::default()).unwrap();
            assert!(before > 10 && Folds::new(&ball, &target, &points).unwrap().count() == 0, "{reach}: of {before}");
            for (v, point) in points.iter().enumerate() {
                assert!(target.nearest(&point.point).unwrap().squared < 1e-20);
                assert!(!fixed[v] || (point.point - ball.positions()[v]).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn a_collapsed_patch_is_spread_and_a_degenerate_triangle_is_no_fold() {
        let ball = shapes::icosphere(4);
        let target = Target::new(&ball, "second", 0).unwrap();
        let pole = ball.positions().iter().copied().max_by(|p, q| p.z.total_cmp(&q.z)).unwrap();
        let near = |p: &Point3<f64>| (p - pole).norm() < 0.2;
        let put = |p: &Point3<f64>| target.closest_facing(if near(p) { &pole } else { p }, &p.coords).unwrap();
        let mut points: Vec<SurfacePoint> = ball.positions().iter().map(put).collect();
        let fixed: Vec<bool> = ball.positions().iter().map(|p| p.z < 0.6).collect();
        unfold(&ball, &target, &fixed, &mut points, &Run::default()).unwrap();
        for t in ball.triangles() {
            let [a, b, c] = t.map(|v| points[v as usize].point);
            assert!((b - a).cross(&(c - a)).dot(&a.coords) > 0.0);
        }
        let mut triangles = ball.triangles().to_vec();
        triangles.push([0, 1, 1]);
        let flat = TriMesh::new(ball.positions().to_vec(), triangles).unwrap();
        let points: Vec<SurfacePoint> =
            flat.positions().iter().map(|p| target.closest_facing(p, &p.coords).unwrap()).collect();
        assert_eq!(Folds::new(&flat, &target, &points).unwrap().count(), 0);
    }

    #[test]
    fn crossing_landmarks_do_not_add_folds() {
        let ball = shapes::icosphere(3);
        let target = Target::new(&ball, "second", 0).unwrap();
        let mut points = mirrored(&ball, 0.3);
        let before = Folds::new(&ball, &target, &points).unwrap().count();
        let fixed = vec![true; ball.vertex_count()];
        let start = points.clone();
        unfold(&ball, &target, &fixed, &mut points, &Run::default()).unwrap();
        assert!(before > 0 && points.iter().zip(&start).all(|(a, b)| a.point == b.point));
    }
}
