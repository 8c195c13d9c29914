//! What the page shows of the document.

use super::PhotoWorkspace;
use super::analysis::length;
use super::document::PhotoDocument;
use super::protocol::{
    FaceInfo, FoundInfo, LensInfo, LineInfo, OrientationSetting, ResultInfo, Selected, SettingsInfo, State,
    Straightness,
};
use super::shown::Shown;
use plumbline_app::stages::photo_steps::FoundLens;
use plumbline_camera::FieldAxis;
use plumbline_num::math::Rect;
use plumbline_photo::{LineReport, Orientation};

pub(super) fn of(workspace: &PhotoWorkspace, document: &PhotoDocument) -> State {
    let said = document.pipeline.said();
    let selection = &workspace.selection;
    let using = match (document.has_lines_in_use(), &said.found) {
        (true, _) => "marked",
        (false, Some(_)) if workspace.lens.is_some() => "found",
        _ => "none",
    };
    State {
        photo: workspace.analysis.info(&workspace.name),
        settings: settings(document),
        lens: workspace.lens.as_ref().map(lens),
        problem: workspace.problem.clone(),
        lines: lines(workspace, document),
        found: found(workspace, document),
        using,
        faces: faces(workspace, document),
        faces_marked: document.faces.is_some(),
        selected: Selected { lines: selection.lines.clone(), point: selection.point, faces: selection.faces.clone() },
        result: workspace.shown.as_ref().map(|Shown { warp, exact }| ResultInfo {
            width: warp.size.0,
            height: warp.size.1,
            exact: *exact,
        }),
    }
}

fn settings(document: &PhotoDocument) -> SettingsInfo {
    let said = document.pipeline.said();
    let word = |value: serde_json::Value| value.as_str().unwrap_or_default().to_owned();
    let text = |value: Result<serde_json::Value, serde_json::Error>| value.map(word).unwrap_or_default();
    let path = plumbline_app::pipeline::paths::to_path(&said.save.path);
    SettingsInfo {
        to: said.map.to.to_string(),
        lens: lens_name(document),
        fov: said.map.fov,
        fov_axis: text(serde_json::to_value(said.map.fov_axis)),
        view: [said.map.view.yaw, said.map.view.pitch, said.map.view.roll],
        view_field: said.map.view_field.map(|field| field.to_string()).unwrap_or_default(),
        crop: said.map.crop.to_string(),
        size: said.map.size.map(|size| size.to_string()).unwrap_or_default(),
        border: text(serde_json::to_value(said.render.border)),
        interpolation: text(serde_json::to_value(said.render.interpolation)),
        path: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        quality: said.save.quality,
    }
}

/// The lens as it is written: a file of the pipeline's folder by its name.
fn lens_name(document: &PhotoDocument) -> String {
    let lens = &document.pipeline.said().map.lens;
    let path = plumbline_app::pipeline::paths::to_path(lens);
    let folder = plumbline_num::files::folder_of(document.pipeline.path());
    path.strip_prefix(folder).map_or_else(|_| lens.clone(), |name| name.to_string_lossy().into_owned())
}

fn lens(found: &FoundLens) -> LensInfo {
    let lens = &found.lens;
    let degrees = |axis| lens.field_of_view(axis).map(|field| field.radians.to_degrees());
    LensInfo {
        how: found.how.clone(),
        projection: lens.projection.name().to_owned(),
        focal_px: [lens.focal.x, lens.focal.y],
        center_px: [lens.center.x, lens.center.y],
        field_deg: [FieldAxis::Horizontal, FieldAxis::Vertical, FieldAxis::Diagonal].map(degrees),
    }
}

fn lines(workspace: &PhotoWorkspace, document: &PhotoDocument) -> Vec<LineInfo> {
    // The map reports on lines in use, in their order.
    let mut reports =
        workspace.shown.as_ref().map(|shown| shown.warp.lines.iter()).filter(|_| document.has_lines_in_use());
    let info = |m: &plumbline_photo::marks::MarkedLine| {
        let report = if m.off { None } else { reports.as_mut().and_then(Iterator::next) };
        LineInfo {
            name: m.line.name.clone(),
            orientation: orientation(m.line.orientation),
            off: m.off,
            points: m.line.points.len(),
            report: report.map(straightness),
        }
    };
    document.lines.iter().map(info).collect()
}

fn straightness(report: &LineReport) -> Straightness {
    Straightness {
        max_px: report.max_px,
        rms_px: report.rms_px,
        angle_error_deg: report.angle_error.map(f64::to_degrees),
        off_lens_px: report.off_lens_px,
        shown: report.shown,
        bent: report.is_bent(),
    }
}

fn found(workspace: &PhotoWorkspace, document: &PhotoDocument) -> Option<Vec<FoundInfo>> {
    let without = document.pipeline.said().found.as_ref().map_or(&[][..], |found| &found.without);
    let info = |line: &plumbline_photo::Line| FoundInfo {
        name: line.name.clone(),
        orientation: orientation(line.orientation),
        off: without.contains(&line.name),
        length: length(&line.points),
    };
    Some(workspace.analysis.found.as_ref()?.lines.iter().map(info).collect())
}

fn faces(workspace: &PhotoWorkspace, document: &PhotoDocument) -> Option<Vec<FaceInfo>> {
    let cut = workspace.shown.as_ref().map_or(&[][..], |shown| &shown.warp.cut_faces);
    let rect = |r: &Rect| [r.min.x, r.min.y, r.width(), r.height()];
    if let Some(marked) = &document.faces {
        let mut used = 0..;
        return Some(
            marked
                .iter()
                .map(|face| {
                    let cut = !face.off && used.next().is_some_and(|k| cut.contains(&k));
                    FaceInfo { name: face.name.clone(), rect: rect(&face.rect), off: face.off, cut }
                })
                .collect(),
        );
    }
    let found = workspace.analysis.faces.as_ref()?.iter().enumerate();
    let info = |(k, face): (usize, &plumbline_image::feature::Face)| FaceInfo {
        name: format!("face {}", k + 1),
        rect: rect(&face.rect),
        off: document.pipeline.said().faces_found.is_none(),
        cut: cut.contains(&k),
    };
    Some(found.map(info).collect())
}

fn orientation(orientation: Orientation) -> OrientationSetting {
    match orientation {
        Orientation::Free => OrientationSetting::Word("free".to_owned()),
        Orientation::Horizontal => OrientationSetting::Word("horizontal".to_owned()),
        Orientation::Vertical => OrientationSetting::Word("vertical".to_owned()),
        Orientation::Angle(angle) => OrientationSetting::Degrees(angle.to_degrees()),
    }
}
