//! What an outline says of its picture: stitched from several, or taken by one lens whose corners are dark.
//!
//! A stitcher cuts: from one pixel to the next the border becomes picture. A lens fades: with `d` the difference from the
//! border's color, the *step* of the outline is the median over its blocks of
//!
//! ```text
//! d(block at the outline) / d(block STEP_BLOCKS further inside).
//! ```
//!
//! It is near 1 for cuts whatever the picture shows, and small where corners are dark by vignetting. The picture of a circular
//! fisheye is cut too, but along a circle: one is fitted to the outline (Kåsa 1976), again without the blocks farthest from it, as
//! dark things at its edge belong to the border by their color.

use nalgebra::{Matrix3, Vector3};

use super::outline::{Depth, Outline};
use plumbline_num::math::{Vec2, median};

/// Fraction of its bounds that the inside fills above which a crop suffices.
const MAX_FILL: f64 = 0.985;
/// Minimum step of a cut. Vignettes of photos are at .1 to .5, stitched pictures at .85 and more.
const MIN_STEP: f64 = 0.7;
/// Distance, blocks, at which a vignette has become much brighter: a thirtieth of the longer side.
const STEP_BLOCKS: usize = 16;
/// Difference from the border's color below which a block says nothing of a step, gray levels.
const MIN_DIFFERENCE: f64 = 8.0;
/// Maximum RMS distance of a circular outline from its circle: blocks, and a fraction of the radius. The first covers
/// quantization to blocks, the second lenses that are not quite round.
const MAX_CIRCLE_RMS: (f64, f64) = (0.6, 0.005);
/// Minimum number of outline blocks for a circle fit: fewer lie near a circle by chance.
const MIN_CIRCLE_BLOCKS: usize = 12;
/// Fraction of the outline that must be on the circle, and of what is left that each fit drops.
const MIN_ON_CIRCLE: f64 = 0.7;
const DROPPED: f64 = 0.1;

impl Outline {
    /// Whether the picture looks stitched: its outside lies along all sides of the frame and was cut off, the inside is neither a
    /// rectangle, for which a crop suffices, nor round.
    pub fn is_stitched(&self) -> bool {
        let [x0, y0, x1, y1] = self.bounds();
        let fills = self.count() as f64 / ((x1 - x0) * (y1 - y0)) as f64;
        self.touched == [true; 4]
            && (0.4..MAX_FILL).contains(&fills)
            && self.inside_fraction() > 0.3
            && self.step >= MIN_STEP
            && !self.is_round()
    }

    /// Whether the inside is a disk, possibly cut by the frame: the picture of a fisheye. Most blocks along the outline, were it
    /// in one corner alone, lie on a circle.
    pub fn is_round(&self) -> bool {
        let mut outline: Vec<Vec2> = self.along().collect();
        let least = MIN_CIRCLE_BLOCKS.max((MIN_ON_CIRCLE * outline.len() as f64) as usize);
        let diagonal = (self.cols as f64).hypot(self.rows as f64);
        while outline.len() >= least {
            let Some((center, radius)) = circle(&outline) else { return false };
            let miss = |p: &Vec2| ((p - center).norm() - radius).abs();
            let rms = (outline.iter().map(|p| miss(p).powi(2)).sum::<f64>() / outline.len() as f64).sqrt();
            if rms <= MAX_CIRCLE_RMS.0 + MAX_CIRCLE_RMS.1 * radius {
                return radius < diagonal;
            }
            outline.sort_by(|a, b| miss(a).total_cmp(&miss(b)));
            outline.truncate(((1.0 - DROPPED) * outline.len() as f64) as usize);
        }
        false
    }

    /// The step of the outline; `difference` is that of a block from the border's color, gray levels.
    pub(super) fn step_of(&self, difference: impl Fn(usize) -> f64) -> f64 {
        let depth = Depth::of(self.cols, self.rows, &self.inside);
        let index = |p: Vec2| {
            let within = |v: f64, n: usize| (v.max(0.0) as usize).min(n - 1);
            within(p.y, self.rows) * self.cols + within(p.x, self.cols)
        };
        let step = |block: Vec2| {
            let at = block + Vec2::repeat(0.5);
            let further = (0..STEP_BLOCKS).fold(at, |p, _| p + depth.inwards(p));
            let inner = difference(index(further));
            (inner >= MIN_DIFFERENCE).then(|| difference(index(at)) / inner)
        };
        let mut steps: Vec<f64> = self.along().filter_map(step).collect();
        median(&mut steps).unwrap_or(0.0)
    }
}

/// Center and radius of the circle nearest to points in the algebraic sense.
fn circle(points: &[Vec2]) -> Option<(Vec2, f64)> {
    let mean = points.iter().sum::<Vec2>() / points.len() as f64;
    let (mut moments, mut moments_rhs) = (Matrix3::zeros(), Vector3::zeros());
    for p in points.iter().map(|p| p - mean) {
        let row = Vector3::new(p.x, p.y, 1.0);
        moments += row * row.transpose();
        moments_rhs += row * p.norm_squared();
    }
    let solved = moments.cholesky()?.solve(&moments_rhs);
    let center = mean + solved.xy() / 2.0;
    Some((center, (solved.z + solved.xy().norm_squared() / 4.0).sqrt()))
}
