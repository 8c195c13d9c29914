//! The gray levels of an endless textured plane, for clips of which every point's motion is known.

use plumbline_num::math::Point2;

/// Gray level, 0 to 255, of the plane `seed` at a point, px: three octaves of noise whose finest details are 6 px, as wide as the
/// corners of a sharp picture.
///
/// # Example
/// ```
/// use plumbline_num::math::Point2;
/// use plumbline_testkit::plane::texture;
///
/// let level = texture(Point2::new(12.5, -7.0), 3);
/// assert!((0.0..=255.0).contains(&level) && level == texture(Point2::new(12.5, -7.0), 3));
/// ```
pub fn texture(p: Point2, seed: u64) -> f64 {
    let octave = |size: f64, k: u64| noise(p.x / size, p.y / size, seed * 16 + k);
    (125.0 + 55.0 * octave(61.0, 0) + 45.0 * octave(17.0, 1) + 35.0 * octave(6.0, 2)).clamp(0.0, 255.0)
}

/// Smooth value noise in [−1, 1]: lattice values blended by a smooth step.
fn noise(x: f64, y: f64, seed: u64) -> f64 {
    let (i, j) = (x.floor(), y.floor());
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (a, b) = (smooth(x - i), smooth(y - j));
    let at = |di: f64, dj: f64| {
        let key = ((i + di) as i64 as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
            ^ ((j + dj) as i64 as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
        let mut k = key ^ seed.wrapping_mul(0x1656_67b1_9e37_79f9);
        k = (k ^ (k >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        k = (k ^ (k >> 29)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((k >> 40) as f64 / f64::from(1 << 23)) - 1.0
    };
    let (top, bottom) = (at(0.0, 0.0) * (1.0 - a) + at(1.0, 0.0) * a, at(0.0, 1.0) * (1.0 - a) + at(1.0, 1.0) * a);
    top * (1.0 - b) + bottom * b
}
