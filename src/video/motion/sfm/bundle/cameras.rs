//! Cameras of all frames at one point of the parameter space.

use nalgebra::Matrix3;

use super::layout::Layout;
use super::parameters::{K1, LN_FOCAL, Parameters, READOUT, Ray};
use super::residual::{Anchored, Eye, View};
use super::shutter::{Stencil, neighbors};
use plumbline_camera::{Intrinsics, Vec3};
use plumbline_num::math::Point2;

/// Lens, views and row motion of all frames.
#[derive(Clone, Debug)]
pub(super) struct Cameras {
    lens: Intrinsics,
    readout: f64,
    /// By frame.
    views: Vec<View>,
    /// By frame; empty for a global shutter.
    stencils: Vec<Stencil>,
}

impl Cameras {
    /// Cameras without poses; [`Self::set`] sets them.
    pub(super) fn new(layout: &Layout, center: Point2) -> Self {
        let origin = View { rotation: Matrix3::identity(), translation: Vec3::zeros() };
        let frames = layout.slot.len();
        Self {
            lens: Intrinsics { focal: 1.0, center, k1: 0.0 },
            readout: 0.0,
            views: vec![origin; frames],
            stencils: vec![Stencil::still(); if layout.rolling { frames } else { 0 }],
        }
    }

    /// Sets the cameras in use from the parameters.
    pub(super) fn set(&mut self, parameters: &Parameters, layout: &Layout) {
        self.lens.focal = parameters.shared[LN_FOCAL].exp();
        self.lens.k1 = parameters.shared[K1];
        self.readout = parameters.shared[READOUT];
        for (frame, pose) in parameters.poses.iter().enumerate().filter(|&(frame, _)| layout.uses(frame)) {
            self.views[frame] = View::of(pose);
            if let Some(stencil) = self.stencils.get_mut(frame) {
                let around = neighbors(frame, |n| layout.uses(n)).map(|n| (n, parameters.poses[n]));
                *stencil = Stencil::of(frame, pose, around);
            }
        }
    }

    pub(super) fn lens(&self) -> &Intrinsics {
        &self.lens
    }

    pub(super) fn view(&self, frame: usize) -> &View {
        &self.views[frame]
    }

    pub(super) fn eye(&self, frame: usize) -> Eye<'_> {
        let stencil = self.stencils.get(frame);
        Eye { lens: &self.lens, readout: self.readout, view: &self.views[frame], stencil }
    }

    pub(super) fn anchored(&self, ray: &Ray, anchor: usize) -> Anchored {
        Anchored::new(ray, &self.views[anchor])
    }

    /// Whether an observation carries no information on poses: the anchor observes its own ray.
    pub(super) fn is_own_ray(&self, frame: usize, anchor: usize) -> bool {
        frame == anchor && self.stencils.is_empty()
    }
}
