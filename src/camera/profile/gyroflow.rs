//! Gyroflow lens profiles: JSON with an OpenCV calibration.
//!
//! The profile's center is used only where `asymmetrical` is set; else, as in that program, the middle of the picture.

use super::opencv::standard;
use super::tree::At;
use super::{Pinhole, Profile, ProfileError};
use crate::Projection;
use plumbline_num::math::{Point2, Vec2};

const KNOWN: &str = "opencv_fisheye, opencv_standard";

pub(super) fn lens(root: &At<'_>) -> Result<Profile, ProfileError> {
    let text = |key: &str| root.get(key).and_then(|v| v.text()).unwrap_or("");
    let flag = |key: &str| root.get(key).is_some_and(|v| v.value.as_bool() == Some(true));
    if !text("digital_lens").is_empty() {
        let expected = "a lens without digital correction in the camera: switch it off, or choose another profile";
        return Err(ProfileError::value("digital_lens", text("digital_lens"), expected));
    }
    for key in ["input_horizontal_stretch", "input_vertical_stretch"] {
        let stretch = root.number_or(key, 1.0)?;
        if stretch != 1.0 && stretch != 0.0 {
            return Err(ProfileError::value(key, stretch, "1: stretched (anamorphic) pictures are not read"));
        }
    }
    let old_standard = flag("use_opencv_standard") && !flag("use_opencv_fisheye");
    let at = match root.get("fisheye_params") {
        Some(at) if !old_standard => at,
        _ => root.need("calib_params", "the calibration")?,
    };
    let [fx, _, cx, _, fy, cy, ..] = at.need("camera_matrix", "a matrix of 3 × 3 numbers")?.exactly::<9>()?;
    let size = root.need("calib_dimension", "the picture's size, `w` and `h`")?;
    let size = (size.need_number("w")?, size.need_number("h")?);
    let coefficients = at.need("distortion_coeffs", "a list of numbers")?;
    let model = match text("distortion_model") {
        "" if old_standard => "opencv_standard",
        "" => "opencv_fisheye",
        model => model,
    };
    let projection = match model {
        "opencv_fisheye" => Projection::kannala_brandt(coefficients.at_most()?),
        "opencv_standard" => standard(&coefficients.numbers()?, coefficients.path())?,
        other => return Err(ProfileError::Model { format: "Gyroflow", model: other.to_owned(), known: KNOWN }),
    };
    let (center, offset) =
        if flag("asymmetrical") { (Point2::new(cx, cy), 0.5) } else { (Point2::new(0.5 * size.0, 0.5 * size.1), 0.0) };
    let pinhole = Pinhole { focal: Vec2::new(fx, fy), center, size };
    Ok(Profile {
        name: text("name").to_owned(),
        format: "Gyroflow",
        lens: pinhole.lens(projection, offset)?,
        rms_px: at.get("RMS_error").and_then(|e| e.number().ok()).filter(|e| *e > 0.0),
        notes: Vec::new(),
    })
}
