//! Frames before and after, taken while the result is made.

use super::in_plane::{Window, Windows};
use super::shown::Shown;
use crate::pipeline::run_error::RunError;
use crate::report::{Change, Moment, Picture, View};
use crate::stages::ReportSettings;
use crate::stages::clip::sampling::Sampled;
use crate::stages::context::Context;
use plumbline_media::{Ratio, VideoInfo};
use plumbline_video::motion::ClipMotion;
use plumbline_video::path::VirtualPath;

/// Moments of a clip that are shown: enough to see each part of it, few enough for a page.
const MOMENTS: usize = 6;

/// Longest side of a picture, px.
const MAX_PX: usize = 640;

/// Pictures of a few moments.
pub(crate) struct Album {
    view: View,
    /// Frames to keep, in order.
    wanted: Vec<usize>,
    /// Frames that went by.
    seen: usize,
    kept: Vec<(usize, Change<Picture>)>,
}

impl Album {
    /// The name under which the album of a stage's pictures is kept.
    pub(crate) const PORT: &'static str = "album";

    /// An empty album, if a report is among the stages `takers` of the pictures of `video`.
    pub(crate) fn wanted(
        context: &Context<'_, '_>,
        takers: &[usize],
        video: &VideoInfo,
    ) -> Result<Option<Self>, RunError> {
        let report = takers.iter().find(|s| context.stage(**s).settings.get::<ReportSettings>().is_some());
        let Some(&report) = report else { return Ok(None) };
        let motion: &ClipMotion = context.values.get(context.required(report, "motion")?)?;
        let path: &VirtualPath = context.values.get(context.required(report, "path")?)?;
        let windows = Windows::of(motion, path, Shown::of(video));
        let view = View {
            most_px: MAX_PX,
            rotation_deg: video.rotation_deg,
            mirrored: video.mirrored,
            pixel_aspect: video.sample_aspect.map_or(1.0, Ratio::value),
        };
        let wanted = moments(motion.frames.len(), |frame| windows.moved(frame));
        Ok(Some(Self { view, wanted, seen: 0, kept: Vec::new() }))
    }

    /// How a player shows the clip.
    pub(super) fn shown(&self) -> Shown {
        Shown { rotation_deg: self.view.rotation_deg, mirrored: self.view.mirrored }
    }

    /// Keeps the next frame if it is wanted.
    pub(crate) fn look(&mut self, sampled: &Sampled) {
        let frame = self.seen;
        self.seen += 1;
        if self.wanted.binary_search(&frame).is_err() {
            return;
        }
        let before = Picture::of(sampled.original(), &self.view);
        let pair = before.zip(Picture::of(&sampled.result, &self.view));
        self.kept.extend(pair.map(|(before, after)| (frame, Change { before, after })));
    }

    /// The pictures, with what was done to each.
    pub(super) fn moments(&self, windows: &Windows, path: &VirtualPath) -> Vec<Moment> {
        let moment = |(frame, pictures): &(usize, Change<Picture>)| {
            let window = windows.frames.get(*frame).copied().flatten();
            let crop = path.crop.get(*frame).map_or(1.0, |c| c.min(1.0));
            Moment {
                frame: *frame,
                what: window.map_or_else(String::new, |w| words(&w, crop)),
                pictures: pictures.clone(),
            }
        };
        self.kept.iter().map(moment).collect()
    }
}

/// Of the middle of each of equal parts of a clip the frame that was moved most; of frames that were moved alike, the one
/// nearest to the middle.
fn moments(frames: usize, moved: impl Fn(usize) -> f64) -> Vec<usize> {
    let parts = MOMENTS.min(frames);
    let of_part = |k: usize| {
        let (start, end) = (frames * k / parts, frames * (k + 1) / parts);
        let (middle, quarter) = (usize::midpoint(start, end), (end - start) / 4);
        (start + quarter..end - quarter)
            .min_by(|a, b| moved(*b).total_cmp(&moved(*a)).then(a.abs_diff(middle).cmp(&b.abs_diff(middle))))
    };
    (0..parts).filter_map(of_part).collect()
}

/// What a window does to the picture, for the reader.
fn words(window: &Window, crop: f64) -> String {
    let toward = |v: f64, negative, positive| {
        let direction = if v < 0.0 { negative } else { positive };
        (v.abs() >= 0.05).then(|| format!("{:.1} px {direction}", v.abs()))
    };
    // The picture goes against the window.
    let shifts = [toward(-window.shift.x, "left", "right"), toward(-window.shift.y, "up", "down")];
    let shifts: Vec<String> = shifts.into_iter().flatten().collect();
    let degrees = -window.rotation.to_degrees();
    let direction = if degrees < 0.0 { "counterclockwise" } else { "clockwise" };
    let moved = (!shifts.is_empty()).then(|| format!("moved {}", shifts.join(" and ")));
    let rotated = (degrees.abs() >= 0.005).then(|| format!("rotated {:.2}° {direction}", degrees.abs()));
    let kept = (crop < 0.9995).then(|| format!("{:.1} % of width and height kept", 100.0 * crop));
    let done: Vec<String> = [moved, rotated, kept].into_iter().flatten().collect();
    if done.is_empty() { "left as it is".to_owned() } else { done.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_num::math::Vec2;

    #[test]
    fn moments_are_spread_over_the_clip_and_show_what_was_moved_most() {
        let moved = |frame: usize| if frame % 10 == 6 { frame as f64 } else { 1.0 };
        assert_eq!(moments(60, moved), [6, 16, 26, 36, 46, 56]);
        assert_eq!(moments(60, |_| 0.0), [5, 15, 25, 35, 45, 55]);
        assert_eq!(moments(3, |_| 0.0), [0, 1, 2]);
        assert_eq!(moments(0, |_| 0.0), [0_usize; 0]);
        assert_eq!(moments(7, |_| f64::NAN).len(), 6);
    }

    #[test]
    fn what_was_done_is_told_as_the_picture_is_seen_to_move() {
        let window = Window { shift: Vec2::new(12.34, -4.0), rotation: 0.01, zoom: 1.1 };
        let wanted =
            "moved 12.3 px left and 4.0 px down, rotated 0.57° counterclockwise, 91.2 % of width and height kept";
        assert_eq!(words(&window, 0.912), wanted);
        assert_eq!(words(&Window { shift: Vec2::zeros(), rotation: 0.0, zoom: 1.0 }, 1.0), "left as it is");
    }
}
