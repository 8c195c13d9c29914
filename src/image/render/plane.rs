//! Planes that are sampled at the same positions: rows split between threads, positions and samples of each row by the chosen
//! code path.

use rayon::prelude::*;

use super::Renderer;
use super::averaged::{Scratch, Spreads};
use super::kernel::{Interpolation, Table, table};
use super::scan::{Cells, Siting};
use super::source::{Pairs, Source};
use crate::PlaneMut;
use crate::warp::Lattice;
use plumbline_num::run::{Run, Stopped};

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

/// What to do with planes of one size and siting.
pub(super) struct Job<'a> {
    pub(super) lattice: &'a Lattice,
    pub(super) siting: Siting,
    pub(super) renderer: &'a Renderer,
    /// How pixels of a map that shrinks are averaged; `None`: they are interpolated.
    pub(super) spreads: Option<&'a Spreads>,
    pub(super) rows: Band,
}

/// Which rows of the output are sampled, and by whom.
#[derive(Clone, Copy, Debug)]
pub(super) enum Band {
    /// All of them, on all threads.
    Whole,
    /// Those of the destination, which begin at this luma row of the lattice, on the thread of the caller: others sample other bands.
    #[cfg(feature = "files")]
    From(usize),
}

/// A run of rows of one plane, and how far apart they start, samples.
type Rows<'d, S> = (&'d mut [S], usize);

impl Job<'_> {
    /// Samples the sources at every position of their destinations.
    pub(super) fn run<S: Kernels>(
        &self,
        sources: &[Source<'_, S>],
        destinations: Vec<PlaneMut<'_, S>>,
        run: &Run,
    ) -> Result<(), Stopped> {
        let Some((width, height)) = destinations.first().map(|d| (d.width(), d.height())) else { return Ok(()) };
        let mut tasks: Vec<Vec<Rows<'_, S>>> = (0..height.div_ceil(ROWS_PER_TASK)).map(|_| Vec::new()).collect();
        for destination in destinations {
            let (data, stride) = destination.into_data();
            // The memory may go on below the plane.
            let end = data.len().min(height * stride);
            let rows = data[..end].chunks_mut(stride * ROWS_PER_TASK);
            tasks.iter_mut().zip(rows).for_each(|(task, rows)| task.push((rows, stride)));
        }
        let scratch = || Scratch::new(width, sources.len());
        let sample = |above: usize, scratch: &mut Scratch<S>, (task, mut planes): (usize, Vec<Rows<'_, S>>)| {
            run.check()?;
            let first = task * ROWS_PER_TASK;
            for j in first..(first + ROWS_PER_TASK).min(height) {
                let range = |stride: usize| (j - first) * stride..(j - first) * stride + width;
                let mut outs: Vec<&mut [S]> =
                    planes.iter_mut().map(|(rows, stride)| &mut rows[range(*stride)]).collect();
                self.row(sources, above + j, scratch, &mut outs);
            }
            Ok(())
        };
        match self.rows {
            Band::Whole => {
                let tasks = tasks.into_par_iter().enumerate();
                tasks.try_for_each_init(scratch, |scratch, task| sample(0, scratch, task))
            }
            #[cfg(feature = "files")]
            Band::From(first) => {
                let first = first >> self.siting.log2.1;
                let mut scratch = scratch();
                tasks.into_iter().enumerate().try_for_each(|task| sample(first, &mut scratch, task))
            }
        }
    }

    fn row<S: Kernels>(&self, sources: &[Source<'_, S>], j: usize, scratch: &mut Scratch<S>, outs: &mut [&mut [S]]) {
        let Renderer { instructions, tables, .. } = self.renderer;
        let Scratch { cells, xs, ys, .. } = scratch;
        instructions.positions(&self.siting, self.lattice, j, cells, (xs, ys));
        match self.spreads.filter(|spreads| spreads.any_in(self.lattice, j)) {
            Some(spreads) => spreads.row(self, sources, j, scratch, outs),
            None => instructions.sample(tables, sources, (xs, ys), outs),
        }
    }
}

impl InstructionSet {
    /// [`Siting::positions`].
    fn positions(self, siting: &Siting, lattice: &Lattice, j: usize, cells: &mut Cells, at: (&mut [i32], &mut [i32])) {
        match self {
            Self::Portable => siting.positions(lattice, j, cells, at),
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // a call into `avx2`, whose only condition is the processor
            // SAFETY: `InstructionSet::Avx2` is made only where the processor has AVX2.
            Self::Avx2 => unsafe { avx2::positions(siting, lattice, j, cells, at) },
        }
    }

    /// Samples the sources at positions in units of 1/256 px, each into its own row.
    pub(super) fn sample<S: Kernels>(
        self,
        tables: &Tables,
        sources: &[Source<'_, S>],
        at: (&[i32], &[i32]),
        outs: &mut [&mut [S]],
    ) {
        match (self, tables) {
            (Self::Portable, Tables::Four(table)) => {
                each(sources, outs, |source, out| source.sample_row(&**table, at, out));
            }
            (Self::Portable, Tables::Six(table)) => {
                each(sources, outs, |source, out| source.sample_row(&**table, at, out));
            }
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // as above
            // SAFETY: as above.
            (Self::Avx2, Tables::Four(table)) => unsafe { S::row4(sources, table, at, outs) },
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // as above
            // SAFETY: as above.
            (Self::Avx2, Tables::Six(table)) => unsafe { S::row6(sources, &**table, at, outs) },
        }
    }

    /// The same with means of pairs of samples.
    pub(super) fn sample_pairs<S: Kernels>(
        self,
        pairs: &Pairs<'_>,
        sources: &[Source<'_, S>],
        at: (&[i32], &[i32]),
        outs: &mut [&mut [S]],
    ) {
        match self {
            Self::Portable => each(sources, outs, |source, out| source.sample_row(pairs, at, out)),
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // as above
            // SAFETY: as above.
            Self::Avx2 => unsafe { S::row6(sources, pairs, at, outs) },
        }
    }
}

fn each<S: Kernels>(sources: &[Source<'_, S>], outs: &mut [&mut [S]], sample: impl Fn(&Source<'_, S>, &mut [S])) {
    sources.iter().zip(outs).for_each(|(source, out)| sample(source, out));
}

/// Samples `source` at positions in units of 1/256 px, as `renderer` would.
pub(super) fn sample_row<S: Kernels>(renderer: &Renderer, source: &Source<'_, S>, at: (&[i32], &[i32]), out: &mut [S]) {
    renderer.instructions.sample(&renderer.tables, std::slice::from_ref(source), at, &mut [out]);
}
