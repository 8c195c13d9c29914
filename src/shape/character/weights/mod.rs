//! Automatic skin weights from a surface and a skeleton at rest.
//!
//! | method | weight of a joint |
//! | --- | --- |
//! | [`WeightMethod::Heat`] | equilibrium temperature with its bones at 1 and all others at 0 |
//! | [`WeightMethod::BoundedBiharmonic`] | the function with the least squared Laplacian that keeps to its bones, bounded by 0 … 1 |
//! | [`WeightMethod::Distance`] | inverse fourth power of the distance to its bones |
//!
//! Duplicates of a vertex (texture seams, triangle soups) are welded, so that weights do not tear along seams. Connected components that
//! see no bone (specks, buttons, the inside of a mouth) copy the weights of the nearest vertex of a component that does. If no component
//! does, all vertices are weighted by distance.

mod biharmonic;
mod bone_distance;
mod distance;
mod heat;
mod mirror;
mod paint;
mod smooth;
#[cfg(test)]
mod tests;
mod visibility;
mod welded;

use serde::{Deserialize, Serialize};

pub use mirror::{MirrorReport, Mirroring, mirror_joints_by_name};
pub use paint::{Brush, BrushStroke};

use super::{CharacterError, Skeleton, SkinWeights};
use crate::mesh::TriMesh;
use plumbline_num::options::OptionError;
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::KdTree;
use welded::Welded;

/// How skin weights are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum WeightMethod {
    /// Bone heat: diffusion along the surface from the nearest visible bones.
    ///
    /// Baran & Popović 2007. Robust default; about one sparse factorization.
    #[default]
    Heat,
    /// Bounded biharmonic weights: the smoothest weights within 0 … 1 that keep to the nearest visible bones.
    ///
    /// After Jacobson et al. 2011, on the surface. Smoother than heat at joints, with as wide a blend, in at most twice the time.
    #[serde(rename = "biharmonic", alias = "bbw")]
    BoundedBiharmonic,
    /// Inverse distance to the bones, ignoring the surface.
    ///
    /// For triangle soups without connectivity; influences leak between limbs that are close.
    Distance,
}

/// Options of automatic skin weights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default)]
pub struct WeightOptions {
    /// How skin weights are computed.
    pub method: WeightMethod,
    /// Largest number of joints per vertex. Use 4 for most engines, 8 for those that read two weight sets.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 64)))]
    pub influences: usize,
    /// Weights below this are dropped, 0 or more and below 1.
    #[serde(skip)]
    pub min_weight: f64,
    /// Laplacian smoothing iterations after the weights are found. Raise it if bends show creases.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 1000)))]
    pub smooth: usize,
}

impl Default for WeightOptions {
    fn default() -> Self {
        Self { method: WeightMethod::Heat, influences: 4, min_weight: 1e-3, smooth: 0 }
    }
}

/// Statistics of automatic weights.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct WeightReport {
    /// Connected components of the surface, isolated vertices not counted.
    pub components: usize,
    /// Components that see no bone and copied weights, including isolated vertices.
    pub borrowed_components: usize,
    /// Vertices of these components.
    pub borrowed_vertices: usize,
    /// Whether no component saw a bone, so that all vertices are weighted by distance.
    pub by_distance: bool,
    /// Joints with bones that influence no vertex.
    pub unused_joints: Vec<u32>,
}

/// Skin weights of a mesh for all joints that have bones.
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
    OptionError::check(
        (0.0..1.0).contains(&options.min_weight),
        "min_weight",
        options.min_weight,
        "0 or more, below 1",
    )?;
    run.check()?;
    let welded = Welded::new(mesh);
    let bones = skeleton.bones();
    let joints = skeleton.joint_count();
    let mut report = WeightReport { components: welded.piece_count(), ..Default::default() };
    let mut rows = match options.method {
        WeightMethod::Heat => heat::rows(&welded, &bones, joints, run)?,
        WeightMethod::BoundedBiharmonic => biharmonic::rows(&welded, &bones, joints, run)?,
        WeightMethod::Distance => distance::rows(welded.positions(), &bones, run)?,
    };
    borrow(&welded, &bones, &mut rows, &mut report, run)?;
    let (of_welded, _) = SkinWeights::normalized(joints, rows, None)?;
    let weights = of_welded.gathered(welded.vertex_of());
    let smoothed = if options.smooth > 0 { weights.smoothed(mesh, options.smooth, run)? } else { weights };
    // Dropped weights after the limit are small, so the limit still holds; the reverse order could exceed it.
    let weights = smoothed.limited(options.influences)?.pruned(options.min_weight)?;
    report.unused_joints = idle(&weights, bones.iter().map(|b| b.joint));
    Ok((weights, report))
}

/// Weights of one vertex, unsorted.
type Row = Vec<(u32, f64)>;

/// Fills empty rows with the row of the nearest vertex that has one.
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

/// Joints with bones that influence no vertex.
fn idle(weights: &SkinWeights, joints: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut followed = vec![false; weights.joint_count()];
    weights.rows().flatten().for_each(|i| followed[i.joint as usize] = true);
    let mut idle: Vec<u32> = joints.filter(|&j| !followed[j as usize]).collect();
    idle.dedup();
    idle
}
