//! A skeleton made for something else, the template, fitted to the curve in the middle of a surface.
//!
//! Template and curve are graphs in space: joints along bones, nodes along branches. Sought is where on the curve each joint of the
//! template belongs,
//!
//! ```text
//! min  Var_{a,b} ln (d_C(f(a), f(b)) / d_T(a, b))  +  min_{s, R} |C − s R T|² / |C|²  +  what of the template has no place
//! ```
//!
//! with path lengths `d`, ends `a, b` of the template and their images `f(a), f(b)` among the ends of the curve. The first term knows
//! neither scale nor pose; the second, a proper rotation `R` without mirroring, tells left from right. Steps:
//!
//! | step | file |
//! | --- | --- |
//! | joints and nodes as graphs in one piece, in units of their own length | `graph.rs` |
//! | ends in the order of what they add | `ends.rs` |
//! | images of the ends, by a beam search that may leave some out | `matching.rs` |
//! | images of the joints where limbs meet, and the paths of limbs between them | `limbs.rs` |
//! | joints along a path: by length, drawn to its bends | `along.rs` |
//! | frames of the joints; limbs without an image go with what they hang on | `frames.rs` |
//! | movements of the template in those frames | `retarget.rs` |
//!
//! A shape that is all but flat or turns into itself leaves two answers that differ by less than can be told; the one that turns the
//! template least is taken then, and the result says so.

mod along;
mod ends;
mod error;
mod frames;
mod graph;
mod limbs;
mod matching;
mod moments;
mod retarget;
#[cfg(test)]
mod tests;

use nalgebra::UnitQuaternion;

use super::{CurveSkeleton, Skeleton};
pub use error::FitError;
use graph::Graph;
use limbs::Layout;
use plumbline_num::run::Run;

/// Layouts whose costs differ by less are not told apart: what a curve is off the middle changes them by as much.
const TIE: f64 = 2e-3;
/// Share of the template's length by which joints of two layouts differ on average where the layouts do.
const DIFFERENT: f64 = 0.02;

/// A limb of the template: the joints between two where limbs meet or end.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedLimb {
    /// Joint at its beginning.
    pub from: u32,
    /// Joint at its end.
    pub to: u32,
    /// How much longer it became than by the scale of the whole, a factor; `None` where the curve has nothing for it and it went with
    /// what it hangs on.
    pub stretch: Option<f64>,
}

/// A template on a curve.
#[derive(Clone, Debug, PartialEq)]
pub struct TemplateFit {
    /// The joints of the template with their names, parents and limits, at rest in their new places.
    pub skeleton: Skeleton,
    /// Every limb of the template.
    pub limbs: Vec<FittedLimb>,
    /// Length of the limbs on the curve by that in the template, a factor.
    pub scale: f64,
    /// How the trunk is turned: what limbs hang on, whatever their pose.
    pub rotation: UnitQuaternion<f64>,
    /// How far joints are from where the best similarity puts those of the template: root of the mean square, as a share of their spread.
    pub residual: f64,
    /// Ends of the curve that no limb ends in.
    pub spare_ends: usize,
    /// Another layout fits as well: sides were chosen so that the template turns least.
    pub ambiguous: bool,
}

/// Fits a template to a curve.
///
/// Scale, turn and place of either do not matter; pieces of the curve, and of the template, are joined where they are nearest.
///
/// # Errors
/// [`FitError`]: a template without two joints apart, a curve without two nodes apart or with nodes that are not finite, names of nodes
/// beyond their number; an interruption.
pub fn fit_template(template: &Skeleton, curve: &CurveSkeleton, run: &Run) -> Result<TemplateFit, FitError> {
    let bones = Graph::of_skeleton(template).ok_or(FitError::Template { joints: template.joint_count() })?;
    let branches = Graph::of_curve(curve)?;
    let (ours, theirs) = (ends::of_template(template, &bones), ends::of_curve(&branches));
    let mut layouts: Vec<Layout> = matching::candidates(&bones, &ours, &branches, &theirs, run)?
        .iter()
        .filter_map(|images| match run.check() {
            Ok(()) => Layout::new(&bones, &ours, &branches, &theirs, images).map(Ok),
            Err(stopped) => Some(Err(stopped)),
        })
        .collect::<Result<_, _>>()?;
    layouts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let best = layouts.first().ok_or(FitError::Curve { nodes: curve.nodes.len() })?;
    let rivals: Vec<&Layout> =
        layouts.iter().take_while(|l| l.cost < best.cost + TIE).filter(|l| l.differs(best, DIFFERENT)).collect();
    let turn = |l: &&Layout| -l.alignment.rotation.trace();
    let chosen = rivals.iter().copied().chain([best]).min_by(|a, b| turn(a).total_cmp(&turn(b))).unwrap_or(best);
    let places = chosen.refined();
    let (skeleton, limbs) = frames::posed(template, &bones, &branches, chosen, &places)?;
    Ok(TemplateFit {
        skeleton,
        limbs,
        scale: chosen.scale() * branches.size / bones.size,
        rotation: UnitQuaternion::from_matrix(&chosen.trunk_turn(&bones, &places)),
        residual: chosen.alignment.residual.sqrt(),
        spare_ends: branches.ends().len().saturating_sub(chosen.matched_ends()),
        ambiguous: !rivals.is_empty(),
    })
}
