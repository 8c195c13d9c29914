//! Maps between two surfaces over the sphere.
//!
//! The second surface is embedded freely. The first is embedded towards its non-rigid registration on the second, as far as that is
//! bijective: every vertex has a target, with a penalty that grows after all vertices are reinserted. Without targets the limbs of the
//! two surfaces would be at different positions. Then landmarks move to their targets while the other vertices relax without
//! inversions. Each vertex of the first is now in a triangle of the second; landmarks that could not get there are simply set on their vertices,
//! since what follows unties the folds that this makes.
//!
//! Finally the vertices walk on the second surface to reduce the distortion of the map itself ([`relax`]), at first together with vertices
//! in the middle of edges that bulge. A triangle that reaches from one leg to the other does not show to its corners that the way
//! is long, over the crotch; those between do.
//!
//! What each of these is worth, on ten pairs of models, is in `docs/ABLATIONS.md`.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Point3, Vector3, center};

use super::super::super::MorphError;
use super::super::super::bvh::{Bvh, CORNERS, SurfacePoint};
use super::super::MAX_LANDMARK_ITERATIONS;
use super::super::refinement::{Edge, divided, edges};
use super::super::registration::{RegistrationOptions, corner_of_vertices, register};
use super::super::relaxation::relax;
use super::super::walk::Ground;
use super::stretch::Target;
use super::{SphereEmbedding, sphere_map};
use crate::mesh::operators::barycentric_areas;
use crate::mesh::{MeshError, TriMesh};
use plumbline_num::run::{Run, Stopped};

/// Distance on the sphere below which a landmark is at its target.
const COINCIDENT: f64 = 1e-12;

/// Maps the vertices of `first` to points on `second`, over the sphere.
///
/// # Errors
/// As [`sphere_map`].
pub fn over_spheres(
    first: &TriMesh,
    second: &TriMesh,
    landmarks: &[(u32, u32)],
    run: &Run,
) -> Result<Vec<SurfacePoint>, MorphError> {
    let goal = sphere_map(second, "second", run)?;
    let mut fixed = vec![false; first.vertex_count()];
    for l in landmarks {
        fixed[l.0 as usize] = true;
    }
    let targets = targets(first, second, &goal, landmarks, &fixed, run)?;
    let mut embedding = SphereEmbedding::new(first, "first", targets, &fixed, run)?;
    if embedding.targets.is_empty() {
        let pairs: Vec<_> = landmarks.iter().map(|&(v, w)| (v, goal[w as usize])).collect();
        embedding.rotate_to(&pairs);
    } else {
        increase_penalty(&mut embedding, run)?;
    }
    embedding.targets.clear();
    move_landmarks(&mut embedding, &goal, landmarks, &fixed, run)?;
    let sphere = second.with_positions(goal.iter().map(|p| Point3::from(*p)).collect())?;
    let bvh = Bvh::new(&sphere);
    let corner_of = corner_of_vertices(second);
    let mut vertex_of = vec![None; first.vertex_count()];
    for &(v, w) in landmarks {
        vertex_of[v as usize] = corner_of[w as usize];
    }
    let point = |(v, at): (usize, &Vector3<f64>)| {
        run.check()?;
        let exact = vertex_of[v].map(|(t, k): (u32, usize)| (t, CORNERS[k]));
        let (triangle, weights) = exact.unwrap_or_else(|| located(&bvh, &sphere, at));
        Ok(SurfacePoint::on(second, triangle, weights))
    };
    let points: Vec<SurfacePoint> = embedding.at.iter().enumerate().map(point).collect::<Result<_, MorphError>>()?;
    let on_sphere = |at: &Vector3<f64>| {
        let (triangle, weights) = located(&bvh, &sphere, at);
        SurfacePoint::on(second, triangle, weights)
    };
    let mut finer = Finer { mesh: first.clone(), at: embedding.at, points };
    for _ in 0..MAX_BISECTIONS {
        let bulging = finer.bulging(&on_sphere, MIN_BULGE * second.diagonal(), run)?;
        if bulging.is_empty() {
            break;
        }
        finer.bisect(bulging)?;
    }
    let Finer { mesh: finer, mut points, .. } = finer;
    let ground = Ground::new(second);
    fixed.resize(points.len(), false);
    relax(&finer, &ground, &mut points, &fixed, run)?;
    points.truncate(first.vertex_count());
    relax(first, &ground, &mut points, &fixed[..first.vertex_count()], run)?;
    Ok(points)
}

/// Bisections at most of edges that bulge.
const MAX_BISECTIONS: usize = 3;
/// Distance of the middle of an edge on the second surface from that of its ends, over their distance, above which it bulges.
const MAX_BULGE: f64 = 0.25;
/// The same in diagonals of the second surface: what is nearer is not seen.
const MIN_BULGE: f64 = 0.002;

/// The first surface with vertices in the middle of edges.
struct Finer {
    mesh: TriMesh,
    /// On the sphere.
    at: Vec<Vector3<f64>>,
    /// On the second surface.
    points: Vec<SurfacePoint>,
}

impl Finer {
    /// The edges whose middle on the sphere is far from the chord between their ends, with it.
    fn bulging(
        &self,
        on_sphere: &impl Fn(&Vector3<f64>) -> SurfacePoint,
        least: f64,
        run: &Run,
    ) -> Result<Vec<(Edge, Vector3<f64>, SurfacePoint)>, Stopped> {
        let mut bulging = Vec::new();
        for (a, b) in edges(&self.mesh) {
            run.check()?;
            let Some(at) = (self.at[a as usize] + self.at[b as usize]).try_normalize(1e-12) else { continue };
            let middle = on_sphere(&at);
            let [p, q] = [a, b].map(|v| self.points[v as usize].point);
            let off = (middle.point - center(&p, &q)).norm();
            if off > least.max(MAX_BULGE * (q - p).norm()) {
                bulging.push(((a, b), at, middle));
            }
        }
        Ok(bulging)
    }

    fn bisect(&mut self, bulging: Vec<(Edge, Vector3<f64>, SurfacePoint)>) -> Result<(), MeshError> {
        let mut positions = self.mesh.positions().to_vec();
        let mut middle_of = BTreeMap::new();
        for ((a, b), at, point) in bulging {
            middle_of.insert((a, b), positions.len() as u32);
            positions.push(center(&positions[a as usize], &positions[b as usize]));
            self.at.push(at);
            self.points.push(point);
        }
        let triangles = self.mesh.triangles().iter().flat_map(|t| divided(t, &middle_of)).collect();
        self.mesh = TriMesh::new(positions, triangles)?;
        Ok(())
    }
}

/// Weight of the target positions relative to the stretch energy (area squared). Smaller values leave limbs at their random initial
/// positions, from which landmarks cannot reach their targets.
const TARGET_WEIGHT: f64 = 1000.0;
/// Factor of the weight for landmarks.
const LANDMARK_FACTOR: f64 = 1000.0;
/// Number of tenfold increases of the weights.
const PENALTY_STEPS: usize = 4;
/// Relaxation sweeps after each increase.
const SWEEPS_PER_STEP: usize = 60;

/// Targets of all vertices from registration; none if the landmarks do not determine one.
fn targets(
    first: &TriMesh,
    second: &TriMesh,
    goal: &[Vector3<f64>],
    landmarks: &[(u32, u32)],
    fixed: &[bool],
    run: &Run,
) -> Result<Vec<Target>, MorphError> {
    let points = match register(first, second, landmarks, &RegistrationOptions::default(), run) {
        Err(MorphError::Landmarks { .. }) => return Ok(Vec::new()),
        registered => registered?,
    };
    let size = first.area();
    let target = |((point, area), fixed): ((&SurfacePoint, f64), &bool)| {
        let corners = second.triangles()[point.triangle as usize].iter().zip(point.weights);
        let middle: Vector3<f64> = corners.map(|(v, w)| goal[*v as usize] * w).sum();
        let weight = area * size * TARGET_WEIGHT * if *fixed { LANDMARK_FACTOR } else { 1.0 };
        Target { position: middle.try_normalize(0.0).unwrap_or_else(Vector3::z), weight }
    };
    Ok(points.iter().zip(barycentric_areas(first)).zip(fixed).map(target).collect())
}

/// Increases the weights of the targets in steps.
fn increase_penalty(embedding: &mut SphereEmbedding<'_>, run: &Run) -> Result<(), Stopped> {
    for _ in 0..PENALTY_STEPS {
        embedding.targets.iter_mut().for_each(|w| w.weight *= 10.0);
        for _ in 0..SWEEPS_PER_STEP {
            run.check()?;
            embedding.relax(&[]);
        }
    }
    Ok(())
}

/// Iterations between convergence checks of the landmarks.
const CHECK_INTERVAL: usize = 100;
/// Minimum relative decrease of the landmark error between checks; below it landmarks are stuck.
const MIN_DECREASE: f64 = 0.01;

/// Moves landmarks to their targets.
fn move_landmarks(
    embedding: &mut SphereEmbedding<'_>,
    goal: &[Vector3<f64>],
    landmarks: &[(u32, u32)],
    fixed: &[bool],
    run: &Run,
) -> Result<(), Stopped> {
    let mut last = f64::INFINITY;
    for iteration in 0..MAX_LANDMARK_ITERATIONS {
        run.check()?;
        let mut error = 0.0;
        for &(v, w) in landmarks {
            let distance = (embedding.at[v as usize] - goal[w as usize]).norm();
            if distance > COINCIDENT && !embedding.step(v, &goal[w as usize]) {
                error += distance;
            }
        }
        if error == 0.0 || iteration % CHECK_INTERVAL == CHECK_INTERVAL - 1 && !(error < (1.0 - MIN_DECREASE) * last) {
            break;
        }
        if iteration % CHECK_INTERVAL == CHECK_INTERVAL - 1 {
            last = error;
        }
        embedding.relax(fixed);
    }
    Ok(())
}

/// The triangle of a map on the sphere that contains a direction, and its barycentric coordinates.
fn located(bvh: &Bvh, sphere: &TriMesh, at: &Vector3<f64>) -> (u32, [f64; 3]) {
    let weights = |t: u32| {
        let [a, b, c] = sphere.corners(t as usize).map(|p| p.coords);
        let solved = Matrix3::from_columns(&[a, b, c]).try_inverse()? * at;
        let sum = solved.sum();
        (sum > 0.0).then(|| [solved[0] / sum, solved[1] / sum, solved[2] / sum])
    };
    let inside = |t: u32| weights(t).is_some_and(|w| w.iter().all(|w| *w >= -1e-9));
    let point = Point3::from(*at);
    let nearest = bvh.nearest(&point, inside).or_else(|| bvh.nearest(&point, |_| true));
    let triangle = nearest.map_or(0, |n| n.triangle);
    let clamped = weights(triangle).unwrap_or([1.0, 0.0, 0.0]).map(|w| w.max(0.0));
    let sum: f64 = clamped.iter().sum();
    (triangle, clamped.map(|w| w / sum))
}
