//! Robust estimation of matrices `M` of epipolar geometry, `m₂ᵀ M m₁ = 0`, generic over the family (essential,
//! fundamental).

use std::marker::PhantomData;

use nalgebra::{Const, DimMin, Matrix3};

use super::correspondence::Correspondence;
use super::sampson::{self, Chart};
use plumbline_num::optim::ransac::Consensus;

/// Levenberg–Marquardt steps of one refit inside the search. A few are enough: a refit starts near its minimum and is
/// repeated by the search.
const REFIT_STEPS: usize = 4;

/// A family of matrices with `N` free parameters, given by charts around its members.
pub(super) trait EpipolarFamily<const N: usize>: Chart<N> + Sized {
    /// Size of a minimal sample: correspondences that determine a member up to finitely many solutions.
    const SAMPLE: usize;

    /// Pushes the members that satisfy [`Self::SAMPLE`] correspondences to `models`.
    fn fit_minimal(sample: &[Correspondence], models: &mut Vec<Matrix3<f64>>);

    /// The chart around a member; `None` if the matrix is not one.
    fn of_matrix(matrix: &Matrix3<f64>) -> Option<Self>;
}

/// Consensus problem: correspondences to be explained by a member of the family `C`.
pub(super) struct Epipolar<'a, C, const N: usize> {
    pairs: &'a [Correspondence],
    family: PhantomData<C>,
}

impl<'a, C, const N: usize> Epipolar<'a, C, N> {
    pub(super) fn of(pairs: &'a [Correspondence]) -> Self {
        Self { pairs, family: PhantomData }
    }
}

impl<C: EpipolarFamily<N>, const N: usize> Consensus for Epipolar<'_, C, N>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    type Model = Matrix3<f64>;

    fn len(&self) -> usize {
        self.pairs.len()
    }

    fn sample_size(&self) -> usize {
        C::SAMPLE
    }

    fn fit_minimal(&self, sample: &[usize], models: &mut Vec<Matrix3<f64>>) {
        let mut drawn = [self.pairs[sample[0]]; plumbline_num::optim::ransac::MAX_SAMPLE];
        drawn.iter_mut().zip(sample).for_each(|(pair, &k)| *pair = self.pairs[k]);
        C::fit_minimal(&drawn[..sample.len()], models);
    }

    /// Local minimum of the weighted squared Sampson distance, from the initial guess `start`.
    fn fit_weighted(&self, weights: &[f64], start: &Matrix3<f64>) -> Option<Matrix3<f64>> {
        Some(sampson::refined(C::of_matrix(start)?, self.pairs, weights, REFIT_STEPS).matrix())
    }

    fn squared_residual(&self, model: &Matrix3<f64>, i: usize) -> f64 {
        sampson::squared_distance(model, &self.pairs[i])
    }

    fn group(&self, i: usize) -> u32 {
        i as u32
    }
}
