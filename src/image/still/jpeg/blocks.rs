//! From rows of pixels to quantized coefficients, block by block.
//!
//! A block of 8×8 samples `s` becomes
//!
//! ```text
//! S(u, v) = ¼ C(u) C(v) Σ_xy s(x, y) cos((2x + 1) u π / 16) cos((2y + 1) v π / 16),      C(0) = 1/√2, else 1,
//! ```
//!
//! divided by its step of quantization and rounded. The transform is that of Arai, Agui and Nakajima, along one axis and then the
//! other: five multiplications per eight samples, the rest of them factors per coefficient, which are part of the division. Samples are not
//! rounded between color and coefficient.
//!
//! # Reference
//! ITU-T T.81, A.3.3; Y. Arai, T. Agui, M. Nakajima, *A fast DCT-SQ scheme for images*, Trans. IEICE E71 (1988).

use super::header::Quantization;
use crate::PlaneRef;
use crate::simd::multiversion;

/// A quantized block in zigzag order, four coefficients of 16 bit per word.
pub(super) type Coefficients = [u64; 16];

/// Rows of a band, as wide as whole blocks, of luma and both color differences, from −128 to 127.
pub(super) struct Rows {
    width: usize,
    channels: Vec<Vec<f32>>,
}

impl Rows {
    /// For `count` rows of so many px, rounded up, and of one channel or three.
    pub(super) fn new(width: usize, count: usize, channels: usize) -> Self {
        Self { width, channels: vec![vec![0.0; width * count]; channels] }
    }

    /// Takes row `y` of the planes as row `k`, its last pixel repeated.
    pub(super) fn take(&mut self, planes: &[PlaneRef<'_, u8>], y: usize, k: usize) {
        let (from, to, width) = (k * self.width, (k + 1) * self.width, planes[0].width());
        if let [luma, blue, red] = &mut self.channels[..] {
            let rows = [planes[0].row(y), planes[1].row(y), planes[2].row(y)];
            color_row(rows, &mut luma[from..from + width], &mut blue[from..from + width], &mut red[from..from + width]);
        } else {
            let luma = self.channels[0][from..to].iter_mut().zip(planes[0].row(y));
            luma.for_each(|(to, v)| *to = f32::from(*v) - 128.0);
        }
        for channel in &mut self.channels {
            let last = channel[from + width - 1];
            channel[from + width..to].fill(last);
        }
    }

    /// The color differences as means of 2×2 px, in place: `count` rows of half the width.
    pub(super) fn halve_color(&mut self, count: usize) {
        let half = self.width / 2;
        for channel in &mut self.channels[1..] {
            for y in 0..count {
                for x in 0..half {
                    let at = 2 * y * self.width + 2 * x;
                    let sum = channel[at] + channel[at + 1] + channel[at + self.width] + channel[at + self.width + 1];
                    channel[y * half + x] = 0.25 * sum;
                }
            }
        }
    }

    /// The quantized blocks of eight rows, `width` px wide, of a channel.
    pub(super) fn blocks(
        &self,
        channel: usize,
        (first, width): (usize, usize),
        quantization: &Quantization,
        out: &mut Vec<Coefficients>,
    ) {
        out.clear();
        out.resize(width / 8, [0; 16]);
        quantized(&self.channels[channel][first * width..][..8 * width], &quantization.factors(), out);
    }
}

multiversion! {
    /// JFIF's YCbCr, which is that of BT.601 over the full range, of rows of green, blue and red.
    fn color_row(gbr: [&[u8]; 3], luma: &mut [f32], blue: &mut [f32], red: &mut [f32]) {
        let pixels = gbr[0].iter().zip(gbr[1]).zip(gbr[2]);
        for ((((g, b), r), luma), (blue, red)) in pixels.zip(luma).zip(blue.iter_mut().zip(red)) {
            let (g, b, r) = (f32::from(*g), f32::from(*b), f32::from(*r));
            *luma = 0.299 * r + 0.587 * g + 0.114 * b - 128.0;
            *blue = -0.168_735_9 * r - 0.331_264_1 * g + 0.5 * b;
            *red = 0.5 * r - 0.418_687_6 * g - 0.081_312_4 * b;
        }
    }
}

/// Eight values, one of each column or row of a block.
type Lanes = [f32; 8];

multiversion! {
    /// Transforms and quantizes the blocks of eight rows.
    fn quantized(rows: &[f32], factors: &[f32; 64], out: &mut [Coefficients]) {
        let width = rows.len() / 8;
        for (k, block) in out.iter_mut().enumerate() {
            let mut samples = [[0.0; 8]; 8];
            for (y, lanes) in samples.iter_mut().enumerate() {
                lanes.copy_from_slice(&rows[y * width + 8 * k..][..8]);
            }
            transform(&mut samples);
            let mut across = transposed(&samples);
            transform(&mut across);
            let mut whole = [0_i16; 64];
            for ((whole, v), factor) in whole.iter_mut().zip(across.as_flattened()).zip(factors) {
                *whole = rounded(v * factor);
            }
            *block = in_zigzag(&whole);
        }
    }
}

/// The nearest whole number: it is in the low bits of a sum whose unit in the last place is 1.
#[inline(always)]
#[allow(clippy::inline_always)] // into code compiled for AVX2, as those below
fn rounded(v: f32) -> i16 {
    const SHIFT: f32 = 1.5 * (1 << 23) as f32;
    (v + SHIFT).to_bits() as i16
}

#[inline(always)]
#[allow(clippy::inline_always)]
fn transposed(block: &[Lanes; 8]) -> [Lanes; 8] {
    let mut out = [[0.0; 8]; 8];
    for (y, lanes) in block.iter().enumerate() {
        for (x, v) in lanes.iter().enumerate() {
            out[x][y] = *v;
        }
    }
    out
}

/// The transform down the columns of a block.
#[inline(always)]
#[allow(clippy::inline_always)]
fn transform(s: &mut [Lanes; 8]) {
    /// cos(4π/16), cos(6π/16), cos(2π/16) − cos(6π/16) and cos(2π/16) + cos(6π/16).
    const C4: f32 = std::f32::consts::FRAC_1_SQRT_2;
    const C6: f32 = 0.382_683_43;
    const MINUS: f32 = 0.541_196_1;
    const PLUS: f32 = 1.306_563;
    let [s0, s1, s2, s3, s4, s5, s6, s7] = s;
    for x in 0..8 {
        let (a0, a1, a2, a3) = (s0[x] + s7[x], s1[x] + s6[x], s2[x] + s5[x], s3[x] + s4[x]);
        let (d0, d1, d2, d3) = (s0[x] - s7[x], s1[x] - s6[x], s2[x] - s5[x], s3[x] - s4[x]);
        // Even coefficients.
        let (outer, inner) = (a0 + a3, a1 + a2);
        let (turned, side) = (a0 - a3, a1 - a2);
        let z = (side + turned) * C4;
        (s0[x], s4[x], s2[x], s6[x]) = (outer + inner, outer - inner, turned + z, turned - z);
        // Odd ones.
        let (low, middle, high) = (d3 + d2, d2 + d1, d1 + d0);
        let common = (low - high) * C6;
        let (p, q, r) = (MINUS * low + common, PLUS * high + common, middle * C4);
        let (plus, minus) = (d0 + r, d0 - r);
        (s5[x], s3[x], s1[x], s7[x]) = (minus + p, minus - p, plus + q, plus - q);
    }
}

/// Where a transposed block has its coefficients in zigzag order.
const ZIGZAG: [u8; 64] = {
    let (mut order, mut x, mut y, mut k) = ([0; 64], 0_i32, 0_i32, 0);
    while k < 64 {
        order[k] = (8 * x + y) as u8;
        // Up and to the right on even diagonals, down and to the left on odd ones.
        let up = (x + y) % 2 == 0;
        if (up && x == 7) || (!up && y < 7 && x == 0) {
            y += 1;
        } else if (!up && y == 7) || (up && y == 0) {
            x += 1;
        } else if up {
            (x, y) = (x + 1, y - 1);
        } else {
            (x, y) = (x - 1, y + 1);
        }
        k += 1;
    }
    order
};

#[inline(always)]
#[allow(clippy::inline_always)]
fn in_zigzag(whole: &[i16; 64]) -> Coefficients {
    let mut out = [0; 16];
    for (word, order) in out.iter_mut().zip(ZIGZAG.as_chunks::<4>().0) {
        for (k, at) in order.iter().enumerate() {
            *word |= u64::from(whole[usize::from(*at) % 64] as u16) << (16 * k);
        }
    }
    out
}

/// What a coefficient of the scaled transform is divided by besides its step: `8 A(u) A(v)`, `A(0) = 1`, else
/// `A(u) = √2 cos(u π / 16)`; in the order of a transposed block, that is, symmetric.
pub(super) fn scale(u: usize, v: usize) -> f32 {
    let a = |k: usize| if k == 0 { 1.0 } else { f64::sqrt(2.0) * (k as f64 * std::f64::consts::PI / 16.0).cos() };
    (8.0 * a(u) * a(v)) as f32
}

/// Place in a transposed block of zigzag position `k`.
pub(super) fn place(k: usize) -> usize {
    usize::from(ZIGZAG[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_zigzag_begins_and_ends_as_in_the_standard() {
        // Of the block as it is: row 8·y + x.
        let upright = |k: usize| (ZIGZAG[k] % 8) * 8 + ZIGZAG[k] / 8;
        let begins: Vec<u8> = (0..10).map(upright).collect();
        assert_eq!(begins, [0, 1, 8, 16, 9, 2, 3, 10, 17, 24]);
        assert_eq!((60..64).map(upright).collect::<Vec<u8>>(), [47, 55, 62, 63]);
        let mut all = ZIGZAG;
        all.sort_unstable();
        assert!(all.iter().enumerate().all(|(k, v)| usize::from(*v) == k));
    }

    #[test]
    fn coefficients_are_those_of_the_definition() {
        let sample = |x: usize, y: usize| ((x * 37 + y * 91 + x * y * 13) % 251) as f32 - 128.0;
        let rows: Vec<f32> = (0..64).map(|k| sample(k % 8, k / 8)).collect();
        let quantization = Quantization::of_steps(&[3; 64]);
        let mut out = [[0; 16]];
        quantized(&rows, &quantization.factors(), &mut out);
        for k in 0..64 {
            let (u, v) = (place(k) / 8, place(k) % 8);
            let c = |k: usize| if k == 0 { 0.5_f64.sqrt() } else { 1.0 };
            let cos = |x: usize, u: usize| ((2 * x + 1) as f64 * u as f64 * std::f64::consts::PI / 16.0).cos();
            let sum: f64 = (0..64).map(|i| f64::from(rows[i]) * cos(i % 8, u) * cos(i / 8, v)).sum();
            let expected = 0.25 * c(u) * c(v) * sum / 3.0;
            let found = f64::from((out[0][k / 4] >> (16 * (k % 4))) as i16);
            assert!((found - expected).abs() < 0.501, "({u}, {v}): {found} for {expected}");
        }
    }
}
