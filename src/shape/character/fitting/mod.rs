//! Fits a template skeleton to the curve skeleton of a surface.
//!
//! Template and curve are graphs in space: joints along bones, nodes along branches. The fit `f` maps each joint of the template to the
//! curve,
//!
//! ```text
//! min  Var_{a,b} ln (d_C(f(a), f(b)) / d_T(a, b))  +  min_{s, R} |C − s R T|² / |C|²  +  cost of unmatched parts
//! ```
//!
//! with path lengths `d`, leaves `a, b` of the template and their images `f(a), f(b)` among the leaves of the curve. The first term is
//! invariant to scale and pose; the second, with a proper rotation `R`, distinguishes left from right. Steps:
//!
//! | step | file |
//! | --- | --- |
//! | connected graphs in units of their own length | `graph.rs` |
//! | leaves, ordered by their contribution | `ends.rs` |
//! | images of the leaves, by a beam search that may leave some unmatched | `matching.rs` |
//! | images of junctions, and the paths of limbs between them | `limbs.rs` |
//! | joints along a path: by length, adapted to bends | `along.rs` |
//! | frames of the joints; limbs without image follow their parents | `frames.rs` |
//! | clips of the template in those frames | `retarget.rs` |
//!
//! A shape that is nearly flat or symmetric has two solutions of almost equal cost; the one that rotates the template least is chosen, and
//! the result is marked ambiguous.

mod along;
mod ends;
mod frames;
mod graph;
mod limbs;
mod matching;
mod moments;
mod retarget;
#[cfg(test)]
mod tests;

use nalgebra::UnitQuaternion;

use super::{CharacterError, CurveSkeleton, Skeleton};
use graph::Graph;
use limbs::Layout;
use plumbline_num::run::Run;

/// Cost difference below which layouts are indistinguishable: off-center curves change costs by as much.
const TIE: f64 = 2e-3;
/// Mean distance of joints above which two layouts are different, as a fraction of the curve's length.
const DIFFERENT: f64 = 0.02;

/// A limb of the template: the chain of joints between two junctions or leaves.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedLimb {
    /// First joint.
    pub from: u32,
    /// Last joint.
    pub to: u32,
    /// Length ratio to the template relative to the global scale; `None` if the curve has no image for it and it followed its parent.
    pub stretch: Option<f64>,
}

/// A fitted template.
#[derive(Clone, Debug, PartialEq)]
pub struct TemplateFit {
    /// The joints of the template with their names, parents and limits, with the fitted rest pose.
    pub skeleton: Skeleton,
    /// Every limb of the template.
    pub limbs: Vec<FittedLimb>,
    /// Ratio of limb lengths on the curve and in the template.
    pub scale: f64,
    /// Rotation of the trunk, independent of the pose of the limbs.
    pub rotation: UnitQuaternion<f64>,
    /// RMS distance of the joints from the best similarity of the template, as a fraction of their spread.
    pub residual: f64,
    /// Number of curve leaves without a limb.
    pub spare_ends: usize,
    /// Whether a different layout fits equally well; the one that rotates the template least was chosen.
    pub ambiguous: bool,
}

/// Fits a template to a curve.
///
/// The result is equivariant under similarities of either input. Components are connected at their nearest points.
///
/// # Errors
/// [`CharacterError::Template`] for a template without extent or with zero scale; [`CharacterError::Input`] for a curve without extent,
/// non-finite nodes, node indices out of range; [`CharacterError::Interrupted`].
pub fn fit_template(template: &Skeleton, curve: &CurveSkeleton, run: &Run) -> Result<TemplateFit, CharacterError> {
    let bones = Graph::of_skeleton(template).ok_or_else(|| {
        let joints = template.joint_count();
        let fault = format!("the template has {joints} joints at one position; fitting needs two joints apart");
        CharacterError::Template(fault)
    })?;
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
    let best = layouts.first().ok_or_else(|| graph::no_limbs(curve.nodes.len()))?;
    let rivals: Vec<&Layout> =
        layouts.iter().take_while(|l| l.cost < best.cost + TIE).filter(|l| l.differs(best, DIFFERENT)).collect();
    let angle_cost = |l: &&Layout| -l.alignment.rotation.trace();
    let chosen =
        rivals.iter().copied().chain([best]).min_by(|a, b| angle_cost(a).total_cmp(&angle_cost(b))).unwrap_or(best);
    let positions = chosen.refined();
    let (skeleton, limbs) = frames::posed(template, &bones, &branches, chosen, &positions)?;
    Ok(TemplateFit {
        skeleton,
        limbs,
        scale: chosen.scale() * branches.size / bones.size,
        rotation: UnitQuaternion::from_matrix(&chosen.trunk_rotation(&bones, &positions)),
        residual: chosen.alignment.residual.sqrt(),
        spare_ends: branches.ends().len().saturating_sub(chosen.matched_ends()),
        ambiguous: !rivals.is_empty(),
    })
}
