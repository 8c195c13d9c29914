//! On round limbs the curve comes to their axis.
//!
//! Smoothing draws bends inward, by `σ² r² κ` in each pass where the curve has the curvature `κ`, and the nearest side of a round limb says
//! where its middle is in one direction only. With two chords across the curve through a node `c`, the first in the plane of the nearest point
//! of the surface, the second at right angles to it, `a⁺`, `a⁻`, `b⁺` and `b⁻` long from `c` in the directions `u` and `v`,
//!
//! `c ← c + w (u (a⁺ − a⁻)/2 + v (b⁺ − b⁻)/2)`,
//!
//! is the middle of both. The weight `w` is one where both chords are about as long as the limb is thick, and falls to nothing where
//! one is longer: in palms and trunks no section says where the middle is, and steps to it would make the curve rough. Steps are evened out
//! along the curve; nothing is smoothed after.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::centering::{AGREE, distances, nearest, tangent};
use super::error::ExtractionError;
use super::fairing::Fairing;
use super::web::Web;
use plumbline_num::run::Run;

/// Times that the steps are taken. After four, curves of sixty capsules, straight and bent, are within a hundredth of the radius of their
/// axes; after two, all but one are.
const PASSES: usize = 4;
/// A limb is round where no chord is longer than this many diameters of the ball about the node.
const ROUND: f64 = 1.1;
/// And flat where one is longer than this many. At 1.6 palms and the fine armadillo lose centeredness (.02), at 1.2 nothing gains.
const FLAT: f64 = 1.3;

/// Moves nodes on round limbs to the axis, but for junctions, ends and pinned nodes.
pub(super) fn settle(web: &mut Web, tree: &AabbTree, run: &Run) -> Result<(), ExtractionError> {
    let alive: Vec<u32> = web.alive().collect();
    let feet = nearest(web, tree);
    let mut fairing = Fairing::new(web, &alive, &distances(web, &feet), AGREE, |_| false, run)?;
    let between_two = alive.iter().filter(|v| web.degree(**v) == 2);
    let mut round: Vec<(u32, Point3<f64>)> = between_two.filter_map(|v| Some((*v, feet[*v as usize]?))).collect();
    for _ in 0..PASSES {
        run.check()?;
        let mut steps = vec![Vector3::zeros(); web.nodes.len()];
        // Nodes that are not on round limbs at first are not asked again.
        round.retain_mut(|(v, foot)| {
            *foot = tree.nearest_from(&web.nodes[*v as usize], foot);
            let step = step(web, tree, *v, foot);
            steps[*v as usize] = step.unwrap_or_default();
            step.is_some()
        });
        fairing.apply(&mut steps);
        for v in alive.iter().map(|v| *v as usize) {
            if !web.pinned[v] {
                web.nodes[v] += steps[v];
            }
        }
    }
    Ok(())
}

/// The way to the middle of two chords, by as much as these say where the axis is.
fn step(web: &Web, tree: &AabbTree, node: u32, nearest: &Point3<f64>) -> Option<Vector3<f64>> {
    let c = &web.nodes[node as usize];
    let (along, away) = (tangent(web, node), c - nearest);
    let radius = away.norm();
    let u = (away - along * away.dot(&along)).try_normalize(1e-9 * radius)?;
    let v = along.cross(&u);
    // The way to the middle of a chord, and how far that says where the axis is.
    let middle = |d: &Vector3<f64>| {
        let [ahead, behind] = [tree.first_hit(c, d)?, tree.first_hit(c, &-d)?];
        let sure = (FLAT - 0.5 * (ahead + behind) / radius) / (FLAT - ROUND);
        (sure > 0.0).then_some((d * (0.5 * (ahead - behind)), sure.min(1.0)))
    };
    let (to_u, sure_u) = middle(&u)?;
    let (to_v, sure_v) = middle(&v)?;
    Some((to_u + to_v) * sure_u.min(sure_v))
}
