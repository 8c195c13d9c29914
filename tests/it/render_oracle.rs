//! Rendered values against `tests/oracle/render.py`, which sums in floating point what the renderer does with tables,
//! fixed-point positions and a lattice.

use plumbline::image::render::{Border, Interpolation, RenderOptions, Renderer};
use plumbline::image::warp::{Lattice, Map, WarpField};
use plumbline::image::{Frame, Layout, PixelFormat};
use plumbline::num::math::Homography;

const POINTS: [(usize, usize); 8] =
    [(20, 20), (77, 31), (150, 100), (151, 100), (233, 57), (201, 144), (64, 171), (290, 180)];

/// Printed by the oracle.
const EXPECTED: [(Interpolation, [f64; 8]); 3] = [
    (Interpolation::Bilinear, [2135.63, 3007.38, 1962.81, 1737.06, 2288.46, 2078.61, 3302.74, 1663.34]),
    (Interpolation::Bicubic, [2149.48, 3026.71, 1965.21, 1737.90, 2300.25, 2088.82, 3332.10, 1661.39]),
    (Interpolation::Lanczos3, [2141.38, 3015.20, 1962.50, 1735.55, 2297.63, 2083.24, 3324.12, 1667.36]),
];

#[test]
fn values_equal_summation_in_floating_point() {
    let mut src = Frame::new(PixelFormat::opaque(Layout::Gray, 12), 320, 200);
    for y in 0..200 {
        for (x, sample) in src.plane16_mut(0).expect("own memory").row_mut(y).iter_mut().enumerate() {
            let (x, y) = (x as f64, y as f64);
            let value = 2048.0 + 900.0 * (0.35 * x + 0.2 * y).sin() + 800.0 * (0.27 * y - 0.11 * x).cos();
            *sample = value.round() as u16;
        }
    }
    #[rustfmt::skip]
    let back = nalgebra::Matrix3::new(
         0.93,   0.021,  7.3,
        -0.017,  0.94,   4.9,
         1.1e-5, -1.6e-5, 1.0,
    );
    let field = WarpField { chain: vec![Map::Homography(Homography::new(back))] };
    let lattice = Lattice::new(&field, 320, 200);
    for (interpolation, expected) in EXPECTED {
        let mut dst = Frame::new(src.format, 320, 200);
        let renderer = Renderer::new(RenderOptions { interpolation, border: Border::Replicate });
        renderer.render(&src, &lattice, &mut dst).expect("sizes and formats agree");
        let plane = dst.plane16(0).expect("12 bit");
        for ((x, y), expected) in POINTS.into_iter().zip(expected) {
            // Positions are off by up to 1/512 px and 0.001 of the lattice, the slope is up to 500 per px along x and
            // 400 along y: 2.6; half a unit is rounding.
            let off = (f64::from(plane.row(y)[x]) - expected).abs();
            assert!(off < 3.1, "{interpolation:?} at ({x}, {y}): {} for {expected}", plane.row(y)[x]);
        }
    }
}
