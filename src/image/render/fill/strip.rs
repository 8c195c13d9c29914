//! The blocks of a frame that filling touches: those that it does not cover fully, and a band along them.
//!
//! Everything that varies smoothly over the frame (positions, displacement, tone, trust) is held per block of
//! [`BLOCK`] luma px, at its center or at the corners of the block grid, and interpolated bilinearly.

use super::canvas::FEATHER_PX;
use crate::warp::{Lattice, WarpField};
use plumbline_num::math::{Point2, PointMap, Vec2};

/// Side of a block, luma px. Smaller blocks follow misaligned texture; larger ones miss vignetting.
pub(super) const BLOCK: usize = 16;
/// Blocks of the band: 48 px of overlap determine displacement and tone at the edge, and cost about as much as the area
/// a typical frame misses.
const BAND: usize = 3;
/// Probes per block along each axis for the coverage of a neighbor.
const PROBES: usize = 2;

/// A block that the frame itself does not cover.
#[derive(Debug)]
pub(super) struct Probe {
    /// Index among the strip's blocks, and of the luma sample in its block.
    pub(super) at: (usize, usize),
    /// Its position in the frame itself, outside or at the edge, px.
    pub(super) src: Point2,
}

/// See the module.
#[derive(Debug)]
pub(super) struct Strip {
    /// Blocks along x.
    pub(super) cols: usize,
    /// Blocks along y.
    pub(super) rows: usize,
    /// Width and height of the frame, px.
    pub(super) size: (usize, usize),
    /// The blocks touched, row-major indices, ascending.
    pub(super) blocks: Vec<usize>,
    /// Places to be covered.
    pub(super) probes: Vec<Probe>,
    /// Position in the frame itself of the corners of the grid, `(cols + 1) × (rows + 1)`; `None` where undefined.
    own: Vec<Option<Point2>>,
}

/// Some blocks of a strip: those that a neighbor is asked for, and what lies along them.
#[derive(Debug)]
pub(super) struct Part {
    /// Positions among the strip's blocks, ascending.
    pub(super) slots: Vec<usize>,
    /// Indices in the grid.
    pub(super) blocks: Vec<usize>,
}

/// Offsets `src − out` at the corners of a block, luma px: top left, top right, bottom left, bottom right.
pub(super) type Corners = [[f32; 2]; 4];

impl Strip {
    /// The strip of a frame rendered through `own`; `None` where it covers everything.
    pub(super) fn new(own: &Lattice, size: (usize, usize)) -> Option<Self> {
        let (cols, rows) = (size.0.div_ceil(BLOCK), size.1.div_ceil(BLOCK));
        let mut strip = Self { cols, rows, size, blocks: Vec::new(), probes: Vec::new(), own: Vec::new() };
        strip.own = (0..(cols + 1) * (rows + 1)).map(|k| own.src_from_out(strip.corner(k))).collect();
        let open = |&k: &usize| !strip.own[k].is_some_and(|p| strip.margin(p) >= f64::from(FEATHER_PX));
        let missing: Vec<bool> = (0..cols * rows).map(|b| strip.corner_indices(b).iter().any(open)).collect();
        if !missing.contains(&true) {
            return None;
        }
        strip.blocks = (0..cols * rows).filter(|&block| strip.near(block, &missing)).collect();
        strip.probes = strip.blocks.iter().enumerate().flat_map(|(slot, &b)| strip.probes_of(slot, b, own)).collect();
        Some(strip)
    }

    /// The blocks of the strip that are `open`, one flag per block of the strip, and the band along them.
    pub(super) fn part(&self, open: &[bool]) -> Part {
        let mut missing = vec![false; self.cols * self.rows];
        self.blocks.iter().zip(open).for_each(|(&block, &open)| missing[block] = open);
        let near = |&slot: &usize| self.near(self.blocks[slot], &missing);
        let slots: Vec<usize> = (0..self.blocks.len()).filter(near).collect();
        Part { blocks: slots.iter().map(|&slot| self.blocks[slot]).collect(), slots }
    }

    /// A missing block lies within the band around `block`.
    fn near(&self, block: usize, missing: &[bool]) -> bool {
        let (i, j) = (block % self.cols, block / self.cols);
        let columns = i.saturating_sub(BAND)..(i + BAND + 1).min(self.cols);
        let mut rows = j.saturating_sub(BAND)..(j + BAND + 1).min(self.rows);
        rows.any(|l| missing[l * self.cols..][columns.clone()].contains(&true))
    }

    fn probes_of(&self, slot: usize, block: usize, own: &Lattice) -> impl Iterator<Item = Probe> {
        let (x0, y0) = (block % self.cols * BLOCK, block / self.cols * BLOCK);
        let along = |k: usize| BLOCK * (2 * k + 1) / (2 * PROBES);
        let probe = move |k: usize| {
            let (i, j) = (along(k % PROBES), along(k / PROBES));
            let (x, y) = (x0 + i, y0 + j);
            let src = own.src_from_out(Point2::new(x as f64 + 0.5, y as f64 + 0.5))?;
            let inside = x < self.size.0 && y < self.size.1;
            let open = self.margin(src) < 0.5 * f64::from(FEATHER_PX);
            (inside && open).then_some(Probe { at: (slot, j * BLOCK + i), src })
        };
        (0..PROBES * PROBES).filter_map(probe).collect::<Vec<_>>().into_iter()
    }

    /// Distance of the outermost sample centers of a source from `p`, px, positive inside.
    pub(super) fn margin(&self, p: Point2) -> f64 {
        let along = |x: f64, n: usize| (x - 0.5).min(n as f64 - 0.5 - x);
        along(p.x, self.size.0).min(along(p.y, self.size.1))
    }

    /// Corner `k` of the grid, in the output.
    fn corner(&self, k: usize) -> Point2 {
        Point2::new((k % (self.cols + 1) * BLOCK) as f64, (k / (self.cols + 1) * BLOCK) as f64)
    }

    /// Indices of a block's corners.
    pub(super) fn corner_indices(&self, block: usize) -> [usize; 4] {
        let first = block / self.cols * (self.cols + 1) + block % self.cols;
        [first, first + 1, first + self.cols + 1, first + self.cols + 2]
    }

    /// Offsets of the frame itself for each block of the strip; `None` where undefined.
    pub(super) fn own_corners(&self) -> Vec<Option<Corners>> {
        self.corners(&self.own, &self.blocks)
    }

    /// Offsets of a neighbor for each of `blocks`. `shift`, px, is added at each block's center before the map.
    pub(super) fn neighbor_corners(
        &self,
        field: &WarpField,
        shift: &[[f32; 2]],
        blocks: &[usize],
    ) -> Vec<Option<Corners>> {
        let mut sums = vec![[0.0_f64; 3]; self.own.len()];
        for &block in blocks {
            for k in self.corner_indices(block) {
                sums[k][0] += f64::from(shift[block][0]);
                sums[k][1] += f64::from(shift[block][1]);
                sums[k][2] += 1.0;
            }
        }
        let position = |(own, [x, y, n]): (&Option<Point2>, [f64; 3])| {
            if n > 0.0 { field.map((*own)? + Vec2::new(x, y) / n) } else { None }
        };
        let positions: Vec<_> = self.own.iter().zip(sums).map(position).collect();
        self.corners(&positions, blocks)
    }

    fn corners(&self, positions: &[Option<Point2>], blocks: &[usize]) -> Vec<Option<Corners>> {
        let offset = |k: usize| positions[k].map(|p| p - self.corner(k)).map(|d| [d.x as f32, d.y as f32]);
        let of = |&block: &usize| {
            let [a, b, c, d] = self.corner_indices(block);
            Some([offset(a)?, offset(b)?, offset(c)?, offset(d)?])
        };
        blocks.iter().map(of).collect()
    }
}
