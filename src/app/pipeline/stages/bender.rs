//! What bends a frame beyond the similarity of its virtual camera: anchors, a plane through them, a mesh drawn by them.

use crate::pipeline::run_error::RunError;
use plumbline_image::grid::{Grid, GridMesh};
use plumbline_image::warp::{ContentPreserving, ContentPreservingOptions, PointPair, cell_salience, keep_covered};
use plumbline_image::{Frame, Plane, analysis_luma};
use plumbline_num::math::Homography;
use plumbline_video::motion::{self, FrameScale, Pair};
use plumbline_video::path::Anchor;

/// Longest side of the picture on which salience is measured, px: 10 pixels a cell are plenty for a variance.
const SALIENCE_SIDE: usize = 640;

/// Sum of anchor weights from which their plane is followed fully. Below it single points would steer the frame, and the
/// first and last frames of a shot, where all anchors fade, would jump.
const TRUSTED_WEIGHT: f64 = 40.0;

/// Weight of keeping that plane a similarity, per unit of anchor weight: enough to hold perspective still where anchors
/// crowd in one corner, too little to be felt where they cover the frame.
const PLANE_PRIOR: f64 = 0.01;

/// Part of the stiffness that is left where points in space are to be shown as a given camera sees them: what they ask
/// carries no noise of single tracks, and parallax at the edge of a near thing turns within a cell. A smoothed path, which
/// nobody has in mind, is better off stiff: on three of five clips wobble rose by a sixth to two fifths.
const GIVEN: f64 = 0.03;

/// Bends frames of one size.
pub(super) struct Bender {
    solver: ContentPreserving,
    alpha: f64,
    scale: FrameScale,
    luma: Plane<u8>,
    salience: Vec<f64>,
    points: Vec<PointPair>,
    /// The source must cover the output.
    covered: bool,
}

/// How far a frame follows its anchors, each in [0, 1].
#[derive(Clone, Copy, Debug)]
pub(super) struct Freedom {
    /// Towards the plane that fits them.
    pub(super) plane: f64,
    /// From there towards each of them.
    pub(super) mesh: f64,
    /// To show them as a given camera sees them.
    pub(super) given: f64,
}

impl Bender {
    pub(super) fn new(grid: &Grid, alpha: f64, covered: bool) -> Result<Self, RunError> {
        let options = ContentPreservingOptions { alpha, ..ContentPreservingOptions::default() };
        let solver = ContentPreserving::new(grid.cols, grid.rows, grid.width, grid.height, options);
        Ok(Self {
            solver: solver.map_err(|e| RunError::Input(e.to_string()))?,
            alpha,
            scale: FrameScale::new(grid.width as u32, grid.height as u32),
            luma: Plane::new(0, 0),
            salience: Vec::new(),
            points: Vec::new(),
            covered,
        })
    }

    /// The mesh of a frame, `out_from_src`: its camera, drawn towards the anchors. Without the picture all cells are alike
    /// in salience.
    pub(super) fn bend(
        &mut self,
        frame: Option<&Frame>,
        camera: &Homography,
        anchors: &[Anchor],
        freedom: Freedom,
    ) -> Result<GridMesh, RunError> {
        let plane = self.plane_of(camera, anchors, freedom.plane);
        self.points.clear();
        self.salience.clear();
        if freedom.mesh > 0.0 {
            if let Some(frame) = frame {
                self.measure_salience(frame);
            }
            let toward = |a: &Anchor| plane.apply(a.src).map(|p| p + (a.dst - p) * freedom.mesh);
            let pair = |a: &Anchor| Some(PointPair { src: a.src, dst: toward(a)?, weight: a.weight });
            self.points.extend(anchors.iter().filter_map(pair));
        }
        let alpha = self.alpha * GIVEN.powf(freedom.given);
        let solved =
            self.solver.set_alpha(alpha).and_then(|()| self.solver.solve(&plane, &self.points, &self.salience));
        Ok(solved.map_err(|e| RunError::Internal(e.to_string()))?.0)
    }

    /// Holds the border of `mesh` outside the output, where the source must cover it.
    pub(super) fn cover(&self, mesh: &mut GridMesh, camera: &Homography) {
        if self.covered {
            let grid = self.solver.grid();
            keep_covered(mesh, &carried(grid, camera), grid.width, grid.height);
        }
    }

    /// The homography nearest to the anchors, mixed into the camera's by `strength`, less where anchors are few.
    fn plane_of(&self, camera: &Homography, anchors: &[Anchor], strength: f64) -> Homography {
        let weights: Vec<f64> = anchors.iter().map(|a| a.weight).collect();
        let total: f64 = weights.iter().sum();
        let share = strength * (total / TRUSTED_WEIGHT).min(1.0);
        if !(share > 0.0) {
            return *camera;
        }
        let pairs: Vec<Pair> = anchors.iter().map(|a| Pair { previous: a.src, this: a.dst }).collect();
        let fitted = motion::homography(&pairs, &weights, camera, PLANE_PRIOR * total, &self.scale, 2);
        fitted.map_or(*camera, |h| Homography::new(camera.matrix() + (h.matrix() - camera.matrix()) * share))
    }

    fn measure_salience(&mut self, frame: &Frame) {
        let grid = self.solver.grid();
        if analysis_luma(frame, SALIENCE_SIDE, &mut self.luma) {
            let luma = self.luma.as_ref();
            let rows: Vec<&[u8]> = (0..luma.height()).map(|y| luma.row(y)).collect();
            cell_salience(rows.into_iter(), grid.cols, grid.rows, &mut self.salience);
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
