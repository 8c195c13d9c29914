//! From a frame's samples to the red, green and blue of web pages (sRGB).
//!
//! ```text
//! Y′CbCr → R′G′B′ by the frame's own matrix and range        sources of standard range: as they are
//! R′G′B′ → light (HLG, PQ), 203 cd/m² as 1 → BT.709 primaries → shoulder → sRGB        others
//! ```
//!
//! Where a frame does not name its matrix, BT.709 is taken from 720 rows on and BT.601 below, as players do.
//!
//! # Reference
//! ITU-T H.273 (codes); ITU-R BT.2100 (HLG, PQ); ITU-R BT.2408 (203 cd/m² for what is white in a graphic).

use plumbline_image::{ColorDescription, Frame, Layout};

/// Light, in units of diffuse white, above which highlights are compressed; below, tones stay as they are.
const SHOULDER: f64 = 0.6;

/// Luminance of diffuse white, cd/m².
const WHITE: f64 = 203.0;

/// How the samples of one clip become colors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Conversion {
    layout: Layout,
    /// Code value of black and extent up to white, of luma; the same of chroma, whose middle is the first.
    luma: (f64, f64),
    chroma: (f64, f64),
    /// Weights of red and blue in luma.
    weights: (f64, f64),
    transfer: Transfer,
    wide: bool,
}

/// How code values stand for light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Transfer {
    /// As screens expect them.
    Standard,
    /// Hybrid log-gamma.
    Hlg,
    /// Perceptual quantizer.
    Pq,
}

impl Conversion {
    pub(super) fn of(frame: &Frame) -> Self {
        let (format, color) = (frame.format, &frame.color);
        let full = color.full_range.unwrap_or(!format.is_yuv()) || format.layout == Layout::Gbr;
        let unit = f64::from(1_u32 << (format.bits.clamp(8, 16) - 8));
        let most = f64::from((1_u32 << format.bits.clamp(8, 16)) - 1);
        let (luma, chroma) = if full {
            ((0.0, most), (128.0 * unit, most))
        } else {
            ((16.0 * unit, 219.0 * unit), (128.0 * unit, 224.0 * unit))
        };
        let transfer = match color.transfer {
            16 => Transfer::Pq,
            18 => Transfer::Hlg,
            _ => Transfer::Standard,
        };
        let weights = weights(color, frame.height);
        Self { layout: format.layout, luma, chroma, weights, transfer, wide: color.primaries == 9 }
    }

    /// The color of samples in the order of the planes; of gray only the first counts.
    pub(super) fn rgb(&self, samples: [f64; 3]) -> [u8; 3] {
        let coded = |sample: f64, (black, extent): (f64, f64)| (sample - black) / extent;
        let [a, b, c] = samples;
        let signal = match self.layout {
            Layout::Gray => [coded(a, self.luma); 3],
            Layout::Gbr => [c, a, b].map(|v| coded(v, self.luma)),
            _ => self.unmixed(coded(a, self.luma), coded(b, self.chroma), coded(c, self.chroma)),
        };
        let signal = if self.transfer == Transfer::Standard && !self.wide { signal } else { self.displayed(signal) };
        signal.map(|v| (255.0 * v.clamp(0.0, 1.0)).round() as u8)
    }

    fn unmixed(&self, y: f64, cb: f64, cr: f64) -> [f64; 3] {
        let (kr, kb) = self.weights;
        let (r, b) = (y + 2.0 * (1.0 - kr) * cr, y + 2.0 * (1.0 - kb) * cb);
        [r, (y - kr * r - kb * b) / (1.0 - kr - kb), b]
    }

    /// The sRGB signal of a signal of another transfer or of wide primaries.
    fn displayed(&self, signal: [f64; 3]) -> [f64; 3] {
        let light = match self.transfer {
            Transfer::Standard => signal.map(srgb_light),
            Transfer::Hlg => hlg_light(signal),
            Transfer::Pq => signal.map(pq_light),
        };
        let light = if self.wide { narrowed(light) } else { light }.map(|v| v.max(0.0));
        let brightest = light.into_iter().fold(0.0, f64::max);
        let share = if self.transfer != Transfer::Standard && brightest > SHOULDER {
            let over = (brightest - SHOULDER) / (1.0 - SHOULDER);
            (SHOULDER + (1.0 - SHOULDER) * over / (1.0 + over)) / brightest
        } else {
            1.0
        };
        light.map(|v| srgb_signal(v * share))
    }
}

/// Weights of red and blue by the code of the matrix.
fn weights(color: &ColorDescription, height: usize) -> (f64, f64) {
    let (bt709, bt601) = ((0.2126, 0.0722), (0.299, 0.114));
    match color.matrix {
        1 => bt709,
        4 => (0.30, 0.11),
        5 | 6 => bt601,
        7 => (0.212, 0.087),
        9 | 10 => (0.2627, 0.0593),
        _ if height >= 720 => bt709,
        _ => bt601,
    }
}

fn srgb_light(v: f64) -> f64 {
    let v = v.max(0.0);
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

fn srgb_signal(v: f64) -> f64 {
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// Light of a PQ signal, in units of diffuse white.
fn pq_light(v: f64) -> f64 {
    let (m1, m2) = (0.159_301_757_812_5, 78.843_75);
    let (c1, c2, c3) = (0.835_937_5, 18.851_562_5, 18.687_5);
    let p = v.clamp(0.0, 1.0).powf(1.0 / m2);
    10_000.0 / WHITE * ((p - c1).max(0.0) / (c2 - c3 * p)).powf(1.0 / m1)
}

/// Light that a display of 1000 cd/m² makes of an HLG signal, in units of diffuse white.
fn hlg_light(signal: [f64; 3]) -> [f64; 3] {
    let (a, b, c) = (0.178_832_77, 0.284_668_92, 0.559_910_73);
    let scene = signal.map(|v| {
        let v = v.clamp(0.0, 1.0);
        if v <= 0.5 { v * v / 3.0 } else { (((v - c) / a).exp() + b) / 12.0 }
    });
    let luminance = 0.2627 * scene[0] + 0.678 * scene[1] + 0.0593 * scene[2];
    let gain = 1000.0 / WHITE * luminance.max(1e-9).powf(0.2);
    scene.map(|v| v * gain)
}

/// Light of BT.2020 primaries as that of BT.709 ones; colors that those cannot show go below zero.
fn narrowed([r, g, b]: [f64; 3]) -> [f64; 3] {
    [1.6605 * r - 0.5876 * g - 0.0728 * b, -0.1246 * r + 1.1329 * g - 0.0083 * b, -0.0182 * r - 0.1006 * g + 1.1187 * b]
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::PixelFormat;

    fn conversion(layout: Layout, bits: u8, height: usize, color: ColorDescription) -> Conversion {
        let mut frame = Frame::new(PixelFormat::opaque(layout, bits), 16, height);
        frame.color = color;
        Conversion::of(&frame)
    }

    fn tagged(matrix: u8, full_range: Option<bool>) -> ColorDescription {
        ColorDescription { full_range, matrix, ..ColorDescription::default() }
    }

    #[test]
    fn the_primaries_of_both_matrices_come_out_at_any_depth() {
        for (matrix, red, blue) in
            [(6, [81.0, 90.0, 240.0], [41.0, 240.0, 110.0]), (1, [63.0, 102.0, 240.0], [32.0, 240.0, 118.0])]
        {
            for bits in [8, 10, 16] {
                let it = conversion(Layout::Yuv420, bits, 360, tagged(matrix, None));
                let unit = f64::from(1 << (bits - 8));
                for (samples, wanted) in [
                    (red, [255, 0, 0]),
                    (blue, [0, 0, 255]),
                    ([235.0, 128.0, 128.0], [255; 3]),
                    ([16.0, 128.0, 128.0], [0; 3]),
                ] {
                    let rgb = it.rgb(samples.map(|v| v * unit));
                    assert!(
                        rgb.iter().zip(wanted).all(|(a, b)| a.abs_diff(b) <= 3),
                        "{matrix} {bits}: {rgb:?} {wanted:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn an_unspecified_matrix_is_that_of_the_picture_s_size() {
        let rgb =
            |height, matrix| conversion(Layout::Yuv420, 8, height, tagged(matrix, None)).rgb([100.0, 90.0, 200.0]);
        assert_eq!(rgb(719, 2), rgb(719, 6));
        assert_eq!(rgb(720, 2), rgb(720, 1));
        let given = [1, 6, 7, 9].map(|matrix| rgb(360, matrix));
        assert!((0..4).all(|i| !given[..i].contains(&given[i])), "each given matrix differs: {given:?}");
    }

    #[test]
    fn ranges_and_orders_of_planes_are_kept() {
        let full = conversion(Layout::Yuv444, 8, 360, tagged(6, Some(true)));
        assert_eq!((full.rgb([255.0, 128.0, 128.0]), full.rgb([16.0, 128.0, 128.0])), ([255; 3], [16; 3]));
        let planes = conversion(Layout::Gbr, 8, 360, tagged(0, None));
        assert_eq!(planes.rgb([10.0, 20.0, 30.0]), [30, 10, 20], "green, blue, red");
        let gray = conversion(Layout::Gray, 8, 360, tagged(2, None));
        assert_eq!(gray.rgb([77.0, 0.0, 0.0]), [77; 3]);
    }

    #[test]
    fn white_of_high_range_is_nearly_white_and_tones_rise_to_it() {
        for (transfer, white) in [(18, 0.75), (16, 0.58)] {
            let color = ColorDescription { transfer, primaries: 9, ..tagged(9, None) };
            let it = conversion(Layout::Yuv420, 10, 2160, color);
            let gray = |signal: f64| it.rgb([64.0 + 876.0 * signal, 512.0, 512.0]);
            let [r, g, b] = gray(white);
            assert!((220..245).contains(&g) && r.abs_diff(g) <= 1 && b.abs_diff(g) <= 1, "{transfer}: {r} {g} {b}");
            let tones: Vec<u8> = (0..=10).map(|i| gray(f64::from(i) / 10.0)[1]).collect();
            assert!(tones.is_sorted() && tones[0] == 0 && tones[10] > 245, "{tones:?}");
        }
    }
}
