//! Triangles without area, taken out without leaving a crack.
//!
//! A *needle* has a side that is a `flat`-th of its longest: that side collapses. A *cap* has its tip on its longest side: that side
//! is flipped, so that the triangle across it is cut in two at the tip. What can neither collapse nor flip is dropped.

use std::collections::HashMap;

use super::{RepairReport, Soup};
use plumbline_num::run::{Run, Stopped};

/// Rounds of collapses and flips: each collapse or flip may flatten a neighbor, of which long chains are not seen.
const ROUNDS: usize = 8;

/// Several triangles at an edge, or too many.
const CROWDED: u32 = u32::MAX;

/// Removes all triangles whose height is at most the fraction `flat` of their longest side.
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

/// Lengths of the sides opposite to each corner, and twice the area.
fn sides(soup: &Soup<'_>, vertices: [u32; 3]) -> ([f64; 3], f64) {
    let [a, b, c] = vertices.map(|v| soup.position(v));
    ([(c - b).norm(), (a - c).norm(), (b - a).norm()], (b - a).cross(&(c - a)).norm())
}

fn is_flat(soup: &Soup<'_>, vertices: [u32; 3], flat: f64) -> bool {
    let (lengths, twice_area) = sides(soup, vertices);
    let longest = lengths.into_iter().fold(0.0, f64::max);
    !(twice_area > flat * longest * longest)
}

fn flat_ones(soup: &Soup<'_>, flat: f64) -> Vec<usize> {
    (0..soup.corners.len()).filter(|&t| is_flat(soup, soup.vertices(t), flat)).collect()
}

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

/// Which two triangles each edge has.
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
            // A crowded edge stays so: it is not to be flipped.
            if let Some(pair) = self.0.get_mut(&edge(p, q)).filter(|pair| pair[1] != CROWDED) {
                *pair = if pair[0] == t { [pair[1], CROWDED - 1] } else { [pair[0], CROWDED - 1] };
            }
            if self.0.get(&edge(p, q)).is_some_and(|pair| pair[0] == CROWDED - 1) {
                self.0.remove(&edge(p, q));
            }
        }
    }

    /// The other triangle at the edge between two vertices, where there is exactly one.
    fn across(&self, t: u32, p: u32, q: u32) -> Option<u32> {
        match *self.0.get(&edge(p, q))? {
            [_, CROWDED] => None,
            [first, second] if first == t => Some(second),
            [first, _] => Some(first),
        }
        .filter(|&other| other < CROWDED - 1)
    }
}

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
        // The other triangle is (d, first, second), its side first–second is cut at b.
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
