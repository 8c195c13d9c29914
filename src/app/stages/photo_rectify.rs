//! `photo.rectify`: the map that makes lines straight and keeps shapes.

use std::sync::Arc;

use serde_json::{Map, json};

use super::lines_detect::line_search;
use super::photo::lens::{self, LensRequest, lens_file};
use super::photo::{rectangle, rectified, rects, report_lines, view};
use super::prelude::*;
use super::values::{LineSet, PhotoMap};
use crate::pipeline::sizes::{PictureSize, TargetSize, ViewAngles, ViewField};
use plumbline_camera::{FieldAxis, Lens, Projection};
use plumbline_image::feature::{Face, Importance};
use plumbline_image::still::Photo;
use plumbline_photo::line_detection::LineConstraints;
use plumbline_photo::rectify::{Crop, OutputSize, RectifyInput, RectifyOptions, Target, Window};
use plumbline_photo::{PhotoWarp, measure_straightness};

/// Settings of `photo.rectify`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoRectifySettings {
    /// How directions become the picture: optimized, perspective, stereographic, panini, panini:D, mercator, cylindrical or equirectangular
    pub to: Target,
    /// The lens: auto (EXIF, profiles, the lines themselves), a file (lensfun XML, OpenCV or Kalibr YAML, Gyroflow JSON, COLMAP cameras.txt, OCam, our own JSON), or a model such as equidistant, to be given with its field of view
    #[schemars(extend("format" = "lens"))]
    pub lens: String,
    /// Field of view, degrees, for a lens named by its model; found from lines or EXIF if left out
    #[schemars(range(min = 1.0, max = 360.0))]
    pub fov: Option<f64>,
    /// The direction along which the field of view is measured
    pub fov_axis: FieldAxis,
    /// View direction relative to the camera's, degrees: yaw, pitch, roll
    pub view: ViewAngles,
    /// Field of view of the result, degrees, such as 100,75; that of the picture if left out, and 100,75 for panoramas
    pub view_field: Option<ViewField>,
    /// Crop: auto shows all that a straight border can without bending what continues lines, W:H takes the largest of this aspect ratio, rectangle the largest rectangle inside a free border, none keeps the curved border
    pub crop: Crop,
    /// Size of the result: 1600x1200, 800x, x600 or 60%; if left out, pictures stay as wide as they are, and clips keep their size
    pub size: Option<PictureSize>,
}

impl Default for PhotoRectifySettings {
    fn default() -> Self {
        Self {
            to: Target::default(),
            lens: "auto".to_owned(),
            fov: None,
            fov_axis: FieldAxis::default(),
            view: ViewAngles::default(),
            view_field: None,
            crop: Crop::default(),
            size: None,
        }
    }
}

impl PhotoRectifySettings {
    /// The size that a rectangle made of a stitched picture gets.
    pub fn rectangle_size(&self) -> Option<TargetSize> {
        match (self.size, self.crop) {
            (Some(size), _) => Some(TargetSize::Size(size)),
            (None, Crop::Aspect(ratio)) => Some(TargetSize::Shape(ratio)),
            (None, _) => None,
        }
    }
}

impl Stage for PhotoRectifySettings {
    const KIND: &'static str = "photo.rectify";
    const SUMMARY: &'static str = "finds the map that makes lines straight and keeps shapes";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture"),
        Port::any("lines", PortType::Lines, "lines to make straight"),
        Port::optional("faces", PortType::Faces, "faces to keep in shape"),
        Port::optional("importance", PortType::Importance, "where distortion would show"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("warp", PortType::Warp, "the map")];
    const MAP: Option<MapStep> = Some(MapStep::Photo);
    type Input = (Arc<Photo>, Vec<LineSet>, Option<Arc<[Face]>>, Option<Arc<Importance>>);
    type Output = (Arc<PhotoMap>,);

    fn reads(&self) -> Vec<&str> {
        lens_file(&self.lens).into_iter().collect()
    }

    fn memory(&self) -> Vec<MemoryCost> {
        vec![MemoryCost { what: "grid and factor", bytes: 64 << 20, ..MemoryCost::default() }]
    }

    fn run(
        &self,
        (photo, lines, faces, importance): Self::Input,
        context: &mut Context<'_, '_>,
    ) -> Result<Self::Output, RunError> {
        let set = LineSet::all(lines);
        let faces = rects(faces.as_deref());
        // The lens: of the lines, or found. Without one a stitched picture becomes a rectangle.
        let found = match &set.lens {
            Some(found) => Some(Arc::clone(found)),
            None => lens::find_unless_stitched(&photo, &set.lines, LensRequest::of_rectify(self), &context.job.run())?
                .map(Arc::new),
        };
        let Some(found) = found else {
            let note = "no lens is known, and the picture looks stitched: its irregular border was made a rectangle";
            context.warn(note.to_owned());
            return Ok((Arc::new(rectangle::make(context, &photo, &set.lines, &faces, self.rectangle_size())?),));
        };
        found.warnings.iter().for_each(|w| context.warn(w.clone()));
        context.job.check_cancel()?;
        // The map, in a size that may depend on that of the result.
        let search = set.searched.and_then(|searched| searched.of(&photo)).or_else(|| line_search(&photo.frame));
        let LineConstraints { lines, soft } = match &search {
            Some(search) if set.found => search.of_found(set.lines, &found.lens, &faces),
            Some(search) => search.of_marked(&set.lines, &found.lens, &faces, &context.job.run())?,
            None => LineConstraints { lines: set.lines, soft: Vec::new() },
        };
        let input = RectifyInput {
            lens: &found.lens,
            lines: &lines,
            soft_lines: &soft,
            found: set.found,
            faces: &faces,
            saliency: importance.as_ref().map(|i| i.plane()),
        };
        let wanted = |natural| self.size.map_or(natural, |size| size.pixels(natural));
        let mut warp = rectified(&input, &options(self, &found.lens), wanted, &context.job.run())?;
        if let Some(search) = &search {
            let size = (photo.frame.width, photo.frame.height);
            measure_straightness(&mut warp, &lines, Some(&found.lens), search.levels().as_ref(), size);
        }
        context.job.check_cancel()?;
        // The summary and the report.
        context.summary.lens = Some(found.named());
        // Of a panorama, and of a view that was asked for, there is no whole to show.
        let source = (photo.frame.width as f64, photo.frame.height as f64);
        if !found.lens.projection.is_panoramic() && self.view_field.is_none() {
            context.summary.source_shown = Some(warp.source_shown(source));
        }
        report_lines(context, &warp.lines, &[]);
        warn_of_bound(context, &warp);
        warn_of_cut_people(context, &warp);
        let mut report = Map::new();
        report.insert("source_shown".into(), json!(context.summary.source_shown));
        let lens = &found.lens;
        report.insert(
            "lens".into(),
            json!({
                "found": found.how,
                "width_deg": found.width().map(f64::to_degrees),
                "width_sigma_deg": found.sigma().map(f64::to_degrees),
                "projection": lens.projection.name(),
                "focal_px": [lens.focal.x, lens.focal.y],
                "center_px": [lens.center.x, lens.center.y],
            }),
        );
        report.insert("faces".into(), faces.len().into());
        Ok((Arc::new(PhotoMap { warp, report }),))
    }
}

/// What a view of a panorama shows unless said otherwise.
const PANORAMA_VIEW: ViewField = ViewField { width: 100.0, height: 75.0 };

/// Says that a view has fewer pixels than its center asks for.
fn warn_of_bound(context: &mut Context<'_, '_>, warp: &PhotoWarp) {
    if let Some((width, height)) = warp.bounded_from {
        let (w, h) = warp.size;
        context.warn(format!(
            "the view would have {width}×{height} px at its center's density, more than the source has; it was made \
             {w}×{h} px (--size sets another)"
        ));
    }
}

/// Says which faces the crop could not keep, and below which it cuts the body.
fn warn_of_cut_people(context: &mut Context<'_, '_>, warp: &PhotoWarp) {
    let bodies: Vec<usize> = warp.cut_below.iter().copied().filter(|k| !warp.cut_faces.contains(k)).collect();
    for (cut, what) in [(&warp.cut_faces, "face"), (&bodies, "the body below face")] {
        if !cut.is_empty() {
            let numbers: Vec<String> = cut.iter().map(|k| (k + 1).to_string()).collect();
            context.warn(format!(
                "the output does not show all of {what} {}: no such rectangle contains all people; --crop none keeps them",
                numbers.join(", ")
            ));
        }
    }
}

pub(super) fn options(settings: &PhotoRectifySettings, lens: &Lens) -> RectifyOptions {
    RectifyOptions {
        target: settings.to.clone(),
        view: view(settings.view),
        window: window(settings, lens),
        crop: settings.crop,
        // A size relative to the result is known once that was made.
        size: settings.size.and_then(PictureSize::exact).map_or(OutputSize::Source, |(w, h)| OutputSize::Exact(w, h)),
        ..RectifyOptions::default()
    }
}

/// What the view shows. Of a panorama no flat picture shows all, save for the panoramas themselves.
fn window(settings: &PhotoRectifySettings, lens: &Lens) -> Option<Window> {
    let panoramic = lens.projection.is_panoramic();
    let all = matches!(
        settings.to,
        Target::Fixed(Projection::Mercator | Projection::Cylindrical | Projection::Equirectangular)
    );
    let field = settings.view_field.or_else(|| (panoramic && !all).then_some(PANORAMA_VIEW))?;
    let half = |degrees: f64| 0.5 * degrees.to_radians();
    Some(Window { half_width: half(field.width), half_height: half(field.height) })
}
