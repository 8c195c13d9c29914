//! A backward warp: where in the source each point of the output comes from.
//!
//! Solvers produce forward maps `out_from_src`; sampling needs `src_from_out`. A [`WarpField`] is a chain
//!
//! ```text
//! src_from_out = mₙ ∘ … ∘ m₂ ∘ m₁
//! ```
//!
//! of backward maps, `m₁` applied first to a point of the output. It is composed as geometry and sampled once: pixels
//! are never resampled twice, however many maps stand in the chain.

use nalgebra::{Matrix2, Matrix2x3};

use super::{InverseMesh, WarpError};
use crate::grid::GridMesh;
use plumbline_num::math::{Homography, Point2, PointMap};

/// One backward map of a chain.
pub enum Map {
    /// `p ↦ A p + t`, the matrix `[A | t]`.
    Affine(Matrix2x3<f64>),
    /// A projective map.
    Homography(Homography),
    /// A forward grid mesh, inverted.
    Mesh(InverseMesh),
    /// A lens model, or any other map of the plane.
    Radial(Box<dyn PointMap>),
}

impl Map {
    fn apply(&self, p: Point2, hint: &mut usize) -> Option<Point2> {
        match self {
            Self::Affine(m) => Some(Point2::from(m * p.to_homogeneous())),
            Self::Homography(h) => h.apply(p),
            Self::Mesh(mesh) => mesh.map_from(p, hint),
            Self::Radial(map) => map.map(p),
        }
    }

    fn jacobian(&self, p: Point2) -> Option<Matrix2<f64>> {
        match self {
            Self::Affine(m) => Some(m.fixed_columns::<2>(0).into_owned()),
            Self::Homography(h) => h.jacobian(p),
            Self::Mesh(mesh) => mesh.jacobian(p),
            Self::Radial(map) => map.jacobian(p),
        }
    }
}

impl std::fmt::Debug for Map {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Affine(m) => f.debug_tuple("Affine").field(m).finish(),
            Self::Homography(h) => f.debug_tuple("Homography").field(h).finish(),
            Self::Mesh(_) => f.write_str("Mesh(..)"),
            Self::Radial(_) => f.write_str("Radial(..)"),
        }
    }
}

/// A chain of backward maps, `src_from_out`; empty: the identity.
#[derive(Debug, Default)]
pub struct WarpField {
    /// The maps, the one applied first to a point of the output first.
    pub chain: Vec<Map>,
}

impl WarpField {
    /// The field under which every frame stays as it is.
    pub fn identity() -> Self {
        Self::default()
    }

    /// The field of a planar forward map.
    ///
    /// # Errors
    /// [`WarpError::Input`] where the map has no finite inverse.
    pub fn from_forward_homography(out_from_src: &Homography) -> Result<Self, WarpError> {
        let singular = || {
            let text = "the homography has no inverse or is not finite; a forward map must be regular to be rendered";
            WarpError::Input(text.to_owned())
        };
        let inverse = out_from_src.inverse().filter(Homography::is_finite).ok_or_else(singular)?;
        Ok(Self { chain: vec![Map::Homography(inverse)] })
    }

    /// The field of a forward mesh over a source of `width × height` px.
    ///
    /// # Errors
    /// See [`InverseMesh::new`].
    pub fn from_forward_mesh(mesh: &GridMesh, width: f64, height: f64) -> Result<Self, WarpError> {
        Ok(Self { chain: vec![Map::Mesh(InverseMesh::new(mesh, width, height)?)] })
    }

    /// Appends a map that acts on the result of the chain so far, that is, nearer to the source.
    #[must_use]
    pub fn then(mut self, map: Map) -> Self {
        self.chain.push(map);
        self
    }

    /// Bound on the error, source px, of the field interpolated bilinearly on a lattice of step `h` output px, where one
    /// is known without sampling: for a mesh alone.
    pub(super) fn interpolation_error(&self, h: f64) -> Option<f64> {
        match self.chain.as_slice() {
            [Map::Mesh(mesh)] => Some(mesh.interpolation_error(h)),
            _ => None,
        }
    }

    /// Source position of the output point `p`, and in `hints` where each map found it: neighboring points start
    /// their search there. `hints` has one entry per map.
    pub(super) fn map_from(&self, p: Point2, hints: &mut [usize]) -> Option<Point2> {
        debug_assert_eq!(hints.len(), self.chain.len());
        self.chain.iter().zip(hints).try_fold(p, |p, (map, hint)| map.apply(p, hint))
    }
}

impl PointMap for WarpField {
    fn map(&self, p: Point2) -> Option<Point2> {
        self.chain.iter().try_fold(p, |p, map| map.apply(p, &mut usize::MAX.clone()))
    }

    fn jacobian(&self, p: Point2) -> Option<Matrix2<f64>> {
        let step = |(p, j), map: &Map| Some((map.apply(p, &mut usize::MAX.clone())?, map.jacobian(p)? * j));
        self.chain.iter().try_fold((p, Matrix2::identity()), step).map(|(_, j)| j)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use plumbline_num::math::{Similarity2, Vec2};

    fn turn() -> Similarity2 {
        Similarity2::about(Point2::new(320.0, 180.0), 0.05, 1.1, Vec2::new(4.0, -3.0))
    }

    #[test]
    fn the_first_map_of_a_chain_acts_first() {
        let (scale, shift) =
            (Matrix2x3::new(2.0, 0.0, 0.0, 0.0, 2.0, 0.0), Matrix2x3::new(1.0, 0.0, 5.0, 0.0, 1.0, 7.0));
        let field = WarpField::identity().then(Map::Affine(scale)).then(Map::Affine(shift));
        assert_eq!(field.map(Point2::new(10.0, 20.0)), Some(Point2::new(25.0, 47.0)));
    }

    #[test]
    fn a_forward_homography_is_inverted() {
        let forward = turn().to_homography();
        let field = WarpField::from_forward_homography(&forward).expect("regular");
        let p = Point2::new(77.0, 200.0);
        let back = field.map(forward.apply(p).expect("affine")).expect("affine");
        assert!((back - p).norm() < 1e-10);
        let singular = Homography::new(Matrix3::zeros());
        let error = WarpField::from_forward_homography(&singular).expect_err("no inverse");
        assert!(error.to_string().starts_with("the homography has no inverse"), "{error}");
    }

    #[test]
    fn the_jacobian_of_a_chain_equals_central_differences() {
        let h = Homography::new(Matrix3::new(1.1, 0.02, 5.0, -0.03, 0.95, -8.0, 1e-4, -2e-4, 1.0));
        let field = WarpField::identity()
            .then(Map::Homography(turn().to_homography()))
            .then(Map::Radial(Box::new(h)))
            .then(Map::Affine(Matrix2x3::new(0.9, 0.1, 5.0, -0.2, 1.2, 7.0)));
        let (p, e) = (Point2::new(250.0, 120.0), 1e-4);
        let j = field.jacobian(p).expect("in front");
        for (k, d) in [Vec2::new(e, 0.0), Vec2::new(0.0, e)].into_iter().enumerate() {
            let numeric = (field.map(p + d).expect("in front") - field.map(p - d).expect("in front")) / (2.0 * e);
            assert!((j.column(k) - numeric).norm() < 1e-7, "column {k}");
        }
    }
}
