//! Which joint of a target follows which of a source.
//!
//! | by | where |
//! | --- | --- |
//! | a map | for the joints that it names; it overrides the rest |
//! | equal names | names that say something, up to separators and capitals; any names where all of them and their parents are equal |
//! | parts of the body | names that mean the same part ([`super::names`]) |
//! | shape | where neither gives half of the ends of limbs: the source is fitted to the bones of the target as a template to a curve ([`fit_template`]), which compares lengths and directions at rest |
//!
//! A correspondence keeps the order of the hierarchy: a pair whose joints are not both below, or both not below, those of another pair
//! closer to the roots is dropped.

use std::collections::HashMap;

use nalgebra::Point3;

use super::names::{self, Role, words};
use super::{JointMap, check_size};
use crate::character::fitting::fit_template;
use crate::character::{CharacterError, CurveSkeleton, Skeleton};
use plumbline_num::run::Run;

/// How a correspondence was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatchedBy {
    /// By names, or by a map.
    Names,
    /// By lengths and directions of limbs.
    Shape {
        /// Whether another assignment of limbs fits equally well.
        ambiguous: bool,
    },
}

/// A correspondence of joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Correspondence {
    /// For each joint of the target the joint of the source that it follows.
    pub source_of: Vec<Option<u32>>,
    /// How it was found.
    pub by: MatchedBy,
}

/// Largest number of joints of a skeleton that is matched by shape: the search is quadratic.
const MAX_BY_SHAPE: usize = 1000;

/// Fewest pairs of a correspondence: a joint that moves, its parent and its child.
const MIN_PAIRS: usize = 3;

impl Correspondence {
    /// Finds the correspondence of two skeletons.
    ///
    /// # Errors
    /// [`CharacterError::Input`] with the names of the joints, where nothing corresponds; a map of other skeletons; more than
    /// 2000 joints. [`CharacterError::Interrupted`].
    ///
    /// ```
    /// use plumbline_num::run::Run;
    /// use plumbline_shape::character::humanoid::humanoid;
    /// use plumbline_shape::character::retargeting::{Correspondence, JointMap};
    ///
    /// let skeleton = humanoid(0.1)?.skeleton;
    /// let found = Correspondence::find(&skeleton, &skeleton, &JointMap::default(), &Run::default())?;
    /// assert!(found.source_of.iter().zip(0..).all(|(source, target)| *source == Some(target)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn find(source: &Skeleton, target: &Skeleton, map: &JointMap, run: &Run) -> Result<Self, CharacterError> {
        check_size(source, target)?;
        let joints = |(joint, followed): &(u32, Option<u32>)| [(target, Some(*joint)), (source, *followed)];
        let is_missing = |(of, joint): &(&Skeleton, Option<u32>)| joint.is_some_and(|j| j as usize >= of.joint_count());
        if map.pairs.iter().flat_map(joints).any(|pair| is_missing(&pair)) {
            return Err(CharacterError::Input(
                "the map of joints is of other skeletons: it has joints that they do not".to_owned(),
            ));
        }
        let roles = [source, target].map(names::roles);
        let mut source_of = by_names(source, target, &roles);
        let mut by = MatchedBy::Names;
        let mapped = map.pairs.iter().filter(|(_, source)| source.is_some()).count();
        if !enough(source, target, &source_of) && mapped < MIN_PAIRS {
            let found = by_shape(source, target, run)?;
            if let Some((found, ambiguous)) = found {
                (source_of, by) = (found, MatchedBy::Shape { ambiguous });
            }
        }
        for (joint, followed) in &map.pairs {
            source_of[*joint as usize] = *followed;
        }
        let forced: Vec<u32> = map.pairs.iter().map(|(joint, _)| *joint).collect();
        in_order(source, target, &mut source_of, &forced);
        if source_of.iter().flatten().count() < MIN_PAIRS.min(source.joint_count()).min(target.joint_count()) {
            return Err(nothing_corresponds(source, target));
        }
        Ok(Self { source_of, by })
    }
}

fn nothing_corresponds(source: &Skeleton, target: &Skeleton) -> CharacterError {
    let some = |skeleton: &Skeleton| {
        let names: Vec<&str> = skeleton.joints().iter().take(8).map(|j| j.name.as_str()).collect();
        let more = skeleton.joint_count().saturating_sub(names.len());
        let names = names.join(", ");
        if more > 0 { format!("{names} and {more} more") } else { names }
    };
    let fault =
        format!("the joints of the source ({}) and of the target ({}) do not correspond", some(source), some(target));
    CharacterError::Input(format!("{fault}, by their names or by the shape of the limbs; give a map of joints"))
}

/// Pairs of equal names, then of equal parts.
fn by_names(source: &Skeleton, target: &Skeleton, roles: &[Vec<Option<Role>>; 2]) -> Vec<Option<u32>> {
    let parent_name =
        |skeleton: &Skeleton, j: usize| skeleton.joints()[j].parent.map(|p| skeleton.joints()[p as usize].name.clone());
    let numbers: HashMap<&str, u32> =
        source.joints().iter().zip(0..).map(|(joint, j)| (joint.name.as_str(), j)).collect();
    let same = |(j, joint): (usize, &crate::character::Joint)| {
        let twin = numbers.get(joint.name.as_str()).copied()?;
        (parent_name(source, twin as usize) == parent_name(target, j)).then_some(twin)
    };
    let equal: Vec<Option<u32>> = target.joints().iter().enumerate().map(same).collect();
    if equal.iter().all(Option::is_some) && source.joint_count() == target.joint_count() {
        return equal;
    }
    let key = |name: &str| words(name).concat();
    let mut named: HashMap<String, Option<u32>> = HashMap::new();
    for (joint, j) in source.joints().iter().zip(0..) {
        // A key of two joints is none.
        named.entry(key(&joint.name)).and_modify(|known| *known = None).or_insert(Some(j));
    }
    let mut source_of = vec![None; target.joint_count()];
    let mut taken = vec![false; source.joint_count()];
    for (j, joint) in target.joints().iter().enumerate().filter(|(_, joint)| !names::is_generic(&joint.name)) {
        let twin = named.get(&key(&joint.name)).copied().flatten();
        // One word may mean two parts: a leg is a thigh in one skeleton, a shin in another.
        let part = |role: &Option<Role>| role.map(|(part, side, _)| (part, side));
        let twin = twin.filter(|twin| part(&roles[0][*twin as usize]) == part(&roles[1][j]));
        if let Some(twin) = twin.filter(|twin| !std::mem::replace(&mut taken[*twin as usize], true)) {
            source_of[j] = Some(twin);
        }
    }
    for [ours, theirs] in names::matched(&roles[0], &roles[1]) {
        if source_of[theirs as usize].is_none() && !std::mem::replace(&mut taken[ours as usize], true) {
            source_of[theirs as usize] = Some(ours);
        }
    }
    source_of
}

/// Whether names suffice: half of the limbs of the skeleton that has fewer have two joints that correspond.
fn enough(source: &Skeleton, target: &Skeleton, source_of: &[Option<u32>]) -> bool {
    let limbs = |skeleton: &Skeleton, mapped: &[bool]| {
        let ends = (0..skeleton.joint_count() as u32).filter(|j| skeleton.children(*j).is_empty());
        let limb = |end: u32| {
            let above = skeleton.ancestors(end).take_while(|j| skeleton.children(*j).len() < 2);
            std::iter::once(end).chain(above).filter(|j| mapped[*j as usize]).count()
        };
        let limbs: Vec<usize> = ends.map(limb).collect();
        (limbs.iter().filter(|count| **count >= 2).count(), limbs.len())
    };
    let theirs: Vec<bool> = source_of.iter().map(Option::is_some).collect();
    let mut ours = vec![false; source.joint_count()];
    source_of.iter().flatten().for_each(|j| ours[*j as usize] = true);
    let [(a, of_a), (b, of_b)] = [limbs(source, &ours), limbs(target, &theirs)];
    source_of.iter().flatten().count() >= MIN_PAIRS
        && (2 * a >= of_a.min(of_b) || 2 * b >= of_a.min(of_b) || a.min(b) >= 4)
}

/// Pieces of a bone between two nodes of its curve.
const PIECES: usize = 8;

/// For each joint of the target one of the source, and whether another assignment fits equally well.
type Fitted = (Vec<Option<u32>>, bool);

/// Fits the source to the bones of the target.
fn by_shape(source: &Skeleton, target: &Skeleton, run: &Run) -> Result<Option<Fitted>, CharacterError> {
    if source.joint_count().max(target.joint_count()) > MAX_BY_SHAPE
        || source.joint_count().min(target.joint_count()) < MIN_PAIRS
    {
        return Ok(None);
    }
    let at = target.rest_positions();
    let mut curve = CurveSkeleton { nodes: at.clone(), ..CurveSkeleton::default() };
    for (joint, j) in target.joints().iter().zip(0_u32..) {
        let Some(parent) = joint.parent else { continue };
        let (from, to) = (at[parent as usize], at[j as usize]);
        let mut last = parent;
        for k in 1..PIECES {
            let node = curve.nodes.len() as u32;
            curve.nodes.push(from + (to - from) * (k as f64 / PIECES as f64));
            curve.edges.push([last, node]);
            last = node;
        }
        curve.edges.push([last, j]);
    }
    let fit = match fit_template(source, &curve, run) {
        Ok(fit) => fit,
        Err(stopped @ CharacterError::Interrupted(_)) => return Err(stopped),
        Err(_) => return Ok(None),
    };
    let images = fit.skeleton.rest_positions();
    let mut placed = vec![false; source.joint_count()];
    for limb in fit.limbs.iter().filter(|limb| limb.stretch.is_some()) {
        // The joints between the two ends: one is an ancestor of the other, or both are below the root.
        for end in [limb.from, limb.to] {
            let stop = if end == limb.from { limb.to } else { limb.from };
            let chain: Vec<u32> = std::iter::once(end).chain(source.ancestors(end)).collect();
            let length = chain.iter().position(|j| *j == stop).map_or_else(
                || chain.iter().position(|j| source.children(*j).len() > 1).map_or(chain.len(), |k| k + 1),
                |k| k + 1,
            );
            chain[..length].iter().for_each(|j| placed[*j as usize] = true);
        }
    }
    Ok(Some((nearest(source, target, &images, &placed), fit.ambiguous)))
}

/// Pairs each joint of the target with the nearest image of a source joint that is nearest to it, too.
fn nearest(source: &Skeleton, target: &Skeleton, images: &[Point3<f64>], placed: &[bool]) -> Vec<Option<u32>> {
    let at = target.rest_positions();
    let mut pairs: Vec<(f64, u32, u32)> = Vec::new();
    for (i, image) in images.iter().enumerate().filter(|(i, _)| placed[*i]) {
        for (j, position) in at.iter().enumerate() {
            // Ends correspond to ends; the root of a limb at a junction is nearest by hierarchy.
            let ends = source.children(i as u32).is_empty() == target.children(j as u32).is_empty();
            let distance = nalgebra::distance(image, position);
            pairs.push((if ends { distance } else { 2.0 * distance }, i as u32, j as u32));
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
    let (mut source_of, mut taken) = (vec![None; target.joint_count()], vec![false; source.joint_count()]);
    let reach = reach(target);
    for (distance, i, j) in pairs {
        if source_of[j as usize].is_none() && !taken[i as usize] && distance <= reach {
            source_of[j as usize] = Some(i);
            taken[i as usize] = true;
        }
    }
    source_of
}

/// Distance within which a joint follows an image: a tenth of the skeleton's extent.
fn reach(target: &Skeleton) -> f64 {
    let at = target.rest_positions();
    let extent = at.iter().map(|p| nalgebra::distance(p, &at[0])).fold(0.0, f64::max);
    0.1 * extent
}

/// Drops pairs that are at odds with the hierarchy: of a joint whose nearest mapped ancestor does not follow an ancestor.
fn in_order(source: &Skeleton, target: &Skeleton, source_of: &mut [Option<u32>], forced: &[u32]) {
    let mut above: Vec<Option<u32>> = vec![None; target.joint_count()];
    for &j in target.parents_first() {
        let inherited = target.joints()[j as usize].parent.and_then(|p| source_of[p as usize].or(above[p as usize]));
        above[j as usize] = inherited;
        if let (Some(own), Some(ancestor)) = (source_of[j as usize], inherited)
            && !source.ancestors(own).any(|above| above == ancestor)
            && !forced.contains(&j)
        {
            source_of[j as usize] = None;
        }
    }
}
