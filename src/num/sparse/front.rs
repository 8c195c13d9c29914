//! Elimination of the columns of one dense front.
//!
//! ```text
//! ⎡A   · ⎤      ⎡L      ⎤
//! ⎣B   U ⎦  →   ⎣M   U − M Mᴴ⎦ ,     A = L Lᴴ,  M = B L⁻ᴴ
//! ```
//!
//! Small fronts go through loops that subtract four columns at a time. Large real ones are cut into strips: each takes the
//! part of all strips before it as one product of the dense kernels, and only its own columns go through the loops.
#![allow(unsafe_code)] // calls of functions compiled for AVX2 and FMA, once both are detected

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{BlockStructure, matmul as triangular_matmul};
use faer::{Accum, MatMut, MatRef, Par};

use super::Scalar;
use crate::run::{Run, Stopped};

/// Multiplications of a front from which the dense kernels are faster than our loops: a square front of 29 columns.
const LARGE: usize = 24_000;

/// Columns of a strip: wider leaves more of the work to the loops, narrower makes the products too thin for the dense kernels.
const STRIP: usize = 32;

/// Multiplications of the last product of a front from which it is made in parts, between which the run is looked at: about a tenth of a
/// second.
const PART: usize = 1_000_000_000;

/// Why an elimination ended.
pub(super) enum Ended {
    /// The pivot of this column of the front is not positive.
    Pivot(usize),
    /// The run ended.
    Stopped(Stopped),
}

/// A dense front: the panel of its columns, `rows` values each, and what remains below, both by columns.
#[derive(Debug)]
pub(super) struct Front<'a, T> {
    pub(super) panel: &'a mut [T],
    /// Lower triangle of what is left of the rows below, `rows − width` square.
    pub(super) u: &'a mut [T],
    pub(super) width: usize,
    pub(super) rows: usize,
}

/// Eliminates the columns of a front, looking at the run every few columns of large ones.
pub(super) fn eliminate<T: Scalar>(front: &mut Front<'_, T>, run: &Run) -> Result<(), Ended> {
    let (width, rows) = (front.width, front.rows);
    if width * rows * rows > LARGE
        && let (Some(panel), Some(u)) = (T::reals_mut(front.panel), T::reals_mut(front.u))
    {
        return eliminate_large(panel, u, (width, rows), run);
    }
    eliminate_strip(front.panel, 0, rows).and_then(|()| subtract_all(front)).map_err(Ended::Pivot)
}

fn eliminate_large(panel: &mut [f64], u: &mut [f64], (width, rows): (usize, usize), run: &Run) -> Result<(), Ended> {
    for start in (0..width).step_by(STRIP) {
        run.check().map_err(Ended::Stopped)?;
        let columns = STRIP.min(width - start);
        let (done, strip) = panel.split_at_mut(start * rows);
        let strip = &mut strip[..columns * rows];
        if start > 0 {
            let done = MatRef::from_column_major_slice(done, rows, start).subrows(start, rows - start);
            let strip = MatMut::from_column_major_slice_mut(strip, rows, columns).subrows_mut(start, rows - start);
            matmul(strip, Accum::Add, done, done.subrows(0, columns).transpose(), -1.0, Par::Seq);
        }
        eliminate_strip(strip, start, rows).map_err(|k| Ended::Pivot(start + k))?;
    }
    let below = rows - width;
    // Parts of the columns of `M` when the product takes long; else all of them at once.
    let columns = (PART / (below * below).max(1)).max(STRIP);
    for start in (0..width).step_by(columns).filter(|_| below > 0) {
        run.check().map_err(Ended::Stopped)?;
        let columns = columns.min(width - start);
        let panel = &panel[start * rows..][..columns * rows];
        let m = MatRef::from_column_major_slice(panel, rows, columns).subrows(width, below);
        let u = MatMut::from_column_major_slice_mut(u, below, below);
        let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
        triangular_matmul(u, lower, Accum::Add, m, full, m.transpose(), full, -1.0, Par::Seq);
    }
    Ok(())
}

/// `U ← U − S Mᵀ`, lower triangle of a symmetric product: `s` by columns of `below` values, `M` the last `below` rows of as
/// many columns of `rows` values.
pub(super) fn subtract_product(u: &mut [f64], below: usize, s: &[f64], (columns, rows): (&[f64], usize)) {
    if below == 0 {
        return;
    }
    let rank = s.len() / below;
    if rank * below * below > LARGE {
        let s = MatRef::from_column_major_slice(s, below, rank);
        let m = MatRef::from_column_major_slice(&columns[..rank * rows], rows, rank).subrows(rows - below, below);
        let u = MatMut::from_column_major_slice_mut(u, below, below);
        let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
        triangular_matmul(u, lower, Accum::Add, s, full, m.transpose(), full, -1.0, Par::Seq);
        return;
    }
    for (s, m) in s.chunks_exact(below).zip(columns.chunks_exact(rows)) {
        for (k, &m) in m[rows - below..].iter().enumerate() {
            u[k * below + k..(k + 1) * below].iter_mut().zip(&s[k..]).for_each(|(u, s)| *u -= s * m);
        }
    }
}

/// Runs a body compiled for AVX2 and FMA where the processor has both, else for any.
macro_rules! widest {
    ($body:ident::<$t:ident>($($arg:ident: $type:ty),*) -> $result:ty) => {{
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2,fma")]
            fn fused<$t: Scalar>($($arg: $type),*) -> $result {
                $body::<$t, true>($($arg),*)
            }
            if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
                // SAFETY: safe code; the features that it is compiled for have just been detected.
                return unsafe { fused($($arg),*) };
            }
        }
        $body::<$t, false>($($arg),*)
    }};
}

/// Eliminates columns of `rows` values each, the first with its diagonal in row `first`, nothing subtracted yet.
fn eliminate_strip<T: Scalar>(strip: &mut [T], first: usize, rows: usize) -> Result<(), usize> {
    widest!(eliminate_columns::<T>(strip: &mut [T], first: usize, rows: usize) -> Result<(), usize>)
}

/// `U ← U − M Mᴴ`.
fn subtract_all<T: Scalar>(front: &mut Front<'_, T>) -> Result<(), usize> {
    widest!(subtract_products::<T>(front: &mut Front<'_, T>) -> Result<(), usize>)
}

#[inline(always)]
#[allow(clippy::inline_always)] // each instruction set compiles the body for itself
fn eliminate_columns<T: Scalar, const FUSED: bool>(strip: &mut [T], first: usize, rows: usize) -> Result<(), usize> {
    for k in 0..strip.len() / rows {
        let (done, rest) = strip.split_at_mut(k * rows);
        let column = &mut rest[first + k..rows];
        subtract::<T, FUSED>(column, done, rows, first + k);
        let pivot = column[0].re();
        if !(pivot > 0.0) {
            return Err(k);
        }
        let pivot = pivot.sqrt();
        column[0] = T::real(pivot);
        let inverse = 1.0 / pivot;
        column[1..].iter_mut().for_each(|v| *v = v.times(inverse));
    }
    Ok(())
}

#[inline(always)]
#[allow(clippy::inline_always, clippy::unnecessary_wraps)] // as its sibling
fn subtract_products<T: Scalar, const FUSED: bool>(front: &mut Front<'_, T>) -> Result<(), usize> {
    let (width, below) = (front.width, front.rows - front.width);
    for k in 0..below {
        let column = &mut front.u[k * below + k..(k + 1) * below];
        subtract::<T, FUSED>(column, front.panel, front.rows, width + k);
    }
    Ok(())
}

/// `to ← to − Σⱼ column_j · l̄_kj` over all columns of `panel`, each from row `k` downwards.
#[inline(always)]
#[allow(clippy::inline_always)]
fn subtract<T: Scalar, const FUSED: bool>(to: &mut [T], panel: &[T], rows: usize, k: usize) {
    let len = to.len();
    let mut columns = panel.chunks_exact(rows).map(|c| &c[k..][..len]);
    while columns.len() >= 4 {
        let [a, b, c, d]: [&[T]; 4] = std::array::from_fn(|_| columns.next().unwrap_or_default());
        let (b, c, d) = (&b[..a.len()], &c[..a.len()], &d[..a.len()]);
        let to = &mut to[..a.len()];
        let s = [a[0], b[0], c[0], d[0]].map(T::conjugate);
        for i in 0..a.len() {
            let v = to[i].less::<FUSED>(a[i], s[0]).less::<FUSED>(b[i], s[1]);
            to[i] = v.less::<FUSED>(c[i], s[2]).less::<FUSED>(d[i], s[3]);
        }
    }
    for a in columns {
        let s = a[0].conjugate();
        to.iter_mut().zip(a).for_each(|(v, &a)| *v = v.less::<FUSED>(a, s));
    }
}
