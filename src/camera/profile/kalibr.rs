//! Kalibr's camera chains, and single cameras in the same notation by parameter names.
//!
//! | camera | intrinsics | distortion |
//! | --- | --- | --- |
//! | `pinhole` | `fu fv pu pv` | `radtan` (k1 k2 p1 p2), `equidistant`, `fov`, `none` |
//! | `omni` | `xi fu fv pu pv` | `radtan`, `none` |
//! | `eucm` | `alpha beta fu fv pu pv` | `none` |
//! | `ds` | `xi alpha fu fv pu pv` | `none` |
//!
//! The form with an `image` and a `parameter` mapping names its numbers; their presence determines the model: `alpha`
//! (unified), `alpha beta` (extended), `alpha xi` (double sphere), `k1 … k4` (Kannala–Brandt), `k1 k2 p1 p2 [k3]`
//! (standard).

use super::opencv::standard;
use super::tree::At;
use super::{ExifFacts, Pinhole, Profile, ProfileError};
use crate::{BrownConrady, DistortedPlane, DistortionTerms, Projection, Unified};
use plumbline_num::math::{Point2, Vec2};

const FORMAT: &str = "Kalibr";

/// The cameras of a chain.
pub(super) fn cameras<'a>(root: &At<'a>) -> impl Iterator<Item = (&'a str, At<'a>)> {
    let is_camera = |(_, at): &(&str, At<'_>)| at.get("camera_model").is_some() && at.get("intrinsics").is_some();
    root.entries().into_iter().filter(is_camera)
}

pub(super) fn lens(root: &At<'_>, picture: &ExifFacts) -> Result<Profile, ProfileError> {
    if let Some(parameters) = root.get("parameter") {
        return named(root, &parameters);
    }
    let found = cameras(root).map(|(name, at)| Ok((name, of_chain(name, &at)?)));
    let found: Vec<(&str, Profile)> = found.collect::<Result<_, ProfileError>>()?;
    the_one(found, picture)
}

/// The only camera, or the only one whose size is the picture's.
pub(super) fn the_one(mut found: Vec<(&str, Profile)>, picture: &ExifFacts) -> Result<Profile, ProfileError> {
    if found.len() > 1 {
        let names = found.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
        let same = |p: &Profile| picture.size == Some(p.lens.size);
        found.retain(|(_, profile)| same(profile));
        if found.len() != 1 {
            return Err(ProfileError::Several { names });
        }
    }
    found.pop().map(|(_, profile)| profile).ok_or(ProfileError::UnknownFormat)
}

fn of_chain(name: &str, at: &At<'_>) -> Result<Profile, ProfileError> {
    let text = |key: &str| at.get(key).and_then(|v| v.text()).unwrap_or("none").to_owned();
    let (camera, distortion) = (text("camera_model"), text("distortion_model"));
    let intrinsics = at.need("intrinsics", "a list of numbers")?;
    let coefficients = || at.get("distortion_coeffs").map_or(Ok([0.0; 4]), |c| c.at_most::<4>());
    let refused = || {
        let model = format!("{camera}-{distortion}");
        let known = "pinhole-radtan, pinhole-equidistant, pinhole-fov, omni-radtan, eucm-none, ds-none";
        Err(ProfileError::Model { format: FORMAT, model, known })
    };
    let radtan = |plane| -> Result<Projection, ProfileError> {
        let [k1, k2, p1, p2] = coefficients()?;
        let terms = DistortionTerms { radial: [k1, k2, 0.0, 0.0], tangential: [p1, p2], ..Default::default() };
        Ok(Projection::BrownConrady(BrownConrady::new(plane, terms)?))
    };
    let (projection, scale, pinhole) = match (camera.as_str(), distortion.as_str()) {
        ("pinhole", distortion) => {
            let projection = match distortion {
                "none" => Projection::Rectilinear,
                "radtan" => radtan(DistortedPlane::Tangent)?,
                "equidistant" | "equi" => Projection::kannala_brandt(coefficients()?),
                "fov" => {
                    let t = 2.0 * (0.5 * coefficients()?[0]).tan();
                    return finished(name, at, Projection::FieldOfView(t), fov_scale(t), intrinsics.exactly()?);
                }
                _ => return refused(),
            };
            (projection, 1.0, intrinsics.exactly::<4>()?)
        }
        ("omni", "radtan" | "none") => {
            let [xi, fu, fv, pu, pv] = intrinsics.exactly()?;
            (radtan(DistortedPlane::Sphere(xi))?, 1.0 / (1.0 + xi), [fu, fv, pu, pv])
        }
        ("eucm", "none") => {
            let [alpha, beta, fu, fv, pu, pv] = intrinsics.exactly()?;
            (Projection::Unified(Unified::extended(alpha, beta)?), 1.0, [fu, fv, pu, pv])
        }
        ("ds", "none") => {
            let [xi, alpha, fu, fv, pu, pv] = intrinsics.exactly()?;
            (Projection::Unified(Unified::double_sphere(xi, alpha)?), 1.0 / (1.0 + xi), [fu, fv, pu, pv])
        }
        _ => return refused(),
    };
    finished(name, at, projection, scale, pinhole)
}

/// The factor on focal lengths that gives the field-of-view model slope 1: `t/ω`.
pub(super) fn fov_scale(t: f64) -> f64 {
    t / (2.0 * (0.5 * t).atan())
}

fn finished(
    name: &str,
    at: &At<'_>,
    projection: Projection,
    scale: f64,
    [fu, fv, pu, pv]: [f64; 4],
) -> Result<Profile, ProfileError> {
    let [w, h] = at.need("resolution", "[width, height] in px")?.exactly()?;
    let pinhole = Pinhole { focal: scale * Vec2::new(fu, fv), center: Point2::new(pu, pv), size: (w, h) };
    let lens = pinhole.lens(projection, 0.5)?;
    Ok(Profile { name: name.to_owned(), format: FORMAT, lens, rms_px: None, notes: Vec::new() })
}

fn named(root: &At<'_>, at: &At<'_>) -> Result<Profile, ProfileError> {
    let image = root.need("image", "a mapping with `width` and `height`")?;
    let has = |key: &str| at.get(key).is_some();
    let number = |key: &str| at.number_or(key, 0.0);
    let (projection, scale) = if has("alpha") && has("xi") {
        let xi = number("xi")?;
        (Projection::Unified(Unified::double_sphere(xi, number("alpha")?)?), 1.0 / (1.0 + xi))
    } else if has("alpha") {
        (Projection::Unified(Unified::extended(number("alpha")?, at.number_or("beta", 1.0)?)?), 1.0)
    } else if has("p1") || has("p2") {
        let d = [number("k1")?, number("k2")?, number("p1")?, number("p2")?, number("k3")?];
        (standard(&d, at.path())?, 1.0)
    } else if has("k1") {
        (Projection::kannala_brandt([number("k1")?, number("k2")?, number("k3")?, number("k4")?]), 1.0)
    } else if at.entries().iter().all(|(key, _)| ["fx", "fy", "cx", "cy"].contains(key)) {
        (Projection::Rectilinear, 1.0)
    } else {
        let model = at.entries().iter().map(|(key, _)| *key).collect::<Vec<_>>().join(" ");
        let known = "alpha; alpha beta; alpha xi; k1 k2 k3 k4; k1 k2 p1 p2 k3; beside fx fy cx cy";
        return Err(ProfileError::Model { format: "camera parameter", model, known });
    };
    let pinhole = Pinhole {
        focal: scale * Vec2::new(at.need_number("fx")?, at.need_number("fy")?),
        center: Point2::new(at.need_number("cx")?, at.need_number("cy")?),
        size: (image.need_number("width")?, image.need_number("height")?),
    };
    let lens = pinhole.lens(projection, 0.5)?;
    Ok(Profile { name: String::new(), format: "camera parameters", lens, rms_px: None, notes: Vec::new() })
}
