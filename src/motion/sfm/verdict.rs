//! What a reconstruction is worth, by its figures.
//!
//! Low residuals do not prove cameras, so a map counts as 3D only where its points are seen under an angle, in enough of
//! the frames and of the picture, and where the focal length is determined.

use super::figures::SfmFigures;

/// Triangulation angle, rad, median over points, from which on two frames carry a map.
pub(super) const LEAST_ANGLE: f64 = 0.017;
/// Parallax, in RMS residuals, median over points, from which on depth is believed: a tenth of its depth is then known of a
/// point seen twice. Shots of a far scene have points under half a degree that are tracked to 0.3 px, which is 20 times that;
/// what a turning camera makes up is within a few.
const LEAST_PARALLAX: f64 = 10.0;
/// Share of frames that must have a camera.
const LEAST_REGISTERED: f64 = 0.7;
/// RMS reprojection, px at 640 px across, beyond which cameras are not believed.
const MOST_RMS_PX: f64 = 1.5;
/// Uncertainty of `ln f` beyond which the focal length is not believed.
const MOST_SIGMA_LN_FOCAL: f64 = 0.3;
/// Radial term beyond which a lens is not believed: fisheyes have 0.3.
const MOST_K1: f64 = 0.5;
/// Share of the cells that must hold points, mean over frames.
const LEAST_COVERAGE: f64 = 0.35;

/// What a shot's tracks allow to say about its cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SfmVerdict {
    /// Cameras with places, points with depths.
    #[serde(rename = "3d")]
    ThreeD,
    /// The scene is one plane; places are in units of its distance.
    Planar,
    /// The camera only turned.
    RotationOnly,
    /// The focal length changes.
    Zoom,
    /// Too few still points.
    TooFewPoints,
    /// No cameras were found that explain the tracks.
    Failed,
}

/// Whether the figures bear the verdict.
pub(super) fn judged(figures: &SfmFigures, k1: f64, verdict: SfmVerdict, unit_px: f64) -> (SfmVerdict, String) {
    let f = figures;
    let registered = f.registered as f64 / f.frames.max(1) as f64;
    let failed = |why: String| (SfmVerdict::Failed, why);
    if !(registered >= LEAST_REGISTERED) {
        failed(format!("cameras for {} of {} frames only", f.registered, f.frames))
    } else if !(f.rms_px <= MOST_RMS_PX * unit_px) {
        failed(format!("points lie {:.1} px beside where the cameras see them", f.rms_px))
    } else if !(f.coverage >= LEAST_COVERAGE) {
        failed(format!("still points on {:.0} % of the picture only", 100.0 * f.coverage))
    } else if verdict == SfmVerdict::ThreeD && !(f.angle * f.focal >= LEAST_PARALLAX * f.rms_px && f.angle > 0.0) {
        failed(format!("points are seen under {:.2} degrees only, to {:.2} px", f.angle.to_degrees(), f.rms_px))
    } else if verdict == SfmVerdict::ThreeD && !f.sigma_ln_focal.is_some_and(|s| s <= MOST_SIGMA_LN_FOCAL) {
        failed("the focal length cannot be told".to_owned())
    } else if !(k1.abs() <= MOST_K1) {
        failed(format!("no lens bends as much as the tracks would need, k1 {k1:.2}"))
    } else {
        let angle = f.angle.to_degrees();
        (verdict, format!("{} points seen under {angle:.1} degrees, to {:.2} px", f.points, f.reprojection_px))
    }
}
