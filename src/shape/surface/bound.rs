//! The rest shape with its constraints: the state that all methods share.
//!
//! Positions are relative to the center of the bounding box, so that a mesh far from the origin loses no digits.

use nalgebra::{Point3, Vector3};

use super::components::{FIXED, Unknowns};
use super::lanes::Lanes;
use super::{
    DeformOptions, DeformReport, Deformation, Distortion, DistortionMetrics, HandlePose, Handles, InitialGuess, Stop,
    SurfaceError,
};
use crate::mesh::TriMesh;

/// A mesh at rest with its constraints.
#[derive(Debug)]
pub(super) struct Bound {
    pub(super) rest: Vec<Lanes>,
    pub(super) unknowns: Unknowns,
    pub(super) metrics: DistortionMetrics,
    center: Vector3<f64>,
}

/// A checked initial guess, with the state `T` of the previous solve.
#[derive(Debug)]
pub(super) enum Guess<T> {
    /// The method's own estimate.
    Own,
    /// The rest shape.
    Rest,
    /// Given positions.
    At(Vec<Lanes>),
    /// The result of the previous solve.
    Last(T),
}

impl Bound {
    pub(super) fn new(mesh: &TriMesh, handles: &Handles, options: &DeformOptions) -> Result<Self, SurfaceError> {
        let unknowns = Unknowns::new(mesh, handles, options.unconstrained)?;
        let center = mesh.bounding_box().map_or(Vector3::zeros(), |(low, high)| nalgebra::center(&low, &high).coords);
        let rest = mesh.positions().iter().map(|p| Lanes::point((p.coords - center).into())).collect();
        Ok(Self { rest, unknowns, metrics: DistortionMetrics::new(mesh), center })
    }

    /// A position relative to the center.
    fn centered(&self, p: &Point3<f64>) -> Lanes {
        Lanes::point((p.coords - self.center).into())
    }

    /// A position relative to the center, in mesh coordinates.
    pub(super) fn uncentered(&self, p: Vector3<f64>) -> Point3<f64> {
        Point3::from(p + self.center)
    }

    /// The checked targets of a pose.
    pub(super) fn targets(&self, pose: &HandlePose) -> Result<Vec<Lanes>, SurfaceError> {
        pose.check(&self.unknowns.handles)?;
        Ok(pose.positions().iter().map(|p| self.centered(p)).collect())
    }

    /// Resolves an initial guess for a method whose previous solve ended at `last`.
    pub(super) fn guess<T>(&self, guess: InitialGuess<'_>, last: Option<T>) -> Result<Guess<T>, SurfaceError> {
        Ok(match (guess, last) {
            (InitialGuess::At(positions), _) => {
                self.check_guess(positions)?;
                Guess::At(positions.iter().map(|p| self.centered(p)).collect())
            }
            (InitialGuess::Last, Some(last)) => Guess::Last(last),
            (InitialGuess::Rest, _) => Guess::Rest,
            _ => Guess::Own,
        })
    }

    /// Rejects positions that do not fit the mesh.
    fn check_guess(&self, positions: &[Point3<f64>]) -> Result<(), SurfaceError> {
        let vertices = self.rest.len();
        if positions.len() != vertices {
            return Err(SurfaceError::PerVertex {
                what: "positions of the initial guess",
                given: positions.len(),
                vertices,
            });
        }
        match positions.iter().position(|p| !p.coords.iter().all(|c| c.is_finite())) {
            Some(v) => Err(SurfaceError::NotFinite { what: "initial guess", vertex: v as u32 }),
            None => Ok(()),
        }
    }

    /// The solution with its report; `counts` are negative weights and degenerate faces.
    pub(super) fn done(
        &self,
        x: &[Lanes],
        pose: &HandlePose,
        energies: Vec<f64>,
        stop: Stop,
        counts: (usize, usize),
    ) -> Deformation {
        self.reported(self.outer(x, pose), pose, energies, stop, counts)
    }

    /// The same without the distortion.
    pub(super) fn unmeasured(
        &self,
        x: &[Lanes],
        pose: &HandlePose,
        energies: Vec<f64>,
        stop: Stop,
        counts: (usize, usize),
    ) -> Deformation {
        let positions = self.outer(x, pose);
        self.with_shape(positions, pose, energies, stop, counts, Distortion::default())
    }

    /// Positions in mesh coordinates with their report.
    pub(super) fn reported(
        &self,
        positions: Vec<Point3<f64>>,
        pose: &HandlePose,
        energies: Vec<f64>,
        stop: Stop,
        counts: (usize, usize),
    ) -> Deformation {
        let shape = self.metrics.measure(&positions);
        self.with_shape(positions, pose, energies, stop, counts, shape)
    }

    fn with_shape(
        &self,
        positions: Vec<Point3<f64>>,
        pose: &HandlePose,
        energies: Vec<f64>,
        stop: Stop,
        (negative_weights, degenerate_faces): (usize, usize),
        shape: Distortion,
    ) -> Deformation {
        let report = DeformReport {
            iterations: if stop == Stop::Solved { 1 } else { energies.len() - 1 },
            energies,
            stop,
            constraint_error: self.constraint_error(&positions, pose),
            shape,
            negative_weights,
            degenerate_faces,
            fixed_components: self.unknowns.unconstrained.clone(),
        };
        Deformation { positions, report }
    }

    /// Sets vertices with hard constraints to their targets, and those of unconstrained components to their rest positions.
    pub(super) fn impose(&self, targets: &[Lanes], x: &mut [Lanes]) {
        for (v, &unknown) in self.unknowns.unknown.iter().enumerate() {
            if unknown == FIXED {
                x[v] = self.rest[v];
            }
        }
        for (&v, &target) in self.unknowns.handles.vertices().iter().zip(targets) {
            if self.unknowns.unknown[v as usize] == FIXED {
                x[v as usize] = target;
            }
        }
    }

    /// Whether each vertex is in a component without a handle.
    pub(super) fn unconstrained(&self) -> Vec<bool> {
        let mut constrained = vec![false; self.rest.len()];
        let component = &self.unknowns.component;
        self.unknowns.handles.vertices().iter().for_each(|&v| constrained[component[v as usize] as usize] = true);
        component.iter().map(|&c| !constrained[c as usize]).collect()
    }

    /// Positions in mesh coordinates. Hard constraints hold to the last bit.
    fn outer(&self, x: &[Lanes], pose: &HandlePose) -> Vec<Point3<f64>> {
        let rest = self.metrics.rest().positions();
        let position = |(v, x): (usize, &Lanes)| match self.unknowns.unknown[v] {
            FIXED => rest[v],
            _ => Point3::from(Vector3::from(x.xyz()) + self.center),
        };
        let mut positions: Vec<Point3<f64>> = x.iter().enumerate().map(position).collect();
        for (&v, target) in self.unknowns.handles.vertices().iter().zip(pose.positions()) {
            if self.unknowns.unknown[v as usize] == FIXED {
                positions[v as usize] = *target;
            }
        }
        positions
    }

    /// Largest distance of a constrained vertex from its target.
    fn constraint_error(&self, positions: &[Point3<f64>], pose: &HandlePose) -> f64 {
        let handles = self.unknowns.handles.vertices().iter().zip(pose.positions());
        handles.map(|(&v, t)| (positions[v as usize] - t).norm()).fold(0.0, f64::max)
    }
}
