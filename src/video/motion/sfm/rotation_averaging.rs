//! Rotation averaging: absolute rotations from relative ones.
//!
//! Edges `(i, j)` of a view graph carry `R_ij ≈ R_j R_iᵀ` with a weight. With the residual `ω_ij = Log(R_jᵀ R_ij R_i)` a step
//! `R_i ← R_i Exp(δ_i)` solves, to first order,
//!
//! ```text
//! min  Σ w_ij ρ(‖δ_j − δ_i − ω_ij‖),
//! ```
//!
//! a weighted graph Laplacian with three right-hand sides. The initial guess is the spanning tree of the edges
//! confirmed by most triangles: around three correct edges the rotations multiply to the identity. The first
//! iterations take `ρ = |·|` (weights `1/‖ω‖`), which finds the majority from a poor initial guess; the last
//! iterations take Geman–McClure's `ρ` on the scale of the median residual, which rejects outliers completely. Gauge:
//! one camera is fixed at its rotation in the tree. The weight of an edge is multiplied by the fraction of its
//! triangles that close: the ends of a clip have few edges, and there a wrong majority would otherwise win.
//!
//! Departure from the paper: the ℓ₁ problem is solved by reweighted least squares instead of a linear program. The
//! Laplacian is factored densely: a window of a clip has tens to a few hundred cameras.
//!
//! # Reference
//! A. Chatterjee, V. Govindu, *Efficient and robust large-scale rotation averaging*, ICCV 2013, algorithms 1 to 3.

use nalgebra::{DMatrix, UnitQuaternion};

use plumbline_camera::Vec3;
use plumbline_num::math::median;
use plumbline_num::run::{Run, Stopped};

/// Maximum number of iterations with `ρ = |·|`.
const ABSOLUTE_ITERATIONS: usize = 60;

/// Maximum number of iterations with the Geman–McClure weight.
const REDESCENDING_ITERATIONS: usize = 30;

/// Residual, rad, below which `1/‖ω‖` is clamped: a thousandth of a degree, below the error of any measured rotation.
const MIN_RESIDUAL: f64 = 2e-5;

/// Scale of the Geman–McClure weight in standard deviations, estimated from the median residual.
const SCALE: f64 = 3.0;

/// Median length of a three-dimensional normal vector in standard deviations of one coordinate: the root of the median 2.366 of
/// χ² with three degrees of freedom.
const MEDIAN_LENGTH: f64 = 1.538;

/// Maximum angle, rad, between the product of the rotations around a triangle and the identity. Triangles of correct
/// edges are well below it, wrong ones are anywhere.
const MAX_TRIANGLE_ERROR: f64 = 0.04;

/// Step, rad, below which the iteration ends.
const TOLERANCE: f64 = 1e-12;

/// A measured relative rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotationEdge {
    /// Camera `i`.
    pub first: usize,
    /// Camera `j`.
    pub second: usize,
    /// `R_ij`, axes of the first camera to axes of the second.
    pub second_from_first: UnitQuaternion<f64>,
    /// Weight, > 0 (other edges are ignored).
    pub weight: f64,
}

/// Rotations of all connected cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct AveragedRotations {
    /// `cam_from_world` of each camera, the first connected one at the identity; `None` outside the largest connected
    /// component.
    pub rotations: Vec<Option<UnitQuaternion<f64>>>,
    /// Residual angle of each edge, rad; infinite for edges that were not used.
    pub residuals: Vec<f64>,
}

/// The robust average of the rotations over the `edges` between `cameras` cameras.
///
/// Edges to cameras that do not exist, of a camera with itself, or without weight are ignored.
///
/// # Errors
/// [`Stopped`].
pub fn average_rotations(cameras: usize, edges: &[RotationEdge], run: &Run) -> Result<AveragedRotations, Stopped> {
    let usable = |e: &RotationEdge| e.first < cameras && e.second < cameras && e.first != e.second && e.weight > 0.0;
    let confirmed = confirmations(cameras, edges, usable);
    let mut tree = spanning_tree(cameras, edges, &confirmed, usable);
    let weighted = |(e, c): (&RotationEdge, &Confirmation)| RotationEdge { weight: e.weight * c.confidence(), ..*e };
    let taking_part: Vec<RotationEdge> =
        edges.iter().zip(&confirmed).filter(|(e, _)| usable(e)).map(weighted).collect();
    let mut solver = Solver::new(&mut tree, taking_part);
    solver.iterate(ABSOLUTE_ITERATIONS, |_, r| 1.0 / r.max(MIN_RESIDUAL), run)?;
    solver.iterate(
        REDESCENDING_ITERATIONS,
        |sigma, r| {
            let scale = SCALE * sigma.max(MIN_RESIDUAL);
            let weight = scale * scale / (scale * scale + r * r);
            weight * weight
        },
        run,
    )?;
    let residual = |e: &RotationEdge| match (tree.get(e.first), tree.get(e.second)) {
        (Some(Some(a)), Some(Some(b))) if usable(e) => edge_residual(a, b, e).norm(),
        _ => f64::INFINITY,
    };
    Ok(AveragedRotations { residuals: edges.iter().map(residual).collect(), rotations: tree })
}

/// `Log(R_jᵀ R_ij R_i)`.
fn edge_residual(first: &UnitQuaternion<f64>, second: &UnitQuaternion<f64>, edge: &RotationEdge) -> Vec3 {
    (second.inverse() * edge.second_from_first * first).scaled_axis()
}

/// Triangle statistics of one edge.
#[derive(Clone, Copy, Debug, Default)]
struct Confirmation {
    /// Triangles that contain the edge.
    triangles: u32,
    /// Triangles around which the rotations multiply to the identity.
    closing: u32,
}

impl Confirmation {
    /// Fraction of the triangles that close, with one more counted as closing, so that an edge without triangles has
    /// full weight.
    fn confidence(self) -> f64 {
        f64::from(1 + self.closing) / f64::from(1 + self.triangles)
    }
}

fn confirmations(cameras: usize, edges: &[RotationEdge], usable: impl Fn(&RotationEdge) -> bool) -> Vec<Confirmation> {
    let mut leaving: Vec<Vec<(usize, UnitQuaternion<f64>)>> = vec![Vec::new(); cameras];
    for e in edges.iter().filter(|e| usable(e)) {
        leaving[e.first].push((e.second, e.second_from_first));
        leaving[e.second].push((e.first, e.second_from_first.inverse()));
    }
    let confirmed = |e: &RotationEdge| {
        let mut found = Confirmation::default();
        if !usable(e) {
            return found;
        }
        let detours = leaving[e.first].iter().flat_map(|(via, via_from_first)| {
            let onward = leaving[*via].iter().filter(|(to, _)| *to == e.second);
            onward.map(move |(_, second_from_via)| second_from_via * via_from_first)
        });
        for detour in detours {
            found.triangles += 1;
            found.closing += u32::from(detour.angle_to(&e.second_from_first) < MAX_TRIANGLE_ERROR);
        }
        found
    };
    edges.iter().map(confirmed).collect()
}

/// Rotations along the maximum spanning tree (by number of closing triangles, then weight) of the largest connected
/// component, whose first camera is at the identity.
fn spanning_tree(
    cameras: usize,
    edges: &[RotationEdge],
    confirmed: &[Confirmation],
    usable: impl Fn(&RotationEdge) -> bool,
) -> Vec<Option<UnitQuaternion<f64>>> {
    // Kruskal: edges in descending order of closing triangles, then weight; an edge within a component is skipped.
    let mut order: Vec<usize> = (0..edges.len()).filter(|&k| usable(&edges[k])).collect();
    let rank = |a: usize, b: usize| edges[b].weight.total_cmp(&edges[a].weight).then(a.cmp(&b));
    order.sort_by(|&a, &b| confirmed[b].closing.cmp(&confirmed[a].closing).then_with(|| rank(a, b)));
    let mut part: Vec<usize> = (0..cameras).collect();
    let mut neighbors = vec![Vec::new(); cameras];
    for k in order {
        let (a, b) = (part[edges[k].first], part[edges[k].second]);
        if a != b {
            part.iter_mut().filter(|p| **p == b).for_each(|p| *p = a);
            neighbors[edges[k].first].push(k);
            neighbors[edges[k].second].push(k);
        }
    }
    let size = |camera: usize| part.iter().filter(|p| **p == part[camera]).count();
    let mut rotations = vec![None; cameras];
    // The first camera of the largest component.
    let Some(root) = (0..cameras).rev().max_by_key(|&c| size(c)) else { return rotations };
    rotations[root] = Some(UnitQuaternion::identity());
    // Chain the relative rotations from the root along the tree.
    let mut stack = vec![(root, UnitQuaternion::identity())];
    while let Some((here, rotation)) = stack.pop() {
        for &k in &neighbors[here] {
            let e = &edges[k];
            let (there, relative) = if e.first == here {
                (e.second, e.second_from_first)
            } else {
                (e.first, e.second_from_first.inverse())
            };
            if rotations[there].is_none() {
                rotations[there] = Some(relative * rotation);
                stack.push((there, relative * rotation));
            }
        }
    }
    rotations
}

struct Solver<'a> {
    rotations: &'a mut [Option<UnitQuaternion<f64>>],
    edges: Vec<RotationEdge>,
    /// Row of each camera in the system; the first known camera is fixed and has none.
    row: Vec<Option<usize>>,
    unknowns: usize,
}

impl<'a> Solver<'a> {
    /// `edges` to cameras with unknown rotation are ignored.
    fn new(rotations: &'a mut [Option<UnitQuaternion<f64>>], mut edges: Vec<RotationEdge>) -> Self {
        edges.retain(|e| rotations[e.first].is_some() && rotations[e.second].is_some());
        let mut known = 0;
        let row = rotations.iter().map(|r| {
            r.as_ref()?;
            known += 1;
            (known > 1).then(|| known - 2)
        });
        let row: Vec<Option<usize>> = row.collect();
        Self { rotations, edges, row, unknowns: known.max(1) - 1 }
    }

    fn residuals(&self) -> Vec<Vec3> {
        let rotation = |camera: usize| self.rotations[camera].expect("edges between known cameras only take part");
        self.edges.iter().map(|e| edge_residual(&rotation(e.first), &rotation(e.second), e)).collect()
    }

    /// Reweighted least-squares iterations; `weight` is a function of a residual and the standard deviation of the
    /// residuals per axis, rad.
    fn iterate(&mut self, count: usize, weight: impl Fn(f64, f64) -> f64, run: &Run) -> Result<(), Stopped> {
        if self.unknowns == 0 {
            return Ok(());
        }
        for _ in 0..count {
            run.check()?;
            let residuals = self.residuals();
            let mut lengths: Vec<f64> = residuals.iter().map(Vec3::norm).collect();
            let Some(middle) = median(&mut lengths.clone()) else { break };
            let sigma = middle / MEDIAN_LENGTH;
            let weights: Vec<f64> =
                lengths.drain(..).zip(&self.edges).map(|(r, e)| e.weight * weight(sigma, r)).collect();
            let Some(largest) = self.step(&residuals, &weights) else { break };
            if largest < TOLERANCE {
                break;
            }
        }
        Ok(())
    }

    /// Updates every rotation by the solution of the weighted Laplacian; returns the largest update, rad.
    fn step(&mut self, residuals: &[Vec3], weights: &[f64]) -> Option<f64> {
        let mut laplacian = DMatrix::<f64>::zeros(self.unknowns, self.unknowns);
        let mut rhs = DMatrix::<f64>::zeros(self.unknowns, 3);
        for ((edge, r), &w) in self.edges.iter().zip(residuals).zip(weights) {
            let (i, j) = (self.row[edge.first], self.row[edge.second]);
            for (row, sign) in [(i, -1.0), (j, 1.0)] {
                let Some(row) = row else { continue };
                laplacian[(row, row)] += w;
                for axis in 0..3 {
                    rhs[(row, axis)] += sign * w * r[axis];
                }
            }
            if let (Some(i), Some(j)) = (i, j) {
                laplacian[(i, j)] -= w;
                laplacian[(j, i)] -= w;
            }
        }
        let solved = laplacian.cholesky()?.solve(&rhs);
        let mut largest = 0.0_f64;
        for (rotation, row) in self.rotations.iter_mut().zip(&self.row) {
            if let (Some(rotation), Some(row)) = (rotation, row) {
                let delta = Vec3::new(solved[(*row, 0)], solved[(*row, 1)], solved[(*row, 2)]);
                largest = largest.max(delta.norm());
                let next = *rotation * UnitQuaternion::from_scaled_axis(delta);
                *rotation = UnitQuaternion::new_normalize(next.into_inner());
            }
        }
        Some(largest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::tests::synthetic_views::{normal, random_unit};

    /// A clip of a rotating camera with relative rotations at offsets 1, 2, 3, 5, 8. The given fraction of them is
    /// random, except that three edges at every camera are correct: with fewer no majority identifies them.
    fn clip(n: usize, noise: f64, wrong: f64, seed: u64) -> (Vec<UnitQuaternion<f64>>, Vec<RotationEdge>, Vec<bool>) {
        let mut rng = fastrand::Rng::with_seed(seed);
        let truth: Vec<_> = (0..n)
            .map(|k| UnitQuaternion::from_scaled_axis(Vec3::new(0.02 * k as f64, 0.1 * (k as f64).sin(), 0.05)))
            .collect();
        let (mut edges, mut right) = (Vec::new(), Vec::new());
        let ends: Vec<_> = (0..n).flat_map(|i| [1, 2, 3, 5, 8].map(|o| (i, o))).filter(|(i, o)| i + o < n).collect();
        let mut left = vec![0; n];
        for (i, o) in &ends {
            left[*i] += 1;
            left[i + o] += 1;
        }
        for (i, offset) in ends {
            let is_right = rng.f64() >= wrong || left[i] <= 3 || left[i + offset] <= 3;
            if !is_right {
                left[i] -= 1;
                left[i + offset] -= 1;
            }
            let error = if is_right {
                Vec3::from_fn(|_, _| normal(&mut rng)) * noise
            } else {
                random_unit(&mut rng) * (0.2 + 2.0 * rng.f64())
            };
            let second_from_first = UnitQuaternion::from_scaled_axis(error) * truth[i + offset] * truth[i].inverse();
            edges.push(RotationEdge { first: i, second: i + offset, second_from_first, weight: 1.0 });
            right.push(is_right);
        }
        (truth, edges, right)
    }

    fn worst(found: &AveragedRotations, truth: &[UnitQuaternion<f64>]) -> f64 {
        let aligned = found.rotations.iter().zip(truth).map(|(r, t)| {
            let world = found.rotations[0].expect("connected").inverse() * truth[0];
            (r.expect("connected") * world).angle_to(t)
        });
        aligned.fold(0.0, f64::max)
    }

    #[test]
    fn exact_edges_give_exact_rotations_though_a_fifth_is_wrong() {
        for seed in 0..10 {
            let (truth, edges, right) = clip(40, 0.0, 0.2, seed);
            let found = average_rotations(40, &edges, &Run::default()).expect("a run that never stops");
            assert!(worst(&found, &truth) < 1e-6, "seed {seed}: {}", worst(&found, &truth));
            assert!(found.residuals.iter().zip(&right).all(|(r, right)| (*r < 1e-5) == *right));
        }
    }

    #[test]
    fn noise_is_averaged_and_outliers_are_forgotten() {
        let noise = 0.1_f64.to_radians();
        for seed in 0..10 {
            let (truth, edges, _) = clip(60, noise, 0.2, seed);
            let with = worst(&average_rotations(60, &edges, &Run::default()).expect("a run that never stops"), &truth);
            let (truth, edges, _) = clip(60, noise, 0.0, seed);
            let without =
                worst(&average_rotations(60, &edges, &Run::default()).expect("a run that never stops"), &truth);
            // Errors accumulate along the clip: 60 steps, each averaged over about four edges, in three axes.
            let expected = noise * (3.0_f64 * 60.0).sqrt();
            assert!(with < expected && without < expected, "seed {seed}: {with} with, {without} without outliers");
        }
    }

    #[test]
    fn unconnected_cameras_are_unknown_and_bad_edges_take_no_part() {
        let (_, mut edges, _) = clip(10, 0.0, 0.0, 1);
        edges.push(RotationEdge { first: 3, second: 99, ..edges[0] });
        edges.push(RotationEdge { first: 10, second: 11, ..edges[0] });
        edges.push(RotationEdge { weight: f64::NAN, ..edges[0] });
        let found = average_rotations(12, &edges, &Run::default()).expect("a run that never stops");
        assert!(found.rotations[..10].iter().all(Option::is_some) && found.rotations[10..].iter().all(Option::is_none));
        assert!(found.residuals[edges.len() - 3..].iter().all(|r| r.is_infinite()));
        assert!(average_rotations(0, &[], &Run::default()).expect("a run that never stops").rotations.is_empty());
        assert_eq!(
            average_rotations(1, &[], &Run::default()).expect("a run that never stops").rotations,
            vec![Some(UnitQuaternion::identity())]
        );
    }

    #[test]
    fn the_answer_does_not_depend_on_the_order_of_equal_runs() {
        let (_, edges, _) = clip(30, 0.01, 0.2, 4);
        assert_eq!(
            average_rotations(30, &edges, &Run::default()).expect("a run that never stops"),
            average_rotations(30, &edges, &Run::default()).expect("a run that never stops")
        );
    }
}
