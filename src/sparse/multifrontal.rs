//! Numeric Cholesky factorization, block of columns by block of columns, each handing the rest of its work to its parent.
//!
//! Block `s` of `w` columns with `r` rows below is a dense front: the panel of its columns, and the symmetric `r×r` matrix `U`
//! of what elimination still owes to later columns.
//!
//! ```text
//! panel, U  ←  entries of A  +  Σ over children c of s: U_c, its rows moved to where s has them
//! panel     ←  L,   U ← U − M Mᵀ      (M the rows of L below the block's own)
//! ```
//!
//! In postorder the children of a block are what lies on top of a stack. Against collecting updates column by column from all
//! earlier blocks there are fewer and larger products, which is what counts on surfaces: most blocks are of a few columns.
//! Small fronts go through loops of our own, large ones through dense kernels.
//!
//! # Reference
//! I. S. Duff, J. K. Reid, *The multifrontal solution of indefinite sparse symmetric linear systems*, ACM TOMS 9 (1983);
//! J. W. H. Liu, *The multifrontal method for sparse matrix solution: theory and practice*, SIAM Review 34 (1992).
#![allow(unsafe_code)] // calls of functions compiled for AVX2 and FMA, once both are detected

use faer::dyn_stack::{MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, MatMut, Par, Spec};

use super::etree::NONE;

/// Multiplications of a front from which the dense kernels are faster than our loops.
const LARGE: usize = 24_000;

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
pub(super) struct Multifrontal {
    blocks: Vec<Block>,
    /// For each row below a block, its place among the rows of the parent's front.
    relative: Vec<u32>,
    /// For each slot of the permuted matrix, its place among the factor's values.
    place: Vec<usize>,
    stack: Vec<f64>,
    /// Blocks whose `U` is on the stack, and where.
    waiting: Vec<(u32, usize)>,
}

impl Multifrontal {
    /// Plans for blocks of columns given as `(first, width, rows below)` in postorder, their panels lying one after another,
    /// and the lower triangle of the matrix by columns.
    pub(super) fn new<'a>(
        blocks: impl Iterator<Item = (usize, usize, &'a [u32])> + Clone,
        starts: &[u32],
        rows: &[u32],
    ) -> Self {
        let n = starts.len() - 1;
        let mut block_of = vec![NONE; n];
        for (s, (first, width, _)) in blocks.clone().enumerate() {
            block_of[first..first + width].fill(s as u32);
        }
        let mut this = Self {
            blocks: Vec::new(),
            relative: Vec::new(),
            place: Vec::new(),
            stack: Vec::new(),
            waiting: Vec::new(),
        };
        let mut values = 0;
        for (first, width, below) in blocks.clone() {
            let parent = below.first().map_or(NONE, |&row| block_of[row as usize]);
            let (start, rows) = (values, this.relative.len());
            this.relative.resize(rows + below.len(), 0);
            values += width * (width + below.len());
            let (first, width, below) = (first as u32, width as u32, below.len() as u32);
            this.blocks.push(Block { first, width, below, parent, values: start, rows });
        }
        this.relate(blocks.clone());
        this.place = this.places(blocks, starts, rows);
        this.reserve();
        this
    }

    fn relate<'a>(&mut self, blocks: impl Iterator<Item = (usize, usize, &'a [u32])>) {
        let lists: Vec<&[u32]> = blocks.map(|(_, _, rows)| rows).collect();
        for (block, rows) in self.blocks.iter().zip(&lists) {
            let Some(parent) = self.blocks.get(block.parent as usize) else { continue };
            let mut above = lists[block.parent as usize].iter().enumerate();
            for (to, &row) in self.relative[block.rows..].iter_mut().zip(*rows) {
                let own = (row - parent.first.min(row)) as usize;
                *to = if row >= parent.first && own < parent.width() {
                    own as u32
                } else {
                    let (k, _) =
                        above.find(|&(_, &r)| r == row).expect("a parent's front holds the rows of its children");
                    parent.width + k as u32
                };
            }
        }
    }

    fn places<'a>(
        &self,
        blocks: impl Iterator<Item = (usize, usize, &'a [u32])>,
        starts: &[u32],
        rows: &[u32],
    ) -> Vec<usize> {
        let mut place = Vec::with_capacity(rows.len());
        for (block, (first, width, below)) in self.blocks.iter().zip(blocks) {
            for j in first..first + width {
                let (column, mut at) = (block.values + (j - first) * block.rows(), 0);
                for &row in &rows[starts[j] as usize..starts[j + 1] as usize] {
                    let row = row as usize;
                    if row < first + width {
                        place.push(column + row - first);
                    } else {
                        at += below[at..].iter().take_while(|&&r| (r as usize) < row).count();
                        place.push(column + width + at);
                    }
                }
            }
        }
        place
    }

    /// Makes room for the stack at its highest.
    fn reserve(&mut self) {
        let mut tops = Vec::new();
        let (mut top, mut highest) = (0, 0);
        for block in &self.blocks {
            let size = block.below() * block.below();
            highest = highest.max(top + size);
            while let Some(&(parent, start)) = tops.last() {
                if parent != block.first {
                    break;
                }
                top = start;
                tops.pop();
            }
            if size > 0 {
                tops.push((self.blocks[block.parent as usize].first, top));
                top += size;
            }
        }
        self.stack = vec![0.0; highest];
        self.waiting = Vec::with_capacity(self.blocks.len());
    }

    /// Memory that [`Self::factor`] needs for the dense kernels.
    pub(super) fn scratch(&self) -> StackReq {
        let widest = self.blocks.iter().map(Block::width).max().unwrap_or(0);
        cholesky_in_place_scratch::<f64>(widest, Par::Seq, Spec::default())
    }

    /// Factors the permuted matrix whose slots are `a` into the panels `l`; the column of the first pivot that is not positive
    /// on failure.
    pub(super) fn factor(&mut self, a: &[f64], l: &mut [f64], memory: &mut MemStack) -> Result<(), LltError> {
        l.fill(0.0);
        for (&place, &value) in self.place.iter().zip(a) {
            l[place] = value;
        }
        self.waiting.clear();
        let mut top = 0;
        for s in 0..self.blocks.len() {
            let block = self.blocks[s];
            let (below, front) = (block.below(), top);
            let panel = &mut l[block.values..][..block.width() * block.rows()];
            let (lower, upper) = self.stack.split_at_mut(front);
            let u = &mut upper[..below * below];
            (0..below).for_each(|k| u[k * (below + 1)..(k + 1) * below].fill(0.0));
            while let Some(&(child, start)) = self.waiting.last() {
                let child = self.blocks[child as usize];
                if child.parent as usize != s {
                    break;
                }
                let rows = &self.relative[child.rows..][..child.below()];
                let from = &lower[start..][..rows.len() * rows.len()];
                extend_add(from, rows, (panel, block.rows()), (u, block.width()));
                top = start;
                self.waiting.pop();
            }
            eliminate(panel, u, &block, memory)?;
            if below > 0 {
                self.stack.copy_within(front..front + below * below, top);
                self.waiting.push((s as u32, top));
                top += below * below;
            }
        }
        Ok(())
    }
}

/// Adds the lower triangle of a child's `U` to the front of its parent.
fn extend_add(from: &[f64], rows: &[u32], (panel, pitch): (&mut [f64], usize), (u, width): (&mut [f64], usize)) {
    let size = rows.len();
    let below = pitch - width;
    // Rows that fall on the parent's own columns come first.
    let own = rows.partition_point(|&row| (row as usize) < width);
    for (k, &column) in rows.iter().enumerate() {
        let values = &from[k * size + k..][..size - k];
        if k < own {
            let to = &mut panel[column as usize * pitch..][..pitch];
            for (&value, &row) in values.iter().zip(&rows[k..]) {
                to[row as usize] += value;
            }
        } else {
            let to = &mut u[(column as usize - width) * below..][..below];
            for (&value, &row) in values.iter().zip(&rows[k..]) {
                to[row as usize - width] += value;
            }
        }
    }
}

/// Eliminates the columns of a front.
fn eliminate(panel: &mut [f64], u: &mut [f64], block: &Block, memory: &mut MemStack) -> Result<(), LltError> {
    let (width, rows) = (block.width(), block.rows());
    let result = if width * rows * rows > LARGE {
        eliminate_large(panel, u, (width, rows), memory)
    } else {
        eliminate_small(panel, u, (width, rows))
    };
    result.map_err(|index| LltError::NonPositivePivot { index: block.first as usize + index })
}

fn eliminate_large(
    panel: &mut [f64],
    u: &mut [f64],
    (width, rows): (usize, usize),
    memory: &mut MemStack,
) -> Result<(), usize> {
    let below = rows - width;
    let panel = MatMut::from_column_major_slice_mut(panel, rows, width);
    let (mut own, mut rest) = panel.split_at_row_mut(width);
    let done = cholesky_in_place(own.rb_mut(), LltRegularization::default(), Par::Seq, memory, Spec::default());
    if let Err(LltError::NonPositivePivot { index }) = done {
        return Err(index);
    }
    if below > 0 {
        solve_lower_triangular_in_place(own.rb(), rest.rb_mut().transpose_mut(), Par::Seq);
        let u = MatMut::from_column_major_slice_mut(u, below, below);
        let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
        matmul(u, lower, Accum::Add, rest.rb(), full, rest.rb().transpose(), full, -1.0, Par::Seq);
    }
    Ok(())
}

fn eliminate_small(panel: &mut [f64], u: &mut [f64], size: (usize, usize)) -> Result<(), usize> {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2,fma")]
        fn fused(panel: &mut [f64], u: &mut [f64], size: (usize, usize)) -> Result<(), usize> {
            eliminate_columns::<true>(panel, u, size)
        }
        if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
            // SAFETY: safe code; the features that it is compiled for have just been detected.
            return unsafe { fused(panel, u, size) };
        }
    }
    eliminate_columns::<false>(panel, u, size)
}

#[inline(always)]
#[allow(clippy::inline_always)] // each instruction set compiles the body for itself
fn eliminate_columns<const FUSED: bool>(
    panel: &mut [f64],
    u: &mut [f64],
    (width, rows): (usize, usize),
) -> Result<(), usize> {
    for k in 0..width {
        let (done, rest) = panel.split_at_mut(k * rows);
        let column = &mut rest[k..rows];
        subtract::<FUSED>(column, done, rows, k);
        let pivot = column[0];
        if !(pivot > 0.0) {
            return Err(k);
        }
        let pivot = pivot.sqrt();
        column[0] = pivot;
        let inverse = 1.0 / pivot;
        column[1..].iter_mut().for_each(|v| *v *= inverse);
    }
    let below = rows - width;
    for k in 0..below {
        subtract::<FUSED>(&mut u[k * below + k..(k + 1) * below], panel, rows, width + k);
    }
    Ok(())
}

/// `to ← to − Σⱼ l_kj · column_j` over all columns of `panel`, each from row `k` downwards.
#[inline(always)]
#[allow(clippy::inline_always)]
fn subtract<const FUSED: bool>(to: &mut [f64], panel: &[f64], rows: usize, k: usize) {
    let len = to.len();
    let mut columns = panel.chunks_exact(rows).map(|c| &c[k..][..len]);
    while columns.len() >= 4 {
        let [a, b, c, d]: [&[f64]; 4] = std::array::from_fn(|_| columns.next().unwrap_or_default());
        let (b, c, d) = (&b[..a.len()], &c[..a.len()], &d[..a.len()]);
        let to = &mut to[..a.len()];
        let s = [a[0], b[0], c[0], d[0]];
        for i in 0..a.len() {
            let v = less::<FUSED>(less::<FUSED>(to[i], a[i], s[0]), b[i], s[1]);
            to[i] = less::<FUSED>(less::<FUSED>(v, c[i], s[2]), d[i], s[3]);
        }
    }
    for a in columns {
        let s = a[0];
        to.iter_mut().zip(a).for_each(|(v, &a)| *v = less::<FUSED>(*v, a, s));
    }
}

/// `v − a s`.
#[inline(always)]
#[allow(clippy::inline_always)]
fn less<const FUSED: bool>(v: f64, a: f64, s: f64) -> f64 {
    if FUSED { (-a).mul_add(s, v) } else { v - a * s }
}
