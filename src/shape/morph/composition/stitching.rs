//! Two loops become one: each gains the vertices of the other, then they are joined one to one.
//!
//! Both are measured by their length, from 0 to 1. The second runs the other way, and starts where the sum of squared distances
//! between the two is least. At the union of both sets of lengths both have vertices: where one has none its edge is divided there,
//! and the triangle beside it.

use std::collections::BTreeMap;

use nalgebra::{Point3, Similarity3};

use super::super::rigid::nearest_similarity;

/// Places along a loop at which two are compared.
const SAMPLES: usize = 240;

/// Vertices of both loops that are nearer to each other than this share of the shorter edge beside them become one.
const SAME: f64 = 0.25;

/// A closed line, its vertices by length.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    points: Vec<Point3<f64>>,
    /// Length at each vertex, from 0, of a whole of 1.
    at: Vec<f64>,
}

impl Measured {
    pub(super) fn new(points: Vec<Point3<f64>>) -> Self {
        let mut at = vec![0.0];
        for k in 0..points.len() {
            at.push(at[k] + (points[(k + 1) % points.len()] - points[k]).norm());
        }
        let whole = at.pop().filter(|w| *w > 0.0).unwrap_or(1.0);
        Self { points, at: at.into_iter().map(|l| l / whole).collect() }
    }

    /// The place at a length, round and round.
    fn place(&self, at: f64) -> Point3<f64> {
        let at = at.rem_euclid(1.0);
        let k = self.at.partition_point(|l| *l <= at).saturating_sub(1);
        let (from, to) = (self.at[k], self.at.get(k + 1).copied().unwrap_or(1.0));
        let share = if to > from { (at - from) / (to - from) } else { 0.0 };
        let (p, q) = (self.points[k], self.points[(k + 1) % self.points.len()]);
        p + (q - p) * share
    }

    fn samples(&self) -> Vec<Point3<f64>> {
        (0..SAMPLES).map(|k| self.place(k as f64 / SAMPLES as f64)).collect()
    }
}

/// A turn by this much (rad) counts like twice the squared distance. Necks are nearly as good turned around; heads are not.
const TURN: f64 = std::f64::consts::FRAC_PI_4;

/// The similarity that brings the second loop, run backwards, nearest to the first, of all places where it may start; of loops that fit nearly as
/// well in several ways the one that turns the least.
pub(super) fn loop_similarity(first: &Measured, second: &Measured) -> Similarity3<f64> {
    let (a, b) = (first.samples(), second.samples());
    let weights = vec![1.0; SAMPLES];
    let fit = |shift: usize| {
        let turned: Vec<_> = (0..SAMPLES).map(|k| b[(2 * SAMPLES - k + shift) % SAMPLES]).collect();
        let (map, _) = nearest_similarity(&turned, &a, &weights, true);
        let misfit: f64 = turned.iter().zip(&a).map(|(p, q)| (map * p - q).norm_squared()).sum();
        (misfit * (1.0 + (map.isometry.rotation.angle() / TURN).powi(2)), map)
    };
    let fits = (0..SAMPLES).map(fit);
    fits.min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(Similarity3::identity, |f| f.1)
}

/// Where the second loop, run backwards, starts on the first: its length there.
fn start_of(first: &Measured, second: &Measured) -> f64 {
    let (a, b) = (first.samples(), second.samples());
    let misfit = |shift: usize| -> f64 {
        (0..SAMPLES).map(|k| (a[k] - b[(2 * SAMPLES - k + shift) % SAMPLES]).norm_squared()).sum()
    };
    let best = (0..SAMPLES).min_by(|p, q| misfit(*p).total_cmp(&misfit(*q))).unwrap_or(0);
    best as f64 / SAMPLES as f64
}

/// One place of both loops: the vertex there, or the edge (from this vertex on) and the share of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum On {
    Vertex(usize),
    Edge(usize, f64),
}

/// The places of both loops that become one another, in the order of the first.
pub(super) fn matched(first: &Measured, second: &Measured) -> Vec<(On, On)> {
    let start = start_of(first, second);
    // Lengths of the second's vertices on the first, ascending.
    let mut other: Vec<(f64, usize)> =
        second.at.iter().enumerate().map(|(k, l)| ((start - l).rem_euclid(1.0), k)).collect();
    other.sort_by(|a, b| a.0.total_cmp(&b.0));
    let near = coincident(&first.at, &other.iter().map(|o| o.0).collect::<Vec<_>>());
    let mut places: Vec<(f64, On, On)> = Vec::new();
    for (k, &at) in first.at.iter().enumerate() {
        let on_second =
            near.get(&k).map_or_else(|| second.on((start - at).rem_euclid(1.0)), |&o| On::Vertex(other[o].1));
        places.push((at, On::Vertex(k), on_second));
    }
    let taken: Vec<usize> = near.values().copied().collect();
    for (o, &(at, k)) in other.iter().enumerate().filter(|(o, _)| !taken.contains(o)) {
        debug_assert!(o < other.len());
        places.push((at, first.on(at), On::Vertex(k)));
    }
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    places.into_iter().map(|(_, a, b)| (a, b)).collect()
}

impl Measured {
    /// The edge at a length, and the share of it that has been passed.
    fn on(&self, at: f64) -> On {
        let k = self.at.partition_point(|l| *l <= at).saturating_sub(1);
        let (from, to) = (self.at[k], self.at.get(k + 1).copied().unwrap_or(1.0));
        // Never an end: a vertex made there would lie on another.
        On::Edge(k, ((at - from) / (to - from)).clamp(1e-3, 1.0 - 1e-3))
    }
}

/// For entries of the first list, that of the second which is so near that both become one; each at most once.
fn coincident(first: &[f64], second: &[f64]) -> BTreeMap<usize, usize> {
    let gap = |list: &[f64], k: usize| {
        let n = list.len();
        let before = (list[k] - list[(k + n - 1) % n]).rem_euclid(1.0);
        let after = (list[(k + 1) % n] - list[k]).rem_euclid(1.0);
        before.min(after)
    };
    let mut near = BTreeMap::new();
    for k in 0..first.len() {
        let distance = |o: usize| {
            let d = (first[k] - second[o]).rem_euclid(1.0);
            d.min(1.0 - d)
        };
        let from = second.partition_point(|s| *s < first[k]);
        let n = second.len();
        let best = [from + n - 1, from].map(|o| o % n).into_iter().min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        let Some(o) = best else { continue };
        if distance(o) < SAME * gap(first, k).min(gap(second, o)) {
            near.insert(k, o);
        }
    }
    near
}

/// A surface whose boundary loop gains vertices.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    pub(super) positions: Vec<Point3<f64>>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Sheet {
    /// Divides the edges of a loop (surface to its left) at ascending shares, and the triangles beside them; returns the loop's
    /// vertices at the wanted places, in their order.
    pub(super) fn divide(&mut self, line: &[u32], wanted: &[On]) -> Vec<u32> {
        let mut shares: BTreeMap<usize, Vec<(usize, f64)>> = BTreeMap::new();
        let mut vertices = vec![0; wanted.len()];
        for (w, on) in wanted.iter().enumerate() {
            match *on {
                On::Vertex(k) => vertices[w] = line[k],
                On::Edge(k, share) => shares.entry(k).or_default().push((w, share)),
            }
        }
        let mut beside: BTreeMap<(u32, u32), usize> = BTreeMap::new();
        for (t, &[a, b, c]) in self.triangles.iter().enumerate() {
            beside.extend([(a, b), (b, c), (c, a)].map(|e| (e, t)));
        }
        for (k, mut on_edge) in shares {
            on_edge.sort_by(|a, b| a.1.total_cmp(&b.1));
            let (from, to) = (line[k], line[(k + 1) % line.len()]);
            let (p, q) = (self.positions[from as usize], self.positions[to as usize]);
            let mut chain = vec![from];
            for (w, share) in on_edge {
                vertices[w] = self.positions.len() as u32;
                chain.push(vertices[w]);
                self.positions.push(p + (q - p) * share);
            }
            chain.push(to);
            self.fan(&chain, &mut beside);
        }
        vertices
    }

    /// The triangle beside the edge from the chain's first vertex to its last becomes a fan over the chain.
    fn fan(&mut self, chain: &[u32], beside: &mut BTreeMap<(u32, u32), usize>) {
        let (from, to) = (chain[0], chain[chain.len() - 1]);
        let Some(t) = beside.remove(&(from, to)) else { return };
        let Some(apex) = self.triangles[t].into_iter().find(|v| *v != from && *v != to) else { return };
        for (k, pair) in chain.windows(2).enumerate() {
            let triangle = [pair[0], pair[1], apex];
            let number = if k == 0 { t } else { self.triangles.len() };
            if k == 0 {
                self.triangles[t] = triangle;
            } else {
                self.triangles.push(triangle);
            }
            let [a, b, c] = triangle;
            beside.extend([(a, b), (b, c), (c, a)].map(|e| (e, number)));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[test]
    fn a_loop_that_fits_nearly_as_well_turned_around_is_not_turned_and_one_that_fits_exactly_is() {
        // Ovals, blunter to one side by a share; the second runs the other way.
        let oval = |blunt: f64, turn: f64, sign: f64| {
            let point = |k: usize| {
                let (sine, cosine) = (sign * k as f64 / 40.0 * std::f64::consts::TAU).sin_cos();
                let p = Point3::new(2.0 * cosine, (1.0 + blunt * cosine) * sine, 0.0);
                nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), turn) * p
            };
            Measured::new((0..40).map(point).collect())
        };
        let turned = |second: &Measured| loop_similarity(&oval(0.15, 0.0, 1.0), second).isometry.rotation.angle();
        assert!(turned(&oval(-0.05, 0.0, -1.0)) < 0.3);
        for turn in [0.5, 3.0] {
            assert!((turned(&oval(0.15, turn, -1.0)) - turn).abs() < 0.03, "{turn}");
        }
    }

    fn ring(n: usize, radius: f64, start: f64, backwards: bool) -> Measured {
        let angle = |k: usize| (start + k as f64 / n as f64) * TAU * if backwards { -1.0 } else { 1.0 };
        Measured::new((0..n).map(|k| Point3::new(radius * angle(k).cos(), radius * angle(k).sin(), 0.0)).collect())
    }

    #[test]
    fn every_vertex_of_both_loops_is_in_the_union_once_and_in_order() {
        for (n, m, start) in [(12, 12, 0.0), (12, 7, 0.13), (5, 40, 0.7), (3, 3, 0.5)] {
            let (first, second) = (ring(n, 1.0, 0.0, false), ring(m, 1.0, start, true));
            let pairs = matched(&first, &second);
            let firsts: Vec<usize> =
                pairs.iter().filter_map(|p| if let On::Vertex(k) = p.0 { Some(k) } else { None }).collect();
            assert_eq!(firsts, (0..n).collect::<Vec<_>>());
            let mut seconds: Vec<usize> =
                pairs.iter().filter_map(|p| if let On::Vertex(k) = p.1 { Some(k) } else { None }).collect();
            // Backwards, from somewhere.
            assert_eq!(seconds.windows(2).filter(|w| (w[0] + m - 1) % m != w[1]).count(), 0, "{seconds:?}");
            seconds.sort_unstable();
            assert_eq!(seconds, (0..m).collect::<Vec<_>>());
            let place = |of: &Measured, on: On| match on {
                On::Vertex(k) => of.points[k],
                On::Edge(k, s) => of.points[k] + (of.points[(k + 1) % of.points.len()] - of.points[k]) * s,
            };
            let apart = pairs.iter().map(|p| (place(&first, p.0) - place(&second, p.1)).norm()).fold(0.0, f64::max);
            assert!(apart < 0.75 && (m < 12 || apart < 0.5), "{n} {m}: {apart}");
        }
        assert_eq!(matched(&ring(12, 1.0, 0.0, false), &ring(12, 1.0, 0.0, true)).len(), 12);
    }

    #[test]
    fn a_loop_turned_moved_and_scaled_is_brought_back() {
        let points: Vec<_> = (0..30)
            .map(|k| f64::from(k) / 30.0 * TAU)
            .map(|a| Point3::new(2.0 * a.cos() + 0.3 * (2.0 * a).cos(), a.sin(), 0.2 * (3.0 * a).sin()))
            .collect();
        let map = Similarity3::new(nalgebra::Vector3::new(3.0, -1.0, 7.0), nalgebra::Vector3::new(0.3, 1.9, -0.8), 2.5);
        let backwards: Vec<_> = points.iter().rev().map(|p| map * p).collect();
        let found = loop_similarity(&Measured::new(points.clone()), &Measured::new(backwards));
        for p in &points {
            // As near as the samples lie.
            assert!((found * (map * p) - p).norm() < 0.05, "{}", (found * (map * p) - p).norm());
        }
    }
}
