//! `video.warp`: the map of each frame, from the path of the virtual camera and the points that pull the mesh.
//!
//! The camera's map `S_t` takes out what all points share. Anchors ([`TrajectorySmoother`]) say where each point would go
//! if it moved smoothly, or where a virtual camera in space shows it. The homography tier follows of that what a plane can
//! follow, the mesh tier bends the frame to it. Where the camera only turned, the frame needs no points: each vertex `v` goes
//! where the virtual camera, turned by `R̄_t`, sees what the real one saw at it, `D_t(π(R̄_t R_tᵀ π⁻¹(v)))`.

use super::analysis::{Tracks, store_error};
use super::bender::{Bender, Freedom};
use super::sampling::Feed;
use super::space::{Places, direction, shown};
use super::tiers::Tiers;
use crate::pipeline::run_error::RunError;
use plumbline_image::Frame;
use plumbline_image::grid::{Grid, GridMesh};
use plumbline_image::warp::WarpField;
use plumbline_num::math::{Homography, Point2, Vec2};
use plumbline_video::motion::{ClipMotion, Tier};
use plumbline_video::path::{Anchor, TrackedPoint, TrajectoryOptions, TrajectorySmoother, VirtualPath};

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
    smoother: TrajectorySmoother,
    /// Frames handed to the smoother, and maps asked for.
    pushed: usize,
    next: usize,
}

/// The map of a frame, `out_from_src`.
pub(super) enum Forward {
    Plane(Homography),
    Mesh(GridMesh),
}

impl Forward {
    /// Where a point of the source is shown.
    pub(super) fn apply(&self, grid: &Grid, src: Point2) -> Option<Point2> {
        match self {
            Self::Plane(h) => h.apply(src),
            Self::Mesh(mesh) => grid.locate(src).map(|at| mesh.at(at)),
        }
    }
}

impl<'a> Maps<'a> {
    /// Maps for the clip of `feed`; rolling shutter is taken out where its motion knows of one. `covered`: the source must
    /// cover the output whatever the mesh does.
    pub(super) fn new(feed: &Feed<'a>, tiers: &'a Tiers, covered: bool) -> Result<Self, RunError> {
        let (cols, rows) = (feed.warp.columns as usize, feed.warp.rows as usize);
        let (width, height) = (feed.tracks.clip.width as f64, feed.tracks.clip.height as f64);
        let grid = Grid { cols, rows, width, height };
        let bender = Bender::new(&grid, feed.warp.alpha, covered)?;
        let subspace = tiers.segments.iter().any(|s| s.tier == Tier::Subspace);
        let smoother = TrajectorySmoother::new(TrajectoryOptions { subspace, ..TrajectoryOptions::default() });
        let cameras = feed.motion.and_then(|m| Some((m.cameras.as_ref()?, m)));
        let places = cameras.filter(|_| !feed.path.cameras.is_empty()).map(|(c, m)| Places::new(c, m));
        let (tracks, path, motion) = (feed.tracks, feed.path, feed.motion);
        Ok(Self { tracks, path, motion, tiers, places, grid, bender, smoother, pushed: 0, next: 0 })
    }

    /// The grid over the source on which frames are bent.
    pub(super) fn grid(&self) -> Grid {
        self.grid
    }

    /// The map of the next frame.
    pub(super) fn next(&mut self, frame: &Frame) -> Result<WarpField, RunError> {
        let index = self.next;
        let field = match self.forward(Some(frame))? {
            Forward::Plane(camera) => WarpField::from_forward_homography(&camera),
            Forward::Mesh(mesh) => WarpField::from_forward_mesh(&mesh, self.grid.width, self.grid.height),
        };
        field.map_err(|e| RunError::Internal(format!("frame {index}: {e}")))
    }

    /// The map of the next frame; without its picture, what is salient in it is not known.
    pub(super) fn forward(&mut self, frame: Option<&Frame>) -> Result<Forward, RunError> {
        let index = self.next;
        self.next += 1;
        let ahead = || RunError::Input("the clip holds more frames than its analysis saw".to_owned());
        let camera = *self.path.out_from_src.get(index).ok_or_else(ahead)?;
        let anchors = self.drawn(index)?;
        let strength = |with: fn(Tier) -> bool| self.tiers.strength(index, with);
        let freedom = Freedom {
            plane: strength(|t| t >= Tier::Homography),
            mesh: strength(|t| t >= Tier::Mesh),
            given: self.tiers.given(index),
        };
        let turn = strength(|t| t == Tier::Rotation);
        let turned = if turn > 0.0 { self.turned(index) } else { None };
        if turned.is_none() && !(freedom.plane > 0.0 || freedom.mesh > 0.0) {
            return Ok(Forward::Plane(camera));
        }
        let mut mesh = match turned {
            Some(turned) if turn >= 1.0 => turned,
            Some(turned) => mixed(self.bender.bend(frame, &camera, &anchors, freedom)?, &turned, turn),
            None => self.bender.bend(frame, &camera, &anchors, freedom)?,
        };
        self.bender.cover(&mut mesh, &camera);
        Ok(Forward::Mesh(mesh))
    }

    /// The anchors of frame `index`, drawn to where a virtual camera in space shows them as far as that tier is in force.
    fn drawn(&mut self, index: usize) -> Result<Vec<Anchor>, RunError> {
        let mut anchors = self.anchors(index)?;
        let in_space = self.tiers.in_space(index);
        let in_subspace = self.tiers.strength(index, |tier| tier == Tier::Subspace);
        for anchor in &mut anchors {
            anchor.dst += anchor.in_subspace.map_or_else(Vec2::zeros, |shared| (shared - anchor.dst) * in_subspace);
            match anchor.in_space {
                Some(place) => anchor.dst += (place - anchor.dst) * in_space,
                // Its own course is that of the picture, not of what the camera sees.
                None => anchor.weight *= 1.0 - in_space,
            }
        }
        Ok(anchors)
    }

    /// Anchors of frame `index`.
    fn anchors(&mut self, index: usize) -> Result<Vec<Anchor>, RunError> {
        loop {
            if let Some(anchors) = self.smoother.pop() {
                return Ok(anchors);
            }
            if self.pushed < self.tracks.store.frames() {
                self.push(self.pushed)?;
                self.pushed += 1;
            } else if self.pushed == index {
                return Ok(Vec::new());
            } else {
                self.smoother.cut();
            }
        }
    }

    /// Hands frame `index` to the smoother.
    fn push(&mut self, index: usize) -> Result<(), RunError> {
        let frame = self.tracks.store.read(index).map_err(store_error)?;
        if index > 0 && self.path.segments.iter().any(|s| s.frames.start == index) {
            self.smoother.cut();
        }
        let rows = self.motion.and_then(|m| m.row_motion(index));
        let still = frame.observations.iter().filter(|o| o.background);
        let still: Vec<_> = still.copied().collect();
        let center_time = |src| rows.as_ref().map_or(src, |r| r.center_time(src));
        let virtual_camera = self.path.cameras.get(index).copied().flatten();
        let in_space = match virtual_camera.zip(self.places.as_ref()) {
            Some((camera, places)) if self.tiers.given(index) > 0.0 => {
                shown(places, index, &camera, &still, center_time)
            }
            Some((camera, places)) => still.iter().map(|o| camera.show(&places.of(index, o, camera.turns)?)).collect(),
            None => vec![None; still.len()],
        };
        let points = still.iter().zip(in_space).map(|(o, in_space)| {
            let src = Point2::new(f64::from(o.x), f64::from(o.y));
            TrackedPoint { id: o.id, src, at_frame_time: center_time(src), in_space }
        });
        let camera = self.path.out_from_src.get(index).copied().unwrap_or_else(Homography::identity);
        self.smoother.push(self.tracks.clip.timebase.seconds(frame.pts), &camera, points);
        Ok(())
    }

    /// The grid as a virtual camera shows it that stands where the real one turned; `None` where that is not known, or a
    /// part of the frame lies behind it.
    fn turned(&self, index: usize) -> Option<GridMesh> {
        let real = self.places.as_ref()?.camera(index)?;
        let shown = self.path.cameras.get(index).copied().flatten().filter(|c| c.turns)?;
        let rows = self.motion.and_then(|m| m.row_motion(index));
        let mut mesh = self.grid.to_mesh();
        for v in &mut mesh.vertices {
            let at_frame_time = rows.as_ref().map_or(*v, |r| r.center_time(*v));
            *v = shown.show(&direction(&real, at_frame_time)?)?;
        }
        (mesh.folded_cells() == 0).then_some(mesh)
    }
}

/// `mesh` with a `share` of `other` mixed in.
fn mixed(mut mesh: GridMesh, other: &GridMesh, share: f64) -> GridMesh {
    for (v, w) in mesh.vertices.iter_mut().zip(&other.vertices) {
        *v += (w - *v) * share;
    }
    mesh
}
