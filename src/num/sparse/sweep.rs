//! Triangular solves over panels of columns, for one or several right-hand sides in lanes.
//!
//! Panel `p` has `W` adjacent columns of equal structure: a `W×W` triangle `T` and rows `M` below. Forwards
//! `s = T⁻¹ x_p`, then `xᵢ −= Mᵢ s` for each row; backwards `s = x_p − Σᵢ Mᵢᵀ xᵢ`, then `x_p = T⁻ᵀ s`. The width is a constant
//! of the code that runs, so that `s` stays in registers.
#![allow(unsafe_code)] // calls of functions compiled for AVX2 and FMA, once both are detected

/// Calls the instance of `f` for a width of 1 to [`MAX_WIDTH`] columns.
macro_rules! with_width {
    ($width:expr, $f:ident::<$lanes:ident, $fused:ident, $value:ident>($($arg:expr),*)) => {
        match $width {
            1 => $f::<1, $lanes, $fused, $value>($($arg),*),
            2 => $f::<2, $lanes, $fused, $value>($($arg),*),
            3 => $f::<3, $lanes, $fused, $value>($($arg),*),
            4 => $f::<4, $lanes, $fused, $value>($($arg),*),
            5 => $f::<5, $lanes, $fused, $value>($($arg),*),
            6 => $f::<6, $lanes, $fused, $value>($($arg),*),
            7 => $f::<7, $lanes, $fused, $value>($($arg),*),
            8 => $f::<8, $lanes, $fused, $value>($($arg),*),
            _ => unreachable!("panels are 1 to {MAX_WIDTH} columns wide"),
        }
    };
}

/// Columns of a panel at most: as many as keep all partial sums of a panel in registers.
pub(super) const MAX_WIDTH: usize = 8;

/// One unknown of `L` right-hand sides.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Lanes<const L: usize>(pub(super) [f64; L]);

impl<const L: usize> Default for Lanes<L> {
    fn default() -> Self {
        Self([0.0; L])
    }
}

/// An entry of a factor, as it is stored; solves are summed in double precision.
pub trait Stored: Copy + Into<f64> {}

impl Stored for f64 {}

impl Stored for f32 {}

/// Adjacent columns of equal structure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Panel {
    pub(super) first: u32,
    pub(super) width: u32,
    /// Rows below its triangle.
    pub(super) below: u32,
}

/// A triangular factor, panel after panel.
#[derive(Clone, Debug, Default)]
pub(super) struct Panels<V> {
    pub(super) list: Vec<Panel>,
    /// Rows below the triangle, ascending.
    pub(super) rows: Vec<u32>,
    /// The triangle row by row, its diagonal inverted; then the rows below, each of the panel's width.
    pub(super) values: Vec<V>,
}

impl Panels<f64> {
    /// Adds the panel of columns `first..last`, whose rows are the columns up to `next` and `below`.
    pub(super) fn push(&mut self, first: usize, last: usize, next: usize, below: &[u32]) {
        let width = last - first;
        let rows = next - last + below.len();
        self.rows.extend((last as u32..next as u32).chain(below.iter().copied()));
        self.values.resize(self.values.len() + width * (width + 1) / 2 + width * rows, f64::NAN);
        self.list.push(Panel { first: first as u32, width: width as u32, below: rows as u32 });
    }

    /// The same in single precision; `None` where a value leaves its range.
    pub(super) fn rounded(&self) -> Option<Panels<f32>> {
        let rounded = |&value: &f64| Some(value as f32).filter(|single| single.is_normal() || value == 0.0);
        let values = self.values.iter().map(rounded).collect::<Option<_>>()?;
        Some(Panels { list: self.list.clone(), rows: self.rows.clone(), values })
    }
}

impl<V: Stored> Panels<V> {
    /// Bytes that one sweep reads.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.list[..]) + size_of_val(&self.rows[..]) + size_of_val(&self.values[..])
    }

    /// `x ← L⁻ᵀ L⁻¹ x`.
    pub(super) fn solve<const L: usize>(&self, x: &mut [Lanes<L>]) {
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2,fma")]
            fn fused<const L: usize, V: Stored>(panels: &Panels<V>, x: &mut [Lanes<L>]) {
                panels.sweep::<L, true>(x);
            }
            if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
                // SAFETY: safe code; the features that it is compiled for have just been detected.
                return unsafe { fused(self, x) };
            }
        }
        self.sweep::<L, false>(x);
    }

    #[inline(always)]
    #[allow(clippy::inline_always)] // each instruction set compiles the body for itself
    fn sweep<const L: usize, const FUSED: bool>(&self, x: &mut [Lanes<L>]) {
        let (mut row, mut value) = (0, 0);
        for panel in &self.list {
            let (rows, values) = (&self.rows[row..][..panel.below as usize], &self.values[value..][..panel.size()]);
            with_width!(panel.width, forward::<L, FUSED, V>(values, rows, panel.first as usize, x));
            (row, value) = (row + rows.len(), value + values.len());
        }
        for panel in self.list.iter().rev() {
            (row, value) = (row - panel.below as usize, value - panel.size());
            let (rows, values) = (&self.rows[row..][..panel.below as usize], &self.values[value..][..panel.size()]);
            with_width!(panel.width, backward::<L, FUSED, V>(values, rows, panel.first as usize, x));
        }
    }
}

impl Panel {
    /// Number of its values.
    fn size(self) -> usize {
        let width = self.width as usize;
        width * (width + 1) / 2 + width * self.below as usize
    }
}

/// `x_p ← T⁻¹ x_p`, then what the rows below take from it.
#[inline(always)]
#[allow(clippy::inline_always)]
fn forward<const W: usize, const L: usize, const FUSED: bool, V: Stored>(
    values: &[V],
    rows: &[u32],
    first: usize,
    x: &mut [Lanes<L>],
) {
    let (triangle, below) = values.split_at(W * (W + 1) / 2);
    let mut s = [[0.0; L]; W];
    let own = &mut x[first..first + W];
    for k in 0..W {
        let l = &triangle[k * (k + 1) / 2..][..=k];
        let mut v = own[k].0;
        for c in 0..k {
            take::<L, FUSED>(&mut v, l[c].into(), &s[c]);
        }
        let inverse: f64 = l[k].into();
        s[k] = v.map(|v| v * inverse);
        own[k].0 = s[k];
    }
    for (l, &row) in below.chunks_exact(W).zip(rows) {
        let x = &mut x[row as usize].0;
        let mut v = *x;
        for c in 0..W {
            take::<L, FUSED>(&mut v, l[c].into(), &s[c]);
        }
        *x = v;
    }
}

/// What the rows below take from `x_p`, then `x_p ← T⁻ᵀ x_p`.
#[inline(always)]
#[allow(clippy::inline_always)]
fn backward<const W: usize, const L: usize, const FUSED: bool, V: Stored>(
    values: &[V],
    rows: &[u32],
    first: usize,
    x: &mut [Lanes<L>],
) {
    let (triangle, below) = values.split_at(W * (W + 1) / 2);
    let mut s: [[f64; L]; W] = std::array::from_fn(|c| x[first + c].0);
    for (l, &row) in below.chunks_exact(W).zip(rows) {
        let v = x[row as usize].0;
        for c in 0..W {
            take::<L, FUSED>(&mut s[c], l[c].into(), &v);
        }
    }
    for k in (0..W).rev() {
        let l = &triangle[k * (k + 1) / 2..][..=k];
        let inverse: f64 = l[k].into();
        let v = s[k].map(|v| v * inverse);
        for c in 0..k {
            take::<L, FUSED>(&mut s[c], l[c].into(), &v);
        }
        x[first + k].0 = v;
    }
}

/// `v ← v − l·s`.
#[inline(always)]
#[allow(clippy::inline_always)]
fn take<const L: usize, const FUSED: bool>(v: &mut [f64; L], l: f64, s: &[f64; L]) {
    for (v, s) in v.iter_mut().zip(s) {
        *v = if FUSED { (-l).mul_add(*s, *v) } else { *v - l * s };
    }
}
