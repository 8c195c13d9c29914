//! Bone heat:
//!
//! ```text
//! (L + M H) w_j = M H p_j        H_ii = 1/d(i)²,  p_j(i) = 1 where joint j has the nearest visible bone
//! ```
//! `wⱼ` is the equilibrium temperature of the surface if the bones of joint `j` are at 1 and all others at 0: each vertex receives heat from
//! its nearest visible bones at the rate `1/d²`, and heat diffuses along the surface. Equally near bones share `p` evenly, so that symmetric
//! models get symmetric weights. Since `Σⱼ pⱼ = 1`, the weights sum to one; since the intrinsic Delaunay Laplacian has non-negative edge
//! weights, they stay within 0 … 1 (maximum principle).
//!
//! One factorization serves all joints. A component without a vertex that sees a bone has no heat source: it is excluded, and its rows
//! stay empty.
//!
//! # Reference
//! I. Baran, J. Popović, *Automatic rigging and animation of 3D characters*, ACM TOG 26 (2007), section 4. `c = 1` as in Blender
//! (the paper: 0.22 for models of unit size).

use nalgebra::Point3;

use super::super::{Bone, CharacterError};
use super::Row;
use super::bone_distance::nearest;
use super::visibility::Occluders;
use super::welded::Welded;
use crate::mesh::operators::{CotangentRule, Cotangents, EdgeWeights, barycentric_areas, factored_laplacian};
use plumbline_num::energy::{ConstrainedLaplacian, FactoredLaplacian};
use plumbline_num::run::{Run, Stopped};
use plumbline_num::sparse::{Ordering, SparseError};

/// Relative difference of distances below which bones count as equally near: above the rounding of symmetric models in single precision.
const EQUALLY_NEAR: f64 = 1e-4;
/// Lower bound of distances, as a fraction of the diagonal: a vertex on a bone takes the bone's temperature.
const MIN_DISTANCE: f64 = 1e-4;
/// Temperatures below this are dropped: rounding, or far away.
const MIN_TEMPERATURE: f64 = 1e-6;
/// Upper bound of half cotangents: with larger ones slivers would cost the factorization the digits of the heat term.
const MAX_COTANGENT: f64 = 1e3;

/// The nearest visible bones of a vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Source {
    /// Squared distance to them.
    pub(super) d2: f64,
    /// Indices of the bones, all equally near; empty if none is visible.
    pub(super) bones: Vec<u32>,
}

/// One row per welded vertex; empty if its component sees no bone.
pub(super) fn rows(welded: &Welded, bones: &[Bone], joints: usize, run: &Run) -> Result<Vec<Row>, CharacterError> {
    diffused(welded, bones, joints, Diffusion { rate: 1.0, steps: 1 }, run)
}

/// Repeated diffusion `w ← (L + M H)⁻¹ M H w` from `w = p`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Diffusion {
    /// `c` in `H_ii = c/d(i)²`, dimensionless.
    pub(super) rate: f64,
    /// Number of diffusions, 1 or more.
    pub(super) steps: usize,
}

/// One row per welded vertex; empty if its component sees no bone.
pub(super) fn diffused(
    welded: &Welded,
    bones: &[Bone],
    joints: usize,
    diffusion: Diffusion,
    run: &Run,
) -> Result<Vec<Row>, CharacterError> {
    let sources = sources(welded, bones, run)?;
    let mut warm = vec![false; sources.len()];
    for (v, source) in sources.iter().enumerate() {
        // An isolated vertex has no area to receive heat.
        warm[welded.piece_of(v) as usize] |= !source.bones.is_empty() && !welded.is_isolated(v);
    }
    // Unknowns: vertices of components that see a bone.
    let is_warm = |v: usize| warm[welded.piece_of(v) as usize];
    let unknown: Vec<usize> = (0..sources.len()).filter(|&v| is_warm(v)).collect();
    let mut rows = vec![Row::new(); sources.len()];
    if unknown.is_empty() {
        return Ok(rows);
    }
    let (mut factor, flow) = factored(welded, &sources, &unknown, is_warm, diffusion.rate, run)
        .map_err(|error| CharacterError::of_system(error, "weight by distance"))?;
    let mut heated = vec![Vec::new(); joints];
    for (u, &v) in unknown.iter().enumerate() {
        for &b in &sources[v].bones {
            heated[bones[b as usize].joint as usize].push((u, 1.0 / sources[v].bones.len() as f64));
        }
    }
    for (joint, heated) in heated.iter().enumerate().filter(|(_, h)| !h.is_empty()) {
        run.check()?;
        let mut temperature = vec![0.0; unknown.len()];
        for &(u, nearest) in heated {
            temperature[u] += nearest;
        }
        for _ in 0..diffusion.steps {
            temperature.iter_mut().zip(&flow).for_each(|(t, flow)| *t *= flow);
            factor.solve_scalar(&mut temperature);
        }
        for (&v, &w) in unknown.iter().zip(&temperature) {
            if w > MIN_TEMPERATURE {
                rows[v].push((joint as u32, w));
            }
        }
    }
    Ok(rows)
}

/// The factorization of `L + M H` over the unknowns, and the diagonal of `M H`.
fn factored(
    welded: &Welded,
    sources: &[Source],
    unknown: &[usize],
    is_warm: impl Fn(usize) -> bool,
    rate: f64,
    run: &Run,
) -> Result<(FactoredLaplacian, Vec<f64>), SparseError> {
    let mesh = welded.mesh();
    run.check()?;
    let cotangents = Cotangents::new(mesh, CotangentRule::IntrinsicDelaunay).limited(MAX_COTANGENT);
    let edges = EdgeWeights::cotangent(mesh.vertex_count(), &cotangents);
    let areas = barycentric_areas(mesh);
    let mean = areas.iter().sum::<f64>() / areas.len() as f64;
    let least = (MIN_DISTANCE * mesh.diagonal()).powi(2);
    let flow = unknown.iter().map(|&v| {
        // 1e-6 of the mean: vertices of slivers have hardly an area but must conduct their neighbors' heat.
        let area = areas[v].max(1e-6 * mean);
        if sources[v].bones.is_empty() { 0.0 } else { rate * area / sources[v].d2.max(least) }
    });
    let flow: Vec<f64> = flow.collect();
    // 1e-9: keeps a component connected even if all cotangents along a cut vanish.
    let edges = edges.iter().map(|(i, j, w)| (i, j, w.max(1e-9)));
    let terms = unknown.iter().zip(&flow).map(|(&v, &f)| (v, v, f)).chain(edges);
    let laplacian = ConstrainedLaplacian::new(mesh.vertex_count(), terms, |v| !is_warm(v))?;
    run.check()?;
    Ok((factored_laplacian(laplacian, &Ordering::Amd, run)?, flow))
}

/// The nearest visible bones of every welded vertex: bones are tested in order of distance until one is visible.
pub(super) fn sources(welded: &Welded, bones: &[Bone], run: &Run) -> Result<Vec<Source>, Stopped> {
    let occluders = Occluders::new(welded.mesh());
    let mut by_distance: Vec<(f64, u32, Point3<f64>)> = Vec::with_capacity(bones.len());
    let source = |(v, p): (usize, &Point3<f64>)| {
        run.check()?;
        by_distance.clear();
        by_distance.extend(bones.iter().zip(0..).map(|(bone, b)| {
            let (q, d2, _) = nearest(bone, p);
            (d2, b, q)
        }));
        by_distance.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut source = Source::default();
        for (d2, b, q) in &by_distance {
            let found = !source.bones.is_empty();
            if found && *d2 > source.d2 * (1.0 + EQUALLY_NEAR).powi(2) {
                break;
            }
            if !occluders.between(v as u32, p, q) {
                if !found {
                    source.d2 = *d2;
                }
                source.bones.push(*b);
            }
        }
        Ok(source)
    };
    welded.positions().iter().enumerate().map(source).collect()
}
