//! Bodies in clusters that move as one: the coarse levels.
//!
//! Clusters are grown from pairs: in each round every cluster looks for the neighbor it is joined to most firmly for their
//! size. What counts is the sum of the weights of the joints between them over the sum of their bodies, which keeps clusters
//! compact and splits the shell where it is soft.

use std::collections::BTreeMap;

use super::shell::Shell;

/// A body that does not move belongs to no cluster.
pub(super) const FIXED: u32 = u32::MAX;

/// A partition of the free bodies.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Clusters {
    /// Cluster of each body, [`FIXED`] where it may not move.
    pub(super) of_body: Vec<u32>,
    /// Number of clusters.
    pub(super) count: usize,
    leaving: Lists,
    members: Lists,
}

/// Lists of numbers, one per cluster.
#[derive(Clone, Debug, PartialEq)]
struct Lists {
    /// Where each starts; one entry more than there are lists.
    starts: Vec<u32>,
    entries: Vec<u32>,
}

impl Lists {
    /// Lists of the second of each pair, by the first.
    fn new(lists: usize, mut pairs: Vec<(u32, u32)>) -> Self {
        pairs.sort_unstable();
        let mut starts = vec![0; lists + 1];
        for &(c, _) in &pairs {
            starts[c as usize + 1] += 1;
        }
        for c in 0..lists {
            starts[c + 1] += starts[c];
        }
        Self { starts, entries: pairs.into_iter().map(|(_, k)| k).collect() }
    }

    fn of(&self, list: usize) -> &[u32] {
        &self.entries[self.starts[list] as usize..self.starts[list + 1] as usize]
    }
}

impl Clusters {
    fn new(shell: &Shell, of_body: Vec<u32>, count: usize) -> Self {
        let mut leaving: Vec<(u32, u32)> = Vec::new();
        for (k, joint) in shell.joints.iter().enumerate() {
            let [a, b] = joint.bodies.map(|i| of_body[i as usize]);
            if a != b {
                leaving.extend([a, b].into_iter().filter(|&c| c != FIXED).map(|c| (c, k as u32)));
            }
        }
        let members = of_body.iter().zip(0..).filter(|&(&c, _)| c != FIXED).map(|(&c, b)| (c, b)).collect();
        Self { leaving: Lists::new(count, leaving), members: Lists::new(count, members), of_body, count }
    }

    /// Joints that leave a cluster, ascending.
    pub(super) fn leaving(&self, cluster: usize) -> &[u32] {
        self.leaving.of(cluster)
    }

    /// Bodies of a cluster, ascending.
    pub(super) fn members(&self, cluster: usize) -> &[u32] {
        self.members.of(cluster)
    }
}

/// Partitions from single bodies (the first) down to about `coarsest` clusters, each with about a quarter of the clusters of
/// the one before. Free bodies with the same number in `rigid` are one cluster from the first.
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
    let mut levels = vec![Clusters::new(shell, of_body.clone(), count)];
    while count > coarsest {
        let wanted = (count / 4).max(coarsest);
        let before = count;
        while count > wanted {
            let merged = matched(&bonds(shell, &of_body), &sizes);
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
        levels.push(Clusters::new(shell, of_body.clone(), count));
    }
    levels
}

/// Pairs of clusters that are joined, both ways round, ascending, with the sum of the weights between them.
fn bonds(shell: &Shell, of_body: &[u32]) -> Vec<(u32, u32, f64)> {
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

/// Numbers of the merged clusters. Small ones choose first; one whose neighbors are all taken goes along with one of them.
fn matched(bonds: &[(u32, u32, f64)], sizes: &[f64]) -> Vec<u32> {
    let mut starts = vec![0_usize; sizes.len() + 1];
    for bond in bonds {
        starts[bond.0 as usize + 1] += 1;
    }
    for c in 0..sizes.len() {
        starts[c + 1] += starts[c];
    }
    let mut order: Vec<u32> = (0..sizes.len() as u32).collect();
    order.sort_by(|&a, &b| sizes[a as usize].total_cmp(&sizes[b as usize]));
    let (mut merged, mut next) = (vec![FIXED; sizes.len()], 0);
    for c in order.into_iter().map(|c| c as usize) {
        if merged[c] != FIXED {
            continue;
        }
        let firmness = |&&(_, other, weight): &&(u32, u32, f64)| weight / (sizes[c] + sizes[other as usize]);
        let of = &bonds[starts[c]..starts[c + 1]];
        let firmest = |taken: bool| {
            let open = of.iter().filter(|bond| (merged[bond.1 as usize] != FIXED) == taken);
            open.max_by(|a, b| firmness(a).total_cmp(&firmness(b))).map(|bond| bond.1 as usize)
        };
        match (firmest(false), firmest(true)) {
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
