//! A sample of observations sufficient for the cameras of a shot.
//!
//! Trackers follow a thousand points per frame, many of them close together and for hundreds of frames. Cameras are
//! determined equally well by a few hundred that are spread over the image. Eliminating a point observed in `L` frames
//! costs `L²`, and the reduced system is as wide as the longest track, so long tracks cost most, while they carry
//! little more information than two of half their length. An adjustment of a whole shot therefore uses a sample:
//!
//! - a point is selected if in most of its frames its grid cell still needs observations; points observed in many
//!   frames come first;
//! - a track longer than [`MAX_FRAMES`] is cut into pieces, each a point of its own. Tracks are cut at different
//!   frames, so that two frames `d` apart share the fraction `1 − d/MAX_FRAMES` of their common points.
//!
//! Afterwards all points are refined with the estimated cameras fixed.

use super::{Observation, Scene, ScenePoint, TrackTable};

/// Columns and rows of the grid over which observations are spread.
const CELLS: (usize, usize) = (8, 5);
/// Maximum number of frames of a piece. Pieces of 32 to 96 frames and whole tracks give equally accurate cameras on
/// tracked clips: trackers drift, and a long track relates far frames only up to that drift.
const MAX_FRAMES: usize = 48;

/// Number of observations below which a track is selected only by frames with less than half of their target. Most of
/// the information of a short track is used up by its own position, and its poorly constrained depth changes
/// erratically between steps.
const SHORT: usize = 8;

/// A scene with a subset of the points, long tracks cut into pieces, and the observations of those.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    pub(super) scene: Scene,
    pub(super) observations: Vec<Observation>,
}

impl Sample {
    /// Samples the known points of a scene and their observations in its known frames.
    pub(super) fn of(table: &TrackTable, scene: &Scene, per_frame: usize) -> Self {
        let chosen = chosen(table, scene, per_frame);
        let mut sample = Self { scene: Scene { points: Vec::new(), ..scene.clone() }, observations: Vec::new() };
        for point in chosen {
            sample.add(table, scene, point);
        }
        sample
    }

    /// Adds a point as one or more pieces.
    fn add(&mut self, table: &TrackTable, scene: &Scene, point: usize) {
        let Some(position) = scene.points[point] else { return };
        let seen: Vec<&Observation> = known_observations(table, scene, point).collect();
        let (Some(first), Some(last)) = (seen.first(), seen.last()) else { return };
        if ((last.frame - first.frame) as usize) < MAX_FRAMES {
            self.push(position, &seen);
            return;
        }
        // Multiples of the golden ratio are evenly distributed modulo 1, whatever their number.
        let shift = (point as f64 * 0.618_033_988_749_895).fract() * MAX_FRAMES as f64;
        let piece = |o: &&Observation| (o.frame as usize + shift as usize) / MAX_FRAMES;
        for part in seen.chunk_by(|a, b| piece(a) == piece(b)).filter(|part| part.len() > 2) {
            if let Some(position) = anchored_at(&position, part[0].frame, scene) {
                self.push(position, part);
            }
        }
    }

    fn push(&mut self, position: ScenePoint, seen: &[&Observation]) {
        let point = self.scene.points.len() as u32;
        self.scene.points.push(Some(position));
        self.observations.extend(seen.iter().map(|o| Observation { point, ..**o }));
    }
}

fn known_observations<'a>(
    table: &'a TrackTable,
    scene: &'a Scene,
    point: usize,
) -> impl Iterator<Item = &'a Observation> {
    table.of_point(point).filter(|o| scene.poses[o.frame as usize].is_some())
}

/// The same point with another frame as anchor; `None` if it is behind that frame's camera.
fn anchored_at(position: &ScenePoint, frame: u32, scene: &Scene) -> Option<ScenePoint> {
    let (pose, anchor) = (scene.poses[frame as usize]?, scene.poses[position.anchor as usize]?);
    let seen = position.scaled_in(&pose, &anchor);
    (seen.z > 0.0).then(|| ScenePoint {
        anchor: frame,
        ray: seen.xy() / seen.z,
        inverse_depth: position.inverse_depth / seen.z,
    })
}

/// Indices of the selected points, ascending.
fn chosen(table: &TrackTable, scene: &Scene, per_frame: usize) -> Vec<usize> {
    let length = |p: usize| known_observations(table, scene, p).count();
    let known = (0..table.points()).filter(|&p| scene.points[p].is_some());
    let mut order: Vec<(usize, usize)> = known.map(|p| (length(p), p)).filter(|(length, _)| *length > 1).collect();
    order.sort_unstable_by_key(|&(length, p)| (std::cmp::Reverse(length.min(MAX_FRAMES)), scattered(p)));
    let mut selection = Selection::new(table.frames(), per_frame);
    let mut taken = Vec::new();
    for (length, point) in order {
        let wanted = |o: &&Observation| {
            if length < SHORT { selection.is_starved(o) } else { selection.wants(o, table.cell(o.pixel, CELLS)) }
        };
        if 2 * known_observations(table, scene, point).filter(wanted).count() >= length {
            known_observations(table, scene, point).for_each(|o| selection.take(o, table.cell(o.pixel, CELLS)));
            taken.push(point);
        }
    }
    taken.sort_unstable();
    taken
}

/// Observations selected so far.
struct Selection {
    per_frame: usize,
    in_cell: Vec<usize>,
    in_frame: Vec<usize>,
}

impl Selection {
    fn new(frames: usize, per_frame: usize) -> Self {
        Self { per_frame, in_cell: vec![0; frames * CELLS.0 * CELLS.1], in_frame: vec![0; frames] }
    }

    fn wants(&self, o: &Observation, cell: usize) -> bool {
        self.in_cell[o.frame as usize * CELLS.0 * CELLS.1 + cell] * CELLS.0 * CELLS.1 < self.per_frame
    }

    fn is_starved(&self, o: &Observation) -> bool {
        2 * self.in_frame[o.frame as usize] < self.per_frame
    }

    fn take(&mut self, o: &Observation, cell: usize) {
        self.in_cell[o.frame as usize * CELLS.0 * CELLS.1 + cell] += 1;
        self.in_frame[o.frame as usize] += 1;
    }
}

/// A hash of the index, independent of the position and the frames of the point.
fn scattered(point: usize) -> u32 {
    (point as u32).wrapping_mul(0x9E37_79B9)
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_camera::{CameraPose, Intrinsics, Vec3};
    use plumbline_num::math::{Point2, Vec2};

    /// Points at depth 5 seen by a camera that moves sideways, `count` new ones every frame, each for `life` frames.
    fn walk(frames: usize, count: usize, life: usize) -> (TrackTable, Scene) {
        let mut random = fastrand::Rng::with_seed(3);
        let intrinsics = Intrinsics::centered(576.0, 640, 360);
        let pose =
            |f: usize| CameraPose { translation: Vec3::new(-0.01 * f as f64, 0.0, 0.0), ..CameraPose::identity() };
        let mut seen: Vec<Vec<(u32, Point2)>> = vec![Vec::new(); frames];
        let mut points = Vec::new();
        let births = (0..frames).flat_map(|f| std::iter::repeat_n(f, if f == 0 { count * life } else { count }));
        for (id, birth) in births.enumerate() {
            let ray = Vec2::new(1.1 * random.f64() - 0.55, 0.6 * random.f64() - 0.3);
            let point = ScenePoint { anchor: birth as u32, ray, inverse_depth: 0.2 };
            // The tracks of the first frame end one by one.
            let end = if birth == 0 { 3 + id * (life - 3) / (count * life) } else { birth + life };
            for (frame, list) in seen.iter_mut().enumerate().take(end.min(frames)).skip(birth) {
                let y = point.scaled_in(&pose(frame), &pose(birth));
                list.push((id as u32, intrinsics.project(&y.into()).expect("in front")));
            }
            points.push(Some(point));
        }
        let table = TrackTable::new(640, 360, seen);
        let known = (0..table.points()).map(|p| points[table.id(p as u32) as usize]).collect();
        let poses = (0..frames).map(|f| Some(pose(f))).collect();
        (table, Scene { intrinsics, readout: 0.0, poses, points: known })
    }

    fn per_frame(sample: &Sample) -> Vec<usize> {
        let mut counts = vec![0; sample.scene.poses.len()];
        sample.observations.iter().for_each(|o| counts[o.frame as usize] += 1);
        counts
    }

    #[test]
    fn every_frame_keeps_about_the_requested_observations_spread_over_the_cells() {
        let (table, scene) = walk(60, 40, 20);
        let sample = Sample::of(&table, &scene, 200);
        for (frame, count) in per_frame(&sample).into_iter().enumerate().take(57).skip(3) {
            let had = table.in_frame(frame).len();
            assert!(had > 300 && (120..320).contains(&count), "frame {frame}: {count} of {had}");
        }
        let mut cells = vec![0; CELLS.0 * CELLS.1];
        sample.observations.iter().filter(|o| o.frame == 30).for_each(|o| cells[table.cell(o.pixel, CELLS)] += 1);
        assert!(cells.iter().all(|c| *c > 0) && cells.iter().all(|c| *c < 20), "{cells:?}");
    }

    #[test]
    fn frames_that_see_little_keep_it_all() {
        let (table, scene) = walk(30, 6, 5);
        let sample = Sample::of(&table, &scene, 400);
        assert_eq!(sample.observations.len(), table.observations().len());
    }

    #[test]
    fn the_pieces_of_a_long_track_are_the_same_point_and_no_two_tracks_are_cut_alike() {
        let (table, scene) = walk(200, 1, 200);
        let sample = Sample::of(&table, &scene, 400);
        let mut cuts = Vec::new();
        for piece in sample.observations.chunk_by(|a, b| a.point == b.point) {
            assert!(((piece[piece.len() - 1].frame - piece[0].frame) as usize) < MAX_FRAMES);
            cuts.push(piece[0].frame);
            for o in piece {
                let seen = sample.scene.project(o.frame, o.point).expect("in front");
                assert!((seen - o.pixel).norm() < 1e-9, "frame {}", o.frame);
            }
        }
        assert!(
            per_frame(&sample).iter().zip(0..200).all(|(n, f)| *n as f64 >= 0.9 * table.in_frame(f).len() as f64 - 2.0)
        );
        cuts.sort_unstable();
        let together = cuts.chunk_by(|a, b| a == b).filter(|same| same[0] > 0).map(<[u32]>::len).max();
        assert!(cuts.len() > 500 && together < Some(40), "{together:?} of {}", cuts.len());
    }
}
