//! `video.warp`: the map of each frame, from the path of the virtual camera and the points that pull the mesh.
//!
//! The camera's map `S_t` takes out what all points share. Anchors ([`TrajectorySmoother`]) say where each point would go
//! if it moved smoothly. The homography tier follows of that what a plane can follow, the mesh tier bends the frame to it.

use super::analysis::{Tracks, store_error};
use super::sampling::Feed;
use super::space::Places;
use super::tiers::Tiers;
use crate::image::{Frame, Plane, analysis_luma};
use crate::math::{Homography, Point2, Vec2};
use crate::mesh::{Grid, GridMesh};
use crate::motion::{self, ClipMotion, FrameScale, Pair, Tier};
use crate::path::{Anchor, TrackedPoint, TrajectoryOptions, TrajectorySmoother, VirtualPath};
use crate::pipeline::run_error::RunError;
use crate::warp::{
    ContentPreserving, ContentPreservingOptions, Lattice, PointPair, WarpField, cell_salience, keep_covered,
};

/// Longest side of the picture on which salience is measured, px: 10 pixels a cell are plenty for a variance.
const SALIENCE_SIDE: usize = 640;

/// Sum of anchor weights from which their plane is followed fully. Below it single points would steer the frame, and the
/// first and last frames of a shot, where all anchors fade, would jump.
const TRUSTED_WEIGHT: f64 = 40.0;

/// Weight of keeping that plane a similarity, per unit of anchor weight: enough to hold perspective still where anchors
/// crowd in one corner, too little to be felt where they cover the frame.
const PLANE_PRIOR: f64 = 0.01;

/// Maps of successive frames.
pub(super) struct Maps<'a> {
    tracks: &'a Tracks,
    path: &'a VirtualPath,
    motion: Option<&'a ClipMotion>,
    tiers: &'a Tiers,
    /// Where the points are, for virtual cameras in space.
    places: Option<Places<'a>>,
    grid: Grid,
    bender: Bender,
    /// Frames handed to the smoother, and maps asked for.
    pushed: usize,
    next: usize,
}

/// What bends a frame beyond its homography.
struct Bender {
    solver: ContentPreserving,
    smoother: TrajectorySmoother,
    scale: FrameScale,
    luma: Plane<u8>,
    salience: Vec<f64>,
    points: Vec<PointPair>,
    /// The source must cover the output.
    covered: bool,
}

impl<'a> Maps<'a> {
    /// Maps for the clip of `feed`; rolling shutter is taken out where its motion knows of one. `covered`: the source must
    /// cover the output whatever the mesh does.
    pub(super) fn new(feed: &Feed<'a>, tiers: &'a Tiers, covered: bool) -> Result<Self, RunError> {
        let (cols, rows) = (feed.warp.columns as usize, feed.warp.rows as usize);
        let (width, height) = (feed.tracks.clip.width as f64, feed.tracks.clip.height as f64);
        let grid = Grid { cols, rows, width, height };
        let bender = Bender::new(&grid, feed.warp.alpha, covered)?;
        let cameras = feed.motion.and_then(|m| Some((m.cameras.as_ref()?, m)));
        let places = cameras.filter(|_| !feed.path.cameras.is_empty()).map(|(c, m)| Places::new(c, m));
        let (tracks, path, motion) = (feed.tracks, feed.path, feed.motion);
        Ok(Self { tracks, path, motion, tiers, places, grid, bender, pushed: 0, next: 0 })
    }

    /// The map of the next frame, sampled for rendering.
    pub(super) fn next(&mut self, frame: &Frame) -> Result<Lattice, RunError> {
        let index = self.next;
        self.next += 1;
        let ahead = || RunError::Input("the clip holds more frames than its analysis saw".to_owned());
        let camera = *self.path.out_from_src.get(index).ok_or_else(ahead)?;
        let mut anchors = self.anchors(index)?;
        let in_space = self.tiers.strength(index, Tier::ThreeD);
        for anchor in &mut anchors {
            anchor.dst += anchor.in_space.map_or_else(Vec2::zeros, |place| (place - anchor.dst) * in_space);
        }
        let (plane, mesh) = (self.tiers.strength(index, Tier::Homography), self.tiers.strength(index, Tier::Mesh));
        let field = if plane > 0.0 || mesh > 0.0 {
            let mesh = self.bender.bend(frame, &camera, &anchors, plane, mesh)?;
            WarpField::from_forward_mesh(&mesh, self.grid.width, self.grid.height)
        } else {
            WarpField::from_forward_homography(&camera)
        };
        let field = field.map_err(|e| RunError::Internal(format!("frame {index}: {e}")))?;
        Ok(Lattice::new(&field, frame.width, frame.height))
    }

    /// Anchors of frame `index`.
    fn anchors(&mut self, index: usize) -> Result<Vec<Anchor>, RunError> {
        loop {
            if let Some(anchors) = self.bender.smoother.pop() {
                return Ok(anchors);
            }
            if self.pushed < self.tracks.store.frames() {
                self.push(self.pushed)?;
                self.pushed += 1;
            } else if self.pushed == index {
                return Ok(Vec::new());
            } else {
                self.bender.smoother.cut();
            }
        }
    }

    /// Hands frame `index` to the smoother.
    fn push(&mut self, index: usize) -> Result<(), RunError> {
        let frame = self.tracks.store.read(index).map_err(store_error)?;
        if index > 0 && self.path.segments.iter().any(|s| s.frames.start == index) {
            self.bender.smoother.cut();
        }
        let rows = self.motion.and_then(|m| m.row_motion(index));
        let still = frame.observations.iter().filter(|o| o.background);
        let virtual_camera = self.path.cameras.get(index).copied().flatten();
        let in_space = |o| virtual_camera.zip(self.places.as_ref()).and_then(|(c, p)| c.show(&p.of(index, o)?));
        let points = still.map(|o| {
            let src = Point2::new(f64::from(o.x), f64::from(o.y));
            let at_frame_time = rows.as_ref().map_or(src, |r| r.center_time(src));
            TrackedPoint { id: o.id, src, at_frame_time, in_space: in_space(o) }
        });
        let camera = self.path.out_from_src.get(index).copied().unwrap_or_else(Homography::identity);
        self.bender.smoother.push(self.tracks.clip.timebase.seconds(frame.pts), &camera, points);
        Ok(())
    }
}

impl Bender {
    fn new(grid: &Grid, alpha: f64, covered: bool) -> Result<Self, RunError> {
        let options = ContentPreservingOptions { alpha, ..ContentPreservingOptions::default() };
        let solver = ContentPreserving::new(grid.cols, grid.rows, grid.width, grid.height, options);
        Ok(Self {
            solver: solver.map_err(|e| RunError::Input(e.to_string()))?,
            smoother: TrajectorySmoother::new(TrajectoryOptions::default()),
            scale: FrameScale::new(grid.width as u32, grid.height as u32),
            luma: Plane::new(0, 0),
            salience: Vec::new(),
            points: Vec::new(),
            covered,
        })
    }

    /// The mesh of a frame, `out_from_src`: the camera, drawn towards the plane that fits the anchors by `plane`, and bent
    /// towards the anchors by `mesh`, both in [0, 1].
    fn bend(
        &mut self,
        frame: &Frame,
        camera: &Homography,
        anchors: &[Anchor],
        plane: f64,
        mesh: f64,
    ) -> Result<GridMesh, RunError> {
        let grid = *self.solver.grid();
        let fitted = self.plane_of(camera, anchors, plane);
        self.points.clear();
        if mesh > 0.0 {
            self.measure_salience(frame);
            let toward = |a: &Anchor| fitted.apply(a.src).map(|p| p + (a.dst - p) * mesh);
            let pair = |a: &Anchor| Some(PointPair { src: a.src, dst: toward(a)?, weight: a.weight });
            self.points.extend(anchors.iter().filter_map(pair));
        }
        let solved = self.solver.solve(&fitted, &self.points, &self.salience);
        let (mut mesh, _) = solved.map_err(|e| RunError::Internal(e.to_string()))?;
        if self.covered {
            keep_covered(&mut mesh, &carried(&grid, camera), grid.width, grid.height);
        }
        Ok(mesh)
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
        self.salience.clear();
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
