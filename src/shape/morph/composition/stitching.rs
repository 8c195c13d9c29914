//! Stitching of two closed curves: the vertices of each are inserted into the other, then both are joined one to one.
//!
//! Both are parametrized by arc length, from 0 to 1. The second is reversed, with the offset of the least sum of squared distances
//! between the two. Both get vertices at the union of their parameters, by dividing edges and the triangles beside them.

use std::collections::BTreeMap;

use nalgebra::{Point3, Similarity3};

use super::super::rigid::nearest_similarity;
use super::{LeftTriangles, left_triangles};

/// Samples per curve for comparisons: finer than the edges of usual cuts.
const SAMPLES: usize = 240;

/// Vertices of both curves are merged below this fraction of the shorter adjacent edge: it bounds the aspect of the new triangles.
const MERGE_FRACTION: f64 = 0.25;

/// A closed curve, parametrized by arc length.
#[derive(Clone, Debug)]
pub(super) struct ArcLengthCurve {
    points: Vec<Point3<f64>>,
    /// Normalized arc length at each vertex, from 0.
    at: Vec<f64>,
}

impl ArcLengthCurve {
    pub(super) fn new(points: Vec<Point3<f64>>) -> Self {
        let mut at = vec![0.0];
        for k in 0..points.len() {
            at.push(at[k] + (points[(k + 1) % points.len()] - points[k]).norm());
        }
        let whole = at.pop().filter(|w| *w > 0.0).unwrap_or(1.0);
        Self { points, at: at.into_iter().map(|l| l / whole).collect() }
    }

    /// The point at an arc length, periodic.
    fn point(&self, at: f64) -> Point3<f64> {
        let at = at.rem_euclid(1.0);
        let k = self.at.partition_point(|l| *l <= at).saturating_sub(1);
        let (from, to) = (self.at[k], self.at.get(k + 1).copied().unwrap_or(1.0));
        let t = if to > from { (at - from) / (to - from) } else { 0.0 };
        let (p, q) = (self.points[k], self.points[(k + 1) % self.points.len()]);
        p + (q - p) * t
    }

    fn samples(&self) -> Vec<Point3<f64>> {
        (0..SAMPLES).map(|k| self.point(k as f64 / SAMPLES as f64)).collect()
    }
}

/// Rotation (rad) that counts like a doubled squared distance: nearly symmetric cuts such as necks should not be rotated.
const ROTATION_SCALE: f64 = std::f64::consts::FRAC_PI_4;

/// The similarity from the second curve, reversed, to the first, over all offsets; of nearly equal fits that of the least rotation.
pub(super) fn curve_similarity(first: &ArcLengthCurve, second: &ArcLengthCurve) -> Similarity3<f64> {
    let (a, b) = (first.samples(), second.samples());
    let weights = vec![1.0; SAMPLES];
    let fit = |shift: usize| {
        let shifted: Vec<_> = (0..SAMPLES).map(|k| b[(2 * SAMPLES - k + shift) % SAMPLES]).collect();
        let (map, _) = nearest_similarity(&shifted, &a, &weights, true);
        let error: f64 = shifted.iter().zip(&a).map(|(p, q)| (map * p - q).norm_squared()).sum();
        (error * (1.0 + (map.isometry.rotation.angle() / ROTATION_SCALE).powi(2)), map)
    };
    let fits = (0..SAMPLES).map(fit);
    fits.min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(Similarity3::identity, |f| f.1)
}

/// The arc length on the first curve of the start of the second, reversed.
fn offset_of(first: &ArcLengthCurve, second: &ArcLengthCurve) -> f64 {
    let (a, b) = (first.samples(), second.samples());
    let error = |shift: usize| -> f64 {
        (0..SAMPLES).map(|k| (a[k] - b[(2 * SAMPLES - k + shift) % SAMPLES]).norm_squared()).sum()
    };
    let best = (0..SAMPLES).min_by(|p, q| error(*p).total_cmp(&error(*q))).unwrap_or(0);
    best as f64 / SAMPLES as f64
}

/// A point of a curve: a vertex, or a position on the edge that starts at a vertex, as a fraction of the edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum CurvePoint {
    Vertex(usize),
    Edge(usize, f64),
}

/// Corresponding points of both curves, in the order of the first.
pub(super) fn matched_points(first: &ArcLengthCurve, second: &ArcLengthCurve) -> Vec<(CurvePoint, CurvePoint)> {
    let start = offset_of(first, second);
    // Arc lengths of the second's vertices on the first, ascending.
    let mut other: Vec<(f64, usize)> =
        second.at.iter().enumerate().map(|(k, l)| ((start - l).rem_euclid(1.0), k)).collect();
    other.sort_by(|a, b| a.0.total_cmp(&b.0));
    let near = coincident(&first.at, &other.iter().map(|o| o.0).collect::<Vec<_>>());
    let mut points: Vec<(f64, CurvePoint, CurvePoint)> = Vec::new();
    for (k, &at) in first.at.iter().enumerate() {
        let on_second =
            near.get(&k).map_or_else(|| second.on((start - at).rem_euclid(1.0)), |&o| CurvePoint::Vertex(other[o].1));
        points.push((at, CurvePoint::Vertex(k), on_second));
    }
    let taken: Vec<usize> = near.values().copied().collect();
    for (o, &(at, k)) in other.iter().enumerate().filter(|(o, _)| !taken.contains(o)) {
        debug_assert!(o < other.len());
        points.push((at, first.on(at), CurvePoint::Vertex(k)));
    }
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points.into_iter().map(|(_, a, b)| (a, b)).collect()
}

impl ArcLengthCurve {
    /// The point at an arc length, inside an edge.
    fn on(&self, at: f64) -> CurvePoint {
        let k = self.at.partition_point(|l| *l <= at).saturating_sub(1);
        let (from, to) = (self.at[k], self.at.get(k + 1).copied().unwrap_or(1.0));
        // Never an end of the edge: a new vertex there would coincide with another.
        CurvePoint::Edge(k, ((at - from) / (to - from)).clamp(1e-3, 1.0 - 1e-3))
    }
}

/// For entries of the first list, the entry of the second to merge with; each at most once.
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
        if distance(o) < MERGE_FRACTION * gap(first, k).min(gap(second, o)) {
            near.insert(k, o);
        }
    }
    near
}

/// A surface with a boundary curve that is subdivided.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    pub(super) positions: Vec<Point3<f64>>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Sheet {
    /// Divides the edges of a boundary curve (surface on its left) and the triangles beside them; returns the vertices at the given
    /// points, in their order.
    pub(super) fn divide(&mut self, line: &[u32], points: &[CurvePoint]) -> Vec<u32> {
        let mut fractions: BTreeMap<usize, Vec<(usize, f64)>> = BTreeMap::new();
        let mut vertices = vec![0; points.len()];
        for (w, on) in points.iter().enumerate() {
            match *on {
                CurvePoint::Vertex(k) => vertices[w] = line[k],
                CurvePoint::Edge(k, fraction) => fractions.entry(k).or_default().push((w, fraction)),
            }
        }
        let mut beside = left_triangles(&self.triangles);
        for (k, mut on_edge) in fractions {
            on_edge.sort_by(|a, b| a.1.total_cmp(&b.1));
            let (from, to) = (line[k], line[(k + 1) % line.len()]);
            let (p, q) = (self.positions[from as usize], self.positions[to as usize]);
            let mut chain = vec![from];
            for (w, fraction) in on_edge {
                vertices[w] = self.positions.len() as u32;
                chain.push(vertices[w]);
                self.positions.push(p + (q - p) * fraction);
            }
            chain.push(to);
            self.fan(&chain, &mut beside);
        }
        vertices
    }

    /// Replaces the triangle beside the edge from the chain's first vertex to its last by a fan over the chain.
    fn fan(&mut self, chain: &[u32], beside: &mut LeftTriangles) {
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
    fn nearly_symmetric_curves_are_not_rotated_and_exact_fits_are() {
        // Ovals, blunter to one side; the second is reversed.
        let oval = |blunt: f64, rotation: f64, sign: f64| {
            let point = |k: usize| {
                let (sine, cosine) = (sign * k as f64 / 40.0 * std::f64::consts::TAU).sin_cos();
                let p = Point3::new(2.0 * cosine, (1.0 + blunt * cosine) * sine, 0.0);
                nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), rotation) * p
            };
            ArcLengthCurve::new((0..40).map(point).collect())
        };
        let turned =
            |second: &ArcLengthCurve| curve_similarity(&oval(0.15, 0.0, 1.0), second).isometry.rotation.angle();
        assert!(turned(&oval(-0.05, 0.0, -1.0)) < 0.3);
        for rotation in [0.5, 3.0] {
            assert!((turned(&oval(0.15, rotation, -1.0)) - rotation).abs() < 0.03, "{rotation}");
        }
    }

    fn ring(n: usize, radius: f64, start: f64, backwards: bool) -> ArcLengthCurve {
        let angle = |k: usize| (start + k as f64 / n as f64) * TAU * if backwards { -1.0 } else { 1.0 };
        ArcLengthCurve::new(
            (0..n).map(|k| Point3::new(radius * angle(k).cos(), radius * angle(k).sin(), 0.0)).collect(),
        )
    }

    #[test]
    fn every_vertex_of_both_curves_is_in_the_union_once_and_in_order() {
        for (n, m, start) in [(12, 12, 0.0), (12, 7, 0.13), (5, 40, 0.7), (3, 3, 0.5)] {
            let (first, second) = (ring(n, 1.0, 0.0, false), ring(m, 1.0, start, true));
            let pairs = matched_points(&first, &second);
            let firsts: Vec<usize> =
                pairs.iter().filter_map(|p| if let CurvePoint::Vertex(k) = p.0 { Some(k) } else { None }).collect();
            assert_eq!(firsts, (0..n).collect::<Vec<_>>());
            let mut seconds: Vec<usize> =
                pairs.iter().filter_map(|p| if let CurvePoint::Vertex(k) = p.1 { Some(k) } else { None }).collect();
            // Reversed, with some offset.
            assert_eq!(seconds.windows(2).filter(|w| (w[0] + m - 1) % m != w[1]).count(), 0, "{seconds:?}");
            seconds.sort_unstable();
            assert_eq!(seconds, (0..m).collect::<Vec<_>>());
            let point = |of: &ArcLengthCurve, on: CurvePoint| match on {
                CurvePoint::Vertex(k) => of.points[k],
                CurvePoint::Edge(k, s) => of.points[k] + (of.points[(k + 1) % of.points.len()] - of.points[k]) * s,
            };
            let apart = pairs.iter().map(|p| (point(&first, p.0) - point(&second, p.1)).norm()).fold(0.0, f64::max);
            assert!(apart < 0.75 && (m < 12 || apart < 0.5), "{n} {m}: {apart}");
        }
        assert_eq!(matched_points(&ring(12, 1.0, 0.0, false), &ring(12, 1.0, 0.0, true)).len(), 12);
    }

    #[test]
    fn a_similarity_between_curves_is_recovered() {
        let points: Vec<_> = (0..30)
            .map(|k| f64::from(k) / 30.0 * TAU)
            .map(|a| Point3::new(2.0 * a.cos() + 0.3 * (2.0 * a).cos(), a.sin(), 0.2 * (3.0 * a).sin()))
            .collect();
        let map = Similarity3::new(nalgebra::Vector3::new(3.0, -1.0, 7.0), nalgebra::Vector3::new(0.3, 1.9, -0.8), 2.5);
        let backwards: Vec<_> = points.iter().rev().map(|p| map * p).collect();
        let found = curve_similarity(&ArcLengthCurve::new(points.clone()), &ArcLengthCurve::new(backwards));
        for p in &points {
            // Up to the spacing of the samples.
            assert!((found * (map * p) - p).norm() < 0.05, "{}", (found * (map * p) - p).norm());
        }
    }
}
