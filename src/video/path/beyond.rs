//! How far beyond the sides of a frame its neighbors show the scene.
//!
//! A window that leaves the frame is filled from neighboring frames, the nearest that shows a place first. What none of them shows is continued by a
//! mirror, and what moves on its own is shown twice or torn, since it stood elsewhere then. So the window may leave a frame on each side as far as
//! nothing is shown there that moved, neither in the neighbor that fills the place nor in the mirror, and as far as little has to be mirrored:
//!
//! ```text
//! e(side) = max e:   no object at any place beyond the side up to e,
//!                    ∫₀ᵉ (fraction of the side that no neighbor shows at depth x) dx  ≤  MIRRORED,      e ≤ limit
//! ```
//!
//! An object at speed `v` against the background counts in a neighbor `n` frames away where `v n` is more than its radius. Where this leaves
//! no room the picture is enlarged, slowly, just as far as needed: by the planner's own crop.

use super::Clip;
use plumbline_num::math::{Homography, Point2};
use plumbline_num::run::{Run, Stopped};

/// Points along a side at which coverage is tested.
const ALONG: usize = 9;
/// Depths at which it is tested, from the side to the limit.
const DEPTHS: usize = 10;
/// Rim of a neighbor that shows nothing: its feather and the error of chained motions, as a fraction of the width.
const RIM: f64 = 0.01;
/// Half of an object around the middle of its points, as a fraction of the width: half a cell of the 16 × 9 in which objects are
/// distinguished from the background.
const OBJECT_RADIUS: f64 = 1.0 / 32.0;
/// Most that is mirrored beyond a side, as a fraction of the frame: a strip that is seen no more than the feather in front of it.
const MIRRORED: f64 = 0.01;

/// Widths beyond the four sides of a frame, px.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Margins {
    /// Beyond the left side.
    pub left: f64,
    /// Beyond the upper side.
    pub top: f64,
    /// Beyond the right side.
    pub right: f64,
    /// Beyond the lower side.
    pub bottom: f64,
}

/// A part of something in a frame that does not move with the background.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingObject {
    /// Its middle, px.
    pub at: Point2,
    /// Its speed against the background, px per frame.
    pub speed: f64,
}

/// Options of [`shown_beyond`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeyondOptions {
    /// How many frames before and after may fill one.
    pub reach_frames: usize,
    /// Most that may be filled beyond a side, as a fraction of the frame's width or height.
    pub limit: f64,
}

impl Default for BeyondOptions {
    /// Thirty frames, as the renderer looks at; a tenth of the size, so that the frame itself covers at least the central 80 % of the window.
    fn default() -> Self {
        Self { reach_frames: 30, limit: 0.1 }
    }
}

impl BeyondOptions {
    /// Speed from which an object counts in the farthest neighbor of a frame `width` px wide, px per frame: slower ones need not be named.
    pub fn min_speed(&self, width: u32) -> f64 {
        OBJECT_RADIUS * f64::from(width) / self.reach_frames.max(1) as f64
    }
}

/// How far beyond each side of every frame its neighbors show the scene. `objects` has, per frame, what moves on its own; it is empty where
/// that is not known.
///
/// ```
/// use plumbline_num::math::{Similarity2, Vec2};
/// use plumbline_num::run::Run;
/// use plumbline_video::path::{BeyondOptions, Clip, InterFrame, shown_beyond};
///
/// // The content moves left by 2 px per frame: later frames show what lies beyond the right side.
/// let similarity = Similarity2 { t: Vec2::new(-2.0, 0.0), ..Similarity2::IDENTITY };
/// let step = InterFrame { similarity, homography: similarity.to_homography(), reliable: true };
/// let times_s: Vec<f64> = (0..40).map(|t| f64::from(t) / 30.0).collect();
/// let clip = Clip { width: 640, height: 360, times_s: &times_s, motion: &[step; 40], shots: &[0..40], beyond: &[] };
/// let margins = shown_beyond(&clip, &[], &BeyondOptions::default(), &Run::default())?;
/// assert!(margins[0].right > 40.0 && margins[0].left < 7.0 && margins[39].right < 7.0);
/// # Ok::<(), plumbline_num::run::Stopped>(())
/// ```
///
/// # Errors
/// [`Stopped`]: interrupted by `run`.
pub fn shown_beyond(
    clip: &Clip<'_>,
    objects: &[Vec<MovingObject>],
    options: &BeyondOptions,
    run: &Run,
) -> Result<Vec<Margins>, Stopped> {
    let mut margins = vec![Margins::default(); clip.times_s.len()];
    let objects_of = |n: usize| objects.get(n).map_or(&[][..], Vec::as_slice);
    for shot in clip.shots {
        for t in shot.clone() {
            run.check()?;
            let mut frame = Surroundings::new(clip, options);
            let (mut later, mut earlier) = (Some(Homography::identity()), Some(Homography::identity()));
            for away in 1..=options.reach_frames {
                let step = |n: usize| Some(&clip.motion[n]).filter(|step| step.reliable).map(|step| step.homography);
                later = later
                    .zip(Some(t + away).filter(|n| *n < shot.end).and_then(step))
                    .map(|(chain, step)| step * chain);
                let before = (t + 1).checked_sub(away).filter(|n| *n > shot.start);
                earlier = earlier.zip(before.and_then(step)).map(|(chain, step)| chain * step);
                if let Some(n_from_t) = later {
                    frame.look_at(&n_from_t, away, objects_of(t + away));
                }
                if let Some(n_from_t) = earlier.and_then(|t_from_n| t_from_n.inverse()) {
                    frame.look_at(&n_from_t, away, objects_of(t - away));
                }
            }
            margins[t] = frame.margins(objects_of(t), options.reach_frames);
        }
    }
    Ok(margins)
}

/// What is shown at a place beyond a side.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shown {
    /// Nothing, by no neighbor: it will be mirrored.
    Nowhere,
    /// The scene, by a neighbor this many frames away.
    Scene(usize),
    /// Something that is elsewhere now.
    Object,
}

/// What lies around a frame.
struct Surroundings {
    size: [f64; 2],
    /// Most beyond a side.
    limits: [f64; 2],
    /// Places beyond each side, depth by depth.
    probes: Vec<(Point2, Shown)>,
}

impl Surroundings {
    fn new(clip: &Clip<'_>, options: &BeyondOptions) -> Self {
        let size = [f64::from(clip.width), f64::from(clip.height)];
        let mut surroundings = Self { size, limits: size.map(|s| options.limit * s), probes: Vec::new() };
        let probes = (0..4 * DEPTHS * ALONG).map(|k| (surroundings.probe(k, 1.0), Shown::Nowhere)).collect();
        surroundings.probes = probes;
        surroundings
    }

    /// Place `k`: sides left, top, right, bottom; depths; places along the side. With `outwards` = −1, its mirror image.
    fn probe(&self, k: usize, outwards: f64) -> Point2 {
        let (side, level, along) = (k / (DEPTHS * ALONG), k / ALONG % DEPTHS, k % ALONG);
        let depth = outwards * self.limits[side % 2] * (level + 1) as f64 / DEPTHS as f64;
        let across = if side < 2 { -depth } else { self.size[side % 2] + depth };
        let other = self.size[1 - side % 2] * (along as f64 + 0.5) / ALONG as f64;
        if side % 2 == 0 { Point2::new(across, other) } else { Point2::new(other, across) }
    }

    /// Takes a neighbor: it fills what none nearer has shown.
    fn look_at(&mut self, n_from_t: &Homography, away: usize, objects: &[MovingObject]) {
        let [width, height] = self.size;
        let (rim, radius) = (RIM * width, OBJECT_RADIUS * width);
        let moved = |o: &&MovingObject| o.speed * away as f64 > radius;
        for (probe, shown) in self.probes.iter_mut().filter(|(_, shown)| *shown == Shown::Nowhere) {
            let Some(p) = n_from_t.apply(*probe) else { continue };
            if (rim..=width - rim).contains(&p.x) && (rim..=height - rim).contains(&p.y) {
                let taken = objects.iter().filter(moved).any(|o| (o.at - p).norm() < 2.0 * radius);
                *shown = if taken { Shown::Object } else { Shown::Scene(away) };
            }
        }
    }

    /// The margins; `objects` are those of the frame itself: what continues them beyond a side is elsewhere in a neighbor, and a mirror
    /// shows them again.
    fn margins(&self, objects: &[MovingObject], reach_frames: usize) -> Margins {
        let radius = OBJECT_RADIUS * self.size[0];
        let mirrors = |k: usize, away: usize| {
            let inside = self.probe(k, -1.0);
            objects.iter().any(|o| o.speed * away as f64 > radius && (o.at - inside).norm() < 2.0 * radius)
        };
        let is_blocked = |k: usize| match self.probes[k].1 {
            Shown::Nowhere => mirrors(k, reach_frames),
            Shown::Scene(away) => mirrors(k, away),
            Shown::Object => true,
        };
        let side = |side: usize| {
            let (first, step) = (side * DEPTHS * ALONG, 1.0 / DEPTHS as f64);
            let (mut depth, mut mirrored) = (0.0, 0.0);
            for level in 0..DEPTHS {
                let at = first + level * ALONG;
                let nowhere = |k: &usize| self.probes[*k].1 == Shown::Nowhere;
                if (at..at + ALONG).any(is_blocked) {
                    break;
                }
                let open = (at..at + ALONG).filter(nowhere).count() as f64 / ALONG as f64;
                let left = (MIRRORED * self.size[side % 2] / self.limits[side % 2] - mirrored).max(0.0);
                if open * step > left {
                    depth += left / open;
                    break;
                }
                mirrored += open * step;
                depth += step;
            }
            depth * self.limits[side % 2]
        };
        Margins { left: side(0), top: side(1), right: side(2), bottom: side(3) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{InterFrame, PathOptions, VirtualPath, plan};
    use plumbline_num::math::{Similarity2, Vec2};

    /// Sixty frames whose content swings by ±24 px across and ±12 px down once a second, and the margins of each.
    fn swinging(objects: &[Vec<MovingObject>], reliable: bool, reach_frames: usize) -> Vec<Margins> {
        let at = |t: f64| {
            Vec2::new(24.0 * (t / 30.0 * std::f64::consts::TAU).sin(), 12.0 * (t / 30.0 * std::f64::consts::TAU).cos())
        };
        let step = |t: u32| {
            let similarity = Similarity2 { t: at(f64::from(t)) - at(f64::from(t) - 1.0), ..Similarity2::IDENTITY };
            InterFrame { similarity, homography: similarity.to_homography(), reliable: reliable || t != 30 }
        };
        let motion: Vec<_> = (0..60).map(step).collect();
        let times_s: Vec<f64> = (0..60).map(|t| f64::from(t) / 30.0).collect();
        let shot = 0..60;
        let shots = std::slice::from_ref(&shot);
        let clip = Clip { width: 640, height: 360, times_s: &times_s, motion: &motion, shots, beyond: &[] };
        let options = BeyondOptions { reach_frames, ..BeyondOptions::default() };
        shown_beyond(&clip, objects, &options, &Run::default()).expect("not interrupted")
    }

    #[test]
    fn margins_are_as_wide_as_neighbors_reach() {
        let margins = swinging(&[], true, 30);
        // At the middle of a swing the picture goes on by 24 px on either side, less the rim of 6.4, and 6.4 more are mirrored.
        let middle = margins[30];
        assert!((19.0..=24.1).contains(&middle.left) && (19.0..=24.1).contains(&middle.right), "{middle:?}");
        let end = margins[37];
        let (wide, narrow) = (end.left.max(end.right), end.left.min(end.right));
        assert!(wide > 41.0 && (narrow - 6.4).abs() < 0.1, "{end:?}");
    }

    #[test]
    fn nothing_is_filled_where_something_moved() {
        let at = |x: f64, y: f64, speed: f64| vec![MovingObject { at: Point2::new(x, y), speed }];
        let free = swinging(&[], true, 30);
        for (speed, is_kept) in [(0.1, false), (10.0, true)] {
            // Three frames later the left side of frame 30 is 14 px inside, and an object stands there.
            let objects: Vec<_> = (0..60).map(|t| if t < 31 { Vec::new() } else { at(10.0, 180.0, speed) }).collect();
            let kept = swinging(&objects, true, 30);
            assert_eq!(kept[30].right, free[30].right);
            assert_eq!(kept[30].left < free[30].left, is_kept, "{:?}, {:?}", kept[30], free[30]);
        }
        let mut objects = vec![Vec::new(); 60];
        objects[37] = at(320.0, 5.0, 5.0);
        assert_eq!(swinging(&objects, true, 30)[37].top, 0.0);
    }

    #[test]
    fn frames_behind_an_unknown_motion_show_nothing() {
        // Frames within reach before frame 30 show what is beyond its right side, those after it what is beyond the left one.
        let (free, cut) = (swinging(&[], true, 10), swinging(&[], false, 10));
        assert_eq!(cut[30].left, free[30].left);
        assert!((cut[30].right - 6.4).abs() < 0.1 && free[30].right > 19.0, "{:?}, {:?}", cut[30], free[30]);
    }

    #[test]
    fn the_planned_window_leaves_the_frame_no_farther() {
        let similarity = |by: Vec2| Similarity2 { t: by, ..Similarity2::IDENTITY };
        let mut random = fastrand::Rng::with_seed(5);
        let mut at = Vec2::zeros();
        let motion: Vec<InterFrame> = (0..200)
            .map(|_| {
                let to = Vec2::new(random.f64() - 0.5, random.f64() - 0.5) * 60.0;
                let similarity = similarity(to - at);
                at = to;
                InterFrame { similarity, homography: similarity.to_homography(), reliable: true }
            })
            .collect();
        let times_s: Vec<f64> = (0..200).map(|t| f64::from(t) / 30.0).collect();
        let shot = 0..200;
        let shots = std::slice::from_ref(&shot);
        let inside = Clip { width: 640, height: 360, times_s: &times_s, motion: &motion, shots, beyond: &[] };
        // Objects beside the right side, in the second half.
        let object = MovingObject { at: Point2::new(600.0, 180.0), speed: 40.0 };
        let objects: Vec<_> = (0..200).map(|t| if t < 100 { Vec::new() } else { vec![object] }).collect();
        let beyond =
            shown_beyond(&inside, &objects, &BeyondOptions::default(), &Run::default()).expect("not interrupted");
        let options = PathOptions::default();
        let [kept, filled] = [inside, Clip { beyond: &beyond, ..inside }]
            .map(|clip| plan(&clip, &options, &Run::default()).expect("valid input"));
        let corners = [(0.0, 0.0), (640.0, 0.0), (640.0, 360.0), (0.0, 360.0)].map(|(x, y)| Point2::new(x, y));
        for (t, (out_from_src, Margins { left, top, right, bottom })) in
            filled.out_from_src.iter().zip(&beyond).enumerate()
        {
            let src_from_out = out_from_src.inverse().expect("a similarity");
            for p in corners.map(|p| src_from_out.apply(p).expect("affine")) {
                let is_inside = p.x >= -left - 1e-6
                    && p.x <= 640.0 + right + 1e-6
                    && p.y >= -top - 1e-6
                    && p.y <= 360.0 + bottom + 1e-6;
                assert!(is_inside, "frame {t}: {p}, {:?}", beyond[t]);
            }
        }
        let mean = |path: &VirtualPath, frames: std::ops::Range<usize>| path.crop[frames].iter().sum::<f64>();
        assert!(mean(&filled, 0..80) > mean(&kept, 0..80) + 2.0, "{} {}", mean(&filled, 0..80), mean(&kept, 0..80));
        assert!(filled.crop[150] < filled.crop[50], "the picture is enlarged where an object is");
    }
}
