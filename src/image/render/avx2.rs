//! AVX2 kernels: eight samples of an output row at a time.
//!
//! Positions along a row advance by nearly one pixel, so the taps of eight neighbors lie in a strip of some 16 source
//! samples in `N` rows, or `N + 1` where the row of positions crosses into the next source row. A row of the strip is
//! loaded once per pair of taps, two samples further each time, and *shuffled* by the same offsets into that pair of all eight
//! samples; one `pmaddwd` weights it. That is one load and one shuffle where a gather costs eight loads, and the sums of the
//! pairs stand in the order of the samples, so that plain additions finish the row. Blocks that reach over the border take the strip from a small copy with the border resolved; blocks
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
/// Samples of a strip row that a kernel may load: 12 or 14 for the offsets of the taps, and a vector's overhang.
const STRIP: usize = 24;
/// Pairs of taps of the largest kernel.
const PAIRS: usize = 3;
/// Rows of the largest strip: six taps and one row more.
const STRIP_ROWS: usize = 7;

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

/// Weights of eight samples, a pair of taps per lane: taps 0 and 1, 2 and 3, 4 and 5.
trait Weights: Sized {
    /// # Safety
    /// AVX2.
    unsafe fn pairs(&self, at: &[i32; LANES]) -> [__m256i; PAIRS];
}

impl Weights for Table<4> {
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn pairs(&self, at: &[i32; LANES]) -> [__m256i; PAIRS] {
        // SAFETY: a row of the table is 8 bytes long, and so is the load.
        let row = |j: usize| unsafe { _mm_loadl_epi64(self[phase(at[j])].as_ptr().cast()) };
        let two = |j: usize| _mm_unpacklo_epi64(row(j), row(j + 1));
        let four = |j: usize| _mm256_castsi256_ps(_mm256_set_m128i(two(j + 4), two(j)));
        let (a, b) = (four(0), four(2));
        [
            _mm256_castps_si256(_mm256_shuffle_ps::<0b10_00_10_00>(a, b)),
            _mm256_castps_si256(_mm256_shuffle_ps::<0b11_01_11_01>(a, b)),
            _mm256_setzero_si256(),
        ]
    }
}

impl Weights for Table<8> {
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn pairs(&self, at: &[i32; LANES]) -> [__m256i; PAIRS] {
        // SAFETY: a row of the table is 16 bytes long, and so is the load.
        let row = |j: usize| unsafe { _mm_loadu_si128(self[phase(at[j])].as_ptr().cast()) };
        let two = |j: usize| _mm256_set_m128i(row(j + 4), row(j));
        let (a, b, c, d) = (two(0), two(1), two(2), two(3));
        let (low0, low1) = (_mm256_unpacklo_epi32(a, b), _mm256_unpacklo_epi32(c, d));
        let (high0, high1) = (_mm256_unpackhi_epi32(a, b), _mm256_unpackhi_epi32(c, d));
        [_mm256_unpacklo_epi64(low0, low1), _mm256_unpackhi_epi64(low0, low1), _mm256_unpacklo_epi64(high0, high1)]
    }
}

/// How pairs of neighboring samples are taken from a strip row.
struct Shuffle {
    /// Bytes of each lane's pair within its half.
    bytes: __m256i,
    /// First sample of the upper half.
    upper: usize,
    bias: __m256i,
}

/// Loads pairs of samples as pairs of 16-bit numbers.
trait Pairs: Sample {
    /// For samples whose taps start `offsets` behind the start of the strip; `None` where these reach too far.
    ///
    /// # Safety
    /// AVX2.
    unsafe fn shuffle(offsets: __m256i, bias: i32) -> Option<Shuffle>;

    /// The pair of each sample, from its offset behind `row` on.
    ///
    /// # Safety
    /// AVX2, and `row` valid for reads of `STRIP − 4` samples.
    unsafe fn pair(shuffle: &Shuffle, row: *const Self) -> __m256i;
}

impl Pairs for u8 {
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn shuffle(offsets: __m256i, _: i32) -> Option<Shuffle> {
        let first = _mm256_mullo_epi32(offsets, _mm256_set1_epi32(0x0001_0001));
        let bytes = _mm256_add_epi32(first, _mm256_set1_epi32(i32::from_le_bytes([0, 0x80, 1, 0x80])));
        at_most(offsets, 14).then_some(Shuffle { bytes, upper: 0, bias: _mm256_setzero_si256() })
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn pair(shuffle: &Shuffle, row: *const Self) -> __m256i {
        // SAFETY: 16 samples, of which offsets up to 14 use all.
        let strip = unsafe { _mm256_broadcastsi128_si256(_mm_loadu_si128(row.cast())) };
        _mm256_shuffle_epi8(strip, shuffle.bytes)
    }
}

impl Pairs for u16 {
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn shuffle(offsets: __m256i, bias: i32) -> Option<Shuffle> {
        // Each half holds the eight words from its first lane's on.
        let within = _mm256_sub_epi32(offsets, _mm256_shuffle_epi32::<0>(offsets));
        let first = _mm256_mullo_epi32(within, _mm256_set1_epi32(0x0202_0202));
        let bytes = _mm256_add_epi32(first, _mm256_set1_epi32(i32::from_le_bytes([0, 1, 2, 3])));
        let upper = _mm256_extract_epi32::<4>(offsets) as usize;
        let bias = _mm256_set1_epi16(bias as i16);
        (at_most(offsets, 12) && at_most(within, 6)).then_some(Shuffle { bytes, upper, bias })
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn pair(shuffle: &Shuffle, row: *const Self) -> __m256i {
        // SAFETY: 8 samples from offset 0 and 8 from `upper` ≤ 12, which is `STRIP − 4` in all.
        let (low, high) = unsafe { (_mm_loadu_si128(row.cast()), _mm_loadu_si128(row.add(shuffle.upper).cast())) };
        _mm256_shuffle_epi8(_mm256_xor_si256(_mm256_set_m128i(high, low), shuffle.bias), shuffle.bytes)
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

/// Weighted sums of eight samples along a row, in their order.
///
/// # Safety
/// `row` valid for reads of [`STRIP`] samples.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn row<S: Pairs, const N: usize>(shuffle: &Shuffle, weights: &[__m256i; PAIRS], row: *const S) -> __m256i {
    // SAFETY: `p` ≤ 2, so that `STRIP − 4` samples are left behind `row + 2p`.
    let sum = |p: usize| unsafe { _mm256_madd_epi16(S::pair(shuffle, row.add(2 * p)), weights[p]) };
    let four = _mm256_add_epi32(sum(0), sum(1));
    if taps(N) == 4 { four } else { _mm256_add_epi32(four, sum(2)) }
}

/// Sums down the columns: values of eight samples, bias not yet added.
///
/// # Safety
/// `strip` valid for reads of [`STRIP`] samples in each of `taps(N)` rows, `stride` apart, and one row more where a lane
/// of `rows` is 1.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn columns<S: Pairs, const N: usize>(
    shuffle: &Shuffle,
    [along, down]: [&[__m256i; PAIRS]; 2],
    rows: __m256i,
    (strip, stride): (*const S, usize),
) -> __m256i {
    // SAFETY: rows 0 to `taps(N)` only, as the caller promises.
    let row = |r: usize| unsafe { _mm256_cvtepi32_ps(row::<S, N>(shuffle, along, strip.add(r * stride))) };
    let ([w0, w1], [w2, w3], [w4, w5]) = (split(down[0]), split(down[1]), split(down[2]));
    let weights = [w0, w1, w2, w3, w4, w5];
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
fn block<S: Pairs, const N: usize>(
    source: &Source<'_, S>,
    table: &Table<N>,
    xs: &[i32; LANES],
    ys: &[i32; LANES],
) -> Option<__m256i>
where
    Table<N>: Weights,
{
    let strip = Strip::of::<N>(xs, ys)?;
    // SAFETY: AVX2 by this function's own feature.
    let (shuffle, along, down) = unsafe { (S::shuffle(strip.offsets, source.bias)?, table.pairs(xs), table.pairs(ys)) };
    let (plane, weights) = (source.plane, [&along, &down]);
    let sums = if strip.inside(plane.width(), plane.height()) {
        let start = &plane.data()[strip.y as usize * plane.stride() + strip.x as usize..];
        // SAFETY: `inside` holds for STRIP samples in STRIP_ROWS rows, more than any kernel reads.
        unsafe { columns::<S, N>(&shuffle, weights, strip.rows, (start.as_ptr(), plane.stride())) }
    } else {
        let mut patch = [[S::default(); STRIP]; STRIP_ROWS];
        source.copy_patch(strip.x, strip.y, &mut patch);
        // SAFETY: the patch has STRIP samples in STRIP_ROWS rows.
        unsafe { columns::<S, N>(&shuffle, weights, strip.rows, (patch.as_flattened().as_ptr(), STRIP)) }
    };
    let value = _mm256_add_epi32(sums, _mm256_set1_epi32(source.bias));
    Some(_mm256_min_epi32(_mm256_max_epi32(value, _mm256_setzero_si256()), _mm256_set1_epi32(source.max)))
}

#[target_feature(enable = "avx2")]
#[inline]
fn sample_row<S: Pairs, const N: usize>(
    source: &Source<'_, S>,
    table: &Table<N>,
    (xs, ys): (&[i32], &[i32]),
    out: &mut [S],
    store: impl Fn(__m256i, &mut [S; LANES]),
) where
    Table<N>: Weights,
{
    let blocks = xs.as_chunks::<LANES>().0.iter().zip(ys.as_chunks::<LANES>().0);
    for ((xs, ys), out) in blocks.zip(out.as_chunks_mut::<LANES>().0) {
        match block::<S, N>(source, table, xs, ys) {
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
        sample_row::<Self, 4>(source, table, at, out, |v, out| store_bytes(v, out));
    }

    #[target_feature(enable = "avx2")]
    unsafe fn row6(source: &Source<'_, Self>, table: &Table<8>, at: (&[i32], &[i32]), out: &mut [Self]) {
        sample_row::<Self, 8>(source, table, at, out, |v, out| store_bytes(v, out));
    }
}

impl Kernels for u16 {
    #[target_feature(enable = "avx2")]
    unsafe fn row4(source: &Source<'_, Self>, table: &Table<4>, at: (&[i32], &[i32]), out: &mut [Self]) {
        sample_row::<Self, 4>(source, table, at, out, |v, out| store_words(v, out));
    }

    #[target_feature(enable = "avx2")]
    unsafe fn row6(source: &Source<'_, Self>, table: &Table<8>, at: (&[i32], &[i32]), out: &mut [Self]) {
        sample_row::<Self, 8>(source, table, at, out, |v, out| store_words(v, out));
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
