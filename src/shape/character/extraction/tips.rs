//! Ends of the curve are brought to where the shape ends.
//!
//! At the end of a limb the largest ball inside touches its tip: a curve through the middle ends at its center. From an end `c` with the
//! direction `d` of its branch, the curve goes on as long as the way to the surface ahead is longer than the radius `r`: as far as the
//! ball can roll on. After each step the node is brought to the middle across `d`, and `d` follows the way that it took. Where it ends is
//! the center of the cap of a capsule, and the tip of a cone.
//!
//! The other way round, end nodes whose balls lie inside the ball of one node before them say nothing and are taken away, and so are those
//! that have come outside. Within the last ball, where no place is more in the middle than others, the branch goes on as it bends before.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::centering::{across, radius};
use super::web::Web;

/// Steps of an end at most.
const STEPS: usize = 80;
/// Length of a step, in radii.
const STEP: f64 = 0.25;
/// Cosine of the angle that an end turns at most, 45°: it goes on, it does not seek.
const STRAIGHT: f64 = 0.7;
/// How far it goes, in radii at the end that was.
const MAX_EXTRAPOLATION: f64 = 4.0;
/// The direction of a branch is that over this many radii before its end.
const LOOK_BACK: f64 = 1.0;
/// How far the direction turns to the way taken, per step.
const TURN: f64 = 0.3;
/// A ball smaller than this is a tip, in radii of the sphere of equal area.
const POINT: f64 = 0.01;
/// An end is inside the ball before where it is inside one larger by this factor.
const WITHIN: f64 = 1.1;
/// The way ahead must be longer than this many radii: bumps do not count.
const ROOM: f64 = 1.1;

/// Makes the curve end at the places of tips, each with the node that it became part of: an end goes to the first of its tips, the others
/// get ends of their own.
pub(super) fn end_at(web: &mut Web, tips: &[(u32, Point3<f64>)]) {
    let degrees: Vec<usize> = tips.iter().map(|(node, _)| web.degree(*node)).collect();
    let mut moved = Vec::new();
    for (&(node, place), degree) in tips.iter().zip(degrees) {
        let around = web.neighbors(node);
        match degree {
            0 => {
                web.append(node, place);
            }
            1 if moved.contains(&node) => {
                web.append(around[0], place);
            }
            1 => {
                web.nodes[node as usize] = place;
                moved.push(node);
            }
            _ => {
                // The curve runs on behind the tip that it was drawn to.
                let sum: Vector3<f64> = around.iter().map(|u| web.nodes[*u as usize].coords).sum();
                web.nodes[node as usize] = Point3::from(sum / around.len() as f64);
                web.append(node, place);
            }
        }
    }
}

/// Takes end nodes away that are not `inside`, and those beyond the farthest node whose ball holds all of theirs.
pub(super) fn trim(web: &mut Web, tree: &AabbTree, inside: &dyn Fn(&Point3<f64>) -> bool) {
    for end in web.free_ends() {
        let mut row = web.row_back(end, f64::INFINITY);
        row.retain(|v| web.degree(*v) < 3);
        let places: Vec<Point3<f64>> = row.iter().map(|v| web.nodes[*v as usize]).collect();
        let Some(first) = places.iter().position(inside) else { continue };
        let balls: Vec<(Point3<f64>, f64)> = places[first..].iter().map(|p| (*p, radius(tree, p))).collect();
        let holds = |i: &usize| {
            let (c, r) = balls[*i];
            balls[..*i].iter().all(|(p, s)| nalgebra::distance(p, &c) + s <= WITHIN * r)
        };
        let last = first + (0..balls.len()).rev().find(holds).unwrap_or(0);
        for pair in row[..=last].windows(2) {
            web.merge(pair[0], pair[1]);
        }
    }
}

/// Lets every end inside a closed surface go on as far as its ball can.
pub(super) fn extend(web: &mut Web, tree: &AabbTree) {
    for end in web.free_ends() {
        let Some(first) = direction(web, tree, end) else { continue };
        let start = web.nodes[end as usize];
        let farthest = MAX_EXTRAPOLATION * radius(tree, &start);
        let (mut at, mut direction, mut last) = (start, first, end);
        for _ in 0..STEPS {
            let Some((next, turned)) = step(tree, &at, &direction) else { break };
            if turned.dot(&first) < STRAIGHT || nalgebra::distance(&next, &start) > farthest {
                break;
            }
            last = web.append(last, next);
            (at, direction) = (next, turned);
        }
    }
}

/// Lets the last radius of every branch go on as the two before it bend: in the ball at the end of a limb all places are about as far from
/// the surface, and facets decide where the middle is. Where its balls would become smaller, the branch stays.
pub(super) fn go_on(web: &mut Web, tree: &AabbTree) {
    for end in web.free_ends() {
        let reach = LOOK_BACK * radius(tree, &web.nodes[end as usize]);
        let row = web.row_back(end, 3.0 * reach);
        let far = |k: f64| row.iter().position(|v| web.length(end, *v) >= k * reach);
        let [Some(base), Some(middle), Some(from)] = [1.0, 2.0, 3.0].map(far) else { continue };
        if base == middle || middle == from {
            continue;
        }
        let bend = Parabola::through([from, middle, base].map(|i| web.nodes[row[i] as usize]));
        let places: Vec<Point3<f64>> = row[..base].iter().map(|v| bend.at(web.length(row[base], *v))).collect();
        let stays_wide = |(v, place): (&u32, &Point3<f64>)| {
            let before = web.nodes[*v as usize];
            !tree.is_hit(&before, &(place - before), 1.0) && WITHIN * radius(tree, place) >= radius(tree, &before)
        };
        if row.iter().zip(&places).all(stays_wide) {
            row.iter().zip(places).for_each(|(v, place)| web.nodes[*v as usize] = place);
        }
    }
}

/// A curve of second degree over the length of chords, from its last place on.
struct Parabola {
    last: Point3<f64>,
    slope: Vector3<f64>,
    bend: Vector3<f64>,
}

impl Parabola {
    /// Through three places at different lengths (Newton's divided differences).
    fn through([a, b, c]: [Point3<f64>; 3]) -> Self {
        let (before, after) = (nalgebra::distance(&a, &b), nalgebra::distance(&b, &c));
        let [first, second] = [(b - a) / before, (c - b) / after];
        let bend = (second - first) / (before + after);
        Self { last: c, slope: second + bend * after, bend }
    }

    fn at(&self, length: f64) -> Point3<f64> {
        self.last + (self.slope + self.bend * length) * length
    }
}

/// Direction of a branch at its end.
fn direction(web: &Web, tree: &AabbTree, end: u32) -> Option<Vector3<f64>> {
    let row = web.row_back(end, LOOK_BACK * radius(tree, &web.nodes[end as usize]));
    (web.nodes[end as usize] - web.nodes[row[row.len() - 1] as usize]).try_normalize(1e-9)
}

fn step(tree: &AabbTree, at: &Point3<f64>, direction: &Vector3<f64>) -> Option<(Point3<f64>, Vector3<f64>)> {
    let r = radius(tree, at);
    let ahead = tree.first_hit(at, direction)?;
    if !(r > POINT && ahead > ROOM * r && tree.encloses(at)) {
        return None;
    }
    let length = (STEP * r).max(POINT).min(0.5 * ahead);
    let moved = at + direction * length;
    let side = across(tree, &moved);
    let next = moved + (side - direction * side.dot(direction));
    let way = (next - at).try_normalize(1e-9)?;
    let turned = (direction * (1.0 - TURN) + way * TURN).try_normalize(1e-9)?;
    // Where the way turns back there is no limb.
    (way.dot(direction) > 0.5).then_some((next, turned))
}
