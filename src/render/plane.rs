//! One plane: rows split between threads, positions and samples of each row by the chosen code path.

use rayon::prelude::*;

use super::kernel::{Interpolation, Table, table};
use super::scan::Siting;
use super::source::Source;
use crate::image::PlaneMut;
use crate::warp::Lattice;

#[cfg(target_arch = "x86_64")]
use super::avx2::{self, Kernels};
#[cfg(not(target_arch = "x86_64"))]
use super::source::Sample as Kernels;

/// Rows per parallel task: enough that neighboring rows find their source rows in cache and that a task outweighs its
/// scheduling (0.1 ms at 1080p), few enough that small planes still split.
const ROWS_PER_TASK: usize = 16;

/// The code that samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Backend {
    /// Scalar Rust.
    Portable,
    /// AVX2 kernels; made only by [`Backend::detect`] on processors that have it.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Backend {
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
    pub(super) backend: Backend,
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

    fn row<S: Kernels>(&self, source: &Source<'_, S>, j: usize, (xs, ys): (&mut [i32], &mut [i32]), out: &mut [S]) {
        match self.backend {
            Backend::Portable => {
                self.siting.positions(self.lattice, j, xs, ys);
                match self.tables {
                    Tables::Four(table) => source.sample_row(table, xs, ys, out),
                    Tables::Six(table) => source.sample_row(table, xs, ys, out),
                }
            }
            #[cfg(target_arch = "x86_64")]
            Backend::Avx2 => avx2_row(self, source, j, (xs, ys), out),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)] // calls into `avx2`, whose only condition is the processor
fn avx2_row<S: Kernels>(
    job: &Job<'_>,
    source: &Source<'_, S>,
    j: usize,
    (xs, ys): (&mut [i32], &mut [i32]),
    out: &mut [S],
) {
    // SAFETY: `Backend::Avx2` is made only where the processor has AVX2.
    unsafe {
        avx2::positions(&job.siting, job.lattice, j, xs, ys);
        match job.tables {
            Tables::Four(table) => S::row4(source, table, (xs, ys), out),
            Tables::Six(table) => S::row6(source, table, (xs, ys), out),
        }
    }
}
