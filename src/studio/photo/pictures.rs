//! Pictures and curves for the page, as buffers.

use nalgebra::Matrix2x3;

use super::protocol::BufferKind;
use crate::error::StudioError;
use crate::outbox::{Buffer, Outbox};
use plumbline_app::pipeline::RunError;
use plumbline_app::stages::ImageRenderSettings;
use plumbline_app::stages::photo_steps::rendered_part;
use plumbline_image::Frame;
use plumbline_image::still::{Photo, SaveOptions, StillFormat, encode, rgb_of_frame};
use plumbline_image::warp::{Lattice, Map, WarpField};
use plumbline_num::math::{Point2, PointMap as _, Rect, Vec2};
use plumbline_num::run::Run;
use plumbline_photo::PhotoWarp;

/// Longest side of the source that the page gets as a whole, px.
pub(super) const SOURCE_SIDE: usize = 2560;
/// Quality of the source for the page.
const SOURCE_QUALITY: u8 = 90;

/// Places along each side of a part at which its scale is measured.
const SCALE_SAMPLES: usize = 9;

/// A part of a picture and the pixels it is shown with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    /// px of the whole picture at full size.
    pub(super) rect: Rect,
    /// Width and height of the samples, px.
    pub(super) size: (usize, usize),
}

impl Part {
    /// The part of a picture of `size` px that fractions of its sides name, with at most as many samples as fit into `screen`, and no
    /// more than the picture has.
    pub(super) fn of(size: (usize, usize), [left, top, right, bottom]: [f64; 4], screen: (usize, usize)) -> Self {
        let (w, h) = (size.0 as f64, size.1 as f64);
        let rect = Rect { min: Point2::new(left * w, top * h), max: Point2::new(right * w, bottom * h) };
        let fit = (screen.0 as f64 / rect.width()).min(screen.1 as f64 / rect.height()).min(1.0);
        let side = |length: f64| ((fit * length).round() as usize).max(1);
        Self { rect, size: (side(rect.width()), side(rect.height())) }
    }

    /// Pixels of the photo that a sample spans along the longer of its sides: the upper decile over the part. (In the middle alone a
    /// wide perspective photo spans half of what it does elsewhere.)
    pub(super) fn scale(&self, warp: &PhotoWarp) -> f64 {
        let step = self.rect.width() / self.size.0 as f64;
        let fraction = |k: usize| (k as f64 + 0.5) / SCALE_SAMPLES as f64;
        let span = |k: usize| {
            let p = self.rect.at(fraction(k % SCALE_SAMPLES), fraction(k / SCALE_SAMPLES));
            let at = |dx, dy| warp.field.map(p + Vec2::new(dx, dy));
            let (here, right, below) = (at(0.0, 0.0)?, at(step, 0.0)?, at(0.0, step)?);
            Some((right - here).norm().max((below - here).norm()))
        };
        let mut spans: Vec<f64> = (0..SCALE_SAMPLES * SCALE_SAMPLES).filter_map(span).collect();
        spans.sort_by(f64::total_cmp);
        spans.get(spans.len() * 9 / 10).copied().unwrap_or(step)
    }

    /// From its samples to the whole picture.
    fn whole_from_part(&self) -> Matrix2x3<f64> {
        let scale = (self.rect.width() / self.size.0 as f64, self.rect.height() / self.size.1 as f64);
        Matrix2x3::new(scale.0, 0.0, self.rect.min.x, 0.0, scale.1, self.rect.min.y)
    }
}

/// From the photo to a copy of it.
fn copy_from_photo(photo: (usize, usize), copy: &Frame) -> Map {
    let scale = (copy.width as f64 / photo.0 as f64, copy.height as f64 / photo.1 as f64);
    Map::Affine(Matrix2x3::new(scale.0, 0.0, 0.0, 0.0, scale.1, 0.0))
}

/// A part of the result, sampled once from `copy` of a photo of `size` px.
pub(super) fn part_of_result(
    warp: &mut PhotoWarp,
    part: Part,
    (copy, size): (&Frame, (usize, usize)),
    settings: &ImageRenderSettings,
    run: &Run,
) -> Result<Frame, RunError> {
    let chain = std::mem::take(&mut warp.field.chain);
    let mut field = WarpField { chain };
    field.chain.insert(0, Map::Affine(part.whole_from_part()));
    field.chain.push(copy_from_photo(size, copy));
    let lattice = Lattice::between(&field, part.size, (copy.width, copy.height));
    field.chain.pop();
    field.chain.remove(0);
    warp.field = field;
    rendered_part(copy, &lattice, settings, run)
}

/// A part of the photo, from a copy of it.
pub(super) fn part_of_source(part: Part, (copy, size): (&Frame, (usize, usize)), run: &Run) -> Result<Frame, RunError> {
    let field = WarpField::identity().then(Map::Affine(part.whole_from_part())).then(copy_from_photo(size, copy));
    let lattice = Lattice::between(&field, part.size, (copy.width, copy.height));
    rendered_part(copy, &lattice, &ImageRenderSettings::default(), run)
}

/// A picture as a buffer of red, green and blue.
pub(super) fn picture(kind: BufferKind, part: Part, frame: &Frame, out: &mut Outbox) -> Result<(), StudioError> {
    let samples = rgb_of_frame(frame).map_err(|e| StudioError::Method(e.to_string()))?;
    let rect = [part.rect.min.x, part.rect.min.y, part.rect.max.x, part.rect.max.y].map(|v| v as f32);
    let size = [frame.width as u32, frame.height as u32];
    let mut bytes = Vec::with_capacity(24 + 3 * samples.len());
    bytes.extend_from_slice(bytemuck::cast_slice(&rect));
    bytes.extend_from_slice(bytemuck::cast_slice(&size));
    bytes.extend_from_slice(bytemuck::cast_slice(&samples));
    out.buffers.push(Buffer { kind: kind as u32, item: 0, bytes: bytes.into() });
    Ok(())
}

/// The source as JPEG, without what its file says of the camera; the color profile stays.
pub(super) fn source_jpeg(photo: Photo) -> Result<Vec<u8>, StudioError> {
    let plain = Photo { icc: photo.icc, ..Photo::new(photo.frame) };
    let mut bytes = std::io::Cursor::new(Vec::new());
    let encoded = encode(&plain, StillFormat::Jpeg, SaveOptions { quality: SOURCE_QUALITY }, &mut bytes);
    encoded.map_err(|e| StudioError::Method(e.to_string()))?;
    Ok(bytes.into_inner())
}

/// Curves as a buffer of `f32`.
pub(super) fn curves(kind: BufferKind, curves: &[Vec<Point2>], out: &mut Outbox) {
    let mut bytes = counts(curves);
    for p in curves.iter().flatten() {
        bytes.extend_from_slice(bytemuck::cast_slice(&[p.x as f32, p.y as f32]));
    }
    out.buffers.push(Buffer { kind: kind as u32, item: 0, bytes: bytes.into() });
}

/// Marked points as a buffer of `f64`.
pub(super) fn marks(lines: &[Vec<Point2>], out: &mut Outbox) {
    let mut bytes = counts(lines);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    for p in lines.iter().flatten() {
        bytes.extend_from_slice(bytemuck::cast_slice(&[p.x, p.y]));
    }
    out.buffers.push(Buffer { kind: BufferKind::Marks as u32, item: 0, bytes: bytes.into() });
}

fn counts(curves: &[Vec<Point2>]) -> Vec<u8> {
    let counts: Vec<u32> = std::iter::once(curves.len()).chain(curves.iter().map(Vec::len)).map(|n| n as u32).collect();
    bytemuck::cast_slice(&counts).to_vec()
}

/// The grid of a map.
pub(super) fn grid(warp: &PhotoWarp, out: &mut Outbox) {
    let mesh = &warp.mesh;
    let mut bytes = bytemuck::cast_slice(&[mesh.cols as u32 + 1, mesh.rows as u32 + 1]).to_vec();
    for v in &mesh.vertices {
        bytes.extend_from_slice(bytemuck::cast_slice(&[v.x as f32, v.y as f32]));
    }
    out.buffers.push(Buffer { kind: BufferKind::Grid as u32, item: 0, bytes: bytes.into() });
}
