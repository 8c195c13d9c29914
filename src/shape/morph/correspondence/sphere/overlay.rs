//! One surface over another by way of the sphere.
//!
//! The second lies on the sphere as it likes; the first is laid out as it lies on the second after registration, as far as that is one to one:
//! every vertex is wanted there while vertices come back one by one, then more and more. Left alone, limbs of the two would lie in different
//! places. Then landmarks go the rest of their ways while everything else relaxes, and nothing turns over; and the rest is wanted once more
//! where it was, with the landmarks held. A vertex of the first lies in a triangle of the second.

use nalgebra::{Matrix3, Point3, Vector3};

use super::super::super::MorphError;
use super::super::super::bvh::{Bvh, Nearest};
use super::super::registration::{RegistrationOptions, register};
use super::stretch::Wish;
use super::{Ball, SphereOptions, sphere_map};
use crate::mesh::TriMesh;
use crate::mesh::operators::barycentric_areas;
use plumbline_num::run::{Run, Stopped};

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
    run: &Run,
) -> Result<Vec<Nearest>, MorphError> {
    let goal = sphere_map(second, "second", run)?;
    let mut held = vec![false; first.vertex_count()];
    for l in landmarks {
        held[l.0 as usize] = true;
    }
    let wishes = wishes(first, second, &goal, landmarks, &held, run)?;
    let mut ball = Ball::laid_out(first, "first", wishes.clone(), &held, run)?;
    if ball.wishes.is_empty() {
        let wanted: Vec<_> = landmarks.iter().map(|&(v, w)| (v, goal[w as usize])).collect();
        ball.turn(&wanted);
    } else {
        press(&mut ball, &[], run)?;
    }
    ball.wishes.clear();
    draw(&mut ball, &goal, landmarks, &held, options.rounds, run)?;
    ball.wishes = wishes;
    press(&mut ball, &held, run)?;
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
        run.check()?;
        let (triangle, weights) = vertex_of[v].map_or_else(
            || located(&bvh, &sphere, at),
            |(t, k)| (t, std::array::from_fn(|c| if c == k { 1.0 } else { 0.0 })),
        );
        let corners = second.corners(triangle as usize);
        let point: Vector3<f64> = corners.iter().zip(weights).map(|(p, w)| p.coords * w).sum();
        Ok(Nearest { triangle, weights, point: Point3::from(point), squared: 0.0 })
    };
    ball.at.iter().enumerate().map(place).collect()
}

/// How strongly vertices are wanted where registration laid them, per area of the first surface over the square of its size, and how much more
/// strongly landmarks are. Less leaves limbs where chance put them when there were few vertices, from where landmarks do not find their way.
const WANTED: f64 = 1000.0;
const LANDMARK: f64 = 1000.0;
/// Then it grows tenfold so many times, with so many rounds each.
const PRESSES: usize = 4;
const ROUNDS_PRESSED: usize = 60;

/// Every vertex is wanted where registration lays it; none where landmarks do not say how to register.
fn wishes(
    first: &TriMesh,
    second: &TriMesh,
    goal: &[Vector3<f64>],
    landmarks: &[(u32, u32)],
    held: &[bool],
    run: &Run,
) -> Result<Vec<Wish>, MorphError> {
    let places = match register(first, second, landmarks, &RegistrationOptions::default(), run) {
        Err(MorphError::Landmarks { .. }) => return Ok(Vec::new()),
        registered => registered?,
    };
    let size = first.area();
    let wish = |((place, area), held): ((&Nearest, f64), &bool)| {
        let corners = second.triangles()[place.triangle as usize].iter().zip(place.weights);
        let middle: Vector3<f64> = corners.map(|(v, w)| goal[*v as usize] * w).sum();
        let weight = area * size * WANTED * if *held { LANDMARK } else { 1.0 };
        Wish { place: middle.try_normalize(0.0).unwrap_or_else(Vector3::z), weight }
    };
    Ok(places.iter().zip(barycentric_areas(first)).zip(held).map(wish).collect())
}

/// Wants every vertex more and more where it is wanted.
fn press(ball: &mut Ball<'_>, held: &[bool], run: &Run) -> Result<(), Stopped> {
    if ball.wishes.is_empty() {
        return Ok(());
    }
    for _ in 0..PRESSES {
        ball.wishes.iter_mut().for_each(|w| w.weight *= 10.0);
        for _ in 0..ROUNDS_PRESSED {
            run.check()?;
            ball.relax(held);
        }
    }
    Ok(())
}

/// Rounds after which landmarks must have come nearer to their places by [`NEARER`], or they never will.
const PATIENCE: usize = 100;
const NEARER: f64 = 0.01;

/// Draws landmarks to their places, for so many rounds at most.
fn draw(
    ball: &mut Ball<'_>,
    goal: &[Vector3<f64>],
    landmarks: &[(u32, u32)],
    held: &[bool],
    rounds: usize,
    run: &Run,
) -> Result<(), Stopped> {
    let mut last = f64::INFINITY;
    for round in 0..rounds {
        run.check()?;
        let mut off = 0.0;
        for &(v, w) in landmarks {
            let missing = (ball.at[v as usize] - goal[w as usize]).norm();
            if missing > MET && !ball.step(v, &goal[w as usize]) {
                off += missing;
            }
        }
        if off == 0.0 || round % PATIENCE == PATIENCE - 1 && !(off < (1.0 - NEARER) * last) {
            break;
        }
        if round % PATIENCE == PATIENCE - 1 {
            last = off;
        }
        ball.relax(held);
    }
    Ok(())
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
