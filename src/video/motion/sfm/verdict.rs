//! Quality verdict of a reconstruction from its figures.
//!
//! Low residuals do not prove correct cameras. A map therefore counts as 3D only if its depths predict held-out
//! observations better than homographies do ([`super::prediction`]), in a sufficient fraction of the frames and of the
//! image, and if the focal length is determined.

use super::figures::{MIN_COVERAGE, SfmFigures};
use super::mapper::WRONG_PX;

/// Minimum triangulation angle, rad, median over points, of two frames that initialize a map: 3 px at usual focal
/// lengths. The quality of the map itself is determined when it is complete.
pub(super) const MIN_ANGLE: f64 = 0.006;
/// Maximum ratio of the held-out prediction error with depth to that with homographies. Measured: scenes with depth
/// 0.34 to 0.64 (0.77 where the camera walks down a street, in the viewing direction); spurious depths of cameras that
/// rotate or are static, 1.4 to 1.6; planes, for which a depth is one parameter too many, 2.
const MAX_PREDICTED_FRACTION: f64 = 0.9;
/// Minimum number of predicted observations for the test to apply: the root mean square of so many errors is known to 7 %
/// (1/√200), less than the margin of [`MAX_PREDICTED_FRACTION`].
const MIN_PREDICTED: usize = 100;
/// Minimum parallax, in RMS residuals, median over points, for depth to be accepted if too few observations were
/// predicted: the depth of a point observed twice is then known to a tenth.
const MIN_PARALLAX: f64 = 10.0;
/// The same for a plane, if depths predict no better than homographies: spurious depths reached 9, planes 300.
const PLANE_PARALLAX: f64 = 30.0;
/// Minimum fraction of frames with a camera.
const MIN_REGISTERED: f64 = 0.7;
/// Maximum RMS reprojection error of accepted cameras, px at 640 px across. Errors are counted up to [`WRONG_PX`]; spread
/// evenly up to there, as those of wrong cameras, they have an RMS of `WRONG_PX/√2`.
const MAX_RMS_PX: f64 = 0.5 * WRONG_PX;
/// Maximum standard deviation of `ln f` of an accepted focal length.
const MAX_SIGMA_LN_FOCAL: f64 = 0.3;
/// Maximum radial term of an accepted lens: fisheyes have 0.3.
const MAX_K1: f64 = 0.5;

/// Kind of camera path that the tracks of a shot determine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum SfmVerdict {
    /// Cameras with positions, points with depths.
    #[serde(rename = "3d")]
    ThreeD,
    /// The scene is one plane; positions are in units of its distance.
    Planar,
    /// The camera only rotated.
    RotationOnly,
    /// The focal length changes.
    Zoom,
    /// Too few static points.
    TooFewPoints,
    /// No cameras were found that explain the tracks.
    Failed,
}

impl SfmVerdict {
    /// Whether this verdict comes with cameras.
    pub fn has_cameras(self) -> bool {
        matches!(self, Self::ThreeD | Self::Planar | Self::RotationOnly)
    }
}

/// Whether the depths of a map have predictive value.
pub(super) fn predicts(f: &SfmFigures) -> bool {
    if f.predicted < MIN_PREDICTED {
        return f.angle > 0.0 && f.angle * f.focal >= MIN_PARALLAX * f.rms_px;
    }
    f.predicted_px <= MAX_PREDICTED_FRACTION * f.homography_px
}

/// Whether the camera moved in front of a plane: homographies predict as well as depths, at parallaxes that spurious
/// depths do not reach.
fn is_plane(f: &SfmFigures) -> bool {
    f.predicted >= MIN_PREDICTED
        && !predicts(f)
        && f.homography_px > 0.0
        && f.angle * f.focal >= PLANE_PARALLAX * f.rms_px
}

fn no_depth(f: &SfmFigures) -> String {
    if f.predicted < MIN_PREDICTED {
        return format!("points are seen under {:.2} degrees only, to {:.2} px", f.angle.to_degrees(), f.rms_px);
    }
    format!("depth predicts points to {:.2} px, homographies to {:.2} px", f.predicted_px, f.homography_px)
}

/// The verdict that the figures support, with the reason.
pub(super) fn judged(figures: &SfmFigures, k1: f64, verdict: SfmVerdict, unit_px: f64) -> (SfmVerdict, String) {
    let f = figures;
    let registered = f.registered as f64 / f.frames.max(1) as f64;
    let failed = |why: String| (SfmVerdict::Failed, why);
    if !(registered >= MIN_REGISTERED) {
        failed(format!("cameras for {} of {} frames only", f.registered, f.frames))
    } else if !(f.rms_px <= MAX_RMS_PX * unit_px) {
        failed(format!("points lie {:.1} px beside where the cameras see them", f.rms_px))
    } else if !(f.coverage >= MIN_COVERAGE) {
        failed(format!("still points on {:.0} % of the picture only", 100.0 * f.coverage))
    } else if verdict == SfmVerdict::ThreeD && !predicts(f) && !is_plane(f) {
        failed(no_depth(f))
    } else if verdict == SfmVerdict::ThreeD && !f.sigma_ln_focal.is_some_and(|s| s <= MAX_SIGMA_LN_FOCAL) {
        failed("the focal length cannot be told".to_owned())
    } else if !(k1.abs() <= MAX_K1) {
        failed(format!("no lens bends as much as the tracks would need, k1 {k1:.2}"))
    } else {
        let angle = f.angle.to_degrees();
        let verdict = if verdict == SfmVerdict::ThreeD && is_plane(f) { SfmVerdict::Planar } else { verdict };
        (verdict, format!("{} points seen under {angle:.1} degrees, to {:.2} px", f.points, f.reprojection_px))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> SfmFigures {
        SfmFigures {
            registered: 100,
            frames: 100,
            points: 900,
            observations: 30_000,
            reprojection_px: 0.3,
            rms_px: 0.4,
            angle: 0.004,
            coverage: 0.9,
            focal: 600.0,
            sigma_ln_focal: Some(0.01),
            predicted: 2000,
            predicted_px: 1.0,
            homography_px: 1.4,
        }
    }

    fn verdict(change: impl Fn(&mut SfmFigures)) -> SfmVerdict {
        let mut figures = good();
        change(&mut figures);
        judged(&figures, 0.0, SfmVerdict::ThreeD, 1.0).0
    }

    #[test]
    fn depth_counts_by_what_it_foretells_and_not_by_the_angle() {
        assert_eq!(verdict(|_| {}), SfmVerdict::ThreeD);
        assert_eq!(verdict(|f| f.predicted_px = 1.3), SfmVerdict::Failed);
        assert_eq!(verdict(|f| (f.predicted_px, f.angle) = (1.3, 0.019)), SfmVerdict::Failed);
        assert_eq!(verdict(|f| (f.predicted_px, f.angle) = (1.3, 0.021)), SfmVerdict::Planar);
        assert_eq!(verdict(|f| (f.predicted_px, f.angle, f.rms_px) = (1.3, 0.1, 1.6)), SfmVerdict::Failed);
    }

    #[test]
    fn where_little_was_foretold_the_parallax_decides() {
        let few =
            |angle: f64| verdict(|f| (f.predicted, f.predicted_px, f.homography_px, f.angle) = (20, 9.0, 1.0, angle));
        assert_eq!((few(0.0066), few(0.0068)), (SfmVerdict::Failed, SfmVerdict::ThreeD));
        assert_eq!(verdict(|f| (f.predicted, f.angle, f.rms_px) = (0, 0.0, 0.0)), SfmVerdict::Failed);
    }

    #[test]
    fn each_figure_alone_can_fail_a_map_and_figures_that_are_no_numbers_do() {
        let changes: [fn(&mut SfmFigures); 8] = [
            |f| f.registered = 69,
            |f| f.rms_px = 1.6,
            |f| f.rms_px = f64::NAN,
            |f| f.coverage = 0.3,
            |f| f.sigma_ln_focal = None,
            |f| f.sigma_ln_focal = Some(0.4),
            |f| f.predicted_px = f64::NAN,
            |f| f.homography_px = f64::NAN,
        ];
        for (k, change) in changes.into_iter().enumerate() {
            assert_eq!(verdict(change), SfmVerdict::Failed, "change {k}");
        }
        assert_eq!(judged(&good(), 0.6, SfmVerdict::ThreeD, 1.0).0, SfmVerdict::Failed, "no lens bends so much");
    }

    #[test]
    fn planes_and_turns_need_neither_depth_nor_focal_length() {
        let figures = SfmFigures { predicted_px: 9.0, sigma_ln_focal: None, ..good() };
        for kind in [SfmVerdict::Planar, SfmVerdict::RotationOnly] {
            assert_eq!(judged(&figures, 0.0, kind, 1.0).0, kind);
        }
    }
}
