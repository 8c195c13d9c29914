//! Ranges and ticks of axes.

/// Part of the data's extent that is left free above and below.
const MARGIN: f64 = 0.06;

/// A range of values with its ticks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    step: f64,
}

impl Axis {
    /// Exactly from `low` to `high`, with about `ticks` ticks.
    pub(super) fn exact(low: f64, high: f64, ticks: usize) -> Self {
        let step = nice((high - low) / ticks.max(1) as f64);
        Self { low, high, step }
    }

    /// Around the finite ones of `values`, no shorter than `least`, with about `ticks` ticks; 0 to 1 where there are none.
    pub(super) fn around(values: impl Iterator<Item = f64>, least: f64, ticks: usize) -> Self {
        let finite = values.filter(|v| v.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        if !(low <= high) {
            return Self::exact(0.0, 1.0, ticks);
        }
        // Numbers so near to each other that doubles hardly tell them apart are one.
        let least = least.max(1e-9 * low.abs().max(high.abs())).max(1e-9);
        let (center, half) = (f64::midpoint(low, high), ((high - low) * (0.5 + MARGIN)).max(least / 2.0));
        Self::exact(center - half, center + half, ticks)
    }

    /// Where `value` lies, as a share of the axis; the middle of an axis without extent.
    pub(super) fn share(&self, value: f64) -> f64 {
        let extent = self.high - self.low;
        if extent > 0.0 { (value - self.low) / extent } else { 0.5 }
    }

    /// The ticks: share of the axis and label. At least one, unless the axis has no extent.
    pub(super) fn ticks(&self) -> Vec<(f64, String)> {
        let decimals = decimals(self.step);
        let (first, last) = ((self.low / self.step - 1e-6).ceil(), (self.high / self.step + 1e-6).floor());
        // A step is more than a hundredth of any axis, so that this ends whatever it is.
        let count = ((last - first).clamp(-1.0, 100.0) + 1.0) as usize;
        (0..count).map(|k| (first + k as f64) * self.step).map(|v| (self.share(v), number(v, decimals))).collect()
    }
}

/// The smallest of 1, 2, 5 times a power of ten that is no less than `step`.
fn nice(step: f64) -> f64 {
    if !(step > 0.0 && step.is_finite()) {
        return 1.0;
    }
    let power = 10_f64.powf(step.log10().floor());
    let times = [1.0, 2.0, 5.0, 10.0].into_iter().find(|t| t * power >= step * (1.0 - 1e-9));
    times.unwrap_or(10.0) * power
}

fn decimals(step: f64) -> usize {
    (-(step * 1.000_001).log10().floor()).clamp(0.0, 9.0) as usize
}

/// A number with the sign that printers use, and no −0.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    match text.strip_prefix('-') {
        Some(rest) if zero => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks().into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn every_finite_value_lies_on_the_axis_around_them() {
        let values = [f64::NAN, -3.0, 17.5, f64::INFINITY, 4.0];
        let axis = Axis::around(values.into_iter(), 0.0, 5);
        let shares = values.iter().filter(|v| v.is_finite()).map(|v| axis.share(*v));
        assert!(shares.into_iter().all(|s| s > 0.0 && s < 1.0), "{axis:?}");
        assert!((axis.share(-3.0) - MARGIN / (1.0 + 2.0 * MARGIN)).abs() < 1e-12, "no more room than the margin");
    }

    #[test]
    fn a_constant_lies_in_the_middle_and_little_is_not_magnified() {
        for constant in [0.0, 5.0, -1e12] {
            assert!((Axis::around([constant; 3].into_iter(), 0.0, 5).share(constant) - 0.5).abs() < 1e-3, "{constant}");
        }
        let axis = Axis::around([0.0, 0.1].into_iter(), 2.0, 4);
        assert!((axis.share(0.1) - axis.share(0.0) - 0.05).abs() < 1e-12);
        assert_eq!(labels(&Axis::around(std::iter::empty(), 0.0, 2)), ["0.0", "0.5", "1.0"]);
    }

    #[test]
    fn nothing_is_less_than_nothing() {
        assert_eq!([-0.004, -0.0, -0.006, 1.005].map(|v| number(v, 2)), ["0.00", "0.00", "−0.01", "1.00"]);
    }

    #[test]
    fn ticks_are_round_numbers_inside_the_axis() {
        assert_eq!(labels(&Axis::exact(0.0, 10.0, 5)), ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(labels(&Axis::exact(-0.31, 0.29, 6)), ["−0.3", "−0.2", "−0.1", "0.0", "0.1", "0.2"]);
        assert_eq!(labels(&Axis::exact(99.0, 2103.0, 5)), ["500", "1000", "1500", "2000"]);
        assert_eq!(labels(&Axis::exact(0.0, 0.0, 5)), ["0"], "one moment");
        let axis = Axis::exact(-7.0, 13.0, 5);
        assert!(axis.ticks().iter().all(|(share, _)| (-1e-9..=1.0 + 1e-9).contains(share)));
    }
}
