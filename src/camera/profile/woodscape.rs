//! WoodScape calibration JSON: an angle polynomial in pixels.
//!
//! ```text
//! ρ = k₁ θ + k₂ θ² + k₃ θ³ + k₄ θ⁴,     u = ρ cos φ + W/2 + c_x − ½,   v = a ρ sin φ + H/2 + c_y − ½
//! ```
//!
//! with pixel centers at integers: in ours the ½ falls away.

use super::tree::At;
use super::{Pinhole, Profile, ProfileError};
use crate::{AnglePolynomial, Projection};
use plumbline_num::math::{Point2, Vec2};

pub(super) fn lens(root: &At<'_>) -> Result<Profile, ProfileError> {
    let at = root.get("intrinsic").unwrap_or_else(|| root.clone());
    if let Some(model) = at.get("model").and_then(|m| m.text()).filter(|m| *m != "radial_poly") {
        return Err(ProfileError::Model { format: "WoodScape", model: model.to_owned(), known: "radial_poly" });
    }
    let k = [at.need_number("k1")?, at.number_or("k2", 0.0)?, at.number_or("k3", 0.0)?, at.number_or("k4", 0.0)?];
    if !(k[0] > 0.0) {
        return Err(ProfileError::value("k1", k[0], "px per radian above 0"));
    }
    let size = (at.need_number("width")?, at.need_number("height")?);
    let offset = Vec2::new(at.number_or("cx_offset", 0.0)?, at.number_or("cy_offset", 0.0)?);
    let pinhole = Pinhole {
        focal: Vec2::new(k[0], k[0] * at.number_or("aspect_ratio", 1.0)?),
        center: Point2::new(0.5 * size.0, 0.5 * size.1) + offset,
        size,
    };
    let projection = Projection::AnglePolynomial(AnglePolynomial::new([k[1] / k[0], k[2] / k[0], k[3] / k[0]]));
    let name = root.get("name").and_then(|n| n.text()).unwrap_or("").to_owned();
    Ok(Profile { name, format: "WoodScape", lens: pinhole.lens(projection, 0.0)?, rms_px: None, notes: Vec::new() })
}
