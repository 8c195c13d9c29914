//! Four-wide vector arithmetic.
//!
//! Plain loops over four entries, which the compiler turns into one, two or four instructions depending on the width of the
//! registers. Results are bit-identical on all processors, since no two operations are contracted.

#![allow(clippy::inline_always)] // A kernel is compiled for wide registers only as far as it is inlined.
#![allow(unsafe_code)] // One call, of code compiled for registers that the processor was found to have.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Number of lanes: four `f64` fill one AVX register.
pub(super) const LANES: usize = 4;

/// Four numbers: one quantity of four cells, or the coordinates `x, y, z, 0` of one vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub(super) struct Lanes(pub(super) [f64; LANES]);

impl Lanes {
    pub(super) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(super) const fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    /// The coordinates of a point, with 0 in the fourth lane.
    #[inline(always)]
    pub(super) const fn point([x, y, z]: [f64; 3]) -> Self {
        Self([x, y, z, 0.0])
    }

    /// The first three lanes.
    #[inline(always)]
    pub(super) const fn xyz(self) -> [f64; 3] {
        [self.0[0], self.0[1], self.0[2]]
    }

    #[inline(always)]
    fn each(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|l| f(self.0[l], other.0[l])))
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }

    /// Sum of the products of all lanes.
    #[inline(always)]
    pub(super) fn dot(self, other: Self) -> f64 {
        let Self([a, b, c, d]) = self * other;
        (a + b) + (c + d)
    }

    /// The largest lane; NaN counts as infinite.
    #[inline(always)]
    pub(super) fn largest(self) -> f64 {
        self.0.iter().fold(f64::NEG_INFINITY, |a, &b| {
            if b <= a {
                a
            } else if b > a {
                b
            } else {
                f64::INFINITY
            }
        })
    }

    /// True where every lane is greater than the other's; never for NaN.
    #[inline(always)]
    pub(super) fn above(self, other: Self) -> bool {
        self.0.iter().zip(&other.0).all(|(a, b)| a > b)
    }
}

macro_rules! elementwise {
    ($($trait:ident $method:ident $op:tt),*) => { $(
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.each(other, |a, b| a $op b)
            }
        }
    )* };
}

elementwise!(Add add +, Sub sub -, Mul mul *, Div div /);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|a| -a))
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Lanes {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

/// A computation on [`Lanes`]; `run` must be `#[inline(always)]` to be compiled for wide registers.
pub(super) trait Kernel {
    type Output;
    fn run(self) -> Self::Output;
}

/// Runs a kernel, compiled for the widest registers of this processor.
#[inline]
pub(super) fn run<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { run_avx2(kernel) };
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
