//! Leaves of a graph, ordered by their contribution to the spanning tree.
//!
//! The first two are far from each other. A leaf `x` then adds `min_{i,j} (d(x,i) + d(x,j) − d(i,j)) / 2`, the length of its path to the
//! tree of the leaves before it (exact on trees).

use super::graph::Graph;
use crate::character::Skeleton;
use plumbline_num::spatial::ShortestPaths;

/// A leaf that adds less than this fraction of the total length coincides with another.
const MIN_LENGTH_FRACTION: f64 = 1e-6;
/// Largest number of curve leaves: four hands of five fingers, and as many others.
const MAX_CURVE_ENDS: usize = 40;
/// Largest number of template leaves; the remaining joints follow their parents.
const MAX_TEMPLATE_ENDS: usize = 64;

/// Weight of a root that is a leaf, matched or not: many rigs have a root on the ground outside the surface, while that of an arm rig is its
/// shoulder.
const ROOT_WEIGHT: f64 = 0.2;

/// Leaves of a graph, in order.
#[derive(Clone, Debug, Default)]
pub(super) struct Ends {
    /// Their nodes.
    pub(super) nodes: Vec<u32>,
    /// Length that each adds, as a fraction of the graph's length; for the first two the path between them.
    pub(super) reach: Vec<f64>,
    /// Cost of leaving each unmatched.
    pub(super) need: Vec<f64>,
    /// Fraction of the surface around each one's path, for the first two half of that between them.
    pub(super) around: Vec<f64>,
    /// Probability that each is the end of a limb, 0 to 1.
    pub(super) trust: Vec<f64>,
    /// Shortest paths from each.
    pub(super) paths: Vec<ShortestPaths>,
}

impl Ends {
    /// Length of the path between two leaves.
    pub(super) fn between(&self, i: usize, j: usize) -> f64 {
        self.paths[i].length[self.nodes[j] as usize]
    }
}

/// The leaves of a template.
pub(super) fn of_template(template: &Skeleton, bones: &Graph) -> Ends {
    let mut ends = far_first(bones, bones.ends(), MAX_TEMPLATE_ENDS);
    for ((need, trust), node) in ends.need.iter_mut().zip(&mut ends.trust).zip(&ends.nodes) {
        if template.joints()[*node as usize].parent.is_none() {
            (*need, *trust) = (*need * ROOT_WEIGHT, ROOT_WEIGHT);
        }
    }
    ends
}

/// The leaves of a curve; for a curve of loops only, the nodes farthest apart.
pub(super) fn of_curve(branches: &Graph) -> Ends {
    let ends = branches.ends();
    if ends.len() >= 2 {
        return far_first(branches, ends, MAX_CURVE_ENDS);
    }
    let all = (0..branches.points.len() as u32).collect();
    far_first(branches, all, 4)
}

fn far_first(graph: &Graph, mut candidates: Vec<u32>, most: usize) -> Ends {
    let mut ends = Ends::default();
    let Some(&start) = candidates.first() else { return ends };
    let mut added = graph.paths(start).length;
    while let Some((at, reach)) = farthest(&candidates, &added).filter(|_| ends.nodes.len() < most) {
        if reach <= MIN_LENGTH_FRACTION {
            break;
        }
        let node = candidates.remove(at);
        let paths = graph.paths(node);
        match ends.nodes.len() {
            0 => added.clone_from(&paths.length),
            1 => added.fill(f64::INFINITY),
            _ => (),
        }
        for (other, before) in ends.nodes.iter().zip(&ends.paths) {
            let between = paths.length[*other as usize];
            for (x, a) in added.iter_mut().enumerate() {
                *a = a.min(0.5 * (paths.length[x] + before.length[x] - between));
            }
        }
        ends.reach.push(reach);
        ends.nodes.push(node);
        ends.paths.push(paths);
    }
    if let [first, second, ..] = ends.reach.as_mut_slice() {
        *first = *second;
    }
    // The path between the first two counts once.
    ends.around = around(graph, &ends);
    ends.trust = vec![1.0; ends.nodes.len()];
    ends.need = ends.reach.iter().enumerate().map(|(k, reach)| if k < 2 { 0.5 * reach } else { *reach }).collect();
    ends
}

/// The part of each leaf's path to the first that no earlier leaf covers.
fn around(graph: &Graph, ends: &Ends) -> Vec<f64> {
    let Some(to_first) = ends.paths.first() else { return Vec::new() };
    let mut seen = std::collections::BTreeSet::new();
    let mut own = |node: &u32| {
        let path = to_first.back_from(*node);
        let pairs = path.windows(2).map(|w| [w[0].min(w[1]), w[0].max(w[1])]);
        let fresh: Vec<_> = pairs.filter(|pair| seen.insert(*pair)).collect();
        graph.surface_fraction_around(fresh.into_iter())
    };
    let mut around: Vec<f64> = ends.nodes.iter().map(&mut own).collect();
    if let [first, second, ..] = around.as_mut_slice() {
        *second *= 0.5;
        *first = *second;
    }
    around
}

/// Index and value of the largest; of values equal up to rounding (1e-9) the first.
fn farthest(candidates: &[u32], added: &[f64]) -> Option<(usize, f64)> {
    let mut best: Option<(usize, f64)> = None;
    for (at, node) in candidates.iter().enumerate() {
        let value = added[*node as usize];
        if best.is_none_or(|(_, b)| value > b + 1e-9) {
            best = Some((at, value));
        }
    }
    best
}
