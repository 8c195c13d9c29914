//! Pieces of great circles, and joining those of one line.

use nalgebra::{Matrix3, SymmetricEigen};

use super::view::View;
use plumbline_camera::Vec3;
use plumbline_image::feature::Segment;
use plumbline_num::math::Vec2;

/// Distance of samples along an edge, px of the view: the shortest edge that is used has four.
const SAMPLE_SPACING: f64 = 4.0;
/// Distance of a piece's ends from the other's circle, px, up to which both are tested for joining: the direction of
/// short pieces is inaccurate.
const MAX_JOIN_DISTANCE: f64 = 4.0;
/// RMS distance from the common circle, px, up to which pieces belong to one line: the ends of edges are accurate to a
/// few tenths.
const MAX_JOIN_RMS: f64 = 0.7;
/// Maximum gap between pieces, as a fraction of their lengths: beyond it, chance alignments outnumber broken lines.
const MAX_GAP: f64 = 0.4;
/// Distance, px, within which a line duplicates a longer one: the two edges of a bar.
const DUPLICATE_DISTANCE: f64 = 5.0;
/// Fraction of a duplicate's length that the other line covers.
const MIN_DUPLICATE_OVERLAP: f64 = 0.6;

/// A piece of a great circle that an edge was seen along.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Arc {
    /// Unit normal of the circle.
    pub(super) normal: Vec3,
    /// Unit direction of the middle.
    pub(super) middle: Vec3,
    /// Half the extent, rad.
    pub(super) half: f64,
    /// Extent along which edges were seen, rad.
    pub(super) seen: f64,
    /// Angle of a pixel of the views, rad.
    pub(super) pixel: f64,
    /// How clear the edge is, in [0, 1]: see [`clarity`].
    pub(super) clarity: f64,
    /// `Σ u uᵀ` over samples.
    moment: Matrix3<f64>,
}

impl Arc {
    /// The arc of an edge of a view; `None` where the view does not look along it.
    pub(super) fn of_segment(view: &View, segment: &Segment) -> Option<Self> {
        let samples = (segment.length() / SAMPLE_SPACING).ceil().max(2.0) as usize;
        let at = |k: usize| segment.start + (segment.end - segment.start) * (k as f64 / samples as f64);
        let rays: Option<Vec<Vec3>> = (0..=samples).map(|k| view.ray(at(k))).collect();
        let rays = rays?;
        let (first, last) = (rays[0], rays[samples]);
        let normal = last.cross(&first).try_normalize(1e-9)?;
        let moment = rays.iter().map(|u| u * u.transpose()).sum();
        let middle = (first + last).normalize();
        let half = 0.5 * first.angle(&last);
        let clarity = clarity(view, segment);
        Some(Self { normal, middle, half, seen: 2.0 * half, pixel: view.pixel_angle(), clarity, moment })
    }

    /// The direction at an angle from the middle, rad.
    pub(super) fn at(&self, angle: f64) -> Vec3 {
        self.middle * angle.cos() + self.ahead() * angle.sin()
    }

    /// Unit direction from the middle onwards.
    fn ahead(&self) -> Vec3 {
        self.middle.cross(&self.normal)
    }

    /// Angle of a direction's foot on the circle from the middle, rad.
    fn angle_of(&self, u: &Vec3) -> f64 {
        u.dot(&self.ahead()).atan2(u.dot(&self.middle))
    }

    /// Both ends.
    fn ends(&self) -> [Vec3; 2] {
        [self.at(-self.half), self.at(self.half)]
    }

    /// Extent of another arc from the middle of this one.
    fn extent_of(&self, other: &Self) -> [f64; 2] {
        let [a, b] = other.ends().map(|u| self.angle_of(&u));
        let m = self.angle_of(&other.middle);
        // The middle determines on which side of the antipode the ends are.
        let near = |v: f64| v + std::f64::consts::TAU * ((m - v) / std::f64::consts::TAU).round();
        let (a, b) = (near(a), near(b));
        [a.min(b), a.max(b)]
    }

    /// The arc of both pieces, where they are pieces of one line. Which side is brighter does not matter: along a row of
    /// tiles it changes from one to the next.
    fn joined(&self, other: &Self) -> Option<Self> {
        let tolerance = MAX_JOIN_DISTANCE * self.pixel.max(other.pixel);
        if !(self.normal.dot(&other.normal).abs() > 0.9)
            || other.ends().iter().any(|u| self.normal.dot(u).abs() > tolerance)
        {
            return None;
        }
        let [from, to] = self.extent_of(other);
        let gap = (from - self.half).max(-self.half - to);
        let lengths = 2.0 * (self.half + other.half);
        if gap > MAX_GAP * lengths {
            return None;
        }
        let moment = self.moment + other.moment;
        let eigen = SymmetricEigen::new(moment);
        let least = eigen.eigenvalues.imin();
        let rms = (eigen.eigenvalues[least].max(0.0) / moment.trace()).sqrt();
        if !(rms <= MAX_JOIN_RMS * self.pixel.max(other.pixel)) {
            return None;
        }
        let normal: Vec3 = eigen.eigenvectors.column(least).into_owned();
        let normal = normal * normal.dot(&self.normal).signum();
        let (from, to) = (from.min(-self.half), to.max(self.half));
        let middle = self.at(0.5 * (from + to));
        let middle = (middle - normal * normal.dot(&middle)).try_normalize(0.5)?;
        let overlap = lengths - (to - from);
        let seen = (self.seen + other.seen - overlap.max(0.0)).min(to - from);
        let pixel = self.pixel.max(other.pixel);
        let clarity = (self.clarity * self.seen + other.clarity * other.seen) / (self.seen + other.seen);
        Some(Self { normal, middle, half: 0.5 * (to - from), seen, pixel, clarity, moment })
    }

    /// Whether this one, the shorter, adds nothing to `other`.
    fn repeats(&self, other: &Self) -> bool {
        let near = |u: &Vec3| other.normal.dot(u).abs() < DUPLICATE_DISTANCE * self.pixel;
        if !self.ends().iter().all(near) {
            return false;
        }
        let [from, to] = other.extent_of(self);
        let common = to.min(other.half) - from.max(-other.half);
        common > MIN_DUPLICATE_OVERLAP * (to - from)
    }
}

/// How much an edge looks like one of a built thing: `(min(1, c₁ / s c₃) · min(1, c/20))²`, with `c₁` and `c₃` the mean
/// steps in gray within one and three pixels of it, `c` the larger, and `s` the least `c₁/c₃` of a sharp edge in the
/// view. On photos whose edges were classified by hand, `c₁/c₃` was about 0.6 for clouds and above 1 for buildings, `c`
/// about 10 for snow and water and above 20 for buildings.
fn clarity(view: &View, segment: &Segment) -> f64 {
    const SAMPLES: usize = 16;
    let along = segment.direction();
    let across = Vec2::new(-along.y, along.x);
    let step = |reach: f64| {
        let samples = (0..SAMPLES).filter_map(|k| {
            let p = segment.start + (segment.end - segment.start) * ((k as f64 + 0.5) / SAMPLES as f64);
            Some((view.gray(p + across * reach)? - view.gray(p - across * reach)?).abs())
        });
        let (n, sum) = samples.fold((0.0, 0.0), |(n, sum), d| (n + 1.0, sum + f64::from(d)));
        if n > 0.0 { sum / n } else { 0.0 }
    };
    let (near, far) = (step(1.2), step(3.0));
    let full = view.sharpness() * far;
    let sharp = if near >= full { 1.0 } else { near / full };
    (sharp * (near.max(far) / 20.0).min(1.0)).powi(2)
}

/// Joins pieces of one line, long ones first, until no two are left that fit.
pub(super) fn joined(mut arcs: Vec<Arc>) -> Vec<Arc> {
    loop {
        let before = arcs.len();
        longest_first(&mut arcs);
        let mut lines: Vec<Arc> = Vec::with_capacity(before);
        for arc in arcs {
            let fit = lines.iter().enumerate().find_map(|(i, line)| Some((i, line.joined(&arc)?)));
            match fit {
                Some((i, line)) => lines[i] = line,
                None => lines.push(arc),
            }
        }
        if lines.len() == before {
            return lines;
        }
        arcs = lines;
    }
}

/// Drops lines that lie along a longer one, as the second edge of a bar does.
pub(super) fn without_repeats(mut arcs: Vec<Arc>) -> Vec<Arc> {
    longest_first(&mut arcs);
    let mut kept: Vec<Arc> = Vec::with_capacity(arcs.len());
    for arc in arcs {
        if !kept.iter().any(|other| arc.repeats(other)) {
            kept.push(arc);
        }
    }
    kept
}

fn longest_first(arcs: &mut [Arc]) {
    arcs.sort_by(|a, b| b.seen.total_cmp(&a.seen));
}
