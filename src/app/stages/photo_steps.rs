//! The steps of rectifying a photo, one call each: for a program that shows the result while settings change. The stages make the
//! same calls, so that their pipeline gives what was shown.

use std::io::{Seek, Write};
use std::path::Path;
use std::sync::Arc;

use serde_json::Map;

pub use super::lines_detect::line_search;
pub use super::photo::lens::{Found as FoundLens, LensClues, LensRequest, find as find_lens};
use super::values::PhotoMap;
use super::{
    ImageRenderSettings, ImageSaveSettings, PhotoRectifySettings, image_load, image_render, photo, photo_rectify,
};
use crate::pipeline::paths::to_path;
use crate::pipeline::run_error::RunError;
use plumbline_camera::Lens;
use plumbline_image::Frame;
use plumbline_image::render::RenderError;
use plumbline_image::still::{Photo, Saved, StillError};
use plumbline_num::run::Run;
use plumbline_photo::PhotoWarp;
use plumbline_photo::rectify::{RectifyInput, RectifyOptions};

/// Reads a picture as `image.load` does, on so many threads.
///
/// # Errors
/// [`RunError`]: a file that is no picture, is damaged or has too many pixels.
pub fn load(path: &Path, max_pixels: u64, threads: usize) -> Result<Photo, RunError> {
    image_load::read(path, max_pixels, threads)
}

/// What `photo.rectify` asks of the library for a lens. A size relative to the result is not in them.
pub fn rectify_options(settings: &PhotoRectifySettings, lens: &Lens) -> RectifyOptions {
    photo_rectify::options(settings, lens)
}

/// The map that `photo.rectify` makes.
///
/// # Errors
/// As [`plumbline_photo::rectify::rectify`].
pub fn rectified(input: &RectifyInput<'_>, settings: &PhotoRectifySettings, run: &Run) -> Result<PhotoWarp, RunError> {
    let wanted = |natural| settings.size.map_or(natural, |size| size.pixels(natural));
    photo::rectified(input, &rectify_options(settings, input.lens), wanted, run)
}

/// Writes the picture that `image.render` makes, as `image.save` does.
///
/// # Errors
/// [`RunError`]: a picture that is too large to render or for the format, an interruption, the disk.
pub fn written(
    photo: &Photo,
    warp: PhotoWarp,
    (render, save): (&ImageRenderSettings, &ImageSaveSettings),
    out: impl Write + Seek,
    run: &Run,
) -> Result<Saved, RunError> {
    let (path, map) = (to_path(&save.path), Arc::new(PhotoMap { warp, report: Map::new() }));
    let said = |e: StillError| photo::still_error(&path, &e);
    let file = save.file().map_err(said)?;
    let lattice = image_render::lattice(photo, Some(map), render);
    let lattice = lattice.ok_or_else(|| RunError::Internal("a picture with a map was not rendered".to_owned()))?;
    image_render::written(photo, &lattice, render, file, out, run).map_err(render_error)?.map_err(said)
}

/// A part of what `image.render` makes, at any scale: `lattice` says where its pixels come from.
///
/// # Errors
/// As [`written`].
pub fn rendered_part(
    frame: &Frame,
    lattice: &plumbline_image::warp::Lattice,
    settings: &ImageRenderSettings,
    run: &Run,
) -> Result<Frame, RunError> {
    image_render::sampled(frame, lattice, settings, run).map_err(render_error)
}

fn render_error(error: RenderError) -> RunError {
    match error {
        RenderError::Interrupted(stopped) => stopped.into(),
        error => RunError::Input(error.to_string()),
    }
}
