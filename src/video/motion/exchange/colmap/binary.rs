//! The binary form of a model: little-endian, each file a count (`u64`) and that many entries.

use std::io::{self, Write};

use super::{
    Camera, ColmapError, EXPECTED_LENS, Image, ImageObservation, LENSES, Model, Point, SIMPLE_RADIAL, lens, rotation_of,
};
use plumbline_camera::{CameraPose, Point3, Vec3};
use plumbline_num::math::Point2;

/// "No point in space".
const NO_POINT: u64 = u64::MAX;
/// Color of all points: the model knows none.
const GRAY: [u8; 3] = [128; 3];

fn put_floats(out: &mut dyn Write, values: &[f64]) -> io::Result<()> {
    values.iter().try_for_each(|v| out.write_all(&v.to_le_bytes()))
}

fn put_count(out: &mut dyn Write, count: usize) -> io::Result<()> {
    out.write_all(&(count as u64).to_le_bytes())
}

pub(super) fn write_cameras(model: &Model, out: &mut dyn Write) -> io::Result<()> {
    put_count(out, model.cameras.len())?;
    for Camera { id, width, height, intrinsics: i } in &model.cameras {
        out.write_all(&id.to_le_bytes())?;
        out.write_all(&SIMPLE_RADIAL.0.to_le_bytes())?;
        out.write_all(&width.to_le_bytes())?;
        out.write_all(&height.to_le_bytes())?;
        put_floats(out, &[i.focal, i.center.x, i.center.y, i.k1])?;
    }
    Ok(())
}

pub(super) fn write_images(model: &Model, out: &mut dyn Write) -> io::Result<()> {
    put_count(out, model.images.len())?;
    for image in &model.images {
        let (q, t) = (image.pose.rotation, image.pose.translation);
        out.write_all(&image.id.to_le_bytes())?;
        put_floats(out, &[q.w, q.i, q.j, q.k, t.x, t.y, t.z])?;
        out.write_all(&image.camera.to_le_bytes())?;
        out.write_all(image.name.as_bytes())?;
        out.write_all(&[0])?;
        put_count(out, image.observations.len())?;
        for ImageObservation { at, point } in &image.observations {
            put_floats(out, &[at.x, at.y])?;
            out.write_all(&point.unwrap_or(NO_POINT).to_le_bytes())?;
        }
    }
    Ok(())
}

pub(super) fn write_points(model: &Model, out: &mut dyn Write) -> io::Result<()> {
    put_count(out, model.points.len())?;
    for Point { id, position, error_px, track } in &model.points {
        out.write_all(&id.to_le_bytes())?;
        put_floats(out, &[position.x, position.y, position.z])?;
        out.write_all(&GRAY)?;
        put_floats(out, &[*error_px])?;
        put_count(out, track.len())?;
        for (image, index) in track {
            out.write_all(&image.to_le_bytes())?;
            out.write_all(&index.to_le_bytes())?;
        }
    }
    Ok(())
}

pub(super) fn read_cameras(bytes: &[u8]) -> Result<Vec<Camera>, ColmapError> {
    let mut bytes = Bytes::of("cameras.bin", bytes);
    bytes.entries(24, |bytes| {
        let (id, number) = (bytes.u32()?, bytes.u32()?);
        let (width, height) = (bytes.u64()?, bytes.u64()?);
        let Some((_, name, count)) = LENSES.iter().find(|(n, ..)| *n == number) else {
            return Err(bytes.wrong(format!("camera model number {number}"), EXPECTED_LENS));
        };
        let parameters = (0..*count).map(|_| bytes.float()).collect::<Result<Vec<_>, _>>()?;
        let refused = || bytes.wrong(format!("camera model {name} {parameters:?}"), EXPECTED_LENS);
        let intrinsics = lens(name, &parameters).ok_or_else(refused)?;
        Ok(Camera { id, width, height, intrinsics })
    })
}

pub(super) fn read_images(bytes: &[u8]) -> Result<Vec<Image>, ColmapError> {
    let mut bytes = Bytes::of("images.bin", bytes);
    bytes.entries(73, |bytes| {
        let id = bytes.u32()?;
        let q = [bytes.float()?, bytes.float()?, bytes.float()?, bytes.float()?];
        let translation = Vec3::new(bytes.float()?, bytes.float()?, bytes.float()?);
        let rotation = rotation_of(q).ok_or_else(|| bytes.wrong(format!("{q:?}"), "a quaternion of length 1"))?;
        let (camera, name) = (bytes.u32()?, bytes.name()?);
        let observations = bytes.list(24, |bytes| {
            let at = Point2::new(bytes.float()?, bytes.float()?);
            let id = bytes.u64()?;
            Ok(ImageObservation { at, point: (id != NO_POINT).then_some(id) })
        })?;
        Ok(Image { id, camera, name, pose: CameraPose { rotation, translation }, observations })
    })
}

pub(super) fn read_points(bytes: &[u8]) -> Result<Vec<Point>, ColmapError> {
    let mut bytes = Bytes::of("points3D.bin", bytes);
    bytes.entries(51, |bytes| {
        let id = bytes.u64()?;
        let position = Point3::new(bytes.float()?, bytes.float()?, bytes.float()?);
        bytes.take(3)?;
        let error_px = bytes.float()?;
        let track = bytes.list(8, |bytes| Ok((bytes.u32()?, bytes.u32()?)))?;
        Ok(Point { id, position, error_px, track })
    })
}

/// The part of a file not yet read.
struct Bytes<'a> {
    file: &'static str,
    rest: &'a [u8],
    /// Entry being read.
    entry: usize,
}

impl<'a> Bytes<'a> {
    fn of(file: &'static str, rest: &'a [u8]) -> Self {
        Self { file, rest, entry: 0 }
    }

    fn wrong(&self, found: String, expected: &'static str) -> ColmapError {
        ColmapError::Value { file: self.file, location: format!("entry {}", self.entry), found, expected }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], ColmapError> {
        let Some((taken, rest)) = self.rest.split_at_checked(count) else {
            return Err(self.wrong("the file ends".to_owned(), "a whole entry"));
        };
        self.rest = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], ColmapError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    fn u32(&mut self) -> Result<u32, ColmapError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    fn u64(&mut self) -> Result<u64, ColmapError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    fn float(&mut self) -> Result<f64, ColmapError> {
        let value = f64::from_le_bytes(self.array()?);
        if value.is_finite() { Ok(value) } else { Err(self.wrong(value.to_string(), "a finite number")) }
    }

    /// Text up to a zero byte.
    fn name(&mut self) -> Result<String, ColmapError> {
        let end = self.rest.iter().position(|b| *b == 0);
        let end = end.ok_or_else(|| self.wrong("the file ends".to_owned(), "a name with a zero byte behind it"))?;
        let name = String::from_utf8_lossy(self.take(end)?).into_owned();
        self.take(1)?;
        Ok(name)
    }

    /// A count, and that many entries of at least `least` bytes each.
    fn list<T>(
        &mut self,
        least: usize,
        mut entry: impl FnMut(&mut Self) -> Result<T, ColmapError>,
    ) -> Result<Vec<T>, ColmapError> {
        let count = self.u64()?;
        if count > (self.rest.len() / least) as u64 {
            return Err(self.wrong(format!("a list of {count}"), "no more entries than fit in the file"));
        }
        (0..count).map(|_| entry(self)).collect()
    }

    /// The entries of the file, and nothing behind them.
    fn entries<T>(
        &mut self,
        least: usize,
        mut entry: impl FnMut(&mut Self) -> Result<T, ColmapError>,
    ) -> Result<Vec<T>, ColmapError> {
        let entries = self.list(least, |bytes| {
            let read = entry(bytes)?;
            bytes.entry += 1;
            Ok(read)
        })?;
        let left = self.rest.len();
        if left > 0 { Err(self.wrong(format!("{left} bytes too many"), "the end of the file")) } else { Ok(entries) }
    }
}
