//! COLMAP's `cameras.txt`: `ID MODEL WIDTH HEIGHT PARAMETERS…` per line; pixel centers at integer + 0.5.
//!
//! Parameters per model, in the file's order:
//!
//! ```text
//! SIMPLE_PINHOLE f cx cy                      PINHOLE fx fy cx cy
//! SIMPLE_RADIAL f cx cy k                     RADIAL f cx cy k1 k2
//! OPENCV fx fy cx cy k1 k2 p1 p2              FULL_OPENCV … k1 k2 p1 p2 k3 k4 k5 k6
//! OPENCV_FISHEYE fx fy cx cy k1 k2 k3 k4      SIMPLE_RADIAL_FISHEYE f cx cy k     RADIAL_FISHEYE f cx cy k1 k2
//! FOV fx fy cx cy ω                           THIN_PRISM_FISHEYE … k1 k2 p1 p2 k3 k4 sx1 sy1
//! SIMPLE_DIVISION f cx cy k                   DIVISION fx fy cx cy k
//! SIMPLE_FISHEYE f cx cy                      FISHEYE fx fy cx cy
//! EUCM fx fy cx cy α β                        EQUIRECTANGULAR w h
//! ```
//!
//! `RAD_TAN_THIN_PRISM_FISHEYE` distorts twice in a row and is refused by name.

use std::f64::consts::TAU;

use super::kalibr::{fov_scale, the_one};
use super::opencv::standard;
use super::{ExifFacts, Pinhole, Profile, ProfileError};
use crate::{BrownConrady, DistortedPlane, DistortionTerms, Projection, Unified};
use plumbline_num::math::{Point2, Vec2};

const FORMAT: &str = "COLMAP";
const KNOWN: &str = "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE, \
                     SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, FOV, THIN_PRISM_FISHEYE, SIMPLE_DIVISION, DIVISION, \
                     SIMPLE_FISHEYE, FISHEYE, EUCM, EQUIRECTANGULAR";

/// Lines that are not comments, with their numbers.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let numbered = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    numbered.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

pub(super) fn is_camera_list(text: &str) -> bool {
    let Some((_, line)) = lines(text).next() else { return false };
    let mut words = line.split_whitespace();
    let id = words.next().is_some_and(|w| w.parse::<u64>().is_ok());
    let model = |w: &str| w.len() > 2 && w.bytes().all(|b| b.is_ascii_uppercase() || b == b'_');
    id && words.next().is_some_and(model)
}

pub(super) fn lens(text: &str, picture: &ExifFacts) -> Result<Profile, ProfileError> {
    let cameras = lines(text).map(|(number, line)| camera(number, line));
    the_one(cameras.collect::<Result<_, _>>()?, picture)
}

fn camera(number: usize, line: &str) -> Result<(&str, Profile), ProfileError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [id, model, numbers @ ..] = words.as_slice() else {
        return Err(ProfileError::value(format!("line {number}"), line, "ID MODEL WIDTH HEIGHT PARAMETERS"));
    };
    let parsed = |word: &&str| word.parse::<f64>().ok().filter(|n| n.is_finite());
    let parsed = |word| parsed(word).ok_or_else(|| ProfileError::value(format!("line {number}"), word, "a number"));
    let numbers: Vec<f64> = numbers.iter().map(parsed).collect::<Result<_, _>>()?;
    let [width, height, parameters @ ..] = numbers.as_slice() else {
        return Err(ProfileError::value(format!("line {number}"), line, "a width and a height after the model"));
    };
    let lens = of_model(model, parameters, (*width, *height), number)?;
    let name = format!("camera {id}");
    Ok((*id, Profile { name, format: FORMAT, lens, rms_px: None, notes: Vec::new() }))
}

/// `N` parameters.
fn exactly<const N: usize>(model: &str, p: &[f64], line: usize) -> Result<[f64; N], ProfileError> {
    let expected = || format!("{N} parameters for {model}");
    p.try_into().map_err(|_| ProfileError::value(format!("line {line}"), format!("{} parameters", p.len()), expected()))
}

fn of_model(model: &str, p: &[f64], size: (f64, f64), line: usize) -> Result<crate::Lens, ProfileError> {
    // One focal length or two, then the center, then the rest.
    let one =
        ["SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "SIMPLE_DIVISION"];
    let (fx, fy, cx, cy, rest) = if one.contains(&model) || model == "SIMPLE_FISHEYE" {
        let [f, cx, cy, rest @ ..] = p else {
            return exactly::<3>(model, p, line).and(Err(ProfileError::UnknownFormat));
        };
        (*f, *f, *cx, *cy, rest)
    } else if model == "EQUIRECTANGULAR" {
        let [w, h] = exactly(model, p, line)?;
        (w / TAU, 2.0 * h / TAU, 0.5 * w, 0.5 * h, &[][..])
    } else {
        match p {
            [fx, fy, cx, cy, rest @ ..] => (*fx, *fy, *cx, *cy, rest),
            _ => (0.0, 0.0, 0.0, 0.0, p),
        }
    };
    let radial = |d: [f64; 2]| standard(&d, model);
    let mut scale = 1.0;
    let projection = match model {
        "SIMPLE_PINHOLE" | "PINHOLE" => exactly::<0>(model, rest, line).map(|_| Projection::Rectilinear)?,
        "SIMPLE_RADIAL" => exactly::<1>(model, rest, line).and_then(|[k]| radial([k, 0.0]))?,
        "RADIAL" => exactly::<2>(model, rest, line).and_then(radial)?,
        "OPENCV" => standard(&exactly::<4>(model, rest, line)?, model)?,
        "FULL_OPENCV" => standard(&exactly::<8>(model, rest, line)?, model)?,
        "OPENCV_FISHEYE" => Projection::kannala_brandt(exactly(model, rest, line)?),
        "SIMPLE_RADIAL_FISHEYE" => {
            exactly(model, rest, line).map(|[k]| Projection::kannala_brandt([k, 0.0, 0.0, 0.0]))?
        }
        "RADIAL_FISHEYE" => exactly(model, rest, line).map(|[a, b]| Projection::kannala_brandt([a, b, 0.0, 0.0]))?,
        "FOV" => {
            let [omega] = exactly(model, rest, line)?;
            let t = 2.0 * (0.5 * omega).tan();
            scale = fov_scale(t);
            Projection::FieldOfView(t)
        }
        "THIN_PRISM_FISHEYE" => {
            let [k1, k2, p1, p2, k3, k4, sx, sy] = exactly(model, rest, line)?;
            let (radial, thin_prism) = ([k1, k2, k3, k4], [sx, 0.0, sy, 0.0]);
            let terms = DistortionTerms { radial, tangential: [p1, p2], thin_prism, ..Default::default() };
            Projection::BrownConrady(BrownConrady::new(DistortedPlane::Angle, terms)?)
        }
        "SIMPLE_DIVISION" | "DIVISION" => exactly(model, rest, line).map(|[k]| Projection::Division(k))?,
        "SIMPLE_FISHEYE" | "FISHEYE" => exactly::<0>(model, rest, line).map(|_| Projection::Equidistant)?,
        "EUCM" => {
            let [alpha, beta] = exactly(model, rest, line)?;
            Projection::Unified(Unified::extended(alpha, beta)?)
        }
        "EQUIRECTANGULAR" => Projection::Equirectangular,
        _ => return Err(ProfileError::Model { format: FORMAT, model: model.to_owned(), known: KNOWN }),
    };
    Pinhole { focal: scale * Vec2::new(fx, fy), center: Point2::new(cx, cy), size }.lens(projection, 0.0)
}
