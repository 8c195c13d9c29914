//! Kernels for processors with AVX2 and FMA.
//!
//! An affine map is two registers of two columns each. Four maps are weighted and summed, multiplied by `[x x x x y y y y]` and
//! `[z z z z 1 1 1 1]`, and the halves are added. A dual quaternion is one register with the real part in the lower half; cross products
//! rotate lanes: `a × b = rot(a · rot(b) − rot(a) · b)`, where `rot` maps `[x y z w]` to `[y z x w]`.
#![allow(unsafe_code)] // SIMD loads and stores through raw pointers; each proves its bounds.
#![allow(clippy::wildcard_imports)] // twenty intrinsics under their own names

use std::arch::x86_64::*;

use super::{Columns, Motion, PackedVertex};

/// Whether the processor supports the kernels.
pub(super) fn available() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

/// Bounds check of the joint indices. Packing guarantees them; one comparison per vertex verifies it before unchecked loads.
#[inline]
fn check(vertex: &PackedVertex, joints: usize) {
    let last = vertex.joints.iter().fold(0, |m, &j| m.max(j));
    assert!((last as usize) < joints, "joints are checked when a skin is packed");
}

pub(super) fn linear_blend(vertices: &[PackedVertex], maps: &[Columns], out: &mut [[f32; 3]]) {
    assert!(available() && vertices.len() == out.len(), "checked by the caller");
    // SAFETY: the processor has AVX2 and FMA.
    unsafe { linear_blend_kernel(vertices, maps, out) }
}

pub(super) fn dual_quaternion(
    vertices: &[PackedVertex],
    scales: Option<&[Columns]>,
    motions: &[Motion],
    out: &mut [[f32; 3]],
) {
    assert!(available() && vertices.len() == out.len(), "checked by the caller");
    assert!(scales.is_none_or(|scales| scales.len() == motions.len()), "a scale for each motion");
    // SAFETY: the processor has AVX2 and FMA.
    unsafe {
        match scales {
            Some(scales) => dual_quaternion_kernel::<true>(vertices, scales, motions, out),
            None => dual_quaternion_kernel::<false>(vertices, &[], motions, out),
        }
    }
}

#[target_feature(enable = "avx2,fma")]
fn linear_blend_kernel(vertices: &[PackedVertex], maps: &[Columns], out: &mut [[f32; 3]]) {
    for (i, vertex) in vertices.iter().enumerate() {
        check(vertex, maps.len());
        store(out, i, blended(vertex, maps));
    }
}

#[target_feature(enable = "avx2,fma")]
fn dual_quaternion_kernel<const SCALED: bool>(
    vertices: &[PackedVertex],
    scales: &[Columns],
    motions: &[Motion],
    out: &mut [[f32; 3]],
) {
    for (i, vertex) in vertices.iter().enumerate() {
        check(vertex, motions.len());
        let [x, y, z] = vertex.position;
        let position = if SCALED { blended(vertex, scales) } else { _mm_setr_ps(x, y, z, 0.0) };
        store(out, i, moved(vertex, motions, position));
    }
}

/// The first three lanes to result `i`.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn store(out: &mut [[f32; 3]], i: usize, x: __m128) {
    if i + 1 < out.len() {
        // SAFETY: 16 bytes from the start of result `i`; 24 bytes up to the end of `i + 1` are in `out`. The overwritten start of
        // the next result is written again by the next iteration.
        unsafe { _mm_storeu_ps(out.as_mut_ptr().add(i).cast(), x) };
    } else {
        let mut last = [0.0_f32; 4];
        // SAFETY: 16 bytes into an array of 16.
        unsafe { _mm_storeu_ps(last.as_mut_ptr(), x) };
        out[i] = [last[0], last[1], last[2]];
    }
}

/// `Σ wⱼ Mⱼ x`; the joint indices are in range.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn blended(vertex: &PackedVertex, maps: &[Columns]) -> __m128 {
    let (mut xy, mut zt) = (_mm256_setzero_ps(), _mm256_setzero_ps());
    for k in 0..4 {
        let w = _mm256_set1_ps(vertex.weights[k]);
        let map = maps[vertex.joints[k] as usize].as_ptr();
        // SAFETY: two loads of 32 bytes from a map of 64.
        let (a, b) = unsafe { (_mm256_loadu_ps(map), _mm256_loadu_ps(map.add(8))) };
        xy = _mm256_fmadd_ps(w, a, xy);
        zt = _mm256_fmadd_ps(w, b, zt);
    }
    let [x, y, z] = vertex.position;
    let x_y = _mm256_set_m128(_mm_set1_ps(y), _mm_set1_ps(x));
    let z_1 = _mm256_set_m128(_mm_set1_ps(1.0), _mm_set1_ps(z));
    let sum = _mm256_fmadd_ps(xy, x_y, _mm256_mul_ps(zt, z_1));
    _mm_add_ps(_mm256_castps256_ps128(sum), _mm256_extractf128_ps::<1>(sum))
}

/// `[x y z w]` to `[y z x w]`.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn rotated(a: __m128) -> __m128 {
    _mm_shuffle_ps::<0b11_00_10_01>(a, a)
}

/// `a × b` in the first three lanes; 0 in the fourth.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn cross(a: __m128, b: __m128) -> __m128 {
    rotated(_mm_fmsub_ps(a, rotated(b), _mm_mul_ps(rotated(a), b)))
}

/// Rigid motion of a vertex from `y`, as in the scalar kernel.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn moved(vertex: &PackedVertex, motions: &[Motion], y: __m128) -> __m128 {
    // SAFETY: a load of 32 bytes from a motion of 32.
    let load = |k: usize| unsafe { _mm256_loadu_ps(motions[vertex.joints[k] as usize].as_ptr()) };
    let first = load(0);
    let pivot = _mm256_castps256_ps128(first);
    let mut sum = _mm256_mul_ps(first, _mm256_set1_ps(vertex.weights[0]));
    for k in 1..4 {
        let q = load(k);
        let dot = _mm_dp_ps::<0xFF>(pivot, _mm256_castps256_ps128(q));
        let sign = _mm_and_ps(dot, _mm_set1_ps(-0.0));
        let w = _mm_xor_ps(_mm_set1_ps(vertex.weights[k]), sign);
        sum = _mm256_fmadd_ps(q, _mm256_set_m128(w, w), sum);
    }
    let (u, f) = (_mm256_castps256_ps128(sum), _mm256_extractf128_ps::<1>(sum));
    let length = _mm_dp_ps::<0xFF>(u, u);
    // Where the motions cancel, the vertex stays: avoids 2/0.
    let some = _mm_cmpgt_ps(length, _mm_setzero_ps());
    let inverse = _mm_and_ps(some, _mm_div_ps(_mm_set1_ps(2.0), length));
    let (a, e) = (_mm_shuffle_ps::<0xFF>(u, u), _mm_shuffle_ps::<0xFF>(f, f));
    let s = _mm_add_ps(_mm_fmadd_ps(a, y, cross(u, y)), f);
    let n = _mm_add_ps(cross(u, s), _mm_fmsub_ps(a, f, _mm_mul_ps(e, u)));
    _mm_fmadd_ps(inverse, n, y)
}
