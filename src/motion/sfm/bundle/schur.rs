//! Elimination of the points, and the step.
//!
//! ```text
//! C + λ D = L Lᵀ,   V = W L⁻ᵀ,   z = L⁻¹ g,      S = A + λ D − V Vᵀ,   S δ_c = −b + V z,   δ_p = −L⁻ᵀ(z + L⁻¹ Wᵀ δ_c)
//! ```
//!
//! `V Vᵀ` is summed over points of about the same frames at once, as a product of dense matrices.

use nalgebra::{Cholesky, Const, Matrix3};

use super::layout::{Layout, POSE};
use super::normal::Normal;
use super::parameters::{LN_FOCAL, SHARED};
use crate::camera::Vec3;
use crate::sparse::{BandedMatrix, SparseError};

/// Points reduced at once, at most: a product of rank 48 keeps the dense kernel busy, and its rows stay in the cache.
const BATCH: usize = 16;
/// Share of rows that may be padding when points of different frames are reduced together.
const SLACK: f64 = 1.2;
/// Least diagonal entry that damping takes hold of, relative to the largest of its kind: what hardly anything observes would
/// otherwise run as far as it likes at any damping.
const LEAST_DIAGONAL: f64 = 1e-9;

/// Damping under which variances are read: far below what observations say, enough to hold what they say nothing of.
const NEARLY_NONE: f64 = 1e-9;

/// The reduced system and the buffers it is made in.
#[derive(Clone, Debug)]
pub(super) struct Reduced {
    system: BandedMatrix,
    /// Steps of poses and shared unknowns.
    pub(super) delta: Vec<f64>,
    /// Steps of points.
    pub(super) points: Vec<Vec3>,
    factors: Vec<Option<Cholesky<f64, Const<3>>>>,
    v: Vec<f64>,
    v_border: Vec<f64>,
    batches: Vec<Batch>,
    /// Floors of the diagonals: turns, shifts, shared unknowns one by one, ray, inverse depth.
    floors: Floors,
}

#[derive(Clone, Debug)]
struct Batch {
    tracks: std::ops::Range<usize>,
    slots: std::ops::Range<usize>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Floors {
    turn: f64,
    shift: f64,
    ray: f64,
    depth: f64,
}

impl Reduced {
    pub(super) fn new(layout: &Layout, normal: &Normal) -> Self {
        let batches = batches(layout);
        let columns = |b: &Batch| 3 * b.tracks.len();
        let v = batches.iter().map(|b| POSE * b.slots.len() * columns(b)).max().unwrap_or(0);
        let v_border = batches.iter().map(|b| SHARED * columns(b)).max().unwrap_or(0);
        Self {
            system: normal.a.clone(),
            delta: vec![0.0; layout.unknowns()],
            points: vec![Vec3::zeros(); layout.tracks.len()],
            factors: vec![None; layout.tracks.len()],
            v: vec![0.0; v],
            v_border: vec![0.0; v_border],
            batches,
            floors: Floors::default(),
        }
    }

    /// The step under damping `λ`; returns what the quadratic model expects to gain.
    pub(super) fn solve(&mut self, layout: &Layout, normal: &Normal, lambda: f64) -> Result<f64, SparseError> {
        self.reduce(layout, normal, lambda);
        self.system.factor()?;
        self.system.solve_in_place(&mut self.delta);
        let mut gain = 0.0;
        for (k, (&step, &b)) in self.delta.iter().zip(&normal.b).enumerate() {
            gain += step * (lambda * self.scale(layout, normal, k) * step - b);
        }
        for (index, track) in layout.tracks.iter().enumerate() {
            let block = &normal.points[index];
            self.points[index] = match &self.factors[index] {
                Some(factor) => -factor.solve(&(block.g + normal.coupled(index, track, &self.delta))),
                None => Vec3::zeros(),
            };
            let step = &self.points[index];
            gain += step.dot(&(lambda * self.point_scale(&block.c).component_mul(step) - block.g));
        }
        Ok(0.5 * gain)
    }

    /// Variance of `ln f`, of the system all but undamped; `None` where nothing determines it.
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
        for index in 0..self.batches.len() {
            let batch = self.batches[index].clone();
            self.eliminate(&batch, layout, normal, lambda);
        }
        for &unknown in &layout.held {
            self.system.isolate(unknown);
            self.delta[unknown] = 0.0;
        }
    }

    /// Takes a batch of points out of the system.
    fn eliminate(&mut self, batch: &Batch, layout: &Layout, normal: &Normal, lambda: f64) {
        let (rows, rank) = (POSE * batch.slots.len(), 3 * batch.tracks.len());
        self.v[..rows * rank].fill(0.0);
        self.v_border[..SHARED * rank].fill(0.0);
        for (n, index) in batch.tracks.clone().enumerate() {
            let block = &normal.points[index];
            let damped = block.c + Matrix3::from_diagonal(&(lambda * self.point_scale(&block.c)));
            self.factors[index] = Cholesky::new(damped).filter(|f| sound(f, &damped));
            let Some(factor) = &self.factors[index] else { continue };
            let l = factor.l_dirty();
            let track = &layout.tracks[index];
            let own = POSE * track.slots.len();
            let v = &mut self.v[3 * n * rows..][..3 * rows];
            let offset = POSE * (track.slots.start - batch.slots.start);
            let w = &normal.w[block.start..][..3 * own];
            for i in 0..own {
                let row = forward(l, [w[i], w[own + i], w[2 * own + i]]);
                (0..3).for_each(|q| v[q * rows + offset + i] = row[q]);
            }
            let z = forward(l, [block.g.x, block.g.y, block.g.z]);
            for (i, delta) in self.delta[POSE * track.slots.start..][..own].iter_mut().enumerate() {
                *delta += (0..3).map(|q| v[q * rows + offset + i] * z[q]).sum::<f64>();
            }
            let v_border = &mut self.v_border[3 * n * SHARED..][..3 * SHARED];
            for i in 0..SHARED {
                let row = forward(l, [block.shared[(i, 0)], block.shared[(i, 1)], block.shared[(i, 2)]]);
                (0..3).for_each(|q| v_border[q * SHARED + i] = row[q]);
                self.delta[POSE * layout.free + i] += (0..3).map(|q| row[q] * z[q]).sum::<f64>();
            }
        }
        let first = POSE * batch.slots.start;
        self.system.subtract_outer(first, (rows, rank), &self.v[..rows * rank], &self.v_border[..SHARED * rank]);
    }

    /// Entry of `D` of an unknown of the reduced system.
    fn scale(&self, layout: &Layout, normal: &Normal, k: usize) -> f64 {
        let floor = match k {
            _ if k >= POSE * layout.free => f64::MIN_POSITIVE,
            _ if k % POSE < 3 => self.floors.turn,
            _ => self.floors.shift,
        };
        normal.a.diagonal(k).max(floor)
    }

    fn point_scale(&self, c: &Matrix3<f64>) -> Vec3 {
        c.diagonal().sup(&Vec3::new(self.floors.ray, self.floors.ray, self.floors.depth))
    }
}

impl Floors {
    fn of(layout: &Layout, normal: &Normal) -> Self {
        // Where nothing at all is observed of a kind, any positive number holds it.
        let floor = |largest: f64| if largest > 0.0 { LEAST_DIAGONAL * largest } else { 1.0 };
        let pose = |kind: usize| {
            let all = (0..layout.free).flat_map(|slot| (0..3).map(move |k| POSE * slot + kind + k));
            floor(all.map(|k| normal.a.diagonal(k)).fold(0.0, f64::max))
        };
        let point = |k: usize| floor(normal.points.iter().map(|p| p.c[(k, k)]).fold(0.0, f64::max));
        Self { turn: pose(0), shift: pose(3), ray: point(0).max(point(1)), depth: point(2) }
    }
}

/// Consecutive tracks whose union of slots is little more than the longest of them.
fn batches(layout: &Layout) -> Vec<Batch> {
    let mut batches: Vec<Batch> = Vec::new();
    let mut longest = 0;
    for (index, track) in layout.tracks.iter().enumerate() {
        let own = &track.slots;
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

/// Whether elimination left more of the last pivot, that of the inverse depth, than rounding.
fn sound(factor: &Cholesky<f64, Const<3>>, c: &Matrix3<f64>) -> bool {
    (0..3).all(|k| factor.l_dirty()[(k, k)].powi(2) > 1e-13 * c[(k, k)])
}
