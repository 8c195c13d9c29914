//! The window sums of [`super::window`] for AVX2 and AVX-512, bit for bit the same.
//!
//! One source for both: a row of the window is two vectors of 16 lanes or one of 32. The lanes behind the window carry
//! the samples of the picture there; the template's gradient is zero in them, so they add nothing.
#![allow(unsafe_code)] // SIMD loads and stores by pointer
#![allow(clippy::cast_ptr_alignment)] // all of them are of the unaligned kind

use super::window::{Kernel, Patch, Template};

/// The kernels that this processor runs, the widest last.
pub(super) fn kernels() -> Vec<Kernel> {
    let mut found = Vec::new();
    if std::arch::is_x86_feature_detected!("avx2") {
        found.push(Kernel { extract: avx2::extract, normal_matrix: avx2::normal_matrix, mismatch: avx2::mismatch });
    }
    if std::arch::is_x86_feature_detected!("avx512bw") {
        let (extract, normal_matrix, mismatch) = (avx512::extract, avx512::normal_matrix, avx512::mismatch);
        found.push(Kernel { extract, normal_matrix, mismatch });
    }
    found
}

/// The kernels over one vector type; the names are those of the intrinsics without their prefix.
macro_rules! window_kernels {
    (
        $features:literal, $vector:ty, $half:ty, $lanes:literal, $load_half:ident, $widen:ident, $load:ident, $store:ident,
        $set1:ident, $zero:ident, $add16:ident, $add32:ident, $sub16:ident, $shift_left:ident, $mul_round:ident,
        $mul_add:ident, $and:ident, $sum:path
    ) => {
        use std::arch::x86_64::*;

        use super::{Patch, Template};
        use crate::track::window::{LANES, RingRows, Rows, SCHARR, SIDE};

        /// Vectors of a stored row.
        const PARTS: usize = LANES / $lanes;
        /// Ones in the lanes of the window.
        const INSIDE: [i16; LANES] = {
            let mut mask = [0; LANES];
            let mut x = 0;
            while x < SIDE {
                mask[x] = -1;
                x += 1;
            }
            mask
        };

        pub(in super::super) fn extract(patch: &Patch<'_>, template: &mut Template) {
            assert!(patch.has_rows(SIDE + 3), "the patch ends inside the window");
            // SAFETY: `super::kernels` returns this function only where the features were detected; the assertion is
            // the contract of `ring`.
            unsafe {
                ring(patch, &mut template.ring);
                gradient(template);
            }
        }

        pub(in super::super) fn normal_matrix(template: &Template) -> [i64; 3] {
            // SAFETY: returned only where the features were detected.
            unsafe { normal_sums(&template.gx, &template.gy) }
        }

        pub(in super::super) fn mismatch(template: &Template, patch: &Patch<'_>) -> [i64; 2] {
            assert!(patch.has_rows(SIDE + 1), "the patch ends inside the window");
            // SAFETY: returned only where the features were detected; the assertion is the contract of the sums.
            unsafe { mismatch_sums(template, patch) }
        }

        /// A row of samples blended horizontally.
        ///
        /// # Safety
        /// `$lanes + 1` samples are readable from `p`.
        #[inline]
        #[target_feature(enable = $features)]
        unsafe fn blended(p: *const u8, a: $vector) -> $vector {
            // SAFETY: unaligned loads of `$lanes` bytes at `p` and `p + 1`, readable by contract.
            let (s0, s1) = unsafe { ($load_half(p.cast::<$half>()), $load_half(p.add(1).cast::<$half>())) };
            let (s0, s1) = ($shift_left::<5>($widen(s0)), $shift_left::<5>($widen(s1)));
            $add16(s0, $mul_round($sub16(s1, s0), a))
        }

        /// The interpolated window with its ring.
        ///
        /// # Safety
        /// `patch.has_rows(SIDE + 3)`.
        #[target_feature(enable = $features)]
        unsafe fn ring(patch: &Patch<'_>, out: &mut RingRows) {
            let (a, b) = ($set1(patch.a), $set1(patch.b));
            for part in 0..PARTS {
                let start = patch.samples.as_ptr().wrapping_add(part * $lanes);
                // SAFETY: rows 0 to `SIDE + 2` of the patch have `LANES + 1` samples each; a row of `out` more than `LANES`.
                unsafe {
                    let mut top = blended(start, a);
                    for (y, row) in out.iter_mut().enumerate() {
                        let bottom = blended(start.add((y + 1) * patch.stride), a);
                        let v = $add16(top, $mul_round($sub16(bottom, top), b));
                        $store(row.as_mut_ptr().add(part * $lanes).cast(), v);
                        top = bottom;
                    }
                }
            }
        }

        /// Scharr's smoothing of three vectors, halved.
        #[inline]
        #[target_feature(enable = $features)]
        fn smooth(before: $vector, at: $vector, after: $vector) -> $vector {
            $add16($mul_round($add16(before, after), $set1(SCHARR[0])), $mul_round(at, $set1(SCHARR[1])))
        }

        /// Value and gradient from the ring.
        #[target_feature(enable = $features)]
        fn gradient(template: &mut Template) {
            let Template { value, gx, gy, ring } = template;
            for part in 0..PARTS {
                let x = part * $lanes;
                // SAFETY: `x + k + $lanes` ≤ `LANES + 2` < `RING_LANES`.
                let at = |y: usize, k: usize| unsafe { $load(ring[y].as_ptr().add(x + k).cast()) };
                // SAFETY: `x + $lanes` ≤ `LANES`.
                let inside = unsafe { $load(INSIDE.as_ptr().add(x).cast()) };
                let dx = |y: usize| $sub16(at(y, 2), at(y, 0));
                let (mut above, mut middle) = (dx(0), dx(1));
                for y in 0..SIDE {
                    let below = dx(y + 2);
                    let dy = |k: usize| $sub16(at(y + 2, k), at(y, k));
                    // SAFETY: rows of the template have `LANES` samples.
                    unsafe {
                        $store(value[y].as_mut_ptr().add(x).cast(), at(y + 1, 1));
                        $store(gx[y].as_mut_ptr().add(x).cast(), $and(smooth(above, middle, below), inside));
                        $store(gy[y].as_mut_ptr().add(x).cast(), $and(smooth(dy(0), dy(1), dy(2)), inside));
                    }
                    (above, middle) = (middle, below);
                }
            }
        }

        #[target_feature(enable = $features)]
        fn normal_sums(gx: &Rows, gy: &Rows) -> [i64; 3] {
            let mut total = [0; 3];
            for part in 0..PARTS {
                let (mut xx, mut xy, mut yy) = ($zero(), $zero(), $zero());
                for (gx, gy) in gx.iter().zip(gy) {
                    // SAFETY: rows of the template have `LANES` samples.
                    let [gx, gy] = [gx, gy].map(|g| unsafe { $load(g.as_ptr().add(part * $lanes).cast()) });
                    xx = $add32(xx, $mul_add(gx, gx));
                    xy = $add32(xy, $mul_add(gx, gy));
                    yy = $add32(yy, $mul_add(gy, gy));
                }
                total = [total[0] + $sum(xx), total[1] + $sum(xy), total[2] + $sum(yy)];
            }
            total
        }

        /// # Safety
        /// `patch.has_rows(SIDE + 1)`.
        #[target_feature(enable = $features)]
        unsafe fn mismatch_sums(template: &Template, patch: &Patch<'_>) -> [i64; 2] {
            let (a, b) = ($set1(patch.a), $set1(patch.b));
            let mut total = [0; 2];
            for part in 0..PARTS {
                let x = part * $lanes;
                let start = patch.samples.as_ptr().wrapping_add(x);
                let (mut sum_x, mut sum_y) = ($zero(), $zero());
                // SAFETY: rows 0 to `SIDE` of the patch have `LANES + 1` samples each, rows of the template `LANES`.
                unsafe {
                    let mut top = blended(start, a);
                    for y in 0..SIDE {
                        let bottom = blended(start.add((y + 1) * patch.stride), a);
                        let v = $add16(top, $mul_round($sub16(bottom, top), b));
                        let at = |rows: &Rows| $load(rows[y].as_ptr().add(x).cast());
                        let d = $sub16(v, at(&template.value));
                        sum_x = $add32(sum_x, $mul_add(d, at(&template.gx)));
                        sum_y = $add32(sum_y, $mul_add(d, at(&template.gy)));
                        top = bottom;
                    }
                }
                total = [total[0] + $sum(sum_x), total[1] + $sum(sum_y)];
            }
            total
        }
    };
}

mod avx2 {
    window_kernels!(
        "avx2",
        __m256i,
        __m128i,
        16,
        _mm_loadu_si128,
        _mm256_cvtepu8_epi16,
        _mm256_loadu_si256,
        _mm256_storeu_si256,
        _mm256_set1_epi16,
        _mm256_setzero_si256,
        _mm256_add_epi16,
        _mm256_add_epi32,
        _mm256_sub_epi16,
        _mm256_slli_epi16,
        _mm256_mulhrs_epi16,
        _mm256_madd_epi16,
        _mm256_and_si256,
        sum
    );

    /// Sum of the eight 32-bit lanes.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn sum(v: __m256i) -> i64 {
        let low = _mm256_cvtepi32_epi64(_mm256_castsi256_si128(v));
        let high = _mm256_cvtepi32_epi64(_mm256_extracti128_si256::<1>(v));
        let four = _mm256_add_epi64(low, high);
        let two = _mm_add_epi64(_mm256_castsi256_si128(four), _mm256_extracti128_si256::<1>(four));
        _mm_cvtsi128_si64(two) + _mm_extract_epi64::<1>(two)
    }
}

mod avx512 {
    window_kernels!(
        "avx2,avx512f,avx512bw",
        __m512i,
        __m256i,
        32,
        _mm256_loadu_si256,
        _mm512_cvtepu8_epi16,
        _mm512_loadu_si512,
        _mm512_storeu_si512,
        _mm512_set1_epi16,
        _mm512_setzero_si512,
        _mm512_add_epi16,
        _mm512_add_epi32,
        _mm512_sub_epi16,
        _mm512_slli_epi16,
        _mm512_mulhrs_epi16,
        _mm512_madd_epi16,
        _mm512_and_si512,
        sum
    );

    /// Sum of the sixteen 32-bit lanes.
    #[inline]
    #[target_feature(enable = "avx2,avx512f,avx512bw")]
    fn sum(v: __m512i) -> i64 {
        let low = _mm512_cvtepi32_epi64(_mm512_castsi512_si256(v));
        let high = _mm512_cvtepi32_epi64(_mm512_extracti64x4_epi64::<1>(v));
        _mm512_reduce_add_epi64(_mm512_add_epi64(low, high))
    }
}
