//! Cameras: poses, intrinsics, lens models and profiles.
//!
//! Axes of a camera: +x right, +y down, +z forward. A pose is `cam_from_world`; pixels are as everywhere in this library,
//! centers at integer + 0.5.

mod alignment;
mod exif_lens;
mod intrinsics;
mod lens;
mod pose;
mod profile;
pub mod rotation;

pub use alignment::{Similarity3, align};
pub use exif_lens::{ExifFacts, ExifLens, ExifLensError};
pub use intrinsics::Intrinsics;
pub use lens::{
    AnglePolynomial, BrownConrady, DistortedPlane, DistortionTerms, FieldAxis, FieldOfView, KannalaBrandt, Lens,
    LensError, Ocam, Projection, RadialPolynomial, Unified,
};
pub use pose::CameraPose;
#[cfg(feature = "schema")]
pub use profile::lens_file_schema;
pub use profile::{LensFile, LensFileError, Profile, ProfileError, lensfun_lens, parse_lens, read_lens};

/// A position in space, in the unit of the scene.
pub type Point3 = nalgebra::Point3<f64>;
/// A displacement or a direction in space.
pub type Vec3 = nalgebra::Vector3<f64>;
