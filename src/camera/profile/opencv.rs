//! Calibrations written with OpenCV's storage (YAML, XML, JSON) and ROS camera files.
//!
//! The camera model is determined, in this order, by `distortion_model` (`plumb_bob`, `rational_polynomial`,
//! `equidistant`, `fisheye`, `standard`, `omnidir`), by `fisheye_model`, by `xi` (omnidirectional), by the number of
//! coefficients (only the standard camera has other than 4), and last by the names: `K` with `D` is how fisheye
//! calibrations are written, `camera_matrix` with `distortion_coefficients` standard ones. The last is noted, as it is
//! a guess.

use serde_json::Value;

use super::tree::At;
use super::{ExifFacts, Pinhole, Profile, ProfileError};
use crate::{BrownConrady, DistortedPlane, DistortionTerms, Projection};
use plumbline_num::math::{Point2, Vec2};

const MATRIX: &[&str] = &["camera_matrix", "K", "cameraMatrix", "Camera_Matrix", "intrinsic_matrix", "mtx"];
const COEFFICIENTS: &[&str] =
    &["distortion_coefficients", "D", "distCoeffs", "Distortion_Coefficients", "dist_coeffs", "dist", "coeffs"];
const WIDTH: &[&str] = &["image_width", "image_Width", "width", "img_width", "imageWidth"];
const HEIGHT: &[&str] = &["image_height", "image_Height", "height", "img_height", "imageHeight"];
const SIZE: &[&str] = &["image_size", "resolution", "dim", "imageSize", "img_shape"];
const KNOWN: &str = "plumb_bob, rational_polynomial, standard, equidistant, fisheye, omnidir";

pub(super) fn lens(tree: &Value, picture: &ExifFacts) -> Result<Profile, ProfileError> {
    let root = At::root(tree);
    let Some(matrix) = root.any(MATRIX) else { return Err(ProfileError::UnknownFormat) };
    let [fx, skew, cx, _, fy, cy, ..] = matrix.exactly::<9>()?;
    // Omnidirectional calibrations may fit a skew; up to this one it moves no pixel of the picture by a tenth.
    if !(skew.abs() <= 1e-4 * fx.abs()) {
        return Err(ProfileError::value(matrix.path(), skew, "a skew (second number) of 0"));
    }
    let mut notes = Vec::new();
    let size = size(&root, picture, &mut notes)?;
    let (projection, scale) = projection(&root, &matrix, &mut notes)?;
    let pinhole = Pinhole { focal: Vec2::new(fx, fy) / scale, center: Point2::new(cx, cy), size };
    let name = root.any(&["camera_name", "name"]).and_then(|n| n.text()).unwrap_or("").to_owned();
    let rms = root.any(&["avg_reprojection_error", "Avg_Reprojection_Error", "rms", "reprojection_error"]);
    let rms_px = rms.and_then(|e| e.number().ok()).filter(|e| *e >= 0.0);
    Ok(Profile { name, format: "OpenCV", lens: pinhole.lens(projection, 0.5)?, rms_px, notes })
}

fn size(root: &At<'_>, picture: &ExifFacts, notes: &mut Vec<String>) -> Result<(f64, f64), ProfileError> {
    if let (Some(w), Some(h)) = (root.any(WIDTH), root.any(HEIGHT)) {
        return Ok((w.number()?, h.number()?));
    }
    if let Some(at) = root.any(SIZE) {
        return at.exactly::<2>().map(|[w, h]| (w, h));
    }
    let expected = "the picture's width in px; and image_height";
    let size = picture.size.ok_or_else(|| ProfileError::Missing { key: "image_width".to_owned(), expected })?;
    notes.push(format!(
        "the file does not give the picture's size: {} × {} px, that of this picture, is used",
        size.0, size.1
    ));
    Ok(size)
}

/// The projection and the divisor of its focal lengths.
fn projection(root: &At<'_>, matrix: &At<'_>, notes: &mut Vec<String>) -> Result<(Projection, f64), ProfileError> {
    let coefficients = root.any(COEFFICIENTS);
    let numbers = coefficients.as_ref().map_or(Ok(Vec::new()), At::numbers)?;
    let path = coefficients.as_ref().map_or("distortion_coefficients", |c| c.path()).to_owned();
    let flag = |key: &str| root.get(key).and_then(|v| v.value.as_bool().or(v.number().ok().map(|n| n != 0.0)));
    let model = root.any(&["distortion_model", "model", "camera_model"]).and_then(|m| m.text()).unwrap_or("");
    let model = if matches!(model, "" | "pinhole") && root.get("xi").is_some() { "omnidir" } else { model };
    let kind = match model.to_lowercase().as_str() {
        "plumb_bob" | "rational_polynomial" | "standard" | "opencv" | "radtan" => Kind::Standard,
        "equidistant" | "fisheye" | "opencv_fisheye" => Kind::Fisheye,
        "omnidir" | "omni" | "mei" => Kind::Omni,
        "" | "pinhole" => match (flag("fisheye_model").or(flag("fisheye")), numbers.len()) {
            (Some(true), _) => Kind::Fisheye,
            (None, 4) => guess(matrix.path() == "K" && path == "D", notes),
            _ => Kind::Standard,
        },
        _ => return Err(ProfileError::Model { format: "OpenCV", model: model.to_owned(), known: KNOWN }),
    };
    match kind {
        Kind::Standard => Ok((standard(&numbers, &path)?, 1.0)),
        Kind::Fisheye => {
            let k = coefficients.map_or(Ok([0.0; 4]), |c| c.at_most())?;
            Ok((Projection::kannala_brandt(k), 1.0))
        }
        Kind::Omni => {
            let [xi] = root.need("xi", "the mirror parameter")?.exactly()?;
            let [k1, k2, p1, p2] = coefficients.map_or(Ok([0.0; 4]), |c| c.at_most())?;
            let terms = DistortionTerms { radial: [k1, k2, 0.0, 0.0], tangential: [p1, p2], ..Default::default() };
            let model = BrownConrady::new(DistortedPlane::Sphere(xi), terms)?;
            Ok((Projection::BrownConrady(model), 1.0 + xi))
        }
    }
}

enum Kind {
    Standard,
    Fisheye,
    Omni,
}

fn guess(fisheye: bool, notes: &mut Vec<String>) -> Kind {
    let (names, kind) = if fisheye { ("K and D", "fisheye") } else { ("its keys", "standard") };
    notes.push(format!(
        "four coefficients fit OpenCV's fisheye and its standard camera: taken as {kind} because of the names {names}; \
         `distortion_model: fisheye` or `standard` in the file would settle it"
    ));
    if fisheye { Kind::Fisheye } else { Kind::Standard }
}

/// OpenCV's standard camera: `k₁ k₂ p₁ p₂ [k₃ [k₄ k₅ k₆ [s₁ s₂ s₃ s₄ [τ_x τ_y]]]]`.
pub(super) fn standard(d: &[f64], path: &str) -> Result<Projection, ProfileError> {
    if ![0, 2, 4, 5, 8, 12, 14].contains(&d.len()) {
        let value = format!("a list of {} numbers", d.len());
        return Err(ProfileError::value(path, value, "4, 5, 8, 12 or 14 coefficients"));
    }
    let at = |i: usize| d.get(i).copied().unwrap_or(0.0);
    if at(12) != 0.0 || at(13) != 0.0 {
        return Err(ProfileError::value(path, format!("tilt {} {}", at(12), at(13)), "a sensor that is not tilted"));
    }
    let terms = DistortionTerms {
        radial: [at(0), at(1), at(4), 0.0],
        rational: [at(5), at(6), at(7)],
        tangential: [at(2), at(3)],
        thin_prism: [at(8), at(9), at(10), at(11)],
    };
    if terms == DistortionTerms::default() {
        return Ok(Projection::Rectilinear);
    }
    Ok(Projection::BrownConrady(BrownConrady::new(DistortedPlane::Tangent, terms)?))
}
