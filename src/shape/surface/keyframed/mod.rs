//! Deformation by handles that move over time: what lies between handles as a file has them and a prefactored method.
//!
//! A handle names vertices of the file. The surface that is deformed is a repaired one ([`SolvableMesh`]): repair joins some
//! vertices and leaves some out, so that every vertex of the surface belongs to the handle of the vertices that it was.

mod constrained;
mod solvable;

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::Point3;

use super::handle_file::{MeshHandles, Track};
use super::{Convergence, DeformOptions, Deformation, Deformer, InitialGuess, Method, SurfaceError};
use crate::mesh::TriMesh;
use plumbline_num::run::Run;

use constrained::Constrained;
pub use solvable::SolvableMesh;

/// Options of a [`KeyframedDeformer`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyframedOptions {
    /// How the rest of the surface follows.
    pub method: Method,
    /// Options of the methods.
    pub options: DeformOptions,
    /// Initial guess of the first pose; a later pose starts from the one before.
    pub init: InitialGuess<'static>,
    /// The surface moves up to this far from handles that move, along edges, in units of the mesh; all of it for `None`.
    pub reach: Option<f64>,
    /// When a pose is done.
    pub convergence: Convergence,
}

impl Default for KeyframedOptions {
    /// A tolerance of 10⁻⁸: a bar that is twisted by 135 degrees rests on a symmetric saddle first, where iterations gain less
    /// than 10⁻⁶ of the energy and end 3.5 % above the minimum; 10⁻⁸ costs half as many iterations again.
    fn default() -> Self {
        Self {
            method: Method::default(),
            options: DeformOptions::default(),
            init: InitialGuess::default(),
            reach: None,
            convergence: Convergence { max_iterations: 1000, tolerance: 1e-8 },
        }
    }
}

/// Largest rotation of a handle between two solves: nearer to half a rotation, the shortest rotation would soon be the wrong one.
const MAX_ROTATION: f64 = 0.8 * PI;
/// Iterations of the solves on the path to a pose: they only have to choose the direction of rotation.
const ON_THE_PATH: usize = 10;

/// A method prefactored for the handles of a mesh, for any number of times.
///
/// ```
/// use std::sync::Arc;
/// use plumbline_num::run::Run;
/// use plumbline_shape::mesh::shapes;
/// use plumbline_shape::surface::handle_file::HandleFile;
/// use plumbline_shape::surface::{KeyframedDeformer, KeyframedOptions, SolvableMesh};
///
/// let bar = shapes::bar([2, 2, 10], [1.0, 1.0, 5.0]);
/// let file = r#"{"format": "plumbline.handles", "version": 1, "handles": [
///     {"vertices": {"half_space": {"point": [0, 0, 0.1], "normal": [0, 0, -1]}}},
///     {"vertices": {"half_space": {"point": [0, 0, 4.9], "normal": [0, 0, 1]}}, "rigid": {"translation": [1, 0, 0]}}]}"#;
/// let (handles, run) = (HandleFile::parse(file)?.of_mesh(bar.positions())?, Run::default());
/// let surface = Arc::new(SolvableMesh::new(&bar, &run)?);
/// let mut deformer = KeyframedDeformer::new(&bar, surface, handles, &KeyframedOptions::default(), &run)?;
/// let half = deformer.pose(0.5, &run)?;
/// assert_eq!(half.report.constraint_error, 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct KeyframedDeformer {
    solvable: Arc<SolvableMesh>,
    /// Positions of the vertices of the file.
    rest: Vec<Point3<f64>>,
    handles: MeshHandles,
    options: KeyframedOptions,
    constrained: Constrained,
    deformer: Deformer,
    /// Time of the pose that was solved last.
    at: Option<f64>,
}

impl KeyframedDeformer {
    /// Prefactors a method for the handles of `mesh`; `solvable` is made from the same mesh.
    ///
    /// # Errors
    /// [`SurfaceError::HandleNotOnSurface`], [`SurfaceError::JoinedHandles`], and as [`Deformer::new`].
    pub fn new(
        mesh: &TriMesh,
        solvable: Arc<SolvableMesh>,
        handles: MeshHandles,
        options: &KeyframedOptions,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        let constrained = Constrained::new(&handles, &solvable, options.reach)?;
        let set = constrained.set(&handles)?;
        let deformer = Deformer::new(options.method, &solvable.mesh, &set, &options.options, run)?;
        let rest = mesh.positions().to_vec();
        Ok(Self { solvable, rest, handles, options: *options, constrained, deformer, at: None })
    }

    /// What the user should know of the handles: vertices on no triangle.
    pub fn warnings(&self) -> &[String] {
        &self.constrained.warnings
    }

    /// The handles.
    pub fn handles(&self) -> &MeshHandles {
        &self.handles
    }

    /// Another motion of a handle. The factorization stays; with [`KeyframedOptions::reach`], what is fixed depends on which
    /// handles move, and a new deformer is needed where a still handle begins to move.
    ///
    /// # Panics
    /// If there is no such handle, or a key of a [`Track::Free`] has another number of positions than the handle has vertices.
    pub fn set_track(&mut self, handle: usize, track: Track) {
        let of = &mut self.handles.handles[handle];
        if let Track::Free { keys, .. } = &track {
            assert!(keys.iter().all(|k| k.1.len() == of.vertices.len()), "one position per vertex of {:?}", of.name);
        }
        of.track = track;
    }

    /// Forgets the pose that was solved last: the next one starts from rest, as the first does.
    pub fn restart(&mut self) {
        self.at = None;
    }

    /// The pose at a time. Where a handle rotates too far from the last pose, or from rest, there are solves between.
    ///
    /// # Errors
    /// As [`Deformer::deform`].
    pub fn pose(&mut self, time: f64, run: &Run) -> Result<Deformation, SurfaceError> {
        let from = self.at.unwrap_or(self.handles.times().0);
        let angle = constrained::max_rotation(&self.handles, from, time);
        let steps = (angle / MAX_ROTATION).ceil().clamp(1.0, 1000.0) as u32;
        for step in 1..steps {
            let between = from + (time - from) * f64::from(step) / f64::from(steps);
            self.step(between, ON_THE_PATH, run)?;
        }
        self.step(time, self.options.convergence.max_iterations, run)
    }

    /// The pose at a time after at most so many iterations from a surface that is near: for a hand that drags, where the next call
    /// goes on from the result of this one.
    ///
    /// # Errors
    /// As [`Deformer::deform`].
    pub fn follow(
        &mut self,
        time: f64,
        from: &[Point3<f64>],
        iterations: usize,
        run: &Run,
    ) -> Result<Deformation, SurfaceError> {
        self.solve(time, InitialGuess::At(from), iterations, run)
    }

    /// The same from the result of the last call, which must have succeeded: without a copy of it, and with the rotations that it ended
    /// with. The report has no distortion ([`Deformer::follow`]).
    ///
    /// # Errors
    /// As [`Deformer::deform`].
    pub fn follow_on(&mut self, time: f64, iterations: usize, run: &Run) -> Result<Deformation, SurfaceError> {
        let Convergence { max_iterations, tolerance } = self.options.convergence;
        let convergence = Convergence { max_iterations: iterations.min(max_iterations), tolerance };
        let pose = self.constrained.pose(&self.handles, &self.rest, &self.solvable.mesh, time);
        let deformed = self.deformer.follow(&pose, &convergence, run)?;
        self.at = Some(time);
        Ok(deformed)
    }

    fn step(&mut self, time: f64, iterations: usize, run: &Run) -> Result<Deformation, SurfaceError> {
        let start = if self.at.is_some() { InitialGuess::Last } else { self.options.init };
        self.solve(time, start, iterations, run)
    }

    fn solve(
        &mut self,
        time: f64,
        start: InitialGuess<'_>,
        iterations: usize,
        run: &Run,
    ) -> Result<Deformation, SurfaceError> {
        let Convergence { max_iterations, tolerance } = self.options.convergence;
        let convergence = Convergence { max_iterations: iterations.min(max_iterations), tolerance };
        let pose = self.constrained.pose(&self.handles, &self.rest, &self.solvable.mesh, time);
        let deformed = self.deformer.deform(&pose, start, &convergence, run)?;
        self.at = Some(time);
        Ok(deformed)
    }

    /// The surface that is solved for, at rest.
    pub fn solvable(&self) -> &SolvableMesh {
        &self.solvable
    }

    /// Positions of the file's vertices for those of the surface.
    pub fn carry_back(&self, moved: &[Point3<f64>]) -> Vec<Point3<f64>> {
        self.solvable.carry_back(&self.rest, moved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::surface::handle_file::HandleFile;

    fn bent(shift: f64) -> KeyframedDeformer {
        let bar = shapes::bar([2, 2, 10], [1.0, 1.0, 5.0]);
        let text = format!(
            r#"{{"format": "plumbline.handles", "version": 1, "handles": [
                {{"vertices": {{"half_space": {{"point": [0, 0, 0.1], "normal": [0, 0, -1]}}}}}},
                {{"vertices": {{"half_space": {{"point": [0, 0, 4.9], "normal": [0, 0, 1]}}}},
                  "rigid": {{"translation": [{shift}, 0, 0]}}}}]}}"#
        );
        let (handles, run) = (HandleFile::parse(&text).unwrap().of_mesh(bar.positions()).unwrap(), Run::default());
        let solvable = Arc::new(SolvableMesh::new(&bar, &run).unwrap());
        KeyframedDeformer::new(&bar, solvable, handles, &KeyframedOptions::default(), &run).unwrap()
    }

    #[test]
    fn a_drag_ends_where_the_pose_is_and_a_restart_forgets_it() {
        let run = Run::default();
        let (mut dragged, mut told) = (bent(0.5), bent(1.0));
        let expected = told.pose(1.0, &run).unwrap();
        let mut shown = dragged.solvable().mesh.positions().to_vec();
        dragged.set_track(1, told.handles().handles[1].track.clone());
        let last = (0..200).map(|_| {
            let found = dragged.follow(1.0, &shown, 1, &run).unwrap();
            shown.clone_from(&found.positions);
            found.report
        });
        let (energy, wanted) =
            (*last.last().unwrap().energies.last().unwrap(), *expected.report.energies.last().unwrap());
        assert!((energy - wanted).abs() <= 1e-3 * wanted, "{energy} {wanted}");
        dragged.restart();
        assert_eq!(dragged.pose(1.0, &run).unwrap(), expected, "the same as without the drag");
        // Following from the last result is following from its positions, but for the warm start of the rotations.
        let mut on = bent(0.5);
        let rest = on.solvable().mesh.positions().to_vec();
        let first = on.follow(1.0, &rest, 3, &run).unwrap();
        let mut from = bent(0.5);
        from.follow(1.0, &rest, 3, &run).unwrap();
        let (a, b) = (on.follow_on(1.0, 2, &run).unwrap(), from.follow(1.0, &first.positions, 2, &run).unwrap());
        let apart = a.positions.iter().zip(&b.positions).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(apart < 1e-9, "{apart:e}");
        assert_eq!(a.report.shape, crate::surface::Distortion::default());
    }
}
