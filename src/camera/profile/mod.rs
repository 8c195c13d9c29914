//! Lenses from files: our own, and those of other programs.
//!
//! The format is found from the content, never from the name. All files are converted to pixel centers at integer + 0.5 and
//! to focal lengths with slope 1 on the axis, as [`Lens`] has them.
//!
//! | format | centers in the file | note |
//! | --- | --- | --- |
//! | lens JSON (ours) | as `pixel_center` says: 0.5 unless given | documented at [`LensFile`] |
//! | the same without `version` | 0 | what calibration scripts around OpenCV write |
//! | OpenCV, ROS | 0 | fisheye or standard told by a key, else by the names: see `opencv.rs` |
//! | Kalibr camchain and single-camera YAML | 0 | |
//! | Gyroflow | the middle of the picture, unless `asymmetrical` | |
//! | COLMAP cameras.txt | 0.5 | |
//! | OCamCalib | 0, rows first | |
//! | WoodScape | offset from the middle | |
//! | lensfun | the middle, or `<center>` | needs to know the camera and lens |

mod colmap;
mod detect;
mod error;
mod gyroflow;
mod json;
mod kalibr;
mod lensfun;
mod names;
mod ocam;
mod opencv;
#[cfg(test)]
mod tests;
mod tree;
mod woodscape;
mod xml;
mod yaml;

use std::path::Path;

pub use detect::parse_lens;
pub use error::{LensFileError, ProfileError};
pub use json::LensFile;
#[cfg(feature = "schema")]
pub use json::lens_file_schema;
pub use lensfun::lensfun_lens;

use super::{ExifFacts, Lens};
use plumbline_num::document::read_text;
use plumbline_num::math::{Point2, Vec2};

/// Maximum file size, bytes: the largest lens files, those of databases, have 0.4 MB.
const MAX_BYTES: u64 = 8 << 20;
/// Maximum nesting of a file; lens files have three levels.
const MAX_NESTING: usize = 32;

/// A lens and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// What the file calls the lens or the camera; empty where it has no name.
    pub name: String,
    /// Name of the file format.
    pub format: &'static str,
    /// The lens, for the picture size of the file.
    pub lens: Lens,
    /// Error of the calibration, px, if the file has it.
    pub rms_px: Option<f64>,
    /// What was assumed where the file does not say.
    pub notes: Vec<String>,
}

/// The lens that a file describes. What is known of the picture chooses among the cameras of a file, and fills in the size where the file has
/// none; the lens returned is for the size in the file ([`Lens::resized`] makes it fit).
///
/// # Errors
/// [`LensFileError`] with the cause and its position.
pub fn read_lens(path: &Path, picture: &ExifFacts) -> Result<Profile, LensFileError> {
    let read = || {
        if path.is_dir() {
            return lensfun_lens(Some(path), picture);
        }
        parse_lens(&read_text(path, MAX_BYTES)?, picture)
    };
    read().map_err(|fault| LensFileError { path: path.to_owned(), fault })
}

/// A pinhole part as files give it.
struct Pinhole {
    focal: Vec2,
    /// In the pixel convention of the file.
    center: Point2,
    size: (f64, f64),
}

impl Pinhole {
    /// The lens with this pinhole part; `center_offset` leads from the file's pixel convention to ours.
    fn lens(&self, projection: super::Projection, center_offset: f64) -> Result<Lens, ProfileError> {
        let positive = |key: &str, value: f64, expected: &str| {
            if value > 0.0 && value.is_finite() { Ok(()) } else { Err(ProfileError::value(key, value, expected)) }
        };
        positive("the picture's width", self.size.0, "px above 0")?;
        positive("the picture's height", self.size.1, "px above 0")?;
        positive("the focal length along x", self.focal.x, "px above 0")?;
        positive("the focal length along y", self.focal.y, "px above 0")?;
        let center = self.center + Vec2::new(center_offset, center_offset);
        let inside = |key: &str, c: f64, side: f64| {
            let expected = "a center within one picture size of the picture";
            if c > -side && c < 2.0 * side { Ok(()) } else { Err(ProfileError::value(key, c, expected)) }
        };
        inside("the center's x", center.x, self.size.0)?;
        inside("the center's y", center.y, self.size.1)?;
        let lens = Lens { projection, focal: self.focal, center, size: self.size };
        if !(lens.max_angle() > 0.0) {
            let expected = "parameters under which the radius grows with the angle";
            return Err(ProfileError::value("the projection", lens.projection.name(), expected));
        }
        Ok(lens)
    }
}
