//! Options by cross-validation:
//!
//! ```text
//! (ridge, μ) = argmin Σ_folds Σ_{k left out} |x(ridge, μ; the others)_k − x_k|²
//! ```
//!
//! over a grid. Held-out error measures how far regressors generalize; training error would always select the smallest ridge.

use super::surface_of_gradients::SurfaceOfGradients;
use super::training::{regressors, square};
use super::{BlendedPositions, Example, JointRotations, RegressionOptions, check, fit_weights, parents_of};
use crate::character::{CharacterError, Skeleton, SkinWeights};
use crate::mesh::TriMesh;
use plumbline_num::run::Run;

/// Ridge candidates, rad²: thresholds of total rotation of 1°, 2°, 6°, 18° and 60° above which a joint is trusted.
const RIDGES: [f64; 5] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0];
/// Position weight candidates: gradients rule over a third of the surface, down to a three-hundredth, which hardly changes the blend.
const POSITION_WEIGHTS: [f64; 5] = [10.0, 1e2, 1e3, 1e4, 1e5];
/// Largest number of folds: each repeats the fit of weights.
const FOLDS: usize = 4;

/// The ridge and position weight with the smallest cross-validation error; the defaults for fewer than two examples.
///
/// # Errors
/// As [`super::RegressionModel::train`].
pub fn tuned(
    mesh: &TriMesh,
    skeleton: &Skeleton,
    weights: &SkinWeights,
    examples: &[Example],
    run: &Run,
) -> Result<RegressionOptions, CharacterError> {
    check(mesh, skeleton, weights, examples)?;
    if examples.len() < 2 {
        return Ok(RegressionOptions::default());
    }
    let mut surfaces: Vec<SurfaceOfGradients> =
        POSITION_WEIGHTS.iter().map(|&hold| SurfaceOfGradients::new(mesh, hold, run)).collect::<Result<_, _>>()?;
    let parents = parents_of(skeleton);
    let folds = FOLDS.min(examples.len());
    let mut errors = [[0.0; POSITION_WEIGHTS.len()]; RIDGES.len()];
    for fold in 0..folds {
        // Interleaved folds: neighboring frames of a clip are similar and should not all be held out together.
        let (validation, kept): (Vec<_>, Vec<_>) = examples.iter().enumerate().partition(|(k, _)| k % folds == fold);
        let kept: Vec<Example> = kept.into_iter().map(|(_, e)| e.clone()).collect();
        let blend =
            BlendedPositions { rest: mesh.positions().to_vec(), weights: fit_weights(mesh, weights, &kept, run)? };
        for (errors, &ridge) in errors.iter_mut().zip(&RIDGES) {
            let regressors = regressors(mesh, skeleton, weights, &kept, ridge, run)?;
            for (_, Example { matrices, positions }) in &validation {
                run.check()?;
                let rotations = JointRotations::new(matrices, &parents);
                let gradients: Vec<_> = regressors.iter().map(|r| r.gradient(&rotations)).collect();
                let blended = blend.all(matrices);
                for (error, surface) in errors.iter_mut().zip(&mut surfaces) {
                    *error += square(&surface.solve(|t| gradients[t], |v| blended[v].coords), positions);
                }
            }
        }
    }
    let cells = RIDGES.iter().zip(&errors).flat_map(|(&ridge, row)| {
        POSITION_WEIGHTS.iter().zip(row).map(move |(&hold, &error)| (error, RegressionOptions { ridge, hold }))
    });
    Ok(cells.min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(RegressionOptions::default, |(_, options)| options))
}
