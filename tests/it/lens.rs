//! Lenses of real cameras, from files as they are.

use std::path::{Path, PathBuf};

use nalgebra::{Rotation3, UnitQuaternion};
use plumbline::camera::rotation::nearest_rotation;
use plumbline::camera::{ExifFacts, Lens, Vec3, read_lens};
use plumbline::num::math::Point2;

use crate::support::missing::real_media;

/// A file of the folder of real media, `None` with the reason printed.
fn photo_file(name: &str) -> Option<PathBuf> {
    real_media(&format!("photo/{name}"))
}

fn lens(path: &Path) -> Lens {
    read_lens(path, &ExifFacts::default()).unwrap_or_else(|e| panic!("{e}")).lens
}

/// Pixels no farther from the center than `share` of half the width.
fn pixels(lens: &Lens, share: f64) -> Vec<Point2> {
    let (w, h) = lens.size;
    let all =
        (0..=40).flat_map(|i| (0..=40).map(move |j| Point2::new(w * f64::from(i) / 40.0, h * f64::from(j) / 40.0)));
    all.filter(|p| (p - lens.center).norm() <= share * 0.5 * w).collect()
}

/// RMS and largest distance, px, between where two lenses see the directions of pixels, but for a rotation of the camera, which
/// calibrations cannot tell from a shift of the center.
fn apart(a: &Lens, b: &Lens, share: f64) -> (f64, f64) {
    let pairs: Vec<(Point2, Vec3, Vec3)> =
        pixels(a, share).into_iter().filter_map(|p| Some((p, a.unproject(p)?, b.unproject(p)?))).collect();
    let correlation = pairs.iter().map(|(_, r, s)| s * r.transpose()).sum();
    let turn: Rotation3<f64> = nearest_rotation(&correlation).expect("finite");
    let turn = UnitQuaternion::from_rotation_matrix(&turn);
    let misses: Vec<f64> = pairs.iter().map(|(p, r, _)| (b.project(&(turn * r)).expect("inside") - p).norm()).collect();
    let mean = misses.iter().map(|m| m * m).sum::<f64>() / misses.len() as f64;
    (mean.sqrt(), misses.into_iter().fold(0.0, f64::max))
}

#[test]
fn four_models_of_one_camera_agree() {
    let file = |model: &str| photo_file(&format!("fisheye/euroc_kalibr_{model}.yml"));
    let Some(kannala_brandt) = file("KB") else { return };
    let reference = lens(&kannala_brandt);
    for (model, share, rms_px, worst_px) in [("EUCM", 1.0, 0.3, 1.0), ("DS", 1.0, 0.3, 1.0), ("RadTan", 0.8, 0.3, 1.0)]
    {
        let Some(path) = file(model) else { return };
        let (rms, worst) = apart(&reference, &lens(&path), share);
        eprintln!("{model}: rms {rms:.3} px, worst {worst:.3} px");
        assert!(rms <= rms_px && worst <= worst_px, "{model}: rms {rms} px, worst {worst} px");
    }
}

#[test]
fn the_toolboxs_own_inverse_agrees_with_ours() {
    let Some(path) = photo_file("fisheye/ocam_matsuren_calib.txt") else { return };
    let lens = lens(&path);
    // The fitted inverse of the file, as the toolbox evaluates it: a polynomial of the angle above the horizon.
    let inverse = [
        772.405_470,
        504.754_051,
        7.034_666,
        45.327_180,
        54.651_570,
        0.458_049,
        -7.873_745,
        15.588_713,
        13.743_404,
        2.968_883,
    ];
    for i in 0..60 {
        let (theta, azimuth) = (0.02 + 0.026 * f64::from(i), 0.7 * f64::from(i));
        let above = theta - std::f64::consts::FRAC_PI_2;
        let rho: f64 = inverse.iter().rev().fold(0.0, |sum, c| sum * above + c);
        let (x, y) = (rho * azimuth.cos(), rho * azimuth.sin());
        let row = 1.000_305 * x - 0.000_277 * y + 794.308_657 + 0.5;
        let column = -0.000_925 * x + y + 798.175_741 + 0.5;
        let ray = Vec3::new(theta.sin() * azimuth.sin(), theta.sin() * azimuth.cos(), theta.cos());
        let p = lens.project(&ray).expect("inside the field");
        assert!((p - Point2::new(column, row)).norm() < 0.5, "{:.1}°: {p} and ({column}, {row})", theta.to_degrees());
    }
}
