//! Takes branches away that say nothing of the shape, and brings junctions together that are one.
//!
//! Bumps of a surface leave short branches. A branch from a junction of radius `r` to an end of radius `s`, `l` long, is covered by the
//! ball at the junction but for `l + s − r`: it is taken away where this is less than `prune · r`. The ratio needs no unit and is the same for
//! fingers and trunks. The shortest goes first, since the next may be longer by then. Vertices of the branch go to the junction.
//! Ends that are pinned stay.
//!
//! Two junctions nearer to each other than a share of the larger radius are one, unless a loop would vanish.

use super::order::Cost;
use super::web::Web;

/// Takes away what is covered.
pub(super) fn prune(web: &mut Web, radius: &mut dyn FnMut(&Web, u32) -> f64, prune: f64) {
    loop {
        let mut worst: Option<(Cost, Vec<u32>)> = None;
        for mut branch in web.branches() {
            if web.degree(branch[0]) == 1 {
                branch.reverse();
            }
            let (junction, end) = (branch[0], branch[branch.len() - 1]);
            if web.degree(end) != 1 || web.degree(junction) < 3 || web.pinned[end as usize] {
                continue;
            }
            let (r, s) = (radius(web, junction), radius(web, end));
            let beyond = (web.branch_length(&branch) + s - r) / r;
            let rank = Cost::new(beyond);
            if beyond < prune && worst.as_ref().is_none_or(|(least, _)| rank < *least) {
                worst = Some((rank, branch));
            }
        }
        let Some((_, branch)) = worst else { return };
        for pair in branch.windows(2).rev() {
            web.merge(pair[1], pair[0]);
        }
    }
}

/// Merges junctions that are one.
pub(super) fn join_junctions(web: &mut Web, radius: &mut dyn FnMut(&Web, u32) -> f64, share: f64) {
    loop {
        let mut nearest: Option<(Cost, Vec<u32>)> = None;
        for branch in web.branches() {
            let (a, b) = (branch[0], branch[branch.len() - 1]);
            if a == b || web.degree(a) < 3 || web.degree(b) < 3 {
                continue;
            }
            let length = web.branch_length(&branch);
            let widest = radius(web, a).max(radius(web, b));
            let rank = Cost::new(length / widest);
            if length < share * widest
                && !closes_a_loop(web, &branch)
                && nearest.as_ref().is_none_or(|(least, _)| rank < *least)
            {
                nearest = Some((rank, branch));
            }
        }
        let Some((_, branch)) = nearest else { return };
        let (a, b) = (branch[0], branch[branch.len() - 1]);
        let (inner, keep) = if radius(web, a) >= radius(web, b) {
            (branch[1..].to_vec(), a)
        } else {
            let mut rest = branch.clone();
            rest.pop();
            rest.reverse();
            (rest, b)
        };
        for v in inner {
            web.merge(v, keep);
        }
    }
}

/// True where another branch joins the same two junctions, or a node is next to both: merging would take the loop away.
fn closes_a_loop(web: &Web, branch: &[u32]) -> bool {
    let (a, b) = (branch[0], branch[branch.len() - 1]);
    let (mut inner, others) = (branch.to_vec(), web.branches());
    inner.sort_unstable();
    others.iter().any(|other| {
        let ends = (other[0], other[other.len() - 1]);
        let mut same = other.clone();
        same.sort_unstable();
        same != inner && (ends == (a, b) || ends == (b, a)) && other.len() <= 3
    }) || web.neighbors(a).iter().any(|v| !branch.contains(v) && web.neighbors(b).contains(v))
}
