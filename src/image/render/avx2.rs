//! AVX2 kernels: eight samples of an output row at a time, of all planes that are sampled at the same positions.
//!
//! Positions along a row advance by about one pixel, so the taps of four neighbors are in a strip of some 8 source
//! samples in `N` rows, or `N + 1` where the row of positions crosses into the next source row. Each half of a block has a strip of its
//! own. A row of the strips is
//! loaded once per pair of taps, two samples further each time, and *shuffled* by the same offsets into that pair of all eight
//! samples; one `pmaddwd` weights it. That is two loads and one shuffle where a gather costs eight loads, and the sums of the
//! pairs are in the order of the samples, so that plain additions finish the row. Weights and offsets are the same for every
//! plane. Blocks that reach over the border take the strips from a small copy with the border resolved; blocks
//! that do not fit strips (8-bit samples: minification beyond 4.6, 16-bit ones: beyond 2; rotation beyond 14°; mirrored) fall back to the
//! scalar code.
//!
//! The arithmetic is that of [`Source::sample_row`]: rows in `i32`, columns in `f32` in the order of the rows. In blocks of
//! `N + 1` rows each sample gives weight 0 to the row it does not use, and adding zero changes nothing: results are equal
//! bit for bit.
#![allow(unsafe_code)] // SIMD loads through raw pointers; each proves its bounds.
#![allow(clippy::wildcard_imports)] // fifty intrinsics under their own names

use std::arch::x86_64::*;
use std::mem::MaybeUninit;

use super::kernel::{PHASE_BITS, Table, UNIT, taps};
use super::scan::{Cells, Siting};
use super::source::{Sample, Source, Taps};
use crate::warp::Lattice;

/// Samples per block, and per half of it.
const LANES: usize = 8;
const HALF: usize = LANES / 2;
/// Samples of a strip row that a kernel may load: a vector, and 4 for the last pair of taps.
const STRIP: usize = 20;
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
    unsafe fn pairs(rows: [&Self; LANES]) -> [__m256i; PAIRS];
}

impl Weights for [i16; 4] {
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn pairs(rows: [&Self; LANES]) -> [__m256i; PAIRS] {
        // SAFETY: a row is 8 bytes long, and so is the load.
        let row = |j: usize| unsafe { _mm_loadl_epi64(rows[j].as_ptr().cast()) };
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

impl Weights for [i16; 8] {
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn pairs(rows: [&Self; LANES]) -> [__m256i; PAIRS] {
        // SAFETY: a row is 16 bytes long, and so is the load.
        let row = |j: usize| unsafe { _mm_loadu_si128(rows[j].as_ptr().cast()) };
        let two = |j: usize| _mm256_set_m128i(row(j + 4), row(j));
        let (a, b, c, d) = (two(0), two(1), two(2), two(3));
        let (low0, low1) = (_mm256_unpacklo_epi32(a, b), _mm256_unpacklo_epi32(c, d));
        let (high0, high1) = (_mm256_unpackhi_epi32(a, b), _mm256_unpackhi_epi32(c, d));
        [_mm256_unpacklo_epi64(low0, low1), _mm256_unpackhi_epi64(low0, low1), _mm256_unpacklo_epi64(high0, high1)]
    }
}

/// Loads pairs of samples as pairs of 16-bit numbers.
trait Pairs: Sample {
    /// Largest offset within a half, so that the pair there is within a vector.
    const MAX_OFFSET: i32;

    /// Bytes of each lane's pair within its half, whose taps start `offsets` behind the start of its strip.
    ///
    /// # Safety
    /// AVX2.
    unsafe fn shuffle(offsets: __m256i) -> __m256i;

    /// The pair of each sample, from its offset behind `lower` and `upper` on, the halves' strips.
    ///
    /// # Safety
    /// AVX2, and both valid for reads of `STRIP − 4` samples.
    unsafe fn pair(shuffle: __m256i, bias: __m256i, lower: *const Self, upper: *const Self) -> __m256i;

    /// Eight values within the type's range.
    ///
    /// # Safety
    /// AVX2.
    unsafe fn stored(values: __m256i) -> [Self; LANES];
}

/// 16 bytes from each of two addresses.
///
/// # Safety
/// Both valid for such reads.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn halves<S>(lower: *const S, upper: *const S) -> __m256i {
    // SAFETY: as the caller promises.
    unsafe { _mm256_loadu2_m128i(upper.cast(), lower.cast()) }
}

impl Pairs for u8 {
    const MAX_OFFSET: i32 = 14;

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn shuffle(offsets: __m256i) -> __m256i {
        let first = _mm256_mullo_epi32(offsets, _mm256_set1_epi32(0x0001_0001));
        _mm256_add_epi32(first, _mm256_set1_epi32(i32::from_le_bytes([0, 0x80, 1, 0x80])))
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn pair(shuffle: __m256i, _: __m256i, lower: *const Self, upper: *const Self) -> __m256i {
        // SAFETY: 16 samples, of which offsets up to 14 use all.
        _mm256_shuffle_epi8(unsafe { halves(lower, upper) }, shuffle)
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn stored(values: __m256i) -> [Self; LANES] {
        let packed = _mm_packus_epi16(words(values), words(values));
        _mm_cvtsi128_si64(packed).to_le_bytes()
    }
}

impl Pairs for u16 {
    const MAX_OFFSET: i32 = 6;

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn shuffle(offsets: __m256i) -> __m256i {
        let first = _mm256_mullo_epi32(offsets, _mm256_set1_epi32(0x0202_0202));
        _mm256_add_epi32(first, _mm256_set1_epi32(i32::from_le_bytes([0, 1, 2, 3])))
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn pair(shuffle: __m256i, bias: __m256i, lower: *const Self, upper: *const Self) -> __m256i {
        // SAFETY: 8 samples, of which offsets up to 6 use all.
        _mm256_shuffle_epi8(_mm256_xor_si256(unsafe { halves(lower, upper) }, bias), shuffle)
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn stored(values: __m256i) -> [Self; LANES] {
        let mut out = [0; LANES];
        // SAFETY: 16 bytes into an array of 16 bytes.
        unsafe { _mm_storeu_si128(out.as_mut_ptr().cast(), words(values)) };
        out
    }
}

/// Where the taps of a block are in the source.
struct Strips {
    /// First sample and row of each half.
    starts: [(i32, i32); 2],
    /// Per lane, samples from the start of its half's strip.
    offsets: __m256i,
    /// Per lane, 1 where the taps start a row below that of the strip.
    rows: __m256i,
}

impl Strips {
    /// The strips of a block of positions; `None` where they would be longer than a vector, or need more than one row more than the
    /// kernel.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn of<S: Pairs, const N: usize>(xs: &[i32; LANES], ys: &[i32; LANES]) -> Option<Self> {
        let before = taps(N) as i32 / 2 - 1;
        // SAFETY: 32 bytes from arrays of 32 bytes.
        let (x, y) = unsafe { (_mm256_loadu_si256(xs.as_ptr().cast()), _mm256_loadu_si256(ys.as_ptr().cast())) };
        let (x, y) = (_mm256_srai_epi32::<{ PHASE_BITS as i32 }>(x), _mm256_srai_epi32::<{ PHASE_BITS as i32 }>(y));
        let first = |at: usize| (xs[at] >> PHASE_BITS, ys[at].min(ys[at + HALF - 1]) >> PHASE_BITS);
        let ((x0, y0), (x1, y1)) = (first(0), first(HALF));
        let both = |lower: i32, upper: i32| _mm256_set_m128i(_mm_set1_epi32(upper), _mm_set1_epi32(lower));
        let (offsets, rows) = (_mm256_sub_epi32(x, both(x0, x1)), _mm256_sub_epi32(y, both(y0, y1)));
        let fits = at_most(rows, 1) && at_most(offsets, S::MAX_OFFSET);
        let starts = [(x0 - before, y0 - before), (x1 - before, y1 - before)];
        fits.then_some(Self { starts, offsets, rows })
    }

    /// Both strips are inside a plane.
    fn inside(&self, width: usize, height: usize) -> bool {
        let fits = |at: i32, size: usize, n: usize| at >= 0 && at as usize + size <= n;
        self.starts.iter().all(|&(x, y)| fits(x, STRIP, width) && fits(y, STRIP_ROWS, height))
    }
}

/// What the planes of a block have in common.
struct Weighting {
    shuffle: __m256i,
    along: [__m256i; PAIRS],
    down: [__m256; 2 * PAIRS],
    /// All bits set in lanes whose taps start a row below those of their strip; whether there are any.
    level: __m256,
    is_level: bool,
}

impl Weighting {
    #[target_feature(enable = "avx2")]
    #[inline]
    fn new<S: Pairs, const N: usize>(strips: &Strips, across: [&[i16; N]; LANES], down: [&[i16; N]; LANES]) -> Self
    where
        [i16; N]: Weights,
    {
        // SAFETY: AVX2 by this function's own feature.
        let (shuffle, along, down) =
            unsafe { (S::shuffle(strips.offsets), <[i16; N]>::pairs(across), <[i16; N]>::pairs(down)) };
        let ([w0, w1], [w2, w3], [w4, w5]) = (split(down[0]), split(down[1]), split(down[2]));
        let level = _mm256_castsi256_ps(_mm256_cmpgt_epi32(strips.rows, _mm256_setzero_si256()));
        let is_level = _mm256_movemask_ps(level) == 0;
        Self { shuffle, along, down: [w0, w1, w2, w3, w4, w5], level, is_level }
    }

    /// Weighted sums of eight samples along a row, in their order.
    ///
    /// # Safety
    /// Both valid for reads of [`STRIP`] samples.
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn row<S: Pairs, const N: usize>(&self, bias: __m256i, [lower, upper]: [*const S; 2]) -> __m256 {
        let sum = |p: usize| {
            // SAFETY: `p` ≤ 2, so that `STRIP − 4` samples are left behind `2p`.
            let pair = unsafe { S::pair(self.shuffle, bias, lower.add(2 * p), upper.add(2 * p)) };
            _mm256_madd_epi16(pair, self.along[p])
        };
        let four = _mm256_add_epi32(sum(0), sum(1));
        _mm256_cvtepi32_ps(if taps(N) == 4 { four } else { _mm256_add_epi32(four, sum(2)) })
    }

    /// Sums down the columns: values of eight samples, bias not yet added.
    ///
    /// # Safety
    /// Both valid for reads of [`STRIP`] samples in each of `taps(N)` rows, `stride` apart, and one row more where a lane
    /// is not level.
    #[target_feature(enable = "avx2")]
    #[inline]
    unsafe fn columns<S: Pairs, const N: usize>(&self, bias: __m256i, strips: [*const S; 2], stride: usize) -> __m256i {
        // SAFETY: rows 0 to `taps(N)` only, as the caller promises.
        let row = |r: usize| unsafe { self.row::<S, N>(bias, [strips[0].add(r * stride), strips[1].add(r * stride)]) };
        let mut sum = _mm256_setzero_ps();
        if self.is_level {
            for (r, &weight) in self.down[..taps(N)].iter().enumerate() {
                sum = _mm256_add_ps(sum, _mm256_mul_ps(row(r), weight));
            }
        } else {
            for r in 0..=taps(N) {
                let zero = _mm256_setzero_ps();
                let own = if r < taps(N) { self.down[r] } else { zero };
                let above = if r > 0 { self.down[r - 1] } else { zero };
                sum = _mm256_add_ps(sum, _mm256_mul_ps(row(r), _mm256_blendv_ps(own, above, self.level)));
            }
        }
        _mm256_cvtps_epi32(_mm256_mul_ps(sum, _mm256_set1_ps(UNIT)))
    }

    /// The values of eight samples of a plane.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn sample<S: Pairs, const N: usize>(&self, source: &Source<'_, S>, strips: &Strips) -> __m256i {
        let (plane, bias) = (source.plane, _mm256_set1_epi16(source.bias as i16));
        let mut patches = MaybeUninit::uninit();
        let (starts, stride) = if strips.inside(plane.width(), plane.height()) {
            let at = |(x, y): (i32, i32)| plane.data()[y as usize * plane.stride() + x as usize..].as_ptr();
            ([at(strips.starts[0]), at(strips.starts[1])], plane.stride())
        } else {
            let patches: &Patches<S> = patches.write(patches_of(source, strips.starts));
            (patches.each_ref().map(|patch| patch.as_flattened().as_ptr()), STRIP)
        };
        // SAFETY: `inside` holds for STRIP samples in STRIP_ROWS rows, more than any kernel reads, and patches have as many; they live
        // to the end of this function.
        let sums = unsafe { self.columns::<S, N>(bias, starts, stride) };
        let value = _mm256_add_epi32(sums, _mm256_set1_epi32(source.bias));
        _mm256_min_epi32(_mm256_max_epi32(value, _mm256_setzero_si256()), _mm256_set1_epi32(source.max))
    }
}

/// Copies of both strips.
type Patches<S> = [[[S; STRIP]; STRIP_ROWS]; 2];

/// Both strips with the border resolved.
#[cold]
fn patches_of<S: Pairs>(source: &Source<'_, S>, starts: [(i32, i32); 2]) -> Patches<S> {
    starts.map(|(x, y)| {
        let mut patch = [[S::default(); STRIP]; STRIP_ROWS];
        source.copy_patch(x, y, &mut patch);
        patch
    })
}

/// The values of eight samples of every plane, handed to `put` with the index of the plane. `weights` are those along x and y.
#[target_feature(enable = "avx2")]
#[inline]
fn block<S: Pairs, const N: usize>(
    sources: &[Source<'_, S>],
    weights: [[&[i16; N]; LANES]; 2],
    (xs, ys): (&[i32; LANES], &[i32; LANES]),
    mut put: impl FnMut(usize, [S; LANES]),
) where
    [i16; N]: Weights,
{
    let [across, down] = weights;
    if let Some(strips) = Strips::of::<S, N>(xs, ys) {
        let weighting = Weighting::new::<S, N>(&strips, across, down);
        for (k, source) in sources.iter().enumerate() {
            // SAFETY: AVX2 by this function's own feature.
            put(k, unsafe { S::stored(weighting.sample::<S, N>(source, &strips)) });
        }
    } else {
        for (k, source) in sources.iter().enumerate() {
            put(k, std::array::from_fn(|j| source.sample([across[j], down[j]], xs[j], ys[j])));
        }
    }
}

#[target_feature(enable = "avx2")]
#[inline]
fn sample_row<S: Pairs, const N: usize>(
    sources: &[Source<'_, S>],
    taps: &impl Taps<N>,
    (xs, ys): (&[i32], &[i32]),
    outs: &mut [&mut [S]],
) where
    [i16; N]: Weights,
{
    let count = xs.len().min(ys.len());
    let (mut padded_xs, mut padded_ys) = ([0; LANES], [0; LANES]);
    for first in (0..count).step_by(LANES) {
        let (x, y, end) = (&xs[first..count], &ys[first..count], count.min(first + LANES));
        let at = if let (Some(x), Some(y)) = (x.first_chunk::<LANES>(), y.first_chunk::<LANES>()) {
            (x, y)
        } else {
            // The rest is filled up with its last position.
            for j in 0..LANES {
                let i = j.min(end - first - 1);
                (padded_xs[j], padded_ys[j]) = (x[i], y[i]);
            }
            (&padded_xs, &padded_ys)
        };
        let (mut across, mut down) = ([taps.across(first, at.0[0]); LANES], [taps.down(first, at.1[0]); LANES]);
        for j in 1..LANES {
            let i = (first + j).min(count - 1);
            (across[j], down[j]) = (taps.across(i, at.0[j]), taps.down(i, at.1[j]));
        }
        block(sources, [across, down], at, |k, values| match outs[k].get_mut(first..first + LANES) {
            Some(out) => out.copy_from_slice(&values),
            None => outs[k][first..end].copy_from_slice(&values[..end - first]),
        });
    }
}

/// Words of eight lanes that lie within 0 to 65535.
#[target_feature(enable = "avx2")]
#[inline]
fn words(values: __m256i) -> __m128i {
    let packed = _mm256_packus_epi32(values, values);
    _mm256_castsi256_si128(_mm256_permute4x64_epi64::<0b10_00>(packed))
}

/// Sample types that have kernels. Each row of `outs` is one of a source, and all of them are as long as the positions.
pub(super) trait Kernels: Sample {
    /// [`Source::sample_row`] of every source with four taps.
    ///
    /// # Safety
    /// AVX2.
    unsafe fn row4(sources: &[Source<'_, Self>], taps: &Table<4>, at: (&[i32], &[i32]), outs: &mut [&mut [Self]]);

    /// [`Source::sample_row`] of every source with six taps.
    ///
    /// # Safety
    /// AVX2.
    unsafe fn row6(sources: &[Source<'_, Self>], taps: &impl Taps<8>, at: (&[i32], &[i32]), outs: &mut [&mut [Self]]);
}

impl<S: Pairs> Kernels for S {
    #[target_feature(enable = "avx2")]
    unsafe fn row4(sources: &[Source<'_, Self>], taps: &Table<4>, at: (&[i32], &[i32]), outs: &mut [&mut [Self]]) {
        sample_row::<Self, 4>(sources, taps, at, outs);
    }

    #[target_feature(enable = "avx2")]
    unsafe fn row6(sources: &[Source<'_, Self>], taps: &impl Taps<8>, at: (&[i32], &[i32]), outs: &mut [&mut [Self]]) {
        sample_row::<Self, 8>(sources, taps, at, outs);
    }
}

/// [`Siting::positions`], compiled for AVX2.
///
/// # Safety
/// AVX2.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn positions(
    siting: &Siting,
    lattice: &Lattice,
    j: usize,
    cells: &mut Cells,
    (xs, ys): (&mut [i32], &mut [i32]),
) {
    siting.positions(lattice, j, cells, (xs, ys));
}
