//! Extends the ends of the curve to the ends of the shape.
//!
//! At the end of a limb the maximal inscribed ball touches its tip: the medial axis ends at the ball's center. From an end `c` with branch
//! direction `d` the curve is extended while the distance to the surface ahead exceeds the radius `r`, i.e. while the ball can advance. After
//! each step the node is centered perpendicular to `d`, and `d` follows the path. The result ends at the center of the cap of a capsule, or
//! at the tip of a cone.
//!
//! Conversely, end nodes whose balls are inside the ball of an earlier node are removed, and so are those outside.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::curve_graph::CurveGraph;
use super::inside::radius;

/// Largest number of steps of an end.
const MAX_STEPS: usize = 80;
/// Step length, in radii.
const STEP_RADII: f64 = 0.25;
/// Smallest cosine of the total rotation of an end, 45°: it extends the limb, it does not search.
const MIN_DIRECTION_COSINE: f64 = 0.7;
/// Largest extension, in radii at the original end.
const MAX_EXTRAPOLATION: f64 = 4.0;
/// Length over which the direction of a branch is measured, in radii.
const DIRECTION_RADII: f64 = 1.0;
/// Weight of the last step in the direction.
const DIRECTION_UPDATE: f64 = 0.3;
/// Radius of a ball that counts as a tip, in radii of the sphere of equal area.
const MIN_BALL_RADIUS: f64 = 0.01;
/// Enlargement of a ball in containment tests.
const CONTAINMENT_FACTOR: f64 = 1.1;
/// Part of the way to the surface, or of the radius where that is shorter, by which ends are continued: at 1 the last node has no chords.
const MAX_REACH: f64 = 0.9;
/// Smallest distance ahead, in radii: ignores bumps.
const MIN_CLEARANCE_RADII: f64 = 1.1;

/// Makes the curve end at tips, each given with the node that it merged into: the first tip of an end moves it, others get ends of their
/// own.
pub(super) fn end_at(graph: &mut CurveGraph, tips: &[(u32, Point3<f64>)]) {
    let degrees: Vec<usize> = tips.iter().map(|(node, _)| graph.degree(*node)).collect();
    let mut moved = Vec::new();
    for (&(node, position), degree) in tips.iter().zip(degrees) {
        let around = graph.neighbors(node);
        match degree {
            0 => {
                graph.append(node, position);
            }
            1 if moved.contains(&node) => {
                graph.append(around[0], position);
            }
            1 => {
                graph.nodes[node as usize] = position;
                moved.push(node);
            }
            _ => {
                // The curve continues behind the tip that it was pulled to.
                let sum: Vector3<f64> = around.iter().map(|u| graph.nodes[*u as usize].coords).sum();
                graph.nodes[node as usize] = Point3::from(sum / around.len() as f64);
                graph.append(node, position);
            }
        }
    }
}

/// Removes end nodes that are not `inside`, and those beyond the farthest node whose ball contains all of theirs.
pub(super) fn trim(graph: &mut CurveGraph, tree: &AabbTree, inside: &dyn Fn(&Point3<f64>) -> bool) {
    for end in graph.free_ends() {
        let mut row = graph.row_back(end, f64::INFINITY);
        row.retain(|v| graph.degree(*v) < 3);
        let positions: Vec<Point3<f64>> = row.iter().map(|v| graph.nodes[*v as usize]).collect();
        let Some(first) = positions.iter().position(inside) else { continue };
        let balls: Vec<(Point3<f64>, f64)> = positions[first..].iter().map(|p| (*p, radius(tree, p))).collect();
        let holds = |i: &usize| {
            let (c, r) = balls[*i];
            balls[..*i].iter().all(|(p, s)| nalgebra::distance(p, &c) + s <= CONTAINMENT_FACTOR * r)
        };
        let last = first + (0..balls.len()).rev().find(holds).unwrap_or(0);
        for pair in row[..=last].windows(2) {
            graph.merge(pair[0], pair[1]);
        }
    }
}

/// Extends every end inside a closed surface as far as its ball can advance.
pub(super) fn extend(graph: &mut CurveGraph, tree: &AabbTree) {
    for end in graph.free_ends() {
        let Some(first) = direction(graph, tree, end) else { continue };
        let start = graph.nodes[end as usize];
        let farthest = MAX_EXTRAPOLATION * radius(tree, &start);
        let (mut at, mut direction, mut last) = (start, first, end);
        for _ in (0..MAX_STEPS).take_while(|_| !tree.is_exhausted()) {
            let Some((next, redirected)) = step(tree, &at, &direction) else { break };
            if redirected.dot(&first) < MIN_DIRECTION_COSINE || nalgebra::distance(&next, &start) > farthest {
                break;
            }
            last = graph.append(last, next);
            (at, direction) = (next, redirected);
        }
    }
}

/// Continues every end straight to the surface, at most by its radius: the energy bends this part, not the end of the limb.
pub(super) fn reach(graph: &mut CurveGraph, tree: &AabbTree, spacing: f64) {
    for end in graph.free_ends() {
        let Some(along) = direction(graph, tree, end) else { continue };
        let start = graph.nodes[end as usize];
        let Some(ahead) = tree.first_hit(&start, &along) else { continue };
        let length = MAX_REACH * ahead.min(radius(tree, &start));
        let parts = (length / spacing).ceil().max(2.0);
        let place = |k: usize| start + along * (length * k as f64 / parts);
        (1..=parts as usize).fold(end, |last, k| graph.append(last, place(k)));
    }
}

/// Direction of a branch at its end.
fn direction(graph: &CurveGraph, tree: &AabbTree, end: u32) -> Option<Vector3<f64>> {
    let row = graph.row_back(end, DIRECTION_RADII * radius(tree, &graph.nodes[end as usize]));
    (graph.nodes[end as usize] - graph.nodes[row[row.len() - 1] as usize]).try_normalize(1e-9)
}

fn step(tree: &AabbTree, at: &Point3<f64>, direction: &Vector3<f64>) -> Option<(Point3<f64>, Vector3<f64>)> {
    let r = radius(tree, at);
    let ahead = tree.first_hit(at, direction)?;
    if !(r > MIN_BALL_RADIUS && ahead > MIN_CLEARANCE_RADII * r && tree.encloses(at)) {
        return None;
    }
    let length = (STEP_RADII * r).max(MIN_BALL_RADIUS).min(0.5 * ahead);
    let moved = at + direction * length;
    let side = to_middle(tree, &moved);
    let next = moved + (side - direction * side.dot(direction));
    let travel = (next - at).try_normalize(1e-9)?;
    let redirected = (direction * (1.0 - DIRECTION_UPDATE) + travel * DIRECTION_UPDATE).try_normalize(1e-9)?;
    // If the path turns back there is no limb.
    (travel.dot(direction) > 0.5).then_some((next, redirected))
}

/// Step from a point inside to the middle of the chord from the nearest surface point, at most half the radius.
fn to_middle(tree: &AabbTree, c: &Point3<f64>) -> Vector3<f64> {
    let away = tree.nearest(c).map_or_else(Vector3::zeros, |p| c - p);
    let r = away.norm();
    let Some(away) = away.try_normalize(0.0) else { return away };
    tree.first_hit(c, &away).map_or_else(Vector3::zeros, |across| away * (0.5 * (across - r)).clamp(0.0, 0.5 * r))
}
