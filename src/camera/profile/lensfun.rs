//! The lensfun database: cameras, lenses and their distortion, from XML.
//!
//! Lengths of the database are those of the sensor on which a lens was calibrated: the unit of `ρ` is half its short side,
//!
//! ```text
//! u_mm = 43.267 / (2 c √(a² + 1)),   c crop factor and a aspect of the lens entry (3:2 unless given),
//! u = u_mm / f_mm,                   f_px = f_mm · d_px / (43.267 / c_camera),
//! ```
//!
//! so that a lens keeps its distortion on another sensor. Between the focal lengths of a zoom, coefficients are
//! interpolated linearly; beyond them the nearest are used. `real-focal` replaces the nominal focal length.
//!
//! # Reference
//! The lensfun authors, *The lensfun database and file format* (`cropfactor`, `aspect-ratio`, `distortion`, `center`).

use std::path::{Path, PathBuf};

use roxmltree::{Document, Node};

use super::names::{likeness, words};
use super::{ExifFacts, MAX_BYTES, Pinhole, Profile, ProfileError, xml};
use crate::exif_lens::DIAGONAL_35_MM;
use crate::{Projection, RadialPolynomial};
use plumbline_num::document::read_text;
use plumbline_num::math::{Point2, Vec2};

const FORMAT: &str = "lensfun";
/// Aspect ratio of entries without one, as in lensfun: a 36 × 24 mm sensor.
const DEFAULT_ASPECT: f64 = 1.5;
/// Similarity of names below which lenses are different: one word in three may be missing, as makers' names often are.
const MIN_SIMILARITY: f64 = 0.6;
/// Maximum number of files of a database folder: bounds the time on a wrong folder.
const MAX_FILES: usize = 1000;

/// The lens of a picture from a lensfun file, a folder of them, or, without a path, the system's database.
///
/// # Errors
/// [`ProfileError::NotInDatabase`] where the picture's lens is not found, and those of the files.
pub fn lensfun_lens(source: Option<&Path>, picture: &ExifFacts) -> Result<Profile, ProfileError> {
    let files = match source {
        Some(path) if path.is_dir() => xml_files(path)?,
        Some(path) => vec![path.to_owned()],
        None => system_files(),
    };
    if files.is_empty() {
        let reason = match source {
            Some(folder) => format!("{} holds no .xml files of lensfun", folder.display()),
            None => {
                "no lensfun database is installed (/usr/share/lensfun, /usr/local/share/lensfun): install it, or give \
                     a file or folder of it"
                    .to_owned()
            }
        };
        return Err(ProfileError::NotInDatabase { reason });
    }
    let texts = files.iter().map(|file| read_text(file, MAX_BYTES)).collect::<Result<Vec<_>, _>>()?;
    let documents = texts.iter().map(|text| xml::document(text)).collect::<Result<Vec<_>, _>>()?;
    lens_of_documents(&documents, picture)
}

/// Databases of this machine: the newest version in the first folder that has one.
fn system_files() -> Vec<PathBuf> {
    let found = |place: &str| {
        let mut versions: Vec<PathBuf> =
            std::fs::read_dir(place).ok()?.flatten().map(|e| e.path()).filter(|p| p.is_dir()).collect();
        versions.sort();
        let files = versions.iter().rev().find_map(|v| xml_files(v).ok().filter(|f| !f.is_empty()));
        files.or_else(|| xml_files(Path::new(place)).ok().filter(|f| !f.is_empty()))
    };
    ["/usr/local/share/lensfun", "/usr/share/lensfun"].into_iter().find_map(found).unwrap_or_default()
}

fn xml_files(folder: &Path) -> Result<Vec<PathBuf>, ProfileError> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)?.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "xml"));
    files.sort();
    files.truncate(MAX_FILES);
    Ok(files)
}

pub(super) fn lens_of_documents(documents: &[Document<'_>], picture: &ExifFacts) -> Result<Profile, ProfileError> {
    let elements = |name: &'static str| {
        let all = documents.iter().flat_map(|d| d.root_element().children());
        all.filter(move |n| n.has_tag_name(name))
    };
    let size = picture.size.filter(|s| s.0 > 0.0 && s.1 > 0.0);
    let size = size.ok_or(ProfileError::Missing { key: "the picture's size".to_owned(), expected: "px" })?;
    let camera = camera(elements("camera"), picture);
    let lens = lens(&elements("lens").collect::<Vec<_>>(), camera, picture)?;
    let crop = camera.and_then(|c| number(c, "cropfactor")).or_else(|| picture.crop_factor());
    let mut notes = Vec::new();
    let crop = crop.or_else(|| {
        notes.push(
            "neither the database nor the picture gives the sensor's size: that of the lens entry is used".into(),
        );
        number(lens, "cropfactor")
    });
    let crop = crop.filter(|c| *c > 0.0).unwrap_or(1.0);
    let entry = Entry::read(lens, picture)?;
    let scale = size.0.hypot(size.1) * crop / DIAGONAL_35_MM;
    let unit_px = entry.unit_mm * scale;
    let focal = entry.focal_mm * scale;
    let center = Point2::new(0.5 * size.0, 0.5 * size.1) + entry.center * unit_px;
    let pinhole = Pinhole { focal: Vec2::new(focal, focal), center, size };
    Ok(Profile { name: name(lens), format: FORMAT, lens: pinhole.lens(entry.projection()?, 0.0)?, rms_px: None, notes })
}

/// Text of the first child of this name, without a language.
fn text<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    let child = |n: &Node<'_, '_>| n.has_tag_name(name) && n.attribute("lang").is_none();
    node.children().find(child).and_then(|n| n.text()).map(str::trim)
}

fn number(node: Node<'_, '_>, name: &str) -> Option<f64> {
    text(node, name)?.parse().ok().filter(|n: &f64| n.is_finite())
}

fn name(lens: Node<'_, '_>) -> String {
    format!("{} {}", text(lens, "maker").unwrap_or(""), text(lens, "model").unwrap_or("")).trim().to_owned()
}

/// Names of an entry in all languages.
fn names<'a>(node: Node<'a, '_>) -> impl Iterator<Item = &'a str> {
    let models = node.children().filter(|n| n.has_tag_name("model"));
    models.filter_map(|n| n.text()).collect::<Vec<_>>().into_iter()
}

/// The entry whose name is most like `wanted`, the maker's name aside, and how alike they are.
fn most_alike<'a, 'i>(entries: impl Iterator<Item = Node<'a, 'i>>, wanted: &str) -> Option<(f64, Node<'a, 'i>)> {
    let wanted = words(wanted);
    let score = |node: Node<'a, 'i>| {
        let maker = words(text(node, "maker").unwrap_or(""));
        let without = |name: &std::collections::BTreeSet<String>| name.difference(&maker).cloned().collect();
        let alike = names(node).map(|n| likeness(&without(&words(n)), &without(&wanted)));
        (alike.fold(0.0, f64::max), node)
    };
    // The first of equals: the order of the files decides, not chance.
    entries.map(score).reduce(|best, next| if next.0 > best.0 { next } else { best })
}

fn camera<'a, 'i>(cameras: impl Iterator<Item = Node<'a, 'i>>, picture: &ExifFacts) -> Option<Node<'a, 'i>> {
    let model = picture.model.as_deref()?;
    let maker = words(picture.make.as_deref().unwrap_or(""));
    let same_maker = |node: &Node<'_, '_>| {
        let all = node.children().filter(|n| n.has_tag_name("maker")).filter_map(|n| n.text());
        maker.is_empty() || all.map(words).any(|m| !m.is_disjoint(&maker))
    };
    let (alike, found) = most_alike(cameras.filter(same_maker), model)?;
    (alike >= 0.99).then_some(found)
}

fn lens<'a, 'i>(
    all: &[Node<'a, 'i>],
    camera: Option<Node<'a, 'i>>,
    picture: &ExifFacts,
) -> Result<Node<'a, 'i>, ProfileError> {
    if let [only] = all {
        return Ok(*only);
    }
    let not_found = |reason: String| Err(ProfileError::NotInDatabase { reason });
    if let Some(wanted) = picture.lens.as_deref().filter(|l| !words(l).is_empty()) {
        let Some((alike, found)) = most_alike(all.iter().copied(), wanted) else {
            return not_found("the lensfun file has no lenses".to_owned());
        };
        if alike >= MIN_SIMILARITY {
            return Ok(found);
        }
        return not_found(format!(
            "the lens \"{wanted}\" is not in the database (nearest: \"{}\"): give a file with this lens, --fov, or mark lines",
            name(found)
        ));
    }
    // Cameras with a fixed lens have a mount of their own.
    let mount = camera.and_then(|c| text(c, "mount"));
    let fits = |lens: &&Node<'_, '_>| {
        mount.is_some() && lens.children().any(|n| n.has_tag_name("mount") && n.text().map(str::trim) == mount)
    };
    let fitting: Vec<_> = all.iter().filter(fits).collect();
    match (fitting.as_slice(), mount) {
        ([one], _) => Ok(**one),
        (_, Some(_)) => {
            not_found("the picture does not name its lens, and several fit its camera: name a lens".to_owned())
        }
        (_, None) => {
            let camera = picture.model.as_deref().unwrap_or("unnamed");
            not_found(format!(
                "the picture does not name its lens, and its camera ({camera}) is not in the database: give a file with one \
                 lens, --fov, or mark lines"
            ))
        }
    }
}

/// What an entry says for the picture's focal length.
struct Entry {
    base: Projection,
    focal_mm: f64,
    unit_mm: f64,
    /// Offset of the center, half short sides.
    center: Vec2,
    coefficients: Option<[f64; 5]>,
}

impl Entry {
    fn read(lens: Node<'_, '_>, picture: &ExifFacts) -> Result<Self, ProfileError> {
        let kind = text(lens, "type").unwrap_or("rectilinear");
        let base = match kind {
            "rectilinear" => Projection::Rectilinear,
            "fisheye" => Projection::Equidistant,
            "equisolid" => Projection::Equisolid,
            "stereographic" => Projection::Stereographic,
            "orthographic" => Projection::Orthographic,
            "equirectangular" => Projection::Equirectangular,
            "panoramic" => Projection::Cylindrical,
            other => {
                let known = "rectilinear, fisheye, equisolid, stereographic, orthographic, equirectangular, panoramic";
                return Err(ProfileError::Model { format: FORMAT, model: other.to_owned(), known });
            }
        };
        let crop = number(lens, "cropfactor").filter(|c| *c > 0.0).unwrap_or(1.0);
        let aspect = text(lens, "aspect-ratio").and_then(ratio).unwrap_or(DEFAULT_ASPECT);
        let calibrations = distortions(lens)?;
        let fixed = calibrations.first().filter(|f| calibrations.iter().all(|c| c.focal == f.focal)).map(|c| c.focal);
        let given = picture.focal_mm.filter(|f| *f > 0.0 && f.is_finite());
        let Some(focal) = given.or(fixed) else {
            let reason = format!("the picture does not tell its focal length, which {} needs: give --fov", name(lens));
            return Err(ProfileError::NotInDatabase { reason });
        };
        let at_focal = interpolated(&calibrations, focal);
        let place = lens.children().find(|n| n.has_tag_name("center"));
        let coordinate = |key: &str| {
            place.and_then(|n| n.attribute(key)).and_then(|v| v.parse().ok()).filter(|v: &f64| v.abs() < 1.0)
        };
        Ok(Self {
            base,
            focal_mm: at_focal.as_ref().and_then(|c| c.real_focal).unwrap_or(focal),
            unit_mm: 0.5 * DIAGONAL_35_MM / crop / (aspect * aspect + 1.0).sqrt(),
            center: Vec2::new(coordinate("x").unwrap_or(0.0), coordinate("y").unwrap_or(0.0)),
            coefficients: at_focal.map(|c| c.coefficients),
        })
    }

    fn projection(&self) -> Result<Projection, ProfileError> {
        match self.coefficients {
            Some(c) if !self.base.is_panoramic() => {
                let model = RadialPolynomial::new(&self.base, self.unit_mm / self.focal_mm, c)?;
                Ok(Projection::RadialPolynomial(model))
            }
            _ => Ok(self.base.clone()),
        }
    }
}

/// `3:2` or `1.5`.
fn ratio(text: &str) -> Option<f64> {
    let parsed = match text.split_once(':') {
        Some((a, b)) => a.trim().parse::<f64>().ok()? / b.trim().parse::<f64>().ok()?,
        None => text.parse().ok()?,
    };
    (parsed > 0.0 && parsed.is_finite()).then(|| parsed.max(parsed.recip()))
}

/// One calibrated focal length.
#[derive(Clone)]
struct Distortion {
    focal: f64,
    real_focal: Option<f64>,
    coefficients: [f64; 5],
}

fn distortions(lens: Node<'_, '_>) -> Result<Vec<Distortion>, ProfileError> {
    let all: Vec<Node<'_, '_>> =
        lens.children().filter(|n| n.has_tag_name("calibration")).flat_map(|n| n.children()).collect();
    let real_focal_of = |focal: f64| {
        let matching =
            |n: &&Node<'_, '_>| n.has_tag_name("real-focal-length") && attribute(**n, "focal") == Some(focal);
        all.iter().find(matching).and_then(|n| attribute(*n, "real-focal"))
    };
    let mut found = Vec::new();
    for node in all.iter().filter(|n| n.has_tag_name("distortion")) {
        let line = || format!("line {}", node.document().text_pos_at(node.range().start).row);
        let get = |key: &str| attribute(*node, key).unwrap_or(0.0);
        let focal = attribute(*node, "focal").filter(|f| *f > 0.0);
        let focal = focal.ok_or_else(|| ProfileError::value(line(), "a distortion", "a focal length above 0"))?;
        let (a, b, c, k1) = (get("a"), get("b"), get("c"), get("k1"));
        let coefficients = match node.attribute("model").unwrap_or("") {
            "ptlens" => [1.0 - a - b - c, c, b, a, 0.0],
            "poly3" => [1.0 - k1, 0.0, k1, 0.0, 0.0],
            "poly5" => [1.0, 0.0, k1, 0.0, get("k2")],
            "none" => [1.0, 0.0, 0.0, 0.0, 0.0],
            other => {
                return Err(ProfileError::Model {
                    format: FORMAT,
                    model: other.to_owned(),
                    known: "ptlens, poly3, poly5",
                });
            }
        };
        let real_focal = attribute(*node, "real-focal").or_else(|| real_focal_of(focal)).filter(|f| *f > 0.0);
        found.push(Distortion { focal, real_focal, coefficients });
    }
    found.sort_by(|a, b| a.focal.total_cmp(&b.focal));
    Ok(found)
}

fn attribute(node: Node<'_, '_>, key: &str) -> Option<f64> {
    node.attribute(key)?.trim().parse().ok().filter(|v: &f64| v.is_finite())
}

/// The calibration at `focal`, between its neighbors.
fn interpolated(all: &[Distortion], focal: f64) -> Option<Distortion> {
    let above = all.partition_point(|d| d.focal < focal);
    let (Some(low), Some(high)) = (all.get(above.saturating_sub(1)), all.get(above.min(all.len().saturating_sub(1))))
    else {
        return None;
    };
    let span = high.focal - low.focal;
    let share = if span > 0.0 { ((focal - low.focal) / span).clamp(0.0, 1.0) } else { 0.0 };
    let between = |a: f64, b: f64| a + share * (b - a);
    // Where only the nominal length is known, the real one is as far off as that of the neighbors.
    let ratio = |d: &Distortion| d.real_focal.unwrap_or(d.focal) / d.focal;
    let known = low.real_focal.is_some() || high.real_focal.is_some();
    Some(Distortion {
        focal,
        real_focal: known.then(|| focal * between(ratio(low), ratio(high))),
        coefficients: std::array::from_fn(|i| between(low.coefficients[i], high.coefficients[i])),
    })
}
