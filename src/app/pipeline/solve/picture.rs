//! Matrices as pictures: where `A` and its factor are non-zero, ordering beside ordering.
//!
//! A panel shows a matrix, its first entry in the upper left corner. Where a pixel covers many entries it is the darker
//! the more of them there are; entries of `A` are blue, those that elimination adds orange.

use plumbline_image::canvas::{Canvas, Rgb, text_width};
use plumbline_num::sparse::FactorStructure;

/// Side of a panel, px.
const PANEL: usize = 360;
/// Between panels, px.
const GAP: usize = 24;
/// Height of the line above a panel, px.
const LABEL: usize = 24;
/// Side of a dot of the letters, px.
const SCALE: usize = 2;
/// Opacity of a pixel with a single one of its many entries: faint, but seen.
const FAINTEST: f32 = 0.3;

const PAPER: Rgb = [255, 255, 255];
const FRAME: Rgb = [200, 204, 210];
const INK: Rgb = [40, 44, 52];
const OWN: Rgb = [28, 84, 178];
const FILL: Rgb = [230, 120, 20];

/// How many entries of `A`, and how many of `L` alone, each pixel of a panel covers.
struct Density {
    side: usize,
    n: usize,
    own: Vec<u32>,
    fill: Vec<u32>,
}

impl Density {
    fn new(n: usize) -> Self {
        let side = n.clamp(1, PANEL);
        Self { side, n, own: vec![0; side * side], fill: vec![0; side * side] }
    }

    fn add(&mut self, row: usize, column: usize, own: bool) {
        let pixel = |k: usize| k * self.side / self.n;
        let at = pixel(row) * self.side + pixel(column);
        if own { self.own[at] += 1 } else { self.fill[at] += 1 }
    }

    fn draw(&self, canvas: &mut Canvas, left: usize, top: usize) {
        let per_side = self.n.div_ceil(self.side) as f32;
        let opacity = |count: u32| {
            let fraction = (count as f32 / (per_side * per_side)).min(1.0);
            if count == 0 { 0.0 } else { FAINTEST + (1.0 - FAINTEST) * fraction.sqrt() }
        };
        for y in 0..PANEL {
            for x in 0..PANEL {
                let at = y * self.side / PANEL * self.side + x * self.side / PANEL;
                let (x, y) = ((left + x) as i64, (top + y) as i64);
                canvas.blend(x, y, FILL, opacity(self.fill[at]));
                canvas.blend(x, y, OWN, opacity(self.own[at]));
            }
        }
    }
}

/// One column of panels for each ordering: `A` above, `L` below.
pub(super) fn draw(structures: &[(&str, FactorStructure<'_>)]) -> Canvas {
    let width = GAP + structures.len() * (PANEL + GAP);
    let mut canvas = Canvas::new(width, 2 * (LABEL + PANEL + GAP) + GAP, PAPER);
    for (k, (name, structure)) in structures.iter().enumerate() {
        let n = structure.order().len();
        let (mut a, mut l) = (Density::new(n), Density::new(n));
        structure.for_each(|i, j, own| {
            l.add(i, j, own);
            if own {
                a.add(i, j, true);
                if i != j {
                    a.add(j, i, true);
                }
            }
        });
        let left = GAP + k * (PANEL + GAP);
        let labels = [name.to_uppercase(), format!("NNZ(L) {}", structure.nnz())];
        for (row, (density, label)) in [a, l].iter().zip(labels).enumerate() {
            let top = GAP + row * (LABEL + PANEL + GAP) + LABEL;
            frame(&mut canvas, left, top);
            density.draw(&mut canvas, left, top);
            let indent = PANEL.saturating_sub(text_width(&label, SCALE)) / 2;
            canvas.text((left + indent) as i64, (top - LABEL) as i64, &label, INK, SCALE);
        }
    }
    canvas
}

/// A line around a panel, just outside it.
fn frame(canvas: &mut Canvas, left: usize, top: usize) {
    for k in 0..PANEL + 2 {
        let (x, y) = ((left + k) as i64 - 1, (top + k) as i64 - 1);
        let (left, top, far) = (left as i64 - 1, top as i64 - 1, PANEL as i64 + 1);
        for (x, y) in [(x, top), (x, top + far), (left, y), (left + far, y)] {
            canvas.blend(x, y, FRAME, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_num::sparse::{Ordering, Pattern};

    #[test]
    fn fill_is_drawn_where_elimination_puts_it() {
        // An arrow that points in the wrong direction fills completely; turned around, not at all.
        let pattern = Pattern::new(4, (1..4).map(|i| (i, 0))).expect("in range");
        let structures: Vec<_> = [Ordering::Natural, Ordering::Amd]
            .iter()
            .map(|o| ("x", FactorStructure::new(&pattern, o).expect("valid")))
            .collect();
        let canvas = draw(&structures);
        let cell = |panel: usize, row: usize, i: usize, j: usize| {
            let x = GAP + panel * (PANEL + GAP) + (2 * j + 1) * PANEL / 8;
            let y = GAP + LABEL + row * (LABEL + PANEL + GAP) + (2 * i + 1) * PANEL / 8;
            canvas.pixels()[y * canvas.width() + x]
        };
        assert_eq!([cell(0, 1, 3, 1), cell(0, 0, 3, 1), cell(0, 0, 0, 3)], [FILL, PAPER, OWN]);
        let orange = |panel: usize| (0..16).filter(|k| cell(panel, 1, k / 4, k % 4) == FILL).count();
        assert_eq!((orange(0), orange(1)), (3, 0));
    }
}
