//! Feet held on the ground.
//!
//! During a contact the point of the foot that is on the ground follows that of the source,
//!
//! ```text
//! x̂(t) = s R y(t) + d        horizontally, d the mean of x(t) − s R y(t) over the contact
//! x̂(t) = g + s (y(t) − h)    in height, g and h the levels of the ground of target and source
//! ```
//!
//! with `x` the point of the target as rotations alone give it. Contacts that follow one another without a gap, as a foot rolls from the ankle
//! to the toes, are joined at the longest. Displacements `x̂ − x` are interpolated between contacts (smoothstep), so that no velocity jumps.

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::alignment::{Alignment, Leg};
use super::contacts::{Contact, Sole, contacts, level};
use super::sampling::Motion;
use super::transfer::place;
use super::{FootReport, RetargetingReport};
use crate::character::ik::{Frames, Goal, IkOptions, Target, solve};
use crate::character::{CharacterError, Pose, Skeleton};
use plumbline_num::run::Run;

/// Distance of a foot from the top of its leg that counts as reached, as a fraction of the length of the leg: at full length the knee
/// would snap.
const STRAIGHT: f64 = 0.998;
/// Time over which the root is lowered and raised, s.
const EASE: f64 = 0.15;
/// Displacement below which a foot is where it should be, in leg lengths.
const SMALL: f64 = 1e-9;
/// Steps of inverse kinematics for a foot: its initial guess is near.
const ITERATIONS: usize = 60;

/// A foot with what holds it.
struct Foot<'a> {
    leg: &'a Leg,
    contacts: Vec<Contact>,
    /// Displacement of the foot by sample.
    displacement: Vec<Vector3<f64>>,
    paths: Paths,
}

/// Paths of a foot.
struct Paths {
    /// Ankle and toes of the source in the world of the target at its scale: `s R y`.
    source: [Vec<Point3<f64>>; 2],
    /// Those of the target, by rotations alone.
    target: [Vec<Point3<f64>>; 2],
    /// Levels of the ground under these, in the world of the target.
    levels: [[f64; 2]; 2],
}

/// Holds the feet of all poses, and reports how.
pub(super) fn hold_feet(
    times: &[f64],
    motion: &Motion,
    target: &Skeleton,
    alignment: &Alignment,
    poses: &mut [Pose],
    report: &mut RetargetingReport,
    run: &Run,
) -> Result<(), CharacterError> {
    let positions = |pose: &Pose| Frames::of(target, pose).map(|frames| frames.positions());
    let free: Vec<Vec<Point3<f64>>> = poses.iter().map(positions).collect::<Result<_, _>>()?;
    let feet: Vec<Foot<'_>> =
        alignment.legs.iter().map(|leg| Foot::new(times, motion, &free, alignment, leg)).collect();
    let lowered = lowered(times, &free, &feet, alignment);
    let up = alignment.up[1];
    for (k, pose) in poses.iter_mut().enumerate() {
        run.check()?;
        let moved = feet.iter().any(|foot| foot.displacement[k].norm() > SMALL * foot.leg.length[1]);
        if !moved && lowered[k] == 0.0 {
            continue;
        }
        let rotations = Frames::chained(target, pose).rotation;
        let goals: Vec<(Point3<f64>, UnitQuaternion<f64>)> = feet
            .iter()
            .map(|foot| {
                (free[k][foot.leg.foot[1] as usize] + foot.displacement[k], rotations[foot.leg.foot[1] as usize])
            })
            .collect();
        if let Some([_, root]) = alignment.root.filter(|_| lowered[k] > 0.0) {
            let at = free[k][root as usize] - up * lowered[k];
            place(target, pose, root, &at)?;
        }
        for (foot, (at, rotation)) in feet.iter().zip(goals) {
            let missed = reach(target, pose, foot.leg, at, rotation, run)?;
            report.missed = report.missed.max(missed / foot.leg.length[1]);
        }
    }
    let held: Vec<Vec<Point3<f64>>> = poses.iter().map(positions).collect::<Result<_, _>>()?;
    report.feet = feet.iter().map(|foot| foot.report(times, &held, alignment)).collect();
    Ok(())
}

/// Moves a foot by its leg; returns the distance that is left.
fn reach(
    target: &Skeleton,
    pose: &mut Pose,
    leg: &Leg,
    at: Point3<f64>,
    rotation: UnitQuaternion<f64>,
    run: &Run,
) -> Result<f64, CharacterError> {
    let foot = leg.foot[1];
    let goal = |goal: Goal| Target { joint: foot, goal, weight: 1.0, chain: Some(leg.chain) };
    // The position counts more, where limits of the ankle oppose it.
    let position = Target { weight: 10.0, ..goal(Goal::Position { point: Point3::origin(), at }) };
    let targets = [position, goal(Goal::Orientation(rotation))];
    let options = IkOptions { iterations: ITERATIONS, ..IkOptions::default() };
    let found = solve(target, pose, &targets, &options, run)?;
    *pose = found.pose;
    Ok(found.residuals[0])
}

impl<'a> Foot<'a> {
    fn new(times: &[f64], motion: &Motion, free: &[Vec<Point3<f64>>], alignment: &Alignment, leg: &'a Leg) -> Self {
        let paths = Paths::new(motion, free, alignment, leg);
        let scaled = alignment.scale * leg.length[0];
        let points = [Sole::Ankle, Sole::Toes].into_iter().zip(&paths.source).zip(paths.levels[0]);
        let points: Vec<_> = points.map(|((sole, path), level)| (sole, path.clone(), level)).collect();
        let known = if leg.toes.is_some() { 2 } else { 1 };
        let contacts = contacts(times, &points[..known], &alignment.up[1], scaled);
        let mut foot = Self { leg, contacts, displacement: vec![Vector3::zeros(); times.len()], paths };
        foot.displace(times, alignment);
        foot
    }

    /// Displacements during contacts, and between them.
    fn displace(&mut self, times: &[f64], alignment: &Alignment) {
        let up = alignment.up[1];
        let flat = |v: Vector3<f64>| v - up * up.dot(&v);
        let offset = |c: &Contact, k: usize| {
            flat(self.paths.source[c.point as usize][k] - self.paths.target[c.point as usize][k])
        };
        let lift = |point: Sole, k: usize| {
            let p = point as usize;
            let (y, x) = (self.paths.source[p][k].coords.dot(&up), self.paths.target[p][k].coords.dot(&up));
            self.paths.levels[1][p] + (y - self.paths.levels[0][p]) - x
        };
        let mean = |c: &Contact| {
            let count = (c.last - c.first + 1) as f64;
            (c.first..=c.last).map(|k| offset(c, k)).sum::<Vector3<f64>>() / count
        };
        let joined = |a: &Contact, b: &Contact| a.last + 1 == b.first;
        let mut held = vec![false; times.len()];
        let mut displacement = vec![Vector3::zeros(); times.len()];
        let mut fill = |c: &Contact, constant: Vector3<f64>| {
            for k in c.first..=c.last {
                displacement[k] = offset(c, k) - constant + up * lift(c.point, k);
                held[k] = true;
            }
        };
        let mut begin = 0;
        while begin < self.contacts.len() {
            let next = (begin + 1..self.contacts.len()).find(|k| !joined(&self.contacts[k - 1], &self.contacts[*k]));
            let end = next.unwrap_or(self.contacts.len());
            let plant = &self.contacts[begin..end];
            let longest =
                (0..plant.len()).max_by_key(|k| (plant[*k].last - plant[*k].first, std::cmp::Reverse(*k))).unwrap_or(0);
            // A foot that rolls goes on where it was.
            let mut constants = vec![mean(&plant[longest]); plant.len()];
            for k in longest + 1..plant.len() {
                let at = plant[k].first;
                constants[k] = constants[k - 1] + offset(&plant[k], at) - offset(&plant[k - 1], at);
            }
            for k in (0..longest).rev() {
                let at = plant[k].last;
                constants[k] = constants[k + 1] + offset(&plant[k], at) - offset(&plant[k + 1], at);
            }
            plant.iter().zip(constants).for_each(|(c, constant)| fill(c, constant));
            begin = end;
        }
        interpolate(times, &held, &mut displacement);
        // A foot that swings stays above the ground as far as that of the source does.
        let points = if self.leg.toes.is_some() { 2 } else { 1 };
        for k in (0..times.len()).filter(|k| !held[*k]) {
            for p in 0..points {
                let depth = (self.paths.source[p][k].coords.dot(&up) - self.paths.levels[0][p]).min(0.0);
                let x = self.paths.target[p][k].coords.dot(&up) + displacement[k].dot(&up);
                displacement[k] += up * (self.paths.levels[1][p] + depth - x).max(0.0);
            }
        }
        self.displacement = displacement;
    }

    fn report(&self, times: &[f64], held: &[Vec<Point3<f64>>], alignment: &Alignment) -> FootReport {
        let up = alignment.up[1];
        let length = self.leg.length[1];
        let toes = self.leg.toes.unwrap_or(self.leg.foot)[1] as usize;
        let at = |c: &Contact, k: usize| held[k][if c.point == Sole::Ankle { self.leg.foot[1] as usize } else { toes }];
        let slide = |c: &Contact, at: &dyn Fn(&Contact, usize) -> Point3<f64>| {
            let flat = |k: usize| {
                let v = at(c, k).coords;
                v - up * up.dot(&v)
            };
            (c.first..=c.last).map(|k| (flat(k) - flat(c.first)).norm()).fold(0.0, f64::max) / length
        };
        let largest = |at: &dyn Fn(&Contact, usize) -> Point3<f64>| {
            self.contacts.iter().map(|c| slide(c, at)).fold(0.0, f64::max)
        };
        let height = |c: &Contact| {
            let above = |k: usize| (at(c, k).coords.dot(&up) - self.paths.levels[1][c.point as usize]).abs();
            (c.first..=c.last).map(above).fold(0.0, f64::max) / length
        };
        let plants = self.contacts.windows(2).filter(|pair| pair[0].last + 1 < pair[1].first).count();
        FootReport {
            joint: self.leg.foot[1],
            contacts: if self.contacts.is_empty() { 0 } else { plants + 1 },
            seconds: self.contacts.iter().map(|c| times[c.last] - times[c.first]).sum(),
            slide: largest(&at),
            source_slide: largest(&|c: &Contact, k| self.paths.source[c.point as usize][k]),
            free_slide: largest(&|c: &Contact, k| self.paths.target[c.point as usize][k]),
            height: self.contacts.iter().map(height).fold(0.0, f64::max),
        }
    }
}

impl Paths {
    fn new(motion: &Motion, free: &[Vec<Point3<f64>>], alignment: &Alignment, leg: &Leg) -> Self {
        let toes = leg.toes.unwrap_or(leg.foot);
        let scaled = |p: &Point3<f64>| Point3::from(alignment.rotation * p.coords * alignment.scale);
        let source = |joint: u32| motion.positions.iter().map(|at| scaled(&at[joint as usize])).collect::<Vec<_>>();
        let target = |joint: u32| free.iter().map(|at| at[joint as usize]).collect::<Vec<_>>();
        let source = [source(leg.foot[0]), source(toes[0])];
        let up = alignment.up[1];
        let level_s = |path: &[Point3<f64>], joint: u32| {
            level(path, &scaled(&alignment.at[0][joint as usize]), &up, alignment.scale * leg.length[0])
        };
        let level_t = |joint: u32| alignment.at[1][joint as usize].coords.dot(&up);
        Self {
            levels: [
                [level_s(&source[0], leg.foot[0]), level_s(&source[1], toes[0])],
                [level_t(leg.foot[1]), level_t(toes[1])],
            ],
            source,
            target: [target(leg.foot[1]), target(toes[1])],
        }
    }
}

/// Interpolates displacements between held samples; before the first and after the last they stay.
fn interpolate(times: &[f64], held: &[bool], displacement: &mut [Vector3<f64>]) {
    let fixed: Vec<usize> = (0..held.len()).filter(|k| held[*k]).collect();
    let (Some(&first), Some(&last)) = (fixed.first(), fixed.last()) else { return };
    let (before, after) = (displacement[first], displacement[last]);
    displacement[..first].fill(before);
    displacement[last + 1..].fill(after);
    for pair in fixed.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        for k in a + 1..b {
            let u = (times[k] - times[a]) / (times[b] - times[a]);
            displacement[k] = displacement[a] + (displacement[b] - displacement[a]) * (u * u * (3.0 - 2.0 * u));
        }
    }
}

/// How far the root is lowered at each sample, so that legs reach their feet; a little before and after, too.
fn lowered(times: &[f64], free: &[Vec<Point3<f64>>], feet: &[Foot<'_>], alignment: &Alignment) -> Vec<f64> {
    let up = alignment.up[1];
    let needed = |k: usize| {
        let of = |foot: &Foot<'_>| {
            let length = STRAIGHT * foot.leg.length[1];
            let top = free[k][foot.leg.top[1] as usize];
            let now = (top - free[k][foot.leg.foot[1] as usize]).norm();
            let along = top - (free[k][foot.leg.foot[1] as usize] + foot.displacement[k]);
            // |along − δ up| = length, with the smaller δ; a leg that is straight already may stay so.
            let length = length.max(now);
            let b = along.dot(&up);
            let inside = b * b - (along.norm_squared() - length * length);
            if along.norm() <= length || inside < 0.0 { 0.0 } else { (b - inside.sqrt()).max(0.0) }
        };
        feet.iter().map(of).fold(0.0, f64::max)
    };
    let needed: Vec<f64> = (0..times.len()).map(needed).collect();
    if needed.iter().all(|n| *n <= SMALL) {
        return vec![0.0; times.len()];
    }
    let around = |k: usize| {
        let first = times.partition_point(|t| *t < times[k] - EASE);
        let last = times.partition_point(|t| *t <= times[k] + EASE);
        first..last
    };
    // The mean of the maxima over a window is no less than what its middle needs.
    let most: Vec<f64> = (0..times.len()).map(|k| needed[around(k)].iter().copied().fold(0.0, f64::max)).collect();
    (0..times.len()).map(|k| most[around(k)].iter().sum::<f64>() / around(k).len() as f64).collect()
}
