//! What the edges of lines have in common under a lens that is not quite theirs.
//!
//! A point at `v` from the center is seen `v (a ρ² + b ρ⁴)` from where the lens says, `ρ` its distance in half diagonals. To first
//! order the distance of a sample from its great circle changes by the part of that across the circle, and by turning the circle
//! itself, which is eliminated line by line. Some lines are none, so that each has the weight
//!
//! ```text
//! 1 / (1 + (bend / s)²)²
//! ```
//!
//! (Geman and McClure 1985) by its largest distance, with a scale `s` that decreases from the usual bend to the noise of an edge.

use nalgebra::{Matrix2, Matrix3x2, Vector2};

use crate::{Sight, best_circle};
use plumbline_camera::{Lens, Vec3};
use plumbline_num::math::{Point2, Vec2};

/// Rounds of the estimate, by how much the scale decreases in each, and the least scale, px: the noise of an edge, which is reached from
/// 60 px.
const ROUNDS: usize = 12;
const SHRINK: f64 = 0.6;
const MIN_SCALE: f64 = 0.25;
/// Pull of the terms to zero, in px² of their squares: lines through the center say nothing of them.
const PULL: f64 = 1e-6;

/// A radial error of a lens, in the picture.
pub(super) struct RadialError {
    center: Point2,
    /// Half the diagonal, px.
    radius: f64,
    /// How many of the terms are there.
    count: usize,
    terms: Vector2<f64>,
}

/// Of one line: its largest distance from its great circle, px, and the normal equations of further terms.
struct Equations {
    bend: f64,
    moment: Matrix2<f64>,
    right: Vector2<f64>,
}

impl RadialError {
    /// Most terms. With a third one, waves become lines of a lens that there is none of; of boards under wrong lenses it makes no more
    /// lines straight.
    pub(super) const TERMS: usize = 2;

    /// That of `count` terms which most edges, each some points, have in common.
    pub(super) fn common(edges: &[&[Point2]], lens: &Lens, count: usize) -> Self {
        let radius = 0.5 * lens.size.0.hypot(lens.size.1);
        let mut error = Self { center: lens.center, radius, count, terms: Vector2::zeros() };
        let mut scale = f64::INFINITY;
        for _ in 0..if count == 0 { 0 } else { ROUNDS } {
            let equations: Vec<Equations> = edges.iter().filter_map(|edge| error.equations(edge, lens)).collect();
            let usual = Self::usual(equations.iter().map(|of_line| of_line.bend).collect());
            scale = (SHRINK * scale).min(usual).max(MIN_SCALE);
            let (mut moment, mut right) = (Matrix2::identity() * PULL, Vector2::zeros());
            for of_line in &equations {
                let weight = (1.0 + (of_line.bend / scale).powi(2)).powi(-2);
                moment += of_line.moment * weight;
                right += of_line.right * weight;
            }
            let Some(step) = moment.cholesky().map(|factor| factor.solve(&right)) else { break };
            error.terms += step;
        }
        error
    }

    /// The lower median: of two or four lines the better half sets the scale. Zero of nothing.
    pub(super) fn usual(mut values: Vec<f64>) -> f64 {
        values.sort_by(f64::total_cmp);
        values.get(values.len().saturating_sub(1) / 2).copied().unwrap_or(0.0)
    }

    /// What the lens sees at `p` without the error.
    pub(super) fn sight(&self, lens: &Lens, p: Point2) -> Option<Sight> {
        Sight::new(lens, p + (p - self.center) * self.powers(p).dot(&self.terms))
    }

    fn powers(&self, p: Point2) -> Vector2<f64> {
        let square = (p - self.center).norm_squared() / self.radius.powi(2);
        Vector2::from_fn(|k, _| if k < self.count { square.powi(k as i32 + 1) } else { 0.0 })
    }

    fn equations(&self, edge: &[Point2], lens: &Lens) -> Option<Equations> {
        let seen: Vec<(Point2, Sight)> = edge.iter().filter_map(|p| Some((*p, self.sight(lens, *p)?))).collect();
        let normal = best_circle(&seen.iter().map(|(_, sight)| *sight).collect::<Vec<_>>())?;
        let aside = normal.cross(&Vec3::ith(normal.iamin(), 1.0)).normalize();
        let turns = Matrix3x2::from_columns(&[aside, normal.cross(&aside)]);
        let mut bend = 0.0_f64;
        // Of the turns, of the terms with the turns, and of the terms.
        let (mut own, mut own_right) = (Matrix2::zeros(), Vector2::zeros());
        let (mut mixed, mut moment, mut right) = (Matrix2::zeros(), Matrix2::zeros(), Vector2::zeros());
        for (p, sight) in &seen {
            let across: Vec2 = sight.ray_per_px.tr_mul(&normal);
            let slope = across.norm().max(f64::MIN_POSITIVE);
            let turn: Vector2<f64> = turns.tr_mul(&sight.ray) / slope;
            let terms = self.powers(*p) * (across.dot(&(p - self.center)) / slope);
            let off = sight.distance(&normal);
            bend = bend.max(off.abs());
            own += turn * turn.transpose();
            own_right -= turn * off;
            mixed += terms * turn.transpose();
            moment += terms * terms.transpose();
            right -= terms * off;
        }
        let own = (own + Matrix2::identity() * (1e-9 * own.trace())).cholesky()?;
        let moment = moment - mixed * own.solve(&mixed.transpose());
        Some(Equations { bend, moment, right: right - mixed * own.solve(&own_right) })
    }
}
