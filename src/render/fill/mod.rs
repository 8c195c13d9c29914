//! Full frames: what the shake pushed out of view is taken from neighboring frames.
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
//! A neighbor is shown only where it continues the frame. On the overlap next to the uncovered area it is
//! 1. shifted by a smooth field of displacements, Gauss–Newton on the difference ([`align`]),
//! 2. brought to the frame's tone, and
//! 3. trusted (`τ`) block by block as far as it repeats the texture there,
//!
//! each known on blocks of the overlap and continued into the uncovered area by a membrane ([`membrane`]). Where it is
//! not trusted (parallax, someone who moved, another scene) the next neighbor has its turn.
//!
//! Only [blocks](strip) of the uncovered area and a band along it are touched: the cost is proportional to what is
//! missing, not to the frame. Neighbors are [chosen](choose) by how much they add, near ones first.
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
mod strip;
mod window;

use std::sync::Arc;

use super::{RenderError, Renderer};
use crate::image::Frame;
use crate::warp::{Lattice, WarpField};
use align::Aligned;
use canvas::Canvas;
use choose::Choice;
use strip::Strip;
pub use window::FillOptions;
use window::Window;

/// Most neighbors composed into a frame. Each shows as a patch of its own; past this many they are specks.
const MOST_LAYERS: usize = 6;
/// Neighbors tried for that: some disagree and are left out.
const MOST_TRIED: usize = 8;

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

/// Fills frames from their neighbors in time, which it holds in a bounded window.
///
/// Push source frames in order; [`Filler::pop`] hands them out again once enough later ones are held. Render such a frame
/// and fill it before the next is popped.
#[derive(Debug)]
pub struct Filler {
    window: Window,
}

impl Filler {
    /// A filler without frames.
    pub fn new(options: FillOptions) -> Self {
        Self { window: Window::new(options) }
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
    /// [`RenderError::Size`], [`RenderError::Dimensions`], and [`RenderError::Plane`] for memory that cannot be accessed.
    pub fn fill(
        &self,
        renderer: &Renderer,
        own: &Lattice,
        dst: &mut Frame,
        mut neighbor_from_src: impl FnMut(usize) -> Option<WarpField>,
    ) -> Result<FillReport, RenderError> {
        super::check(dst, own, dst)?;
        let Some(strip) = Strip::new(own, (dst.width, dst.height)) else { return Ok(FillReport::default()) };
        let now = self.window.now();
        let neighbors = self.window.neighbors(now, |frame| frame.format == dst.format && same_size(frame, dst));
        let maps = neighbors.filter_map(|(n, frame)| Some((n.abs_diff(now), frame, neighbor_from_src(n)?)));
        let mut choice = Choice::new(&strip, maps.collect());
        let mut canvas = Canvas::new(&strip, dst)?;
        let mut used = 0;
        for _ in 0..MOST_TRIED {
            let Some((neighbor, field)) = choice.next().filter(|_| used < MOST_LAYERS) else { break };
            if let Some(aligned) = Aligned::new(renderer, &strip, &canvas, neighbor, &field)? {
                canvas.add(renderer, &strip, neighbor, &aligned)?;
                used += 1;
                choice.set_left(canvas.left_probes(&strip));
            }
        }
        if used > 0 {
            canvas.write(&strip, dst)?;
        }
        Ok(FillReport { uncovered: canvas.uncovered(), left: canvas.left(&strip), used })
    }
}

fn same_size(a: &Frame, b: &Frame) -> bool {
    (a.width, a.height) == (b.width, b.height)
}
