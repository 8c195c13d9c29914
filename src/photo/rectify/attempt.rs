//! What a view gives up, and in which order, where its border cannot be straight with all that is asked of its lines.
//!
//! A straight border shows the whole picture, and bends what lies near it; a free one is cut off by the crop, with the people at it.
//! What is tried is, in this order,
//!
//! 1. where there are lines and no people, a border that yields: a side is straight at the weight [`YIELDING`], and the crop cuts off
//!    what it bends,
//! 2. a straight border,
//! 3. a free one,
//! 4. a straight one, without straightness near it: with `d` the distance of a virtual vertex from the border of the source, its weight
//!    is multiplied by `max((d / D)², w₀)`, `d < D`.
//!
//! The first is taken whose grid does not fold, and whose crop cuts no face and no body below one and shows [`MIN_SHOWN`] of the source; else
//! the one with the fewest cuts, and of those the first that shows the most.

use super::solver::Folding;
use super::sphere_grid::SphereGrid;
use super::straight::GridLine;
use crate::PhotoWarp;
use plumbline_camera::Lens;
use plumbline_num::math::{Point2, PointMap};

/// Part of the source that a crop shows at least, unless asked otherwise.
pub(super) const MIN_SHOWN: f64 = 0.85;
/// Weight of a side that yields, relative to a line's: with the default line weight of 10⁴ twice that of conformality, so that it
/// does to shapes what they do to it, and gives way to lines and to what lies beside them.
const YIELDING: f64 = 3e-5;
/// Gain in the part shown for which more is given up: less is not seen.
const MIN_GAIN: f64 = 0.02;
/// `D`, as a fraction of the shorter side, and `w₀`: a thousandth of the line weight of 10⁴ is the weight of conformality at faces.
const FADE: f64 = 0.15;
const MIN_FADE: f64 = 1e-3;

/// What is asked of border and lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Attempt {
    /// A border that yields, and all lines as they are.
    Yielding,
    /// A straight border.
    Straight,
    /// A free one.
    Free,
    /// A straight border, and lines near it may bend.
    Fading,
}

impl Attempt {
    /// All in their order; `border`: it may be straight, `yields`: there are lines and no people.
    pub(super) fn all(border: bool, yields: bool) -> impl Iterator<Item = Self> {
        let possible = move |attempt: &Self| match attempt {
            Self::Yielding => border && yields,
            Self::Straight | Self::Fading => border,
            Self::Free => true,
        };
        [Self::Yielding, Self::Straight, Self::Free, Self::Fading].into_iter().filter(possible)
    }

    /// Weight of the sides relative to a line's; none where the border is free.
    pub(super) fn border(self) -> Option<f64> {
        match self {
            Self::Yielding => Some(YIELDING),
            Self::Straight | Self::Fading => Some(1.0),
            Self::Free => None,
        }
    }

    /// What to do with folds: a border is given up where another attempt remains that cannot fold.
    pub(super) fn folding(self) -> Folding {
        match self {
            Self::Yielding | Self::Straight => Folding::Refused,
            Self::Free | Self::Fading => Folding::Held,
        }
    }

    /// Lines on the grid with the weights that are asked of them.
    pub(super) fn weigh(self, lines: &mut [GridLine], lens: &Lens, sphere: &SphereGrid) {
        if self != Self::Fading {
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
