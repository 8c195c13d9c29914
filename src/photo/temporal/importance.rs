//! Importance of a clip's moments, small.

use plumbline_image::feature::Importance;
use plumbline_num::math::Rect;

/// Approximate number of cells per moment: 48 × 27 for a 16:9 picture.
const CELLS: f64 = 1300.0;

/// Importance at moments of a clip: a grid of bytes each, over the whole picture of the source. An hour of six moments
/// a second takes 28 MB.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClipImportance {
    pub(super) cols: usize,
    pub(super) rows: usize,
    /// Frames of the moments, in order, and their cells, row-major, 255 for 1.
    pub(super) moments: Vec<(usize, Vec<u8>)>,
}

impl ClipImportance {
    /// No moments yet of a clip of `width × height` px, both > 0.
    pub fn new((width, height): (usize, usize)) -> Self {
        let aspect = width as f64 / height as f64;
        let count = |aspect: f64| ((CELLS * aspect).sqrt().round() as usize).clamp(4, 325);
        Self { cols: count(aspect), rows: count(1.0 / aspect), moments: Vec::new() }
    }

    /// Keeps the importance of a frame; frames ascend.
    pub fn push(&mut self, frame: usize, importance: &Importance) {
        let cells = importance.cell_means(&Rect::of_size(1.0, 1.0), self.cols, self.rows);
        self.moments.push((frame, cells.into_iter().map(|v| (v * 255.0).round() as u8).collect()));
    }

    /// Moments kept.
    pub fn len(&self) -> usize {
        self.moments.len()
    }

    /// Nothing was kept.
    pub fn is_empty(&self) -> bool {
        self.moments.is_empty()
    }
}
