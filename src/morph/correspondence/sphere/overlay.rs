//! One surface over another by way of the sphere.
//!
//! Both lie on the sphere; the first is turned so that landmarks are as near to each other as can be, then its landmarks go towards
//! those of the second, everything else relaxes, and nothing turns over. A vertex of the first then lies in a triangle of the second.

use nalgebra::{Matrix3, Point3, Vector3};

use super::super::super::MorphError;
use super::super::super::bvh::{Bvh, Nearest};
use super::super::super::rigid::nearest_similarity;
use super::{Ball, SphereOptions, sphere_map};
use crate::mesh::{HalfEdges, TriMesh};

/// Landmarks this near on the sphere have met.
const MET: f64 = 1e-12;

/// Where the vertices of `first` lie on `second`, through the sphere.
///
/// # Errors
/// As [`sphere_map`].
pub fn over_spheres(
    first: &TriMesh,
    second: &TriMesh,
    landmarks: &[(u32, u32)],
    options: &SphereOptions,
) -> Result<Vec<Nearest>, MorphError> {
    let goal = sphere_map(second, "second")?;
    let half_edges = HalfEdges::new(first)?;
    let mut ball = Ball {
        mesh: first,
        at: sphere_map(first, "first")?,
        rings: (0..first.vertex_count() as u32).map(|v| half_edges.neighbors(v).collect()).collect(),
        order: (0..first.vertex_count() as u32).collect(),
    };
    turn(&mut ball, &goal, landmarks);
    draw(&mut ball, &goal, landmarks, options.rounds);
    let sphere = second.with_positions(goal.iter().map(|p| Point3::from(*p)).collect())?;
    let bvh = Bvh::new(&sphere);
    let mut corner_of = vec![None; second.vertex_count()];
    for (t, v) in second.triangles().iter().enumerate() {
        v.iter().enumerate().for_each(|(k, v)| corner_of[*v as usize] = Some((t as u32, k)));
    }
    let mut vertex_of = vec![None; first.vertex_count()];
    for &(v, w) in landmarks {
        if (ball.at[v as usize] - goal[w as usize]).norm() <= MET {
            vertex_of[v as usize] = corner_of[w as usize];
        }
    }
    let place = |(v, at): (usize, &Vector3<f64>)| {
        let (triangle, weights) = vertex_of[v].map_or_else(
            || located(&bvh, &sphere, at),
            |(t, k)| (t, std::array::from_fn(|c| if c == k { 1.0 } else { 0.0 })),
        );
        let corners = second.corners(triangle as usize);
        let point: Vector3<f64> = corners.iter().zip(weights).map(|(p, w)| p.coords * w).sum();
        Nearest { triangle, weights, point: Point3::from(point), squared: 0.0 }
    };
    Ok(ball.at.iter().enumerate().map(place).collect())
}

/// Turns the first so that its landmarks are nearest to those of the second.
fn turn(ball: &mut Ball<'_>, goal: &[Vector3<f64>], landmarks: &[(u32, u32)]) {
    let from: Vec<_> = landmarks.iter().map(|l| Point3::from(ball.at[l.0 as usize])).collect();
    let to: Vec<_> = landmarks.iter().map(|l| Point3::from(goal[l.1 as usize])).collect();
    // About the center of the sphere: every landmark and its opposite.
    let both =
        |p: &[Point3<f64>]| p.iter().copied().chain(p.iter().map(|p| Point3::from(-p.coords))).collect::<Vec<_>>();
    let (map, rank) = nearest_similarity(&both(&from), &both(&to), &vec![1.0; 2 * from.len()], false);
    if rank > 1 {
        ball.at.iter_mut().for_each(|p| *p = (map.isometry.rotation * *p).normalize());
    }
}

/// Draws landmarks to their places.
fn draw(ball: &mut Ball<'_>, goal: &[Vector3<f64>], landmarks: &[(u32, u32)], rounds: usize) {
    let mut held = vec![false; ball.at.len()];
    for l in landmarks {
        held[l.0 as usize] = true;
    }
    for _ in 0..rounds {
        let mut met = true;
        for &(v, w) in landmarks {
            if (ball.at[v as usize] - goal[w as usize]).norm() > MET {
                met &= ball.step(v, &goal[w as usize]);
            }
        }
        if met {
            break;
        }
        ball.relax(&held);
    }
}

/// The triangle of a map on the sphere in which a direction lies, and its weights there.
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
