//! Brings the curve to the middle of the shape, as a whole.
//!
//! With `p` the point of the surface nearest to a node `c`, `r₁ = ‖c − p‖` and `r₂` how far the surface is on the other side, along the
//! ray from `p` through `c`,
//!
//! `c ← c + (r₂ − r₁)/2 · (c − p)/r₁`
//!
//! is the middle of that chord; repeated, it comes to rest at the center of a maximal inscribed ball. Node by node this would tear
//! the curve: neighbors in a wide part have other nearest sides and would run to different sheets of the medial axis. The steps
//! are therefore taken across the curve, no longer than a share of `r₁`, and evened out along it before they are made; then the curve is
//! smoothed a little along itself. Both pull against each other without end where the shape is wide: in pass `k` steps are shortened to
//! `1 / (1 + k/2)`, which leaves the curve nearer to the middle. A node outside steps through the nearest point to the middle beyond it, or as
//! far as the shape is wide there.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::error::ExtractionError;
use super::fairing::Fairing;
use super::order::Cost;
use super::web::Web;
use plumbline_num::run::Run;

/// Over how many radii steps agree.
pub(super) const AGREE: f64 = 0.5;
/// Over how many radii the curve is smoothed in each pass.
const SMOOTH: f64 = 0.2;
/// A step is at most this share of the distance to the surface.
const MAX_STEP: f64 = 0.5;
/// How fast steps become shorter from pass to pass. At 0 and at 1 the curve is farther from the middle on all of eleven models:
/// centeredness of a horse .67 and .71, here .73.
const FADING: f64 = 0.5;
/// Times that an edge which passes outside is split.
const SPLITS: usize = 5;
/// Steps by which a place outside comes in: one is the rule, folds of the surface take more.
const STEPS_IN: usize = 4;
/// Ways across an edge that passes outside: one of them meets the floor of a cleft within 12°.
const WAYS: usize = 16;
/// How far behind where an edge meets the surface the next meeting is looked for, as a share of the edge.
const BEYOND: f64 = 1e-6;

/// Distance to the surface.
pub(super) fn radius(tree: &AabbTree, c: &Point3<f64>) -> f64 {
    tree.nearest(c).map_or(0.0, |p| nalgebra::distance(c, &p))
}

/// Likewise for each node of a curve.
pub(super) fn radii(web: &Web, tree: &AabbTree) -> Vec<f64> {
    distances(web, &nearest(web, tree))
}

/// Distance of each node to the point of the surface nearest to it.
pub(super) fn distances(web: &Web, nearest: &[Option<Point3<f64>>]) -> Vec<f64> {
    web.nodes.iter().zip(nearest).map(|(c, p)| p.map_or(0.0, |p| nalgebra::distance(c, &p))).collect()
}

/// The point of the surface nearest to each node of a curve.
pub(super) fn nearest(web: &Web, tree: &AabbTree) -> Vec<Option<Point3<f64>>> {
    let mut all = vec![None; web.nodes.len()];
    let mut last = None;
    for v in web.alive() {
        let c = &web.nodes[v as usize];
        // Nodes in a row are near to each other.
        last = match last {
            Some(guess) => Some(tree.nearest_from(c, &guess)),
            None => tree.nearest(c),
        };
        all[v as usize] = last;
    }
    all
}

/// Moves all nodes but pinned ones toward the middle, and back in where that took them out. Only a `closed` surface has an outside.
pub(super) fn center(
    web: &mut Web,
    tree: &AabbTree,
    closed: bool,
    passes: usize,
    run: &Run,
) -> Result<(), ExtractionError> {
    let alive: Vec<u32> = web.alive().collect();
    let pinned = web.pinned.clone();
    let mut feet: Vec<Option<Foot>> = vec![None; web.nodes.len()];
    for pass in 0..passes {
        run.check()?;
        let share = 1.0 / (1.0 + FADING * pass as f64);
        let mut radii = vec![0.0; web.nodes.len()];
        let mut steps = vec![Vector3::zeros(); web.nodes.len()];
        for &v in &alive {
            let foot = &mut feet[v as usize];
            *foot = Foot::of(&web.nodes[v as usize], tree, closed, foot.as_ref());
            let Some(foot) = foot else { continue };
            radii[v as usize] = foot.radius;
            let (step, along) = (foot.step(tree), tangent(web, v));
            steps[v as usize] = step - along * step.dot(&along);
        }
        Fairing::new(web, &alive, &radii, AGREE, |_| false, run)?.apply(&mut steps);
        for &v in alive.iter().filter(|v| !pinned[**v as usize]) {
            web.nodes[v as usize] += steps[v as usize] * share;
        }
        smooth(web, &alive, &radii, SMOOTH, run)?;
    }
    if closed {
        bring_nodes_in(web, tree);
    }
    Ok(())
}

/// Smooths the curve over a share of the radius about it; ends stay.
fn smooth(web: &mut Web, alive: &[u32], radii: &[f64], share: f64, run: &Run) -> Result<(), ExtractionError> {
    let held = |v: u32| web.pinned[v as usize] || web.degree(v) < 2;
    let mut fairing = Fairing::new(web, alive, radii, share, held, run)?;
    let free: Vec<u32> = alive.iter().copied().filter(|v| !held(*v)).collect();
    let mut places: Vec<Vector3<f64>> = web.nodes.iter().map(|p| p.coords).collect();
    fairing.apply(&mut places);
    for v in free {
        web.nodes[v as usize] = Point3::from(places[v as usize]);
    }
    Ok(())
}

/// Brings nodes of a closed surface that are outside back in.
fn bring_nodes_in(web: &mut Web, tree: &AabbTree) {
    for v in web.alive().filter(|v| !web.pinned[*v as usize]).collect::<Vec<_>>() {
        let place = web.nodes[v as usize];
        if !tree.encloses(&place) {
            web.nodes[v as usize] = brought_in(tree, place).unwrap_or(place);
        }
    }
}

/// Likewise, and the middles of where edges pass outside.
pub(super) fn keep_inside(web: &mut Web, tree: &AabbTree) {
    bring_nodes_in(web, tree);
    let joined = |v: u32| web.neighbors(v).iter().filter(move |u| v < **u).map(move |u| (v, *u, SPLITS));
    let mut edges: Vec<(u32, u32, usize)> = web.alive().flat_map(joined).collect();
    while let Some((a, b, splits)) = edges.pop() {
        let (p, q) = (web.nodes[a as usize], web.nodes[b as usize]);
        let outside = outside(tree, &p, &q).filter(|_| splits > 0);
        if let Some(inside) = outside.and_then(|place| way_round(tree, &p, &q, &place)) {
            let new = web.split(a, b, inside);
            edges.extend([(a, new, splits - 1), (new, b, splits - 1)]);
        }
    }
}

/// The middle of where the line from `p` to `q` first runs outside.
fn outside(tree: &AabbTree, p: &Point3<f64>, q: &Point3<f64>) -> Option<Point3<f64>> {
    let way = q - p;
    let mut leaves = tree.first_hit(p, &way).filter(|t| *t < 1.0)?;
    // A surface that intersects itself is met from inside, too.
    loop {
        let beyond = leaves + BEYOND;
        let enters = tree.first_hit(&(p + way * beyond), &way).map_or(1.0, |t| (beyond + t).min(1.0));
        let place = p + way * (0.5 * (leaves + enters));
        if !tree.encloses(&place) {
            return Some(place);
        }
        if enters >= 1.0 {
            return None;
        }
        leaves = enters;
    }
}

/// The place inside by which the way from `p` to `q` around `outside` is shortest, among those in the middle beyond the surface across the
/// line.
fn way_round(tree: &AabbTree, p: &Point3<f64>, q: &Point3<f64>, outside: &Point3<f64>) -> Option<Point3<f64>> {
    let along = (q - p).try_normalize(0.0)?;
    let side = along.cross(&Vector3::ith(along.iamin(), 1.0)).normalize();
    let other = along.cross(&side);
    let beyond = |k: usize| {
        let angle = std::f64::consts::TAU * k as f64 / WAYS as f64;
        let across = side * angle.cos() + other * angle.sin();
        let enters = tree.first_hit(outside, &across)? * (1.0 + BEYOND);
        let leaves = tree.first_hit(&(outside + across * enters), &across)?;
        let place = outside + across * (enters + 0.5 * leaves);
        tree.encloses(&place).then_some(place)
    };
    let detour = |x: &Point3<f64>| Cost::new(nalgebra::distance(p, x) + nalgebra::distance(x, q));
    (0..WAYS).filter_map(beyond).min_by_key(detour).or_else(|| brought_in(tree, *outside))
}

/// A place inside that steps from `place` lead to.
fn brought_in(tree: &AabbTree, place: Point3<f64>) -> Option<Point3<f64>> {
    let mut at = place;
    (0..STEPS_IN).find_map(|_| {
        at += step(tree, true, &at);
        tree.encloses(&at).then_some(at)
    })
}

/// The way from a place inside to the middle of its chord.
pub(super) fn across(tree: &AabbTree, c: &Point3<f64>) -> Vector3<f64> {
    step(tree, false, c)
}

fn step(tree: &AabbTree, closed: bool, c: &Point3<f64>) -> Vector3<f64> {
    Foot::of(c, tree, closed, None).map_or_else(Vector3::zeros, |foot| foot.step(tree))
}

/// Where the surface is nearest to a place.
#[derive(Clone, Copy)]
struct Foot {
    place: Point3<f64>,
    nearest: Point3<f64>,
    radius: f64,
    inside: bool,
}

impl Foot {
    /// Of a place that was where the foot `before` is of: what is known of that one makes it cheaper.
    fn of(place: &Point3<f64>, tree: &AabbTree, closed: bool, before: Option<&Self>) -> Option<Self> {
        let nearest = match before {
            Some(foot) => tree.nearest_from(place, &foot.nearest),
            None => tree.nearest(place)?,
        };
        // No surface passes through the ball about a place.
        let still = |foot: &Self| foot.inside && nalgebra::distance(place, &foot.place) < foot.radius;
        let inside = !closed || before.is_some_and(still) || tree.encloses(place);
        Some(Self { place: *place, nearest, radius: nalgebra::distance(place, &nearest), inside })
    }

    /// The way from the place to the middle of its chord.
    fn step(&self, tree: &AabbTree) -> Vector3<f64> {
        let Some(away) = (self.place - self.nearest).try_normalize(0.0) else { return Vector3::zeros() };
        if !self.inside {
            let start = self.nearest - away * (1e-6 + 1e-3 * self.radius);
            let beyond = tree.first_hit(&start, &-away).unwrap_or(0.0);
            let middle = start - away * (0.5 * beyond);
            let depth = radius(tree, &middle).min(0.5 * beyond);
            return self.nearest - self.place - away * depth;
        }
        let Some(across) = tree.first_hit(&self.place, &away) else { return Vector3::zeros() };
        away * (0.5 * (across - self.radius)).clamp(0.0, MAX_STEP * self.radius)
    }
}

/// Direction of the curve at a node with two neighbors; zero at ends and junctions, which move freely.
pub(super) fn tangent(web: &Web, v: u32) -> Vector3<f64> {
    match web.neighbors(v) {
        [a, b] => (web.nodes[*b as usize] - web.nodes[*a as usize]).try_normalize(0.0).unwrap_or_default(),
        _ => Vector3::zeros(),
    }
}
