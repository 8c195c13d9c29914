//! Removal of degenerate triangles (zero area) without leaving cracks.
//!
//! A *needle* has an edge of at most `flat` times its longest edge: that edge collapses. A *cap* has its third vertex on its
//! longest edge: that edge is flipped, which splits the adjacent triangle at the vertex. Triangles that can neither collapse
//! nor flip are dropped.

use std::collections::HashMap;

use super::{RepairReport, Soup};
use plumbline_num::run::{Run, Stopped};

/// Maximum iterations of collapses and flips. Each collapse or flip may make a neighbor degenerate; long chains of such
/// neighbors do not occur in practice. The bound guarantees termination, and the remaining degenerate triangles are dropped.
const ROUNDS: usize = 8;

/// Marks an edge with more than two incident triangles in [`Edges`]. `CROWDED - 1` marks an empty slot; neither is a valid
/// triangle index.
const CROWDED: u32 = u32::MAX;

/// Removes all triangles whose height is at most the fraction `flat` of their longest edge.
pub(super) fn remove(soup: &mut Soup<'_>, flat: f64, report: &mut RepairReport, run: &Run) -> Result<(), Stopped> {
    for _ in 0..ROUNDS {
        let Some(found) = Some(flat_ones(soup, flat)).filter(|found| !found.is_empty()) else { return Ok(()) };
        collapse_needles(soup, flat, &found, report, run)?;
        let found = flat_ones(soup, flat);
        flip_caps(soup, &found, report, run)?;
        soup.drop_collapsed();
        let duplicates = soup.drop_duplicates();
        report.duplicates.extend(duplicates);
    }
    let found = flat_ones(soup, flat);
    let mut dead = vec![false; soup.corners.len()];
    for t in found {
        dead[t] = true;
    }
    report.flat_dropped.extend(soup.drop_dead(&dead));
    Ok(())
}

/// Lengths of the edges opposite each corner, and twice the area.
fn sides(soup: &Soup<'_>, vertices: [u32; 3]) -> ([f64; 3], f64) {
    let [a, b, c] = vertices.map(|v| soup.position(v));
    ([(c - b).norm(), (a - c).norm(), (b - a).norm()], (b - a).cross(&(c - a)).norm())
}

/// Whether a triangle is degenerate; true also for NaN.
fn is_flat(soup: &Soup<'_>, vertices: [u32; 3], flat: f64) -> bool {
    let (lengths, twice_area) = sides(soup, vertices);
    let longest = lengths.into_iter().fold(0.0, f64::max);
    !(twice_area > flat * longest * longest)
}

fn flat_ones(soup: &Soup<'_>, flat: f64) -> Vec<usize> {
    (0..soup.corners.len()).filter(|&t| is_flat(soup, soup.vertices(t), flat)).collect()
}

/// Collapses the shortest edge of each needle among the `found` triangles.
fn collapse_needles(
    soup: &mut Soup<'_>,
    flat: f64,
    found: &[usize],
    report: &mut RepairReport,
    run: &Run,
) -> Result<(), Stopped> {
    for &t in found {
        run.check()?;
        let vertices = soup.vertices(t);
        let (lengths, _) = sides(soup, vertices);
        let shortest = (0..3).min_by(|&i, &j| lengths[i].total_cmp(&lengths[j])).expect("three sides");
        let longest = lengths.into_iter().fold(0.0, f64::max);
        if lengths[shortest] <= flat * longest {
            soup.joined.join(vertices[(shortest + 1) % 3], vertices[(shortest + 2) % 3]);
            report.needles_collapsed += 1;
        }
    }
    soup.drop_collapsed();
    Ok(())
}

fn edge(p: u32, q: u32) -> (u32, u32) {
    (p.min(q), p.max(q))
}

/// The one or two triangles incident to each edge. Invariant: the first slot is filled before the second; an edge that once had
/// three or more triangles stays marked [`CROWDED`].
struct Edges(HashMap<(u32, u32), [u32; 2]>);

impl Edges {
    fn of(soup: &Soup<'_>) -> Self {
        let mut edges = Self(HashMap::with_capacity(soup.corners.len() * 3 / 2));
        for t in 0..soup.corners.len() {
            edges.add(t as u32, soup.vertices(t));
        }
        edges
    }

    fn add(&mut self, t: u32, [a, b, c]: [u32; 3]) {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let pair = self.0.entry(edge(p, q)).or_insert([CROWDED - 1; 2]);
            *pair = match *pair {
                [first, CROWDED] => [first, CROWDED],
                [first, second] if first == CROWDED - 1 => [t, second],
                [first, second] if second == CROWDED - 1 => [first, t],
                [first, _] => [first, CROWDED],
            };
        }
    }

    fn remove(&mut self, t: u32, [a, b, c]: [u32; 3]) {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            // A non-manifold edge stays marked: it must not be flipped.
            if let Some(pair) = self.0.get_mut(&edge(p, q)).filter(|pair| pair[1] != CROWDED) {
                *pair = if pair[0] == t { [pair[1], CROWDED - 1] } else { [pair[0], CROWDED - 1] };
            }
            if self.0.get(&edge(p, q)).is_some_and(|pair| pair[0] == CROWDED - 1) {
                self.0.remove(&edge(p, q));
            }
        }
    }

    /// The other triangle incident to the edge `pq` of triangle `t`, if there is exactly one.
    fn across(&self, t: u32, p: u32, q: u32) -> Option<u32> {
        match *self.0.get(&edge(p, q))? {
            [_, CROWDED] => None,
            [first, second] if first == t => Some(second),
            [first, _] => Some(first),
        }
        .filter(|&other| other < CROWDED - 1)
    }
}

/// Flips the longest edge of each cap among the `found` triangles, where the flip creates no existing edge.
fn flip_caps(soup: &mut Soup<'_>, found: &[usize], report: &mut RepairReport, run: &Run) -> Result<(), Stopped> {
    if found.is_empty() {
        return Ok(());
    }
    let mut edges = Edges::of(soup);
    for &t in found {
        run.check()?;
        let vertices = soup.vertices(t);
        let (lengths, _) = sides(soup, vertices);
        let tip = (0..3).max_by(|&i, &j| lengths[i].total_cmp(&lengths[j])).expect("three sides");
        let [b, c, a] = [vertices[tip], vertices[(tip + 1) % 3], vertices[(tip + 2) % 3]];
        let Some(other) = edges.across(t as u32, a, c).map(|u| u as usize) else { continue };
        let around = soup.vertices(other);
        let Some(k) = around.iter().position(|&d| d != a && d != c) else { continue };
        let (d, first, second) = (around[k], around[(k + 1) % 3], around[(k + 2) % 3]);
        if d == b || edges.0.contains_key(&edge(b, d)) {
            continue;
        }
        // The other triangle is (d, first, second); its edge first–second is split at b.
        edges.remove(t as u32, vertices);
        edges.remove(other as u32, around);
        let (of_b, of_other) = (soup.corners[t][tip], soup.corners[other]);
        let [of_d, of_first, of_second] = [of_other[k], of_other[(k + 1) % 3], of_other[(k + 2) % 3]];
        soup.corners[t] = [of_d, of_first, of_b];
        soup.corners[other] = [of_d, of_b, of_second];
        edges.add(t as u32, [d, first, b]);
        edges.add(other as u32, [d, b, second]);
        report.caps_flipped += 1;
    }
    Ok(())
}
