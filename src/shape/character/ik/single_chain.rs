//! Sequential solution of position targets, each by the joints of its own chain: the driver of [`IkMethod::Ccd`],
//! [`IkMethod::Fabrik`] and [`IkMethod::TwoBone`].

use nalgebra::Point3;

use super::frames::Frames;
use super::{
    Goal, IkMethod, IkOptions, IkSolution, RootMotion, Target, body_roots, ccd, fabrik, moves_root, no_chain, residual,
    two_bone, within_limits,
};
use crate::character::{CharacterError, Pose, Skeleton};
use plumbline_num::run::Run;

/// Distance to a met target, as a fraction of its chain length: the tolerance of the least-squares method, too.
const TOLERANCE: f64 = 1e-6;

/// Solves the targets in order, from a pose within limits; later ones may move joints of earlier ones.
pub(super) fn solve(
    skeleton: &Skeleton,
    initial: Pose,
    targets: &[Target],
    options: &IkOptions,
    run: &Run,
) -> Result<IkSolution, CharacterError> {
    let (mut pose, mut iterations, mut converged) = (initial, 0, true);
    for (number, target) in targets.iter().enumerate() {
        let refused = |problem: &str| {
            let what = format!("target {number} is not for the method {}", options.method.name());
            CharacterError::Input(format!("{what}: {problem}; the method least-squares takes it"))
        };
        let at = match &target.goal {
            Goal::Position { point, at } if *point == Point3::origin() => at,
            // The closed form handles a pole together with the position of its joint.
            Goal::Pole { .. } if options.method == IkMethod::TwoBone => continue,
            _ => return Err(refused("it brings the origins of joints to positions, nothing else")),
        };
        let joints = target.chain.unwrap_or(usize::MAX).min(below_root(skeleton, target, options.root));
        let mut chain = skeleton.ancestors(target.joint).take(joints);
        if chain.any(|j| options.locked.contains(&j)) {
            return Err(refused("a joint of the chain is locked"));
        }
        let tolerance = TOLERANCE * Frames::of(skeleton, &pose)?.scale(target);
        let (solved, taken) = match options.method {
            IkMethod::TwoBone => (of_two_bones(skeleton, &pose, (number, target, at), targets)?, 1),
            method => {
                let solver = if method == IkMethod::Fabrik { fabrik } else { ccd };
                solver(skeleton, &pose, (target.joint, joints), at, (options.iterations, tolerance), run)?
            }
        };
        pose = within_limits(skeleton, &solved);
        iterations = iterations.max(taken);
        converged &= options.method == IkMethod::TwoBone || taken < options.iterations;
    }
    let residuals = residual::residuals(targets, &Frames::of(skeleton, &pose)?);
    Ok(IkSolution { pose, residuals, iterations, converged })
}

/// Number of ancestors below the pinned root; all ancestors where the target is on the root itself.
fn below_root(skeleton: &Skeleton, target: &Target, root: RootMotion) -> usize {
    let roots = body_roots(skeleton);
    if root == RootMotion::Rotates || roots.contains(&target.joint) {
        return usize::MAX;
    }
    let rotates = |j: &u32| !roots.contains(j) || moves_root(skeleton, *j, target);
    skeleton.ancestors(target.joint).take_while(rotates).count()
}

/// The closed form: root and middle joint are those of a pole of the same joint, or its two ancestors.
fn of_two_bones(
    skeleton: &Skeleton,
    pose: &Pose,
    (number, target, at): (usize, &Target, &Point3<f64>),
    targets: &[Target],
) -> Result<Pose, CharacterError> {
    let pole = targets.iter().filter(|other| other.joint == target.joint).find_map(|other| match &other.goal {
        Goal::Pole { root, middle, at } => Some((*root, *middle, at)),
        _ => None,
    });
    let parent = |j: u32| skeleton.joints()[j as usize].parent;
    let above = || parent(target.joint).and_then(|middle| parent(middle).map(|root| (root, middle)));
    let (root, middle) = pole.map(|(root, middle, _)| (root, middle)).or_else(above).ok_or_else(|| no_chain(number))?;
    two_bone(skeleton, pose, [root, middle, target.joint], at, pole.map(|(.., at)| at))
}
