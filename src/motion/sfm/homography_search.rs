//! Homographies between two views as a consensus problem.

use super::correspondence::Correspondence;
use super::rotation_fit::homography_squared_distance;
use crate::math::Homography;
use crate::motion::{FrameScale, Pair, homography, homography_of_four};
use crate::optim::ransac::Consensus;

/// Gauss–Newton steps of one refit inside the search: it starts near and repeats.
const REFIT_STEPS: usize = 3;

/// Correspondences in normalized image coordinates explained by homographies.
pub(super) struct ByPlane<'a> {
    correspondences: &'a [Correspondence],
    pairs: Vec<Pair>,
    scale: FrameScale,
}

impl<'a> ByPlane<'a> {
    pub(super) fn new(correspondences: &'a [Correspondence]) -> Self {
        let pair = |c: &Correspondence| {
            let (previous, this) = c.points();
            Pair { previous, this }
        };
        // Normalized image coordinates have their center at 0 and a size of about 1 already: the scale of an empty frame
        // changes nothing.
        Self { correspondences, pairs: correspondences.iter().map(pair).collect(), scale: FrameScale::new(0, 0) }
    }
}

impl Consensus for ByPlane<'_> {
    type Model = Homography;

    fn len(&self) -> usize {
        self.pairs.len()
    }

    fn sample_size(&self) -> usize {
        4
    }

    fn fit_minimal(&self, sample: &[usize], models: &mut Vec<Homography>) {
        models.extend(homography_of_four([0, 1, 2, 3].map(|k| self.pairs[sample[k]]), &self.scale));
    }

    fn fit_weighted(&self, weights: &[f64], start: &Homography) -> Option<Homography> {
        homography(&self.pairs, weights, start, 0.0, &self.scale, REFIT_STEPS)
    }

    fn squared_residual(&self, model: &Homography, i: usize) -> f64 {
        homography_squared_distance(model.matrix(), &self.correspondences[i])
    }

    fn group(&self, i: usize) -> u32 {
        i as u32
    }
}
