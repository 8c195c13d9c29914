//! Bounded biharmonic weights, on the surface:
//!
//! ```text
//! min  Σⱼ ½ wⱼᵀ Q wⱼ      s.t.  w ≥ 0,  Σⱼ wⱼ = 1,  wⱼ(a) = p_j(a) at the anchors a        Q = L M⁻¹ L
//! ```
//!
//! Anchors are the vertices whose nearest visible bone point is near the middle of the bone; there the surface moves rigidly with the
//! joint. Between anchors the weights are as smooth as the bounds allow. Departures: the paper solves in the volume, joint by joint, and
//! normalizes afterwards; on the surface no tetrahedral mesh is needed (open surfaces work), and all joints are solved together under the
//! partition-of-unity constraint.
//!
//! The alternating direction method of multipliers (ADMM) splits the smooth copy from the bounded copy, `w = z`:
//!
//! ```text
//! wⱼ ← (Q + ρ M)⁻¹ (ρ M (zⱼ − uⱼ))         one factorization for all joints and iterations; anchors eliminated
//! z  ← projection of w + u onto the simplex   vertex by vertex
//! u  ← u + w − z
//! ```
//!
//! with over-relaxed `w`. `ρ` has the unit of an inverse length to the fourth power: modes smoother than that length are slow to leave
//! the initial guess, rougher ones slow to reach consensus. `ρ` is adapted by the ratio of the residuals; a factorization costs as much as
//! a few iterations. The initial guess is bone heat.
//!
//! # Reference
//! A. Jacobson, I. Baran, J. Popović, O. Sorkine, *Bounded biharmonic weights for real-time deformation*, ACM TOG 30 (2011);
//! S. Boyd, N. Parikh, E. Chu, B. Peleato, J. Eckstein, *Distributed optimization and statistical learning via ADMM*, 2011;
//! B. Stellato et al., *OSQP: an operator splitting solver for quadratic programs*, 2020, section 5.2 (the rule for `ρ`).

use super::super::{Bone, CharacterError};
use super::bone_distance::nearest;
use super::heat::{Source, sources};
use super::welded::Welded;
use super::{Row, WeightReport, heat};
use crate::mesh::operators::{CotangentRule, Cotangents, EdgeWeights, barycentric_areas, max_multiplications};
use plumbline_num::energy::ConstrainedLaplacian;
use plumbline_num::run::Run;
use plumbline_num::sparse::{Cholesky, CompactFactor, Ordering, SparseError, SparseMatrix};

/// Range of the bone parameter whose vertices are anchors: the middle fifth of each bone.
const ANCHOR: std::ops::RangeInclusive<f64> = 0.4..=0.6;
/// Largest number of iterations: five joints converge in 300, sixty with fingers in 1100.
const MAX_ITERATIONS: usize = 2000;
/// Largest difference of the two copies at convergence: below the weights that are pruned (1e-3).
const TOLERANCE: f64 = 1e-4;
/// Over-relaxation factor; Boyd et al. recommend 1.5 to 1.8.
const RELAXATION: f64 = 1.6;
/// Length whose inverse fourth power is the initial `ρ`, in bounding-box diagonals; adapted from there.
const INITIAL_LENGTH: f64 = 0.03;
/// Iterations between updates of `ρ`: an update costs a factorization, as much as a few iterations.
const UPDATE_INTERVAL: usize = 10;
/// `ρ` is updated if its target differs by more than this factor.
const UPDATE_FACTOR: f64 = 2.0;
/// Weights below this are dropped from rows: far below [`TOLERANCE`].
const MIN_KEPT_WEIGHT: f64 = 1e-6;
/// Upper bound of half cotangents: squared in `Q`, they reach 10⁶ beside 1.
const MAX_COTANGENT: f64 = 1e3;
/// Lower bound of vertex areas, as a fraction of the mean: `Q` divides by them.
const MIN_AREA: f64 = 1e-4;

/// One row per welded vertex; empty if its component has no anchor.
pub(super) fn rows(
    welded: &Welded,
    bones: &[Bone],
    joints: usize,
    report: &mut WeightReport,
    run: &Run,
) -> Result<Vec<Row>, CharacterError> {
    let start = heat::rows(welded, bones, joints, run)?;
    let sources = sources(welded, bones, run)?;
    let system = System::new(welded, &anchors(welded, bones, &sources), run)
        .map_err(|error| CharacterError::of_system(error, "take heat weights"))?;
    let Some(system) = system else { return Ok(start) };
    let mut used: Vec<u32> = bones.iter().map(|b| b.joint).collect();
    used.dedup();
    let mut rows = start;
    system.solve(&used, &mut rows, report, run)?;
    Ok(rows)
}

/// The joint of each anchor vertex.
fn anchors(welded: &Welded, bones: &[Bone], sources: &[Source]) -> Vec<Option<u32>> {
    let anchor = |(p, source): (&nalgebra::Point3<f64>, &Source)| {
        let [bone] = source.bones[..] else { return None };
        let (_, _, t) = nearest(&bones[bone as usize], p);
        (ANCHOR.contains(&t) || bones[bone as usize].child.is_none()).then_some(bones[bone as usize].joint)
    };
    welded.positions().iter().zip(sources).map(anchor).collect()
}

/// The system `Q + ρ M` over the free vertices of components with anchors.
struct System {
    free: Vec<usize>,
    /// `(unknown, joint, −Q_ua)` of free vertices adjacent to anchors.
    pull: Vec<(u32, u32, f64)>,
    anchored: Vec<(usize, u32)>,
    smoothness: SparseMatrix,
    mass: Vec<f64>,
    /// In units of an inverse length to the fourth power.
    rho: f64,
    cholesky: Cholesky,
    factor: CompactFactor,
}

impl System {
    /// `None` if no vertex is free.
    fn new(welded: &Welded, anchors: &[Option<u32>], run: &Run) -> Result<Option<Self>, SparseError> {
        let mesh = welded.mesh();
        let free = free_vertices(welded, anchors);
        if free.is_empty() {
            return Ok(None);
        }
        run.check()?;
        let cotangents = Cotangents::new(mesh, CotangentRule::IntrinsicDelaunay).limited(MAX_COTANGENT);
        // Q = L M⁻¹ L over the free vertices; columns of anchors move to the right-hand side.
        let areas = barycentric_areas(mesh);
        let mean = areas.iter().sum::<f64>() / areas.len() as f64;
        let areas: Vec<f64> = areas.iter().map(|a| a.max(MIN_AREA * mean)).collect();
        let inverse: Vec<f64> = areas.iter().map(|a| 1.0 / a).collect();
        let edges = EdgeWeights::cotangent(mesh.vertex_count(), &cotangents).squared(&inverse)?;
        let laplacian = ConstrainedLaplacian::new(anchors.len(), edges.iter(), |v| free.binary_search(&v).is_err())?;
        let anchored = |&(u, v, w): &(u32, u32, f64)| anchors[v as usize].map(|joint| (u, joint, w));
        let pull = laplacian.coupling().iter().filter_map(anchored).collect();
        let smoothness = laplacian.matrix().clone();
        let mass: Vec<f64> = free.iter().map(|&v| areas[v]).collect();
        let rho = (INITIAL_LENGTH * mesh.diagonal()).powi(-4);
        run.check()?;
        let most = max_multiplications(smoothness.n());
        let mut cholesky = Cholesky::analyze_within(smoothness.pattern(), &Ordering::Amd, most)?;
        cholesky.factor(&regularized(&smoothness, &mass, rho), run)?;
        let factor = CompactFactor::new(&cholesky);
        let anchored = anchors.iter().enumerate().filter_map(|(v, a)| a.map(|j| (v, j))).collect();
        Ok(Some(Self { free, pull, anchored, smoothness, mass, rho, cholesky, factor }))
    }

    fn set_rho(&mut self, rho: f64, run: &Run) -> Result<(), SparseError> {
        self.rho = rho;
        self.cholesky.factor(&regularized(&self.smoothness, &self.mass, rho), run)?;
        self.factor.refill(&self.cholesky);
        Ok(())
    }

    /// Runs ADMM for the joints `used`, with `rows` as the initial guess.
    fn solve(
        mut self,
        used: &[u32],
        rows: &mut [Row],
        report: &mut WeightReport,
        run: &Run,
    ) -> Result<(), SparseError> {
        let n = self.free.len();
        let column = |joint: u32| used.binary_search(&joint).expect("a joint of a bone");
        let mut copies = Copies::new(n, used.len());
        for (u, &v) in self.free.iter().enumerate() {
            rows[v].iter().for_each(|&(j, w)| copies.bounded[column(j) * n + u] = w);
        }
        let mut given = vec![0.0; copies.bounded.len()];
        self.pull.iter().for_each(|&(u, j, w)| given[column(j) * n + u as usize] += w);
        for iteration in 1..=MAX_ITERATIONS {
            run.step((iteration - 1) as f64 / MAX_ITERATIONS as f64)?;
            for (i, x) in copies.smooth.iter_mut().enumerate() {
                *x = given[i] + self.rho * self.mass[i % n] * (copies.bounded[i] - copies.dual[i]);
            }
            self.factor.solve_columns(&mut copies.smooth);
            let step = copies.project(&self.mass);
            (report.iterations, report.residual) = (iteration, step.apart.max(step.moved));
            if report.residual < TOLERANCE {
                break;
            }
            let change = step.change_of_rho();
            if iteration % UPDATE_INTERVAL == 0 && !(1.0 / UPDATE_FACTOR..=UPDATE_FACTOR).contains(&change) {
                self.set_rho(self.rho * change, run)?;
                copies.dual.iter_mut().for_each(|u| *u /= change);
            }
        }
        for (u, &v) in self.free.iter().enumerate() {
            rows[v] = (0..used.len())
                .map(|c| (used[c], copies.bounded[c * n + u]))
                .filter(|r| r.1 > MIN_KEPT_WEIGHT)
                .collect();
        }
        for &(v, joint) in &self.anchored {
            rows[v] = vec![(joint, 1.0)];
        }
        Ok(())
    }
}

/// Vertices that are not anchors, of components with anchors.
fn free_vertices(welded: &Welded, anchors: &[Option<u32>]) -> Vec<usize> {
    let mut anchored = vec![false; anchors.len()];
    for (v, _) in anchors.iter().enumerate().filter(|(_, a)| a.is_some()) {
        anchored[welded.piece_of(v) as usize] = !welded.is_isolated(v);
    }
    (0..anchors.len()).filter(|&v| anchors[v].is_none() && anchored[welded.piece_of(v) as usize]).collect()
}

/// `Q + ρ M`.
fn regularized(smoothness: &SparseMatrix, mass: &[f64], rho: f64) -> SparseMatrix {
    let mut matrix = smoothness.clone();
    let starts = matrix.pattern().clone();
    for (j, m) in mass.iter().enumerate() {
        // The diagonal entry is the first of its column.
        matrix.values_mut()[starts.column(j).start] += rho * m;
    }
    matrix
}

/// The variables of ADMM, joint by joint, so that each joint is one right-hand side.
struct Copies {
    unknowns: usize,
    /// `w`
    smooth: Vec<f64>,
    /// `z`
    bounded: Vec<f64>,
    /// `u`
    dual: Vec<f64>,
}

/// Residuals of an iteration.
#[derive(Default)]
struct Step {
    /// `max |w − z|`
    apart: f64,
    /// `max |Δz|`
    moved: f64,
    /// `‖w − z‖²`, `‖z‖²`, `‖Δz‖²`, `‖u‖²`, weighted by area.
    squares: [f64; 4],
}

impl Step {
    /// The factor for `ρ` that would balance the relative primal and dual residuals.
    fn change_of_rho(&self) -> f64 {
        let [apart, bounded, moved, dual] = self.squares;
        let ratio = (apart * dual) / (bounded * moved);
        if ratio > 0.0 && ratio.is_finite() { ratio.sqrt().sqrt() } else { 1.0 }
    }
}

impl Copies {
    fn new(unknowns: usize, joints: usize) -> Self {
        let zeros = vec![0.0; unknowns * joints];
        Self { unknowns, smooth: zeros.clone(), bounded: zeros.clone(), dual: zeros }
    }

    /// Updates `z` by projection, and the multipliers `u`.
    fn project(&mut self, mass: &[f64]) -> Step {
        let n = self.unknowns;
        let mut step = Step::default();
        let mut point = vec![0.0; self.bounded.len() / n];
        for (u, m) in mass.iter().enumerate() {
            for (c, p) in point.iter_mut().enumerate() {
                let i = c * n + u;
                *p = RELAXATION * self.smooth[i] + (1.0 - RELAXATION) * self.bounded[i] + self.dual[i];
            }
            let raised = onto_simplex(&point);
            for (c, p) in point.iter().enumerate() {
                let i = c * n + u;
                let next = (p - raised).max(0.0);
                let (apart, moved) = (self.smooth[i] - next, self.bounded[i] - next);
                (self.dual[i], self.bounded[i]) = (p - next, next);
                (step.apart, step.moved) = (step.apart.max(apart.abs()), step.moved.max(moved.abs()));
                let squares = [apart, next, moved, p - next];
                step.squares.iter_mut().zip(squares).for_each(|(sum, x)| *sum += m * x * x);
            }
        }
        step
    }
}

/// The threshold to subtract so that the positive parts sum to 1: projection onto the probability simplex.
///
/// J. Duchi, S. Shalev-Shwartz, Y. Singer, T. Chandra, *Efficient projections onto the ℓ1-ball*, ICML 2008.
pub(super) fn onto_simplex(point: &[f64]) -> f64 {
    let mut sorted = point.to_vec();
    sorted.sort_unstable_by(|a, b| b.total_cmp(a));
    let (mut sum, mut level) = (0.0, 0.0);
    for (count, p) in (1..).zip(&sorted) {
        sum += p;
        let of_these = (sum - 1.0) / f64::from(count);
        if *p <= of_these {
            break;
        }
        level = of_these;
    }
    level
}
