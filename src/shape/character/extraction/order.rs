//! Costs that order equally for a model and its rotated, scaled or moved copy.

/// A cost in single precision: values that differ by rounding compare equal, and the vertex index breaks the tie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cost(f32);

impl Cost {
    pub(super) fn new(value: f64) -> Self {
        Self(value as f32)
    }
}

impl Eq for Cost {}

impl PartialOrd for Cost {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Cost {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}
