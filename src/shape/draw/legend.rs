//! The color bar at the right edge of the picture.

#![allow(clippy::cast_possible_wrap)] // sides of pictures are far below 2^63

use super::Scale;
use plumbline_image::canvas::{Canvas, Rgb, text_width};

/// Height of the bar as a fraction of the picture's.
const HEIGHT: f64 = 0.6;
/// Labels beside the bar: both ends, the middle and the quarters.
const TICKS: usize = 5;
const INK: Rgb = [40, 44, 52];

/// Draws the bar, unless the picture is too small for it.
pub(super) fn draw(scale: &Scale, canvas: &mut Canvas) {
    let text = (canvas.width().min(canvas.height()) / 400).clamp(1, 4);
    let labels: Vec<String> = (0..TICKS).map(|k| number(value(scale, k))).collect();
    let widest = labels.iter().map(|l| text_width(l, text)).max().unwrap_or(0);
    let (bar, margin) = (12 * text, 8 * text);
    let height = (canvas.height() as f64 * HEIGHT) as usize;
    let needed = widest + bar + 3 * margin;
    if height < TICKS * 10 * text || canvas.width() < 2 * needed {
        return;
    }
    let left = canvas.width() - needed + margin;
    let top = (canvas.height() - height) / 2;
    let table = scale.map.table();
    for y in 0..height {
        let color = table[(height - 1 - y) * (table.len() - 1) / (height - 1)];
        for x in 0..bar {
            canvas.blend((left + x) as i64, (top + y) as i64, color, 1.0);
        }
    }
    for (k, label) in labels.iter().enumerate() {
        let y = top + (TICKS - 1 - k) * (height - 1) / (TICKS - 1);
        for x in bar..bar + 3 * text {
            canvas.blend((left + x) as i64, y as i64, INK, 1.0);
        }
        let at = ((left + bar + 5 * text) as i64, y as i64 - (7 * text / 2) as i64);
        canvas.text(at.0, at.1, label, INK, text);
    }
}

fn value(scale: &Scale, k: usize) -> f64 {
    let t = k as f64 / (TICKS - 1) as f64;
    scale.low * (1.0 - t) + scale.high * t
}

/// Three significant digits; with an exponent for very small and very large values.
fn number(v: f64) -> String {
    let size = v.abs();
    if v == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e5).contains(&size) {
        return format!("{v:.2e}");
    }
    let decimals = (2 - size.log10().floor() as i32).max(0) as usize;
    let text = format!("{v:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_no_trailing_zeros() {
        let shown = |v: f64| number(v);
        let cases =
            [(0.0, "0"), (0.5, "0.5"), (-12.346, "-12.3"), (1234.6, "1235"), (2e-7, "2.00e-7"), (3e9, "3.00e9")];
        for (value, text) in cases {
            assert_eq!(shown(value), text);
        }
    }
}
