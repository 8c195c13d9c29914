//! What moves on its own in a clip: people, cars, captions that are laid over the picture.

use std::collections::BTreeMap;

use super::error::StabilizeError;
use super::tracks::Tracks;
use crate::motion::ClipMotion;
use crate::path::MovingObject;
use crate::track::Observation;
use plumbline_num::math::{Homography, Point2, Vec2};
use plumbline_num::run::Run;

/// Columns and rows of the cells whose points are taken together; as those of the motion estimation.
const COLS: usize = 16;
const ROWS: usize = 9;
/// Least number of points in a cell: a single one may be a wrong track.
const MIN_POINTS: usize = 2;
/// Distance that the background has moved behind a point that stands still in the picture, as a fraction of the width, before the point is one of a
/// caption or a logo: far more than the shake of a camera on a tripod.
const OVERLAY_PATH: f64 = 0.02;
/// Distance within which such a point stands still, px: the noise of the tracker.
const OVERLAY_NOISE_PX: f64 = 0.5;
/// Weight of a frame in the running mean of a point's velocity: a memory of some seven frames, as that of the motion estimation's drift.
const LEARNING: f64 = 0.15;

/// Per frame, the cells in which points move against the background, with the median of their speeds, and the points of captions and logos, which
/// are elsewhere in any other frame: their speed is infinite. Those slower than `min_speed`, px per frame, are left out: most cells of a clip are.
///
/// # Errors
/// [`StabilizeError::Store`], [`StabilizeError::Interrupted`].
pub(super) fn moving_objects(
    motion: &ClipMotion,
    tracks: &Tracks,
    min_speed: f64,
    run: &Run,
) -> Result<Vec<Vec<MovingObject>>, StabilizeError> {
    let mut velocities = Velocities::default();
    let frame = |t: usize| {
        run.check()?;
        let seen = tracks.store.read(t)?.observations;
        velocities.push(&seen, motion.frames.get(t).map_or(Homography::identity(), |frame| frame.homography));
        let mut objects = velocities.objects((tracks.width, tracks.height));
        objects.retain(|object| object.speed > min_speed);
        objects.shrink_to_fit();
        Ok(objects)
    };
    (0..tracks.store.frames()).map(frame).collect()
}

/// A live point.
struct Point {
    at: Point2,
    /// Mean velocity against the background, px per frame.
    velocity: Vec2,
    /// Where it was first seen.
    origin: Point2,
    /// Length of the background's path behind it since then, px.
    path: f64,
}

/// The live points by track.
#[derive(Default)]
struct Velocities(BTreeMap<u32, Point>);

impl Velocities {
    /// Takes the points of the next frame.
    fn push(&mut self, seen: &[Observation], this_from_last: Homography) {
        let last = std::mem::take(&mut self.0);
        self.0.extend(seen.iter().map(|o| {
            let at = Point2::new(f64::from(o.x), f64::from(o.y));
            let Some(before) = last.get(&o.id) else {
                return (o.id, Point { at, velocity: Vec2::zeros(), origin: at, path: 0.0 });
            };
            let carried = this_from_last.apply(before.at).unwrap_or(at);
            let velocity = before.velocity + LEARNING * (at - carried - before.velocity);
            (o.id, Point { at, velocity, origin: before.origin, path: before.path + (carried - before.at).norm() })
        }));
    }

    fn objects(&self, (width, height): (usize, usize)) -> Vec<MovingObject> {
        let cell_of = |v: f64, size: usize, n: usize| ((v / size as f64 * n as f64).max(0.0) as usize).min(n - 1);
        let mut cells = vec![Vec::new(); COLS * ROWS];
        for Point { at, velocity, .. } in self.0.values() {
            cells[cell_of(at.y, height, ROWS) * COLS + cell_of(at.x, width, COLS)].push((*at, velocity.norm()));
        }
        let stands = |p: &&Point| (p.at - p.origin).norm() < OVERLAY_NOISE_PX && p.path > OVERLAY_PATH * width as f64;
        let overlays = self.0.values().filter(stands).map(|p| MovingObject { at: p.at, speed: f64::INFINITY });
        let object = |mut points: Vec<(Point2, f64)>| {
            if points.len() < MIN_POINTS {
                return None;
            }
            let at = points.iter().map(|p| p.0.coords).sum::<Vec2>() / points.len() as f64;
            let middle = points.len() / 2;
            let speed = points.select_nth_unstable_by(middle, |a, b| a.1.total_cmp(&b.1)).1.1;
            Some(MovingObject { at: at.into(), speed })
        };
        cells.into_iter().filter_map(object).chain(overlays).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_num::math::Similarity2;

    /// The objects after thirty frames in which the camera moves everything by 3 px per frame, and each point by its own speed.
    fn found(points: &[(f32, f32)]) -> Vec<MovingObject> {
        let mut velocities = Velocities::default();
        let camera = Similarity2 { t: Vec2::new(3.0, 0.0), ..Similarity2::IDENTITY };
        for t in 0..30_u16 {
            let seen = points.iter().zip(0..).map(|((x, speed), id)| {
                let x = x + speed * f32::from(t);
                Observation { id, x, y: 20.0, background: true }
            });
            velocities.push(&seen.collect::<Vec<_>>(), camera.to_homography());
        }
        velocities.objects((1280, 360))
    }

    #[test]
    fn objects_move_against_the_background() {
        let found = found(&[(82.0, 5.0), (87.0, 5.0), (400.0, 3.0), (405.0, 3.0), (600.0, 9.0)]);
        let speeds: Vec<f64> = found.iter().map(|o| (o.speed * 10.0).round() / 10.0).collect();
        assert_eq!(speeds, [2.0, 0.0], "{found:?}");
    }

    #[test]
    fn captions_stand_while_the_background_moves() {
        let found = found(&[(400.0, 3.0), (405.0, 3.0), (420.0, 0.0), (700.0, 0.02)]);
        let captions: Vec<f64> = found.iter().filter(|o| o.speed.is_infinite()).map(|o| o.at.x).collect();
        assert_eq!(captions, [420.0], "{found:?}");
    }
}
