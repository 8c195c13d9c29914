//! The map of each frame, from the path of the virtual camera and the anchors of the mesh.
//!
//! The camera's map `S_t` removes the motion common to all points. Anchors ([`TrajectorySmoother`]) are the targets of single
//! points: their smoothed positions, or their projections into a virtual camera in space. The homography model follows the part
//! of them that a plane can follow, the mesh model warps the frame to them. Where the camera only rotated, no points are needed:
//! each vertex `v` moves to `D_t(π(R̄_t R_tᵀ π⁻¹(v)))`, with the rotations `R_t` of the real camera and `R̄_t` of the virtual one.

use std::ops::Range;

use super::error::StabilizeError;
use super::frame_models::FrameModels;
use super::options::WarpOptions;
use super::space::{ScenePoints, point_targets, viewing_direction};
use super::tracks::Tracks;
use super::warp_solver::{Strengths, WarpSolver};
use crate::motion::{ClipMotion, MotionModel};
use crate::path::{Anchor, TrackedPoint, TrajectoryOptions, TrajectorySmoother, VirtualPath};
use plumbline_image::Frame;
use plumbline_image::grid::{Grid, GridMesh};
use plumbline_image::warp::WarpField;
use plumbline_num::math::{Homography, Point2, Vec2};

/// Inputs of the maps of a clip.
#[derive(Clone, Copy)]
pub struct RenderInputs<'a> {
    /// The points of the clip.
    pub tracks: &'a Tracks,
    /// The path of the virtual camera.
    pub path: &'a VirtualPath,
    /// The motion of the real camera: the readout of its sensor, and its poses in space. Without it no frame is
    /// warped beyond the model that the mode forces.
    pub motion: Option<&'a ClipMotion>,
    /// Options of the warp.
    pub warp: &'a WarpOptions,
    /// The source must cover the output under any mesh: borders may not show.
    pub covered: bool,
}

/// Maps of the frames of a clip: inexpensive in their order, possible in any.
pub struct FrameMaps<'a> {
    inputs: RenderInputs<'a>,
    models: &'a FrameModels,
    /// Points in space, for virtual cameras there.
    scene: Option<ScenePoints<'a>>,
    grid: Grid,
    solver: WarpSolver,
    smoother: TrajectorySmoother,
    trajectories: TrajectoryOptions,
    /// Frames handed to the smoother, anchors taken from it, and maps asked for: each the next frame's index.
    pushed: usize,
    popped: usize,
    next: usize,
}

/// The map of a frame, `out_from_src`.
pub(super) enum ForwardMap {
    Plane(Homography),
    Mesh(GridMesh),
}

impl ForwardMap {
    /// Maps a point of the source to the output.
    pub(super) fn apply(&self, grid: &Grid, src: Point2) -> Option<Point2> {
        match self {
            Self::Plane(h) => h.apply(src),
            Self::Mesh(mesh) => grid.locate(src).map(|at| mesh.at(at)),
        }
    }
}

impl<'a> FrameMaps<'a> {
    /// Maps of the clip of `inputs` by the models of its frames; rolling shutter is corrected where the motion has a readout
    /// time.
    ///
    /// # Errors
    /// [`StabilizeError::Options`]: the options of the warp.
    pub fn new(inputs: &RenderInputs<'a>, models: &'a FrameModels) -> Result<Self, StabilizeError> {
        let (cols, rows) = (inputs.warp.columns as usize, inputs.warp.rows as usize);
        let (width, height) = (inputs.tracks.width as f64, inputs.tracks.height as f64);
        let grid = Grid { cols, rows, width, height };
        let solver = WarpSolver::new(&grid, inputs.warp.alpha, inputs.covered)?;
        let subspace = models.segments().iter().any(|s| s.model == MotionModel::Subspace);
        let trajectories = TrajectoryOptions { subspace, ..TrajectoryOptions::default() };
        let cameras = inputs.motion.and_then(|m| Some((m.cameras.as_ref()?, m)));
        let scene = cameras.filter(|_| !inputs.path.cameras.is_empty()).map(|(c, m)| ScenePoints::new(c, m));
        let smoother = TrajectorySmoother::new(trajectories);
        Ok(Self { inputs: *inputs, models, scene, grid, solver, smoother, trajectories, pushed: 0, popped: 0, next: 0 })
    }

    /// The grid over the source on which frames are warped.
    pub(super) fn grid(&self) -> Grid {
        self.grid
    }

    /// The map of the next frame, whose picture is `frame`: from output pixels to source pixels.
    ///
    /// # Errors
    /// [`StabilizeError::Input`] beyond the last frame; [`StabilizeError::Store`], [`StabilizeError::Warp`].
    pub fn next(&mut self, frame: &Frame) -> Result<WarpField, StabilizeError> {
        self.next_field(Some(frame))
    }

    /// The map of frame `index`, as [`Self::next`] would give it; without its picture, all parts of it have the same
    /// saliency. The frame after it is the next one.
    ///
    /// A frame out of order costs the reading of the tracks of about a second.
    ///
    /// # Errors
    /// As for [`Self::next`].
    pub fn at(&mut self, index: usize, frame: Option<&Frame>) -> Result<WarpField, StabilizeError> {
        if index != self.next {
            self.seek(index)?;
        }
        self.next_field(frame)
    }

    /// Makes `index` the next frame: trajectories are smoothed from the first frame on that its map depends on.
    ///
    /// # Errors
    /// [`StabilizeError::Store`].
    pub fn seek(&mut self, index: usize) -> Result<(), StabilizeError> {
        let start = self.first_support(index)?;
        self.smoother = TrajectorySmoother::new(self.trajectories);
        (self.pushed, self.popped, self.next) = (start, start, index);
        Ok(())
    }

    /// The frames whose points the maps of `frames` depend on.
    ///
    /// # Errors
    /// [`StabilizeError::Store`].
    pub fn support(&self, frames: Range<usize>) -> Result<Range<usize>, StabilizeError> {
        let end = self.inputs.tracks.store.frames();
        let Some(last) = frames.end.checked_sub(1).filter(|last| *last < end) else { return Ok(frames.start..end) };
        // A frame is settled by the first one that is half a window later; one more, so that rounding decides nothing.
        let until = self.time_s(last)? + self.trajectories.half_window_s();
        let mut stop = last + 1;
        while stop < end && self.time_s(stop)? < until {
            stop += 1;
        }
        Ok(self.first_support(frames.start)?..(stop + 2).min(end))
    }

    /// The first frame that the map of frame `index` depends on. Trajectories do not reach beyond the start of a segment, and when a
    /// frame is settled the smoother has forgotten the samples half a window before the frame in front of it; one frame more, so that
    /// rounding decides nothing.
    fn first_support(&self, index: usize) -> Result<usize, StabilizeError> {
        let starts = self.inputs.path.segments.iter().map(|s| s.frames.start);
        let segment = starts.filter(|&start| start <= index).max().unwrap_or(0);
        let mut start = index.saturating_sub(1);
        if start <= segment || start >= self.inputs.tracks.store.frames() {
            return Ok(segment);
        }
        let until = self.time_s(start)? - self.trajectories.half_window_s();
        while start > segment && self.time_s(start)? > until {
            start -= 1;
        }
        Ok(start.saturating_sub(1).max(segment))
    }

    fn time_s(&self, frame: usize) -> Result<f64, StabilizeError> {
        let tracks = self.inputs.tracks;
        Ok(tracks.timebase.seconds(tracks.store.quality(frame)?.0))
    }

    fn next_field(&mut self, frame: Option<&Frame>) -> Result<WarpField, StabilizeError> {
        let index = self.next;
        let field = match self.forward(frame)? {
            ForwardMap::Plane(camera) => WarpField::from_forward_homography(&camera),
            ForwardMap::Mesh(mesh) => WarpField::from_forward_mesh(&mesh, self.grid.width, self.grid.height),
        };
        field.map_err(|e| StabilizeError::Warp { frame: index, reason: e })
    }

    /// The map of the next frame; without its picture, all parts of it have the same saliency.
    pub(super) fn forward(&mut self, frame: Option<&Frame>) -> Result<ForwardMap, StabilizeError> {
        let index = self.next;
        self.next += 1;
        let path = self.inputs.path;
        let analyzed = path.out_from_src.len();
        let ahead = || StabilizeError::Input(format!("the clip has more frames than were analyzed ({analyzed})"));
        let camera = *path.out_from_src.get(index).ok_or_else(ahead)?;
        let anchors = self.anchors_in_space(index)?;
        let strength = |with: fn(MotionModel) -> bool| self.models.strength(index, with);
        let strengths = Strengths {
            homography: strength(|m| m >= MotionModel::Homography),
            mesh: strength(|m| m >= MotionModel::Mesh),
            given: self.models.given(index),
        };
        let rotation = strength(|m| m == MotionModel::Rotation);
        let rotated = if rotation > 0.0 { self.rotated(index) } else { None };
        if rotated.is_none() && !(strengths.homography > 0.0 || strengths.mesh > 0.0) {
            return Ok(ForwardMap::Plane(camera));
        }
        let mut solve = || {
            let solved = self.solver.solve(frame, &camera, &anchors, strengths);
            solved.map_err(|e| StabilizeError::Warp { frame: index, reason: e })
        };
        let mut mesh = match rotated {
            Some(rotated) if rotation >= 1.0 => rotated,
            Some(rotated) => mixed(solve()?, &rotated, rotation),
            None => solve()?,
        };
        self.solver.keep_covered(&mut mesh, &camera);
        Ok(ForwardMap::Mesh(mesh))
    }

    /// The anchors of frame `index`, blended toward their projections into the virtual camera by the strength of that model.
    fn anchors_in_space(&mut self, index: usize) -> Result<Vec<Anchor>, StabilizeError> {
        let mut anchors = self.anchors(index)?;
        let in_space = self.models.in_space(index);
        let in_subspace = self.models.strength(index, |model| model == MotionModel::Subspace);
        for anchor in &mut anchors {
            anchor.dst += anchor.in_subspace.map_or_else(Vec2::zeros, |shared| (shared - anchor.dst) * in_subspace);
            match anchor.in_space {
                Some(target) => anchor.dst += (target - anchor.dst) * in_space,
                // Its smoothed trajectory belongs to the path in the picture, not to the camera in space.
                None => anchor.weight *= 1.0 - in_space,
            }
        }
        Ok(anchors)
    }

    /// Anchors of frame `index`; none beyond the end of the tracks.
    fn anchors(&mut self, index: usize) -> Result<Vec<Anchor>, StabilizeError> {
        loop {
            if let Some(anchors) = self.smoother.pop() {
                self.popped += 1;
                if self.popped > index {
                    return Ok(anchors);
                }
            } else if self.pushed < self.inputs.tracks.store.frames() {
                self.push(self.pushed)?;
                self.pushed += 1;
            } else if self.pushed <= index {
                return Ok(Vec::new());
            } else {
                self.smoother.cut();
            }
        }
    }

    /// Hands frame `index` to the smoother.
    fn push(&mut self, index: usize) -> Result<(), StabilizeError> {
        let RenderInputs { tracks, path, motion, .. } = self.inputs;
        let frame = tracks.store.read(index)?;
        if index > 0 && path.segments.iter().any(|s| s.frames.start == index) {
            self.smoother.cut();
        }
        let rows = motion.and_then(|m| m.row_motion(index));
        let background: Vec<_> = frame.observations.iter().filter(|o| o.background).copied().collect();
        let center_time = |src| rows.as_ref().map_or(src, |r| r.center_time(src));
        let virtual_camera = path.cameras.get(index).copied().flatten();
        let in_space = match virtual_camera.zip(self.scene.as_ref()) {
            Some((camera, scene)) if self.models.given(index) > 0.0 => {
                point_targets(scene, index, &camera, &background, center_time)
            }
            Some((camera, scene)) => {
                background.iter().map(|o| camera.show(&scene.of(index, o, camera.rotation_only)?)).collect()
            }
            None => vec![None; background.len()],
        };
        let points = background.iter().zip(in_space).map(|(o, in_space)| {
            let src = Point2::new(f64::from(o.x), f64::from(o.y));
            TrackedPoint { id: o.id, src, at_frame_time: center_time(src), in_space }
        });
        let camera = path.out_from_src.get(index).copied().unwrap_or_else(Homography::identity);
        self.smoother.push(tracks.timebase.seconds(frame.pts), &camera, points);
        Ok(())
    }

    /// The grid in a virtual camera at the position of the real one; `None` where that is unknown, or a part of the frame is
    /// behind it.
    fn rotated(&self, index: usize) -> Option<GridMesh> {
        let real = self.scene.as_ref()?.camera(index)?;
        let shown = self.inputs.path.cameras.get(index).copied().flatten().filter(|c| c.rotation_only)?;
        let rows = self.inputs.motion.and_then(|m| m.row_motion(index));
        let mut mesh = self.grid.to_mesh();
        for v in &mut mesh.vertices {
            let at_frame_time = rows.as_ref().map_or(*v, |r| r.center_time(*v));
            *v = shown.show(&viewing_direction(&real, at_frame_time)?)?;
        }
        (mesh.folded_cells() == 0).then_some(mesh)
    }
}

/// `mesh` with the fraction `fraction` of `other` mixed in.
fn mixed(mut mesh: GridMesh, other: &GridMesh, fraction: f64) -> GridMesh {
    for (v, w) in mesh.vertices.iter_mut().zip(&other.vertices) {
        *v += (w - *v) * fraction;
    }
    mesh
}
