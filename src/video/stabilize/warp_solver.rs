//! The warp of one frame beyond the similarity of its virtual camera: a homography fitted to the anchors, and a mesh that follows
//! them.
//!
//! With the camera's map `S`, the homography `H` nearest to the anchors `s_k → q_k` and the strengths `a`, `b` in [0, 1] of
//! homography and mesh,
//!
//! ```text
//! P = S + a (H − S)                  pre-warp
//! q̂_k = P s_k + b (q_k − P s_k)       targets of the content-preserving warp (`plumbline_image::warp::ContentPreserving`)
//! ```
//!
//! so that one model blends into the next without a step.
//!
//! # Reference
//! F. Liu, M. Gleicher, H. Jin, A. Agarwala, *Content-preserving warps for 3D video stabilization*, SIGGRAPH 2009, section 4.

use super::error::StabilizeError;
use crate::motion::{self, FrameScale, Pair};
use crate::path::Anchor;
use plumbline_image::grid::{Grid, GridMesh};
use plumbline_image::warp::{
    ContentPreserving, ContentPreservingOptions, PointPair, WarpError, cell_saliency, keep_covered,
};
use plumbline_image::{Frame, Plane, analysis_luma};
use plumbline_num::math::Homography;

/// Longest side of the picture on which saliency is measured, px: a hundred pixels per cell of the default mesh determine a
/// variance.
const SALIENCY_SIDE: usize = 640;

/// Sum of anchor weights from which their homography is applied fully: five times its eight parameters. Below it single points
/// would dominate, and the first and last frames of a shot, where all anchors fade, would jump.
const FULL_WEIGHT: f64 = 40.0;

/// Weight of keeping that homography a similarity, per unit of anchor weight: enough to determine its perspective where anchors
/// crowd in one corner, too little to have an effect where they cover the frame.
const HOMOGRAPHY_PRIOR: f64 = 0.01;

/// Fraction of the stiffness that remains under a given camera in space: its targets have no noise of single tracks, and
/// parallax at the edge of a near object changes within a cell. A smoothed path, which is not prescribed, needs full
/// stiffness: on three of five clips wobble rose by a sixth to two fifths.
const GIVEN_STIFFNESS: f64 = 0.03;

/// Solves for the meshes of frames of one size.
pub(super) struct WarpSolver {
    solver: ContentPreserving,
    alpha: f64,
    scale: FrameScale,
    luma: Plane<u8>,
    saliency: Vec<f64>,
    points: Vec<PointPair>,
    /// The source must cover the output.
    covered: bool,
}

/// Strengths with which a frame follows its anchors, each from 0 to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strengths {
    /// Towards the homography that fits them.
    pub(super) homography: f64,
    /// From there towards each of them.
    pub(super) mesh: f64,
    /// Of a given camera in space.
    pub(super) given: f64,
}

impl WarpSolver {
    pub(super) fn new(grid: &Grid, alpha: f64, covered: bool) -> Result<Self, StabilizeError> {
        let options = ContentPreservingOptions { alpha, ..ContentPreservingOptions::default() };
        let solver = ContentPreserving::new(grid.cols, grid.rows, grid.width, grid.height, options);
        Ok(Self {
            solver: solver.map_err(|e| StabilizeError::Options(e.to_string()))?,
            alpha,
            scale: FrameScale::new(grid.width as u32, grid.height as u32),
            luma: Plane::new(0, 0),
            saliency: Vec::new(),
            points: Vec::new(),
            covered,
        })
    }

    /// The mesh of a frame, `out_from_src`: its camera's map, warped towards the anchors. Without the picture all cells have the
    /// same saliency.
    pub(super) fn solve(
        &mut self,
        frame: Option<&Frame>,
        camera: &Homography,
        anchors: &[Anchor],
        strengths: Strengths,
    ) -> Result<GridMesh, WarpError> {
        let prewarp = self.prewarp(camera, anchors, strengths.homography);
        self.points.clear();
        self.saliency.clear();
        if strengths.mesh > 0.0 {
            if let Some(frame) = frame {
                self.measure_saliency(frame);
            }
            let toward = |a: &Anchor| prewarp.apply(a.src).map(|p| p + (a.dst - p) * strengths.mesh);
            let pair = |a: &Anchor| Some(PointPair { src: a.src, dst: toward(a)?, weight: a.weight });
            self.points.extend(anchors.iter().filter_map(pair));
        }
        let alpha = self.alpha * GIVEN_STIFFNESS.powf(strengths.given);
        let solved =
            self.solver.set_alpha(alpha).and_then(|()| self.solver.solve(&prewarp, &self.points, &self.saliency));
        Ok(solved?.0)
    }

    /// Moves the border of `mesh` outside the output, where the source must cover it.
    pub(super) fn keep_covered(&self, mesh: &mut GridMesh, camera: &Homography) {
        if self.covered {
            let grid = self.solver.grid();
            keep_covered(mesh, &carried(grid, camera), grid.width, grid.height);
        }
    }

    /// The homography nearest to the anchors, mixed into the camera's by `strength`, less where anchors are few.
    fn prewarp(&self, camera: &Homography, anchors: &[Anchor], strength: f64) -> Homography {
        let weights: Vec<f64> = anchors.iter().map(|a| a.weight).collect();
        let total: f64 = weights.iter().sum();
        let strength = strength * (total / FULL_WEIGHT).min(1.0);
        if !(strength > 0.0) {
            return *camera;
        }
        let pairs: Vec<Pair> = anchors.iter().map(|a| Pair { previous: a.src, this: a.dst }).collect();
        let fitted = motion::homography(&pairs, &weights, camera, HOMOGRAPHY_PRIOR * total, &self.scale, 2);
        fitted.map_or(*camera, |h| Homography::new(camera.matrix() + (h.matrix() - camera.matrix()) * strength))
    }

    fn measure_saliency(&mut self, frame: &Frame) {
        let grid = self.solver.grid();
        if analysis_luma(frame, SALIENCY_SIDE, &mut self.luma) {
            let luma = self.luma.as_ref();
            let rows: Vec<&[u8]> = (0..luma.height()).map(|y| luma.row(y)).collect();
            cell_saliency(rows.into_iter(), grid.cols, grid.rows, &mut self.saliency);
        }
    }
}

/// The grid as a homography carries it.
fn carried(grid: &Grid, out_from_src: &Homography) -> GridMesh {
    let mut mesh = grid.to_mesh();
    for v in &mut mesh.vertices {
        *v = out_from_src.apply(*v).unwrap_or(*v);
    }
    mesh
}
