//! Affine expressions `Σⱼ aⱼ xⱼ + k` of unknowns with `D` coordinates.

use std::ops::{Add, Mul, Neg, Sub};

use super::Value;

/// `Σⱼ aⱼ xⱼ + k`: scalar coefficients, so that all `D` coordinates act alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Expr<const D: usize> {
    terms: Vec<(usize, f64)>,
    constant: Value<D>,
}

impl<const D: usize> Expr<D> {
    /// The unknown `x_i` itself.
    pub fn unknown(i: usize) -> Self {
        Self { terms: vec![(i, 1.0)], constant: Value::zeros() }
    }

    /// The expression without unknowns.
    pub fn constant(k: Value<D>) -> Self {
        Self { terms: Vec::new(), constant: k }
    }

    /// Unknowns ascending, each once, with their coefficients; and the constant.
    pub(super) fn into_parts(mut self) -> (Vec<(usize, f64)>, Value<D>) {
        self.terms.sort_by_key(|&(i, _)| i);
        self.terms.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            if same {
                kept.1 += next.1;
            }
            same
        });
        (self.terms, self.constant)
    }
}

impl<const D: usize> From<Value<D>> for Expr<D> {
    fn from(k: Value<D>) -> Self {
        Self::constant(k)
    }
}

impl From<f64> for Expr<1> {
    fn from(k: f64) -> Self {
        Self::constant(Value::<1>::new(k))
    }
}

impl<const D: usize, R: Into<Self>> Add<R> for Expr<D> {
    type Output = Self;

    fn add(mut self, other: R) -> Self {
        let other = other.into();
        self.terms.extend(other.terms);
        self.constant += other.constant;
        self
    }
}

impl<const D: usize> Neg for Expr<D> {
    type Output = Self;

    fn neg(self) -> Self {
        self * -1.0
    }
}

impl<const D: usize, R: Into<Self>> Sub<R> for Expr<D> {
    type Output = Self;

    fn sub(self, other: R) -> Self {
        self + -other.into()
    }
}

impl<const D: usize> Mul<f64> for Expr<D> {
    type Output = Self;

    fn mul(mut self, s: f64) -> Self {
        self.terms.iter_mut().for_each(|(_, a)| *a *= s);
        self.constant *= s;
        self
    }
}

impl<const D: usize> Mul<Expr<D>> for f64 {
    type Output = Expr<D>;

    fn mul(self, e: Expr<D>) -> Expr<D> {
        e * self
    }
}
