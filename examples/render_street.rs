//! Photos of the street of `render_clip` with people in it: `render_street --preset NAME [--out FOLDER]`.
//!
//! | preset | camera |
//! | --- | --- |
//! | `street-fisheye` | a fisheye of 150° with people at its edges, and their heads as `NAME.faces.json`, the lens as `NAME.lens.json` |
//! | `street-people` | a normal lens, two people far apart |
//! | `street-stitched` | seven hand-held pictures, stitched: an irregular border on black |
//!
//! The scene renders pinhole pictures alone, so a cube of six is rendered around the camera and sampled along the rays of the
//! lens, four per pixel.

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::f64::consts::FRAC_PI_2;
use std::fs;
use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use nalgebra::{Rotation3, Vector3};
use plumbline::camera::{FieldAxis, FieldOfView, Lens, LensFile, Projection, Vec3};
use plumbline::image::canvas::{Canvas, Rgb};
use plumbline::num::math::Point2;
use plumbline_testkit::scene::{Pose, Scene, View, passer_by};
use serde_json::json;

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Preset {
    #[value(name = "street-fisheye")]
    Fisheye,
    #[value(name = "street-people")]
    People,
    #[value(name = "street-stitched")]
    Stitched,
}

#[derive(Parser)]
struct Options {
    #[arg(long, value_enum)]
    preset: Preset,
    /// Side of each picture of the cube, px
    #[arg(long, default_value_t = 1600)]
    cube: usize,
    /// JPEG quality
    #[arg(long, default_value_t = 88)]
    quality: u8,
    /// Folder to write into
    #[arg(long, default_value = "media")]
    out: PathBuf,
}

/// Somebody who stands in the street: `[x, z]` in meters, the direction they face, and the tint of the coat.
struct Person {
    at: [f64; 2],
    facing: [f64; 2],
    coat: [f32; 3],
}

const RED: [f32; 3] = [1.0; 3];
const GREEN: [f32; 3] = [0.35, 0.85, 0.6];
const BLUE: [f32; 3] = [0.35, 0.6, 1.7];

impl Preset {
    fn camera(self) -> Pose {
        let (yaw, pitch, center) = match self {
            Self::Fisheye => (0.06, -0.17, Vector3::new(0.2, -1.6, 4.0)),
            Self::People => (0.02, -0.02, Vector3::new(0.0, -1.6, 2.0)),
            Self::Stitched => (-0.35, 0.0, Vector3::new(1.6, -1.7, 3.0)),
        };
        Pose { cam_from_world: looking(yaw, pitch, 0.0), center }
    }

    fn people(self) -> Vec<Person> {
        let person = |at, facing, coat| Person { at, facing, coat };
        match self {
            Self::Fisheye => vec![
                person([-1.75, 5.25], [1.0, -0.5], RED),
                person([2.35, 5.2], [-1.0, -0.5], BLUE),
                person([-0.5, 9.0], [0.1, -1.0], GREEN),
            ],
            Self::People => {
                vec![person([-2.0, 6.9], [0.3, -1.0], RED), person([2.35, 7.2], [-0.3, -1.0], GREEN)]
            }
            Self::Stitched => vec![person([-1.1, 9.5], [0.5, -1.0], RED)],
        }
    }

    fn lens(self) -> Result<Lens, Box<dyn Error>> {
        let (projection, degrees, size) = match self {
            Self::Fisheye => (Projection::Equisolid, 150.0, (1200.0, 740.0)),
            Self::People => (Projection::Rectilinear, 66.0, (1200.0, 750.0)),
            Self::Stitched => (Projection::Cylindrical, 128.0, (1280.0, 560.0)),
        };
        Ok(Lens::from_field_of_view(projection, FieldOfView::degrees(degrees, FieldAxis::Horizontal), size)?)
    }
}

/// Turns directions ahead into those of a camera that looks `yaw` to the right and `pitch` up, rad.
fn looking(yaw: f64, pitch: f64, roll: f64) -> Rotation3<f64> {
    let turn = |axis: Vector3<f64>, angle: f64| Rotation3::new(axis * angle);
    turn(Vector3::z(), -roll) * turn(Vector3::x(), -pitch) * turn(Vector3::y(), -yaw)
}

/// Pictures of 94° in six directions around a camera.
struct Cube {
    faces: Vec<(Rotation3<f64>, Canvas)>,
    focal_px: f64,
}

impl Cube {
    fn new(preset: Preset, side: usize) -> Self {
        let scene = Scene::street(4);
        // At a quarter of the stride both feet are on the ground.
        let t = 0.26;
        let standing = |p: Person| {
            let start = [0, 1].map(|k| p.at[k] - p.facing[k] * t);
            passer_by(t, start, p.facing, p.coat)
        };
        let people: Vec<_> = preset.people().into_iter().flat_map(standing).collect();
        let camera = preset.camera();
        // A little more than 90°, so that no sample at an edge is outside its picture.
        let focal_px = 0.5 * side as f64 / 47_f64.to_radians().tan();
        let view = View { width: side, height: side, focal_px, readout_s: 0.0 };
        let turns = [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (2.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
        let face = |(yaw, pitch): (f64, f64)| {
            let turn = looking(yaw * FRAC_PI_2, pitch * FRAC_PI_2, 0.0);
            let pose = Pose { cam_from_world: turn * camera.cam_from_world, ..camera };
            (turn, view.render(&scene, &people, |_| pose))
        };
        Self { faces: turns.into_iter().map(face).collect(), focal_px }
    }

    /// The color in a direction of the camera, of the picture that looks there most directly, bilinear.
    fn color(&self, ray: &Vec3) -> [f64; 3] {
        let ahead = |face: &(Rotation3<f64>, Canvas)| (face.0 * ray).z;
        let best = self.faces.iter().max_by(|a, b| ahead(a).total_cmp(&ahead(b))).expect("six faces");
        let (d, canvas) = (best.0 * ray, &best.1);
        let side = canvas.width();
        let at = |v: f64| (v / d.z * self.focal_px + 0.5 * side as f64 - 0.5).clamp(0.0, side as f64 - 1.001);
        let (x, y) = (at(d.x), at(d.y));
        let (fx, fy) = (x.fract(), y.fract());
        let pixel = |dx: usize, dy: usize| canvas.pixels()[(y as usize + dy) * side + x as usize + dx].map(f64::from);
        let corners = [pixel(0, 0), pixel(1, 0), pixel(0, 1), pixel(1, 1)];
        let weights = [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy];
        std::array::from_fn(|c| corners.iter().zip(weights).map(|(p, w)| p[c] * w).sum())
    }
}

/// What the lens sees of the cube where `shown` holds, black elsewhere.
fn photo(lens: &Lens, cube: &Cube, shown: impl Fn(&Vec3) -> bool) -> Canvas {
    let (width, height) = (lens.size.0 as usize, lens.size.1 as usize);
    let sample = |x: f64, y: f64| {
        let ray = lens.unproject(Point2::new(x, y)).filter(|ray| shown(ray));
        ray.map_or([0.0; 3], |ray| cube.color(&ray))
    };
    let pixel = |k: usize| -> Rgb {
        let (x, y) = ((k % width) as f64, (k / width) as f64);
        let four = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)].map(|(dx, dy)| sample(x + dx, y + dy));
        std::array::from_fn(|c| (four.iter().map(|s| s[c]).sum::<f64>() / 4.0).round() as u8)
    };
    Canvas::from_pixels(width, height, (0..width * height).map(pixel).collect()).expect("one pixel per place")
}

/// Whether one of seven pictures shows a direction, each held a little off.
fn stitched(ray: &Vec3) -> bool {
    const SHOTS: [[f64; 3]; 7] = [
        [-50.0, 1.2, 3.0],
        [-34.0, -1.5, -2.0],
        [-17.0, 1.1, 2.5],
        [0.0, -1.3, -1.5],
        [17.0, 1.5, 2.0],
        [34.0, -1.1, -3.0],
        [50.0, 0.9, 2.0],
    ];
    SHOTS.iter().any(|[yaw, pitch, roll]| {
        let d = looking(yaw.to_radians(), pitch.to_radians(), roll.to_radians()) * ray;
        d.z > 0.0 && (d.x / d.z).abs() < 0.26 && (d.y / d.z).abs() < 0.4
    })
}

/// The squares around the heads of people, px.
fn faces(preset: Preset, lens: &Lens) -> serde_json::Value {
    let camera = preset.camera();
    let square = |p: Person| {
        // Middle and radius of the head of `passer_by`, m.
        let head = Vector3::new(p.at[0], -1.7, p.at[1]) - camera.center;
        let middle = lens.project(&(camera.cam_from_world * head))?;
        let above = lens.project(&(camera.cam_from_world * (head - Vector3::y() * 0.17)))?;
        let half = (above - middle).norm();
        Some(json!({ "x": (middle.x - half).round(), "y": (middle.y - half).round(),
                     "w": (2.0 * half).round(), "h": (2.0 * half).round() }))
    };
    let faces: Vec<_> = preset.people().into_iter().filter_map(square).collect();
    json!({ "format": "plumbline.faces", "version": 1,
            "source": { "width": lens.size.0 as u32, "height": lens.size.1 as u32 }, "faces": faces })
}

fn main() -> Result<(), Box<dyn Error>> {
    let o = Options::parse();
    let name = o.preset.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned());
    let (lens, cube) = (o.preset.lens()?, Cube::new(o.preset, o.cube));
    let picture = match o.preset {
        Preset::Stitched => photo(&lens, &cube, stitched),
        _ => photo(&lens, &cube, |_| true),
    };
    fs::create_dir_all(&o.out)?;
    let file = |suffix: &str| o.out.join(format!("{name}{suffix}"));
    let encoder = jpeg_encoder::Encoder::new_file(file(".jpg"), o.quality)?;
    encoder.encode(picture.as_bytes(), lens.size.0 as u16, lens.size.1 as u16, jpeg_encoder::ColorType::Rgb)?;
    if o.preset == Preset::Fisheye {
        fs::write(file(".lens.json"), serde_json::to_string_pretty(&LensFile::of(&lens, &name))? + "\n")?;
        fs::write(file(".faces.json"), faces(o.preset, &lens).to_string() + "\n")?;
    }
    println!("{}", file(".jpg").display());
    Ok(())
}
