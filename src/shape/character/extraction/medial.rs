//! Maximal balls inside a surface that touch it at a vertex.
//!
//! For a vertex `p` with outward normal `n`, a ball with center `c = p − r n` shrinks until it contains no other vertex: with `q` the vertex
//! nearest to `c`, the ball through `p` and `q` has radius
//!
//! `r = ‖p − q‖² / 2 n·(p − q)`.
//!
//! It stops if the nearest vertex is as far as `p`, or if the angle between `p` and `q` seen from `c` is small: then `q` is a neighbor on a
//! bumpy surface, and the previous ball is kept. The centers are on the medial axis; they replace the Voronoi poles of the paper on mean
//! curvature skeletons, without a Delaunay tetrahedralization.
//!
//! # Reference
//! J. Ma, S. W. Bae, S. Choi, *3D medial axis point approximation using nearest neighbors and the normal field*, The Visual
//! Computer 28 (2012).

use nalgebra::{Point3, Vector3};

use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::KdTree;

/// Largest number of shrinking steps: the radius decreases each time; two or three steps are typical.
const MAX_ITERATIONS: usize = 20;
/// Cosine of the separation angle below which touching points are on one side: 40°. Below 25° bumps of scans get balls of their own; above
/// 60° ridges of thin parts lose theirs.
const MAX_SEPARATION_COSINE: f64 = 0.766;

/// Radius of unbounded balls, as a fraction of the largest: an open surface has no inside there, and its vertices are attracted to their own
/// positions.
const UNBOUNDED_RADIUS: f64 = 0.1;

/// A ball inside the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ball {
    pub(super) center: Point3<f64>,
    pub(super) radius: f64,
}

/// The ball of each vertex. `widest` bounds the radii: open surfaces have sides without an inside.
pub(super) fn balls(
    positions: &[Point3<f64>],
    normals: &[Vector3<f64>],
    widest: f64,
    run: &Run,
) -> Result<Vec<Ball>, Stopped> {
    let tree = KdTree::new(positions);
    let mut first = widest;
    let of = |(i, (p, n)): (usize, (&Point3<f64>, &Vector3<f64>))| {
        run.check()?;
        let ball = shrunk(i as u32, p, n, first, &tree, positions);
        // Consecutive vertices are often adjacent: the last radius gives a good initial guess.
        let start = first;
        first = (3.0 * ball.radius).min(widest);
        let ball = if ball.radius >= start { shrunk(i as u32, p, n, widest, &tree, positions) } else { ball };
        Ok(if ball.radius >= widest { Ball { center: *p, radius: UNBOUNDED_RADIUS * widest } } else { ball })
    };
    positions.iter().zip(normals).enumerate().map(of).collect()
}

fn shrunk(i: u32, p: &Point3<f64>, n: &Vector3<f64>, start: f64, tree: &KdTree, positions: &[Point3<f64>]) -> Ball {
    let mut ball = Ball { center: p - n * start, radius: start };
    for _ in 0..MAX_ITERATIONS {
        let inside = (ball.radius * (1.0 - 1e-6)).powi(2);
        let Some((q, _)) = tree.nearest_within(&ball.center, inside, |v| v != i) else { break };
        let away = p - positions[q as usize];
        let radius = away.norm_squared() / (2.0 * n.dot(&away));
        if !(radius > 0.0 && radius < ball.radius) {
            break;
        }
        let center = p - n * radius;
        let (to_p, to_q) = ((p - center).normalize(), (positions[q as usize] - center).normalize());
        if to_p.dot(&to_q) > MAX_SEPARATION_COSINE {
            break;
        }
        ball = Ball { center, radius };
    }
    ball
}
