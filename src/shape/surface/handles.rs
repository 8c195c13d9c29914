//! Handles: positional constraints on vertices, and their targets.
//!
//! The *set* of handles is part of the factorization; the *pose* (their targets) is an argument of every solve, so that dragging
//! needs no factorization.

use nalgebra::{Point3, UnitQuaternion};

use super::SurfaceError;

/// A positional constraint of a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Constraint {
    /// Hard constraint: the vertex is at its target.
    Hard,
    /// Soft constraint: `μ |x − target|²` is added to the energy. `μ` is dimensionless like the edge weights: 1 is about as stiff
    /// as an edge of a regular mesh.
    Soft(f64),
}

/// A set of constrained vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Handles {
    vertices: Vec<u32>,
    constraints: Vec<Constraint>,
}

impl Handles {
    /// Constrains vertices, given in any order; they are stored in ascending order.
    ///
    /// # Errors
    /// [`SurfaceError::ConstrainedTwice`], [`SurfaceError::Weight`].
    pub fn new(constrained: impl IntoIterator<Item = (u32, Constraint)>) -> Result<Self, SurfaceError> {
        let mut constrained: Vec<(u32, Constraint)> = constrained.into_iter().collect();
        constrained.sort_by_key(|h| h.0);
        if let Some(twice) = constrained.windows(2).find(|h| h[0].0 == h[1].0) {
            return Err(SurfaceError::ConstrainedTwice { vertex: twice[0].0 });
        }
        for &(vertex, constraint) in &constrained {
            if let Constraint::Soft(weight) = constraint
                && !(weight > 0.0 && weight.is_finite())
            {
                return Err(SurfaceError::Weight { vertex, weight });
            }
        }
        let (vertices, constraints) = constrained.into_iter().unzip();
        Ok(Self { vertices, constraints })
    }

    /// Hard constraints on these vertices.
    ///
    /// # Errors
    /// [`SurfaceError::ConstrainedTwice`].
    pub fn exact(vertices: impl IntoIterator<Item = u32>) -> Result<Self, SurfaceError> {
        Self::new(vertices.into_iter().map(|v| (v, Constraint::Hard)))
    }

    /// The constrained vertices, ascending: the order of a pose.
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// The constraint of each vertex.
    pub fn constraints(&self) -> &[Constraint] {
        &self.constraints
    }

    /// Number of constrained vertices.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// True without constraints.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }
}

/// Targets of the constrained vertices, one entry per vertex of the [`Handles`], in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct HandlePose {
    positions: Vec<Point3<f64>>,
    rotations: Option<Vec<UnitQuaternion<f64>>>,
}

impl HandlePose {
    /// Target positions. The rotations at the handles are fitted to them, for each connected patch of handles.
    pub fn new(positions: Vec<Point3<f64>>) -> Self {
        Self { positions, rotations: None }
    }

    /// Adds the rotation of the surface at each handle (`posed_from_rest`), which a single vertex does not determine. Linear
    /// methods interpolate these rotations over the surface; iterative ones derive their initial guess from them.
    #[must_use]
    pub fn with_rotations(mut self, rotations: Vec<UnitQuaternion<f64>>) -> Self {
        self.rotations = Some(rotations);
        self
    }

    /// Target positions.
    pub fn positions(&self) -> &[Point3<f64>] {
        &self.positions
    }

    /// Rotations, if given.
    pub fn rotations(&self) -> Option<&[UnitQuaternion<f64>]> {
        self.rotations.as_deref()
    }

    /// Rejects a pose that does not fit the handles.
    pub(super) fn check(&self, handles: &Handles) -> Result<(), SurfaceError> {
        let expect = |what, given| {
            let handles = handles.len();
            if given == handles { Ok(()) } else { Err(SurfaceError::Pose { what, given, handles }) }
        };
        expect("positions", self.positions.len())?;
        expect("rotations", self.rotations.as_ref().map_or(handles.len(), Vec::len))?;
        let finite = |k: &usize| self.positions[*k].coords.iter().all(|c| c.is_finite());
        if let Some(k) = (0..handles.len()).find(|k| !finite(k)) {
            return Err(SurfaceError::NotFinite { what: "target", vertex: handles.vertices[k] });
        }
        let bad = self.rotations.iter().flatten().position(|q| !q.coords.iter().all(|c| c.is_finite()));
        match bad {
            Some(k) => Err(SurfaceError::NotFinite { what: "rotation", vertex: handles.vertices[k] }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handles_are_sorted_and_each_vertex_is_constrained_once() {
        let handles = Handles::new([(7, Constraint::Soft(2.0)), (3, Constraint::Hard)]).unwrap();
        assert_eq!(
            (handles.vertices(), handles.constraints()),
            (&[3, 7][..], &[Constraint::Hard, Constraint::Soft(2.0)][..])
        );
        assert_eq!(Handles::exact([4, 1, 4]), Err(SurfaceError::ConstrainedTwice { vertex: 4 }));
        for weight in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                Handles::new([(1, Constraint::Soft(weight))]),
                Err(SurfaceError::Weight { vertex: 1, .. })
            ));
        }
    }

    #[test]
    fn a_pose_of_another_size_or_not_finite_is_rejected() {
        let handles = Handles::exact([2, 5]).unwrap();
        let message = |pose: HandlePose| pose.check(&handles).unwrap_err().to_string();
        let two = vec![Point3::origin(); 2];
        assert_eq!(
            message(HandlePose::new(vec![Point3::origin()])),
            "1 positions for 2 constrained vertices: give one for each"
        );
        assert_eq!(
            message(HandlePose::new(vec![Point3::origin(), Point3::new(0.0, f64::NAN, 0.0)])),
            "the target of vertex 5 is not finite"
        );
        let rotations = vec![UnitQuaternion::identity(); 3];
        assert_eq!(
            message(HandlePose::new(two).with_rotations(rotations)),
            "3 rotations for 2 constrained vertices: give one for each"
        );
    }
}
