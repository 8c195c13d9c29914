//! The two number fields in which systems are solved.

use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A complex number `x + iy`: one plane point as one unknown.
pub type Complex = faer::c64;

/// Real or complex entries of a matrix.
///
/// Complex entries pay where an energy is linear over ℂ (similarities of the plane are): `n` complex unknowns factor with
/// about half the arithmetic of `2n` real ones.
pub trait Scalar:
    Copy
    + Default
    + Send
    + Sync
    + std::fmt::Debug
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + 'static
{
    /// The scalar with this real part.
    fn real(re: f64) -> Self;
    /// Complex conjugate; the number itself if it is real.
    #[must_use]
    fn conjugate(self) -> Self;
    /// `|z|²`.
    fn norm_sqr(self) -> f64;
    /// `s·z` for real `s`.
    #[must_use]
    fn times(self, s: f64) -> Self;
    /// `self − a·s`, with fused multiplications where the caller is compiled for processors that have them.
    #[must_use]
    fn less<const FUSED: bool>(self, a: Self, s: Self) -> Self;
    /// True where every part is finite.
    fn finite(self) -> bool;
    /// Real part.
    fn re(self) -> f64;
    /// The numbers as real ones, where that is what they are.
    fn reals(numbers: &[Self]) -> Option<&[f64]> {
        let _ = numbers;
        None
    }
    /// The same, writable.
    fn reals_mut(numbers: &mut [Self]) -> Option<&mut [f64]> {
        let _ = numbers;
        None
    }
}

impl Scalar for f64 {
    fn real(re: f64) -> Self {
        re
    }
    fn conjugate(self) -> Self {
        self
    }
    fn norm_sqr(self) -> f64 {
        self * self
    }
    fn times(self, s: f64) -> Self {
        self * s
    }
    #[expect(clippy::inline_always, reason = "a fused product that is not inlined calls the library's")]
    #[inline(always)]
    fn less<const FUSED: bool>(self, a: Self, s: Self) -> Self {
        if FUSED { (-a).mul_add(s, self) } else { self - a * s }
    }
    fn finite(self) -> bool {
        self.is_finite()
    }
    fn re(self) -> f64 {
        self
    }
    fn reals(numbers: &[Self]) -> Option<&[f64]> {
        Some(numbers)
    }
    fn reals_mut(numbers: &mut [Self]) -> Option<&mut [f64]> {
        Some(numbers)
    }
}

impl Scalar for Complex {
    fn real(re: f64) -> Self {
        Self::new(re, 0.0)
    }
    fn conjugate(self) -> Self {
        self.conj()
    }
    fn norm_sqr(self) -> f64 {
        self.re * self.re + self.im * self.im
    }
    fn times(self, s: f64) -> Self {
        Self::new(self.re * s, self.im * s)
    }
    #[expect(clippy::inline_always, reason = "a fused product that is not inlined calls the library's")]
    #[inline(always)]
    fn less<const FUSED: bool>(self, a: Self, s: Self) -> Self {
        let (re, im) = (self.re.less::<FUSED>(a.re, s.re), self.im.less::<FUSED>(a.re, s.im));
        Self::new(re.less::<FUSED>(-a.im, s.im), im.less::<FUSED>(a.im, s.re))
    }
    fn finite(self) -> bool {
        self.re.is_finite() && self.im.is_finite()
    }
    fn re(self) -> f64 {
        self.re
    }
}
