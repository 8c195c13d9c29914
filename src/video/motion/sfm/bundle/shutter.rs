//! Rolling shutter: the pose of a row, interpolated between frames.
//!
//! Row time `τ` is in frame periods relative to the frame's own pose, which is that of the row through the center of
//! projection. Between the poses of a frame `i` and of its neighbors `k` at distances `o_k ∈ {±1, ±2}` the motion is
//! interpolated by Lagrange polynomials `c_k(τ)`:
//!
//! ```text
//! τ = (v − c_y)/(2 c_y) ρ_s
//! R_i(τ) = Exp(θ) R_i,   θ = Σ_k c_k(τ) l_k,   l_k = Log(R_k R_iᵀ),      t_i(τ) = t_i + Σ_k c_k(τ) (t_k − t_i)
//! ```
//!
//! With the two nearest neighbors, and to first order in `τ`, this is the motion by central differences. The two
//! further neighbors represent a shake of several Hz, which linear interpolation between frames does not.

use nalgebra::Matrix3;

use plumbline_camera::rotation::left_jacobian_inverse;
use plumbline_camera::{CameraPose, Vec3};

/// Neighbors on either side: two represent a shake of several Hz (see the module documentation).
const REACH: isize = 2;
/// Maximum number of neighbors of a frame.
pub(super) const NEIGHBORS: usize = 2 * REACH as usize;

/// A neighbor of a frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbor {
    pub(super) frame: usize,
    /// `o_k`.
    offset: f64,
    /// `l_k`.
    pub(super) rotation: Vec3,
    /// `J(l_k)⁻¹`.
    pub(super) jacobian: Matrix3<f64>,
    /// `t_k − t_i`.
    pub(super) translation: Vec3,
}

/// The neighbors that determine the row motion of a frame; none for a global shutter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stencil {
    neighbors: [Neighbor; NEIGHBORS],
    len: usize,
}

impl Stencil {
    /// For a camera that is constant during the readout.
    pub(super) fn still() -> Self {
        let none = Neighbor {
            frame: 0,
            offset: 0.0,
            rotation: Vec3::zeros(),
            jacobian: Matrix3::identity(),
            translation: Vec3::zeros(),
        };
        Self { neighbors: [none; NEIGHBORS], len: 0 }
    }

    /// `pose` is that of `frame`, `others` are those of its [`neighbors`].
    pub(super) fn of(frame: usize, pose: &CameraPose, others: impl Iterator<Item = (usize, CameraPose)>) -> Self {
        let mut stencil = Self::still();
        for (neighbor, other) in others {
            let rotation = (other.rotation * pose.rotation.inverse()).scaled_axis();
            stencil.neighbors[stencil.len] = Neighbor {
                frame: neighbor,
                offset: neighbor as f64 - frame as f64,
                rotation,
                jacobian: left_jacobian_inverse(&rotation),
                translation: other.translation - pose.translation,
            };
            stencil.len += 1;
        }
        stencil
    }

    pub(super) fn neighbors(&self) -> &[Neighbor] {
        &self.neighbors[..self.len]
    }

    /// `c_k(τ)` and `c_k'(τ)` of every neighbor.
    pub(super) fn weights(&self, tau: f64) -> [(f64, f64); NEIGHBORS] {
        let mut weights = [(0.0, 0.0); NEIGHBORS];
        for (k, weight) in weights.iter_mut().enumerate().take(self.len) {
            let own = self.neighbors[k].offset;
            let others = (0..self.len).filter(|&m| m != k).map(|m| self.neighbors[m].offset);
            // Product rule, factor by factor; node 0 is the frame itself.
            *weight = std::iter::once(0.0).chain(others).fold((1.0, 0.0), |(value, slope), node| {
                let (factor, rate) = ((tau - node) / (own - node), 1.0 / (own - node));
                (value * factor, slope * factor + value * rate)
            });
        }
        weights
    }
}

/// Known frames within [`REACH`] of `frame`, without an unknown frame between.
pub(super) fn neighbors(frame: usize, known: impl Fn(usize) -> bool + Copy) -> impl Iterator<Item = usize> {
    let at = move |o: isize| frame.checked_add_signed(o);
    let is_known = move |f: Option<usize>| f.is_some_and(known);
    let reached = move |o: isize| (1..=o.abs()).all(|step| is_known(at(step * o.signum())));
    (-REACH..=REACH).filter(move |&o| o != 0 && reached(o)).filter_map(at)
}
