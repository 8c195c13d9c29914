//! Finds the straight lines of a photo and draws them over it, to look at: `lines_of_image FILE OUT.png [LENS DEGREES]`.
//!
//! `LENS` is `rectilinear`, `equidistant`, `equisolid`, `stereographic` or `equirectangular`, `DEGREES` the field of view
//! along the width. Without them the photo is taken as it is. Verticals are red, horizontals green, blue and yellow, others
//! white. Prints what a `.lines.json` file holds.

use std::io::Write;
use std::time::Instant;

use image::{Rgb, RgbImage};
use plumbline::camera::{FieldAxis, FieldOfView, Lens, Projection};
use plumbline::image::Plane;
use plumbline::num::math::Point2;
use plumbline::num::run::Run;
use plumbline::photo::line_detection::{LineDetectionOptions, LineGroup, detect_lines};
use plumbline::photo::marks::LinesFile;

pub(super) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = super::args().collect();
    let [_, input, output, ..] = args.as_slice() else {
        return Err("usage: lines_of_image FILE OUT.png [LENS DEGREES]".into());
    };
    let mut picture = image::open(input)?.into_rgb8();
    let size = picture.dimensions();
    let gray = image::imageops::grayscale(&picture);
    let luma =
        Plane::from_fn(size.0 as usize, size.1 as usize, |x, y| f32::from(gray.get_pixel(x as u32, y as u32).0[0]));
    let lens = match args.get(3) {
        Some(name) => Some(lens(name, args.get(4).ok_or("degrees are missing")?.parse()?, size)?),
        None => None,
    };
    let began = Instant::now();
    let found = detect_lines(luma.as_ref(), lens.as_ref(), &LineDetectionOptions::default(), &Run::default())
        .expect("a run that never stops");
    eprintln!(
        "{input}: {} lines in {:.2} s, down {:?}, {} horizontal directions",
        found.lines.len(),
        began.elapsed().as_secs_f64(),
        found.down.map(|d| [d.x, d.y, d.z]),
        found.horizontals.len()
    );
    for line in &found.lines {
        let color = match line.group {
            LineGroup::Vertical => [255, 40, 40],
            LineGroup::Horizontal(i) => [[40, 230, 60], [70, 130, 255], [255, 220, 0]][i.min(2)],
            LineGroup::Free => [255, 255, 255],
        };
        let width = (f64::from(size.0.max(size.1)) / 700.0).max(1.0);
        for ends in line.line.points.windows(2) {
            draw(&mut picture, ends[0], ends[1], width, color);
        }
    }
    picture.save(output)?;
    let file = LinesFile::new(size, found.lines.into_iter().map(|l| l.line).collect());
    std::io::stdout().write_all(file.to_json().as_bytes())?;
    Ok(())
}

fn lens(name: &str, degrees: f64, size: (u32, u32)) -> Result<Lens, Box<dyn std::error::Error>> {
    let projection = match name {
        "rectilinear" => Projection::Rectilinear,
        "equidistant" => Projection::Equidistant,
        "equisolid" => Projection::Equisolid,
        "stereographic" => Projection::Stereographic,
        "equirectangular" => Projection::Equirectangular,
        other => return Err(format!("unknown lens {other:?}").into()),
    };
    let fov = FieldOfView::degrees(degrees, FieldAxis::Horizontal);
    Ok(Lens::from_field_of_view(projection, fov, (f64::from(size.0), f64::from(size.1)))?)
}

fn draw(picture: &mut RgbImage, a: Point2, b: Point2, width: f64, color: [u8; 3]) {
    let steps = (b - a).norm().ceil().max(1.0) as usize;
    let reach = (width / 2.0).ceil() as i64;
    for k in 0..=steps {
        let p = a + (b - a) * (k as f64 / steps as f64);
        for (dx, dy) in (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| (x, y))) {
            let (x, y) = (p.x.floor() as i64 + dx, p.y.floor() as i64 + dy);
            let inside = x >= 0 && y >= 0 && x < i64::from(picture.width()) && y < i64::from(picture.height());
            if inside && (dx * dx + dy * dy) as f64 <= width * width / 4.0 {
                picture.put_pixel(x as u32, y as u32, Rgb(color));
            }
        }
    }
}
