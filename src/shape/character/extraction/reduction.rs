//! Mesh reduction before contraction, by collapsing the shortest edges.
//!
//! A curve needs much less detail than its surface. The edge with the smallest length relative to the target sizes of its ends collapses,
//! unless that changes the topology or folds the surface: for constant sizes triangles become uniform; for sizes proportional to the local
//! radius a finger keeps as many around it as a trunk.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::complex::Complex;
use super::order::Cost;
use plumbline_num::run::{Run, Stopped};

/// Smallest number of queued edges at which outdated ones are removed: a hub queues all of its edges at every collapse.
const MIN_CROWDED: usize = 1 << 20;

/// Collapses edges shorter than `size` at either end, and further ones until at most `most` vertices remain, if possible within the
/// budget of the complex.
pub(super) fn reduce(
    complex: &mut Complex,
    most: usize,
    pinned: &[bool],
    size: &dyn Fn(u32) -> f64,
    run: &Run,
) -> Result<(), Stopped> {
    let mut heap = BinaryHeap::new();
    let mut version = vec![0_u32; complex.positions.len()];
    let length = |c: &Complex, a: u32, b: u32| {
        Cost::new(nalgebra::distance(&c.positions[a as usize], &c.positions[b as usize]) / size(a).min(size(b)))
    };
    let (mut neighbors, mut scratch) = (Vec::new(), Vec::new());
    for a in complex.vertices() {
        run.check()?;
        complex.neighbors(a, &mut neighbors);
        heap.extend(neighbors.iter().filter(|b| a < **b).map(|b| Reverse((length(complex, a, *b), a, *b, 0, 0))));
    }
    let mut crowded = heap.len().max(MIN_CROWDED);
    while let Some(Reverse((cost, a, b, at_a, at_b))) = heap.pop() {
        run.check()?;
        if complex.budget.is_spent() || (cost >= Cost::new(1.0) && complex.alive_count() <= most) {
            return Ok(());
        }
        if version[a as usize] != at_a || version[b as usize] != at_b || !complex.is_alive(a) || !complex.is_alive(b) {
            continue;
        }
        if !complex.link_condition(a, b, &mut scratch) {
            continue;
        }
        let Some((gone, kept)) = [(b, a), (a, b)]
            .into_iter()
            .find(|(gone, kept)| !pinned[*gone as usize] && !complex.would_fold(*gone, *kept))
        else {
            continue;
        };
        complex.collapse(gone, kept);
        version[kept as usize] += 1;
        complex.neighbors(kept, &mut neighbors);
        complex.budget.queue(neighbors.len());
        for &u in &neighbors {
            let (a, b) = (kept.min(u), kept.max(u));
            heap.push(Reverse((length(complex, a, b), a, b, version[a as usize], version[b as usize])));
        }
        if heap.len() > crowded {
            heap.retain(|Reverse((_, a, b, at_a, at_b))| {
                version[*a as usize] == *at_a && version[*b as usize] == *at_b
            });
            crowded = MIN_CROWDED.max(2 * heap.len());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::budget::Budget;
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn short_edges_collapse_and_small_sizes_keep_detail() {
        let ball = shapes::icosphere(4);
        let whole = || Complex::new(ball.positions().to_vec(), ball.triangles().to_vec());
        let kept = vec![false; ball.vertex_count()];
        let mut complex = whole();
        let extrema: Vec<f64> = ball.positions().iter().map(|p| p.z).collect();
        reduce(
            &mut complex,
            usize::MAX,
            &kept,
            &|v| if extrema[v as usize] > 0.0 { 0.3 } else { 0.1 },
            &Run::default(),
        )
        .expect("a run that never stops");
        let (upper, lower): (Vec<u32>, Vec<u32>) = complex.vertices().partition(|v| extrema[*v as usize] > 0.0);
        assert!(lower.len() > 4 * upper.len(), "{} and {}", lower.len(), upper.len());
        let length = |a: u32, b: u32| nalgebra::distance(&ball.positions()[a as usize], &ball.positions()[b as usize]);
        let mut around = Vec::new();
        let short = complex.vertices().filter(|v| {
            complex.neighbors(*v, &mut around);
            around.iter().any(|u| length(*v, *u) < 0.1)
        });
        assert_eq!(short.count(), 0);
        let mut untouched = whole();
        reduce(&mut untouched, usize::MAX, &kept, &|_| 1e-3, &Run::default()).expect("a run that never stops");
        assert_eq!(untouched.alive_count(), ball.vertex_count());
        reduce(&mut untouched, 300, &kept, &|_| 1e-3, &Run::default()).expect("a run that never stops");
        assert_eq!(untouched.alive_count(), 300);
    }

    #[test]
    fn reduction_ends_where_its_budget_is_used_up() {
        let ball = shapes::icosphere(4);
        let kept = vec![false; ball.vertex_count()];
        let reduced = |units: u64| {
            let mut complex = Complex::new(ball.positions().to_vec(), ball.triangles().to_vec());
            complex.budget = Budget::of(units);
            reduce(&mut complex, 300, &kept, &|_| 1e-3, &Run::default()).expect("a run that never stops");
            complex.alive_count()
        };
        assert_eq!(reduced(u64::MAX), 300);
        let some = reduced(200_000);
        assert!(some > 300 && some < ball.vertex_count(), "{some}");
        assert_eq!(reduced(0), ball.vertex_count());
    }
}
