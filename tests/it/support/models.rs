//! Models that tests of several areas read and compare.

use std::path::Path;

use nalgebra::Point3;
use plumbline::num::run::Run;
use plumbline::shape::mesh::{Model, ReadLimits, read_model};

/// Path of the humanoid of `media/`.
pub(crate) fn humanoid() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("media/humanoid.glb").display().to_string()
}

/// The model of a file.
pub(crate) fn model(path: &Path) -> Model {
    read_model(path, &ReadLimits::default(), &Run::default()).expect("a mesh file")
}

/// The greatest distance of points of the same index.
pub(crate) fn far_apart(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(p, q)| nalgebra::distance(p, q)).fold(0.0, f64::max)
}
