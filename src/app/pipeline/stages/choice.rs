//! Which tier is drawn: what each would make of the clip is measured on the meshes that it would be drawn with.
//!
//! Two paths are compared shot by shot, the one of cameras in space and the one of the picture; then, under the path of the
//! picture, ways to bend a frame are compared segment by segment.

use std::fmt::Write as _;
use std::ops::Range;

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::analysis::Tracks;
use super::sampling::Feed;
use super::telling::tier_name;
use super::tiers::Tiers;
use super::trial::{Trial, TrialFigures};
use crate::pipeline::kinds::{WarpMode, WarpSettings};
use crate::pipeline::run_error::RunError;
use plumbline_video::motion::{ClipMotion, SegmentVerdict, Tier};
use plumbline_video::path::{self, VirtualPath};

/// Motion, px, that cannot be seen: what is below it does not decide.
const LEAST_PX: f64 = 0.01;
/// Shake, acceleration and wobble of a freer tier over those of the lower one, geometric mean, that still pass for equal:
/// parallax under a smooth camera counts as wobble here, though it is what the camera would have seen.
const MOST_UNREST: f64 = 1.1;
/// Part of the picture's width that a freer tier may cost.
const CROP_LOST: f64 = 0.02;
/// Anisotropy below which shapes are seen to change.
const LEAST_ANISOTROPY: f64 = 0.96;

/// Tiers under one path, from the freest down.
const LADDER: [Tier; 3] = [Tier::Subspace, Tier::Mesh, Tier::Homography];

/// The path of cameras in space, and where that comes out worse than the one of the picture, the latter. `covered`: the
/// source must cover the output.
pub(super) fn better(
    motion: &ClipMotion,
    tracks: &Tracks,
    in_space: &VirtualPath,
    in_picture: &VirtualPath,
    covered: bool,
) -> Result<VirtualPath, RunError> {
    let warp = WarpSettings::default();
    let trial = |path: &VirtualPath| {
        let feed = Feed { tracks, path, motion: Some(motion), warp: &warp };
        Trial::run(&feed, &Tiers::new(WarpMode::Auto, Some(motion), path), motion, covered)
    };
    let (space, picture) = rayon::join(|| trial(in_space), || trial(in_picture));
    let (space, picture) = (space?, picture?);
    let mut chosen =
        VirtualPath { out_from_src: Vec::new(), crop: Vec::new(), cameras: Vec::new(), segments: Vec::new() };
    for shot in &motion.shots {
        let drawn = in_space.cameras[shot.clone()].iter().any(Option::is_some);
        let figures = if drawn { space.over(shot.clone()).zip(picture.over(shot.clone())) } else { None };
        let in_space_wins = figures.is_some_and(|(s, p)| s.is_no_worse_than(&p));
        append(&mut chosen, if in_space_wins { in_space } else { in_picture }, shot);
        if let (Some((space, picture)), Some(segment)) = (figures, chosen.segments.last_mut()) {
            let word = if in_space_wins { "chosen" } else { "left" };
            let _ = write!(segment.reason, "; in space ({word}): {space}; in the picture: {picture}");
        }
    }
    Ok(chosen)
}

/// The tiers of a clip under `mode`. Where the mode leaves it open and depth or wobble would have a mesh, tiers from the
/// freest down are tried on every segment, and each that does worse than the next is given up for it.
pub(super) fn tiers(feed: &Feed<'_>, covered: bool) -> Result<Tiers, RunError> {
    let mut tiers = Tiers::new(feed.warp.mode, feed.motion, feed.path);
    let bent = |s: &SegmentVerdict| s.tier == Tier::Mesh;
    let Some(motion) = feed.motion.filter(|_| feed.warp.mode == WarpMode::Auto && tiers.segments.iter().any(bent))
    else {
        return Ok(tiers);
    };
    let trial = |tier: &Tier| {
        let mut tried = tiers.clone();
        tried.segments.iter_mut().filter(|s| bent(s)).for_each(|s| s.tier = *tier);
        Trial::run(feed, &tried, motion, covered)
    };
    let trials = LADDER.par_iter().map(trial).collect::<Result<Vec<_>, _>>()?;
    for segment in tiers.segments.iter_mut().filter(|s| bent(s)) {
        let figures: Option<Vec<TrialFigures>> = trials.iter().map(|t| t.over(segment.frames.clone())).collect();
        let Some(figures) = figures else { continue };
        let rung = rung(&figures);
        segment.tier = LADDER[rung];
        for (tier, figures) in LADDER.iter().zip(&figures).take(rung + 2) {
            let _ = write!(segment.reason, "; {}: {figures}", tier_name(*tier));
        }
    }
    Ok(tiers)
}

/// The freest tier that is no worse than the next lower one; the lowest where there is none.
fn rung(figures: &[TrialFigures]) -> usize {
    let passes = |pair: &[TrialFigures]| pair[0].is_no_worse_than(&pair[1]);
    figures.windows(2).position(passes).unwrap_or(figures.len() - 1)
}

/// Adds a shot of `from`.
fn append(path: &mut VirtualPath, from: &VirtualPath, shot: &Range<usize>) {
    path.out_from_src.extend(&from.out_from_src[shot.clone()]);
    path.crop.extend(&from.crop[shot.clone()]);
    path.cameras.extend(shot.clone().map(|f| from.cameras.get(f).copied().flatten()));
    let inside = |s: &&path::Segment| s.frames.start >= shot.start && s.frames.end <= shot.end;
    path.segments.extend(from.segments.iter().filter(inside).cloned());
}

impl TrialFigures {
    /// Whether the freer tier, whose figures these are, may replace the one of `other`. Within what such figures can tell,
    /// it may: it shows the parallax that a steady camera would have seen.
    fn is_no_worse_than(&self, other: &Self) -> bool {
        let ratio = |of: fn(&Self) -> f64| (of(self) + LEAST_PX) / (of(other) + LEAST_PX);
        let unrest = (ratio(|f| f.shake_px) * ratio(|f| f.acceleration_px) * ratio(|f| f.wobble_px)).cbrt();
        self.folds == 0
            && self.anisotropy >= LEAST_ANISOTROPY
            && self.crop >= other.crop - CROP_LOST
            && unrest <= MOST_UNREST
    }
}

impl std::fmt::Display for TrialFigures {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { crop, shake_px, acceleration_px, wobble_px, anisotropy, folds } = self;
        write!(
            f,
            "crop {crop:.3}, shake {shake_px:.2} px, acceleration {acceleration_px:.3} px, wobble {wobble_px:.3} px"
        )?;
        write!(f, ", anisotropy {anisotropy:.3}")?;
        if *folds > 0 { write!(f, ", {folds} folds") } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_num::math::Similarity2;

    const LOWER: TrialFigures =
        TrialFigures { crop: 0.9, shake_px: 2.0, acceleration_px: 0.2, wobble_px: 0.2, anisotropy: 0.99, folds: 0 };

    #[test]
    fn a_freer_tier_passes_where_it_is_as_good_and_where_it_trades_one_for_another() {
        assert!(LOWER.is_no_worse_than(&LOWER));
        assert!(TrialFigures { shake_px: 1.5, wobble_px: 0.25, ..LOWER }.is_no_worse_than(&LOWER));
    }

    #[test]
    fn a_freer_tier_is_given_up_where_it_is_worse_in_any_way_that_shows() {
        for worse in [
            TrialFigures { folds: 1, ..LOWER },
            TrialFigures { anisotropy: 0.9, ..LOWER },
            TrialFigures { crop: 0.85, ..LOWER },
            TrialFigures { shake_px: 3.0, ..LOWER },
            TrialFigures { acceleration_px: 0.3, ..LOWER },
            TrialFigures { wobble_px: 0.3, ..LOWER },
            TrialFigures { wobble_px: f64::NAN, ..LOWER },
        ] {
            assert!(!worse.is_no_worse_than(&LOWER), "{worse}");
        }
    }

    #[test]
    fn what_cannot_be_seen_does_not_decide() {
        let still = TrialFigures { shake_px: 1e-6, acceleration_px: 1e-6, wobble_px: 1e-6, ..LOWER };
        assert!(TrialFigures { wobble_px: 1e-4, ..still }.is_no_worse_than(&still));
    }

    #[test]
    fn the_freest_tier_that_holds_against_the_next_lower_one_is_drawn() {
        let folded = TrialFigures { folds: 3, ..LOWER };
        assert_eq!(rung(&[LOWER, LOWER, LOWER]), 0);
        assert_eq!(rung(&[folded, LOWER, LOWER]), 1);
        assert_eq!(rung(&[folded, folded, folded]), 2, "the lowest needs to hold against nothing");
    }

    #[test]
    fn a_path_put_together_of_shots_is_each_of_them_in_its_own_frames() {
        let segment = |frames: Range<usize>, zoom: f64| path::Segment {
            frames,
            tier: path::Tier::Smoothed,
            reason: format!("{zoom}"),
        };
        let path = |zoom: f64| VirtualPath {
            out_from_src: vec![Similarity2 { a: zoom, ..Similarity2::IDENTITY }.to_homography(); 10],
            crop: vec![1.0 / zoom; 10],
            cameras: Vec::new(),
            segments: [0..4, 4..10].map(|frames| segment(frames, zoom)).to_vec(),
        };
        let mut chosen =
            VirtualPath { out_from_src: Vec::new(), crop: Vec::new(), cameras: Vec::new(), segments: Vec::new() };
        append(&mut chosen, &path(2.0), &(0..4));
        append(&mut chosen, &path(4.0), &(4..10));
        assert_eq!(chosen.crop, [vec![0.5; 4], vec![0.25; 6]].concat());
        assert_eq!((chosen.out_from_src.len(), chosen.cameras.len()), (10, 10));
        let told: Vec<_> = chosen.segments.iter().map(|s| (s.frames.clone(), s.reason.as_str())).collect();
        assert_eq!(told, [(0..4, "2"), (4..10, "4")]);
    }
}
