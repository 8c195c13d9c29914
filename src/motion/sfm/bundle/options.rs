//! Settings of the adjustment.

use super::BundleError;
use crate::energy::Loss;
use crate::optim::levenberg_marquardt::DampingOptions;

/// How far an unknown shared by all frames may go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Freedom {
    /// It stays as it is.
    Fixed,
    /// Only the observations speak.
    Free,
    /// A Gaussian prior, in the unit of the unknown.
    Near {
        /// Mean; for the focal length px.
        value: f64,
        /// Standard deviation, > 0; for the focal length that of `ln f`, dimensionless.
        sigma: f64,
    },
}

/// Settings of [`super::adjust`].
#[derive(Clone, Debug, PartialEq)]
pub struct BundleOptions {
    /// Standard deviation of an observation in x and in y, px, > 0.
    pub sigma_px: f64,
    /// Losses of a residual's length in units of `sigma_px`, each minimized in turn from where the one before ended: the
    /// first convex, to bring a rough start home; the last redescending, to forget outliers. At least one.
    pub losses: Vec<Loss>,
    /// Frames whose poses are held. Where none is, the first one is, and the scale with it.
    pub held: Vec<u32>,
    /// The focal length, by its logarithm.
    pub focal: Freedom,
    /// The radial term `k₁`.
    pub k1: Freedom,
    /// The readout time, frame periods.
    pub readout: Freedom,
    /// Damping and when to stop, for each loss.
    pub damping: DampingOptions,
}

impl Default for BundleOptions {
    /// Huber at 1 px, then Cauchy at 1 px; lens and readout fixed.
    fn default() -> Self {
        Self {
            sigma_px: 0.5,
            losses: vec![Loss::Huber(2.0), Loss::Cauchy(2.0)],
            held: Vec::new(),
            focal: Freedom::Fixed,
            k1: Freedom::Fixed,
            readout: Freedom::Fixed,
            damping: DampingOptions::default(),
        }
    }
}

impl BundleOptions {
    pub(super) fn check(&self) -> Result<(), BundleError> {
        let losses = self.losses.iter().map(|loss| {
            let (Loss::Huber(scale) | Loss::Cauchy(scale) | Loss::GemanMcClure(scale)) = *loss;
            ("loss scale", scale)
        });
        let priors = [("sigma of ln f", self.focal), ("sigma of k1", self.k1), ("sigma of the readout", self.readout)];
        let sigmas = priors.into_iter().filter_map(|(name, freedom)| match freedom {
            Freedom::Near { sigma, .. } => Some((name, sigma)),
            Freedom::Fixed | Freedom::Free => None,
        });
        let means = [("prior mean of f", self.focal)].into_iter().filter_map(|(name, freedom)| match freedom {
            Freedom::Near { value, .. } => Some((name, value)),
            Freedom::Fixed | Freedom::Free => None,
        });
        let positive = [("sigma_px", self.sigma_px), ("lambda", self.damping.lambda)];
        for (name, value) in positive.into_iter().chain(losses).chain(sigmas).chain(means) {
            if !(value > 0.0 && value.is_finite()) {
                return Err(BundleError::Option { name, value, range: "above 0, finite" });
            }
        }
        if self.losses.is_empty() {
            return Err(BundleError::Option { name: "number of losses", value: 0.0, range: "at least 1" });
        }
        Ok(())
    }
}
