//! How long a graph of tasks takes on several workers.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

/// A duration that can be ordered.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Moment(f64);

impl Eq for Moment {}

impl PartialOrd for Moment {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Moment {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// Seconds until all tasks are done: task `i` takes `seconds[i]` and is behind the tasks `after[i]`, all of which are before it;
/// each of `workers` workers, of which there is at least one, does one task at a time.
///
/// List scheduling: a worker that is free takes the first task of the list that waits for no other, as engines hand them out. No order is
/// shorter than half of this (Graham, *Bounds on multiprocessing timing anomalies*, 1969).
pub fn makespan(seconds: &[f64], after: &[Vec<usize>], workers: usize) -> f64 {
    let count = seconds.len();
    let mut waits: Vec<usize> = (0..count).map(|task| after.get(task).map_or(0, Vec::len)).collect();
    let mut before: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (task, needed) in after.iter().enumerate().take(count) {
        needed.iter().filter(|needed| **needed < count).for_each(|needed| before[*needed].push(task));
    }
    let mut ready: BTreeSet<usize> = (0..count).filter(|task| waits[*task] == 0).collect();
    let mut running: BinaryHeap<Reverse<(Moment, usize)>> = BinaryHeap::new();
    let mut now = 0.0;
    loop {
        while running.len() < workers.max(1) {
            let Some(task) = ready.pop_first() else { break };
            running.push(Reverse((Moment(now + seconds[task].max(0.0)), task)));
        }
        let Some(Reverse((Moment(end), done))) = running.pop() else { return now };
        now = end;
        for &task in &before[done] {
            waits[task] -= 1;
            if waits[task] == 0 {
                ready.insert(task);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_makespan_is_between_its_bounds() {
        // Two chains behind one task, and one task behind both.
        let seconds = [1.0, 4.0, 2.0, 2.0, 1.0];
        let after = [vec![], vec![0], vec![0], vec![2], vec![1, 3]];
        let of = |workers| makespan(&seconds, &after, workers);
        assert_eq!([0, 1, 2, 100].map(of), [10.0, 10.0, 6.0, 6.0]);
        assert_eq!(makespan(&[], &[], 3), 0.0);
        assert_eq!(makespan(&[3.0; 10], &vec![Vec::new(); 10], 4), 9.0);
    }

    #[test]
    fn more_workers_than_tasks_are_no_fault() {
        assert_eq!(makespan(&[2.0, f64::NAN, -1.0], &[vec![], vec![], vec![7]], usize::MAX), 2.0);
    }
}
