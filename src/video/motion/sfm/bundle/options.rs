//! Options of the adjustment.

use plumbline_num::energy::Loss;
use plumbline_num::optim::levenberg_marquardt::DampingOptions;
use plumbline_num::options::OptionError;

/// Residual, in standard deviations, below which observations count as fitted exactly: lower costs differ by the
/// rounding of the tracked positions only.
const EXACT: f64 = 1e-4;

/// Freedom of an unknown shared by all frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Freedom {
    /// Constant.
    Fixed,
    /// Free, without a prior.
    Free,
    /// A Gaussian prior, in the unit of the unknown.
    Near {
        /// Mean; for the focal length px.
        value: f64,
        /// Standard deviation, > 0; for the focal length that of `ln f`, dimensionless.
        sigma: f64,
    },
}

/// Robust loss and termination of the solver.
#[derive(Clone, Debug, PartialEq)]
pub struct RobustFit {
    /// Standard deviation of an observation in x and in y, px, > 0.
    pub sigma_px: f64,
    /// Losses of a residual's length in units of `sigma_px`, minimized one after the other, each from the result of
    /// the one before. Put a convex loss first, for convergence from a poor initial guess, and a redescending one
    /// last, to reject outliers. At least one.
    pub losses: Vec<Loss>,
    /// Damping and termination criteria, for each loss.
    pub damping: DampingOptions,
}

impl Default for RobustFit {
    /// Observations with a standard deviation of half a pixel; Huber's loss, then Cauchy's, both with a scale of two
    /// standard deviations.
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

    /// Damping options for this number of observations: once the cost corresponds to residuals of [`EXACT`], the
    /// search ends at any relative decrease.
    pub(super) fn damping_for(&self, observations: usize) -> DampingOptions {
        DampingOptions { floor: self.damping.floor + EXACT * EXACT * observations as f64, ..self.damping }
    }
}

/// Options of [`super::adjust`].
#[derive(Clone, Debug, PartialEq)]
pub struct BundleOptions {
    /// Robust loss and solver.
    pub fit: RobustFit,
    /// Frames whose poses are fixed. If empty, the first pose is fixed, and the scale.
    pub fixed_frames: Vec<u32>,
    /// Pure camera rotation: all translations are fixed. If they are equal, no observation determines a depth, and the
    /// points keep their inverse depths.
    pub rotation_only: bool,
    /// The focal length, by its logarithm.
    pub focal: Freedom,
    /// The radial term `k₁`.
    pub k1: Freedom,
    /// The readout time, frame periods.
    pub readout: Freedom,
    /// Whether to compute the standard deviation of the focal length; it costs as much as one iteration.
    pub uncertainty: bool,
}

impl Default for BundleOptions {
    /// All poses free, lens and readout fixed.
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
