//! Importance of a clip's moments, small.

use plumbline_image::feature::Importance;
use plumbline_num::math::Rect;

/// Approximate number of cells per moment: 48 × 27 for a 16:9 picture.
const CELLS: f64 = 1300.0;
/// Smallest and largest number of columns and rows: those of a picture 81 times as wide as it is high.
const MIN_SIDE: usize = 4;
const MAX_SIDE: usize = 325;

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
        let count = |aspect: f64| ((CELLS * aspect).sqrt().round() as usize).clamp(MIN_SIDE, MAX_SIDE);
        Self { cols: count(aspect), rows: count(1.0 / aspect), moments: Vec::new() }
    }

    /// Keeps the importance of a frame; frames ascend.
    pub fn push(&mut self, frame: usize, importance: &Importance) {
        let cells = importance.cell_means(&Rect::of_size(1.0, 1.0), self.cols, self.rows);
        self.moments.push((frame, cells.into_iter().map(|v| (v * 255.0).round() as u8).collect()));
    }

    /// Whether it is of a clip of this size, px.
    pub fn is_of(&self, size: (usize, usize)) -> bool {
        let new = Self::new(size);
        (self.cols, self.rows) == (new.cols, new.rows)
    }

    /// All of it as bytes: columns and rows, then frame and cells of each moment; numbers of 64 bits, little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let number = |n: usize| (n as u64).to_le_bytes();
        let mut bytes = [number(self.cols), number(self.rows)].concat();
        for (frame, cells) in &self.moments {
            bytes.extend(number(*frame));
            bytes.extend(cells);
        }
        bytes
    }

    /// What [`Self::to_bytes`] gave; `None` for other bytes.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let number = |bytes: &[u8; 8]| usize::try_from(u64::from_le_bytes(*bytes)).ok();
        let (cols, rest) = bytes.split_first_chunk()?;
        let (rows, rest) = rest.split_first_chunk()?;
        let (cols, rows) = (number(cols)?, number(rows)?);
        if !(MIN_SIDE..=MAX_SIDE).contains(&cols) || !(MIN_SIDE..=MAX_SIDE).contains(&rows) {
            return None;
        }
        let moments = rest.chunks(8 + cols * rows).map(|moment| {
            let (frame, cells) = moment.split_first_chunk()?;
            (cells.len() == cols * rows).then_some((number(frame)?, cells.to_vec()))
        });
        let moments = moments.collect::<Option<Vec<_>>>()?;
        moments.is_sorted_by(|a, b| a.0 < b.0).then_some(Self { cols, rows, moments })
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
