//! AVX2 kernels: eight samples of an output row at a time.
//!
//! Positions along a row advance by nearly one pixel, so the taps of eight neighbors lie in a strip of some 16 source
//! samples in `N` rows, or `N + 1` where the row of positions crosses into the next source row. A row of the strip is
//! loaded once and *shuffled* into the taps of the eight samples, which costs one load and two shuffles where a gather
//! costs eight loads. Blocks that reach over the border take the strip from a small copy with the border resolved; blocks
//! that do not fit a strip (minification beyond 1.5, rotation beyond 7°, mirrored) fall back to the scalar code.
//!
//! The arithmetic is that of [`Source::sample`]: rows in `i32`, columns in `f32` in the order of the rows. In blocks of
//! `N + 1` rows each sample gives weight 0 to the row it does not use, and adding zero changes nothing: results are equal
//! bit for bit.
#![allow(unsafe_code)] // SIMD loads through raw pointers; each proves its bounds.
#![allow(clippy::wildcard_imports)] // fifty intrinsics under their own names

use std::arch::x86_64::*;

use super::kernel::{PHASE_BITS, PHASES, Table, UNIT, taps};
use super::scan::Siting;
use super::source::{Sample, Source};
use crate::warp::Lattice;

/// Samples per block.
const LANES: usize = 8;
/// Samples of a strip row that a kernel may load: 16 for the offsets of the taps, and a vector's overhang.
const STRIP: usize = 24;
/// Rows of the largest strip: six taps and one row more.
const STRIP_ROWS: usize = 7;

/// The shuffles and weights that turn a strip row into eight weighted sums.
trait Taps<S, const N: usize>: Sized {
    /// Prepares for samples whose taps start `offsets` samples behind the start of the strip and whose positions are
    /// `xs`; `None` where the offsets reach too far.
    ///
    /// # Safety
    /// AVX2.
    unsafe fn new(table: &Table<N>, xs: &[i32; LANES], offsets: __m256i, bias: i32) -> Option<Self>;

    /// Weighted sums of one row, in the order of the samples.
    ///
    /// # Safety
    /// AVX2, and `row` valid for reads of [`STRIP`] samples.
    unsafe fn row(&self, row: *const S) -> __m256i;

    /// Weights of the rows, one lane per sample.
    ///
    /// # Safety
    /// AVX2.
    unsafe fn columns(table: &Table<N>, ys: &[i32; LANES]) -> [__m256; 6];
}

/// All lanes of `v` are at most `limit`, as unsigned numbers.
#[target_feature(enable = "avx2")]
#[inline]
fn at_most(v: __m256i, limit: i32) -> bool {
    let clamped = _mm256_min_epu32(v, _mm256_set1_epi32(limit));
    _mm256_movemask_epi8(_mm256_cmpeq_epi32(clamped, v)) == -1
}

fn phase(position: i32) -> usize {
    position as usize % PHASES
}

/// Both 16-bit weights of each lane, low half first, as `f32`.
#[target_feature(enable = "avx2")]
#[inline]
fn split(pairs: __m256i) -> [__m256; 2] {
    let low = _mm256_srai_epi32::<16>(_mm256_slli_epi32::<16>(pairs));
    [_mm256_cvtepi32_ps(low), _mm256_cvtepi32_ps(_mm256_srai_epi32::<16>(pairs))]
}

/// The four weights at a position, in the low half.
#[target_feature(enable = "avx2")]
#[inline]
fn four(table: &Table<4>, position: i32) -> __m128i {
    // SAFETY: a row of the table is 8 bytes long, and so is the load.
    unsafe { _mm_loadl_epi64(table[phase(position)].as_ptr().cast()) }
}

/// The six weights at a position, and two zeros.
#[target_feature(enable = "avx2")]
#[inline]
fn six(table: &Table<8>, position: i32) -> __m128i {
    // SAFETY: a row of the table is 16 bytes long, and so is the load.
    unsafe { _mm_loadu_si128(table[phase(position)].as_ptr().cast()) }
}

/// Weights of two samples for each half: samples `j, j + 1` below, `j + 4, j + 5` above.
#[target_feature(enable = "avx2")]
#[inline]
fn four_weights(table: &Table<4>, at: &[i32; LANES], j: usize) -> __m256i {
    let (low, high) = (_mm_unpacklo_epi64(four(table, at[j]), four(table, at[j + 1])), j + 4);
    _mm256_set_m128i(_mm_unpacklo_epi64(four(table, at[high]), four(table, at[high + 1])), low)
}

/// Weights of sample `j` below and of `j + 4` above.
#[target_feature(enable = "avx2")]
#[inline]
fn six_weights(table: &Table<8>, at: &[i32; LANES], j: usize) -> __m256i {
    _mm256_set_m128i(six(table, at[j + 4]), six(table, at[j]))
}

#[target_feature(enable = "avx2")]
#[inline]
fn six_by_four(table: &Table<8>, at: &[i32; LANES]) -> [__m256i; 4] {
    [six_weights(table, at, 0), six_weights(table, at, 1), six_weights(table, at, 2), six_weights(table, at, 3)]
}

#[target_feature(enable = "avx2")]
#[inline]
fn four_columns(table: &Table<4>, ys: &[i32; LANES]) -> [__m256; 6] {
    let a = _mm256_castsi256_ps(four_weights(table, ys, 0));
    let b = _mm256_castsi256_ps(four_weights(table, ys, 2));
    let [w0, w1] = split(_mm256_castps_si256(_mm256_shuffle_ps::<0b10_00_10_00>(a, b)));
    let [w2, w3] = split(_mm256_castps_si256(_mm256_shuffle_ps::<0b11_01_11_01>(a, b)));
    [w0, w1, w2, w3, _mm256_setzero_ps(), _mm256_setzero_ps()]
}

#[target_feature(enable = "avx2")]
#[inline]
fn six_columns(table: &Table<8>, ys: &[i32; LANES]) -> [__m256; 6] {
    let [a, b, c, d] = six_by_four(table, ys);
    let (low0, low1) = (_mm256_unpacklo_epi32(a, b), _mm256_unpacklo_epi32(c, d));
    let (high0, high1) = (_mm256_unpackhi_epi32(a, b), _mm256_unpackhi_epi32(c, d));
    let [w0, w1] = split(_mm256_unpacklo_epi64(low0, low1));
    let [w2, w3] = split(_mm256_unpackhi_epi64(low0, low1));
    let [w4, w5] = split(_mm256_unpacklo_epi64(high0, high1));
    [w0, w1, w2, w3, w4, w5]
}

/// Four taps of bytes: two shuffles of one 16-byte row spread the taps of four samples each to 16 bits.
struct Bytes4 {
    shuffles: [__m256i; 2],
    weights: [__m256i; 2],
}

impl Taps<u8, 4> for Bytes4 {
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn new(table: &Table<4>, xs: &[i32; LANES], offsets: __m256i, _: i32) -> Option<Self> {
        if !at_most(offsets, 12) {
            return None;
        }
        let tap = i64::from_le_bytes([0, 0x80, 1, 0x80, 2, 0x80, 3, 0x80]);
        let spread = |j: i8| {
            let from = |j: i8| i64::from_le_bytes([4 * j, -1, 4 * j, -1, 4 * j, -1, 4 * j, -1].map(|b| b as u8));
            _mm256_setr_epi64x(from(j), from(j + 1), from(j), from(j + 1))
        };
        let shuffle = |j| _mm256_add_epi8(_mm256_shuffle_epi8(offsets, spread(j)), _mm256_set1_epi64x(tap));
        Some(Self {
            shuffles: [shuffle(0), shuffle(2)],
            weights: [four_weights(table, xs, 0), four_weights(table, xs, 2)],
        })
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn row(&self, row: *const u8) -> __m256i {
        // SAFETY: 16 of the STRIP samples.
        let strip = unsafe { _mm256_broadcastsi128_si256(_mm_loadu_si128(row.cast())) };
        let sum = |k: usize| _mm256_madd_epi16(_mm256_shuffle_epi8(strip, self.shuffles[k]), self.weights[k]);
        _mm256_hadd_epi32(sum(0), sum(1))
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn columns(table: &Table<4>, ys: &[i32; LANES]) -> [__m256; 6] {
        four_columns(table, ys)
    }
}

/// Six taps of bytes: four shuffles, one sample per half each.
struct Bytes6 {
    shuffles: [__m256i; 4],
    weights: [__m256i; 4],
}

impl Taps<u8, 8> for Bytes6 {
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn new(table: &Table<8>, xs: &[i32; LANES], offsets: __m256i, _: i32) -> Option<Self> {
        if !at_most(offsets, 10) {
            return None;
        }
        #[rustfmt::skip]
        let tap = _mm256_setr_epi8(
            0, -128, 1, -128, 2, -128, 3, -128, 4, -128, 5, -128, 6, -128, 7, -128,
            0, -128, 1, -128, 2, -128, 3, -128, 4, -128, 5, -128, 6, -128, 7, -128,
        );
        // The last two taps may wrap around the strip; their weights are zero.
        let even = |j: i16| _mm256_set1_epi16((4 * j) | -256);
        let shuffle = |j| _mm256_add_epi8(_mm256_shuffle_epi8(offsets, even(j)), tap);
        let shuffles = [shuffle(0), shuffle(1), shuffle(2), shuffle(3)];
        Some(Self { shuffles, weights: six_by_four(table, xs) })
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn row(&self, row: *const u8) -> __m256i {
        // SAFETY: 16 of the STRIP samples.
        let strip = unsafe { _mm256_broadcastsi128_si256(_mm_loadu_si128(row.cast())) };
        let sum = |k: usize| _mm256_madd_epi16(_mm256_shuffle_epi8(strip, self.shuffles[k]), self.weights[k]);
        _mm256_hadd_epi32(_mm256_hadd_epi32(sum(0), sum(1)), _mm256_hadd_epi32(sum(2), sum(3)))
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn columns(table: &Table<8>, ys: &[i32; LANES]) -> [__m256; 6] {
        six_columns(table, ys)
    }
}

/// Four taps of words: each half holds the eight words that its four samples need.
struct Words4 {
    upper: usize,
    bias: __m256i,
    shuffles: [__m256i; 2],
    weights: [__m256i; 2],
}

impl Taps<u16, 4> for Words4 {
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn new(table: &Table<4>, xs: &[i32; LANES], offsets: __m256i, bias: i32) -> Option<Self> {
        let within = _mm256_sub_epi32(offsets, _mm256_shuffle_epi32::<0>(offsets));
        if !(at_most(offsets, 12) && at_most(within, 4)) {
            return None;
        }
        let tap = i64::from_le_bytes([0, 1, 2, 3, 4, 5, 6, 7]);
        let spread = |j: i64| {
            let from = |j: i64| 0x0101_0101_0101_0101 * (4 * j);
            _mm256_setr_epi64x(from(j), from(j + 1), from(j), from(j + 1))
        };
        let bytes = _mm256_slli_epi32::<1>(within);
        let shuffle = |j| _mm256_add_epi8(_mm256_shuffle_epi8(bytes, spread(j)), _mm256_set1_epi64x(tap));
        Some(Self {
            upper: _mm256_extract_epi32::<4>(offsets) as usize,
            bias: _mm256_set1_epi16(bias as i16),
            shuffles: [shuffle(0), shuffle(2)],
            weights: [four_weights(table, xs, 0), four_weights(table, xs, 2)],
        })
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn row(&self, row: *const u16) -> __m256i {
        // SAFETY: 8 samples from offset 0 and 8 from `upper` ≤ 12: 20 of the STRIP samples.
        let (low, high) = unsafe { (_mm_loadu_si128(row.cast()), _mm_loadu_si128(row.add(self.upper).cast())) };
        let strip = _mm256_xor_si256(_mm256_set_m128i(high, low), self.bias);
        let sum = |k: usize| _mm256_madd_epi16(_mm256_shuffle_epi8(strip, self.shuffles[k]), self.weights[k]);
        _mm256_hadd_epi32(sum(0), sum(1))
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn columns(table: &Table<4>, ys: &[i32; LANES]) -> [__m256; 6] {
        four_columns(table, ys)
    }
}

/// Six taps of words: they fill a half by themselves, so that no shuffle is needed.
struct Words6 {
    offsets: [i32; LANES],
    bias: __m256i,
    weights: [__m256i; 4],
}

impl Taps<u16, 8> for Words6 {
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn new(table: &Table<8>, xs: &[i32; LANES], offsets: __m256i, bias: i32) -> Option<Self> {
        if !at_most(offsets, 10) {
            return None;
        }
        let mut lanes = [0; LANES];
        // SAFETY: 32 bytes into an array of 32 bytes.
        unsafe { _mm256_storeu_si256(lanes.as_mut_ptr().cast(), offsets) };
        let weights = six_by_four(table, xs);
        Some(Self { offsets: lanes, bias: _mm256_set1_epi16(bias as i16), weights })
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn row(&self, row: *const u16) -> __m256i {
        // SAFETY: 8 samples from an offset ≤ 10: 18 of the STRIP samples.
        let load = |j: usize| unsafe { _mm_loadu_si128(row.add(self.offsets[j] as usize).cast()) };
        let taps = |j: usize| _mm256_xor_si256(_mm256_set_m128i(load(j + 4), load(j)), self.bias);
        let sum = |j: usize| _mm256_madd_epi16(taps(j), self.weights[j]);
        _mm256_hadd_epi32(_mm256_hadd_epi32(sum(0), sum(1)), _mm256_hadd_epi32(sum(2), sum(3)))
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn columns(table: &Table<8>, ys: &[i32; LANES]) -> [__m256; 6] {
        six_columns(table, ys)
    }
}

/// Where the taps of a block lie in the source.
struct Strip {
    x: i32,
    y: i32,
    offsets: __m256i,
    /// Per lane, 1 where the taps start a row below `y`.
    rows: __m256i,
}

impl Strip {
    /// The strip of a block of positions; `None` where it would need more than one row more than the kernel.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn of<const N: usize>(xs: &[i32; LANES], ys: &[i32; LANES]) -> Option<Self> {
        let before = taps(N) as i32 / 2 - 1;
        // SAFETY: 32 bytes from arrays of 32 bytes.
        let (x, y) = unsafe { (_mm256_loadu_si256(xs.as_ptr().cast()), _mm256_loadu_si256(ys.as_ptr().cast())) };
        let (x, y) = (_mm256_srai_epi32::<{ PHASE_BITS as i32 }>(x), _mm256_srai_epi32::<{ PHASE_BITS as i32 }>(y));
        let (x0, y0) = (xs[0] >> PHASE_BITS, ys[0].min(ys[LANES - 1]) >> PHASE_BITS);
        let offsets = _mm256_sub_epi32(x, _mm256_set1_epi32(x0));
        let rows = _mm256_sub_epi32(y, _mm256_set1_epi32(y0));
        at_most(rows, 1).then_some(Self { x: x0 - before, y: y0 - before, offsets, rows })
    }

    /// The whole strip lies inside a plane.
    fn inside(&self, width: usize, height: usize) -> bool {
        let fits = |at: i32, size: usize, n: usize| at >= 0 && at as usize + size <= n;
        fits(self.x, STRIP, width) && fits(self.y, STRIP_ROWS, height)
    }
}

/// Sums down the columns: values of eight samples, bias not yet added.
///
/// # Safety
/// `strip` valid for reads of [`STRIP`] samples in each of `taps(N)` rows, `stride` apart, and one row more where a lane
/// of `rows` is 1.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn columns<S, T: Taps<S, N>, const N: usize>(
    taps_of: &T,
    weights: &[__m256; 6],
    rows: __m256i,
    strip: *const S,
    stride: usize,
) -> __m256i {
    // SAFETY: rows 0 to `taps(N)` only, as the caller promises.
    let row = |r: usize| unsafe { _mm256_cvtepi32_ps(taps_of.row(strip.add(r * stride))) };
    let mut sum = _mm256_setzero_ps();
    let level = _mm256_castsi256_ps(_mm256_cmpgt_epi32(rows, _mm256_setzero_si256()));
    if _mm256_movemask_ps(level) == 0 {
        for (r, &weight) in weights[..taps(N)].iter().enumerate() {
            sum = _mm256_add_ps(sum, _mm256_mul_ps(row(r), weight));
        }
    } else {
        for r in 0..=taps(N) {
            let zero = _mm256_setzero_ps();
            let own = if r < taps(N) { weights[r] } else { zero };
            let above = if r > 0 { weights[r - 1] } else { zero };
            sum = _mm256_add_ps(sum, _mm256_mul_ps(row(r), _mm256_blendv_ps(own, above, level)));
        }
    }
    _mm256_cvtps_epi32(_mm256_mul_ps(sum, _mm256_set1_ps(UNIT)))
}

/// One block; `None` where it does not fit a strip.
#[target_feature(enable = "avx2")]
#[inline]
fn block<S: Sample, T: Taps<S, N>, const N: usize>(
    source: &Source<'_, S>,
    table: &Table<N>,
    xs: &[i32; LANES],
    ys: &[i32; LANES],
) -> Option<__m256i> {
    let strip = Strip::of::<N>(xs, ys)?;
    // SAFETY: AVX2 by this function's own feature.
    let (taps_of, weights) = unsafe { (T::new(table, xs, strip.offsets, source.bias)?, T::columns(table, ys)) };
    let plane = source.plane;
    let sums = if strip.inside(plane.width(), plane.height()) {
        let start = &plane.data()[strip.y as usize * plane.stride() + strip.x as usize..];
        // SAFETY: `inside` holds for STRIP samples in STRIP_ROWS rows, more than any kernel reads.
        unsafe { columns(&taps_of, &weights, strip.rows, start.as_ptr(), plane.stride()) }
    } else {
        let mut patch = [[S::default(); STRIP]; STRIP_ROWS];
        source.copy_patch(strip.x, strip.y, &mut patch);
        // SAFETY: the patch has STRIP samples in STRIP_ROWS rows.
        unsafe { columns(&taps_of, &weights, strip.rows, patch.as_flattened().as_ptr(), STRIP) }
    };
    let value = _mm256_add_epi32(sums, _mm256_set1_epi32(source.bias));
    Some(_mm256_min_epi32(_mm256_max_epi32(value, _mm256_setzero_si256()), _mm256_set1_epi32(source.max)))
}

#[target_feature(enable = "avx2")]
fn sample_row<S: Sample, T: Taps<S, N>, const N: usize>(
    source: &Source<'_, S>,
    table: &Table<N>,
    (xs, ys): (&[i32], &[i32]),
    out: &mut [S],
    store: impl Fn(__m256i, &mut [S; LANES]),
) {
    let blocks = xs.as_chunks::<LANES>().0.iter().zip(ys.as_chunks::<LANES>().0);
    for ((xs, ys), out) in blocks.zip(out.as_chunks_mut::<LANES>().0) {
        match block::<S, T, N>(source, table, xs, ys) {
            Some(values) => store(values, out),
            None => source.sample_row(table, xs, ys, out),
        }
    }
    let done = out.len() / LANES * LANES;
    source.sample_row(table, &xs[done..], &ys[done..], &mut out[done..]);
}

/// Words of eight lanes that lie within 0 to 65535.
#[target_feature(enable = "avx2")]
#[inline]
fn words(values: __m256i) -> __m128i {
    let packed = _mm256_packus_epi32(values, values);
    _mm256_castsi256_si128(_mm256_permute4x64_epi64::<0b10_00>(packed))
}

#[target_feature(enable = "avx2")]
#[inline]
fn store_bytes(values: __m256i, out: &mut [u8; LANES]) {
    let packed = _mm_packus_epi16(words(values), words(values));
    // SAFETY: 8 bytes into an array of 8 bytes.
    unsafe { _mm_storel_epi64(out.as_mut_ptr().cast(), packed) };
}

#[target_feature(enable = "avx2")]
#[inline]
fn store_words(values: __m256i, out: &mut [u16; LANES]) {
    // SAFETY: 16 bytes into an array of 16 bytes.
    unsafe { _mm_storeu_si128(out.as_mut_ptr().cast(), words(values)) };
}

/// Sample types that have kernels.
pub(super) trait Kernels: Sample {
    /// [`Source::sample_row`] with four taps.
    ///
    /// # Safety
    /// AVX2.
    unsafe fn row4(source: &Source<'_, Self>, table: &Table<4>, at: (&[i32], &[i32]), out: &mut [Self]);

    /// [`Source::sample_row`] with six taps.
    ///
    /// # Safety
    /// AVX2.
    unsafe fn row6(source: &Source<'_, Self>, table: &Table<8>, at: (&[i32], &[i32]), out: &mut [Self]);
}

impl Kernels for u8 {
    #[target_feature(enable = "avx2")]
    unsafe fn row4(source: &Source<'_, Self>, table: &Table<4>, at: (&[i32], &[i32]), out: &mut [Self]) {
        sample_row::<Self, Bytes4, 4>(source, table, at, out, |v, out| store_bytes(v, out));
    }

    #[target_feature(enable = "avx2")]
    unsafe fn row6(source: &Source<'_, Self>, table: &Table<8>, at: (&[i32], &[i32]), out: &mut [Self]) {
        sample_row::<Self, Bytes6, 8>(source, table, at, out, |v, out| store_bytes(v, out));
    }
}

impl Kernels for u16 {
    #[target_feature(enable = "avx2")]
    unsafe fn row4(source: &Source<'_, Self>, table: &Table<4>, at: (&[i32], &[i32]), out: &mut [Self]) {
        sample_row::<Self, Words4, 4>(source, table, at, out, |v, out| store_words(v, out));
    }

    #[target_feature(enable = "avx2")]
    unsafe fn row6(source: &Source<'_, Self>, table: &Table<8>, at: (&[i32], &[i32]), out: &mut [Self]) {
        sample_row::<Self, Words6, 8>(source, table, at, out, |v, out| store_words(v, out));
    }
}

/// [`Siting::positions`], compiled for AVX2.
///
/// # Safety
/// AVX2.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn positions(siting: &Siting, lattice: &Lattice, j: usize, xs: &mut [i32], ys: &mut [i32]) {
    siting.positions(lattice, j, xs, ys);
}
