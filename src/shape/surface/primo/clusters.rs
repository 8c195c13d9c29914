//! Clusters of bodies that move rigidly: the coarse levels.
//!
//! Clusters grow by pairwise matching: in each pass every cluster is merged with the neighbor of the largest connection strength,
//! the sum of the weights of the joints between them over their number of bodies. This keeps clusters compact and separates
//! them where the shell is soft.

use std::collections::BTreeMap;

use super::shell::Shell;
use plumbline_num::math::Lists;

/// Cluster of fixed bodies.
pub(super) const FIXED: u32 = u32::MAX;

/// A partition of the free bodies.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Clusters {
    /// Cluster of each body, or [`FIXED`].
    pub(super) of_body: Vec<u32>,
    /// Number of clusters.
    pub(super) count: usize,
    members: Lists<u32>,
}

impl Clusters {
    fn new(of_body: Vec<u32>, count: usize) -> Self {
        let members = of_body.iter().copied().zip(0..).filter(|&(c, _)| c != FIXED);
        Self { members: Lists::new(count, members), of_body, count }
    }

    /// Bodies of a cluster, ascending.
    pub(super) fn members(&self, cluster: usize) -> &[u32] {
        self.members.of(cluster)
    }
}

/// Partitions from single bodies (level 0) to about `coarsest` clusters, each with about a quarter of the clusters of
/// the previous one. Free bodies with the same number in `rigid` are one cluster on all levels.
pub(super) fn levels(shell: &Shell, rigid: Option<&[Option<u32>]>, coarsest: usize) -> Vec<Clusters> {
    let mut of_body = vec![FIXED; shell.centers.len()];
    let (mut sizes, mut of_number) = (Vec::new(), BTreeMap::new());
    for (body, _) in shell.free.iter().enumerate().filter(|(_, free)| **free) {
        let next = sizes.len() as u32;
        let number = rigid.and_then(|rigid| rigid.get(body).copied().flatten());
        of_body[body] = number.map_or(next, |number| *of_number.entry(number).or_insert(next));
        if of_body[body] == next {
            sizes.push(0.0);
        }
        sizes[of_body[body] as usize] += 1.0;
    }
    let mut count = sizes.len();
    let mut levels = vec![Clusters::new(of_body.clone(), count)];
    while count > coarsest {
        let wanted = (count / 4).max(coarsest);
        let before = count;
        while count > wanted {
            let merged = merge_pairs(&connections(shell, &of_body), &sizes);
            let now = merged.iter().max().map_or(0, |&c| c as usize + 1);
            if now == count {
                break;
            }
            let mut sums = vec![0.0; now];
            for (&c, size) in merged.iter().zip(&sizes) {
                sums[c as usize] += size;
            }
            of_body.iter_mut().filter(|c| **c != FIXED).for_each(|c| *c = merged[*c as usize]);
            (count, sizes) = (now, sums);
        }
        if count == before {
            break;
        }
        levels.push(Clusters::new(of_body.clone(), count));
    }
    levels
}

/// Pairs of connected clusters in both orders, ascending, with the sum of the weights between them.
fn connections(shell: &Shell, of_body: &[u32]) -> Vec<(u32, u32, f64)> {
    let mut all: Vec<(u32, u32, f64)> = Vec::new();
    for joint in &shell.joints {
        let [a, b] = joint.bodies.map(|i| of_body[i as usize]);
        if a != b && a != FIXED && b != FIXED {
            all.extend([(a, b, joint.weight), (b, a, joint.weight)]);
        }
    }
    all.sort_by_key(|&(a, b, _)| (a, b));
    all.dedup_by(|next, first| {
        let same = (next.0, next.1) == (first.0, first.1);
        if same {
            first.2 += next.2;
        }
        same
    });
    all
}

/// Indices of the merged clusters. Small clusters are matched first; one without an unmatched neighbor joins a matched one.
fn merge_pairs(connections: &[(u32, u32, f64)], sizes: &[f64]) -> Vec<u32> {
    let of_cluster = Lists::new(sizes.len(), connections.iter().map(|&(c, other, weight)| (c, (other, weight))));
    let mut order: Vec<u32> = (0..sizes.len() as u32).collect();
    order.sort_by(|&a, &b| sizes[a as usize].total_cmp(&sizes[b as usize]));
    let (mut merged, mut next) = (vec![FIXED; sizes.len()], 0);
    for c in order.into_iter().map(|c| c as usize) {
        if merged[c] != FIXED {
            continue;
        }
        let strength = |&&(other, weight): &&(u32, f64)| weight / (sizes[c] + sizes[other as usize]);
        let strongest = |taken: bool| {
            let open = of_cluster.of(c).iter().filter(|c| (merged[c.0 as usize] != FIXED) == taken);
            open.max_by(|a, b| strength(a).total_cmp(&strength(b))).map(|c| c.0 as usize)
        };
        match (strongest(false), strongest(true)) {
            (Some(other), _) => {
                (merged[c], merged[other]) = (next, next);
                next += 1;
            }
            (None, Some(other)) => merged[c] = merged[other],
            (None, None) => {
                merged[c] = next;
                next += 1;
            }
        }
    }
    merged
}
