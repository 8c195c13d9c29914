//! Centers the curve on the axis of round limbs.
//!
//! Smoothing shrinks bends by `σ² r² κ` per pass at curvature `κ`, and the nearest surface point determines the center in one direction only.
//! Take two chords through a node `c` perpendicular to the curve, the first toward the nearest surface point, the second perpendicular to it,
//! with lengths `a⁺`, `a⁻`, `b⁺` and `b⁻` from `c` along `u` and `v`:
//!
//! `c ← c + w (u (a⁺ − a⁻)/2 + v (b⁺ − b⁻)/2)`,
//!
//! moves the node to the midpoints of both. The weight `w` is one if both chords are about as long as the limb is thick, and falls to zero for
//! longer ones: in palms and trunks a cross-section does not determine the center, and steps would roughen the curve. Steps are smoothed
//! along the curve.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::centering::{STEP_SMOOTHING_RADII, distances, nearest, tangent};
use super::curve_graph::CurveGraph;
use super::fairing::Fairing;
use crate::character::CharacterError;
use plumbline_num::run::Run;

/// Number of passes. After four, the curves of sixty capsules, straight and bent, are within a hundredth of the radius of their axes; after
/// two, all but one are.
const PASSES: usize = 4;
/// Chord length, in inscribed-ball diameters, up to which a limb is round.
const ROUND_CHORD: f64 = 1.1;
/// Chord length, in inscribed-ball diameters, beyond which a limb is flat. At 1.6 palms and the fine armadillo lose centeredness (.02); 1.2
/// improves nothing.
const FLAT_CHORD: f64 = 1.3;

/// Moves nodes on round limbs to the axis, except junctions, ends and pinned nodes.
pub(super) fn settle(graph: &mut CurveGraph, tree: &AabbTree, run: &Run) -> Result<(), CharacterError> {
    let alive: Vec<u32> = graph.alive().collect();
    let feet = nearest(graph, tree);
    let mut fairing = Fairing::new(graph, &alive, &distances(graph, &feet), STEP_SMOOTHING_RADII, |_| false, run)?;
    let between_two = alive.iter().filter(|v| graph.degree(**v) == 2);
    let mut round: Vec<(u32, Point3<f64>)> = between_two.filter_map(|v| Some((*v, feet[*v as usize]?))).collect();
    for _ in 0..PASSES {
        run.check()?;
        if tree.is_exhausted() {
            break;
        }
        let mut steps = vec![Vector3::zeros(); graph.nodes.len()];
        // Nodes that are not on round limbs in the first pass are skipped in later ones.
        round.retain_mut(|(v, foot)| {
            *foot = tree.nearest_from(&graph.nodes[*v as usize], foot);
            let step = step(graph, tree, *v, foot);
            steps[*v as usize] = step.unwrap_or_default();
            step.is_some()
        });
        fairing.apply(&mut steps);
        for v in alive.iter().map(|v| *v as usize) {
            if !graph.pinned[v] {
                graph.nodes[v] += steps[v];
            }
        }
    }
    Ok(())
}

/// Weighted step to the midpoints of both chords; `None` for flat cross-sections.
fn step(graph: &CurveGraph, tree: &AabbTree, node: u32, nearest: &Point3<f64>) -> Option<Vector3<f64>> {
    let c = &graph.nodes[node as usize];
    let (along, away) = (tangent(graph, node), c - nearest);
    let radius = away.norm();
    let u = (away - along * away.dot(&along)).try_normalize(1e-9 * radius)?;
    let v = along.cross(&u);
    // Step to the midpoint of a chord, and its weight.
    let middle = |d: &Vector3<f64>| {
        let [ahead, behind] = [tree.first_hit(c, d)?, tree.first_hit(c, &-d)?];
        let sure = (FLAT_CHORD - 0.5 * (ahead + behind) / radius) / (FLAT_CHORD - ROUND_CHORD);
        (sure > 0.0).then_some((d * (0.5 * (ahead - behind)), sure.min(1.0)))
    };
    let (to_u, sure_u) = middle(&u)?;
    let (to_v, sure_v) = middle(&v)?;
    Some((to_u + to_v) * sure_u.min(sure_v))
}
