//! The local warp: a picture with an irregular outline grown to its bounding rectangle by seams.
//!
//! As long as some pixel of the frame is missing, the longest run of missing pixels along a side is taken, a seam is
//! inserted across the part of the picture that the run spans, and the pixels between seam and run move by one pixel
//! towards the run; the seam's pixels are doubled. A seam is the connected path of least energy
//!
//! ```text
//! e = |∂I/∂x| + |∂I/∂y| + penalty of earlier seams,       ∞ where the picture is missing,
//! ```
//!
//! so that it runs where growing shows least. What remains of it is a displacement per pixel: which pixel of the picture it
//! came from. It places the grid; no pixel is drawn through it.
//!
//! # References
//! S. Avidan, A. Shamir, *Seam carving for content-aware image resizing*, ACM Trans. Graph. (SIGGRAPH) 26 (2007).
//! K. He, H. Chang, J. Sun, *Rectangling panoramic images via warping*, ACM Trans. Graph. (SIGGRAPH) 32 (2013), section 3.1.

use plumbline_num::run::{Run, Stopped};

/// Energy of a missing pixel: above that of any path through the picture.
const MISSING: f32 = 1e6;
/// Energy that a seam adds to its pixels, a quarter of the gray range: later seams avoid them unless everything else
/// has edges.
const REUSE_PENALTY: f32 = 64.0;
/// Minimum energy of a pixel: prefers short seams in flat regions.
const MIN_ENERGY: f32 = 1.0;

/// A picture that grows; row-major.
#[derive(Clone, Debug)]
pub(super) struct Canvas {
    width: usize,
    height: usize,
    luma: Vec<f32>,
    left: Vec<f32>,
    missing: Vec<bool>,
    /// Which pixel of the picture each pixel came from.
    source: Vec<(u32, u32)>,
}

/// Where missing pixels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Left,
    Right,
    Top,
    Bottom,
}

const SIDES: [Side; 4] = [Side::Left, Side::Right, Side::Top, Side::Bottom];

impl Canvas {
    /// A picture of gray levels 0 to 255, and where it is missing.
    pub(super) fn new(width: usize, height: usize, luma: Vec<f32>, missing: Vec<bool>) -> Self {
        let source = (0..width * height).map(|k| ((k % width) as u32, (k / width) as u32)).collect();
        Self { width, height, luma, left: vec![0.0; width * height], missing, source }
    }

    /// Grows it until the frame is whole; false where that does not come to an end.
    pub(super) fn grow(&mut self, run: &Run) -> Result<bool, Stopped> {
        // Every seam moves at least one missing pixel out, save where a whole line is missing.
        for _ in 0..2 * (self.width + self.height) {
            run.check()?;
            let runs = SIDES.map(|side| self.longest_run(side));
            let Some((side, (first, end))) =
                SIDES.into_iter().zip(runs).max_by_key(|(_, (first, end))| end - first).filter(|(_, (a, b))| b > a)
            else {
                return Ok(true);
            };
            self.insert(side, first, end);
        }
        Ok(false)
    }

    /// Which pixel of the picture each pixel came from.
    pub(super) fn source(&self) -> &[(u32, u32)] {
        &self.source
    }

    /// Length of a side, and depth across.
    fn extent(&self, side: Side) -> (usize, usize) {
        match side {
            Side::Top | Side::Bottom => (self.width, self.height),
            Side::Left | Side::Right => (self.height, self.width),
        }
    }

    /// The pixel at position `u` along a side, `v` away from it.
    fn at(&self, side: Side, u: usize, v: usize) -> usize {
        match side {
            Side::Top => v * self.width + u,
            Side::Bottom => (self.height - 1 - v) * self.width + u,
            Side::Left => u * self.width + v,
            Side::Right => u * self.width + self.width - 1 - v,
        }
    }

    /// The first and one past the last position of the longest run of missing pixels along a side.
    fn longest_run(&self, side: Side) -> (usize, usize) {
        let (length, _) = self.extent(side);
        let (mut best, mut start) = ((0, 0), 0);
        for u in 0..length {
            if !self.missing[self.at(side, u, 0)] {
                start = u + 1;
            } else if u + 1 - start > best.1 - best.0 {
                best = (start, u + 1);
            }
        }
        best
    }

    /// Inserts a seam across the positions from `first` to `end` and moves the pixels before it towards the side.
    fn insert(&mut self, side: Side, first: usize, end: usize) {
        let seam = self.seam(side, first, end);
        for (u, &cut) in (first..end).zip(&seam) {
            for v in 0..cut {
                let (to, from) = (self.at(side, u, v), self.at(side, u, v + 1));
                self.luma[to] = self.luma[from];
                self.left[to] = self.left[from];
                self.missing[to] = self.missing[from];
                self.source[to] = self.source[from];
            }
            for v in cut.saturating_sub(1)..=cut {
                let k = self.at(side, u, v);
                self.left[k] += REUSE_PENALTY;
            }
        }
    }

    fn energy(&self, k: usize) -> f32 {
        if self.missing[k] {
            return MISSING;
        }
        let (x, y) = (k % self.width, k / self.width);
        let step = |valid: bool, next: usize| {
            if valid && !self.missing[next] { (self.luma[next] - self.luma[k]).abs() } else { 0.0 }
        };
        MIN_ENERGY + self.left[k] + step(x + 1 < self.width, k + 1) + step(y + 1 < self.height, k + self.width)
    }

    /// The path of least energy: its distance from the side at each position.
    fn seam(&self, side: Side, first: usize, end: usize) -> Vec<usize> {
        let (_, depth) = self.extent(side);
        let mut before = vec![0.0_f32; depth];
        let mut steps: Vec<Vec<i8>> = Vec::with_capacity(end - first);
        for u in first..end {
            let mut now = vec![0.0; depth];
            let mut step = vec![0_i8; depth];
            for v in 0..depth {
                let mut best = (before[v], 0);
                if v > 0 && before[v - 1] < best.0 {
                    best = (before[v - 1], -1);
                }
                if v + 1 < depth && before[v + 1] < best.0 {
                    best = (before[v + 1], 1);
                }
                now[v] = best.0 + self.energy(self.at(side, u, v));
                step[v] = best.1;
            }
            before = now;
            steps.push(step);
        }
        let last = (0..depth).min_by(|a, b| before[*a].total_cmp(&before[*b])).unwrap_or(0);
        let mut seam = vec![last; end - first];
        for n in (1..seam.len()).rev() {
            seam[n - 1] = seam[n].saturating_add_signed(isize::from(steps[n][seam[n]]));
        }
        seam
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk of stripes in a frame.
    fn disk(n: usize) -> Canvas {
        let middle = 0.5 * (n as f64 - 1.0);
        let at = |k: usize| ((k % n) as f64 - middle, (k / n) as f64 - middle);
        let luma = (0..n * n).map(|k| if (k % n) % 8 < 4 { 40.0 } else { 200.0 }).collect();
        let missing = (0..n * n).map(|k| at(k).0.hypot(at(k).1) > middle).collect();
        Canvas::new(n, n, luma, missing)
    }

    #[test]
    fn an_expanded_picture_is_complete_and_contains_only_source_pixels() {
        let before = disk(60);
        let mut after = before.clone();
        assert!(after.grow(&Run::default()).expect("a run that never stops"));
        for (k, &(x, y)) in after.source().iter().enumerate() {
            assert!(!before.missing[y as usize * 60 + x as usize], "pixel {k} came from outside");
        }
    }

    #[test]
    fn a_whole_picture_stays_as_it_is() {
        let mut canvas = Canvas::new(20, 10, vec![100.0; 200], vec![false; 200]);
        let before = canvas.source.clone();
        assert!(canvas.grow(&Run::default()).expect("a run that never stops"));
        assert_eq!(canvas.source(), before);
    }

    #[test]
    fn seams_go_around_what_has_edges() {
        // The upper row is missing, an upright bar of texture stands in the lower half: rows grow above it.
        let (w, h) = (40, 30);
        let luma = (0..w * h).map(|k| if k / w > 12 { ((k * 37) % 200) as f32 } else { 120.0 }).collect();
        let mut canvas = Canvas::new(w, h, luma, (0..w * h).map(|k| k < 3 * w).collect());
        assert!(canvas.grow(&Run::default()).expect("a run that never stops"));
        let moved = (0..w * h).filter(|&k| k / w > 12 && canvas.source[k] != ((k % w) as u32, (k / w) as u32)).count();
        assert_eq!(moved, 0);
    }

    #[test]
    fn order_along_rows_and_columns_is_kept() {
        let mut canvas = disk(60);
        assert!(canvas.grow(&Run::default()).expect("a run that never stops"));
        let back = |k: usize, next: usize, along: fn((u32, u32)) -> u32| {
            along(canvas.source[next]) + 1 < along(canvas.source[k])
        };
        let turned = (0..59 * 59).filter(|n| {
            let k = n / 59 * 60 + n % 59;
            back(k, k + 1, |p| p.0) || back(k, k + 60, |p| p.1)
        });
        assert!(turned.count() < 60 * 60 / 50);
    }
}
