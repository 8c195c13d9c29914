//! Regions of agreeing level lines, and their rectangles.

use std::f64::consts::PI;

use super::gradient::LevelLines;
use super::rectangle::Rectangle;
use super::{DENSITY, MEANINGFULNESS, TOLERANCE};
use plumbline_num::math::{Point2, Vec2};

/// Factor by which the radius of a region that is too sparse is reduced about its seed; as in the paper.
const RADIUS_FACTOR: f64 = 0.75;

/// Grows one region after the other; a node belongs to one at most.
#[derive(Debug)]
pub(super) struct RegionGrower<'a> {
    lines: &'a LevelLines,
    taken: Vec<bool>,
    /// Nodes of the present region, the seed first.
    region: Vec<usize>,
    /// Sum of their unit vectors.
    sum: [f32; 2],
    /// `log₁₀` of the number of rectangles that could be tried.
    log_tests: f64,
    /// Fewest nodes that could be meaningful: even if all were aligned, fewer would not.
    min_size: usize,
}

impl<'a> RegionGrower<'a> {
    pub(super) fn new(lines: &'a LevelLines) -> Self {
        let log_tests = 2.5 * (lines.len().max(1) as f64).log10();
        let precision = TOLERANCE / PI;
        let min_size = ((log_tests + MEANINGFULNESS) / -precision.log10()).max(2.0) as usize;
        let taken = vec![false; lines.len()];
        Self { lines, taken, region: Vec::new(), sum: [0.0; 2], log_tests, min_size }
    }

    /// The meaningful rectangle around `seed`, if there is one and the seed is free.
    pub(super) fn grow(&mut self, seed: usize) -> Option<Rectangle> {
        if self.taken[seed] {
            return None;
        }
        self.spread(seed, TOLERANCE);
        if self.region.len() < self.min_size {
            return None;
        }
        let rectangle = self.dense_rectangle()?.scored(self.lines, self.log_tests);
        let best = rectangle.improved(self.lines, self.log_tests, MEANINGFULNESS);
        (best.score >= MEANINGFULNESS).then_some(best)
    }

    /// Collects the free nodes that connect to `seed` and whose level line lies within `tolerance` of the region's.
    fn spread(&mut self, seed: usize, tolerance: f64) {
        let cosine_sq = (tolerance.cos() * tolerance.cos()) as f32;
        let (w, h) = (self.lines.width(), self.lines.height());
        self.region.clear();
        self.sum = [0.0; 2];
        self.join(seed);
        let mut next = 0;
        while next < self.region.len() {
            let (x, y) = (self.region[next] % w, self.region[next] / w);
            next += 1;
            for v in y.saturating_sub(1)..(y + 2).min(h) {
                for u in x.saturating_sub(1)..(x + 2).min(w) {
                    let i = v * w + u;
                    if self.taken[i] {
                        continue;
                    }
                    let line = self.lines.at(i);
                    let [sx, sy] = self.sum;
                    let dot = line.along[0] * sx + line.along[1] * sy;
                    if line.norm > 0.0 && dot > 0.0 && dot * dot >= cosine_sq * (sx * sx + sy * sy) {
                        self.join(i);
                    }
                }
            }
        }
    }

    fn join(&mut self, i: usize) {
        self.taken[i] = true;
        self.region.push(i);
        let line = self.lines.at(i);
        self.sum = [self.sum[0] + line.along[0], self.sum[1] + line.along[1]];
    }

    /// The rectangle of the region, the region made denser where it fills it too thinly: curved edges and corners are
    /// caught here.
    fn dense_rectangle(&mut self) -> Option<Rectangle> {
        let rectangle = self.rectangle()?;
        if self.density(&rectangle) >= DENSITY {
            return Some(rectangle);
        }
        let seed = self.region[0];
        let tighter = self.spread_near(seed, rectangle.width());
        for i in self.region.drain(..) {
            self.taken[i] = false;
        }
        self.spread(seed, tighter.min(TOLERANCE));
        let mut rectangle = self.rectangle()?;
        let center = self.lines.position(seed);
        let far = |r: &Rectangle| {
            let normal = Vec2::new(-r.along.y, r.along.x);
            let corner = |s: f64, t: f64| r.center + r.along * s + normal * t;
            let ends = r.length.into_iter().flat_map(|s| r.across.map(|t| corner(s, t)));
            ends.map(|c| (c - center).norm()).fold(0.0, f64::max)
        };
        let mut radius = far(&rectangle);
        while self.density(&rectangle) < DENSITY {
            radius *= RADIUS_FACTOR;
            self.cut_back(center, radius);
            if self.region.len() < self.min_size {
                return None;
            }
            rectangle = self.rectangle()?;
        }
        Some(rectangle)
    }

    /// Twice the standard deviation of the level lines within `reach` of the seed around the seed's own, rad.
    fn spread_near(&self, seed: usize, reach: f64) -> f64 {
        let (center, own) = (self.lines.position(seed), self.lines.at(seed).along);
        let (mut sum, mut squares, mut n) = (0.0, 0.0, 0.0);
        for &i in &self.region {
            if (self.lines.position(i) - center).norm() < reach {
                let [x, y] = self.lines.at(i).along;
                let angle = f64::from(own[0] * y - own[1] * x).atan2(f64::from(own[0] * x + own[1] * y));
                sum += angle;
                squares += angle * angle;
                n += 1.0;
            }
        }
        2.0 * (squares / n - (sum / n) * (sum / n)).max(0.0).sqrt()
    }

    /// Lets go of the nodes farther than `radius` from `center`.
    fn cut_back(&mut self, center: Point2, radius: f64) {
        let (lines, taken) = (self.lines, &mut self.taken);
        self.region.retain(|&i| {
            let near = (lines.position(i) - center).norm() <= radius;
            taken[i] &= near;
            near
        });
    }

    /// Share of the rectangle that the region fills.
    fn density(&self, rectangle: &Rectangle) -> f64 {
        self.region.len() as f64 / (rectangle.length() * rectangle.width())
    }

    /// The rectangle around the region along its main axis of inertia, nodes weighing by their level lines' weights. `None` for fewer
    /// than two nodes.
    fn rectangle(&self) -> Option<Rectangle> {
        if self.region.len() < 2 {
            return None;
        }
        let origin = self.lines.position(self.region[0]);
        let weighted =
            || self.region.iter().map(|&i| (f64::from(self.lines.at(i).weight), self.lines.position(i) - origin));
        let (mass, moment) = weighted().fold((0.0, Vec2::zeros()), |(m, s), (w, d)| (m + w, s + d * w));
        let mean = moment / mass;
        let center = origin + mean;
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (w, d) in weighted() {
            let d = d - mean;
            (xx, xy, yy) = (xx + w * d.x * d.x, xy + w * d.x * d.y, yy + w * d.y * d.y);
        }
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        let axis = Vec2::new(angle.cos(), angle.sin());
        let run = Vec2::new(f64::from(self.sum[0]), f64::from(self.sum[1]));
        let along = if axis.dot(&run) < 0.0 { -axis } else { axis };
        let normal = Vec2::new(-along.y, along.x);
        let (mut length, mut across) = ([0.0_f64; 2], [0.0_f64; 2]);
        for &i in &self.region {
            let d = self.lines.position(i) - center;
            let (s, t) = (d.dot(&along), d.dot(&normal));
            length = [length[0].min(s), length[1].max(s)];
            across = [across[0].min(t), across[1].max(t)];
        }
        let precision = TOLERANCE / PI;
        Some(Rectangle { center, along, length, across, precision, score: 0.0 })
    }
}
