//! COLMAP models: cameras, images and points of one reconstruction, as text or binary.
//!
//! A model is three files in one folder, `cameras`, `images` and `points3D`, each as `.txt` or `.bin`. Its conventions are
//! ours: `x_in_camera = R x + t` with `q = [w, x, y, z]`, +x right, +y down, +z forward, pixel centers at integer + 0.5. An image
//! lists its observations; a point lists its track, the images that observe it and the indices of these observations.
//!
//! We write the camera model `SIMPLE_RADIAL` (`f, cx, cy, k`), which is [`Intrinsics`] itself, and read those models that are
//! special cases of it. Images are named `frame_000012.png` after the frame of the clip, counted from 0.
//!
//! # Reference
//! J. L. Schönberger, J.-M. Frahm, *Structure-from-motion revisited*, CVPR 2016; the format is that of COLMAP's documentation,
//! page *Output format*.

mod binary;
mod build;
mod clip;
mod text;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use plumbline_camera::{CameraPose, Intrinsics, Point3};
use plumbline_num::document::read_bounded;
use plumbline_num::math::Point2;

pub use build::models_of;
pub use clip::{ImportedClip, ImportedShot};

/// Largest file of a model, bytes: half a million images of a hundred observations each.
const MAX_BYTES: u64 = 1 << 30;

/// A reconstruction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Cameras, each of which may have taken any number of images.
    pub cameras: Vec<Camera>,
    /// Images.
    pub images: Vec<Image>,
    /// Points in space.
    pub points: Vec<Point>,
}

/// A camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Identity in the model.
    pub id: u32,
    /// Width of its pictures, px.
    pub width: u64,
    /// Height of its pictures, px.
    pub height: u64,
    /// Its lens.
    pub intrinsics: Intrinsics,
}

/// An image.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Identity in the model.
    pub id: u32,
    /// Identity of its camera.
    pub camera: u32,
    /// Name of its file.
    pub name: String,
    /// `cam_from_world`.
    pub pose: CameraPose,
    /// Its observations.
    pub observations: Vec<ImageObservation>,
}

/// An observed point of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageObservation {
    /// Position, px.
    pub at: Point2,
    /// Identity of the point in space; `None` where it is unknown.
    pub point: Option<u64>,
}

/// A point in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Identity in the model.
    pub id: u64,
    /// Where it is.
    pub position: Point3,
    /// Mean distance of its observations from where the images should see it, px; below 0 where unknown.
    pub error_px: f64,
    /// Its observations: identity of the image, index into [`Image::observations`].
    pub track: Vec<(u32, u32)>,
}

/// Errors of reading a model.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ColmapError {
    /// A file is missing or cannot be read.
    #[error("{file}: {source}")]
    Io {
        /// The file.
        file: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// The folder has no model.
    #[error("{folder} has no COLMAP model (expected cameras, images and points3D, each as .bin or .txt)")]
    NoModel {
        /// The folder.
        folder: PathBuf,
    },
    /// An invalid value, or a camera model that is not supported.
    #[error("{file}, {location}: {found} (expected {expected})")]
    Value {
        /// Name of the file.
        file: &'static str,
        /// Location in it: `line 12`, or the entry of a binary file.
        location: String,
        /// Value found.
        found: String,
        /// Allowed values.
        expected: &'static str,
    },
    /// The model does not fit the clip.
    #[error("{0}")]
    Misfit(String),
}

/// Writes one of the files of a model.
pub type FileWriter = fn(&Model, &mut dyn Write) -> io::Result<()>;

/// The files of a model, text and binary, with what writes them.
pub const FILES: [(&str, FileWriter); 6] = [
    ("cameras.bin", binary::write_cameras),
    ("images.bin", binary::write_images),
    ("points3D.bin", binary::write_points),
    ("cameras.txt", text::write_cameras),
    ("images.txt", text::write_images),
    ("points3D.txt", text::write_points),
];

impl Model {
    /// Reads the model in `folder`: its binary files, or its text where one of those is missing.
    ///
    /// # Errors
    /// [`ColmapError`]: a file that is missing, truncated or has invalid values; an unsupported camera model; identities that do
    /// not exist.
    pub fn read(folder: &Path) -> Result<Self, ColmapError> {
        let has = |extension: &str| {
            ["cameras", "images", "points3D"].iter().all(|n| folder.join(format!("{n}.{extension}")).exists())
        };
        let bytes = |name: &str| {
            let file = folder.join(name);
            read_bounded(&file, MAX_BYTES).map_err(|source| ColmapError::Io { file, source })
        };
        if has("bin") {
            let files = [bytes("cameras.bin")?, bytes("images.bin")?, bytes("points3D.bin")?];
            Self::from_binary(files.each_ref().map(Vec::as_slice))
        } else if has("txt") {
            let files = [bytes("cameras.txt")?, bytes("images.txt")?, bytes("points3D.txt")?];
            Self::from_text(files.each_ref().map(Vec::as_slice))
        } else {
            Err(ColmapError::NoModel { folder: folder.to_owned() })
        }
    }

    /// The model of the contents of `cameras.bin`, `images.bin` and `points3D.bin`.
    ///
    /// # Errors
    /// As for [`Self::read`].
    pub fn from_binary([cameras, images, points]: [&[u8]; 3]) -> Result<Self, ColmapError> {
        let (cameras, images) = (binary::read_cameras(cameras)?, binary::read_images(images)?);
        Self { cameras, images, points: binary::read_points(points)? }.checked()
    }

    /// The model of the contents of `cameras.txt`, `images.txt` and `points3D.txt`.
    ///
    /// # Errors
    /// As for [`Self::read`].
    pub fn from_text([cameras, images, points]: [&[u8]; 3]) -> Result<Self, ColmapError> {
        let (cameras, images) = (text::read_cameras(cameras)?, text::read_images(images)?);
        Self { cameras, images, points: text::read_points(points)? }.checked()
    }

    /// Refuses identities that do not exist. Tracks are read from the images alone; those of the points are not checked.
    fn checked(self) -> Result<Self, ColmapError> {
        let cameras: std::collections::HashSet<u32> = self.cameras.iter().map(|c| c.id).collect();
        let points: std::collections::HashSet<u64> = self.points.iter().map(|p| p.id).collect();
        for image in &self.images {
            let misfit = |found: String, expected| ColmapError::Value {
                file: "images",
                location: format!("image {:?}", image.name),
                found,
                expected,
            };
            if !cameras.contains(&image.camera) {
                return Err(misfit(format!("camera {}", image.camera), "a camera of the model"));
            }
            if let Some(id) = image.observations.iter().filter_map(|s| s.point).find(|id| !points.contains(id)) {
                return Err(misfit(format!("point {id}"), "a point of the model, or -1"));
            }
        }
        Ok(self)
    }
}

/// Greatest deviation of the norm of a quaternion from 1: files with four digits pass.
const QUATERNION_TOLERANCE: f64 = 1e-3;
/// The same for a quaternion that is taken as it is, so that one that was written comes back bit for bit: the rounding of a thousand
/// products.
const ROUNDING: f64 = 1e-12;

/// The rotation of `[w, x, y, z]`; `None` for another norm than 1.
pub(crate) fn rotation_of([w, x, y, z]: [f64; 4]) -> Option<nalgebra::UnitQuaternion<f64>> {
    let q = nalgebra::Quaternion::new(w, x, y, z);
    if (q.norm_squared() - 1.0).abs() <= ROUNDING {
        return Some(nalgebra::UnitQuaternion::new_unchecked(q));
    }
    ((q.norm() - 1.0).abs() <= QUATERNION_TOLERANCE).then(|| nalgebra::UnitQuaternion::new_normalize(q))
}

/// Parameters of the lenses that can be read: COLMAP's number, name, number of parameters.
const LENSES: [(u32, &str, usize); 4] =
    [(0, "SIMPLE_PINHOLE", 3), (1, "PINHOLE", 4), (2, "SIMPLE_RADIAL", 4), (3, "RADIAL", 5)];
/// What [`lens`] expects.
const EXPECTED_LENS: &str = "SIMPLE_PINHOLE, PINHOLE with fx = fy, SIMPLE_RADIAL, or RADIAL with k2 = 0; undistort the model, or \
                             solve it again with SIMPLE_RADIAL";
/// The one written.
const SIMPLE_RADIAL: (u32, &str) = (2, "SIMPLE_RADIAL");

/// The intrinsics of a camera model with these parameters, in the number of [`LENSES`]; `None` where it is not supported.
fn lens(model: &str, p: &[f64]) -> Option<Intrinsics> {
    let (focal, center, k1) = match (model, p) {
        ("SIMPLE_PINHOLE", &[f, x, y]) => (f, (x, y), 0.0),
        ("PINHOLE", &[fx, fy, x, y]) if (fx - fy).abs() <= 1e-3 * fx => (0.5 * (fx + fy), (x, y), 0.0),
        ("SIMPLE_RADIAL", &[f, x, y, k]) | ("RADIAL", &[f, x, y, k, 0.0]) => (f, (x, y), k),
        _ => return None,
    };
    let finite = focal.is_finite() && center.0.is_finite() && center.1.is_finite() && k1.is_finite();
    (focal > 0.0 && finite).then(|| Intrinsics { focal, center: Point2::new(center.0, center.1), k1 })
}

#[cfg(test)]
mod tests;
