//! One plane: rows split between threads, positions and samples of each row by the chosen code path.

use rayon::prelude::*;

use super::Renderer;
use super::kernel::{Interpolation, Table, table};
use super::scan::Siting;
use super::source::Source;
use crate::PlaneMut;
use crate::warp::Lattice;

#[cfg(target_arch = "x86_64")]
use super::avx2::{self, Kernels};
#[cfg(not(target_arch = "x86_64"))]
use super::source::Sample as Kernels;

/// Rows per parallel task: enough that neighboring rows find their source rows in cache and that a task outweighs its
/// scheduling (0.1 ms at 1080p), few enough that small planes still split.
pub(super) const ROWS_PER_TASK: usize = 16;

/// Instruction set of the sampling code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InstructionSet {
    /// Scalar Rust.
    Portable,
    /// AVX2 kernels; made only by [`InstructionSet::detect`] on processors that have it.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl InstructionSet {
    /// The fastest code this processor runs.
    pub(super) fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Portable
    }
}

/// Weights, four taps or six.
#[derive(Debug)]
pub(super) enum Tables {
    Four(Box<Table<4>>),
    Six(Box<Table<8>>),
}

impl Tables {
    pub(super) fn new(kernel: Interpolation) -> Self {
        match kernel {
            Interpolation::Lanczos3 => Self::Six(table(kernel)),
            Interpolation::Bilinear | Interpolation::Bicubic => Self::Four(table(kernel)),
        }
    }
}

/// What to do with a plane.
pub(super) struct Job<'a> {
    pub(super) lattice: &'a Lattice,
    pub(super) siting: Siting,
    pub(super) tables: &'a Tables,
    pub(super) instructions: InstructionSet,
}

impl Job<'_> {
    /// Samples `source` at every position of `dst`.
    pub(super) fn run<S: Kernels>(&self, source: &Source<'_, S>, dst: PlaneMut<'_, S>) {
        let (width, height) = (dst.width(), dst.height());
        let (data, stride) = dst.into_data();
        // The memory may go on below the plane.
        let end = data.len().min(height * stride);
        data[..end].par_chunks_mut(stride * ROWS_PER_TASK).enumerate().for_each_init(
            || (vec![0; width], vec![0; width]),
            |(xs, ys), (task, rows)| {
                for (j, row) in (task * ROWS_PER_TASK..).zip(rows.chunks_mut(stride)) {
                    self.row(source, j, (xs, ys), &mut row[..width]);
                }
            },
        );
    }

    /// Samples `source` at positions in units of 1/256 px.
    pub(super) fn sample<S: Kernels>(&self, source: &Source<'_, S>, at: (&[i32], &[i32]), out: &mut [S]) {
        self.instructions.sample(self.tables, source, at, out);
    }

    fn row<S: Kernels>(&self, source: &Source<'_, S>, j: usize, (xs, ys): (&mut [i32], &mut [i32]), out: &mut [S]) {
        self.instructions.positions(&self.siting, self.lattice, j, xs, ys);
        self.instructions.sample(self.tables, source, (xs, ys), out);
    }
}

impl InstructionSet {
    /// [`Siting::positions`].
    fn positions(self, siting: &Siting, lattice: &Lattice, j: usize, xs: &mut [i32], ys: &mut [i32]) {
        match self {
            Self::Portable => siting.positions(lattice, j, xs, ys),
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // a call into `avx2`, whose only condition is the processor
            // SAFETY: `InstructionSet::Avx2` is made only where the processor has AVX2.
            Self::Avx2 => unsafe { avx2::positions(siting, lattice, j, xs, ys) },
        }
    }

    /// Samples `source` at positions in units of 1/256 px.
    fn sample<S: Kernels>(self, tables: &Tables, source: &Source<'_, S>, at: (&[i32], &[i32]), out: &mut [S]) {
        match (self, tables) {
            (Self::Portable, Tables::Four(table)) => source.sample_row(table, at.0, at.1, out),
            (Self::Portable, Tables::Six(table)) => source.sample_row(table, at.0, at.1, out),
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // as above
            // SAFETY: as above.
            (Self::Avx2, Tables::Four(table)) => unsafe { S::row4(source, table, at, out) },
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // as above
            // SAFETY: as above.
            (Self::Avx2, Tables::Six(table)) => unsafe { S::row6(source, table, at, out) },
        }
    }
}

/// Samples `source` at positions in units of 1/256 px, as `renderer` would.
pub(super) fn sample_row<S: Kernels>(renderer: &Renderer, source: &Source<'_, S>, at: (&[i32], &[i32]), out: &mut [S]) {
    renderer.instructions.sample(&renderer.tables, source, at, out);
}
