//! Model selection: each motion model is evaluated on the clip's tracks, mapped by the meshes with which it would render.
//!
//! Two paths are compared shot by shot, the one of cameras in space and the one in the picture; then, under the path in the
//! picture, the models of a frame's warp are compared segment by segment. A more flexible model is used unless it is measurably
//! worse than the next simpler one.

use std::fmt::Write as _;
use std::ops::Range;

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::error::StabilizeError;
use super::frame_maps::RenderInputs;
use super::frame_models::FrameModels;
use super::model_evaluation::{EvaluatedModel, ModelEvaluation, ModelFigures};
use super::options::{ModelChoice, WarpOptions};
use super::summary::model_name;
use super::tracks::Tracks;
use crate::motion::{ClipMotion, MotionModel, SegmentVerdict};
use crate::path::{self, VirtualPath};
use plumbline_num::run::Run;

/// Motion that is not visible, px: added to both sides of a ratio, so that smaller figures do not decide.
const MIN_VISIBLE_PX: f64 = 0.01;
/// Shake, acceleration and wobble of the more flexible model over those of the simpler one, geometric mean, up to which they
/// count as equal: parallax under a smooth camera counts as wobble here, although a steady camera would have seen it.
const MAX_UNREST_RATIO: f64 = 1.1;
/// Fraction of the picture's width that a more flexible model may cost: two percent of crop are worth six of shake
/// (`CROP_PRICE` in `path/optimal.rs`), less than [`MAX_UNREST_RATIO`] allows.
const MAX_CROP_LOSS: f64 = 0.02;
/// Anisotropy below which a change of shape is visible: a circle becomes an ellipse with axes 4 % apart.
const MIN_ANISOTROPY: f64 = 0.96;

/// Models under one path, from the most flexible to the simplest.
const LADDER: [MotionModel; 3] = [MotionModel::Subspace, MotionModel::Mesh, MotionModel::Homography];

/// The path of cameras in space or, on shots where that is worse, the one in the picture. `covered`: the source must cover the
/// output.
pub(super) fn select_path(
    motion: &ClipMotion,
    tracks: &Tracks,
    in_space: &VirtualPath,
    in_picture: &VirtualPath,
    covered: bool,
    run: &Run,
) -> Result<VirtualPath, StabilizeError> {
    let warp = WarpOptions::default();
    let evaluate = |path: &VirtualPath| {
        let inputs = RenderInputs { tracks, path, motion: Some(motion), warp: &warp, covered };
        ModelEvaluation::new(&inputs, &FrameModels::new(ModelChoice::Auto, Some(motion), path), motion, run)
    };
    let (space, picture) = rayon::join(|| evaluate(in_space), || evaluate(in_picture));
    let (space, picture) = (space?, picture?);
    let mut chosen =
        VirtualPath { out_from_src: Vec::new(), crop: Vec::new(), cameras: Vec::new(), segments: Vec::new() };
    for shot in &motion.shots {
        let has_cameras = in_space.cameras[shot.clone()].iter().any(Option::is_some);
        let figures = if has_cameras { space.over(shot.clone()).zip(picture.over(shot.clone())) } else { None };
        let in_space_wins = figures.is_some_and(|(s, p)| s.is_no_worse_than(&p));
        append(&mut chosen, if in_space_wins { in_space } else { in_picture }, shot);
        if let (Some((space, picture)), Some(segment)) = (figures, chosen.segments.last_mut()) {
            let word = if in_space_wins { "chosen" } else { "left" };
            let _ = write!(segment.reason, "; in space ({word}): {space}; in the picture: {picture}");
        }
    }
    Ok(chosen)
}

/// The motion models of a clip under the mode of `inputs`.
///
/// In automatic mode, on segments where depth or wobble calls for a mesh, the models of the ladder are evaluated, and each that
/// is worse than the next simpler one is replaced by it.
///
/// # Errors
/// [`StabilizeError::Store`], [`StabilizeError::Options`], [`StabilizeError::Warp`], [`StabilizeError::Interrupted`].
pub fn select_models(inputs: &RenderInputs<'_>, run: &Run) -> Result<FrameModels, StabilizeError> {
    let mut models = FrameModels::new(inputs.warp.mode, inputs.motion, inputs.path);
    let is_mesh = |s: &SegmentVerdict| s.model == MotionModel::Mesh;
    let open = inputs.warp.mode == ModelChoice::Auto && models.segments.iter().any(is_mesh);
    let Some(motion) = inputs.motion.filter(|_| open) else { return Ok(models) };
    let evaluate = |model: &MotionModel| {
        let mut tried = models.clone();
        tried.segments.iter_mut().filter(|s| is_mesh(s)).for_each(|s| s.model = *model);
        ModelEvaluation::new(inputs, &tried, motion, run)
    };
    let evaluations = LADDER.par_iter().map(evaluate).collect::<Result<Vec<_>, _>>()?;
    for segment in models.segments.iter_mut().filter(|s| is_mesh(s)) {
        let figures: Option<Vec<ModelFigures>> = evaluations.iter().map(|e| e.over(segment.frames.clone())).collect();
        let Some(figures) = figures else { continue };
        let rung = rung(&figures);
        segment.model = LADDER[rung];
        for (&model, &figures) in LADDER.iter().zip(&figures).take(rung + 2) {
            let _ = write!(segment.reason, "; {}: {figures}", model_name(model));
            models.evaluated.push(EvaluatedModel { frames: segment.frames.clone(), model, figures });
        }
    }
    Ok(models)
}

/// Index of the most flexible model that is no worse than the next simpler one; of the simplest where there is none.
fn rung(figures: &[ModelFigures]) -> usize {
    let passes = |pair: &[ModelFigures]| pair[0].is_no_worse_than(&pair[1]);
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

impl ModelFigures {
    /// Whether the more flexible model, which has these figures, may replace the one of `other`. Within the accuracy of the
    /// figures it may: it shows the parallax that a steady camera would have seen.
    fn is_no_worse_than(&self, other: &Self) -> bool {
        let ratio = |of: fn(&Self) -> f64| (of(self) + MIN_VISIBLE_PX) / (of(other) + MIN_VISIBLE_PX);
        let unrest = (ratio(|f| f.shake_px) * ratio(|f| f.acceleration_px) * ratio(|f| f.wobble_px)).cbrt();
        self.folds == 0
            && self.anisotropy >= MIN_ANISOTROPY
            && self.crop >= other.crop - MAX_CROP_LOSS
            && unrest <= MAX_UNREST_RATIO
    }
}

impl std::fmt::Display for ModelFigures {
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

    const LOWER: ModelFigures =
        ModelFigures { crop: 0.9, shake_px: 2.0, acceleration_px: 0.2, wobble_px: 0.2, anisotropy: 0.99, folds: 0 };

    #[test]
    fn a_more_flexible_model_passes_where_it_is_equal_or_trades_one_figure_for_another() {
        assert!(LOWER.is_no_worse_than(&LOWER));
        assert!(ModelFigures { shake_px: 1.5, wobble_px: 0.25, ..LOWER }.is_no_worse_than(&LOWER));
    }

    #[test]
    fn a_more_flexible_model_is_rejected_where_any_figure_is_visibly_worse() {
        for worse in [
            ModelFigures { folds: 1, ..LOWER },
            ModelFigures { anisotropy: 0.9, ..LOWER },
            ModelFigures { crop: 0.85, ..LOWER },
            ModelFigures { shake_px: 3.0, ..LOWER },
            ModelFigures { acceleration_px: 0.3, ..LOWER },
            ModelFigures { wobble_px: 0.3, ..LOWER },
            ModelFigures { wobble_px: f64::NAN, ..LOWER },
        ] {
            assert!(!worse.is_no_worse_than(&LOWER), "{worse}");
        }
    }

    #[test]
    fn invisible_differences_do_not_decide() {
        let still = ModelFigures { shake_px: 1e-6, acceleration_px: 1e-6, wobble_px: 1e-6, ..LOWER };
        assert!(ModelFigures { wobble_px: 1e-4, ..still }.is_no_worse_than(&still));
    }

    #[test]
    fn the_most_flexible_model_no_worse_than_the_next_simpler_one_is_selected() {
        let folded = ModelFigures { folds: 3, ..LOWER };
        assert_eq!(rung(&[LOWER, LOWER, LOWER]), 0);
        assert_eq!(rung(&[folded, LOWER, LOWER]), 1);
        assert_eq!(rung(&[folded, folded, folded]), 2, "the lowest is compared with nothing");
    }

    #[test]
    fn a_path_put_together_of_shots_is_each_of_them_in_its_own_frames() {
        let segment = |frames: Range<usize>, zoom: f64| path::Segment {
            frames,
            outcome: path::SegmentOutcome::Smoothed,
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
        let segments: Vec<_> = chosen.segments.iter().map(|s| (s.frames.clone(), s.reason.as_str())).collect();
        assert_eq!(segments, [(0..4, "2"), (4..10, "4")]);
    }
}
