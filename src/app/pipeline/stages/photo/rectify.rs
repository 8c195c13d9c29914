//! `photo.rectify`: lens, lines and faces to a map.

use std::sync::Arc;

use serde_json::{Map, json};

use super::lens::{self, Wish};
use super::{PhotoMap, all_lines, picture, rectangle, tell_lines};
use crate::pipeline::kinds::PhotoRectifySettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::sizes::{CropWish, ProjectionWish, ViewAngles, ViewField};
use crate::pipeline::stages::context::Context;
use plumbline_camera::{Lens, Projection};
use plumbline_image::feature::{Face, Importance};
use plumbline_num::math::Rect;
use plumbline_photo::line_detection::off_faces;
use plumbline_photo::rectangle::RectangleShape;
use plumbline_photo::rectify::{
    Crop, OutputSize, RectifyError, RectifyInput, RectifyOptions, Target, View, Window, rectify,
};

/// What a view of a panorama shows unless said otherwise.
const PANORAMA_VIEW: ViewField = ViewField { width: 100.0, height: 75.0 };

/// Finds the map.
pub(super) fn run(
    context: &mut Context<'_, '_>,
    stage: usize,
    settings: &PhotoRectifySettings,
) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let set = all_lines(context, stage)?;
    let faces: Vec<Rect> = match context.edge(stage, "faces") {
        Some(edge) => context.values.get::<Vec<Face>>(edge)?.iter().map(|f| f.rect).collect(),
        None => Vec::new(),
    };
    let lines = if set.found { off_faces(set.lines, &faces) } else { set.lines };
    let salience = match context.edge(stage, "importance") {
        Some(edge) => Some(context.values.get::<Importance>(edge)?.plane().clone()),
        None => None,
    };
    let found = match set.lens {
        Some(found) => Some(found),
        None => {
            lens::find_unless_stitched(&photo, &lines, Wish::of_rectify(settings), &context.job.run())?.map(Arc::new)
        }
    };
    let Some(found) = found else {
        let note = "no lens is known, and the picture looks stitched: its irregular border was made a rectangle";
        context.warn(note.to_owned());
        return rectangle::make(context, stage, &lines, &faces, shape(settings));
    };
    found.warnings.iter().for_each(|w| context.warn(w.clone()));
    context.job.check_cancel()?;
    let input = RectifyInput { lens: &found.lens, lines: &lines, faces: &faces, salience: salience.as_ref() };
    let warp = rectify(&input, &options(settings, &found.lens), &context.job.run()).map_err(|e| rectify_error(&e))?;
    tell_lines(context, &warp.lines);
    tell_cut_faces(context, &warp.cut_faces);
    let mut told = Map::new();
    let lens = &found.lens;
    told.insert(
        "lens".into(),
        json!({
            "found": found.how,
            "projection": lens.projection.name(),
            "focal_px": [lens.focal.x, lens.focal.y],
            "center_px": [lens.center.x, lens.center.y],
        }),
    );
    told.insert("faces".into(), faces.len().into());
    context.values.put(stage, "warp", Arc::new(PhotoMap { warp, told }));
    Ok(())
}

/// The shape of a rectangle for the wishes on size and crop.
fn shape(settings: &PhotoRectifySettings) -> RectangleShape {
    match (settings.size, settings.crop) {
        (Some(size), _) => RectangleShape::Exact(size.width as usize, size.height as usize),
        (None, CropWish::Shape(ratio)) => RectangleShape::Aspect(ratio.value()),
        (None, _) => RectangleShape::Natural,
    }
}

/// Says which faces the crop could not keep.
fn tell_cut_faces(context: &mut Context<'_, '_>, cut: &[usize]) {
    if !cut.is_empty() {
        let numbers: Vec<String> = cut.iter().map(|k| (k + 1).to_string()).collect();
        context.warn(format!(
            "the output does not show all of face {}: no such rectangle holds all faces; --crop none keeps them",
            numbers.join(", ")
        ));
    }
}

fn options(settings: &PhotoRectifySettings, lens: &Lens) -> RectifyOptions {
    RectifyOptions {
        target: target(settings.to),
        view: view(settings.view),
        window: window(settings, lens),
        crop: match settings.crop {
            CropWish::Auto => Crop::Auto,
            CropWish::Rectangle => Crop::Rectangle,
            CropWish::None => Crop::None,
            CropWish::Shape(ratio) => Crop::Aspect(ratio.value()),
        },
        size: settings.size.map_or(OutputSize::Source, |s| OutputSize::Exact(s.width as usize, s.height as usize)),
        ..RectifyOptions::default()
    }
}

/// What the view shows. Of a panorama no flat picture shows all, save for the panoramas themselves.
fn window(settings: &PhotoRectifySettings, lens: &Lens) -> Option<Window> {
    let panoramic = lens.projection.is_panoramic();
    let all =
        matches!(settings.to, ProjectionWish::Mercator | ProjectionWish::Cylindrical | ProjectionWish::Equirectangular);
    let field = settings.view_field.or_else(|| (panoramic && !all).then_some(PANORAMA_VIEW))?;
    let half = |degrees: f64| 0.5 * degrees.to_radians();
    Some(Window { half_width: half(field.width), half_height: half(field.height) })
}

/// The wish in the terms of the method.
pub(in crate::pipeline::stages) fn target(wish: ProjectionWish) -> Target {
    match wish {
        ProjectionWish::Optimized => Target::Optimized,
        ProjectionWish::Perspective => Target::Fixed(Projection::Rectilinear),
        ProjectionWish::Stereographic => Target::Fixed(Projection::Stereographic),
        ProjectionWish::Panini(d) => Target::Fixed(Projection::Panini(d)),
        ProjectionWish::Mercator => Target::Fixed(Projection::Mercator),
        ProjectionWish::Cylindrical => Target::Fixed(Projection::Cylindrical),
        ProjectionWish::Equirectangular => Target::Fixed(Projection::Equirectangular),
    }
}

/// Degrees to radians.
pub(in crate::pipeline::stages) fn view(angles: ViewAngles) -> View {
    View { yaw: angles.yaw.to_radians(), pitch: angles.pitch.to_radians(), roll: angles.roll.to_radians() }
}

fn rectify_error(error: &RectifyError) -> RunError {
    match error {
        RectifyError::Interrupted(stopped) => (*stopped).into(),
        RectifyError::EmptyView | RectifyError::Option { .. } | RectifyError::Size { .. } => {
            RunError::Usage(error.to_string())
        }
        other => RunError::Input(other.to_string()),
    }
}
