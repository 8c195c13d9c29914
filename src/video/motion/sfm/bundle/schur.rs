//! Schur complement: elimination of the points, and the solution of the reduced system.
//!
//! ```text
//! C + λ D = L Lᵀ,   V = W L⁻ᵀ,   z = L⁻¹ g,      S = A + λ D − V Vᵀ,   S δ_c = −b + V z,   δ_p = −L⁻ᵀ(z + L⁻¹ Wᵀ δ_c)
//! ```
//!
//! `V Vᵀ` is accumulated over batches of points with nearly the same frames, as a product of dense matrices, and in
//! parallel over the parts of the tracks.

use nalgebra::{Cholesky, Const, Matrix3};
use rayon::prelude::*;

use super::layout::{Layout, POSE};
use super::normal::Normal;
use super::parameters::{LN_FOCAL, SHARED};
use plumbline_camera::Vec3;
use plumbline_num::sparse::{BandedMatrix, SparseError};

/// Maximum number of points per batch: a product of rank 48 uses the dense kernel fully, and its rows stay in the
/// cache.
const BATCH: usize = 16;
/// Maximum ratio of the slots of a batch, padding included, to the slots of its longest track.
const SLACK: f64 = 1.2;
/// Minimum diagonal entry in the damping term, relative to the largest of its kind. Without it, unknowns that are
/// hardly observed would be undamped at any `λ` and take arbitrarily long steps.
const MIN_DIAGONAL: f64 = 1e-9;

/// Damping under which variances are computed: far below the information of the observations, enough to constrain
/// unobserved unknowns.
const NEARLY_NONE: f64 = 1e-9;

/// The reduced system and its buffers.
#[derive(Clone, Debug)]
pub(super) struct Reduced {
    system: BandedMatrix,
    /// Step of poses and shared unknowns.
    pub(super) delta: Vec<f64>,
    /// Step of each point.
    pub(super) points: Vec<Vec3>,
    factors: Vec<Option<Factor>>,
    gains: Vec<f64>,
    parts: Vec<Part>,
    /// Minimum diagonal entries: rotations, translations, each shared unknown, ray, inverse depth.
    floors: Floors,
}

type Factor = Cholesky<f64, Const<3>>;

/// What the eliminated points of one part subtract from the system.
#[derive(Clone, Debug)]
struct Part {
    /// `−V Vᵀ`.
    system: BandedMatrix,
    /// `V z`.
    delta: Vec<f64>,
    v: Vec<f64>,
    v_border: Vec<f64>,
    batches: Vec<Batch>,
}

#[derive(Clone, Debug)]
struct Batch {
    tracks: std::ops::Range<usize>,
    slots: std::ops::Range<usize>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Floors {
    rotation: f64,
    shift: f64,
    ray: f64,
    depth: f64,
}

impl Reduced {
    pub(super) fn new(layout: &Layout, normal: &Normal) -> Self {
        Self {
            system: normal.a.clone(),
            delta: vec![0.0; layout.unknowns()],
            points: vec![Vec3::zeros(); layout.tracks.len()],
            factors: vec![None; layout.tracks.len()],
            gains: vec![0.0; layout.tracks.len()],
            parts: layout.parts().into_iter().map(|tracks| Part::new(layout, tracks, &normal.a)).collect(),
            floors: Floors::default(),
        }
    }

    /// Solves for the step under damping `λ`; returns the cost decrease predicted by the quadratic model.
    pub(super) fn solve(&mut self, layout: &Layout, normal: &Normal, lambda: f64) -> Result<f64, SparseError> {
        self.reduce(layout, normal, lambda);
        self.system.factor()?;
        self.system.solve_in_place(&mut self.delta);
        let (floors, factors, delta) = (self.floors, &self.factors, &self.delta);
        let points = self.points.par_iter_mut().zip(&mut self.gains).enumerate();
        points.with_min_len(256).for_each(|(index, (step, gain))| {
            let block = &normal.points[index];
            *step = match &factors[index] {
                Some(factor) => -factor.solve(&(block.g + normal.coupled(index, &layout.tracks[index], delta))),
                None => Vec3::zeros(),
            };
            *gain = step.dot(&(lambda * floors.of_point(&block.c).component_mul(step) - block.g));
        });
        let of_pose =
            |(k, (step, b)): (usize, (&f64, &f64))| step * (lambda * self.scale(layout, normal, k) * step - b);
        let by_poses: f64 = self.delta.iter().zip(&normal.b).enumerate().map(of_pose).sum();
        Ok(0.5 * (by_poses + self.gains.iter().sum::<f64>()))
    }

    /// Variance of `ln f` from the nearly undamped system; `None` if nothing determines it.
    pub(super) fn variance_of_ln_focal(&mut self, layout: &Layout, normal: &Normal) -> Option<f64> {
        let unknown = POSE * layout.free + LN_FOCAL;
        self.reduce(layout, normal, NEARLY_NONE);
        self.system.factor().ok()?;
        self.delta.fill(0.0);
        self.delta[unknown] = 1.0;
        self.system.solve_in_place(&mut self.delta);
        Some(self.delta[unknown])
    }

    fn reduce(&mut self, layout: &Layout, normal: &Normal, lambda: f64) {
        self.floors = Floors::of(layout, normal);
        self.system.copy_from(&normal.a);
        for k in 0..layout.unknowns() {
            *self.system.diagonal_mut(k) += lambda * self.scale(layout, normal, k);
        }
        self.delta.iter_mut().zip(&normal.b).for_each(|(d, b)| *d = -b);
        let (floors, mut factors) = (self.floors, self.factors.as_mut_slice());
        let jobs = self.parts.iter_mut().map(|part| {
            let own = factors.split_off_mut(..part.tracks().len()).expect("the parts cover the tracks once");
            (part, own)
        });
        let jobs: Vec<(&mut Part, &mut [Option<Factor>])> = jobs.collect();
        jobs.into_par_iter().for_each(|(part, factors)| part.eliminate(factors, layout, normal, (lambda, floors)));
        for part in &self.parts {
            self.system.add(&part.system);
            self.delta.iter_mut().zip(&part.delta).for_each(|(sum, d)| *sum += d);
        }
        for &unknown in &layout.fixed {
            self.system.isolate(unknown);
            self.delta[unknown] = 0.0;
        }
    }

    /// Entry of `D` for unknown `k` of the reduced system.
    fn scale(&self, layout: &Layout, normal: &Normal, k: usize) -> f64 {
        let floor = match k {
            _ if k >= POSE * layout.free => f64::MIN_POSITIVE,
            _ if k % POSE < 3 => self.floors.rotation,
            _ => self.floors.shift,
        };
        normal.a.diagonal(k).max(floor)
    }
}

impl Part {
    fn new(layout: &Layout, tracks: std::ops::Range<usize>, like: &BandedMatrix) -> Self {
        let batches = batches(layout, tracks);
        let columns = |b: &Batch| 3 * b.tracks.len();
        let v = batches.iter().map(|b| POSE * b.slots.len() * columns(b)).max().unwrap_or(0);
        let v_border = batches.iter().map(|b| SHARED * columns(b)).max().unwrap_or(0);
        let delta = vec![0.0; layout.unknowns()];
        Self { system: like.clone(), delta, v: vec![0.0; v], v_border: vec![0.0; v_border], batches }
    }

    fn tracks(&self) -> std::ops::Range<usize> {
        let end = |b: Option<&Batch>, of: fn(&Batch) -> usize| b.map_or(0, of);
        end(self.batches.first(), |b| b.tracks.start)..end(self.batches.last(), |b| b.tracks.end)
    }

    fn eliminate(&mut self, factors: &mut [Option<Factor>], layout: &Layout, normal: &Normal, damping: (f64, Floors)) {
        self.system.clear();
        self.delta.fill(0.0);
        let first = self.tracks().start;
        for index in 0..self.batches.len() {
            let batch = self.batches[index].clone();
            let factors = &mut factors[batch.tracks.start - first..batch.tracks.end - first];
            self.eliminate_batch(&batch, factors, layout, normal, damping);
        }
    }

    /// Eliminates a batch of points.
    fn eliminate_batch(
        &mut self,
        batch: &Batch,
        factors: &mut [Option<Factor>],
        layout: &Layout,
        normal: &Normal,
        (lambda, floors): (f64, Floors),
    ) {
        let (rows, rank) = (POSE * batch.slots.len(), 3 * batch.tracks.len());
        self.v[..rows * rank].fill(0.0);
        self.v_border[..SHARED * rank].fill(0.0);
        for (n, index) in batch.tracks.clone().enumerate() {
            let block = &normal.points[index];
            // Factor C + λ D = L Lᵀ; a point without a sound factor keeps zero columns in V.
            let damped = block.c + Matrix3::from_diagonal(&(lambda * floors.of_point(&block.c)));
            factors[n] = Cholesky::new(damped).filter(|f| sound(f, &damped));
            let Some(factor) = &factors[n] else { continue };
            let l = factor.l_dirty();
            let track = &layout.tracks[index];
            let own = POSE * track.slots.len();
            // V = W L⁻ᵀ, in the rows of the track's slots; the other rows of the batch are zero padding.
            let v = &mut self.v[3 * n * rows..][..3 * rows];
            let offset = POSE * (track.slots.start - batch.slots.start);
            let w = &normal.w[block.start..][..3 * own];
            for i in 0..own {
                let row = forward(l, [w[i], w[own + i], w[2 * own + i]]);
                (0..3).for_each(|q| v[q * rows + offset + i] = row[q]);
            }
            // z = L⁻¹ g; accumulate V z.
            let z = forward(l, [block.g.x, block.g.y, block.g.z]);
            for (i, delta) in self.delta[POSE * track.slots.start..][..own].iter_mut().enumerate() {
                *delta += (0..3).map(|q| v[q * rows + offset + i] * z[q]).sum::<f64>();
            }
            // The same for the rows of the shared unknowns.
            let v_border = &mut self.v_border[3 * n * SHARED..][..3 * SHARED];
            for i in 0..SHARED {
                let row = forward(l, [block.shared[(i, 0)], block.shared[(i, 1)], block.shared[(i, 2)]]);
                (0..3).for_each(|q| v_border[q * SHARED + i] = row[q]);
                self.delta[POSE * layout.free + i] += (0..3).map(|q| row[q] * z[q]).sum::<f64>();
            }
        }
        // One product − V Vᵀ of dense matrices for the whole batch.
        let first = POSE * batch.slots.start;
        self.system.subtract_outer(first, (rows, rank), &self.v[..rows * rank], &self.v_border[..SHARED * rank]);
    }
}

impl Floors {
    fn of(layout: &Layout, normal: &Normal) -> Self {
        // If no unknown of a kind is observed, any positive number constrains them.
        let floor = |largest: f64| if largest > 0.0 { MIN_DIAGONAL * largest } else { 1.0 };
        let pose = |kind: usize| {
            let all = (0..layout.free).flat_map(|slot| (0..3).map(move |k| POSE * slot + kind + k));
            floor(all.map(|k| normal.a.diagonal(k)).fold(0.0, f64::max))
        };
        let point = |k: usize| floor(normal.points.iter().map(|p| p.c[(k, k)]).fold(0.0, f64::max));
        Self { rotation: pose(0), shift: pose(3), ray: point(0).max(point(1)), depth: point(2) }
    }

    /// Entries of `D` for the unknowns of a point.
    fn of_point(&self, c: &Matrix3<f64>) -> Vec3 {
        c.diagonal().sup(&Vec3::new(self.ray, self.ray, self.depth))
    }
}

/// Batches of consecutive tracks whose union of slots is little larger than the longest of them ([`SLACK`]).
fn batches(layout: &Layout, tracks: std::ops::Range<usize>) -> Vec<Batch> {
    let mut batches: Vec<Batch> = Vec::new();
    let mut longest = 0;
    for index in tracks {
        let own = &layout.tracks[index].slots;
        if let Some(batch) = batches.last_mut() {
            let union = batch.slots.start.min(own.start)..batch.slots.end.max(own.end);
            let fits = union.len() as f64 <= SLACK * longest.max(own.len()) as f64 && union.len() <= layout.longest();
            if fits && batch.tracks.len() < BATCH {
                (batch.tracks.end, batch.slots) = (index + 1, union);
                longest = longest.max(own.len());
                continue;
            }
        }
        batches.push(Batch { tracks: index..index + 1, slots: own.clone() });
        longest = own.len();
    }
    batches
}

/// `L⁻¹ x`.
fn forward(l: &Matrix3<f64>, x: [f64; 3]) -> [f64; 3] {
    let a = x[0] / l[(0, 0)];
    let b = (x[1] - l[(1, 0)] * a) / l[(1, 1)];
    [a, b, (x[2] - l[(2, 0)] * a - l[(2, 1)] * b) / l[(2, 2)]]
}

/// Whether the last pivot of the factorization, that of the inverse depth, is above rounding error.
fn sound(factor: &Cholesky<f64, Const<3>>, c: &Matrix3<f64>) -> bool {
    (0..3).all(|k| factor.l_dirty()[(k, k)].powi(2) > 1e-13 * c[(k, k)])
}
