//! What a view gives up, and in which order, where its border cannot be straight with all that is asked of its lines.
//!
//! A straight border shows the whole picture; a free one is cut off by the crop, with the people at it. Where the grid folds under a
//! straight border, a free one is taken if its crop cuts no face and no body below one and shows [`MIN_SHOWN`] of the source.
//! Otherwise the border stays straight, and what is given up is, in this order,
//!
//! 1. the angles of lines that were found, not marked: a picture that was taken at a slant stays at it,
//! 2. straightness near the border: with `d` the distance of a virtual vertex from the border of the source, its weight is multiplied
//!    by `max((d / D)², w₀)`, `d < D`.
//!
//! Of all that were solved the one with the fewest cuts is taken, and of those the first that shows enough or the most.

use super::sphere_grid::SphereGrid;
use super::straight::GridLine;
use crate::{Line, Orientation, PhotoWarp};
use plumbline_camera::Lens;
use plumbline_num::math::{Point2, PointMap};

/// Part of the source that a crop shows at least, unless asked otherwise.
pub(super) const MIN_SHOWN: f64 = 0.85;
/// Gain in the part shown for which more is given up: less is not seen.
const MIN_GAIN: f64 = 0.02;
/// `D`, as a fraction of the shorter side, and `w₀`: a thousandth of the line weight of 10⁴ is the weight of conformality at faces.
const FADE: f64 = 0.15;
const MIN_FADE: f64 = 1e-3;

/// What is asked of border and lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Attempt {
    /// A straight border, and all lines as they are.
    Straight,
    /// A free border.
    Free,
    /// A straight border, and lines at whatever angle suits.
    AnyAngle,
    /// The same, and lines near the border bend.
    Bending,
}

impl Attempt {
    /// All in their order; `border`: it may be straight, `found`: the lines were.
    pub(super) fn all(border: bool, found: bool) -> impl Iterator<Item = Self> {
        let possible = move |attempt: &Self| match attempt {
            Self::Free => true,
            Self::Straight | Self::Bending => border,
            Self::AnyAngle => border && found,
        };
        [Self::Straight, Self::Free, Self::AnyAngle, Self::Bending].into_iter().filter(possible)
    }

    /// The border is straight.
    pub(super) fn has_border(self) -> bool {
        self != Self::Free
    }

    /// Lines with the orientations that are asked of them.
    pub(super) fn oriented(self, lines: &[Line], found: bool) -> Vec<Line> {
        let free = found && matches!(self, Self::AnyAngle | Self::Bending);
        let of =
            |line: &Line| Line { orientation: if free { Orientation::Free } else { line.orientation }, ..line.clone() };
        lines.iter().map(of).collect()
    }

    /// Lines on the grid with the weights that are asked of them.
    pub(super) fn weigh(self, lines: &mut [GridLine], lens: &Lens, sphere: &SphereGrid) {
        if self != Self::Bending {
            return;
        }
        let source = sphere.source(lens);
        let reach = FADE * lens.size.0.min(lens.size.1);
        let factor = |p: Point2| {
            let p = source.map(p).unwrap_or_default();
            let inside = p.x.min(p.y).min(lens.size.0 - p.x).min(lens.size.1 - p.y).max(0.0);
            (inside / reach).min(1.0).powi(2).max(MIN_FADE)
        };
        for line in lines {
            line.weigh(sphere, factor);
        }
    }
}

/// What a crop loses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loss {
    /// Faces and bodies that are cut.
    cut: usize,
    /// Part of the source that is missing to [`MIN_SHOWN`].
    missing: f64,
}

impl Loss {
    /// Nothing is shown.
    pub(super) const ALL: Self = Self { cut: usize::MAX, missing: 1.0 };

    /// Of a warp; `any`: the shape of the crop was asked for, and with it how much is shown.
    pub(super) fn of(warp: &PhotoWarp, size: (f64, f64), any: bool) -> Self {
        let missing = if any { 0.0 } else { (MIN_SHOWN - warp.source_shown(size)).max(0.0) };
        Self { cut: warp.cut_faces.len() + warp.cut_below.len(), missing }
    }

    /// Nothing that matters.
    pub(super) fn is_none(self) -> bool {
        self.cut == 0 && self.missing <= 0.0
    }

    /// It loses less.
    pub(super) fn is_less_than(self, other: Self) -> bool {
        self.cut < other.cut
            || (self.cut == other.cut
                && (self.missing + MIN_GAIN < other.missing || (self.missing <= 0.0 && other.missing > 0.0)))
    }
}
