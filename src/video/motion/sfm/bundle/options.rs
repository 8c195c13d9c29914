//! Settings of the adjustment.

use plumbline_num::energy::Loss;
use plumbline_num::optim::levenberg_marquardt::DampingOptions;
use plumbline_num::options::OptionError;

/// Residual, in standard deviations, below which observations count as met exactly; gains below it are rounding of what
/// was tracked.
const EXACT: f64 = 1e-4;

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

/// How residuals are judged, and how long is searched.
#[derive(Clone, Debug, PartialEq)]
pub struct RobustFit {
    /// Standard deviation of an observation in x and in y, px, > 0.
    pub sigma_px: f64,
    /// Losses of a residual's length in units of `sigma_px`, each minimized in turn from where the one before ended: the
    /// first convex, to bring a rough start home; the last redescending, to forget outliers. At least one.
    pub losses: Vec<Loss>,
    /// Damping and when to stop, for each loss.
    pub damping: DampingOptions,
}

impl Default for RobustFit {
    /// Observations good to half a pixel; Huber's loss, then Cauchy's, both bent at two standard deviations.
    fn default() -> Self {
        Self { sigma_px: 0.5, losses: vec![Loss::Huber(2.0), Loss::Cauchy(2.0)], damping: DampingOptions::default() }
    }
}

impl RobustFit {
    pub(super) fn check(&self) -> Result<(), OptionError> {
        let losses = self.losses.iter().map(|loss| {
            let (Loss::Huber(scale) | Loss::Cauchy(scale) | Loss::GemanMcClure(scale)) = *loss;
            ("loss scale", scale)
        });
        OptionError::check_positive(
            [("sigma_px", self.sigma_px), ("lambda", self.damping.lambda)].into_iter().chain(losses),
        )?;
        OptionError::check(!self.losses.is_empty(), "number of losses", 0.0, "at least 1")
    }

    /// Damping for so many observations: where they are met to [`EXACT`], the search ends whatever share is still gained.
    pub(super) fn damping_for(&self, observations: usize) -> DampingOptions {
        DampingOptions { floor: self.damping.floor + EXACT * EXACT * observations as f64, ..self.damping }
    }
}

/// Settings of [`super::adjust`].
#[derive(Clone, Debug, PartialEq)]
pub struct BundleOptions {
    /// Residuals and search.
    pub fit: RobustFit,
    /// Frames whose poses are held. Where none is, the first one is, and the scale with it.
    pub fixed_frames: Vec<u32>,
    /// Cameras turn and do not move: all translations are held. Where they are equal, no observation tells a depth, and the
    /// points stay at the inverse depths they have.
    pub rotation_only: bool,
    /// The focal length, by its logarithm.
    pub focal: Freedom,
    /// The radial term `k₁`.
    pub k1: Freedom,
    /// The readout time, frame periods.
    pub readout: Freedom,
    /// Whether the uncertainty of the focal length is wanted; it costs as much as a step.
    pub uncertainty: bool,
}

impl Default for BundleOptions {
    /// Every pose is free, lens and readout are fixed.
    fn default() -> Self {
        Self {
            fit: RobustFit::default(),
            fixed_frames: Vec::new(),
            rotation_only: false,
            focal: Freedom::Fixed,
            k1: Freedom::Fixed,
            readout: Freedom::Fixed,
            uncertainty: true,
        }
    }
}

impl BundleOptions {
    pub(super) fn check(&self) -> Result<(), OptionError> {
        self.fit.check()?;
        let priors = [("sigma of ln f", self.focal), ("sigma of k1", self.k1), ("sigma of the readout", self.readout)];
        OptionError::check_positive(priors.into_iter().filter_map(|(name, freedom)| match freedom {
            Freedom::Near { sigma, .. } => Some((name, sigma)),
            Freedom::Fixed | Freedom::Free => None,
        }))?;
        match self.focal {
            Freedom::Near { value, .. } => OptionError::check_positive([("prior mean of f", value)]),
            Freedom::Fixed | Freedom::Free => Ok(()),
        }
    }
}
