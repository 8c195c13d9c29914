//! Joints along a path.
//!
//! Joints `0 = t₀ < t₁ < … < t_n = 1` by share of the path's length `L`; the template has them at `τᵢ`. An elbow belongs in the bend, which
//! the template cannot know to the last percent:
//!
//! ```text
//! min  Σᵢ ∫ dist²(c(t), bone i) dt / L²  +  μ Σᵢ (Δtᵢ − Δτᵢ)² / Δτᵢ
//! ```
//!
//! over a grid of shares about each `τᵢ`, by dynamic programming, so that the least is found. Along a straight path it is `t = τ`.

use nalgebra::Vector3;

/// `μ`: a bend of 40° outweighs a difference of a tenth of the path's length; unrest of a straight path by 1 % of its length moves joints
/// by 4 %.
const STIFFNESS: f64 = 0.005;
/// Shares tried to each side of `τ`, and the step between them.
const STEPS: i32 = 20;
const STEP: f64 = 0.01;
/// Samples of the path.
const SAMPLES: usize = 128;
/// A bone keeps at least this share of its length in the template.
const MIN_LENGTH_RATIO: f64 = 0.4;
/// A path of more bones has no bends of its own: it is a tail or a rope.
const MAX_BONES: usize = 16;

/// Points in a row, by share of their length.
#[derive(Clone, Debug)]
pub(super) struct Path {
    points: Vec<Vector3<f64>>,
    /// Length up to each point.
    upto: Vec<f64>,
}

impl Path {
    /// A path of one point or more.
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

    /// The point at a share of the length.
    pub(super) fn at(&self, share: f64) -> Vector3<f64> {
        let wanted = share.clamp(0.0, 1.0) * self.length();
        let after = self.upto.partition_point(|u| *u < wanted).clamp(1, self.points.len().max(2) - 1);
        let Some(b) = self.points.get(after) else { return self.points[0] };
        let (from, to) = (self.upto[after - 1], self.upto[after]);
        let t = if to > from { (wanted - from) / (to - from) } else { 0.0 };
        self.points[after - 1].lerp(b, t)
    }
}

/// Shares `t` for the template's `τ`, which rise from 0 to 1.
pub(super) fn bent(path: &Path, shares: &[f64]) -> Vec<f64> {
    let bones = shares.len() - 1;
    let squared = path.length().powi(2);
    if !(2..=MAX_BONES).contains(&bones) || !(squared > 0.0) {
        return shares.to_vec();
    }
    let samples: Vec<Vector3<f64>> = (0..SAMPLES).map(|j| path.at(share_of(j))).collect();
    let grid = |i: usize| if i == 0 || i == bones { 0..=0 } else { -STEPS..=STEPS };
    let share = |i: usize, m: i32| shares[i] + STEP * f64::from(m);
    let mut least: Vec<f64> = vec![0.0];
    let mut back: Vec<Vec<usize>> = Vec::new();
    for i in 0..bones {
        let wanted = shares[i + 1] - shares[i];
        let best = |to: i32| {
            let to = share(i + 1, to);
            let cost = |(a, from): (usize, i32)| {
                let (from, before) = (share(i, from), least[a]);
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
        return shares.to_vec();
    }
    let mut found = shares.to_vec();
    let mut at = 0;
    for i in (1..bones).rev() {
        at = back[i][at];
        found[i] = share(i, at as i32 - STEPS);
    }
    found
}

fn share_of(sample: usize) -> f64 {
    (sample as f64 + 0.5) / SAMPLES as f64
}

/// `∫ dist²(c(t), bone) dt` over the part of the path from one share to another, by its samples.
fn deviation(path: &Path, samples: &[Vector3<f64>], from: f64, to: f64) -> f64 {
    let (a, b) = (path.at(from), path.at(to));
    let along = b - a;
    let squared = along.norm_squared().max(f64::MIN_POSITIVE);
    let index = |share: f64| ((share * SAMPLES as f64 - 0.5).ceil().max(0.0) as usize).min(SAMPLES);
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
    fn along_a_straight_path_joints_keep_their_shares() {
        let path = Path::new((0..=30).map(|i| Vector3::new(f64::from(i).powf(1.3), 2.0, -1.0)).collect());
        let shares = [0.0, 0.21, 0.58, 0.9, 1.0];
        assert_eq!(bent(&path, &shares), shares);
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
    fn shares_rise_however_the_path_turns() {
        let knot = Path::new(
            (0..200)
                .map(|i| f64::from(i) * 0.1)
                .map(|t| Vector3::new((3.1 * t).sin(), t.cos(), (0.7 * t).sin()))
                .collect(),
        );
        let shares = [0.0, 0.02, 0.04, 0.5, 0.52, 1.0];
        let found = bent(&knot, &shares);
        assert!(found.windows(2).all(|w| w[0] < w[1]), "{found:?}");
        assert_eq!((found[0], found[5]), (0.0, 1.0));
    }
}
