//! Sightings enough for the cameras of a shot.
//!
//! Trackers follow a thousand points per frame, many of them side by side and for hundreds of frames. Cameras are known as well
//! from a few hundred that are spread over the picture; and since to eliminate a point that `L` frames see costs `L²`, and the
//! reduced system is as wide as the longest track, long tracks weigh most while they say little more than two of half their
//! length. So an adjustment of a whole shot is given a sample:
//!
//! - points that many frames see first, a point as long as in most of its frames its cell of the picture still wants sightings;
//! - a track longer than [`LONGEST`] cut into pieces, each a point of its own. Cuts of different tracks fall in different frames,
//!   so that two frames `d` apart share the part `1 − d/LONGEST` of the points that both see.
//!
//! Afterwards all points are placed among the cameras found.

use super::{Observation, Scene, ScenePoint, TrackTable};

/// Columns and rows of the cells over which sightings are spread.
const CELLS: (usize, usize) = (8, 5);
/// Frames that a piece spans at most. Pieces of 32 to 96 frames and whole tracks give cameras that are equally good on tracked
/// clips: trackers drift, and what a long track says about far frames it says with that drift.
const LONGEST: usize = 48;

/// A scene with part of the points, long tracks in pieces, and the sightings of those.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    pub(super) scene: Scene,
    pub(super) observations: Vec<Observation>,
}

impl Sample {
    /// Of the known points of a scene, seen in its known frames.
    pub(super) fn of(table: &TrackTable, scene: &Scene, per_frame: usize) -> Self {
        let chosen = chosen(table, scene, per_frame);
        let mut sample = Self { scene: Scene { points: Vec::new(), ..scene.clone() }, observations: Vec::new() };
        for point in chosen {
            sample.add(table, scene, point);
        }
        sample
    }

    /// Adds a point by its pieces.
    fn add(&mut self, table: &TrackTable, scene: &Scene, point: usize) {
        let Some(place) = scene.points[point] else { return };
        let seen: Vec<&Observation> = sightings(table, scene, point).collect();
        let (Some(first), Some(last)) = (seen.first(), seen.last()) else { return };
        if ((last.frame - first.frame) as usize) < LONGEST {
            self.push(place, &seen);
            return;
        }
        // Multiples of the golden section spread evenly whatever their number.
        let shift = (point as f64 * 0.618_033_988_749_895).fract() * LONGEST as f64;
        let piece = |o: &&Observation| (o.frame as usize + shift as usize) / LONGEST;
        for part in seen.chunk_by(|a, b| piece(a) == piece(b)).filter(|part| part.len() > 2) {
            if let Some(place) = anchored_at(&place, part[0].frame, scene) {
                self.push(place, part);
            }
        }
    }

    fn push(&mut self, place: ScenePoint, seen: &[&Observation]) {
        let point = self.scene.points.len() as u32;
        self.scene.points.push(Some(place));
        self.observations.extend(seen.iter().map(|o| Observation { point, ..**o }));
    }
}

fn sightings<'a>(table: &'a TrackTable, scene: &'a Scene, point: usize) -> impl Iterator<Item = &'a Observation> {
    table.of_point(point).filter(|o| scene.poses[o.frame as usize].is_some())
}

/// The same point as another frame sees it; `None` where it lies behind that one.
fn anchored_at(place: &ScenePoint, frame: u32, scene: &Scene) -> Option<ScenePoint> {
    let (pose, anchor) = (scene.poses[frame as usize]?, scene.poses[place.anchor as usize]?);
    let seen = place.scaled_in(&pose, &anchor);
    (seen.z > 0.0).then(|| ScenePoint {
        anchor: frame,
        ray: seen.xy() / seen.z,
        inverse_depth: place.inverse_depth / seen.z,
    })
}

/// Indices of the points to take, ascending.
fn chosen(table: &TrackTable, scene: &Scene, per_frame: usize) -> Vec<usize> {
    let length = |p: usize| sightings(table, scene, p).count();
    let mut order: Vec<(usize, usize)> =
        (0..table.points()).filter(|&p| scene.points[p].is_some()).map(|p| (length(p), p)).collect();
    order.sort_unstable_by_key(|&(length, p)| (std::cmp::Reverse(length), p));
    let cells = CELLS.0 * CELLS.1;
    let quota = per_frame.div_ceil(cells) as u32;
    let mut held = vec![0_u32; table.frames() * cells];
    let cell = |o: &Observation| o.frame as usize * cells + cell_of(table, o);
    let mut taken = Vec::new();
    for (length, point) in order {
        let wanted = sightings(table, scene, point).filter(|o| held[cell(o)] < quota).count();
        if 2 * wanted >= length && length > 1 {
            sightings(table, scene, point).for_each(|o| held[cell(o)] += 1);
            taken.push(point);
        }
    }
    taken.sort_unstable();
    taken
}

fn cell_of(table: &TrackTable, o: &Observation) -> usize {
    let along = |v: f64, size: u32, n: usize| ((v / f64::from(size) * n as f64).max(0.0) as usize).min(n - 1);
    along(o.pixel.y, table.height, CELLS.1) * CELLS.0 + along(o.pixel.x, table.width, CELLS.0)
}
