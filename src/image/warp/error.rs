//! What a warp can refuse.

use plumbline_num::energy::EnergyError;
use plumbline_num::options::OptionError;

/// Why no warp could be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WarpError {
    /// Settings: the grid.
    #[error(
        "a grid of {cols}×{rows} cells over {width}×{height} px is invalid (1 to 1024 cells each way, size above 0)"
    )]
    Grid {
        /// Cells along x.
        cols: usize,
        /// Cells along y.
        rows: usize,
        /// Width of the image, px.
        width: f64,
        /// Height of the image, px.
        height: f64,
    },
    /// Settings: an option out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Input: a point pair with a NaN, an infinite coordinate, or a weight that is not in [0, ∞).
    #[error("point {index} is not usable: source ({}, {}), target ({}, {}), weight {weight} (finite, weight 0 or more)", src[0], src[1], dst[0], dst[1])]
    Point {
        /// Position in the list of points.
        index: usize,
        /// Source, px.
        src: [f64; 2],
        /// Target, px.
        dst: [f64; 2],
        /// Weight.
        weight: f64,
    },
    /// Input: saliency must be one finite, positive number per cell, or absent.
    #[error("saliency of cell {cell} is {value} (expected {cells} finite numbers above 0, or none)")]
    Saliency {
        /// First cell that has none or a bad one.
        cell: usize,
        /// Its value, NaN where absent.
        value: f64,
        /// Cells of the grid.
        cells: usize,
    },
    /// Input: the pre-warp mirrors, collapses or sends to infinity some cell of the image.
    #[error("the pre-warp does not map the image one to one: cell {cell} folds or reaches infinity")]
    PreWarp {
        /// First such cell, row-major.
        cell: usize,
    },
    /// Numerics: the solve failed.
    #[error("the warp could not be solved: {0}")]
    Energy(#[from] EnergyError),
}
