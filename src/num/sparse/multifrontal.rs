//! Numeric Cholesky factorization, block of columns by block of columns, each handing the rest of its work to its parent.
//!
//! Block `s` of `w` columns with `r` rows below is a dense front: the panel of its columns, and the Hermitian `r×r` matrix `U`
//! of what elimination still owes to later columns.
//!
//! ```text
//! panel, U  ←  entries of A  +  Σ over children c of s: U_c, its rows moved to where s has them
//! panel     ←  L,   U ← U − M Mᴴ      (M the rows of L below the block's own)
//! ```
//!
//! In the order of elimination the children of a block are the top of a stack. Against collecting updates column by
//! column from all earlier blocks there are fewer and larger products, which is what counts on surfaces: most blocks are of a
//! few columns.
//!
//! # Reference
//! I. S. Duff, J. K. Reid, *The multifrontal solution of indefinite sparse symmetric linear systems*, ACM TOMS 9 (1983);
//! J. W. H. Liu, *The multifrontal method for sparse matrix solution: theory and practice*, SIAM Review 34 (1992).

use super::Scalar;
use super::blocks::Blocks;
use super::etree::NONE;
use super::front::{Ended, Front, eliminate};
use super::permuted::Permuted;
use crate::run::{Run, Stopped};

/// Why an elimination ended early.
#[derive(Clone, Copy, Debug)]
pub(super) enum Halt {
    /// The pivot of this column is not positive.
    Pivot(usize),
    /// The run ended.
    Stopped(Stopped),
}

/// One block of columns of the factor.
#[derive(Clone, Copy, Debug)]
struct Block {
    first: u32,
    width: u32,
    below: u32,
    parent: u32,
    /// Start of its panel among the factor's values.
    values: usize,
    /// Start of its rows in `relative`.
    rows: usize,
}

impl Block {
    fn width(&self) -> usize {
        self.width as usize
    }

    fn below(&self) -> usize {
        self.below as usize
    }

    fn rows(&self) -> usize {
        self.width() + self.below()
    }
}

/// The plan of a factorization, and the memory it works in.
#[derive(Debug)]
pub(super) struct Multifrontal<T> {
    list: Vec<Block>,
    /// For each row below a block, its position among the rows of the parent's front.
    relative: Vec<u32>,
    /// For each entry of the permuted matrix, its position among the factor's values.
    position: Vec<usize>,
    stack: Vec<T>,
    /// Blocks whose `U` is on the stack, and where.
    waiting: Vec<(u32, usize)>,
}

impl<T: Scalar> Multifrontal<T> {
    pub(super) fn new(blocks: &Blocks, permuted: &Permuted) -> Self {
        let (mut values, mut rows) = (0, 0);
        let plan = |(block, parent): (super::blocks::Block<'_>, u32)| {
            let (first, width, below) = (block.first as u32, block.width as u32, block.rows.len() as u32);
            let planned = Block { first, width, below, parent, values, rows };
            values += block.width * (block.width + block.rows.len());
            rows += block.rows.len();
            planned
        };
        let list = blocks.iter().zip(blocks.parents()).map(plan).collect();
        let mut this =
            Self { list, relative: Vec::new(), position: Vec::new(), stack: Vec::new(), waiting: Vec::new() };
        this.relative = this.relate(blocks);
        this.position = this.positions(blocks, permuted);
        this.reserve();
        this
    }

    /// Number of values of the factor, padding included.
    pub(super) fn stored(&self) -> usize {
        self.list.last().map_or(0, |block| block.values + block.width() * block.rows())
    }

    /// The range of the panel of block `s` among the values: columns of all its rows.
    pub(super) fn panel(&self, s: usize) -> std::ops::Range<usize> {
        let block = &self.list[s];
        block.values..block.values + block.width() * block.rows()
    }

    fn relate(&self, blocks: &Blocks) -> Vec<u32> {
        let mut relative = Vec::new();
        for (s, block) in self.list.iter().enumerate().filter(|(_, block)| block.parent != NONE) {
            let parent = blocks.get(block.parent as usize);
            let mut above = parent.rows.iter().enumerate();
            relative.extend(blocks.get(s).rows.iter().map(|&row| {
                let own = row as usize - parent.first;
                if own < parent.width {
                    return own as u32;
                }
                let (k, _) =
                    above.find(|&(_, &r)| r == row).expect("a parent's front contains the rows of its children");
                (parent.width + k) as u32
            }));
        }
        relative
    }

    fn positions(&self, blocks: &Blocks, permuted: &Permuted) -> Vec<usize> {
        let mut position = Vec::with_capacity(permuted.rows.len());
        for (block, planned) in blocks.iter().zip(&self.list) {
            let end = block.first + block.width;
            for j in block.first..end {
                let (column, mut at) = (planned.values + (j - block.first) * planned.rows(), 0);
                for &row in permuted.column(j) {
                    let row = row as usize;
                    if row < end {
                        position.push(column + row - block.first);
                    } else {
                        at += block.rows[at..].iter().take_while(|&&r| (r as usize) < row).count();
                        position.push(column + block.width + at);
                    }
                }
            }
        }
        position
    }

    /// Makes room for the stack at its highest.
    fn reserve(&mut self) {
        let mut tops: Vec<(u32, usize)> = Vec::new();
        let (mut top, mut highest) = (0, 0);
        for (s, block) in self.list.iter().enumerate() {
            let size = block.below() * block.below();
            highest = highest.max(top + size);
            while let Some((_, start)) = tops.pop_if(|(parent, _)| *parent == s as u32) {
                top = start;
            }
            if size > 0 {
                tops.push((block.parent, top));
                top += size;
            }
        }
        self.stack = vec![T::default(); highest];
        self.waiting = Vec::with_capacity(self.list.len());
    }

    /// Factors the permuted matrix whose entries are `a` into the panels `l`, looking at the run before each block and within large ones.
    pub(super) fn factor(&mut self, a: &[T], l: &mut [T], run: &Run) -> Result<(), Halt> {
        l.fill(T::default());
        for (&position, &value) in self.position.iter().zip(a) {
            l[position] = value;
        }
        self.waiting.clear();
        let mut top = 0;
        for (s, block) in self.list.iter().enumerate() {
            run.check().map_err(Halt::Stopped)?;
            let (below, bottom) = (block.below(), top);
            let panel = &mut l[block.values..][..block.width() * block.rows()];
            let (lower, upper) = self.stack.split_at_mut(bottom);
            let u = &mut upper[..below * below];
            (0..below).for_each(|k| u[k * (below + 1)..(k + 1) * below].fill(T::default()));
            let mut front = Front { panel, u, width: block.width(), rows: block.rows() };
            while let Some((child, start)) =
                self.waiting.pop_if(|(child, _)| self.list[*child as usize].parent == s as u32)
            {
                let child = &self.list[child as usize];
                let rows = &self.relative[child.rows..][..child.below()];
                extend_add(&lower[start..][..rows.len() * rows.len()], rows, &mut front);
                top = start;
            }
            eliminate(&mut front, run).map_err(|ended| match ended {
                Ended::Pivot(k) => Halt::Pivot(block.first as usize + k),
                Ended::Stopped(stopped) => Halt::Stopped(stopped),
            })?;
            if below > 0 {
                self.stack.copy_within(bottom..bottom + below * below, top);
                self.waiting.push((s as u32, top));
                top += below * below;
            }
        }
        Ok(())
    }
}

/// Adds the lower triangle of a child's `U` to the front of its parent.
fn extend_add<T: Scalar>(from: &[T], rows: &[u32], front: &mut Front<'_, T>) {
    let (size, pitch, width) = (rows.len(), front.rows, front.width);
    let below = pitch - width;
    // Rows that fall on the parent's own columns come first.
    let own = rows.partition_point(|&row| (row as usize) < width);
    for (k, &column) in rows.iter().enumerate() {
        let values = &from[k * size + k..][..size - k];
        if k < own {
            let to = &mut front.panel[column as usize * pitch..][..pitch];
            for (&value, &row) in values.iter().zip(&rows[k..]) {
                to[row as usize] += value;
            }
        } else {
            let to = &mut front.u[(column as usize - width) * below..][..below];
            for (&value, &row) in values.iter().zip(&rows[k..]) {
                to[row as usize - width] += value;
            }
        }
    }
}
