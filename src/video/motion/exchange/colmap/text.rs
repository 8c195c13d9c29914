//! The text form of a model: one entry per line, two for an image; lines that begin with `#` are comments.

use std::io::{self, Write};

use super::{
    Camera, ColmapError, EXPECTED_LENS, Image, ImageObservation, LENSES, Model, Point, SIMPLE_RADIAL, lens, rotation_of,
};
use plumbline_camera::{CameraPose, Point3, Vec3};
use plumbline_num::math::Point2;

/// Color of all points: the model knows none.
const GRAY: &str = "128 128 128";

pub(super) fn write_cameras(model: &Model, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]")?;
    writeln!(out, "# Number of cameras: {}", model.cameras.len())?;
    for Camera { id, width, height, intrinsics: i } in &model.cameras {
        writeln!(out, "{id} {} {width} {height} {} {} {} {}", SIMPLE_RADIAL.1, i.focal, i.center.x, i.center.y, i.k1)?;
    }
    Ok(())
}

pub(super) fn write_images(model: &Model, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME")?;
    writeln!(out, "# POINTS2D[] as (X, Y, POINT3D_ID)")?;
    writeln!(out, "# Number of images: {}", model.images.len())?;
    for image in &model.images {
        let (q, t) = (image.pose.rotation, image.pose.translation);
        let (id, camera, name) = (image.id, image.camera, &image.name);
        writeln!(out, "{id} {} {} {} {} {} {} {} {camera} {name}", q.w, q.i, q.j, q.k, t.x, t.y, t.z)?;
        for (k, ImageObservation { at, point }) in image.observations.iter().enumerate() {
            write!(out, "{}{} {} ", if k == 0 { "" } else { " " }, at.x, at.y)?;
            match point {
                Some(id) => write!(out, "{id}")?,
                None => write!(out, "-1")?,
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

pub(super) fn write_points(model: &Model, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)")?;
    writeln!(out, "# Number of points: {}", model.points.len())?;
    for Point { id, position, error_px, track } in &model.points {
        write!(out, "{id} {} {} {} {GRAY} {error_px}", position.x, position.y, position.z)?;
        for (image, index) in track {
            write!(out, " {image} {index}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

pub(super) fn read_cameras(bytes: &[u8]) -> Result<Vec<Camera>, ColmapError> {
    let mut lines = Lines::of("cameras.txt", bytes)?;
    let mut cameras = Vec::new();
    while let Some(mut line) = lines.entry() {
        let id = line.number("an id of 0 or more")?;
        let model = line.word("the name of a camera model")?;
        let (width, height) = (line.number("a width in px")?, line.number("a height in px")?);
        let parameters = line.rest("the parameters of the lens, finite numbers")?;
        let known = LENSES.iter().any(|(_, name, count)| *name == model && *count == parameters.len());
        let intrinsics = known.then(|| lens(model, &parameters)).flatten();
        let shown = || &parameters[..parameters.len().min(12)];
        let refused = || line.wrong(format!("camera model {model:.40} {:?}", shown()), EXPECTED_LENS);
        let intrinsics = intrinsics.ok_or_else(refused)?;
        cameras.push(Camera { id, width, height, intrinsics });
    }
    Ok(cameras)
}

pub(super) fn read_images(bytes: &[u8]) -> Result<Vec<Image>, ColmapError> {
    let mut lines = Lines::of("images.txt", bytes)?;
    let mut images = Vec::new();
    while let Some(mut line) = lines.entry() {
        let id = line.number("an id of 0 or more")?;
        let q = [line.float()?, line.float()?, line.float()?, line.float()?];
        let t = Vec3::new(line.float()?, line.float()?, line.float()?);
        let camera = line.number("the id of a camera")?;
        let name = line.name();
        let rotation = rotation_of(q).ok_or_else(|| line.wrong(format!("{q:?}"), "a quaternion of length 1"))?;
        let observations = lines.following().map_or_else(|| Ok(Vec::new()), observations)?;
        images.push(Image { id, camera, name, pose: CameraPose { rotation, translation: t }, observations });
    }
    Ok(images)
}

fn observations(mut line: Line<'_>) -> Result<Vec<ImageObservation>, ColmapError> {
    let mut found = Vec::new();
    while !line.is_done() {
        let at = Point2::new(line.float()?, line.float()?);
        let id: i64 = line.number("the id of a point, or -1")?;
        found.push(ImageObservation { at, point: u64::try_from(id).ok() });
    }
    Ok(found)
}

pub(super) fn read_points(bytes: &[u8]) -> Result<Vec<Point>, ColmapError> {
    let mut lines = Lines::of("points3D.txt", bytes)?;
    let mut points = Vec::new();
    while let Some(mut line) = lines.entry() {
        let id = line.number("an id of 0 or more")?;
        let position = Point3::new(line.float()?, line.float()?, line.float()?);
        for _ in 0..3 {
            line.number::<u8>("a color of 0 to 255")?;
        }
        let error_px = line.float()?;
        let mut track = Vec::new();
        while !line.is_done() {
            track.push((line.number("the id of an image")?, line.number("the index of a point")?));
        }
        points.push(Point { id, position, error_px, track });
    }
    Ok(points)
}

/// Lines of a file, with their numbers.
struct Lines<'a> {
    file: &'static str,
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
}

impl<'a> Lines<'a> {
    fn of(file: &'static str, bytes: &'a [u8]) -> Result<Self, ColmapError> {
        let text = std::str::from_utf8(bytes).map_err(|e| ColmapError::Value {
            file,
            location: format!("byte {}", e.valid_up_to()),
            found: "no text".to_owned(),
            expected: "UTF-8",
        })?;
        Ok(Self { file, lines: text.lines().enumerate() })
    }

    /// The next line that is neither empty nor a comment.
    fn entry(&mut self) -> Option<Line<'a>> {
        loop {
            let line = self.following()?;
            if !(line.text.trim().is_empty() || line.text.trim_start().starts_with('#')) {
                return Some(line);
            }
        }
    }

    /// The next line, comments and empty ones included.
    fn following(&mut self) -> Option<Line<'a>> {
        let (index, text) = self.lines.next()?;
        Some(Line { file: self.file, number: index + 1, text })
    }
}

/// A line, read word by word.
struct Line<'a> {
    file: &'static str,
    number: usize,
    /// The part not yet read.
    text: &'a str,
}

impl<'a> Line<'a> {
    fn wrong(&self, found: String, expected: &'static str) -> ColmapError {
        ColmapError::Value { file: self.file, location: format!("line {}", self.number), found, expected }
    }

    fn is_done(&self) -> bool {
        self.text.trim_start().is_empty()
    }

    fn word(&mut self, expected: &'static str) -> Result<&'a str, ColmapError> {
        let text = self.text.trim_start();
        let end = text.find(char::is_whitespace).unwrap_or(text.len());
        if end == 0 {
            return Err(self.wrong("the line ends".to_owned(), expected));
        }
        let (word, rest) = text.split_at(end);
        self.text = rest;
        Ok(word)
    }

    fn number<T: std::str::FromStr>(&mut self, expected: &'static str) -> Result<T, ColmapError> {
        let word = self.word(expected)?;
        // A word may be as long as the file.
        let shown = || word.chars().take(60).collect::<String>();
        word.parse().map_err(|_| self.wrong(format!("{:?}", shown()), expected))
    }

    fn float(&mut self) -> Result<f64, ColmapError> {
        let value: f64 = self.number("a finite number")?;
        if value.is_finite() { Ok(value) } else { Err(self.wrong(value.to_string(), "a finite number")) }
    }

    fn rest(&mut self, expected: &'static str) -> Result<Vec<f64>, ColmapError> {
        let mut values = Vec::new();
        while !self.is_done() {
            values.push(self.number(expected)?);
        }
        Ok(values)
    }

    /// The rest as a name, which may contain spaces.
    fn name(&mut self) -> String {
        std::mem::take(&mut self.text).trim().to_owned()
    }
}
