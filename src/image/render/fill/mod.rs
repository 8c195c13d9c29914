//! Full-frame stabilization: uncovered areas are filled from neighboring frames.
//!
//! Layers (the frame itself, then its neighbors) are composed front to back, layer `k` with weight `αₖ`:
//!
//! ```text
//! c = Σₖ αₖ Πⱼ₍ⱼ﹤ₖ₎ (1 − αⱼ) cₖ,    αₖ = τₖ · clamp(m / F, 0, 1),
//! ```
//!
//! `m` the distance of the source position to the edge of its source, px: each layer ends in a feather of `F` px instead
//! of a seam. Beyond the frame itself the sum is divided by the weight its neighbors took, so that their own feathers do
//! not let the border shine through; what no layer covers fades into the border that the frame was rendered with.
//!
//! A neighbor is shown only where it continues what is shown so far. On the overlap next to the uncovered area it is
//! 1. shifted by a smooth field of displacements, Gauss–Newton on the difference, coarse to fine ([`align`]),
//! 2. brought to the tone there, and
//! 3. trusted (`τ`) block by block as far as it repeats the texture there,
//!
//! each known on blocks of the overlap and continued into the uncovered area by a membrane ([`membrane`]). Where it is
//! not trusted (parallax, someone who moved, another scene) the next neighbor has its turn. Where none is, the first that
//! agrees at a quarter of the size is shown behind the others: leaves that do not match leaf by leaf are still leaves,
//! which a mirrored border is not.
//!
//! Only [blocks](strip) of the uncovered area and a band along it are touched, by each layer those alone that are still
//! open: the cost is proportional to what is missing, not to the frame. Neighbors are [chosen](choose) by how much they
//! add, near ones and those that filled the frame before first.
//!
//! # Reference
//! Y. Matsushita, E. Ofek, W. Ge, X. Tang, H.-Y. Shum, *Full-frame video stabilization with motion inpainting*, PAMI 28
//! (2006), section 4: neighbors aligned locally along the boundary of what is missing, motion continued inwards. The
//! motion is continued here by a membrane rather than along isophotes.

mod align;
mod canvas;
mod choose;
mod layer;
mod membrane;
mod quarter;
mod strip;
mod sums;
mod window;

use std::sync::Arc;

use super::{RenderError, Renderer};
use crate::Frame;
use crate::warp::{Lattice, WarpField};
use align::Aligned;
use canvas::Canvas;
use choose::{Choice, Neighbor};
use plumbline_num::run::Run;
use strip::Strip;
pub use window::FillOptions;
use window::Window;

/// Maximum number of neighbors composed into a frame: each further one only adds specks.
const MAX_LAYERS: usize = 6;
/// Maximum number of neighbors tried: some disagree and are rejected.
const MAX_TRIALS: usize = 8;
/// Maximum number of neighbors shown behind the others where none is trusted.
const MAX_COARSE: usize = 2;

/// What filling a frame did, in shares of its samples, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FillReport {
    /// Not covered by the frame itself.
    pub uncovered: f64,
    /// Covered by no neighbor either: these kept their border.
    pub left: f64,
    /// Neighbors that were composed.
    pub used: usize,
}

/// Fills frames from their neighbors in time, kept in a bounded window.
///
/// Push source frames in order; [`Filler::pop`] hands them out again once enough later ones are held. Render such a frame
/// and fill it before the next is popped.
#[derive(Debug)]
pub struct Filler {
    window: Window,
    /// Numbers of the neighbors that filled the frame before.
    before: Vec<usize>,
}

impl Filler {
    /// A filler without frames.
    pub fn new(options: FillOptions) -> Self {
        Self { window: Window::new(options), before: Vec::new() }
    }

    /// Takes the next source frame. Frames are numbered from 0 in the order in which they come.
    pub fn push(&mut self, frame: Arc<Frame>) {
        self.window.push(frame);
    }

    /// The next frame to render and its number, when the later frames it may need are held, or when the clip `ended`.
    pub fn pop(&mut self, ended: bool) -> Option<(usize, Arc<Frame>)> {
        self.window.pop(ended)
    }

    /// Fills what `dst`, the frame popped last, rendered through `own`, does not cover. `neighbor_from_src` gives the map
    /// from positions in that frame to positions in another one, by number; `None` where there is none (another shot).
    ///
    /// # Errors
    /// [`RenderError::Size`], [`RenderError::Dimensions`], [`RenderError::Interrupted`], and [`RenderError::Plane`] for memory that
    /// cannot be accessed.
    pub fn fill(
        &mut self,
        renderer: &Renderer,
        own: &Lattice,
        dst: &mut Frame,
        mut neighbor_from_src: impl FnMut(usize) -> Option<WarpField>,
        run: &Run,
    ) -> Result<FillReport, RenderError> {
        super::check(dst, own, dst)?;
        let before = std::mem::take(&mut self.before);
        let Some(strip) = Strip::new(own, (dst.width, dst.height)) else { return Ok(FillReport::default()) };
        let now = self.window.now();
        let neighbors = self.window.neighbors(now, |frame| frame.format == dst.format && same_size(frame, dst));
        let mapped = neighbors.filter_map(|held| Some(Neighbor { held, field: neighbor_from_src(held.number)? }));
        let choice = Choice::new(&strip, now, &before, mapped);
        let canvas = Canvas::new(&strip, dst)?;
        let mut composition = Composition { renderer, strip: &strip, canvas, choice, used: Vec::new() };
        let refused = composition.trusted(run)?;
        composition.coarse(&refused, run)?;
        let Composition { canvas, used, .. } = composition;
        if !used.is_empty() {
            canvas.write(&strip, dst)?;
        }
        let report = FillReport { uncovered: canvas.uncovered(), left: canvas.left(&strip), used: used.len() };
        self.before = used;
        Ok(report)
    }
}

/// Layers on their way into a frame.
struct Composition<'a> {
    renderer: &'a Renderer,
    strip: &'a Strip,
    canvas: Canvas,
    choice: Choice<'a>,
    /// Numbers of the neighbors composed.
    used: Vec<usize>,
}

impl<'a> Composition<'a> {
    /// Adds neighbors that continue the texture; gives all that were aligned.
    fn trusted(&mut self, run: &Run) -> Result<Vec<(Neighbor<'a>, Aligned)>, RenderError> {
        let mut tried = Vec::new();
        for _ in 0..MAX_TRIALS {
            run.check()?;
            let Some(neighbor) = self.choice.next().filter(|_| self.used.len() < MAX_LAYERS) else { break };
            let part = self.canvas.part(self.strip);
            let Some(aligned) = Aligned::new(self.renderer, self.strip, &self.canvas, part, &neighbor)? else {
                continue;
            };
            if let Some(trust) = &aligned.trust {
                self.canvas.add(self.renderer, self.strip, &neighbor, &aligned, trust)?;
                self.used.push(neighbor.held.number);
                self.choice.set_left(self.canvas.left_probes(self.strip));
            }
            tried.push((neighbor, aligned));
        }
        Ok(tried)
    }

    /// Adds, behind all others, neighbors that agree at a quarter of the size.
    fn coarse(&mut self, tried: &[(Neighbor<'a>, Aligned)], run: &Run) -> Result<(), RenderError> {
        for (neighbor, aligned) in tried.iter().take(MAX_COARSE) {
            run.check()?;
            if !self.canvas.left_probes(self.strip).contains(&true) {
                break;
            }
            self.canvas.add(self.renderer, self.strip, neighbor, aligned, &aligned.coarse_trust)?;
            if !self.used.contains(&neighbor.held.number) {
                self.used.push(neighbor.held.number);
            }
        }
        Ok(())
    }
}

fn same_size(a: &Frame, b: &Frame) -> bool {
    (a.width, a.height) == (b.width, b.height)
}
