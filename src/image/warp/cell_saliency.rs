//! How visible a bent cell would be: texture shows distortion, an even sky does not.
//!
//! Liu et al. (2009) take `w_s = ‖color variance in the cell‖₂ + 0.5` with channels in [0, 1]. Analysis runs on luma
//! alone; a gray image has the same variance in all three channels, so `‖(σ², σ², σ²)‖₂ = √3 σ²` of the luma is used.

/// Saliency of a cell without any texture.
pub(super) const BASE: f64 = 0.5;

/// Writes the saliency of each of `cols × rows` cells, row-major, in [0.5, 0.5 + √3/4], from the rows of an 8-bit luma
/// image; a pixel belongs to the cell that holds its center. Cells smaller than a pixel get 0.5.
///
/// All rows must be equally long.
pub fn cell_saliency<'a>(
    luma: impl ExactSizeIterator<Item = &'a [u8]>,
    cols: usize,
    rows: usize,
    saliency: &mut Vec<f64>,
) {
    saliency.clear();
    saliency.reserve(cols * rows);
    let height = luma.len();
    let mut sums = vec![(0_u64, 0_u64, 0_u64); cols];
    let (mut row, mut first_row) = (0, 0);
    for (y, line) in luma.enumerate() {
        let row_of_y = (2 * y + 1) * rows / (2 * height);
        while row < row_of_y {
            flush(&mut sums, saliency);
            row += 1;
            first_row = y;
        }
        debug_assert!(first_row <= y);
        accumulate(line, &mut sums);
    }
    while row < rows {
        flush(&mut sums, saliency);
        row += 1;
    }
}

/// Adds a line's pixels to the count, sum and sum of squares of their cells.
fn accumulate(line: &[u8], sums: &mut [(u64, u64, u64)]) {
    let (width, cols) = (line.len(), sums.len());
    // First pixel whose center (x + ½) lies in cell c: smallest x with (2x + 1)·cols ≥ 2c·width.
    let first = |c: usize| (2 * c * width).div_ceil(cols).saturating_sub(1).div_ceil(2).min(width);
    for (c, cell) in sums.iter_mut().enumerate() {
        let pixels = &line[first(c)..first(c + 1)];
        let (sum, squares) = pixels.iter().fold((0_u32, 0_u64), |(sum, squares), &v| {
            let v = u32::from(v);
            (sum + v, squares + u64::from(v * v))
        });
        *cell = (cell.0 + pixels.len() as u64, cell.1 + u64::from(sum), cell.2 + squares);
    }
}

fn flush(sums: &mut [(u64, u64, u64)], saliency: &mut Vec<f64>) {
    for cell in sums {
        let (count, sum, squares) = std::mem::take(cell);
        let variance = if count == 0 {
            0.0
        } else {
            // In integers: n Σv² − (Σv)² is exact, so an even cell has variance 0 exactly.
            let spread = u128::from(count) * u128::from(squares) - u128::from(sum) * u128::from(sum);
            spread as f64 / (count as f64 * count as f64 * 255.0 * 255.0)
        };
        saliency.push(BASE + 3_f64.sqrt() * variance);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn saliency_of(width: usize, height: usize, cols: usize, rows: usize, f: impl Fn(usize, usize) -> u8) -> Vec<f64> {
        let image: Vec<u8> = (0..width * height).map(|i| f(i % width, i / width)).collect();
        let mut saliency = Vec::new();
        cell_saliency(image.chunks_exact(width), cols, rows, &mut saliency);
        saliency
    }

    #[test]
    fn an_even_image_has_the_base_everywhere() {
        assert_eq!(saliency_of(64, 36, 8, 4, |_, _| 201), vec![BASE; 32]);
    }

    #[test]
    fn black_and_white_halves_reach_the_largest_variance() {
        let s = saliency_of(64, 36, 1, 1, |x, _| if x < 32 { 0 } else { 255 });
        assert!((s[0] - (BASE + 3_f64.sqrt() / 4.0)).abs() < 1e-15, "{s:?}");
    }

    #[test]
    fn each_pixel_counts_in_the_cell_of_its_center() {
        // 10 px over 4 columns: borders at 2.5, 5 and 7.5, hence pixels 0-1 (center 2.5 belongs to the right), 2-4, 5-6, 7-9.
        let s = saliency_of(10, 10, 4, 1, |x, _| if x == 2 { 255 } else { 0 });
        assert_eq!((s[0], s[2], s[3]), (BASE, BASE, BASE));
        let third = 1.0 / 3.0;
        assert!((s[1] - (BASE + 3_f64.sqrt() * third * (1.0 - third))).abs() < 1e-15, "{s:?}");
        let s = saliency_of(10, 10, 1, 4, |_, y| if y == 2 { 255 } else { 0 });
        assert_eq!((s[0], s[2], s[3]), (BASE, BASE, BASE));
    }

    #[test]
    fn cells_smaller_than_a_pixel_do_not_fail() {
        assert_eq!(saliency_of(3, 2, 64, 36, |x, y| (x * 90 + y * 30) as u8), vec![BASE; 64 * 36]);
        assert_eq!(saliency_of(1, 0, 4, 4, |_, _| 0).len(), 16);
    }
}
