//! `calib_results.txt` of OCamCalib: five groups of numbers between comments.
//!
//! ```text
//! n a₀ a₁ …        the ray at row r, column c:  (x, y, z) ∝ (ρ_row, ρ_col, a₀ + a₁ |ρ| + …), the camera looking along −z
//! m …              the fitted inverse, not used
//! x_c y_c          row and column of the center, pixel centers at integers
//! c d e            (r, c) = (c d; e 1) ρ + center
//! height width
//! ```

use nalgebra::Matrix2;

use super::{Pinhole, Profile, ProfileError};
use crate::{Ocam, Projection};
use plumbline_num::math::{Point2, Vec2};

/// Maximum number of coefficients; calibrations have degrees 3 to 7.
const MAX_COEFFICIENTS: usize = 24;

pub(super) fn is_calibration(text: &str) -> bool {
    text.lines().any(|l| l.starts_with('#') && l.contains("polynomial coefficients for the DIRECT mapping"))
}

pub(super) fn lens(text: &str) -> Result<Profile, ProfileError> {
    let rows: Vec<(usize, Vec<f64>)> = text
        .lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
        .map(|(number, line)| Ok((number, numbers(number, line)?)))
        .collect::<Result<_, ProfileError>>()?;
    let [direct, _, center, affine, size, ..] = rows.as_slice() else {
        let (key, expected) = ("a group of numbers".to_owned(), "polynomial, inverse, center, affine parameters, size");
        return Err(ProfileError::Missing { key, expected });
    };
    let wrong = |row: &(usize, Vec<f64>), expected: &str| {
        ProfileError::value(format!("line {}", row.0), format!("{:?}", row.1), expected)
    };
    let [count, a @ ..] = direct.1.as_slice() else { return Err(wrong(direct, "a count and coefficients")) };
    if *count != a.len() as f64 || a.len() > MAX_COEFFICIENTS || a.is_empty() {
        return Err(wrong(direct, "as many coefficients as the first number says (1 to 24)"));
    }
    let [row, column] = center.1[..] else { return Err(wrong(center, "row and column")) };
    let [c, d, e] = affine.1[..] else { return Err(wrong(affine, "c d e")) };
    let [height, width] = size.1[..] else { return Err(wrong(size, "height and width")) };
    let f = -a[0];
    if !(f > 0.0) {
        return Err(wrong(direct, "a negative first coefficient: the camera looks along -z"));
    }
    let scaled: Vec<f64> = (0..).zip(&a[1..]).map(|(i, a)| -a * f.powi(i)).collect();
    let model = Ocam::new(&scaled, Matrix2::new(1.0, e, d, c))?;
    let pinhole = Pinhole { focal: Vec2::new(f, f), center: Point2::new(column, row), size: (width, height) };
    let lens = pinhole.lens(Projection::Ocam(model), 0.5)?;
    Ok(Profile { name: String::new(), format: "OCamCalib", lens, rms_px: None, notes: Vec::new() })
}

fn numbers(number: usize, line: &str) -> Result<Vec<f64>, ProfileError> {
    let parsed = |word: &str| word.parse::<f64>().ok().filter(|n| n.is_finite());
    let refused = |word: &str| ProfileError::value(format!("line {number}"), word, "a number");
    line.split_whitespace().map(|word| parsed(word).ok_or_else(|| refused(word))).collect()
}
