//! `image.render`: samples a still picture once through its maps.

use std::io::{Seek, Write};
use std::sync::{Arc, OnceLock};

use nalgebra::{Matrix2, Matrix2x3};

use super::photo::transparency::{eroded, mask_of, opacity, plane_of, with_alpha};
use super::prelude::*;
use super::values::{PhotoMap, Picture};
use super::video_render;
use crate::pipeline::sizes::PictureSize;
use plumbline_image::Frame;
use plumbline_image::render::{Border, Interpolation, RenderError, RenderOptions, Renderer, StillRendering, complete};
use plumbline_image::still::{GainMap, Photo, SaveOptions, Saved, StillError, StillFormat, encode};
use plumbline_image::warp::{Lattice, Map, WarpField};
use plumbline_num::math::{Point2, PointMap};
use plumbline_num::run::Run;

/// Fill of pixels that the source does not cover.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PhotoBorder {
    /// Black; transparent where the picture has transparency
    #[default]
    Black,
    /// The picture mirrored at its edge
    Mirror,
    /// The edge's pixels drawn out
    Replicate,
    /// Transparent: for PNG, TIFF and WebP
    Transparent,
    /// What the rest of the picture suggests: skies, walls and floors go on, things are not invented
    Fill,
}

impl PhotoBorder {
    /// It is made of the whole result, not of each row by itself.
    fn is_of_the_whole(self) -> bool {
        matches!(self, Self::Transparent | Self::Fill)
    }
}

/// Settings of `image.render`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImageRenderSettings {
    /// How pixels are interpolated
    pub interpolation: video_render::Interpolation,
    /// Fill of pixels that the source does not cover
    pub border: PhotoBorder,
    /// Size of the result, such as 1600x1200; that of the maps if left out
    pub size: Option<PictureSize>,
}

impl Stage for ImageRenderSettings {
    const KIND: &'static str = "image.render";
    const SUMMARY: &'static str = "samples a still picture once through its map, as the mean where it shrinks";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture"),
        Port::any("warps", PortType::Warp, "the map; without one the picture is only resized"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the sampled picture")];
    const RESAMPLES: bool = true;
    type Input = (Arc<Photo>, Vec<Arc<PhotoMap>>);
    type Output = (Picture,);

    fn memory(&self) -> Vec<MemoryCost> {
        vec![MemoryCost { what: "the result", frames: 1.0, ..MemoryCost::default() }]
    }

    fn run(&self, (photo, maps): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let Some(lattice) = lattice(&photo, maps.into_iter().next(), self) else { return Ok((Picture::Made(photo),)) };
        for warning in photo.without_pixels(lattice.size()).warnings {
            context.warn(warning);
        }
        let (settings, run) = (self.clone(), context.job.run());
        let unsampled = Unsampled { photo, lattice, settings, run, made: OnceLock::new() };
        Ok((Picture::Unsampled(Arc::new(unsampled)),))
    }
}

/// A picture through a map, before any of its pixels was made.
pub struct Unsampled {
    photo: Arc<Photo>,
    lattice: Lattice,
    settings: ImageRenderSettings,
    run: Run,
    made: OnceLock<Arc<Photo>>,
}

impl Unsampled {
    /// Width and height, px.
    pub(super) fn size(&self) -> (usize, usize) {
        self.lattice.size()
    }

    /// The picture, made once.
    pub(super) fn photo(&self) -> Result<Arc<Photo>, RenderError> {
        if let Some(made) = self.made.get() {
            return Ok(made.clone());
        }
        let made = through(&self.photo, &self.lattice, &self.settings, &self.run)?;
        Ok(self.made.get_or_init(|| Arc::new(made)).clone())
    }

    /// Writes the picture, as it is made where it was not made before.
    pub(super) fn encode(
        &self,
        format: StillFormat,
        options: SaveOptions,
        out: impl Write + Seek,
    ) -> Result<Result<Saved, StillError>, RenderError> {
        match self.made.get() {
            Some(made) => Ok(encode(made, format, options, out)),
            None => written(&self.photo, &self.lattice, &self.settings, (format, options), out, &self.run),
        }
    }
}

/// Writes the picture through a lattice, with its gain map: row by row as they are made, where each has its border by itself.
pub(super) fn written(
    photo: &Photo,
    lattice: &Lattice,
    settings: &ImageRenderSettings,
    (format, options): (StillFormat, SaveOptions),
    out: impl Write + Seek,
    run: &Run,
) -> Result<Result<Saved, StillError>, RenderError> {
    if settings.border.is_of_the_whole() {
        return Ok(encode(&through(photo, lattice, settings, run)?, format, options, out));
    }
    let renderer = renderer(settings);
    let rendering = StillRendering::new(&renderer, &photo.frame, lattice)?;
    let mut head = photo.without_pixels(lattice.size());
    head.gain_map = gain_map(photo, lattice, &renderer, run)?;
    Ok(rendering.encode(&head, format, options, out, run))
}

/// Where the pixels of the result come from; `None` where the picture stays as it is.
pub(super) fn lattice(photo: &Photo, map: Option<Arc<PhotoMap>>, settings: &ImageRenderSettings) -> Option<Lattice> {
    let source = (photo.frame.width, photo.frame.height);
    let natural = map.as_ref().map_or(source, |m| m.warp.size);
    let size = settings.size.map_or(natural, |size| size.pixels(natural));
    match map {
        None if size == source => None,
        Some(map) if size == natural => Some(Lattice::between(&map.warp.field, size, source)),
        map => Some(Lattice::between(&resized(map, natural, size), size, source)),
    }
}

/// The picture through a lattice, with its gain map.
fn through(photo: &Photo, lattice: &Lattice, settings: &ImageRenderSettings, run: &Run) -> Result<Photo, RenderError> {
    let mut made = photo.with_frame(sampled(&photo.frame, lattice, settings, run)?);
    made.gain_map = gain_map(photo, lattice, &renderer(settings), run)?;
    Ok(made)
}

/// The gain map of a picture through the lattice that shows the picture. Where nothing is shown, nothing shines.
fn gain_map(photo: &Photo, lattice: &Lattice, renderer: &Renderer, run: &Run) -> Result<Option<GainMap>, RenderError> {
    let whole = (photo.frame.width, photo.frame.height);
    photo.gain_map.as_ref().map(|map| map.rendered(lattice, whole, renderer, run)).transpose()
}

/// The picture through a lattice, and what fills the rest.
pub(super) fn sampled(
    frame: &Frame,
    lattice: &Lattice,
    settings: &ImageRenderSettings,
    run: &Run,
) -> Result<Frame, RenderError> {
    let renderer = renderer(settings);
    if !settings.border.is_of_the_whole() {
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

/// A map that others use too.
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
            video_render::Interpolation::Bicubic => Interpolation::Bicubic,
            video_render::Interpolation::Lanczos3 => Interpolation::Lanczos3,
        },
        border: match settings.border {
            PhotoBorder::Black | PhotoBorder::Transparent | PhotoBorder::Fill => Border::Black,
            PhotoBorder::Mirror => Border::Mirror,
            PhotoBorder::Replicate => Border::Replicate,
        },
    }
}

pub(super) fn render_error(context: &Context<'_, '_>, error: &RenderError) -> RunError {
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
        let warp = PhotoWarp::new(field, (100, 50), mesh, forward);
        Arc::new(PhotoMap { warp, report: serde_json::Map::new() })
    }

    #[test]
    fn a_resize_acts_on_the_output_and_the_map_behind_it() {
        let field = resized(Some(shifted()), (100, 50), (200, 25));
        assert_eq!(field.map(Point2::new(20.0, 10.0)), Some(Point2::new(15.0, 17.0)));
        let plain = resized(None, (100, 50), (200, 25));
        assert_eq!(plain.map(Point2::new(200.0, 25.0)), Some(Point2::new(100.0, 50.0)));
    }
}
