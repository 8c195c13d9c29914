//! The 21×21 window of the Lucas–Kanade tracker in 16-bit fixed point: its three sums, without SIMD.
//!
//! A window at a position with fraction `(a, b)` is interpolated separably,
//!
//! ```text
//! h(x, y) = s(x, y) + ⌊a (s(x+1, y) − s(x, y))⌉        s = 32 × gray value
//! v(x, y) = h(x, y) + ⌊b (h(x, y+1) − h(x, y))⌉        |v| ≤ 8160
//! ```
//!
//! with `a`, `b` in 1/32768. The template's gradient is Scharr's, taken on the interpolated window itself (interpolation
//! and differentiation commute, so no gradient image of the whole picture is needed):
//!
//! ```text
//! gx = ⌊3/32 (Δ(y−1) + Δ(y+1))⌉ + ⌊10/32 Δ(y)⌉,   Δ(y) = v(x+1, y) − v(x−1, y)        32 × gray/px, |gx| ≤ 4080
//! ```
//!
//! Products of two such numbers stay below 2²⁵, 42 of them below 2³¹, so that lanes of 32 bits never overflow and every
//! sum is exact: all instruction sets give the same bits. [`super::window_x86`] has the vector versions.

/// Side of the window, px. Fixed, since the kernels unroll it; 21 is OpenCV's default and bridges 10 px per level.
pub(super) const SIDE: usize = 21;
/// Distance from the center of the window to its edge samples, px.
pub(super) const RADIUS: isize = 10;
/// Lanes of a stored row: the 21 of the window and zeros up to whole vectors.
pub(super) const LANES: usize = 32;
/// Lanes of a row of the window with its one-pixel ring, and what shifted vectors may read behind it.
pub(super) const RING_LANES: usize = 48;
/// Samples that a kernel may read from the start of a row.
pub(super) const READ: usize = LANES + 1;

/// Rows of a window.
pub(super) type Rows = [[i16; LANES]; SIDE];
/// Rows of a window with a ring of one pixel.
pub(super) type RingRows = [[i16; RING_LANES]; SIDE + 2];

/// The window of a point in the first picture and its gradient.
#[repr(C, align(64))]
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Template {
    /// `v`, 32 × gray.
    pub value: Rows,
    /// `gx`, 32 × gray/px; zero behind the window.
    pub gx: Rows,
    /// `gy`, likewise.
    pub gy: Rows,
    /// `v` with its ring: scratch of the extraction.
    pub ring: RingRows,
}

impl Default for Template {
    fn default() -> Self {
        let rows = [[0; LANES]; SIDE];
        Self { value: rows, gx: rows, gy: rows, ring: [[0; RING_LANES]; SIDE + 2] }
    }
}

/// Samples of a picture from the first of a window on, and the sub-pixel fraction of the window's position.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch<'a> {
    /// From the top left sample on.
    pub samples: &'a [u8],
    /// Distance of rows.
    pub stride: usize,
    /// Horizontal fraction in 1/32768, 0 to 32767.
    pub a: i16,
    /// Vertical fraction, likewise.
    pub b: i16,
}

impl Patch<'_> {
    /// Whether the slice contains `rows` rows of [`READ`] samples.
    pub(super) fn has_rows(&self, rows: usize) -> bool {
        self.samples.len() >= (rows - 1) * self.stride + READ
    }
}

/// `⌊x·y / 2¹⁵⌉`, the instruction `pmulhrsw`.
fn mul_round(x: i16, y: i16) -> i16 {
    ((i32::from(x) * i32::from(y) + (1 << 14)) >> 15) as i16
}

/// 3/32 and 10/32 in 1/32768: Scharr's smoothing with the halving of the central difference.
pub(super) const SCHARR: [i16; 2] = [3072, 10_240];

fn blended(row: &[u8], x: usize, a: i16) -> i16 {
    let (s0, s1) = (i16::from(row[x]) << 5, i16::from(row[x + 1]) << 5);
    s0 + mul_round(s1 - s0, a)
}

/// Interpolated sample `(x, y)` of the patch.
fn value(patch: &Patch<'_>, x: usize, y: usize) -> i16 {
    let h = |k: usize| blended(&patch.samples[k * patch.stride..], x, patch.a);
    let (top, bottom) = (h(y), h(y + 1));
    top + mul_round(bottom - top, patch.b)
}

/// Fills `template` from a patch that starts one pixel left of and above the window.
pub(super) fn extract(patch: &Patch<'_>, template: &mut Template) {
    for y in 0..SIDE + 2 {
        for x in 0..SIDE + 2 {
            template.ring[y][x] = value(patch, x, y);
        }
    }
    let v = &template.ring;
    let smooth = |before: i16, at: i16, after: i16| mul_round(before + after, SCHARR[0]) + mul_round(at, SCHARR[1]);
    for y in 0..SIDE {
        for x in 0..SIDE {
            let dx = |k: usize| v[y + k][x + 2] - v[y + k][x];
            let dy = |k: usize| v[y + 2][x + k] - v[y][x + k];
            template.value[y][x] = v[y + 1][x + 1];
            template.gx[y][x] = smooth(dx(0), dx(1), dx(2));
            template.gy[y][x] = smooth(dy(0), dy(1), dy(2));
        }
    }
}

/// `[Σ gx², Σ gx gy, Σ gy²]`, 1024 × (gray/px)².
pub(super) fn normal_matrix(template: &Template) -> [i64; 3] {
    let mut sums = [0; 3];
    for (gx, gy) in template.gx.iter().flatten().zip(template.gy.iter().flatten()) {
        let (gx, gy) = (i64::from(*gx), i64::from(*gy));
        sums = [sums[0] + gx * gx, sums[1] + gx * gy, sums[2] + gy * gy];
    }
    sums
}

/// `[Σ gx (v − template), Σ gy (v − template)]` over the window at the patch, 1024 × gray²/px.
pub(super) fn mismatch(template: &Template, patch: &Patch<'_>) -> [i64; 2] {
    let mut sums = [0; 2];
    for y in 0..SIDE {
        for x in 0..SIDE {
            let d = i64::from(value(patch, x, y)) - i64::from(template.value[y][x]);
            sums[0] += d * i64::from(template.gx[y][x]);
            sums[1] += d * i64::from(template.gy[y][x]);
        }
    }
    sums
}

/// The three sums in one instruction set.
#[derive(Clone, Copy)]
pub(super) struct Kernel {
    /// See [`extract`].
    pub extract: fn(&Patch<'_>, &mut Template),
    /// See [`normal_matrix`].
    pub normal_matrix: fn(&Template) -> [i64; 3],
    /// See [`mismatch`].
    pub mismatch: fn(&Template, &Patch<'_>) -> [i64; 2],
}

impl Kernel {
    /// Plain Rust.
    pub(super) const SCALAR: Self = Self { extract, normal_matrix, mismatch };

    /// The widest that this processor runs.
    pub(super) fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(kernel) = super::window_x86::kernels().pop() {
            return kernel;
        }
        Self::SCALAR
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRIDE: usize = 64;

    /// Random pictures, and the two that drive every sum to its bound.
    fn pictures() -> Vec<Vec<u8>> {
        let mut rng = fastrand::Rng::with_seed(3);
        let mut pictures: Vec<Vec<u8>> = (0..8).map(|_| (0..STRIDE * 30).map(|_| rng.u8(..)).collect()).collect();
        pictures.push((0..STRIDE * 30).map(|i| if (i % STRIDE / 2).is_multiple_of(2) { 255 } else { 0 }).collect());
        pictures.push((0..STRIDE * 30).map(|i| if i / STRIDE % 4 < 2 { 255 } else { 0 }).collect());
        pictures.push(vec![255; STRIDE * 30]);
        pictures
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn every_instruction_set_gives_the_bits_of_the_scalar_window() {
        let fractions = [(0, 0), (1, 32_767), (32_767, 32_767), (12_345, 777), (16_384, 16_384)];
        let (pictures, kernels) = (pictures(), super::super::window_x86::kernels());
        for (samples, next) in pictures.iter().zip(pictures.iter().cycle().skip(1)) {
            for (a, b) in fractions {
                let (patch, moved) =
                    (Patch { samples, stride: STRIDE, a, b }, Patch { samples: next, stride: STRIDE, a: b, b: a });
                let mut scalar = Template::default();
                extract(&patch, &mut scalar);
                for kernel in &kernels {
                    let mut wide = Template::default();
                    (kernel.extract)(&patch, &mut wide);
                    let same = |r: &Rows, s: &Rows| r.iter().zip(s).all(|(r, s)| r[..SIDE] == s[..SIDE]);
                    assert!(
                        same(&wide.value, &scalar.value) && wide.gx == scalar.gx && wide.gy == scalar.gy,
                        "{a} {b}"
                    );
                    assert_eq!((kernel.normal_matrix)(&wide), normal_matrix(&scalar));
                    assert_eq!((kernel.mismatch)(&wide, &moved), mismatch(&scalar, &moved));
                }
            }
        }
    }

    #[test]
    fn gradients_of_a_ramp_are_its_slopes() {
        let samples: Vec<u8> = (0..STRIDE * 30).map(|i| (3 * (i % STRIDE) + 2 * (i / STRIDE)) as u8).collect();
        let mut template = Template::default();
        extract(&Patch { samples: &samples, stride: STRIDE, a: 9_000, b: 20_000 }, &mut template);
        for y in 0..SIDE {
            for x in 0..SIDE {
                assert!((template.gx[y][x] - 3 * 32).abs() <= 2, "{}", template.gx[y][x]);
                assert!((template.gy[y][x] - 2 * 32).abs() <= 2, "{}", template.gy[y][x]);
            }
        }
    }

    #[test]
    fn a_window_does_not_differ_from_itself() {
        let samples = &pictures()[0];
        let mut template = Template::default();
        extract(&Patch { samples, stride: STRIDE, a: 100, b: 30_000 }, &mut template);
        let inside = Patch { samples: &samples[STRIDE + 1..], stride: STRIDE, a: 100, b: 30_000 };
        assert_eq!(mismatch(&template, &inside), [0, 0]);
    }
}
