//! Ends that run into corners and rims are taken away.
//!
//! The middle of a box is its axis, but medial sheets reach into every corner and edge, and the curve likes to follow them. Toward a
//! corner the balls shrink evenly and fast until nothing is left, like those in a cone: with `r` the radius of the first, and `s` that of the
//! end at the distance `d`,
//!
//! `(r − s) / d > STEEP`,   `s < SMALL · r`,   no ball between `THICKER · r` above the straight line or `THINNER · r` below,
//!
//! by `1/√3` of the way in the corner of a cube, `1/√2` in the rim of a cylinder. Legs and ears, and the spines of a ball, are
//! thinner than that line where they leave the body. A blunt horn is such a cone, too; what tells them apart is their company. Where
//! three or more are about one ball, they are the crown of a box; where one goes on from a limb and turns aside, it is a hook into a
//! rim. A cone that goes on straight is the tip of the limb.

use super::order::Cost;
use super::pruning::sticks_out;
use super::web::{Branch, Web};

/// The balls shrink at least by this share of the way.
const STEEP: f64 = 0.45;
/// Until they are as small as this share of the first: there is a little fillet at most.
const SMALL: f64 = 0.35;
/// How much larger they are between than the straight line says, as a share of the first: sheets of boxes bend the way to a corner.
const THICKER: f64 = 0.25;
/// And how much smaller: spines and ears are by .16 to .4, corners of boxes by .14 at most, nine of ten by less than .1.
const THINNER: f64 = 0.15;
/// An end in one of several corners sticks out of the ball that they are about by less than this share of its radius; and one in a rim.
const OUT: f64 = 1.1;
const OUT_OF_RIM: f64 = 0.9;
/// So many corners about one ball are no limbs: boxes have four to eight, heads two ears.
const CROWN: usize = 3;
/// A hook turns aside by more than this, 30°.
const ASIDE: f64 = 0.52;

/// Takes branches into corners away, where several are about one ball; whether there were any. The `radii` are the distances of the nodes
/// to the surface.
pub(super) fn take_crowns(web: &mut Web, radii: &[f64]) -> bool {
    let corner = |branch: Branch| {
        let (_, base) = sticks_out(web, &branch, radii);
        let first = (0..branch.len()).min_by_key(|i| Cost::new(web.length(base, branch[*i])))?;
        is_cone(web, radii, base, &branch[first..], OUT).then_some((branch, base))
    };
    let corners: Vec<(Branch, u32)> = web.limbs().filter_map(corner).collect();
    let about = |base: u32| corners.iter().filter(|(_, other)| web.length(base, *other) < radii[base as usize]).count();
    let crowns: Vec<&Branch> = corners.iter().filter(|(_, base)| about(*base) >= CROWN).map(|(b, _)| b).collect();
    for branch in &crowns {
        web.take_away(branch);
    }
    !crowns.is_empty()
}

/// Takes away what turns aside into a rim or a corner at the end of a limb.
pub(super) fn unhook(web: &mut Web, radii: &[f64]) {
    for mut branch in web.branches() {
        for _ in 0..2 {
            let end = branch[branch.len() - 1];
            if web.degree(end) == 1
                && !web.pinned[end as usize]
                && let Some(base) = hook(web, radii, &branch)
            {
                web.take_away(&branch[base..]);
                branch.truncate(base + 1);
            }
            branch.reverse();
        }
    }
}

/// Position in a branch where the hook at its end begins.
fn hook(web: &Web, radii: &[f64], branch: &[u32]) -> Option<usize> {
    let last = branch.len() - 1;
    let away = |i: usize, from: usize| web.length(branch[i], branch[from]);
    let radius = |i: usize| radii[branch[i] as usize];
    let base = (0..last).max_by_key(|i| Cost::new(radius(*i) - STEEP * away(*i, last)))?;
    let before = (0..base).rev().find(|i| away(*i, base) >= radius(base))?;
    let [from, at, to] = [before, base, last].map(|i| web.nodes[branch[i] as usize]);
    let is_hook =
        (at - from).angle(&(to - at)) > ASIDE && is_cone(web, radii, branch[base], &branch[base..], OUT_OF_RIM);
    is_hook.then_some(base)
}

/// Whether the balls from that of `base` along a row of nodes are those in a cone, whose last one sticks out by less than `out` radii.
fn is_cone(web: &Web, radii: &[f64], base: u32, row: &[u32], out: f64) -> bool {
    let end = row[row.len() - 1];
    let [r, s] = [base, end].map(|v| radii[v as usize]);
    let length = web.length(base, end);
    let slope = (r - s) / length;
    let even = |v: &u32| {
        let more = (radii[*v as usize] - r + slope * web.length(base, *v)) / r;
        (-THINNER..=THICKER).contains(&more)
    };
    slope > STEEP && s < SMALL * r && length + s < (1.0 + out) * r && row.iter().all(even)
}
