//! Joint matrices and skin weights fitted to posed surfaces of which only vertex positions are known.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Point3, Vector3};
use rayon::prelude::*;

use super::super::{CharacterError, Skeleton, SkinWeights};
use super::{Example, check_examples};
use crate::mesh::TriMesh;
use plumbline_num::math::nearest_rotation;
use plumbline_num::run::{Run, Stopped};

/// Weighted centroids of a joint's vertices, at rest and in the example.
type Middles = (Vector3<f64>, Vector3<f64>);

/// Largest number of active-set iterations per joint; a few are typical.
const MAX_ITERATIONS: usize = 10;
/// Weight of the prior, relative to the trace: far below the information of examples, far above rounding.
const RIDGE: f64 = 1e-6;
/// Motions below this fraction of the diagonal are rounding and carry no information.
const NOISE: f64 = 1e-10;

/// The rigid motion of each joint that best maps its vertices to their posed positions:
///
/// ```text
/// min Σᵢ w_ij² |Rⱼ pᵢ + tⱼ − xᵢ|²
/// ```
///
/// A joint without influence, such as a leaf, follows its parent; if no ancestor has influence either, it follows the first descendant
/// with influence.
///
/// # Errors
/// [`CharacterError::PerVertex`] for weights or positions of another mesh, [`CharacterError::Input`] for weights of another skeleton.
pub fn fit_joints(
    mesh: &TriMesh,
    skeleton: &Skeleton,
    weights: &SkinWeights,
    positions: &[Point3<f64>],
) -> Result<Vec<Matrix4<f64>>, CharacterError> {
    let (vertices, joints) = (mesh.vertex_count(), skeleton.joint_count());
    CharacterError::check_matrices(weights.joint_count(), joints)?;
    for (what, given) in [("rows of weights", weights.vertex_count()), ("positions", positions.len())] {
        CharacterError::check_per_vertex(what, given, vertices)?;
    }
    let mut sums = vec![(0.0, Vector3::zeros(), Vector3::zeros()); weights.joint_count()];
    let pairs = || mesh.positions().iter().zip(positions).zip(weights.rows());
    for ((p, x), row) in pairs() {
        for i in row {
            let (total, from, to) = &mut sums[i.joint as usize];
            let w = i.weight * i.weight;
            *total += w;
            *from += w * p.coords;
            *to += w * x.coords;
        }
    }
    let middles: Vec<Option<Middles>> = sums.iter().map(|(w, p, x)| (*w > 0.0).then(|| (p / *w, x / *w))).collect();
    let mut spread = vec![Matrix3::zeros(); weights.joint_count()];
    for ((p, x), row) in pairs() {
        for i in row {
            if let Some((from, to)) = &middles[i.joint as usize] {
                spread[i.joint as usize] += (x.coords - to) * (p.coords - from).transpose() * (i.weight * i.weight);
            }
        }
    }
    let motion = |(middle, spread): (&Option<Middles>, &Matrix3<f64>)| {
        let (from, to) = (*middle)?;
        let rotation = nearest_rotation(spread);
        let mut m = rotation.to_homogeneous();
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&(to - rotation * from));
        Some(m)
    };
    Ok(with_idle(skeleton, middles.iter().zip(&spread).map(motion).collect()))
}

/// Fills the motions of joints without influence from their neighbors in the skeleton.
fn with_idle(skeleton: &Skeleton, mut motions: Vec<Option<Matrix4<f64>>>) -> Vec<Matrix4<f64>> {
    let order = skeleton.parents_first();
    let parent = |j: u32| skeleton.joints()[j as usize].parent.map(|p| p as usize);
    // From the leaves up; the lowest child is visited last and wins.
    let known = motions.clone();
    let mut below = known.clone();
    for &j in order.iter().rev() {
        if let (Some(p), Some(motion)) = (parent(j), below[j as usize])
            && known[p].is_none()
        {
            below[p] = Some(motion);
        }
    }
    for &j in order {
        let above = parent(j).and_then(|p| motions[p]);
        let j = j as usize;
        motions[j] = motions[j].or(above).or(below[j]);
    }
    motions.into_iter().map(|m| m.unwrap_or_else(Matrix4::identity)).collect()
}

/// The weights whose linear blend comes closest to the examples, over all joints: per vertex
///
/// ```text
/// min Σₖ |Σⱼ wⱼ Mⱼₖ p − xₖ|² + λ |w − u|²      s.t.  w ≥ 0,  Σⱼ wⱼ = 1
/// ```
///
/// by the active-set method. `u` are the initial weights: they decide between joints that the examples do not distinguish.
///
/// # Errors
/// [`CharacterError::Input`] without examples or for examples of other joints, [`CharacterError::PerVertex`],
/// [`CharacterError::Interrupted`].
pub fn fit_weights(
    mesh: &TriMesh,
    weights: &SkinWeights,
    examples: &[Example],
    run: &Run,
) -> Result<SkinWeights, CharacterError> {
    let joints = weights.joint_count();
    check_examples(mesh, weights, examples)?;
    let least = (NOISE * mesh.diagonal()).powi(2).max(f64::MIN_POSITIVE);
    let row = |(v, p): (usize, &Point3<f64>)| {
        run.check()?;
        let mut moved = DMatrix::zeros(3 * examples.len(), joints);
        for (k, example) in examples.iter().enumerate() {
            // Relative to the posed vertex, which keeps digits far from the origin: weights sum to one.
            for (j, m) in example.matrices.iter().enumerate() {
                moved.fixed_view_mut::<3, 1>(3 * k, j).copy_from(&(m.transform_point(p) - example.positions[v]));
            }
        }
        let mut prior = DVector::zeros(joints);
        weights.row(v).iter().for_each(|i| prior[i.joint as usize] = i.weight);
        let w = on_simplex(&moved.tr_mul(&moved), &prior, least);
        Ok((0..).zip(w.iter().copied().collect::<Vec<_>>()).collect::<Vec<(u32, f64)>>())
    };
    let rows = mesh.positions().par_iter().enumerate().map(row).collect::<Result<Vec<_>, Stopped>>()?;
    Ok(SkinWeights::normalized(joints, rows, None)?.0)
}

/// `min wᵀ G w + λ |w − u|²` over the simplex by an active-set method: on a set of free weights the minimum is `H w = λ u + ν 1`, `H = G + λ`,
/// with `λ` at least `least`; a weight that would become negative leaves the set, one with a gradient below the multiplier enters it.
fn on_simplex(gram: &DMatrix<f64>, prior: &DVector<f64>, least: f64) -> DVector<f64> {
    let n = gram.nrows();
    let lambda = (RIDGE * gram.trace()).max(least);
    let (h, b) = (gram + DMatrix::identity(n, n) * lambda, prior * lambda);
    let cost = |j: usize| 0.5 * h[(j, j)] - b[j];
    let best = (0..n).min_by(|&i, &j| cost(i).total_cmp(&cost(j))).unwrap_or(0);
    let mut w = DVector::zeros(n);
    w[best] = 1.0;
    let mut free = vec![best];
    for _ in 0..MAX_ITERATIONS * n {
        let Some(wanted) = on_plane(&h, &b, &free) else { break };
        // Step to the first bound.
        let reach = |k: usize| if wanted[k] < 0.0 { w[free[k]] / (w[free[k]] - wanted[k]) } else { 1.0 };
        let first = (0..free.len()).min_by(|&a, &b| reach(a).total_cmp(&reach(b))).expect("one is free");
        let step = reach(first);
        for (k, &j) in free.iter().enumerate() {
            w[j] += step * (wanted[k] - w[j]);
        }
        if step < 1.0 {
            w[free.remove(first)] = 0.0;
            continue;
        }
        let slope = &h * &w - &b;
        // All free weights have the same gradient.
        let level = slope.dot(&w);
        let steepest = (0..n).filter(|j| !free.contains(j)).min_by(|&a, &b| slope[a].total_cmp(&slope[b]));
        let rounding = 1e-9 * (level.abs() + lambda);
        match steepest.filter(|&j| slope[j] < level - rounding) {
            Some(j) => free.push(j),
            None => break,
        }
    }
    w
}

/// The minimum over the free weights with sum one.
fn on_plane(h: &DMatrix<f64>, b: &DVector<f64>, free: &[usize]) -> Option<DVector<f64>> {
    let cholesky = h.select_rows(free).select_columns(free).cholesky()?;
    let (toward, along) = (cholesky.solve(&b.select_rows(free)), cholesky.solve(&DVector::repeat(free.len(), 1.0)));
    let nu = (1.0 - toward.sum()) / along.sum();
    Some(toward + along * nu)
}
