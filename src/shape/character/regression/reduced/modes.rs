//! Principal shapes of the triangles' maps:
//!
//! ```text
//! min Σ_s ω_s² Σ_t area_t |E_t(q_s) − E_t(0) − Σ_k z_k(q_s) B_tk|²
//! ```
//!
//! by the singular value decomposition of each group's samples; the largest singular values over all groups are kept. `z_k(q)` for other
//! rotations is predicted from key triangles, chosen greedily by the largest unexplained part, until they explain all `z`.

use nalgebra::{DMatrix, DVector, SymmetricEigen, Vector3};

use super::super::JointRotations;
use super::super::training::Regressor;
use super::{Group, MAX_KEYS, Map, array};
use plumbline_num::run::{Run, Stopped};

/// Largest number of samples per joint; the training rotations are thinned beyond. Bounds the eigenproblem.
const MAX_SAMPLES: usize = 96;
/// Multiples of the training rotations that are sampled: between rest and a pose, and slightly beyond it.
const PARTS: [f64; 4] = [0.35, 0.7, 1.0, 1.2];
/// Weight of samples that are not training rotations.
const INTERPOLATED_WEIGHT: f64 = 0.3;
/// Unexplained fraction of the coefficients below which no more keys are added.
const UNEXPLAINED: f64 = 1e-3;
/// Singular values of the key outputs below this fraction of the largest are cut off in the pseudoinverse.
const MIN_SINGULAR_RATIO: f64 = 1e-5;
/// Shapes with a singular value below this fraction of the largest are rounding.
const ROUNDING: f64 = 1e-9;

/// A rotation vector to sample, and its weight.
type Sample = (Vector3<f64>, f64);

/// Triangles of a group, and their sampled maps.
struct Sampled {
    bone: u32,
    joint: u32,
    triangles: Vec<usize>,
    /// Weight of each sample.
    counts: Vec<f64>,
    /// `E_t(q_s) − E_t(0)` times the weight of the sample: a row per sample, nine columns per triangle.
    said: DMatrix<f64>,
    /// Singular values and left singular vectors, weighted by area, in descending order.
    modes: Vec<(f64, DVector<f64>)>,
}

/// Groups, the group of each triangle, and maps of all triangles.
type Groups = (Vec<Group>, Vec<u32>, Vec<Map>);

/// Computes the groups and their shapes.
pub(super) fn groups(
    regressors: &[Regressor],
    areas: &[f64],
    rotations: &[JointRotations],
    most: usize,
    run: &Run,
) -> Result<Groups, Stopped> {
    let mut groups: std::collections::BTreeMap<(u32, u32), Vec<usize>> = std::collections::BTreeMap::new();
    for (t, r) in regressors.iter().enumerate() {
        groups.entry((r.bone, r.joint)).or_default().push(t);
    }
    let sampled: Vec<Sampled> = groups
        .into_iter()
        .map(|((bone, joint), triangles)| {
            run.check()?;
            Ok(Sampled::new(bone, joint, triangles, regressors, areas, rotations))
        })
        .collect::<Result<_, Stopped>>()?;
    let bones: std::collections::BTreeSet<u32> = sampled.iter().map(|s| s.bone).collect();
    let least = least_kept(&sampled, most * bones.len());
    let mut group_of = vec![0; regressors.len()];
    let mut maps: Vec<Vec<Map>> = vec![Vec::new(); regressors.len()];
    let mut groups = Vec::with_capacity(sampled.len());
    for group in &sampled {
        run.check()?;
        let kept = group.modes.iter().take_while(|m| m.0 > least).count();
        let (sheet, shapes) = group.sheet(kept, regressors, areas);
        for (c, &t) in group.triangles.iter().enumerate() {
            group_of[t] = groups.len() as u32;
            maps[t].push(array(&regressors[t].at_rest()).map(|x| x as f32));
            maps[t].extend(shapes.iter().map(|b| std::array::from_fn(|k| b[9 * c + k] as f32)));
        }
        groups.push(sheet);
    }
    Ok((groups, group_of, maps.concat()))
}

/// Cutoff of singular values.
fn least_kept(sampled: &[Sampled], budget: usize) -> f64 {
    let mut all: Vec<f64> = sampled.iter().flat_map(|s| s.modes.iter().map(|m| m.0)).collect();
    all.sort_by(|a, b| b.total_cmp(a));
    let rounding = ROUNDING * all.first().copied().unwrap_or(0.0);
    all.get(budget).copied().unwrap_or(0.0).max(rounding)
}

impl Sampled {
    fn new(
        bone: u32,
        joint: u32,
        triangles: Vec<usize>,
        regressors: &[Regressor],
        areas: &[f64],
        rotations: &[JointRotations],
    ) -> Self {
        let samples = samples(rotations, joint);
        let mut said = DMatrix::zeros(samples.len(), 9 * triangles.len());
        for (c, &t) in triangles.iter().enumerate() {
            let rest = regressors[t].at_rest();
            for (s, (q, count)) in samples.iter().enumerate() {
                let map = array(&((regressors[t].of_turn(q) - rest) * *count));
                (0..9).for_each(|k| said[(s, 9 * c + k)] = map[k]);
            }
        }
        let mut gram = DMatrix::zeros(samples.len(), samples.len());
        for (c, &t) in triangles.iter().enumerate() {
            let columns = said.columns(9 * c, 9);
            gram.gemm(areas[t], &columns, &columns.transpose(), 1.0);
        }
        let eigen = SymmetricEigen::new(gram);
        let mut modes: Vec<(f64, DVector<f64>)> = (eigen.eigenvalues.iter())
            .zip(eigen.eigenvectors.column_iter())
            .map(|(value, vector)| (value.max(0.0).sqrt(), vector.into_owned()))
            .collect();
        modes.sort_by(|a, b| b.0.total_cmp(&a.0));
        Self { bone, joint, triangles, counts: samples.iter().map(|s| s.1).collect(), said, modes }
    }

    /// The group with its first shapes, and the shapes.
    fn sheet(&self, kept: usize, regressors: &[Regressor], areas: &[f64]) -> (Group, Vec<DVector<f64>>) {
        // `z` reaches 1 on the samples, so that the norm of a shape is its largest displacement.
        let reach =
            |u: &DVector<f64>| u.iter().zip(&self.counts).map(|(u, w)| (u / w).abs()).fold(f64::MIN_POSITIVE, f64::max);
        let kept = &self.modes[..kept];
        if kept.is_empty() {
            let (keys, reading) = (Vec::new(), DMatrix::zeros(0, 0));
            return (Group { bone: self.bone, joint: self.joint, keys, reading }, Vec::new());
        }
        let shapes = kept.iter().map(|(_, u)| self.said.tr_mul(u) * reach(u)).collect();
        let wanted = DMatrix::from_columns(&kept.iter().map(|(_, u)| u / reach(u)).collect::<Vec<_>>());
        let (keys, reading) = self.read(&wanted, areas);
        let keys = keys.into_iter().map(|c| regressors[self.triangles[c]].map).collect();
        (Group { bone: self.bone, joint: self.joint, keys, reading }, shapes)
    }

    /// Key triangles, and the linear predictor from their outputs.
    fn read(&self, wanted: &DMatrix<f64>, areas: &[f64]) -> (Vec<usize>, DMatrix<f64>) {
        let mut left = self.said.clone();
        let mut keys = Vec::new();
        loop {
            let size = |c: usize| left.columns(9 * c, 9).norm_squared() * areas[self.triangles[c]];
            let next = (0..self.triangles.len()).max_by(|&a, &b| size(a).total_cmp(&size(b))).expect("a triangle");
            keys.push(next);
            let columns: Vec<usize> = keys.iter().flat_map(|&c| 9 * c..9 * c + 9).collect();
            let said = self.said.select_columns(&columns);
            let svd = said.clone().svd(true, true);
            let reading =
                svd.solve(wanted, MIN_SINGULAR_RATIO * svd.singular_values.max()).expect("both factors were asked for");
            let missed = (said * &reading - wanted).norm();
            if keys.len() == MAX_KEYS.min(self.triangles.len()) || missed <= UNEXPLAINED * wanted.norm() {
                return (keys, reading.transpose());
            }
            for direction in left.columns(9 * next, 9).into_owned().svd(true, false).u.expect("asked for").column_iter()
            {
                let along = left.tr_mul(&direction);
                left.ger(-1.0, &direction, &along, 1.0);
            }
        }
    }
}

/// Rotations of a joint to sample.
fn samples(rotations: &[JointRotations], joint: u32) -> Vec<Sample> {
    let seen: Vec<Vector3<f64>> = rotations.iter().map(|t| t.relative[joint as usize]).collect();
    let furthest = seen.iter().map(Vector3::norm).fold(0.0, f64::max);
    let parts = PARTS
        .iter()
        .flat_map(|&part| seen.iter().map(move |q| (q * part, if part == 1.0 { 1.0 } else { INTERPOLATED_WEIGHT })));
    let between = (0..seen.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
    let between =
        between.map(|(a, b)| (nalgebra::center(&seen[a].into(), &seen[b].into()).coords, INTERPOLATED_WEIGHT));
    let all: Vec<Sample> = parts.chain(between).collect();
    let step = all.len().div_ceil(MAX_SAMPLES).max(1);
    // Joints that never rotate in the examples need a sample too: any axis.
    let none = (Vector3::x() * furthest.max(f64::MIN_POSITIVE), INTERPOLATED_WEIGHT);
    all.into_iter().step_by(step).chain([none]).collect()
}
