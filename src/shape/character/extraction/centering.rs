//! Moves the curve to the medial axis.
//!
//! With `p` the surface point nearest to a node `c`, `r₁ = ‖c − p‖` and `r₂` the distance to the opposite side along the ray from `p` through
//! `c`,
//!
//! `c ← c + (r₂ − r₁)/2 · (c − p)/r₁`
//!
//! moves the node to the midpoint of the chord; iterated, it converges to the center of a maximal inscribed ball. Node by node this would
//! tear the curve: neighbors in a wide part have different nearest sides and converge to different sheets of the medial axis. Steps are
//! therefore taken perpendicular to the curve, limited to a fraction of `r₁`, and smoothed along the curve; then the curve itself is
//! smoothed a little. Both compete without convergence where the shape is wide: in pass `k` steps are damped by `1 / (1 + k/2)`, which
//! leaves the curve closer to the medial axis. A node outside moves through the nearest point to the midpoint beyond it, at most by the
//! local thickness.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::curve_graph::CurveGraph;
use super::fairing::Fairing;
use super::order::Cost;
use crate::character::CharacterError;
use plumbline_num::run::Run;

/// Smoothing width of the steps, in radii.
const STEP_SMOOTHING_RADII: f64 = 0.5;
/// Smoothing width of the curve in each pass, in radii.
const CURVE_SMOOTHING_RADII: f64 = 0.2;
/// Largest step, as a fraction of the distance to the surface.
const MAX_STEP: f64 = 0.5;
/// Damping of the steps per pass. At 0 and at 1 the curve is farther from the medial axis on all of eleven models: centeredness of a horse
/// .67 and .71, here .73.
const STEP_DAMPING: f64 = 0.5;
/// Largest number of subdivisions of an edge that passes outside.
const MAX_SPLITS: usize = 5;
/// Largest number of steps to bring a point inside: one is typical, folds of the surface need more.
const MAX_STEPS_INSIDE: usize = 4;
/// Number of directions across an edge that passes outside: one of them is within 12° of the floor of a cleft.
const DIRECTIONS: usize = 16;
/// Offset beyond an intersection before the search for the next, as a fraction of the edge.
const RAY_OFFSET: f64 = 1e-6;

/// Distance to the surface.
pub(super) fn radius(tree: &AabbTree, c: &Point3<f64>) -> f64 {
    tree.nearest(c).map_or(0.0, |p| nalgebra::distance(c, &p))
}

/// Distance to the surface for each node of a curve.
pub(super) fn radii(graph: &CurveGraph, tree: &AabbTree) -> Vec<f64> {
    distances(graph, &nearest(graph, tree))
}

/// Distance of each node to its nearest surface point.
fn distances(graph: &CurveGraph, nearest: &[Option<Point3<f64>>]) -> Vec<f64> {
    graph.nodes.iter().zip(nearest).map(|(c, p)| p.map_or(0.0, |p| nalgebra::distance(c, &p))).collect()
}

/// The surface point nearest to each node of a curve.
fn nearest(graph: &CurveGraph, tree: &AabbTree) -> Vec<Option<Point3<f64>>> {
    let mut all = vec![None; graph.nodes.len()];
    let mut last = None;
    for v in graph.alive() {
        let c = &graph.nodes[v as usize];
        // Consecutive nodes are close: the last result is a good guess.
        last = match last {
            Some(guess) => Some(tree.nearest_from(c, &guess)),
            None => tree.nearest(c),
        };
        all[v as usize] = last;
    }
    all
}

/// Moves all nodes except pinned ones toward the medial axis; for a `closed` surface nodes that end up outside are brought back in.
pub(super) fn center(
    graph: &mut CurveGraph,
    tree: &AabbTree,
    closed: bool,
    passes: usize,
    run: &Run,
) -> Result<(), CharacterError> {
    let alive: Vec<u32> = graph.alive().collect();
    let pinned = graph.pinned.clone();
    let mut feet: Vec<Option<Foot>> = vec![None; graph.nodes.len()];
    for pass in 0..passes {
        run.check()?;
        if tree.is_exhausted() {
            break;
        }
        let share = 1.0 / (1.0 + STEP_DAMPING * pass as f64);
        let mut radii = vec![0.0; graph.nodes.len()];
        let mut steps = vec![Vector3::zeros(); graph.nodes.len()];
        for &v in &alive {
            let foot = &mut feet[v as usize];
            *foot = Foot::of(&graph.nodes[v as usize], tree, closed, foot.as_ref());
            let Some(foot) = foot else { continue };
            radii[v as usize] = foot.radius;
            let (step, along) = (foot.step(tree), tangent(graph, v));
            steps[v as usize] = step - along * step.dot(&along);
        }
        Fairing::new(graph, &alive, &radii, STEP_SMOOTHING_RADII, |_| false, run)?.apply(&mut steps);
        for &v in alive.iter().filter(|v| !pinned[**v as usize]) {
            graph.nodes[v as usize] += steps[v as usize] * share;
        }
        smooth(graph, &alive, &radii, CURVE_SMOOTHING_RADII, run)?;
    }
    if closed {
        bring_nodes_in(graph, tree);
    }
    Ok(())
}

/// Smooths the curve over a fraction of the local radius; ends are fixed.
fn smooth(graph: &mut CurveGraph, alive: &[u32], radii: &[f64], share: f64, run: &Run) -> Result<(), CharacterError> {
    let fixed = |v: u32| graph.pinned[v as usize] || graph.degree(v) < 2;
    let mut fairing = Fairing::new(graph, alive, radii, share, fixed, run)?;
    let free: Vec<u32> = alive.iter().copied().filter(|v| !fixed(*v)).collect();
    let mut positions: Vec<Vector3<f64>> = graph.nodes.iter().map(|p| p.coords).collect();
    fairing.apply(&mut positions);
    for v in free {
        graph.nodes[v as usize] = Point3::from(positions[v as usize]);
    }
    Ok(())
}

/// Brings nodes outside a closed surface back inside.
pub(super) fn bring_nodes_in(graph: &mut CurveGraph, tree: &AabbTree) {
    for v in graph.alive().filter(|v| !graph.pinned[*v as usize]).collect::<Vec<_>>() {
        let position = graph.nodes[v as usize];
        if !tree.encloses(&position) {
            graph.nodes[v as usize] = brought_in(tree, position).unwrap_or(position);
        }
    }
}

/// Brings nodes inside and splits edges that pass outside.
pub(super) fn keep_inside(graph: &mut CurveGraph, tree: &AabbTree) {
    bring_nodes_in(graph, tree);
    let joined = |v: u32| graph.neighbors(v).iter().filter(move |u| v < **u).map(move |u| (v, *u, MAX_SPLITS));
    let mut edges: Vec<(u32, u32, usize)> = graph.alive().flat_map(joined).collect();
    while let Some((a, b, splits)) = edges.pop().filter(|_| !tree.is_exhausted()) {
        let (p, q) = (graph.nodes[a as usize], graph.nodes[b as usize]);
        let outside = outside(tree, &p, &q).filter(|_| splits > 0);
        if let Some(inside) = outside.and_then(|position| detour_around(tree, &p, &q, &position)) {
            let new = graph.split(a, b, inside);
            edges.extend([(a, new, splits - 1), (new, b, splits - 1)]);
        }
    }
}

/// Midpoint of the first part of the segment from `p` to `q` that is outside.
fn outside(tree: &AabbTree, p: &Point3<f64>, q: &Point3<f64>) -> Option<Point3<f64>> {
    let along = q - p;
    let mut leaves = tree.first_hit(p, &along).filter(|t| *t < 1.0)?;
    // A self-intersecting surface also has intersections with the inside on both sides.
    loop {
        let beyond = leaves + RAY_OFFSET;
        let enters = tree.first_hit(&(p + along * beyond), &along).map_or(1.0, |t| (beyond + t).min(1.0));
        let position = p + along * (0.5 * (leaves + enters));
        if !tree.encloses(&position) {
            return Some(position);
        }
        if enters >= 1.0 || tree.is_exhausted() {
            return None;
        }
        leaves = enters;
    }
}

/// The inside point that gives the shortest path from `p` to `q` around `outside`, among midpoints of chords beyond the surface in directions
/// perpendicular to the segment.
fn detour_around(tree: &AabbTree, p: &Point3<f64>, q: &Point3<f64>, outside: &Point3<f64>) -> Option<Point3<f64>> {
    let along = (q - p).try_normalize(0.0)?;
    let side = along.cross(&Vector3::ith(along.iamin(), 1.0)).normalize();
    let other = along.cross(&side);
    let beyond = |k: usize| {
        let angle = std::f64::consts::TAU * k as f64 / DIRECTIONS as f64;
        let across = side * angle.cos() + other * angle.sin();
        let enters = tree.first_hit(outside, &across)? * (1.0 + RAY_OFFSET);
        let leaves = tree.first_hit(&(outside + across * enters), &across)?;
        let position = outside + across * (enters + 0.5 * leaves);
        tree.encloses(&position).then_some(position)
    };
    let detour = |x: &Point3<f64>| Cost::new(nalgebra::distance(p, x) + nalgebra::distance(x, q));
    (0..DIRECTIONS).filter_map(beyond).min_by_key(detour).or_else(|| brought_in(tree, *outside))
}

/// An inside point reached by centering steps.
fn brought_in(tree: &AabbTree, position: Point3<f64>) -> Option<Point3<f64>> {
    let mut at = position;
    (0..MAX_STEPS_INSIDE).find_map(|_| {
        at += step(tree, true, &at);
        tree.encloses(&at).then_some(at)
    })
}

/// Step from an inside point to the midpoint of its chord.
pub(super) fn across(tree: &AabbTree, c: &Point3<f64>) -> Vector3<f64> {
    step(tree, false, c)
}

fn step(tree: &AabbTree, closed: bool, c: &Point3<f64>) -> Vector3<f64> {
    Foot::of(c, tree, closed, None).map_or_else(Vector3::zeros, |foot| foot.step(tree))
}

/// The nearest surface point of a query point.
#[derive(Clone, Copy)]
struct Foot {
    position: Point3<f64>,
    nearest: Point3<f64>,
    radius: f64,
    inside: bool,
}

impl Foot {
    /// Computes it; `before` is the foot of the same node in the previous pass, which speeds up the search.
    fn of(position: &Point3<f64>, tree: &AabbTree, closed: bool, before: Option<&Self>) -> Option<Self> {
        let nearest = match before {
            Some(foot) => tree.nearest_from(position, &foot.nearest),
            None => tree.nearest(position)?,
        };
        // The inscribed ball contains no surface: an inside point that stays within it stays inside.
        let still = |foot: &Self| foot.inside && nalgebra::distance(position, &foot.position) < foot.radius;
        let inside = !closed || before.is_some_and(still) || tree.encloses(position);
        Some(Self { position: *position, nearest, radius: nalgebra::distance(position, &nearest), inside })
    }

    /// Step to the midpoint of the chord.
    fn step(&self, tree: &AabbTree) -> Vector3<f64> {
        let Some(away) = (self.position - self.nearest).try_normalize(0.0) else { return Vector3::zeros() };
        if !self.inside {
            let start = self.nearest - away * (1e-6 + 1e-3 * self.radius);
            let beyond = tree.first_hit(&start, &-away).unwrap_or(0.0);
            let middle = start - away * (0.5 * beyond);
            let depth = radius(tree, &middle).min(0.5 * beyond);
            return self.nearest - self.position - away * depth;
        }
        let Some(across) = tree.first_hit(&self.position, &away) else { return Vector3::zeros() };
        away * (0.5 * (across - self.radius)).clamp(0.0, MAX_STEP * self.radius)
    }
}

/// Direction of the curve at a node with two neighbors; zero at ends and junctions, whose steps are not projected.
fn tangent(graph: &CurveGraph, v: u32) -> Vector3<f64> {
    match graph.neighbors(v) {
        [a, b] => (graph.nodes[*b as usize] - graph.nodes[*a as usize]).try_normalize(0.0).unwrap_or_default(),
        _ => Vector3::zeros(),
    }
}
