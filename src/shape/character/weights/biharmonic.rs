//! Bounded biharmonic weights, on the surface:
//!
//! ```text
//! min  ½ ∫ Σⱼ ℓ² (Δwⱼ)² + 2 |∇wⱼ|² + (wⱼ − pⱼ)²/ℓ²      s.t.  w ≥ 0,  Σⱼ wⱼ = 1        ℓ = d/√c
//! ```
//!
//! A biharmonic energy with tension, attached as bone heat is: `pⱼ` is 1 where joint `j` has the nearest visible bone, at distance `d`.
//! The minimizer without bounds solves, with the matrices of [`heat`],
//!
//! ```text
//! (L + M H) (M H)⁻¹ (L + M H) wⱼ = M H pⱼ,        i. e.  wⱼ = A A pⱼ,   A = (L + M H)⁻¹ M H,   H = 1/ℓ²
//! ```
//!
//! `A` has no negative entry, by the maximum principle, and rows that sum to one. So `w` is within its bounds, which are never active:
//! no quadratic program is left to solve, and two back-substitutions per joint with the factor of bone heat are the exact minimizer. A
//! vertex that sees no bone (`H = 0`) takes harmonic weights. `A` alone is bone heat, whose weights have a jump in their second derivative
//! where the nearest bone changes; applied twice, the jump is in the fourth.
//!
//! A response of `A` spreads by `ℓ √2`, that of `A A` by `2 ℓ`: with `c = 2` both methods blend over the same width.
//!
//! Departures: the paper minimizes `∫ (Δw)²` alone in the volume, where weights interpolate 1 on the bones. A surface does not meet the
//! bones. Weights that interpolate 1 at the vertices near the middles of bones instead jump from 1 to 0 between neighbors with different
//! nearest bones (a head, an armpit). Attached by `1/d⁴`, without tension, they overshoot: the bounds are active on most of the surface,
//! which takes 100 to 1100 iterations of an alternating direction method, and extrapolate linearly over vertices that see no bone, to a
//! wedge of a foreign joint across a mouth.
//!
//! # Reference
//! A. Jacobson, I. Baran, J. Popović, O. Sorkine, *Bounded biharmonic weights for real-time deformation*, ACM TOG 30 (2011);
//! I. Baran, J. Popović, *Automatic rigging and animation of 3D characters*, ACM TOG 26 (2007), section 4.

use super::super::{Bone, CharacterError};
use super::Row;
use super::heat::{self, Diffusion};
use super::welded::Welded;
use plumbline_num::run::Run;

/// `c`: as wide as bone heat. At 1 the torso of a stocky model is a blend of all joints around it; at 4 elbows of coarse models crease.
const RATE: f64 = 2.0;

/// One row per welded vertex; empty if its component sees no bone.
pub(super) fn rows(welded: &Welded, bones: &[Bone], joints: usize, run: &Run) -> Result<Vec<Row>, CharacterError> {
    heat::diffused(welded, bones, joints, Diffusion { rate: RATE, steps: 2 }, run)
}
