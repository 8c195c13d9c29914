//! `image.render`: the picture through its map, once.

use std::sync::Arc;

use nalgebra::{Matrix2, Matrix2x3};

use super::transparency::{eroded, mask_of, opacity, plane_of, with_alpha};
use super::{PhotoMap, map_at, picture, with_pixels};
use crate::pipeline::kinds::{self, ImageRenderSettings, PhotoBorder};
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use plumbline_image::Frame;
use plumbline_image::render::{Border, Interpolation, RenderError, RenderOptions, Renderer, complete};
use plumbline_image::warp::{Lattice, Map, WarpField};
use plumbline_num::math::{Point2, PointMap};
use plumbline_num::run::Run;

/// Samples the picture. One that keeps its size and has no map is handed on as it is.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &ImageRenderSettings) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let map = map_at(context, stage, "warps")?;
    let source = (photo.frame.width, photo.frame.height);
    let natural = map.as_ref().map_or(source, |m| m.warp.size);
    let size = settings.size.map_or(natural, |s| (s.width as usize, s.height as usize));
    if map.is_none() && size == source {
        context.values.put(stage, "image", photo);
        return Ok(());
    }
    let lattice = match map {
        Some(map) if size == natural => Lattice::between(&map.warp.field, size, source),
        map => Lattice::between(&resized(map, natural, size), size, source),
    };
    let frame = sampled(&photo.frame, &lattice, settings, &context.job.run()).map_err(|e| render_error(context, &e))?;
    context.values.put(stage, "image", Arc::new(with_pixels(&photo, frame)));
    Ok(())
}

/// The picture through a lattice, and what stands where it shows nothing.
fn sampled(frame: &Frame, lattice: &Lattice, settings: &ImageRenderSettings, run: &Run) -> Result<Frame, RenderError> {
    let renderer = renderer(settings);
    if !matches!(settings.border, PhotoBorder::Transparent | PhotoBorder::Fill) {
        return renderer.render_still(frame, lattice, run);
    }
    let lost = RenderError::Plane { plane: 0, role: "source" };
    let (mut made, shown) = if frame.format.alpha {
        let made = renderer.render_still(frame, lattice, run)?;
        let shown = opacity(&made).ok_or(lost.clone())?;
        (made, shown)
    } else {
        // Colors go on beyond the edge, so that a pixel shown in part has the color of what it shows.
        let options = RenderOptions { border: Border::Replicate, ..options(settings) };
        let made = Renderer::new(options).render_still(frame, lattice, run)?;
        let mask = mask_of(frame, settings.border == PhotoBorder::Fill).ok_or(lost.clone())?;
        let mask = renderer.render_still(&mask, lattice, run)?;
        let shown = plane_of(&mask).ok_or(lost.clone())?;
        (made, shown)
    };
    if settings.border == PhotoBorder::Fill {
        complete(&mut made, &eroded(&shown), run)?;
        return Ok(made);
    }
    if frame.format.alpha { Ok(made) } else { with_alpha(&made, &shown).ok_or(lost) }
}

/// The map followed by a resize: where the pixels of the resized output come from.
fn resized(map: Option<Arc<PhotoMap>>, natural: (usize, usize), size: (usize, usize)) -> WarpField {
    let scale = (natural.0 as f64 / size.0 as f64, natural.1 as f64 / size.1 as f64);
    let field = WarpField::identity().then(Map::Affine(Matrix2x3::new(scale.0, 0.0, 0.0, 0.0, scale.1, 0.0)));
    match map {
        Some(map) => field.then(Map::Radial(Box::new(Shared(map)))),
        None => field,
    }
}

/// A map that others hold too.
struct Shared(Arc<PhotoMap>);

impl PointMap for Shared {
    fn map(&self, p: Point2) -> Option<Point2> {
        self.0.warp.field.map(p)
    }

    fn jacobian(&self, p: Point2) -> Option<Matrix2<f64>> {
        self.0.warp.field.jacobian(p)
    }
}

fn renderer(settings: &ImageRenderSettings) -> Renderer {
    Renderer::new(options(settings))
}

fn options(settings: &ImageRenderSettings) -> RenderOptions {
    RenderOptions {
        interpolation: match settings.interpolation {
            kinds::Interpolation::Bicubic => Interpolation::Bicubic,
            kinds::Interpolation::Lanczos3 => Interpolation::Lanczos3,
        },
        border: match settings.border {
            PhotoBorder::Black | PhotoBorder::Transparent | PhotoBorder::Fill => Border::Black,
            PhotoBorder::Mirror => Border::Mirror,
            PhotoBorder::Replicate => Border::Replicate,
        },
    }
}

fn render_error(context: &Context<'_, '_>, error: &RenderError) -> RunError {
    let name = context.summary.input.as_ref().map_or("the picture", |i| i.name.as_str());
    match error {
        RenderError::Interrupted(stopped) => (*stopped).into(),
        RenderError::Dimensions { .. } => RunError::Input(format!("{name}: {error}; resize it first")),
        other => RunError::Internal(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::grid::Grid;
    use plumbline_photo::PhotoWarp;

    fn shifted() -> Arc<PhotoMap> {
        let shift = Map::Affine(Matrix2x3::new(1.0, 0.0, 5.0, 0.0, 1.0, -3.0));
        let mesh = Grid { cols: 1, rows: 1, width: 100.0, height: 50.0 }.to_mesh();
        let field = WarpField::identity().then(shift);
        let forward = Box::new(|p: Point2| Some(p));
        let warp = PhotoWarp {
            field,
            size: (100, 50),
            mesh,
            forward,
            lines: Vec::new(),
            cut_faces: Vec::new(),
            iterations: 0,
        };
        Arc::new(PhotoMap { warp, told: serde_json::Map::new() })
    }

    #[test]
    fn a_resize_acts_on_the_output_and_the_map_behind_it() {
        let field = resized(Some(shifted()), (100, 50), (200, 25));
        assert_eq!(field.map(Point2::new(20.0, 10.0)), Some(Point2::new(15.0, 17.0)));
        let plain = resized(None, (100, 50), (200, 25));
        assert_eq!(plain.map(Point2::new(200.0, 25.0)), Some(Point2::new(100.0, 50.0)));
    }
}
