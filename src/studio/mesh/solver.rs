//! The surface that is shown, brought up to date in slices.
//!
//! ```text
//! prefactor → follow → settle → exact → frames → rest
//! ```
//!
//! While a hand drags, each slice follows the handles by a few iterations from the surface that is shown. At rest the slices go on until
//! little changes, then the pose is solved as the stage `mesh.deform` does, from its own initial guess to its own tolerance: what is
//! shown at rest is what `plumbline run` writes. With several frames all of them are solved in their order, as the stage does.

use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::Point3;

use super::document::{Handle, MeshDocument, Region};
use super::keys;
use crate::error::StudioError;
use plumbline_app::stages::MeshDeformSettings;
use plumbline_num::run::Run;
use plumbline_shape::mesh::TriMesh;
use plumbline_shape::surface::{
    DeformReport, Deformation, KeyframedDeformer, Method, RotationEstimation, SolvableMesh, Stop, SurfaceError,
};

/// Iterations of a slice that settles: a few pictures a second at 173k vertices.
const SETTLING: usize = 2;
/// Settling ends where a slice lowers the energy by less than this fraction, and the exact solve begins. After a second of CPU at 43k
/// vertices the energy is then .01 % above the lowest; it was .13 % with 1e-4, .38 % with 1e-3.
const SETTLED: f64 = 1e-5;
/// Longest time of settling. The exact solve starts over from its own initial guess and shows nothing before its end, 1.5 s at 43k
/// vertices: until then a surface that still moves is shown better by settling.
const MAX_SETTLING: Duration = Duration::from_secs(1);
/// Maximum memory of the poses of all frames, bytes.
const MAX_FRAME_BYTES: usize = 256 << 20;
/// Energies that are shown of one solve.
const MAX_CURVE: usize = 2000;

/// What the next slice does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Factors the method for the handles.
    Prefactor,
    /// A few iterations towards handles that moved.
    Follow,
    /// A few more.
    Settle,
    /// The pose as the stage solves it.
    Exact,
    /// The pose of the next frame.
    Frames,
    /// Nothing.
    Rest,
}

impl Phase {
    /// Its name in the state.
    pub fn name(self) -> &'static str {
        match self {
            Self::Prefactor => "prefactor",
            Self::Follow => "follow",
            Self::Settle => "settle",
            Self::Exact => "exact",
            Self::Frames => "frames",
            Self::Rest => "rest",
        }
    }
}

/// What a slice brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// The surface that is shown is another one.
    Surface,
    /// A frame is solved.
    Frame(usize),
    /// Nothing to show.
    Nothing,
}

/// What a factorization depends on.
#[derive(Debug)]
struct Factored {
    handles: Vec<Arc<Handle>>,
    region: Arc<Region>,
    settings: MeshDeformSettings,
    deformer: KeyframedDeformer,
}

/// The surface of a document.
#[derive(Debug)]
pub struct Solver {
    mesh: TriMesh,
    /// The surface at rest.
    pub solvable: Arc<SolvableMesh>,
    factored: Option<Factored>,
    shown: Vec<Point3<f64>>,
    phase: Phase,
    time: f64,
    settling_since: Option<Instant>,
    interrupted: bool,
    /// The surface that is shown is the last result of the deformer.
    in_step: bool,
    frames: Frames,
    /// The last report.
    pub report: Option<DeformReport>,
    /// Whether the surface that is shown is what the stage gives.
    pub exact: bool,
    /// Energies since the last change.
    pub curve: Vec<f64>,
    /// Why there is no solution.
    pub error: Option<String>,
    /// Time of the last factorization.
    pub prefactored_in: Option<Duration>,
    /// Time of the last slice that followed the handles.
    pub followed_in: Option<Duration>,
    warnings: Vec<String>,
}

/// Poses of all frames.
#[derive(Debug, Default)]
struct Frames {
    times: Vec<f64>,
    poses: Vec<Arc<Vec<Point3<f64>>>>,
    /// Frames that the deformer has solved in a row: a pose starts from the one before.
    in_a_row: usize,
}

impl Solver {
    /// The surface of a mesh at rest.
    pub fn new(mesh: &TriMesh, solvable: Arc<SolvableMesh>) -> Self {
        let shown = solvable.mesh.positions().to_vec();
        Self {
            mesh: mesh.clone(),
            solvable,
            factored: None,
            shown,
            phase: Phase::Rest,
            time: 0.0,
            settling_since: None,
            interrupted: false,
            in_step: false,
            frames: Frames::default(),
            report: None,
            exact: true,
            curve: Vec::new(),
            error: None,
            prefactored_in: None,
            followed_in: None,
            warnings: Vec::new(),
        }
    }

    /// Positions of the surface that is shown.
    pub fn shown(&self) -> &[Point3<f64>] {
        &self.shown
    }

    /// What the next slice does.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Poses of frames that are solved, in their order.
    pub fn frames(&self) -> &[Arc<Vec<Point3<f64>>>] {
        &self.frames.poses
    }

    /// Times of the frames.
    pub fn frame_times(&self) -> &[f64] {
        &self.frames.times
    }

    /// Texts for the user since the last call.
    pub fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// Another document, or another time: what is out of date is computed again in the next slices.
    pub fn set(&mut self, document: &MeshDocument, time: f64) {
        if document.handles.is_empty() {
            self.factored = None;
            self.become_rest();
            return;
        }
        let settings = document.pipeline.settings();
        let fits = self.factored.as_ref().is_some_and(|f| f.fits(document));
        if !fits {
            self.phase = Phase::Prefactor;
            self.factored = None;
            self.in_step = false;
            self.time = time;
            self.changed();
            return;
        }
        let Some(factored) = self.factored.as_mut() else { return };
        let moved = factored.set_tracks(document);
        let frames = factored.settings.frames != settings.frames;
        factored.settings.clone_from(settings);
        if moved || frames {
            self.frames = Frames::default();
        }
        let seeks = time.to_bits() != self.time.to_bits();
        self.time = time;
        if moved || seeks {
            self.phase = Phase::Follow;
            self.changed();
            self.show_frame();
        } else if frames && self.phase == Phase::Rest {
            self.phase = Phase::Frames;
        }
    }

    fn changed(&mut self) {
        self.exact = false;
        self.error = None;
        self.settling_since = None;
        self.curve.clear();
    }

    fn become_rest(&mut self) {
        self.phase = Phase::Rest;
        self.frames = Frames::default();
        self.report = None;
        self.exact = true;
        self.error = None;
        self.curve.clear();
        self.shown.copy_from_slice(self.solvable.mesh.positions());
        self.in_step = false;
    }

    /// Shows the pose of a frame at this very time, if it is solved.
    fn show_frame(&mut self) -> bool {
        let Some(k) = self.frames.times.iter().position(|t| keys::same_time(*t, self.time)) else { return false };
        let Some(pose) = self.frames.poses.get(k) else { return false };
        self.shown.copy_from_slice(pose);
        self.in_step = false;
        self.exact = true;
        self.phase = if self.frames.poses.len() < self.frames.times.len() { Phase::Frames } else { Phase::Rest };
        true
    }

    /// One slice.
    ///
    /// # Errors
    /// What the method says; the phase is then [`Phase::Rest`], until the document changes.
    pub fn slice(&mut self, document: &MeshDocument, run: &Run) -> Result<Shown, StudioError> {
        let done = match self.phase {
            Phase::Prefactor => self.prefactor(document, run),
            Phase::Follow => self.follow(),
            Phase::Settle => self.settle(),
            Phase::Exact => self.solve(run),
            Phase::Frames => self.next_frame(run),
            Phase::Rest => Ok(Shown::Nothing),
        };
        done.map_err(|error| match error {
            SurfaceError::Interrupted(stopped) => {
                self.interrupted = true;
                stopped.into()
            }
            other => {
                self.phase = Phase::Rest;
                self.error = Some(other.to_string());
                StudioError::Method(other.to_string())
            }
        })
    }

    fn prefactor(&mut self, document: &MeshDocument, run: &Run) -> Result<Shown, SurfaceError> {
        let settings = document.pipeline.settings().clone();
        let started = Instant::now();
        // Letters that come all the time must not keep it from its end.
        let run = if std::mem::take(&mut self.interrupted) { Run::default() } else { run.silent() };
        let deformer = KeyframedDeformer::new(
            &self.mesh,
            self.solvable.clone(),
            document.mesh_handles(),
            &settings.keyframed(),
            &run,
        )?;
        self.prefactored_in = Some(started.elapsed());
        self.warnings.extend(deformer.warnings().iter().cloned());
        let (handles, region) = (document.handles.clone(), document.region.clone());
        self.factored = Some(Factored { handles, region, settings, deformer });
        self.frames = Frames::default();
        self.phase = Phase::Follow;
        Ok(Shown::Nothing)
    }

    fn follow(&mut self) -> Result<Shown, SurfaceError> {
        let Some(factored) = &self.factored else { return Ok(self.rest()) };
        if factored.is_linear() {
            self.phase = Phase::Exact;
            return Ok(Shown::Nothing);
        }
        let started = Instant::now();
        self.iterate(1)?;
        self.followed_in = Some(started.elapsed());
        self.phase = Phase::Settle;
        self.settling_since = Some(Instant::now());
        Ok(Shown::Surface)
    }

    fn rest(&mut self) -> Shown {
        self.phase = Phase::Rest;
        Shown::Nothing
    }

    fn settle(&mut self) -> Result<Shown, SurfaceError> {
        let energies = self.iterate(SETTLING)?;
        let (first, last) = (energies.0, energies.1);
        let long = self.settling_since.is_none_or(|since| since.elapsed() > MAX_SETTLING);
        if long || !(first - last > SETTLED * first.abs()) {
            self.phase = Phase::Exact;
        }
        Ok(Shown::Surface)
    }

    /// A few iterations from the surface that is shown; the energies before and after.
    fn iterate(&mut self, iterations: usize) -> Result<(f64, f64), SurfaceError> {
        self.frames.in_a_row = 0;
        let Some(factored) = &mut self.factored else { return Ok((0.0, 0.0)) };
        // Whole: a picture of a drag takes a few milliseconds.
        let whole = Run::default();
        let found = if std::mem::take(&mut self.in_step) {
            factored.deformer.follow_on(self.time, iterations, &whole)?
        } else {
            factored.deformer.follow(self.time, &self.shown, iterations, &whole)?
        };
        let ends = (found.report.energies.first().copied(), found.report.energies.last().copied());
        self.take(found);
        Ok((ends.0.unwrap_or(0.0), ends.1.unwrap_or(0.0)))
    }

    fn take(&mut self, found: Deformation) {
        let more = found.report.energies.iter().skip(usize::from(!self.curve.is_empty()));
        self.curve.extend(more.copied());
        self.curve.truncate(MAX_CURVE);
        self.shown = found.positions;
        self.report = Some(found.report);
        self.in_step = true;
    }

    /// The pose as the stage solves it.
    fn solve(&mut self, run: &Run) -> Result<Shown, SurfaceError> {
        self.frames.in_a_row = 0;
        self.in_step = false;
        let Some(factored) = &mut self.factored else { return Ok(self.rest()) };
        factored.deformer.restart();
        let found = factored.deformer.pose(self.time, &run.silent())?;
        let several = factored.settings.frames > 1;
        self.take(found);
        self.exact = true;
        self.phase = if several { Phase::Frames } else { Phase::Rest };
        Ok(Shown::Surface)
    }

    /// The pose of the next frame.
    fn next_frame(&mut self, run: &Run) -> Result<Shown, SurfaceError> {
        self.in_step = false;
        let Some(factored) = &mut self.factored else { return Ok(self.rest()) };
        let count = factored.settings.frames;
        if count <= 1 || count as usize * self.shown.len() * size_of::<Point3<f64>>() > MAX_FRAME_BYTES {
            self.frames = Frames::default();
            return Ok(self.rest());
        }
        if self.frames.times.len() != count as usize {
            let times = factored.deformer.handles().frame_times(count).collect();
            self.frames = Frames { times, ..Frames::default() };
        }
        let k = self.frames.in_a_row;
        if k >= self.frames.times.len() {
            self.phase = Phase::Rest;
            return Ok(if self.show_frame() { Shown::Surface } else { Shown::Nothing });
        }
        if k == 0 {
            factored.deformer.restart();
        }
        let solved = factored.deformer.pose(self.frames.times[k], &run.silent());
        let found = solved.inspect_err(|_| self.frames.in_a_row = 0)?;
        self.frames.in_a_row += 1;
        if k < self.frames.poses.len() {
            return Ok(Shown::Nothing);
        }
        self.frames.poses.push(Arc::new(found.positions));
        Ok(Shown::Frame(k))
    }

    /// Solves to the end, all frames too: for what is exported.
    ///
    /// # Errors
    /// As [`Self::slice`].
    pub fn finish(&mut self, document: &MeshDocument, run: &Run) -> Result<(), StudioError> {
        if let Some(error) = &self.error {
            return Err(StudioError::Method(error.clone()));
        }
        while self.phase != Phase::Rest {
            run.check()?;
            if matches!(self.phase, Phase::Follow | Phase::Settle) {
                self.phase = Phase::Exact;
            }
            self.slice(document, run)?;
        }
        Ok(())
    }

    /// Positions of the vertices of the file for those of the surface.
    pub fn carried_back(&self, positions: &[Point3<f64>]) -> Vec<Point3<f64>> {
        self.solvable.carry_back(self.mesh.positions(), positions)
    }

    /// Whether the last solve converged.
    pub fn stop(&self) -> Option<Stop> {
        self.report.as_ref().map(|r| r.stop)
    }
}

impl Factored {
    /// Whether the factorization is that of the document.
    fn fits(&self, document: &MeshDocument) -> bool {
        let (old, new) = (&self.settings, document.pipeline.settings());
        let same = |a: &Arc<Handle>, b: &Arc<Handle>| {
            let moves = |h: &Handle| new.roi.is_some() && h.mesh.track.times().is_some();
            Arc::ptr_eq(a, b)
                || a.mesh.vertices == b.mesh.vertices && a.mesh.weight == b.mesh.weight && moves(a) == moves(b)
        };
        old.keyframed() == new.keyframed()
            && (Arc::ptr_eq(&self.region, &document.region) || self.region.outside == document.region.outside)
            && self.handles.len() == document.handles.len()
            && self.handles.iter().zip(&document.handles).all(|(a, b)| same(a, b))
    }

    /// Takes the motions of the document over. True where one differs.
    fn set_tracks(&mut self, document: &MeshDocument) -> bool {
        let mut moved = false;
        for (k, handle) in document.handles.iter().enumerate() {
            let old = &self.handles[k];
            if !Arc::ptr_eq(old, handle) && old.mesh.track != handle.mesh.track {
                self.deformer.set_track(k, handle.mesh.track.clone());
                moved = true;
            }
        }
        self.handles.clone_from(&document.handles);
        self.region = document.region.clone();
        moved
    }

    /// Whether a single solve gives the minimum: there is nothing to follow.
    fn is_linear(&self) -> bool {
        match self.settings.method {
            Method::Poisson => true,
            Method::Laplacian => self.settings.options.rotation_estimation != RotationEstimation::Alternating,
            _ => false,
        }
    }
}
