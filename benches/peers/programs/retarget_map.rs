//! Writes the map that gives a picture another shape: `retarget_map PICTURE WxH PREFIX [key=value ...]`.
//!
//! Keys: `lines=FILE.json` (a list of `{"id", "points": [[x, y], ...], "orientation": null | "h" | "v" | degrees}`, pixel
//! centers at integers), `mask=PICTURE`, `faces=off`, `refine=off`, `cells`, `least`, `bending`, `crop`, `floor`.
//! Written: `PREFIX_x.npy`, `PREFIX_y.npy` (source position of every output pixel), `PREFIX_mesh.npy` (the grid in the output),
//! all with pixel centers at integers, and `PREFIX_importance.npy`. Figures go to stdout as JSON.

use std::collections::HashMap;
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::time::Instant;

use plumbline::image::feature::{Face, FaceDetector, FaceOptions, Importance, ImportanceOptions};
use plumbline::image::{Frame, Layout, PixelFormat};
use plumbline::num::math::{Point2, PointMap};
use plumbline::num::run::Run;
use plumbline::photo::retarget::{RetargetOptions, Retargeter};
use plumbline::photo::{Line, Orientation};

type Failure = Box<dyn Error>;

fn read_frame(path: &str) -> Result<Frame, Failure> {
    let picture = image::open(path)?.to_rgb8();
    let (w, h) = (picture.width() as usize, picture.height() as usize);
    let mut frame = Frame::new(PixelFormat::opaque(Layout::Gbr, 8), w, h);
    for (plane, channel) in [(0, 1), (1, 2), (2, 0)] {
        let mut out = frame.plane8_mut(plane).ok_or("no plane")?;
        for y in 0..h {
            for (x, v) in out.row_mut(y).iter_mut().enumerate() {
                *v = picture.as_raw()[3 * (y * w + x) + channel];
            }
        }
    }
    Ok(frame)
}

fn read_lines(path: &str) -> Result<Vec<Line>, Failure> {
    let document: serde_json::Value = serde_json::from_reader(File::open(path)?)?;
    let list = document.as_array().ok_or("a list of lines is wanted")?;
    let number = |v: &serde_json::Value| v.as_f64().ok_or("a number is wanted");
    list.iter()
        .map(|line| {
            let points = line["points"].as_array().ok_or("points are missing")?;
            let points: Result<Vec<Point2>, &str> =
                points.iter().map(|p| Ok(Point2::new(number(&p[0])? + 0.5, number(&p[1])? + 0.5))).collect();
            let orientation = match &line["orientation"] {
                serde_json::Value::String(s) if s == "h" => Orientation::Horizontal,
                serde_json::Value::String(s) if s == "v" => Orientation::Vertical,
                serde_json::Value::Number(degrees) => {
                    Orientation::Angle(degrees.as_f64().unwrap_or_default().to_radians())
                }
                _ => Orientation::Free,
            };
            Ok(Line { name: line["id"].to_string(), points: points?, orientation })
        })
        .collect()
}

fn write_npy(path: &str, shape: &str, values: impl Iterator<Item = f32>) -> Result<(), Failure> {
    let mut out = BufWriter::new(File::create(path)?);
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}");
    let padded = format!("{header:<width$}\n", width = (header.len() + 11).next_multiple_of(64) - 11);
    out.write_all(b"\x93NUMPY\x01\x00")?;
    out.write_all(&(padded.len() as u16).to_le_bytes())?;
    out.write_all(padded.as_bytes())?;
    for v in values {
        out.write_all(&v.to_le_bytes())?;
    }
    Ok(out.flush()?)
}

fn size_of(text: &str) -> Result<(usize, usize), Failure> {
    let (w, h) = text.split_once('x').ok_or("a size WxH is wanted")?;
    Ok((w.parse()?, h.parse()?))
}

pub(super) fn main() -> Result<(), Failure> {
    let args: Vec<String> = super::args().skip(1).collect();
    let [picture, size, prefix, keys @ ..] = &args[..] else {
        return Err("usage: retarget_map PICTURE WxH PREFIX [key=value ...]".into());
    };
    let keys: HashMap<&str, &str> = keys.iter().filter_map(|k| k.split_once('=')).collect();
    let value = |key: &str, default: f64| keys.get(key).map_or(Ok(default), |v| v.parse::<f64>());
    let frame = read_frame(picture)?;
    let out = size_of(size)?;
    let lines = keys.get("lines").map_or(Ok(Vec::new()), |path| read_lines(path))?;
    let mask = keys.get("mask").map(|path| read_frame(path)).transpose()?;

    let clock = Instant::now();
    let with_faces = keys.get("faces").is_none_or(|v| *v != "off");
    let faces: Vec<Face> = if with_faces {
        FaceDetector::new(FaceOptions::default()).detect(&frame, &Run::default()).expect("a run that never stops")
    } else {
        Vec::new()
    };
    let faces_s = clock.elapsed().as_secs_f64();
    let judged = ImportanceOptions::default();
    let judged = ImportanceOptions { floor: value("floor", f64::from(judged.floor))? as f32, ..judged };
    let clock = Instant::now();
    let importance = Importance::of_frame(&frame, &faces, mask.as_ref(), &judged, &Run::default())?;
    let importance_s = clock.elapsed().as_secs_f64();

    let standard = RetargetOptions::default();
    let options = RetargetOptions {
        cells: value("cells", standard.cells as f64)? as usize,
        min_scale: value("least", standard.min_scale)?,
        max_scale: value("most", standard.max_scale)?,
        bending: value("bending", standard.bending)?,
        contrast: value("contrast", standard.contrast)?,
        face_weight: value("face", standard.face_weight)?,
        crop_below: value("crop", standard.crop_below)?,
        refine: keys.get("refine").is_none_or(|v| *v != "off"),
    };
    let clock = Instant::now();
    let mut retargeter =
        Retargeter::new((frame.width, frame.height), importance.clone(), lines, faces.clone(), options)?;
    let result = retargeter.solve(out, &Run::default())?;
    let first_s = clock.elapsed().as_secs_f64();
    let again = |(w, h): (usize, usize), r: &mut Retargeter| -> Result<f64, Failure> {
        let clock = Instant::now();
        r.solve((w, h), &Run::default())?;
        Ok(clock.elapsed().as_secs_f64())
    };
    let mut resolves: Vec<f64> = Vec::new();
    for by in 1..8 {
        resolves.push(again((out.0 + by, out.1), &mut retargeter)?);
    }
    resolves.sort_by(f64::total_cmp);

    let map: Vec<Option<Point2>> = (0..out.0 * out.1)
        .map(|i| result.warp.field.map(Point2::new((i % out.0) as f64 + 0.5, (i / out.0) as f64 + 0.5)))
        .collect();
    let shape = format!("{}, {}", out.1, out.0);
    let coordinate = |get: fn(&Point2) -> f64| map.iter().map(move |p| p.as_ref().map_or(f64::NAN, get) as f32 - 0.5);
    write_npy(&format!("{prefix}_x.npy"), &shape, coordinate(|p| p.x))?;
    write_npy(&format!("{prefix}_y.npy"), &shape, coordinate(|p| p.y))?;
    let mesh = &result.warp.mesh;
    let corners = mesh.vertices.iter().flat_map(|v| [v.x as f32 - 0.5, v.y as f32 - 0.5]);
    write_npy(&format!("{prefix}_mesh.npy"), &format!("{}, {}, 2", mesh.rows + 1, mesh.cols + 1), corners)?;
    let plane = importance.plane();
    let values = (0..plane.height()).flat_map(|y| plane.as_ref().row(y).iter().copied());
    write_npy(&format!("{prefix}_importance.npy"), &format!("{}, {}", plane.height(), plane.width()), values)?;

    let face = |f: &Face| [f.rect.min.x, f.rect.min.y, f.rect.width(), f.rect.height(), f.score];
    let bent: Vec<&str> = result.warp.lines.iter().filter(|l| l.is_bent()).map(|l| l.name.as_str()).collect();
    let window = [result.window.min.x, result.window.min.y, result.window.max.x, result.window.max.y];
    let figures = serde_json::json!({
        "faces": faces.iter().map(face).collect::<Vec<_>>(), "faces_s": faces_s, "importance_s": importance_s,
        "first_solve_s": first_s, "resolve_s": resolves[0], "iterations": result.warp.iterations,
        "energies": result.energies, "released": result.released, "bent": bent, "window": window,
        "folded": mesh.folded_cells(),
        "worst_line": result.warp.lines.iter().map(|l| l.max_px / l.length_px.max(1.0)).fold(0.0, f64::max),
    });
    println!("{figures}");
    Ok(())
}
