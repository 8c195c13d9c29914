//! Values of polynomials `Σ cᵢ xⁱ`, by Horner's rule.

/// The value at `x`.
#[inline]
pub fn value(c: &[f64], x: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// The value and the derivative at `x`.
#[inline]
pub fn value_and_slope(c: &[f64], x: f64) -> (f64, f64) {
    c.iter().rev().fold((0.0, 0.0), |(sum, slope), c| (sum * x + c, slope * x + sum))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_and_slope_are_those_of_the_sum_of_powers() {
        let c = [3.0, -1.0, 0.5, 2.0];
        assert_eq!((value(&c, 2.0), value_and_slope(&c, 2.0)), (19.0, (19.0, 25.0)));
        assert_eq!((value(&[], 2.0), value_and_slope(&[7.0], 2.0)), (0.0, (7.0, 0.0)));
    }
}
