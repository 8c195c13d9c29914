//! What every method keeps of the mesh it is bound to.
//!
//! Positions are kept relative to the middle of the mesh's box, so that a mesh far from the origin loses no digits.

use nalgebra::{Point3, Vector3};

use super::held::{FIXED, Held};
use super::lanes::Lanes;
use super::{DeformOptions, DeformReport, Deformation, Gauge, HandlePose, Handles, Start, Stop, SurfaceError};
use crate::mesh::TriMesh;

/// A mesh with handles, method aside.
#[derive(Debug)]
pub(super) struct Bound {
    pub(super) rest: Vec<Lanes>,
    pub(super) held: Held,
    pub(super) gauge: Gauge,
    middle: Vector3<f64>,
}

/// What a method begins with, once a start was checked.
#[derive(Debug)]
pub(super) enum Begin<T> {
    /// With what it finds itself.
    Itself,
    /// With the surface at rest.
    Rest,
    /// With these positions.
    At(Vec<Lanes>),
    /// With where it ended.
    Last(T),
}

impl Bound {
    pub(super) fn new(mesh: &TriMesh, handles: &Handles, options: &DeformOptions) -> Result<Self, SurfaceError> {
        let held = Held::new(mesh, handles, options.unheld)?;
        let middle = mesh.bounding_box().map_or(Vector3::zeros(), |(low, high)| nalgebra::center(&low, &high).coords);
        let rest = mesh.positions().iter().map(|p| Lanes::point((p.coords - middle).into())).collect();
        Ok(Self { rest, held, gauge: Gauge::new(mesh), middle })
    }

    /// A position relative to the middle.
    fn inner(&self, p: &Point3<f64>) -> Lanes {
        Lanes::point((p.coords - self.middle).into())
    }

    /// The targets of a pose, checked.
    pub(super) fn targets(&self, pose: &HandlePose) -> Result<Vec<Lanes>, SurfaceError> {
        pose.check(&self.held.handles)?;
        Ok(pose.positions().iter().map(|p| self.inner(p)).collect())
    }

    /// What a start means to a method that ended at `last`.
    pub(super) fn begin<T>(&self, start: Start<'_>, last: Option<T>) -> Result<Begin<T>, SurfaceError> {
        Ok(match (start, last) {
            (Start::At(positions), _) => {
                self.check_start(positions)?;
                Begin::At(positions.iter().map(|p| self.inner(p)).collect())
            }
            (Start::Last, Some(last)) => Begin::Last(last),
            (Start::Rest, _) => Begin::Rest,
            (Start::Auto | Start::Coarse | Start::Spread | Start::Last, _) => Begin::Itself,
        })
    }

    /// Refuses a start that does not fit the mesh.
    fn check_start(&self, positions: &[Point3<f64>]) -> Result<(), SurfaceError> {
        let vertices = self.rest.len();
        if positions.len() != vertices {
            return Err(SurfaceError::PerVertex { what: "positions to start from", given: positions.len(), vertices });
        }
        match positions.iter().position(|p| !p.coords.iter().all(|c| c.is_finite())) {
            Some(v) => Err(SurfaceError::NotFinite { what: "start", vertex: v as u32 }),
            None => Ok(()),
        }
    }

    /// The surface at the end of a solve, and its report; `counts` are negative weights and degenerate faces.
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

    /// Positions in the mesh's own frame with their report.
    pub(super) fn reported(
        &self,
        positions: Vec<Point3<f64>>,
        pose: &HandlePose,
        energies: Vec<f64>,
        stop: Stop,
        (negative_weights, degenerate_faces): (usize, usize),
    ) -> Deformation {
        let report = DeformReport {
            iterations: if stop == Stop::Solved { 1 } else { energies.len() - 1 },
            energies,
            stop,
            constraint_error: self.constraint_error(&positions, pose),
            shape: self.gauge.measure(&positions),
            negative_weights,
            degenerate_faces,
            held_still: self.held.still.clone(),
        };
        Deformation { positions, report }
    }

    /// Puts the exactly held vertices on their targets and those of still parts where they rest.
    pub(super) fn impose(&self, targets: &[Lanes], x: &mut [Lanes]) {
        for (v, &unknown) in self.held.unknown.iter().enumerate() {
            if unknown == FIXED {
                x[v] = self.rest[v];
            }
        }
        for (&v, &target) in self.held.handles.vertices().iter().zip(targets) {
            if self.held.unknown[v as usize] == FIXED {
                x[v as usize] = target;
            }
        }
    }

    /// Whether each vertex is on a part without a handle.
    pub(super) fn still(&self) -> Vec<bool> {
        let mut held = vec![false; self.rest.len()];
        self.held.handles.vertices().iter().for_each(|&v| held[self.held.part[v as usize] as usize] = true);
        self.held.part.iter().map(|&part| !held[part as usize]).collect()
    }

    /// Positions in the mesh's own frame. What is held exactly gets its target to the last bit.
    fn outer(&self, x: &[Lanes], pose: &HandlePose) -> Vec<Point3<f64>> {
        let rest = self.gauge.rest().positions();
        let place = |(v, x): (usize, &Lanes)| match self.held.unknown[v] {
            FIXED => rest[v],
            _ => Point3::from(Vector3::from(x.xyz()) + self.middle),
        };
        let mut positions: Vec<Point3<f64>> = x.iter().enumerate().map(place).collect();
        for (&v, target) in self.held.handles.vertices().iter().zip(pose.positions()) {
            if self.held.unknown[v as usize] == FIXED {
                positions[v as usize] = *target;
            }
        }
        positions
    }

    /// Largest distance of a held vertex from its target.
    fn constraint_error(&self, positions: &[Point3<f64>], pose: &HandlePose) -> f64 {
        let handles = self.held.handles.vertices().iter().zip(pose.positions());
        handles.map(|(&v, t)| (positions[v as usize] - t).norm()).fold(0.0, f64::max)
    }
}
