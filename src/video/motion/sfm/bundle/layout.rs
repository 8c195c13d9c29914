//! Problem structure: the observations used, the unknowns each depends on, and the index of each unknown in the
//! system.

use super::BundleError;
use super::parameters::{K1, LN_FOCAL, Parameters, READOUT, Ray, SHARED};
use super::shutter::neighbors;
use crate::motion::sfm::{Observation, Scene};
use plumbline_camera::{CameraPose, Vec3};
use plumbline_num::math::Point2;

/// Unknowns of a pose: three of the rotation, three of the translation.
pub(super) const POSE: usize = 6;

/// Number of parts of the tracks that are accumulated in parallel. Each part has a reduced system of its own, as large
/// as the whole one: with four parts, clearing and adding these systems takes a third of the time of the accumulation
/// itself.
const PARTS: usize = 2;

/// An image observation of a track.
#[derive(Clone, Copy, Debug)]
pub(super) struct TrackObservation {
    pub(super) frame: usize,
    pub(super) pixel: Point2,
}

/// A point in use.
#[derive(Clone, Debug)]
pub(super) struct Track {
    /// Index of the point in the scene.
    pub(super) point: usize,
    pub(super) anchor: usize,
    /// Range of its observations in [`Layout::observations`].
    pub(super) observations: std::ops::Range<usize>,
    /// Contiguous range of slots of free poses that contains every pose the point depends on.
    pub(super) slots: std::ops::Range<usize>,
}

/// The structure of a problem.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// Sorted by first slot, then last slot, then point.
    pub(super) tracks: Vec<Track>,
    /// Grouped by track, each group sorted by frame.
    pub(super) observations: Vec<TrackObservation>,
    /// By frame: whether its camera takes part.
    used: Vec<bool>,
    /// By frame: slot of its pose; `None` for a fixed or unused pose.
    pub(super) slot: Vec<Option<usize>>,
    /// Number of free poses.
    pub(super) free: usize,
    /// Whether the rows of a frame have separate poses (rolling shutter).
    pub(super) rolling: bool,
    /// Fixed unknowns of the reduced system: the one that fixes the scale, and shared ones.
    pub(super) fixed: Vec<usize>,
}

impl Layout {
    /// Collects every observation of a known point by a known frame, for points observed in at least two frames.
    pub(super) fn new(
        scene: &Scene,
        observations: &[Observation],
        fixed_frames: &[u32],
        shared_free: [bool; SHARED],
        rolling: bool,
    ) -> Result<Self, BundleError> {
        let groups = grouped(scene, observations)?;
        let mut used = vec![false; scene.poses.len()];
        for (anchor, observations) in &groups.tracks {
            used[*anchor] = true;
            groups.observations[observations.clone()].iter().for_each(|s| used[s.frame] = true);
        }
        let mut is_free = used.clone();
        for &frame in fixed_frames {
            if let Some(free) = is_free.get_mut(frame as usize) {
                *free = false;
            }
        }
        let gauge = Gauge::choose(scene, &used, &mut is_free);
        let slot: Vec<_> = is_free
            .iter()
            .scan(0, |next, &free| {
                *next += usize::from(free);
                Some(free.then(|| *next - 1))
            })
            .collect();
        let free = slot.iter().flatten().count();
        let mut fixed: Vec<_> = gauge.iter().filter_map(|g| Some(POSE * slot[g.frame]? + 3 + g.axis)).collect();
        fixed.extend((0..SHARED).filter(|&k| !shared_free[k]).map(|k| POSE * free + k));
        let mut layout =
            Self { tracks: Vec::new(), observations: groups.observations, used, slot, free, fixed, rolling };
        layout.tracks = groups.points.iter().zip(groups.tracks).map(|(&p, (a, s))| layout.track(p, a, s)).collect();
        layout.tracks.sort_by_key(|t| (t.slots.start, t.slots.end, t.point));
        Ok(layout)
    }

    fn track(&self, point: usize, anchor: usize, observations: std::ops::Range<usize>) -> Track {
        let seen = self.observations[observations.clone()].iter().map(|s| s.frame);
        let around = |f: usize| neighbors(f, |n| self.uses(n)).take_while(|_| self.rolling);
        let touched = seen.flat_map(|f| std::iter::once(f).chain(around(f)));
        let slots = touched.chain([anchor]).filter_map(|f| self.slot[f]);
        let (first, end) = slots.fold((usize::MAX, 0), |(first, end), s| (first.min(s), end.max(s + 1)));
        Track { point, anchor, observations, slots: first.min(end)..end }
    }

    /// Fixes all translations; rotations stay free.
    pub(super) fn fix_translations(&mut self) {
        self.fixed.extend((0..self.free).flat_map(|slot| (3..POSE).map(move |k| POSE * slot + k)));
        self.fixed.sort_unstable();
        self.fixed.dedup();
    }

    /// Whether the camera of a frame takes part.
    pub(super) fn uses(&self, frame: usize) -> bool {
        self.used.get(frame).copied().unwrap_or(false)
    }

    /// Number of unknowns of the reduced system.
    pub(super) fn unknowns(&self) -> usize {
        POSE * self.free + SHARED
    }

    /// Maximum number of poses coupled by one point: the half-bandwidth of the reduced system in poses.
    pub(super) fn longest(&self) -> usize {
        self.tracks.iter().map(|t| t.slots.len()).max().unwrap_or(0)
    }

    /// Nonempty ranges of consecutive tracks with about equal numbers of observations. Their number depends on the
    /// problem alone (not on the machine), so sums over them are reproducible.
    pub(super) fn parts(&self) -> Vec<std::ops::Range<usize>> {
        let mut parts = Vec::with_capacity(PARTS);
        let (mut start, mut count) = (0, 0);
        for (index, track) in self.tracks.iter().enumerate() {
            count += track.observations.len();
            if count * PARTS >= (parts.len() + 1) * self.observations.len() {
                parts.push(start..index + 1);
                start = index + 1;
            }
        }
        parts
    }

    /// The scene as a point of the parameter space.
    pub(super) fn parameters(&self, scene: &Scene) -> Parameters {
        let pose = |p: &Option<CameraPose>| p.unwrap_or_else(CameraPose::identity);
        let ray = |t: &Track| {
            let point = scene.points[t.point].expect("tracks are of known points");
            Ray { xy: point.ray, w: point.inverse_depth }
        };
        Parameters {
            poses: scene.poses.iter().map(pose).collect(),
            points: self.tracks.iter().map(ray).collect(),
            shared: [scene.intrinsics.focal.ln(), scene.intrinsics.k1, scene.readout],
        }
    }

    /// Writes the result to the scene; anything that took no part is unchanged.
    pub(super) fn store(&self, parameters: &Parameters, scene: &mut Scene) {
        for (frame, pose) in scene.poses.iter_mut().enumerate().filter(|&(f, _)| self.slot[f].is_some()) {
            *pose = Some(parameters.poses[frame]);
        }
        for (track, ray) in self.tracks.iter().zip(&parameters.points) {
            if let Some(point) = &mut scene.points[track.point] {
                (point.ray, point.inverse_depth) = (ray.xy, ray.w);
            }
        }
        let is_free = |k: usize| !self.fixed.contains(&(POSE * self.free + k));
        if is_free(LN_FOCAL) {
            scene.intrinsics.focal = parameters.shared[LN_FOCAL].exp();
        }
        (scene.intrinsics.k1, scene.readout) = (parameters.shared[K1], parameters.shared[READOUT]);
    }
}

/// Points in use, grouped with their observations.
struct Groups {
    points: Vec<usize>,
    /// Anchor and range of observations of each point.
    tracks: Vec<(usize, std::ops::Range<usize>)>,
    observations: Vec<TrackObservation>,
}

fn grouped(scene: &Scene, observations: &[Observation]) -> Result<Groups, BundleError> {
    check(scene)?;
    let known = |f: u32| scene.poses.get(f as usize).is_some_and(Option::is_some);
    let usable = |o: &&Observation| {
        let point = scene.points.get(o.point as usize).copied().flatten();
        known(o.frame) && point.is_some_and(|p| known(p.anchor))
    };
    let mut used: Vec<_> = observations.iter().filter(usable).copied().collect();
    if let Some(o) = used.iter().find(|o| !(o.pixel.x.is_finite() && o.pixel.y.is_finite())) {
        return Err(BundleError::NotFinite { what: format!("observation of point {} in frame {}", o.point, o.frame) });
    }
    used.sort_by_key(|o| (o.point, o.frame));
    let mut groups = Groups { points: Vec::new(), tracks: Vec::new(), observations: Vec::new() };
    for chunk in used.chunk_by(|a, b| a.point == b.point).filter(|c| c[0].frame != c[c.len() - 1].frame) {
        let (point, start) = (chunk[0].point as usize, groups.observations.len());
        groups.observations.extend(chunk.iter().map(|o| TrackObservation { frame: o.frame as usize, pixel: o.pixel }));
        let anchor = scene.points[point].expect("only known points are used").anchor as usize;
        groups.points.push(point);
        groups.tracks.push((anchor, start..groups.observations.len()));
    }
    if groups.points.is_empty() {
        return Err(BundleError::NoPoints);
    }
    Ok(groups)
}

fn check(scene: &Scene) -> Result<(), BundleError> {
    let bad = |what: String| Err(BundleError::NotFinite { what });
    let lens = scene.intrinsics;
    if !(lens.focal > 0.0 && lens.focal.is_finite() && lens.k1.is_finite()) {
        return bad(format!("lens with focal length {} px, k1 {}", lens.focal, lens.k1));
    }
    if !(lens.center.y > 0.0 && lens.center.x.is_finite() && lens.center.y.is_finite() && scene.readout.is_finite()) {
        return bad(format!("center ({}, {}) px, readout {}", lens.center.x, lens.center.y, scene.readout));
    }
    for (frame, pose) in scene.poses.iter().enumerate().filter_map(|(f, p)| Some((f, p.as_ref()?))) {
        if !(pose.rotation.coords.iter().chain(pose.translation.iter()).all(|v| v.is_finite())) {
            return bad(format!("pose of frame {frame}"));
        }
    }
    for (index, point) in scene.points.iter().enumerate().filter_map(|(i, p)| Some((i, p.as_ref()?))) {
        if !(point.ray.x.is_finite() && point.ray.y.is_finite() && point.inverse_depth.is_finite()) {
            return bad(format!("point {index}"));
        }
    }
    Ok(())
}

/// Scale gauge: the one coordinate of one camera's translation that is fixed.
struct Gauge {
    frame: usize,
    axis: usize,
}

impl Gauge {
    /// Fixes the first pose in use if no pose is fixed, and the scale if all fixed centers coincide.
    ///
    /// Scaling the scene about the fixed center `c_0` moves `t_g` along `−R_g (c_g − c_0)`. For the frame farthest
    /// from `c_0`, the coordinate with the largest such motion is fixed; this determines the scale. If all centers
    /// coincide there is no scale to fix.
    fn choose(scene: &Scene, used: &[bool], is_free: &mut [bool]) -> Option<Self> {
        let center = |f: usize| scene.poses[f].map(|p| p.center());
        let in_use: Vec<usize> = (0..used.len()).filter(|&f| used[f]).collect();
        if in_use.iter().all(|&f| is_free[f]) {
            is_free[*in_use.first()?] = false;
        }
        let fixed = in_use.iter().copied().find(|&f| !is_free[f])?;
        let origin = center(fixed)?;
        let shift = |f: usize| center(f).map_or_else(Vec3::zeros, |c| c - origin);
        let farthest = |frames: &mut dyn Iterator<Item = usize>| {
            frames.fold((fixed, 0.0), |best, f| if shift(f).norm() > best.1 { (f, shift(f).norm()) } else { best })
        };
        let (_, fixed_apart) = farthest(&mut in_use.iter().copied().filter(|&f| !is_free[f]));
        let (frame, apart) = farthest(&mut in_use.iter().copied().filter(|&f| is_free[f]));
        // Fixed centers whose distance is only rounding error do not determine the scale.
        if fixed_apart > 1e-9 * apart || !(apart > 0.0) {
            return None;
        }
        let moved = scene.poses[frame]?.rotation * shift(frame);
        Some(Self { frame, axis: moved.iamax() })
    }
}
