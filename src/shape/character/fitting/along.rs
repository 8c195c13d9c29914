//! Joint positions along a path.
//!
//! Joints are at arc-length fractions `0 = t₀ < t₁ < … < t_n = 1` of a path of length `L`; the template has them at `τᵢ`. An elbow belongs in
//! the bend of the path, which the template locates only roughly:
//!
//! ```text
//! min  Σᵢ ∫ dist²(c(t), bone i) dt / L²  +  μ Σᵢ (Δtᵢ − Δτᵢ)² / Δτᵢ
//! ```
//!
//! over a grid of fractions around each `τᵢ`, by dynamic programming, which finds the global minimum. Along a straight path `t = τ`.

use nalgebra::Vector3;

/// `μ`: a bend of 40° outweighs a shift by a tenth of the path's length; noise of 1 % of the length on a straight path moves joints by 4 %.
const STIFFNESS: f64 = 0.005;
/// Grid steps on each side of `τ`, and the step size: joints move by at most a fifth of the path's length.
const STEPS: i32 = 20;
const STEP: f64 = 0.01;
/// Samples of the path: finer than the grid step.
const SAMPLES: usize = 128;
/// Lower bound of a bone's length relative to the template, so that bones do not collapse into a bend.
const MIN_LENGTH_RATIO: f64 = 0.4;
/// Largest number of bones: longer chains are tails or ropes without distinct bends.
const MAX_BONES: usize = 16;

/// A polyline parametrized by arc length.
#[derive(Clone, Debug)]
pub(super) struct Path {
    points: Vec<Vector3<f64>>,
    /// Arc length up to each point.
    upto: Vec<f64>,
}

impl Path {
    /// A path of at least one point.
    pub(super) fn new(points: Vec<Vector3<f64>>) -> Self {
        let mut upto = Vec::with_capacity(points.len());
        let mut sum = 0.0;
        for (i, p) in points.iter().enumerate() {
            sum += if i > 0 { (p - points[i - 1]).norm() } else { 0.0 };
            upto.push(sum);
        }
        Self { points, upto }
    }

    pub(super) fn length(&self) -> f64 {
        self.upto[self.upto.len() - 1]
    }

    /// The point at a fraction of the length.
    pub(super) fn at(&self, fraction: f64) -> Vector3<f64> {
        let wanted = fraction.clamp(0.0, 1.0) * self.length();
        let after = self.upto.partition_point(|u| *u < wanted).clamp(1, self.points.len().max(2) - 1);
        let Some(b) = self.points.get(after) else { return self.points[0] };
        let (from, to) = (self.upto[after - 1], self.upto[after]);
        let t = if to > from { (wanted - from) / (to - from) } else { 0.0 };
        self.points[after - 1].lerp(b, t)
    }
}

/// Fractions `t` that fit the bends, for the template's `τ`, which increase from 0 to 1.
pub(super) fn bent(path: &Path, fractions: &[f64]) -> Vec<f64> {
    let bones = fractions.len() - 1;
    let squared = path.length().powi(2);
    if !(2..=MAX_BONES).contains(&bones) || !(squared > 0.0) {
        return fractions.to_vec();
    }
    let samples: Vec<Vector3<f64>> = (0..SAMPLES).map(|j| path.at(fraction_of(j))).collect();
    let grid = |i: usize| if i == 0 || i == bones { 0..=0 } else { -STEPS..=STEPS };
    let fraction = |i: usize, m: i32| fractions[i] + STEP * f64::from(m);
    let mut least: Vec<f64> = vec![0.0];
    let mut back: Vec<Vec<usize>> = Vec::new();
    for i in 0..bones {
        let wanted = fractions[i + 1] - fractions[i];
        let best = |to: i32| {
            let to = fraction(i + 1, to);
            let cost = |(a, from): (usize, i32)| {
                let (from, before) = (fraction(i, from), least[a]);
                let bone = to - from;
                let possible = before.is_finite() && bone >= MIN_LENGTH_RATIO * wanted && bone > 0.0 && to <= 1.0;
                let strain = STIFFNESS * (bone - wanted).powi(2) / wanted.max(STEP);
                let cost = if possible {
                    before + strain + deviation(path, &samples, from, to) / squared
                } else {
                    f64::INFINITY
                };
                (cost, a)
            };
            grid(i).enumerate().map(cost).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0))
        };
        let (costs, from): (Vec<f64>, Vec<usize>) = grid(i + 1).map(best).unzip();
        (least, back) = (costs, {
            back.push(from);
            back
        });
    }
    if !least[0].is_finite() {
        return fractions.to_vec();
    }
    let mut found = fractions.to_vec();
    let mut at = 0;
    for i in (1..bones).rev() {
        at = back[i][at];
        found[i] = fraction(i, at as i32 - STEPS);
    }
    found
}

fn fraction_of(sample: usize) -> f64 {
    (sample as f64 + 0.5) / SAMPLES as f64
}

/// `∫ dist²(c(t), bone) dt` over the path between two fractions, by its samples.
fn deviation(path: &Path, samples: &[Vector3<f64>], from: f64, to: f64) -> f64 {
    let (a, b) = (path.at(from), path.at(to));
    let along = b - a;
    let squared = along.norm_squared().max(f64::MIN_POSITIVE);
    let index = |fraction: f64| ((fraction * SAMPLES as f64 - 0.5).ceil().max(0.0) as usize).min(SAMPLES);
    let off = |p: &Vector3<f64>| {
        let t = ((p - a).dot(&along) / squared).clamp(0.0, 1.0);
        (p - a - along * t).norm_squared()
    };
    samples[index(from)..index(to).max(index(from))].iter().map(off).sum::<f64>() / SAMPLES as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn along_a_straight_path_joints_keep_their_fractions() {
        let path = Path::new((0..=30).map(|i| Vector3::new(f64::from(i).powf(1.3), 2.0, -1.0)).collect());
        let fractions = [0.0, 0.21, 0.58, 0.9, 1.0];
        assert_eq!(bent(&path, &fractions), fractions);
    }

    #[test]
    fn an_elbow_goes_into_the_bend_near_it() {
        for (angle, bend) in [(90.0_f64, 0.55), (60.0, 0.45), (40.0, 0.57)] {
            let (sin, cos) = angle.to_radians().sin_cos();
            let corner = Vector3::new(bend, 0.0, 0.0);
            let end = corner + Vector3::new(cos, sin, 0.0) * (1.0 - bend);
            let path = Path::new(vec![Vector3::zeros(), corner, end]);
            let elbow = bent(&path, &[0.0, 0.5, 1.0])[1];
            assert!((elbow - bend).abs() <= 0.021, "{angle}°: {elbow} for {bend}");
        }
    }

    #[test]
    fn fractions_increase_for_any_path() {
        let knot = Path::new(
            (0..200)
                .map(|i| f64::from(i) * 0.1)
                .map(|t| Vector3::new((3.1 * t).sin(), t.cos(), (0.7 * t).sin()))
                .collect(),
        );
        let fractions = [0.0, 0.02, 0.04, 0.5, 0.52, 1.0];
        let found = bent(&knot, &fractions);
        assert!(found.windows(2).all(|w| w[0] < w[1]), "{found:?}");
        assert_eq!((found[0], found[5]), (0.0, 1.0));
    }
}
