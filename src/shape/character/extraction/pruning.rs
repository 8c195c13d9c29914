//! Prunes branches and ends of branches that are no limbs.
//!
//! Contraction leaves branches into bumps, corners and rims. The persistence of a branch is the length by which it extends beyond the rest of
//! the curve, in half-widths of its own:
//!
//! `max_i (‖c_i − c‖ + s)/w_i`
//!
//! over its nodes `c_i`, from its end `c` to the first one inside a ball of the rest. The ball of a node is the largest one inside the surface,
//! `s` that of the end, and `w_i` half the longest chord across the branch. Persistence is a ratio and equal for fingers and trunks: `l/ρ` for a
//! rod of length `l` and radius `ρ`, 1 for half a ball, `cot α` for a cone, .94 for the corner of a cube; the edge of a slab and the rim of a
//! cylinder, which are long across, have less. Below 1 a part is a bump. The least persistent branch goes first, since others may extend farther
//! beyond the rest afterwards; its vertices go to the junction. Pinned ends stay.
//!
//! The same holds for the end of a branch, which may turn aside into a corner: its last part that is too short for a limb goes, back to the
//! first node whose ball contains some of it. From there it is extended straight (`tips.rs`).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::Vector3;

use super::aabb::AabbTree;
use super::curve_graph::CurveGraph;
use super::order::Cost;
use plumbline_num::run::{Run, Stopped};

/// Number of chords across a branch. With four, `male` gets an end more on one side.
const CHORDS: usize = 8;

/// The shape about a curve: the radii of its balls, and the half-widths that are known.
struct Shape<'a> {
    tree: &'a AabbTree,
    radii: &'a [f64],
    half_widths: Vec<Option<f64>>,
}

/// Prunes branches with a persistence below `least`; `radii` are the distances of the nodes to the surface.
pub(super) fn prune(
    graph: &mut CurveGraph,
    tree: &AabbTree,
    radii: &[f64],
    least: f64,
    run: &Run,
) -> Result<(), Stopped> {
    let mut shape = Shape::new(graph, tree, radii);
    let mut rest = Rest::new(graph, radii);
    // Persistence only grows as other branches go, since the rest then holds less of a branch: what is known of it is a
    // lower bound, and the least bound is computed anew before its branch goes.
    let mut bounds: BinaryHeap<_> = graph.free_ends().into_iter().map(|end| Reverse((Cost::new(0.0), end))).collect();
    while let Some(Reverse((bound, end))) = bounds.pop() {
        run.check()?;
        let Some(branch) = graph.limb(end) else { continue };
        let outside = rest.nodes_outside(graph, &branch[1..]);
        let persistence = shape.persistence(graph, &branch, branch.len() - outside, least);
        if persistence >= least {
            continue;
        }
        if Cost::new(persistence) > bound {
            bounds.push(Reverse((Cost::new(persistence), end)));
        } else {
            graph.remove_branch(&branch);
        }
    }
    Ok(())
}

/// What the nodes of a branch are compared with: the balls of all other branches.
struct Rest<'a> {
    radii: &'a [f64],
    /// Nodes of the branch at work.
    is_own: Vec<bool>,
    /// A node whose ball holds each node, as found last.
    holder: Vec<Option<u32>>,
    /// Nodes that no ball of the rest holds: they stay so, since branches only go.
    is_outside: Vec<bool>,
}

impl<'a> Rest<'a> {
    fn new(graph: &CurveGraph, radii: &'a [f64]) -> Self {
        let count = graph.nodes.len();
        Self { radii, is_own: vec![false; count], holder: vec![None; count], is_outside: vec![false; count] }
    }

    /// Number of nodes at the end of a branch, from its second node on, before the first one that the rest holds.
    fn nodes_outside(&mut self, graph: &CurveGraph, own: &[u32]) -> usize {
        for v in own {
            self.is_own[*v as usize] = true;
        }
        let outside = own.iter().rev().take_while(|v| self.is_outside(graph, **v)).count();
        for v in own {
            self.is_own[*v as usize] = false;
        }
        outside
    }

    fn is_outside(&mut self, graph: &CurveGraph, v: u32) -> bool {
        let holds = |u: &u32| !self.is_own[*u as usize] && graph.length(*u, v) < self.radii[*u as usize];
        let node = v as usize;
        if !self.is_outside[node] && !self.holder[node].is_some_and(|u| graph.is_alive(u) && holds(&u)) {
            self.holder[node] = graph.alive().find(holds);
            self.is_outside[node] = self.holder[node].is_none();
        }
        self.is_outside[node]
    }
}

impl<'a> Shape<'a> {
    fn new(graph: &CurveGraph, tree: &'a AabbTree, radii: &'a [f64]) -> Self {
        Self { tree, radii, half_widths: vec![None; graph.nodes.len()] }
    }

    /// Persistence of a branch of which the nodes from index `first` on are outside the rest; any value above `enough` is as good.
    fn persistence(&mut self, graph: &CurveGraph, branch: &[u32], first: usize, enough: f64) -> f64 {
        let mut most = 0.0_f64;
        for i in (first..branch.len()).rev() {
            if most >= enough {
                break;
            }
            most = most.max(self.ratio(graph, branch, i, most));
        }
        most
    }

    /// Length from a node of a branch to its tip in half-widths at the node; some lower value if it is below `least`.
    fn ratio(&mut self, graph: &CurveGraph, branch: &[u32], i: usize, least: f64) -> f64 {
        let (v, end) = (branch[i], branch[branch.len() - 1]);
        let length = graph.length(v, end) + self.radii[end as usize];
        let r = self.radii[v as usize].max(f64::MIN_POSITIVE);
        // The half-width is at least the radius.
        if length < least * r {
            return 0.0;
        }
        let tree = self.tree;
        length / *self.half_widths[v as usize].get_or_insert_with(|| half_width(graph, tree, &branch[..=i], r))
    }
}

/// Cuts the last part of every branch, which is too short for a limb, as far as a ball of the branch contains some of it.
pub(super) fn cut_ends(graph: &mut CurveGraph, tree: &AabbTree, radii: &[f64], least: f64) {
    let mut shape = Shape::new(graph, tree, radii);
    for end in graph.free_ends() {
        let mut branch = graph.row_back(end, f64::INFINITY);
        branch.reverse();
        let is_limb = |i: &usize| shape.ratio(graph, &branch, *i, least) >= least;
        let Some(limb) = (1..branch.len()).rev().find(is_limb) else { continue };
        let first = usize::from(graph.degree(branch[0]) != 2);
        let reaches = |i: &usize| {
            let from = branch[*i];
            branch[limb..].iter().any(|v| graph.length(from, *v) < radii[from as usize])
        };
        if let Some(from) = (first..branch.len()).find(reaches) {
            graph.remove_branch(&branch[from..]);
        }
    }
}

/// Half the longest chord across a branch at its end, at least its radius there.
fn half_width(graph: &CurveGraph, tree: &AabbTree, branch: &[u32], radius: f64) -> f64 {
    let end = graph.nodes[branch[branch.len() - 1] as usize];
    let mut before = branch.iter().rev().map(|v| graph.nodes[*v as usize]);
    let from = before.find(|p| nalgebra::distance(p, &end) >= radius).unwrap_or(graph.nodes[branch[0] as usize]);
    let Some(along) = (end - from).try_normalize(1e-12).filter(|_| !tree.is_exhausted()) else { return radius };
    let side = along.cross(&Vector3::ith(along.iamin(), 1.0)).normalize();
    let other = along.cross(&side);
    let half_chord = |k: usize| {
        let angle = std::f64::consts::PI * k as f64 / CHORDS as f64;
        let across = side * angle.cos() + other * angle.sin();
        let [ahead, behind] = [across, -across].map(|d| tree.first_hit(&end, &d).unwrap_or(0.0));
        0.5 * (ahead + behind)
    };
    (0..CHORDS).map(half_chord).fold(radius, f64::max)
}
