//! What the kinds of still pictures share.

pub(crate) mod heif;
pub(crate) mod lens;
pub(crate) mod rectangle;
pub(crate) mod transparency;

use std::path::Path;

use super::context::Context;
use crate::pipeline::run_error::RunError;
use crate::pipeline::sizes::ViewAngles;
use crate::pipeline::summary::LinesSummary;
use plumbline_image::feature::Face;
use plumbline_image::still::{self, LoadOptions, StillError, flattened};
use plumbline_image::{Frame, Plane, analysis_luma};
use plumbline_num::math::Rect;
use plumbline_num::run::Run;
use plumbline_photo::rectify::{OutputSize, Rectifier, RectifyInput, RectifyOptions, Target, View, rectify};
use plumbline_photo::{LineReport, PhotoWarp};

/// Boxes around faces.
pub(crate) fn rects(faces: Option<&[Face]>) -> Vec<Rect> {
    faces.unwrap_or_default().iter().map(|f| f.rect).collect()
}

/// The map of a picture. Where its natural size is not the one that `wanted` makes of it, it is framed again: only the frame
/// depends on the size, and what takes long is solved once.
pub(crate) fn rectified(
    input: &RectifyInput<'_>,
    options: &RectifyOptions,
    wanted: impl FnOnce((usize, usize)) -> (usize, usize),
    run: &Run,
) -> Result<PhotoWarp, RunError> {
    let mut rectifier =
        (options.target == Target::Optimized).then(|| Rectifier::new(input, options, run)).transpose()?;
    let natural = match &rectifier {
        Some(rectifier) => rectifier.warp()?,
        None => rectify(input, options, run)?,
    };
    let (width, height) = wanted(natural.size);
    if (width, height) == natural.size {
        return Ok(natural);
    }
    let size = OutputSize::Exact(width, height);
    let Some(rectifier) = &mut rectifier else {
        return Ok(rectify(input, &RectifyOptions { size, ..options.clone() }, run)?);
    };
    rectifier.set_frame(options.crop, size)?;
    Ok(rectifier.warp()?)
}

/// The gray levels of a frame, 0 to 255, its longer side at most `max_side` px; `None` where its memory does not hold its planes.
pub(crate) fn gray_levels(frame: &Frame, max_side: usize) -> Option<Plane<f32>> {
    let mut luma = Plane::new(0, 0);
    let made = analysis_luma(frame, max_side, &mut luma);
    made.then(|| Plane::from_fn(luma.width(), luma.height(), |x, y| f32::from(luma.as_ref().row(y)[x])))
}

/// Reports how straight lines became, and warns of those that did not; `released` are those that were let go for the others.
pub(crate) fn report_lines(context: &mut Context<'_, '_>, lines: &[LineReport], released: &[String]) {
    let measured = lines.iter().filter(|l| l.edge.is_some()).count();
    // What was measured in the result, where anything was: the residuals of the map say nothing of a wrong lens.
    let judged = lines.iter().filter(|l| measured == 0 || l.edge.is_some());
    let worst = worst_of(judged).map(|l| (l.name.clone(), l.off_px()));
    context.summary.lines = Some(LinesSummary { count: lines.len(), measured, worst });
    for warning in bent_lines(lines, released) {
        context.warn(warning);
    }
}

fn worst_of<'l>(lines: impl Iterator<Item = &'l LineReport>) -> Option<&'l LineReport> {
    lines.max_by(|a, b| a.off_px().total_cmp(&b.off_px()))
}

/// A warning of the lines that were let go, and one of the others that are bent, each with the worst of them.
fn bent_lines(lines: &[LineReport], released: &[String]) -> Vec<String> {
    let (gone, kept): (Vec<_>, Vec<_>) = lines.iter().partition(|l| released.contains(&l.name));
    let bent: Vec<_> = kept.into_iter().filter(|l| l.is_bent()).collect();
    let warning = |(lines, what): (Vec<&LineReport>, &str)| {
        let worst = worst_of(lines.iter().copied())?;
        let (name, max_px) = (&worst.name, worst.off_px());
        Some(match lines.len() {
            1 => format!("line `{name}` {what}: it is off by {max_px:.1} px"),
            count => format!("{count} lines {what}; the worst, `{name}`, is off by {max_px:.1} px"),
        })
    };
    let groups = [(gone, "could not stay straight with the others"), (bent, "could not be made straight")];
    groups.into_iter().filter_map(warning).collect()
}

/// An error of a picture's file in the terms of a run.
pub(crate) fn still_error(path: &Path, error: &StillError) -> RunError {
    let text = format!("{}: {error}", path.display());
    match error {
        StillError::Extension(_) => RunError::Usage(error.to_string()),
        StillError::Layout => RunError::Internal(text),
        StillError::Stopped(stopped) => (*stopped).into(),
        e if e.is_about_output() => RunError::Output(text),
        _ => RunError::Input(text),
    }
}

/// A mask painted by hand. Where it is transparent, nothing was painted: mid-gray, which leaves what was found.
pub(crate) fn painted_mask(path: &Path) -> Result<Frame, RunError> {
    let frame = still::load(path, LoadOptions::default()).map_err(|e| still_error(path, &e))?.frame;
    if !frame.format.alpha {
        return Ok(frame);
    }
    flattened(&frame, 0.5).map_err(|e| still_error(path, &e))
}

/// Degrees to radians.
pub(crate) fn view(angles: ViewAngles) -> View {
    View { yaw: angles.yaw.to_radians(), pitch: angles.pitch.to_radians(), roll: angles.roll.to_radians() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_did_not_become_straight_are_counted_in_one_warning_with_the_worst() {
        let line = |name: &str, max_px| LineReport {
            name: name.to_owned(),
            max_px,
            rms_px: 0.0,
            length_px: 100.0,
            angle: 0.0,
            angle_error: None,
            off_lens_px: None,
            shown: 1.0,
            edge: None,
        };
        let lines = [line("a", 30.0), line("b", 0.1), line("c", 40.5), line("d", 50.0)];
        let released = ["a".to_owned(), "c".to_owned()];
        let expected = [
            "2 lines could not stay straight with the others; the worst, `c`, is off by 40.5 px",
            "line `d` could not be made straight: it is off by 50.0 px",
        ];
        assert_eq!(bent_lines(&lines, &released), expected);
        assert!(bent_lines(&lines[1..2], &[]).is_empty());
    }
}
