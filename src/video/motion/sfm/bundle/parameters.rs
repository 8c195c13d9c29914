//! A point of the parameter space.

use plumbline_camera::{CameraPose, Vec3};
use plumbline_num::math::Vec2;

/// Index of `ln f` among the shared unknowns.
pub(super) const LN_FOCAL: usize = 0;
/// Index of `k₁`.
pub(super) const K1: usize = 1;
/// Index of the readout.
pub(super) const READOUT: usize = 2;
/// Number of unknowns shared by all frames.
pub(super) const SHARED: usize = 3;

/// A scene point relative to its anchor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) xy: Vec2,
    /// Inverse depth.
    pub(super) w: f64,
}

impl Ray {
    pub(super) fn moved(&self, step: &Vec3) -> Self {
        Self { xy: self.xy + step.xy(), w: self.w + step.z }
    }
}

/// All unknowns.
#[derive(Clone, Debug)]
pub(super) struct Parameters {
    /// By frame; unused for an unknown frame.
    pub(super) poses: Vec<CameraPose>,
    /// By index among the points in use.
    pub(super) points: Vec<Ray>,
    /// `ln f`, `k₁`, `ρ_s`.
    pub(super) shared: [f64; SHARED],
}

impl Parameters {
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.poses.copy_from_slice(&other.poses);
        self.points.copy_from_slice(&other.points);
        self.shared = other.shared;
    }
}
