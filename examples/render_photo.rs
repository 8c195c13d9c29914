//! Photos of a room with exact lines: `render_photo --preset NAME [--out FOLDER]`.
//!
//! Writes `NAME.jpg`, `NAME.lens.json` (the lens) and `NAME.lines.json` (the exact image of every marked edge, with how it
//! lies in the world as its orientation: plumb edges are vertical, level ones free). `--lens FILE` takes a lens from a file of
//! any format that is read, `--yaw`, `--pitch` and `--roll` turn the camera.

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::fs;
use std::path::PathBuf;

use clap::Parser;
use nalgebra::UnitQuaternion;
use plumbline::camera::{
    CameraPose, ExifFacts, FieldAxis, FieldOfView, Lens, LensFile, Point3, Projection, Unified, Vec3, read_lens,
};
use plumbline::num::math::{Point2, Vec2};
use plumbline_testkit::room::{LineKind, Room, RoomView};
use serde_json::{Value, json};

#[derive(Parser)]
struct Options {
    /// One of the cameras of `media/`.
    #[arg(long, value_parser = ["room-kb-125", "room-equisolid-180", "room-eucm", "room-rectilinear-100"])]
    preset: Option<String>,
    /// A lens file instead.
    #[arg(long, conflicts_with = "preset")]
    lens: Option<PathBuf>,
    /// Name of the files; that of the preset unless given.
    #[arg(long)]
    name: Option<String>,
    /// Degrees to the right.
    #[arg(long, default_value_t = 8.0, allow_hyphen_values = true)]
    yaw: f64,
    /// Degrees up.
    #[arg(long, default_value_t = -6.0, allow_hyphen_values = true)]
    pitch: f64,
    /// Degrees clockwise.
    #[arg(long, default_value_t = 1.5, allow_hyphen_values = true)]
    roll: f64,
    /// Samples per pixel and axis.
    #[arg(long, default_value_t = 4)]
    samples: usize,
    /// JPEG quality.
    #[arg(long, default_value_t = 88)]
    quality: u8,
    /// Where the files go.
    #[arg(long, default_value = "media")]
    out: PathBuf,
}

/// Lenses like those of an action camera, a full-frame fisheye, a phone's wide clip-on, and a wide-angle.
fn preset(name: &str) -> Result<Lens, Box<dyn Error>> {
    let fov = |projection, degrees, axis, size| {
        Lens::from_field_of_view(projection, FieldOfView::degrees(degrees, axis), size)
    };
    Ok(match name {
        "room-kb-125" => {
            let projection = Projection::kannala_brandt([0.04, 0.038, -0.03, 0.0076]);
            let lens = fov(projection, 125.0, FieldAxis::Horizontal, (1200.0, 900.0))?;
            Lens {
                center: lens.center + Vec2::new(-7.25, 4.5),
                focal: lens.focal.component_mul(&Vec2::new(1.0, 0.998)),
                ..lens
            }
        }
        "room-equisolid-180" => fov(Projection::Equisolid, 180.0, FieldAxis::Diagonal, (1200.0, 800.0))?,
        "room-eucm" => {
            let projection = Projection::Unified(Unified::extended(0.62, 1.12)?);
            let lens = fov(projection, 150.0, FieldAxis::Horizontal, (1200.0, 900.0))?;
            Lens { center: Point2::new(604.0, 446.5), ..lens }
        }
        _ => fov(Projection::Rectilinear, 100.0, FieldAxis::Horizontal, (1200.0, 800.0))?,
    })
}

/// The camera by the back wall, turned.
fn pose(o: &Options) -> CameraPose {
    let turn = |axis, degrees: f64| UnitQuaternion::from_axis_angle(&axis, degrees.to_radians());
    let (x, y, z) = (Vec3::x_axis(), Vec3::y_axis(), Vec3::z_axis());
    let rotation = turn(z, -o.roll) * turn(x, -o.pitch) * turn(y, -o.yaw);
    CameraPose::looking_from(Point3::new(0.3, -0.05, -0.9), rotation)
}

/// What was drawn, as a file of marked lines.
fn lines(room: &Room, lens: &Lens, pose: &CameraPose) -> Value {
    let rounded = |v: f64| (v * 1e6).round() / 1e6;
    let lines = room.lines(lens, pose).into_iter().map(|line| {
        let points: Vec<[f64; 2]> = line.points.iter().map(|p| [rounded(p.x), rounded(p.y)]).collect();
        let orientation = if line.kind == LineKind::Vertical { "vertical" } else { "free" };
        json!({ "name": line.name, "points": points, "orientation": orientation })
    });
    json!({
        "format": "plumbline.lines", "version": 1, "pixel_center": 0.5,
        "source": { "width": lens.size.0 as u32, "height": lens.size.1 as u32 },
        "lines": lines.collect::<Vec<_>>(),
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let o = Options::parse();
    let lens = match &o.lens {
        Some(path) => read_lens(path, &ExifFacts::default())?.lens,
        None => preset(o.preset.as_deref().unwrap_or("room-kb-125"))?,
    };
    let name = o.name.clone().or_else(|| o.preset.clone()).unwrap_or_else(|| "room".to_owned());
    let (room, pose) = (Room::furnished(), pose(&o));
    let picture = RoomView { lens: lens.clone(), pose, samples: o.samples }.render(&room);
    fs::create_dir_all(&o.out)?;
    let file = |suffix: &str| o.out.join(format!("{name}{suffix}"));
    let encoder = jpeg_encoder::Encoder::new_file(file(".jpg"), o.quality)?;
    encoder.encode(picture.as_bytes(), lens.size.0 as u16, lens.size.1 as u16, jpeg_encoder::ColorType::Rgb)?;
    fs::write(file(".lens.json"), serde_json::to_string_pretty(&LensFile::of(&lens, &name))? + "\n")?;
    let lines = lines(&room, &lens, &pose);
    let count = lines["lines"].as_array().map_or(0, Vec::len);
    fs::write(file(".lines.json"), lines.to_string() + "\n")?;
    println!("{}: {count} lines", file(".jpg").display());
    Ok(())
}
