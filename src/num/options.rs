//! Options and their ranges: every method refuses a value out of range in the same words.

/// Settings: an option out of its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} {value} is invalid (expected {range})")]
pub struct OptionError {
    /// Name of the option.
    pub name: &'static str,
    /// What it was set to.
    pub value: f64,
    /// What it may be.
    pub range: &'static str,
}

impl OptionError {
    /// Refuses an option whose value is not `valid`; write the condition so that NaN fails it.
    ///
    /// # Errors
    /// [`OptionError`] with its name, value and range.
    pub fn check(valid: bool, name: &'static str, value: f64, range: &'static str) -> Result<(), Self> {
        if valid { Ok(()) } else { Err(Self { name, value, range }) }
    }

    /// Refuses the first of several options that is not above 0 and finite.
    ///
    /// # Errors
    /// [`OptionError`] with its name and value.
    pub fn check_positive(options: impl IntoIterator<Item = (&'static str, f64)>) -> Result<(), Self> {
        let mut options = options.into_iter();
        options.try_for_each(|(name, v)| Self::check(v > 0.0 && v.is_finite(), name, v, "above 0, finite"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_option_is_told_with_its_value_and_range() {
        let checked = |v: f64| OptionError::check((1.0..4.0).contains(&v), "spacing", v, "1 to below 4");
        assert_eq!(checked(1.0), Ok(()));
        assert_eq!(checked(4.5).unwrap_err().to_string(), "spacing 4.5 is invalid (expected 1 to below 4)");
        assert!(checked(f64::NAN).is_err());
    }

    #[test]
    fn the_first_option_that_is_not_positive_is_refused() {
        let refused = |b: f64| OptionError::check_positive([("a", 1.0), ("b", b), ("c", -1.0)]).unwrap_err().name;
        assert_eq!([0.0, f64::NAN, f64::INFINITY, 2.0].map(refused), ["b", "b", "b", "c"]);
    }
}
