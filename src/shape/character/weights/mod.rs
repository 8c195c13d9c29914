//! Weights found from a surface and a skeleton at rest.
//!
//! | method | of each joint |
//! | --- | --- |
//! | [`WeightMethod::Heat`] | the temperature where its bones are hot and all others cold |
//! | [`WeightMethod::BoundedBiharmonic`] | the smoothest function that is 1 about the middle of its bones, and never leaves 0 … 1 |
//! | [`WeightMethod::Distance`] | a power of the distance to its bones |
//!
//! Copies of a vertex (seams, soups) are taken as one, so that weights do not tear along seams. Pieces of the surface that see no
//! bone (specks, buttons, the inside of a mouth) take the weights of the nearest vertex of a piece that does, and spoil nothing;
//! where no piece does, all are weighted by distance.

mod biharmonic;
mod bone_distance;
mod distance;
mod heat;
mod mirror;
mod smooth;
#[cfg(test)]
mod tests;
mod visibility;
mod welded;

use serde::{Deserialize, Serialize};

pub use mirror::{MirrorReport, Mirroring, mirror_joints_by_name};

use super::{CharacterError, Skeleton, SkinWeights};
use crate::mesh::TriMesh;
use plumbline_num::options::OptionError;
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::KdTree;
use welded::Welded;

/// How weights are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum WeightMethod {
    /// As heat that comes from the nearest bones in sight and spreads along the surface.
    ///
    /// Bone heat (Baran & Popović 2007).
    #[default]
    Heat,
    /// As smoothly as bounds of 0 and 1 allow, rigid about the middles of bones.
    ///
    /// Bounded biharmonic weights (Jacobson et al. 2011), on the surface.
    #[serde(rename = "biharmonic", alias = "bbw")]
    BoundedBiharmonic,
    /// By distance to the bones alone, through the surface.
    ///
    /// It needs no surface, and leaks between limbs that are close.
    Distance,
}

/// What weights are like.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default)]
pub struct WeightOptions {
    /// How weights are found.
    pub method: WeightMethod,
    /// Joints per vertex at most: 4 for most programs, 8 where two sets are read.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 64)))]
    pub influences: usize,
    /// Weights below this are left out, 0 or more and below 1.
    #[serde(skip)]
    pub least: f64,
    /// Rounds of smoothing over neighbors.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 1000)))]
    pub smooth: usize,
}

impl Default for WeightOptions {
    fn default() -> Self {
        Self { method: WeightMethod::Heat, influences: 4, least: 1e-3, smooth: 0 }
    }
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WeightReport {
    /// Pieces of the surface, lone vertices not counted.
    pub components: usize,
    /// Pieces that see no bone and took the weights of others, lone vertices among them.
    pub borrowed_components: usize,
    /// Vertices of these.
    pub borrowed_vertices: usize,
    /// Whether no piece saw a bone, so that all are weighted by distance.
    pub by_distance: bool,
    /// Joints that have bones but that no vertex follows, by number.
    pub idle_joints: Vec<u32>,
    /// Rounds of the solver, for weights that are found by rounds.
    pub iterations: usize,
    /// What was left when it stopped: how far its two copies of the weights are apart, 0 to 1.
    pub residual: f64,
}

/// Weights of every joint that has bones, for every vertex.
///
/// # Errors
/// [`CharacterError::Option`] for options out of range, [`CharacterError::Solve`], [`CharacterError::Interrupted`].
pub fn bone_weights(
    mesh: &TriMesh,
    skeleton: &Skeleton,
    options: &WeightOptions,
    run: &Run,
) -> Result<(SkinWeights, WeightReport), CharacterError> {
    OptionError::check(options.influences > 0, "influences", 0.0, "1 or more")?;
    OptionError::check((0.0..1.0).contains(&options.least), "least weight", options.least, "0 or more, below 1")?;
    run.check()?;
    let welded = Welded::new(mesh);
    let bones = skeleton.bones();
    let joints = skeleton.joint_count();
    let mut report = WeightReport { components: welded.piece_count(), ..Default::default() };
    let mut rows = match options.method {
        WeightMethod::Heat => heat::rows(&welded, &bones, joints, run)?,
        WeightMethod::BoundedBiharmonic => biharmonic::rows(&welded, &bones, joints, &mut report, run)?,
        WeightMethod::Distance => distance::rows(welded.positions(), &bones, run)?,
    };
    borrow(&welded, &bones, &mut rows, &mut report, run)?;
    let (of_welded, _) = SkinWeights::normalized(joints, rows, None)?;
    let weights = of_welded.gathered(welded.vertex_of());
    let smoothed = if options.smooth > 0 { weights.smoothed(mesh, options.smooth, run)? } else { weights };
    // What is pruned after the limit is small; what is limited after pruning need not be.
    let weights = smoothed.limited(options.influences)?.pruned(options.least)?;
    report.idle_joints = idle(&weights, bones.iter().map(|b| b.joint));
    Ok((weights, report))
}

/// Weights of one vertex: joints in any order.
type Row = Vec<(u32, f64)>;

/// Fills the rows that are empty from the nearest that are not.
fn borrow(
    welded: &Welded,
    bones: &[super::Bone],
    rows: &mut [Row],
    report: &mut WeightReport,
    run: &Run,
) -> Result<(), Stopped> {
    let (full, empty): (Vec<usize>, Vec<usize>) = (0..rows.len()).partition(|&v| !rows[v].is_empty());
    if empty.is_empty() {
        return Ok(());
    }
    if full.is_empty() {
        report.by_distance = true;
        for (row, by_distance) in rows.iter_mut().zip(distance::rows(welded.positions(), bones, run)?) {
            *row = by_distance;
        }
        return Ok(());
    }
    let tree = KdTree::new(&full.iter().map(|&v| welded.positions()[v]).collect::<Vec<_>>());
    let mut pieces: Vec<u32> = Vec::new();
    for &v in &empty {
        run.check()?;
        let (nearest, _) = tree.first_nearest(&welded.positions()[v]).expect("there are full rows");
        let borrowed = rows[full[nearest as usize]].clone();
        rows[v] = borrowed;
        pieces.push(welded.piece_of(v));
    }
    pieces.sort_unstable();
    pieces.dedup();
    report.borrowed_components = pieces.len();
    let borrowed = |w: &&u32| empty.binary_search(&(**w as usize)).is_ok();
    report.borrowed_vertices = welded.vertex_of().iter().filter(borrowed).count();
    Ok(())
}

/// Joints of bones that no vertex follows.
fn idle(weights: &SkinWeights, joints: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut followed = vec![false; weights.joint_count()];
    weights.rows().flatten().for_each(|i| followed[i.joint as usize] = true);
    let mut idle: Vec<u32> = joints.filter(|&j| !followed[j as usize]).collect();
    idle.dedup();
    idle
}
