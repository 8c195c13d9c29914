//! The path of the window that is kept of a shot.
//!
//! First the target: of all sequences of window positions, dynamic programming finds the one with the highest score,
//! with a cost for movement,
//!
//! ```text
//! max  Σ_k (t_{k+1} − t_k) worth_k(p_k)  −  λ Σ_k (p_{k+1} − p_k)² / (t_{k+1} − t_k),
//! ```
//!
//! so that the window does not jump between two equally important objects. Then the path: at rest while the target
//! moves within a dead zone, smooth otherwise,
//!
//! ```text
//! min  Σ_k e_k²  +  τ² Σ |c'|² ε  +  τ⁴ Σ |c''|²      s.t.  |c_k − p_k| ≤ δ + e_k,   0 ≤ c_k ≤ 1 − fraction,   |c'| ≤ v.
//! ```
//!
//! Positions are in fractions of the picture, times in seconds.

use plumbline_num::optim::qp::{Affine, QpError, QuadraticProgram};
use plumbline_num::run::Run;

/// Weight of importance at the border of a window relative to its middle: below 1, so that subjects are centered; above
/// 0, so that those that fill the window still count.
const BORDER_WEIGHT: f64 = 0.3;
/// Cost λ of moving the window: crossing half of the picture in a second costs a quarter of the total importance.
const MOVE_COST: f64 = 1.0;
/// Distance, as a fraction of the window, by which the target may move before the window follows.
const DEAD_ZONE: f64 = 0.06;
/// Time constant τ of the path, s.
const TIME_CONSTANT_S: f64 = 0.6;
/// Relative weight ε of the speed term.
const SPEED_WEIGHT: f64 = 0.02;
/// Maximum speed, widths of the picture per second: a pan across the picture takes 2.5 s.
const MAX_SPEED: f64 = 0.4;

/// Score of each window position at a moment, as a fraction of the total importance.
pub(super) struct WindowScores {
    worth: Vec<f64>,
}

impl WindowScores {
    /// Of the importance of strips along the axis, of which a window keeps `fraction`. Importance in the window's middle
    /// counts in full, at its border [`BORDER_WEIGHT`] of it, so that subjects are centered.
    pub(super) fn new(profile: &[f64], fraction: f64) -> Self {
        let n = profile.len() as f64;
        let starts = ((1.0 - fraction) * n).round() as usize + 1;
        let total: f64 = profile.iter().sum();
        let apart = apart(starts, fraction);
        let worth = |p: usize| {
            let center = p as f64 * apart + 0.5 * fraction;
            let weight = |strip: usize| {
                let off = ((strip as f64 + 0.5) / n - center).abs() / (0.5 * fraction);
                if off <= 1.0 { 1.0 - (1.0 - BORDER_WEIGHT) * off * off } else { 0.0 }
            };
            let inside: f64 = profile.iter().enumerate().map(|(strip, v)| v * weight(strip)).sum();
            let shown = if total > 0.0 { inside / total } else { 0.0 };
            // Of equals the one in the middle of the picture.
            shown - 1e-2 * (center - 0.5).powi(2)
        };
        Self { worth: (0..starts).map(worth).collect() }
    }
}

/// Distance of neighboring starts, given their number, from 0 to `1 − fraction`.
fn apart(starts: usize, fraction: f64) -> f64 {
    if starts > 1 { (1.0 - fraction) / (starts - 1) as f64 } else { 0.0 }
}

/// Starts of the window at each moment, in `[0, 1 − fraction]`.
pub(super) fn window_path(
    sights: &[WindowScores],
    times_s: &[f64],
    fraction: f64,
    run: &Run,
) -> Result<Vec<f64>, QpError> {
    let strips = apart(sights[0].worth.len(), fraction);
    let wanted: Vec<f64> =
        course(sights, times_s, strips).into_iter().map(|p| (p as f64 * strips).min(1.0 - fraction)).collect();
    if wanted.iter().all(|w| *w == wanted[0]) {
        return Ok(wanted);
    }
    smooth(&wanted, times_s, fraction, run)
}

/// The course worth most, as indices of starts that lie `apart`.
fn course(sights: &[WindowScores], times_s: &[f64], apart: f64) -> Vec<usize> {
    let places = sights[0].worth.len();
    let mut best = vec![0.0; places];
    let mut came_from: Vec<Vec<u16>> = Vec::with_capacity(sights.len());
    for (k, profile) in sights.iter().enumerate() {
        let lasts = lasting(times_s, k);
        let price = if k == 0 { 0.0 } else { MOVE_COST * apart * apart / (times_s[k] - times_s[k - 1]).max(1e-3) };
        let arrived: Vec<(f64, u16)> = (0..places).map(|p| arrival(&best, p, price)).collect();
        best = arrived.iter().zip(&profile.worth).map(|((value, _), worth)| value + lasts * worth).collect();
        came_from.push(arrived.into_iter().map(|(_, from)| from).collect());
    }
    let mut at = (0..places).max_by(|a, b| best[*a].total_cmp(&best[*b])).unwrap_or(0);
    let mut course = vec![0; sights.len()];
    for k in (0..sights.len()).rev() {
        course[k] = at;
        at = came_from[k][at] as usize;
    }
    course
}

/// The best predecessor of position `p` and its score; of equals, `p` itself.
fn arrival(best: &[f64], p: usize, price: f64) -> (f64, u16) {
    let mut found = (best[p], p as u16);
    for (q, value) in best.iter().enumerate() {
        let value = value - price * (p.abs_diff(q) as f64).powi(2);
        if value > found.0 {
            found = (value, q as u16);
        }
    }
    found
}

/// Integration weight of a moment, s.
fn lasting(times_s: &[f64], k: usize) -> f64 {
    let after = times_s.get(k + 1).map_or(0.0, |t| t - times_s[k]);
    let before = if k == 0 { 0.0 } else { times_s[k] - times_s[k - 1] };
    (0.5 * (after + before)).max(1e-3)
}

/// The smooth path near the target.
fn smooth(wanted: &[f64], times_s: &[f64], fraction: f64, run: &Run) -> Result<Vec<f64>, QpError> {
    let n = wanted.len();
    // Unknowns: the path, then its deviation beyond the dead zone; both in widths of the window.
    let (c, e) = (Affine::var, |k: usize| Affine::var(n + k));
    let (most, free) = ((1.0 - fraction) / fraction, DEAD_ZONE);
    let mut qp = QuadraticProgram::new(2 * n);
    let step = |k: usize| (times_s[k + 1] - times_s[k]).max(1e-3);
    let speed = |k: usize| (1.0 / step(k)) * (c(k + 1) - c(k));
    for (k, wanted) in wanted.iter().enumerate() {
        let target = Affine::constant(wanted / fraction);
        qp.add_square(lasting(times_s, k), e(k));
        qp.require_at_most_zero(c(k) - target.clone() - e(k) - Affine::constant(free));
        qp.require_at_most_zero(target - c(k) - e(k) - Affine::constant(free));
        qp.require_at_most_zero(Affine::constant(0.0) - e(k));
        qp.require_at_most_zero(Affine::constant(0.0) - c(k));
        qp.require_at_most_zero(c(k) - Affine::constant(most));
    }
    for k in 0..n - 1 {
        let way = MAX_SPEED / fraction * step(k);
        qp.add_square(SPEED_WEIGHT * TIME_CONSTANT_S.powi(2) * step(k), speed(k));
        qp.require_at_most_zero(c(k + 1) - c(k) - Affine::constant(way));
        qp.require_at_most_zero(c(k) - c(k + 1) - Affine::constant(way));
    }
    for k in 1..n - 1 {
        let lasts = 0.5 * (step(k - 1) + step(k));
        qp.add_square(TIME_CONSTANT_S.powi(4) * lasts, (1.0 / lasts) * (speed(k) - speed(k - 1)));
    }
    let solved = qp.solve(run)?;
    Ok(solved[..n].iter().map(|c| (c * fraction).clamp(0.0, 1.0 - fraction)).collect())
}
