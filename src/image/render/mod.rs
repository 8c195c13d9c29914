//! Sampling a frame through a warp field, once.
//!
//! For each sample `q` of each plane of the output, `dst(q) = Σⱼ k(j − src_from_out(q)) src(j)` with a separable kernel
//! `k`, in the plane's own depth and siting: YUV stays YUV, 10-bit stays 10-bit. Weights are fixed-point and sum to one
//! exactly; the identity returns the input bit for bit. Rows are rendered in parallel on the current rayon pool; the
//! result does not depend on the number of threads, nor on whether SIMD kernels are available.
//!
//! Kernels are interpolating, not smoothing: where the field minifies by more than about 2:1 the result aliases. Video
//! stabilization magnifies by 1 to 1.5. For pictures that shrink there is [`Renderer::render_averaged`].

#![allow(clippy::cast_possible_wrap)] // sizes are at most 16384, checked before any pixel is touched

#[cfg(feature = "files")]
mod alpha;
mod averaged;
#[cfg(target_arch = "x86_64")]
mod avx2;
mod border;
mod completion;
mod fill;
mod four_tap;
mod kernel;
mod plane;
mod scan;
mod source;
#[cfg(feature = "files")]
mod still;

pub use border::Border;
pub use completion::complete;
pub use fill::{FillOptions, FillReport, Filler};
pub use kernel::Interpolation;
#[cfg(feature = "files")]
pub use still::StillRendering;

use std::ops::Range;
use std::sync::OnceLock;

use crate::warp::Lattice;
use crate::{Frame, Layout, PixelFormat, PlaneRef};
use averaged::Spreads;
use kernel::{PairTable, pair_table};
use plane::{Band, InstructionSet, Job, Tables};
use plumbline_num::run::{Run, Stopped};
use scan::{MAX_SIZE, Siting};
use source::{Sample, Source};

/// Why a frame cannot be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// Caller's fault: source and destination differ in format.
    #[error("cannot render {src:?} into {dst:?}; both frames need the same format")]
    Format {
        /// Format of the source.
        src: PixelFormat,
        /// Format of the destination.
        dst: PixelFormat,
    },
    /// Caller's fault: the lattice was made for another output size.
    #[error("the lattice covers {lattice:?} px and the destination has {dst:?}; sample the field for the frame's size")]
    Size {
        /// Width and height that the lattice covers, px.
        lattice: (usize, usize),
        /// Width and height of the destination, px.
        dst: (usize, usize),
    },
    /// Unsupported: a frame without pixels, or too large for fixed-point positions.
    #[error("frame of {width}×{height} px cannot be rendered (expected 1 to 16384 each)")]
    Dimensions {
        /// Width, px.
        width: usize,
        /// Height, px.
        height: usize,
    },
    /// Caller's fault: a plane of the source cannot be read, or of the destination not be written (shared memory).
    #[error("plane {plane} of the {role} is not accessible; its memory is shared, too short or misaligned")]
    Plane {
        /// Index of the plane.
        plane: usize,
        /// `"source"` or `"destination"`.
        role: &'static str,
    },
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

/// How to render.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RenderOptions {
    /// Kernel between pixels.
    pub interpolation: Interpolation,
    /// Extrapolation outside the source.
    pub border: Border,
}

/// Weight tables and the choice of code path; make one and use it for every frame.
#[derive(Debug)]
pub struct Renderer {
    options: RenderOptions,
    tables: Tables,
    /// Weights of means, once a map shrinks.
    pairs: OnceLock<Box<PairTable>>,
    instructions: InstructionSet,
}

impl Renderer {
    /// A renderer with the fastest code path of this machine.
    pub fn new(options: RenderOptions) -> Self {
        let (tables, instructions) = (Tables::new(options.interpolation), InstructionSet::detect());
        Self { options, tables, pairs: OnceLock::new(), instructions }
    }

    /// A renderer without SIMD kernels. Its results are the same.
    pub fn portable(options: RenderOptions) -> Self {
        Self { instructions: InstructionSet::Portable, ..Self::new(options) }
    }

    /// Renders `src` through `lattice` into `dst`, which takes over its time and color.
    ///
    /// # Errors
    /// [`RenderError::Format`], [`RenderError::Size`], [`RenderError::Dimensions`], [`RenderError::Plane`].
    pub fn render(&self, src: &Frame, lattice: &Lattice, dst: &mut Frame) -> Result<(), RenderError> {
        check(src, lattice, dst)?;
        self.render_planes(src, lattice, dst, (None, Band::Whole), &Run::default())
    }

    /// Rows of what [`Self::render`] makes, as means where `spreads` says so in planes of full size, looking at the run on the way.
    /// The caller has checked that the frames fit the lattice.
    fn render_planes(
        &self,
        src: &Frame,
        lattice: &Lattice,
        dst: &mut Frame,
        (spreads, rows): (Option<&Spreads>, Band),
        run: &Run,
    ) -> Result<(), RenderError> {
        dst.copy_properties(src);
        let siting = |i: usize| Siting::of(src.format, &src.color, i);
        let mut first = 0;
        while first < src.format.planes() {
            // Planes of one siting are sampled at the same positions.
            let alike = (first..src.format.planes()).take_while(|&i| siting(i) == siting(first));
            let planes = first..first + alike.count();
            first = planes.end;
            let siting = siting(planes.start);
            let spreads = spreads.filter(|_| siting.log2 == (0, 0));
            let job = Job { lattice, siting, renderer: self, spreads, rows };
            if src.format.bytes_per_sample() == 1 {
                let sources = sources(src, planes.clone(), self.options.border, Frame::plane8)?;
                job.run(&sources, dst.planes8_mut(planes.clone()).ok_or_else(|| unwritable(&planes))?, run)?;
            } else {
                let sources = sources(src, planes.clone(), self.options.border, Frame::plane16)?;
                job.run(&sources, dst.planes16_mut(planes.clone()).ok_or_else(|| unwritable(&planes))?, run)?;
            }
        }
        Ok(())
    }

    /// Weights of the means of pairs of samples.
    fn pair_table(&self) -> &PairTable {
        self.pairs.get_or_init(|| pair_table(self.options.interpolation))
    }
}

fn sources<'f, S: Sample>(
    frame: &'f Frame,
    planes: Range<usize>,
    border: Border,
    plane: impl Fn(&'f Frame, usize) -> Option<PlaneRef<'f, S>>,
) -> Result<Vec<Source<'f, S>>, RenderError> {
    let source = |i: usize| {
        let plane = plane(frame, i).ok_or(RenderError::Plane { plane: i, role: "source" })?;
        Ok(Source::new(plane, border, black(frame, i), frame.format.bits))
    };
    planes.map(source).collect()
}

fn unwritable(planes: &Range<usize>) -> RenderError {
    RenderError::Plane { plane: planes.start, role: "destination" }
}

fn check(src: &Frame, lattice: &Lattice, dst: &Frame) -> Result<(), RenderError> {
    if src.format != dst.format {
        return Err(RenderError::Format { src: src.format, dst: dst.format });
    }
    for frame in [src, dst] {
        check_size((frame.width, frame.height))?;
    }
    let dst = (dst.width, dst.height);
    if lattice.size() == dst { Ok(()) } else { Err(RenderError::Size { lattice: lattice.size(), dst }) }
}

fn check_size((width, height): (usize, usize)) -> Result<(), RenderError> {
    let fits = (1..=MAX_SIZE).contains(&width) && (1..=MAX_SIZE).contains(&height);
    if fits { Ok(()) } else { Err(RenderError::Dimensions { width, height }) }
}

/// Sample value of black, or of transparency, in plane `i`. An unspecified range is limited for YUV and full otherwise.
fn black(frame: &Frame, i: usize) -> i32 {
    let format = frame.format;
    let scale = 1 << (format.bits - 8);
    let color = format.planes() - usize::from(format.alpha);
    let limited = match frame.color.full_range {
        Some(full) => !full,
        None => format.layout != Layout::Gbr,
    };
    match i {
        _ if i >= color => 0,
        1 | 2 if format.is_yuv() => 128 * scale,
        _ if limited => 16 * scale,
        _ => 0,
    }
}
