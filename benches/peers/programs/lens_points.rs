//! Points through a lens, for comparison with other programs: `lens_points LENS_FILE < QUERY`.
//!
//! The query is `{"rays": [[x, y, z], …], "pixels": [[u, v], …]}`; the answer has, in the same order, the pixels at which the
//! rays are seen, the directions in which the pixels look, `null` where there is none, and the derivatives of the former.
//! Pixel centers lie at integer + 0.5.

use std::error::Error;
use std::path::Path;

use plumbline::camera::{ExifFacts, Vec3, read_lens};
use plumbline::num::math::Point2;
use serde::Deserialize;
use serde_json::json;

#[derive(Deserialize)]
#[serde(default)]
#[derive(Default)]
struct Query {
    rays: Vec<[f64; 3]>,
    pixels: Vec<[f64; 2]>,
}

pub(super) fn main() -> Result<(), Box<dyn Error>> {
    let file = super::args().nth(1).ok_or("usage: lens_points LENS_FILE < QUERY")?;
    let profile = read_lens(Path::new(&file), &ExifFacts::default())?;
    let query: Query = serde_json::from_reader(std::io::stdin().lock())?;
    let rays: Vec<Vec3> = query.rays.into_iter().map(Vec3::from).collect();
    let seen = rays.iter().map(|ray| profile.lens.project(ray).map(|p| [p.x, p.y]));
    let slopes = rays.iter().map(|ray| {
        profile.lens.project_with_jacobian(ray).map(|(_, j)| [0, 1].map(|i| [j[(i, 0)], j[(i, 1)], j[(i, 2)]]))
    });
    let looked = query.pixels.iter().map(|p| profile.lens.unproject(Point2::from(*p)).map(|r| [r.x, r.y, r.z]));
    let answer = json!({
        "format": profile.format, "max_angle": profile.lens.max_angle(), "notes": profile.notes,
        "pixels": seen.collect::<Vec<_>>(), "jacobians": slopes.collect::<Vec<_>>(), "rays": looked.collect::<Vec<_>>(),
    });
    println!("{answer}");
    Ok(())
}
