//! The energy of a curve inside a surface.
//!
//! A curve is centered, smooth and inside where it minimizes
//!
//! `E = ∫ (Σ_u −(r/h_u)² log(1 − e_u²)/K + β r² ‖κ‖²) ds/r`,   `e_u = (d⁺ − d⁻)/(d⁺ + d⁻)`,   `h_u = (d⁺ + d⁻)/2`,
//!
//! with `r` the distance to the surface, `κ` the curvature, and `d⁺`, `d⁻` the lengths of the two halves of the chord through the curve in
//! direction `u`, one of `K` directions across the tangent. Both terms are dimensionless and the same for fingers and trunks. The logarithm
//! keeps the curve inside. A chord that is long beside the inscribed ball says little about the center, as across a palm. At a junction every
//! branch bends for itself and has its own cross-section.
//!
//! Gauss–Newton: in direction `u` the surface is taken as two planes across the chord, so that `e` is linear in the position, and the logarithm
//! as `e²/(1 − e₀²)` about the current `e₀`; `r`, `ds` and tangents are those of the step before. Nodes are free along the curve, so that folds
//! unfold; ends are not, since limbs would shorten. A step is at most half the distance to the surface: a node inside stays inside.
//!
//! At a free end the bending moment vanishes, which straightens the last radius of a bent limb. Ends are therefore continued to the surface
//! (`tips.rs`) and trimmed after.

use std::sync::Arc;

use nalgebra::{Matrix3, Point3, Rotation3, Vector3};

use super::aabb::AabbTree;
use super::curve_graph::CurveGraph;
use crate::character::CharacterError;
use plumbline_num::run::Run;
use plumbline_num::sparse::{Cholesky, Ordering, Pattern, SparseMatrix};

/// Weight `β` of the bending, with which a curve smooths over `(2β)^¼ r`, half the radius. At .02 more models turn more than CGAL's, at .04 the
/// axis of a bent capsule is off by more than a hundredth of its radius.
const BENDING: f64 = 0.03;
/// Number `K` of chords across the curve. Six changed nothing in an earlier version.
const CHORDS: usize = 4;
/// Largest step, as a fraction of the distance to the surface: any below 1 keeps nodes inside.
const MAX_STEP: f64 = 0.5;
/// Displacement after which chords are cast again, in local radii: between, chords follow the node as if the surface were flat.
const RECAST_RADII: f64 = 0.02;
/// Largest step at which the curve has arrived, in local radii: far below what is visible.
const TOLERANCE: f64 = 0.005;
/// Damping relative to the centering of a node: what no chord and no bend decides stays. Much more leaves folds.
const DAMPING: f64 = 0.002;
/// Damping of ends along the curve; the same from 1 to 1000.
const END_DAMPING: f64 = 10.0;
/// Weight of a pinned node: far above the others, of order one. Its own offset bends the curve beside it over some three radii.
const PINNED: f64 = 1e9;
/// Lower bound of lengths, in node spacings: bounds the weights.
const MIN_LENGTH: f64 = 0.1;
/// Bound of `e`: nodes at the surface.
const MAX_OFFSET: f64 = 0.99;

/// A node as a part of one of its branches.
struct Station {
    node: u32,
    /// Neighbors along the branch; the node itself where the branch ends.
    before: u32,
    after: u32,
    chords: Vec<Chord>,
    /// Positions of the three nodes when the chords were cast.
    cast_at: [Point3<f64>; 3],
}

/// A chord through a node.
#[derive(Clone, Copy)]
struct Chord {
    along: Vector3<f64>,
    /// From the node to the middle.
    middle: f64,
    half: f64,
}

/// Takes Gauss–Newton steps, at most `steps`, with nodes about `spacing` apart. `axes` turn with the model.
pub(super) fn minimize(
    graph: &mut CurveGraph,
    tree: &AabbTree,
    axes: &Rotation3<f64>,
    (steps, spacing): (usize, f64),
    run: &Run,
) -> Result<(), CharacterError> {
    let alive: Vec<u32> = graph.alive().collect();
    let mut stations = stations(graph);
    let mut system = System::new(graph, &alive, &stations)?;
    let mut feet: Vec<Option<Point3<f64>>> = vec![None; graph.nodes.len()];
    let mut radii = vec![0.0; graph.nodes.len()];
    for _ in 0..steps {
        run.check()?;
        if tree.is_exhausted() {
            break;
        }
        for &v in &alive {
            let (c, foot) = (&graph.nodes[v as usize], &mut feet[v as usize]);
            *foot = foot.map(|guess| tree.nearest_from(c, &guess)).or_else(|| tree.nearest(c));
            radii[v as usize] = foot.map_or(0.0, |p| nalgebra::distance(c, &p)).max(MIN_LENGTH * spacing);
        }
        system.clear();
        for station in &mut stations {
            let r = radii[station.node as usize];
            station.center(graph, tree, axes, r, &mut system);
            station.straighten(graph, (r, MIN_LENGTH * spacing), &mut system);
        }
        for &v in &alive {
            let damping = DAMPING * spacing / radii[v as usize].powi(3);
            let weight = if graph.pinned[v as usize] { PINNED } else { damping };
            system.add(v, v, &Matrix3::from_diagonal_element(weight));
        }
        system.solve(run)?;
        let mut longest = 0.0_f64;
        for v in alive.iter().copied().filter(|v| !graph.pinned[*v as usize]) {
            let (step, r) = (system.step(v), radii[v as usize]);
            let length = step.norm() / r;
            longest = longest.max(length);
            graph.nodes[v as usize] += step * (MAX_STEP / length.max(MAX_STEP));
        }
        if longest < TOLERANCE {
            break;
        }
    }
    Ok(())
}

/// The nodes of all branches.
fn stations(graph: &CurveGraph) -> Vec<Station> {
    let mut all = Vec::new();
    for branch in graph.branches() {
        let last = branch.len() - 1;
        let is_ring = branch[0] == branch[last] && graph.degree(branch[0]) == 2;
        for i in usize::from(is_ring)..=last {
            let before = branch[i.saturating_sub(1)];
            let after = if is_ring && i == last { branch[1] } else { branch[(i + 1).min(last)] };
            let cast_at = [Point3::origin(); 3];
            all.push(Station { node: branch[i], before, after, chords: Vec::new(), cast_at });
        }
    }
    all
}

impl Station {
    fn positions(&self, graph: &CurveGraph) -> [Point3<f64>; 3] {
        [self.before, self.node, self.after].map(|v| graph.nodes[v as usize])
    }

    /// Adds the first term of the energy, with `r` the distance to the surface.
    fn center(&mut self, graph: &CurveGraph, tree: &AabbTree, axes: &Rotation3<f64>, r: f64, system: &mut System) {
        let at = self.positions(graph);
        let [p, c, q] = at;
        let Some(tangent) = (q - p).try_normalize(1e-12) else { return };
        let is_stale = |(now, cast): (&Point3<f64>, &Point3<f64>)| nalgebra::distance(now, cast) > RECAST_RADII * r;
        if self.chords.is_empty() || at.iter().zip(&self.cast_at).any(is_stale) {
            self.chords = cast(tree, axes, &c, &tangent);
            self.cast_at = at;
        }
        let share = 0.5 * (nalgebra::distance(&p, &c) + nalgebra::distance(&c, &q)) / r;
        let hold = if graph.degree(self.node) == 1 { END_DAMPING * share / (r * r) } else { 0.0 };
        let (mut block, mut pull) = (tangent * tangent.transpose() * hold, Vector3::zeros());
        for chord in &self.chords {
            let half = chord.half.max(r);
            let to = chord.middle - chord.along.dot(&(c - self.cast_at[1]));
            let e = (to / half).clamp(-MAX_OFFSET, MAX_OFFSET);
            let weight = share * (r / half).powi(2) / ((1.0 - e * e) * half * half * CHORDS as f64);
            block += chord.along * chord.along.transpose() * weight;
            pull += chord.along * (weight * to);
        }
        system.add(self.node, self.node, &block);
        system.pull(self.node, &pull);
    }

    /// Adds the second term, with `least` the lower bound of lengths.
    fn straighten(&self, graph: &CurveGraph, (r, least): (f64, f64), system: &mut System) {
        if self.before == self.node || self.after == self.node {
            return;
        }
        let [p, c, q] = self.positions(graph);
        let share = 0.5 * (nalgebra::distance(&p, &c) + nalgebra::distance(&c, &q)) / r;
        let (a, b) = (nalgebra::distance(&p, &c).max(least), nalgebra::distance(&c, &q).max(least));
        let (to_p, to_q) = (2.0 / ((a + b) * a), 2.0 / ((a + b) * b));
        let curvature = (p - c) * to_p + (q - c) * to_q;
        let weight = BENDING * r * r * share;
        let row = [(self.before, to_p), (self.node, -to_p - to_q), (self.after, to_q)];
        for (i, x) in row {
            system.pull(i, &(curvature * (-weight * x)));
            for (j, y) in row {
                system.add(i, j, &Matrix3::from_diagonal_element(weight * x * y));
            }
        }
    }
}

/// The chords through a point across a direction. Where the surface is open there is nothing to center between: the node stays.
fn cast(tree: &AabbTree, axes: &Rotation3<f64>, c: &Point3<f64>, along: &Vector3<f64>) -> Vec<Chord> {
    let [side, other] = across(axes, along);
    let chord = |k: usize| {
        let angle = std::f64::consts::PI * k as f64 / CHORDS as f64;
        let along = side * angle.cos() + other * angle.sin();
        let halves = tree.first_hit(c, &along).zip(tree.first_hit(c, &-along));
        let [middle, half] =
            halves.map_or([0.0; 2], |(ahead, behind)| [0.5 * (ahead - behind), 0.5 * (ahead + behind)]);
        Chord { along, middle, half }
    };
    (0..CHORDS).map(chord).collect()
}

/// Two unit vectors across a direction, continuous in it except opposite to one in which no limb is likely to be aligned, and turned with the
/// model.
fn across(axes: &Rotation3<f64>, along: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let [from, side] = [axes * Vector3::new(0.36, 0.48, 0.8), axes * Vector3::new(0.8, -0.6, 0.0)];
    let side = Rotation3::rotation_between(&from, along).map_or(side, |turn| turn * side);
    [side, along.cross(&side)]
}

/// The normal equations of a step, three unknowns for each node.
struct System {
    number: Vec<usize>,
    matrix: SparseMatrix,
    values: Vec<f64>,
    factor: Cholesky,
}

impl System {
    fn new(graph: &CurveGraph, alive: &[u32], stations: &[Station]) -> Result<Self, CharacterError> {
        let mut number = vec![usize::MAX; graph.nodes.len()];
        alive.iter().zip(0..).for_each(|(v, i)| number[*v as usize] = i);
        let pairs = stations.iter().flat_map(|s| {
            let all = [s.before, s.node, s.after].map(|v| number[v as usize]);
            all.into_iter().flat_map(move |i| all.into_iter().map(move |j| (i, j)))
        });
        let blocks = pairs.filter(|(i, j)| i >= j);
        let entries = blocks.flat_map(|(i, j)| (0..9).map(move |k| (3 * i + k / 3, 3 * j + k % 3)));
        let inner = (0..alive.len()).flat_map(|i| [(3 * i + 1, 3 * i), (3 * i + 2, 3 * i), (3 * i + 2, 3 * i + 1)]);
        let pattern = Arc::new(Pattern::new(3 * alive.len(), entries.chain(inner))?);
        let factor = Cholesky::analyze(&pattern, &Ordering::Amd)?;
        Ok(Self { number, values: vec![0.0; pattern.n()], matrix: SparseMatrix::zeros(pattern), factor })
    }

    fn clear(&mut self) {
        self.matrix.values_mut().fill(0.0);
        self.values.fill(0.0);
    }

    /// Adds a block of the matrix; of the two of a pair that in the lower triangle counts.
    fn add(&mut self, i: u32, j: u32, block: &Matrix3<f64>) {
        let (i, j) = (3 * self.number[i as usize], 3 * self.number[j as usize]);
        for (a, b) in (0..9).map(|k| (k / 3, k % 3)).filter(|(a, b)| i + a >= j + b) {
            let slot = self.matrix.pattern().slot(i + a, j + b).expect("nodes of a station are in the pattern");
            self.matrix.values_mut()[slot] += block[(a, b)];
        }
    }

    fn pull(&mut self, i: u32, by: &Vector3<f64>) {
        let i = 3 * self.number[i as usize];
        (0..3).for_each(|k| self.values[i + k] += by[k]);
    }

    fn solve(&mut self, run: &Run) -> Result<(), CharacterError> {
        self.factor.factor(&self.matrix, run)?;
        self.factor.solve_in_place(&mut self.values);
        Ok(())
    }

    fn step(&self, node: u32) -> Vector3<f64> {
        let i = 3 * self.number[node as usize];
        Vector3::new(self.values[i], self.values[i + 1], self.values[i + 2])
    }
}
