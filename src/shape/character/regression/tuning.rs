//! Options found by leaving examples out:
//!
//! ```text
//! (ridge, μ) = argmin Σ_folds Σ_{k left out} |x(ridge, μ; the others)_k − x_k|²
//! ```
//!
//! over a grid. What no fold had seen tells how far regressors may be believed; what they were trained on would always ask for the
//! least ridge.

use super::surface_of_gradients::SurfaceOfGradients;
use super::training::{regressors, square};
use super::{Example, JointTurns, Places, RegressionOptions, check, fit_weights, parents_of};
use crate::character::{CharacterError, Skeleton, SkinWeights};
use crate::mesh::TriMesh;
use plumbline_num::run::Run;

/// Ridges tried, rad²: joints are believed that turned by 1°, 2°, 6°, 18° or 60° in all examples together.
const RIDGES: [f64; 5] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0];
/// Holds tried: gradients count over a third of the surface, or down to a three-hundredth, which hardly changes the blend.
const HOLDS: [f64; 5] = [10.0, 1e2, 1e3, 1e4, 1e5];
/// Folds at most: each costs the fit of weights anew.
const FOLDS: usize = 4;

/// The ridge and the hold that predict examples best which were left out; the default ones for fewer than two examples.
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
        HOLDS.iter().map(|&hold| SurfaceOfGradients::new(mesh, hold, run)).collect::<Result<_, _>>()?;
    let parents = parents_of(skeleton);
    let folds = FOLDS.min(examples.len());
    let mut errors = [[0.0; HOLDS.len()]; RIDGES.len()];
    for fold in 0..folds {
        // Neighbors in a movement are alike: they are left out together no more than chance has it.
        let (held, kept): (Vec<_>, Vec<_>) = examples.iter().enumerate().partition(|(k, _)| k % folds == fold);
        let kept: Vec<Example> = kept.into_iter().map(|(_, e)| e.clone()).collect();
        let places = Places { rest: mesh.positions().to_vec(), weights: fit_weights(mesh, weights, &kept, run)? };
        for (errors, &ridge) in errors.iter_mut().zip(&RIDGES) {
            let regressors = regressors(mesh, skeleton, weights, &kept, ridge, run)?;
            for (_, Example { matrices, positions }) in &held {
                run.check()?;
                let turns = JointTurns::new(matrices, &parents);
                let gradients: Vec<_> = regressors.iter().map(|r| r.gradient(&turns)).collect();
                let blended = places.all(matrices);
                for (error, surface) in errors.iter_mut().zip(&mut surfaces) {
                    *error += square(&surface.solve(|t| gradients[t], |v| blended[v].coords), positions);
                }
            }
        }
    }
    let cells = RIDGES.iter().zip(&errors).flat_map(|(&ridge, row)| {
        HOLDS.iter().zip(row).map(move |(&hold, &error)| (error, RegressionOptions { ridge, hold }))
    });
    Ok(cells.min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(RegressionOptions::default, |(_, options)| options))
}
