//! Ratios of width to height.

use std::fmt;
use std::str::FromStr;

/// Largest ratio that is read from text, and the inverse of the smallest: a picture of the largest side that is rendered
/// keeps more than a hundred rows there.
const MAX_RATIO: f64 = 100.0;

/// Ratio of width to height. Written `"16:9"`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AspectRatio {
    /// Width, in any unit.
    pub width: f64,
    /// Height, in the same unit.
    pub height: f64,
}

impl AspectRatio {
    /// From width and height, in any unit.
    pub const fn new(width: f64, height: f64) -> Self {
        Self { width, height }
    }

    /// Width over height.
    pub fn value(self) -> f64 {
        self.width / self.height
    }
}

impl FromStr for AspectRatio {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is no shape (expected WIDTH:HEIGHT between 1:100 and 100:1, such as 16:9)");
        let side = |t: &str| t.trim().parse::<f64>().ok().filter(|x| *x > 0.0 && x.is_finite());
        let (width, height) = text.split_once(':').ok_or_else(wrong)?;
        let ratio = side(width).zip(side(height)).map(|(width, height)| Self { width, height });
        ratio.filter(|r| (1.0 / MAX_RATIO..=MAX_RATIO).contains(&r.value())).ok_or_else(wrong)
    }
}

impl fmt::Display for AspectRatio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.width, self.height)
    }
}
