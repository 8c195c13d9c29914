//! Bounded biharmonic weights, on the surface:
//!
//! ```text
//! min  Σⱼ ½ wⱼᵀ Q wⱼ      s.t.  w ≥ 0,  Σⱼ wⱼ = 1,  wⱼ(a) = p_j(a) at the anchors a        Q = L M⁻¹ L
//! ```
//!
//! Anchors are the vertices whose nearest visible bone is met near its middle: there the surface goes rigidly with it. Between
//! them weights are as smooth as the bounds allow. The paper solves in the volume and for one joint after the other, and divides
//! by the sums; on the surface no volume is needed (open surfaces do), and all joints are solved at once with their sum held.
//!
//! The alternating direction method of multipliers splits the smooth from the bounded copy, `w = z`:
//!
//! ```text
//! wⱼ ← (Q + ρ M)⁻¹ (ρ M (zⱼ − uⱼ))         one factor for all joints and rounds; anchors eliminated
//! z  ← the nearest point of the simplex to w + u      vertex by vertex
//! u  ← u + w − z
//! ```
//!
//! with `w` over-relaxed. `ρ` is in units of the fourth power of an inverse length: what is smoother than that length converges
//! first; it starts from bone heat, which is smooth on longer ones already.
//!
//! # Reference
//! A. Jacobson, I. Baran, J. Popović, O. Sorkine, *Bounded biharmonic weights for real-time deformation*, ACM TOG 30 (2011);
//! S. Boyd, N. Parikh, E. Chu, B. Peleato, J. Eckstein, *Distributed optimization and statistical learning via ADMM*, 2011.

use super::super::{Bone, CharacterError};
use super::bone_distance::nearest;
use super::heat::{Source, sources};
use super::welded::Welded;
use super::{Row, WeightReport, heat};
use crate::mesh::operators::{CotangentRule, Cotangents, EdgeWeights, barycentric_areas};
use crate::sparse::{Cholesky, CompactFactor, Ordering, SparseError, SparseMatrix};

/// The part of a bone about its middle that holds the surface.
const ANCHOR: std::ops::RangeInclusive<f64> = 0.4..=0.6;
/// Rounds at most: residuals fall by about a tenth in thirty.
const ROUNDS: usize = 400;
/// Both copies agree to this: below what is pruned.
const TOLERANCE: f64 = 1e-4;
/// Over-relaxation, as Boyd et al. advise.
const RELAXATION: f64 = 1.6;
/// Length of `ρ^(−1/4)`, in diagonals.
const LENGTH: f64 = 0.03;
/// Weights below this are left out of rows.
const COLD: f64 = 1e-6;
/// Half cotangents at most: squared, they make 10⁶ beside 1.
const LARGEST: f64 = 1e3;
/// Vertex areas at least, in parts of the mean.
const LEAST_AREA: f64 = 1e-4;

/// A row for each welded vertex; empty where its piece has no anchor.
pub(super) fn rows(
    welded: &Welded,
    bones: &[Bone],
    joints: usize,
    report: &mut WeightReport,
) -> Result<Vec<Row>, CharacterError> {
    let start = heat::rows(welded, bones, joints)?;
    let sources = sources(welded, bones);
    let system = System::new(welded, &anchors(welded, bones, &sources))?;
    let Some(system) = system else { return Ok(start) };
    let mut used: Vec<u32> = bones.iter().map(|b| b.joint).collect();
    used.dedup();
    let mut rows = start;
    system.solve(&used, &mut rows, report);
    Ok(rows)
}

/// The joint that each vertex is held by, if any.
fn anchors(welded: &Welded, bones: &[Bone], sources: &[Source]) -> Vec<Option<u32>> {
    let anchor = |(p, source): (&nalgebra::Point3<f64>, &Source)| {
        let [bone] = source.bones[..] else { return None };
        let (_, _, t) = nearest(&bones[bone as usize], p);
        (ANCHOR.contains(&t) || bones[bone as usize].child.is_none()).then_some(bones[bone as usize].joint)
    };
    welded.positions().iter().zip(sources).map(anchor).collect()
}

/// `Q + ρ M` over the free vertices of pieces that are anchored.
struct System {
    free: Vec<usize>,
    /// `(unknown, joint, −Q_ua)` of free vertices beside anchors.
    pull: Vec<(u32, u32, f64)>,
    anchored: Vec<(usize, u32)>,
    /// `ρ M`.
    mass: Vec<f64>,
    factor: CompactFactor,
}

impl System {
    /// `None` where nothing is free.
    fn new(welded: &Welded, anchors: &[Option<u32>]) -> Result<Option<Self>, SparseError> {
        let mesh = welded.mesh();
        let mut held = vec![false; anchors.len() + 1];
        for (v, _) in anchors.iter().enumerate().filter(|(_, a)| a.is_some()) {
            let piece = welded.piece_of(v) as usize;
            held[piece] = piece < welded.piece_count();
        }
        let is_free = |v: &usize| anchors[*v].is_none() && held[welded.piece_of(*v) as usize];
        let free: Vec<usize> = (0..anchors.len()).filter(is_free).collect();
        if free.is_empty() {
            return Ok(None);
        }
        let mut number = vec![u32::MAX; anchors.len()];
        free.iter().zip(0..).for_each(|(&v, u)| number[v] = u);
        let cotangents = Cotangents::new(mesh, CotangentRule::IntrinsicDelaunay).limited(LARGEST);
        let areas = barycentric_areas(mesh);
        let mean = areas.iter().sum::<f64>() / areas.len() as f64;
        let areas: Vec<f64> = areas.iter().map(|a| a.max(LEAST_AREA * mean)).collect();
        let inverse: Vec<f64> = areas.iter().map(|a| 1.0 / a).collect();
        let edges = EdgeWeights::cotangent(mesh.vertex_count(), &cotangents).squared(&inverse);
        let rho = (LENGTH * mesh.diagonal()).powi(-4);
        let mass: Vec<f64> = free.iter().map(|&v| rho * areas[v]).collect();
        let mut triplets: Vec<(usize, usize, f64)> = mass.iter().enumerate().map(|(u, m)| (u, u, *m)).collect();
        let mut pull = Vec::new();
        for (i, j, w) in edges.iter() {
            for (a, b) in [(i, j), (j, i)] {
                let u = number[a];
                if u == u32::MAX {
                    continue;
                }
                triplets.push((u as usize, u as usize, w));
                match anchors[b] {
                    Some(joint) => pull.push((u, joint, w)),
                    None if number[b] < u => triplets.push((u as usize, number[b] as usize, -w)),
                    None => {}
                }
            }
        }
        let matrix = SparseMatrix::from_triplets(free.len(), &triplets)?;
        let mut cholesky = Cholesky::analyze(matrix.pattern(), &Ordering::Amd)?;
        cholesky.factor(&matrix)?;
        let anchored = anchors.iter().enumerate().filter_map(|(v, a)| a.map(|j| (v, j))).collect();
        Ok(Some(Self { free, pull, anchored, mass, factor: CompactFactor::new(&cholesky) }))
    }

    /// Solves for the joints `used`, from `rows` on.
    fn solve(mut self, used: &[u32], rows: &mut [Row], report: &mut WeightReport) {
        let (n, k) = (self.free.len(), used.len());
        let place = |joint: u32| used.binary_search(&joint).expect("a joint of a bone");
        // Joint by joint, so that each is one right-hand side.
        let mut z = vec![0.0; n * k];
        for (u, &v) in self.free.iter().enumerate() {
            rows[v].iter().for_each(|&(j, w)| z[place(j) * n + u] = w);
        }
        let mut dual = vec![0.0; n * k];
        let mut given = vec![0.0; n * k];
        self.pull.iter().for_each(|&(u, j, w)| given[place(j) * n + u as usize] += w);
        let mut w = vec![0.0; n * k];
        for round in 0..ROUNDS {
            for (i, x) in w.iter_mut().enumerate() {
                *x = given[i] + self.mass[i % n] * (z[i] - dual[i]);
            }
            self.factor.solve_columns(&mut w);
            let (apart, moved) = project(n, k, &w, &mut z, &mut dual);
            report.iterations = round + 1;
            report.residual = apart.max(moved);
            if report.residual < TOLERANCE {
                break;
            }
        }
        for (u, &v) in self.free.iter().enumerate() {
            rows[v] = (0..k).map(|c| (used[c], z[c * n + u])).filter(|r| r.1 > COLD).collect();
        }
        for &(v, joint) in &self.anchored {
            rows[v] = vec![(joint, 1.0)];
        }
    }
}

/// `z` and the multipliers from `w`; how far the copies are apart, and how far `z` moved.
fn project(n: usize, k: usize, w: &[f64], z: &mut [f64], dual: &mut [f64]) -> (f64, f64) {
    let (mut apart, mut moved) = (0.0_f64, 0.0_f64);
    let mut point = vec![0.0; k];
    for u in 0..n {
        for (c, p) in point.iter_mut().enumerate() {
            let i = c * n + u;
            *p = RELAXATION * w[i] + (1.0 - RELAXATION) * z[i] + dual[i];
        }
        let raised = onto_simplex(&point);
        for (c, p) in point.iter().enumerate() {
            let i = c * n + u;
            let next = (p - raised).max(0.0);
            dual[i] = p - next;
            apart = apart.max((w[i] - next).abs());
            moved = moved.max((z[i] - next).abs());
            z[i] = next;
        }
    }
    (apart, moved)
}

/// The level to subtract so that what stays above 0 sums to 1.
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
