//! Colors for numbers: even steps in value look like even steps in color.
//!
//! Colors are laid out in OKLab, where distances are those that are seen: `L` is lightness, `(a, b)` the hue and how strong
//! it is. A sequential map rises in `L` at an even rate while its hue turns; a diverging one falls away from a light
//! middle to two hues. Chroma is cut where sRGB ends, never lightness.
//!
//! # Reference
//! B. Ottosson, *A perceptual color space for image processing*, 2020 (the two matrices).

use super::Rgb;
use super::srgb::srgb_from_linear;

/// Entries of the interpolated table: 8-bit colors resolve no more.
const STEPS: usize = 256;

/// A color for every value in [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorMap {
    /// Dark violet over blue and green to light yellow: for values that rise from nothing.
    #[default]
    Sequential,
    /// Blue over near-white to red: for values to both sides of a middle.
    Diverging,
}

impl ColorMap {
    /// The colors at `i / 255`.
    pub fn table(self) -> [Rgb; STEPS] {
        std::array::from_fn(|i| {
            let t = i as f64 / (STEPS - 1) as f64;
            match self {
                Self::Sequential => sequential(t),
                Self::Diverging => diverging(t),
            }
        })
    }
}

fn sequential(t: f64) -> Rgb {
    // Hue runs backward from violet to yellow; chroma is largest in the middle of the lightness, where sRGB is widest.
    let hue_deg = 310.0 - 205.0 * t;
    srgb(0.25 + 0.68 * t, 0.115 + 0.055 * t, hue_deg)
}

fn diverging(t: f64) -> Rgb {
    let (side, hue_deg) = if t < 0.5 { (1.0 - 2.0 * t, 258.0) } else { (2.0 * t - 1.0, 27.0) };
    srgb(0.95 - 0.48 * side, 0.19 * side.powf(0.9), hue_deg)
}

/// The sRGB color of lightness `l` and hue, with the chroma wanted or the largest that sRGB has there.
fn srgb(l: f64, chroma: f64, hue_deg: f64) -> Rgb {
    let (sin, cos) = hue_deg.to_radians().sin_cos();
    let linear = |chroma: f64| linear_of_oklab(l, chroma * cos, chroma * sin);
    let fits = |chroma: f64| linear(chroma).iter().all(|v| (-1e-9..=1.0 + 1e-9).contains(v));
    let (mut inside, mut outside) = (0.0, chroma);
    if fits(chroma) {
        inside = chroma;
    } else {
        for _ in 0..40 {
            let middle = 0.5 * (inside + outside);
            if fits(middle) { inside = middle } else { outside = middle }
        }
    }
    linear(inside).map(|v| (srgb_from_linear(v.clamp(0.0, 1.0) as f32) * 255.0).round() as u8)
}

#[rustfmt::skip]
fn linear_of_oklab(l: f64, a: f64, b: f64) -> [f64; 3] {
    let [l, m, s] = [
        l + 0.396_337_777_4 * a + 0.215_803_757_3 * b,
        l - 0.105_561_345_8 * a - 0.063_854_172_8 * b,
        l - 0.089_484_177_5 * a - 1.291_485_548_0 * b,
    ].map(|v: f64| v.powi(3));
    [
         4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canvas::srgb::LINEAR;

    /// Relative luminance of a color.
    fn luminance(color: Rgb) -> f32 {
        let [r, g, b] = color.map(|v| LINEAR[usize::from(v)]);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    #[test]
    fn no_lightness_is_white_and_black_in_oklab() {
        assert_eq!(srgb(1.0, 0.0, 0.0), [255; 3]);
        assert_eq!(srgb(0.0, 0.3, 0.0), [0; 3], "chroma is cut where sRGB ends");
    }

    #[test]
    fn a_sequential_map_grows_lighter_at_every_step() {
        let table = ColorMap::Sequential.table();
        let falls = table.windows(2).filter(|w| luminance(w[1]) < luminance(w[0])).count();
        assert_eq!(falls, 0);
        assert!(luminance(table[0]) < 0.04 && luminance(table[255]) > 0.7);
    }

    #[test]
    fn a_diverging_map_is_lightest_in_the_middle_and_equally_dark_at_both_ends() {
        let table = ColorMap::Diverging.table();
        let lightest = (0..256).max_by(|a, b| luminance(table[*a]).total_cmp(&luminance(table[*b]))).expect("256");
        assert!((120..136).contains(&lightest), "{lightest}");
        let (low, high) = (luminance(table[0]), luminance(table[255]));
        assert!(low / high < 1.6 && high / low < 1.6, "{low} {high}");
        assert!(table[0][2] > table[0][0] && table[255][0] > table[255][2], "blue is less, red is more");
    }
}
