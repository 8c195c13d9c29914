//! Handles: which vertices are held, and where they are wanted.
//!
//! The *set* is fixed when a method is bound to a mesh, since the factorization depends on it; the *pose* comes with every
//! solve, so that a drag costs no factorization.

use nalgebra::{Point3, UnitQuaternion};

use super::SurfaceError;

/// How firmly a vertex is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hold {
    /// It is where the pose says.
    Exact,
    /// It is drawn there: `μ |x − target|²` is added to the energy. `μ` is dimensionless as the weights of edges are: 1
    /// holds a vertex as an edge of a regular mesh would.
    Soft(f64),
}

/// The set of vertices that are held.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Handles {
    vertices: Vec<u32>,
    holds: Vec<Hold>,
}

impl Handles {
    /// Holds each of these vertices as said, in any order; they are kept in ascending order.
    ///
    /// # Errors
    /// [`SurfaceError::HeldTwice`], [`SurfaceError::Weight`].
    pub fn new(held: impl IntoIterator<Item = (u32, Hold)>) -> Result<Self, SurfaceError> {
        let mut held: Vec<(u32, Hold)> = held.into_iter().collect();
        held.sort_by_key(|h| h.0);
        if let Some(twice) = held.windows(2).find(|h| h[0].0 == h[1].0) {
            return Err(SurfaceError::HeldTwice { vertex: twice[0].0 });
        }
        for &(vertex, hold) in &held {
            if let Hold::Soft(weight) = hold
                && !(weight > 0.0 && weight.is_finite())
            {
                return Err(SurfaceError::Weight { vertex, weight });
            }
        }
        let (vertices, holds) = held.into_iter().unzip();
        Ok(Self { vertices, holds })
    }

    /// Holds these vertices exactly.
    ///
    /// # Errors
    /// [`SurfaceError::HeldTwice`].
    pub fn exact(vertices: impl IntoIterator<Item = u32>) -> Result<Self, SurfaceError> {
        Self::new(vertices.into_iter().map(|v| (v, Hold::Exact)))
    }

    /// The vertices, ascending: the order of a pose.
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// How each is held.
    pub fn holds(&self) -> &[Hold] {
        &self.holds
    }

    /// Number of held vertices.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// True where nothing is held.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }
}

/// Where the held vertices are wanted, one entry per vertex of the [`Handles`], in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct HandlePose {
    positions: Vec<Point3<f64>>,
    rotations: Option<Vec<UnitQuaternion<f64>>>,
}

impl HandlePose {
    /// Wanted positions. How the surface is turned at the handles is fitted to them, each connected patch for itself.
    pub fn new(positions: Vec<Point3<f64>>) -> Self {
        Self { positions, rotations: None }
    }

    /// The same with the rotation of the surface at each held vertex (`posed_from_rest`), where it is known: a single
    /// vertex does not show its own. Linear methods spread them over the surface, others start from them.
    #[must_use]
    pub fn with_rotations(mut self, rotations: Vec<UnitQuaternion<f64>>) -> Self {
        self.rotations = Some(rotations);
        self
    }

    /// Wanted positions.
    pub fn positions(&self) -> &[Point3<f64>] {
        &self.positions
    }

    /// Rotations, where given.
    pub fn rotations(&self) -> Option<&[UnitQuaternion<f64>]> {
        self.rotations.as_deref()
    }

    /// Refuses a pose that does not fit the handles.
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
        let turns = self.rotations.iter().flatten().position(|q| !q.coords.iter().all(|c| c.is_finite()));
        match turns {
            Some(k) => Err(SurfaceError::NotFinite { what: "rotation", vertex: handles.vertices[k] }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handles_are_sorted_and_each_vertex_is_held_once() {
        let handles = Handles::new([(7, Hold::Soft(2.0)), (3, Hold::Exact)]).unwrap();
        assert_eq!((handles.vertices(), handles.holds()), (&[3, 7][..], &[Hold::Exact, Hold::Soft(2.0)][..]));
        assert_eq!(Handles::exact([4, 1, 4]), Err(SurfaceError::HeldTwice { vertex: 4 }));
        for weight in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(Handles::new([(1, Hold::Soft(weight))]), Err(SurfaceError::Weight { vertex: 1, .. })));
        }
    }

    #[test]
    fn a_pose_of_another_size_or_not_finite_is_refused() {
        let handles = Handles::exact([2, 5]).unwrap();
        let said = |pose: HandlePose| pose.check(&handles).unwrap_err().to_string();
        let two = vec![Point3::origin(); 2];
        assert_eq!(
            said(HandlePose::new(vec![Point3::origin()])),
            "1 positions do not pose 2 held vertices: give one for each"
        );
        assert_eq!(
            said(HandlePose::new(vec![Point3::origin(), Point3::new(0.0, f64::NAN, 0.0)])),
            "the target of vertex 5 is not finite"
        );
        let turns = vec![UnitQuaternion::identity(); 3];
        assert_eq!(
            said(HandlePose::new(two).with_rotations(turns)),
            "3 rotations do not pose 2 held vertices: give one for each"
        );
    }
}
