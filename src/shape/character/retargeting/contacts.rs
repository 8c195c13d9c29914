//! Contacts of feet with the ground.
//!
//! A foot is on the ground while its ankle or its toes are lower than a twentieth of the leg above their lowest level and slower than half a
//! leg length per second; both are independent of scale. Shorter interruptions and contacts than two frames of film are noise.

use nalgebra::{Point3, Vector3};

/// Height above the level of the ground below which a point can be in contact, in leg lengths: 4 cm of a person, more than a sole flexes
/// and noise of markers, less than toes clear the ground in a step.
const HEIGHT: f64 = 0.05;
/// Speed below which it can be, in leg lengths per second: .4 m/s of a person; feet swing at 3 to 5 m/s and are slower than this for less
/// than a twentieth of a second as they turn.
const SPEED: f64 = 0.5;
/// Shortest contact and shortest interruption, s.
const SHORTEST: f64 = 0.08;
/// Difference between the lowest level in the motion and that at rest from which the rest pose does not stand on the ground, in leg lengths.
const FLOATS: f64 = 0.1;

/// The point of a foot that is on the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sole {
    Ankle,
    Toes,
}

/// Samples `first ..= last` during which a point is on the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Contact {
    pub(super) point: Sole,
    pub(super) first: usize,
    pub(super) last: usize,
}

/// Level of a point: that at rest; the lowest of the motion, where the rest pose does not stand on the ground.
pub(super) fn level(path: &[Point3<f64>], rest: &Point3<f64>, up: &Vector3<f64>, length: f64) -> f64 {
    let mut heights: Vec<f64> = path.iter().map(|p| p.coords.dot(up)).collect();
    heights.sort_by(f64::total_cmp);
    // One sample in twenty may be below.
    let lowest = heights[heights.len() / 20];
    let at_rest = rest.coords.dot(up);
    if (lowest - at_rest).abs() > FLOATS * length { lowest } else { at_rest }
}

/// Contacts of a foot, in order, from the paths of ankle and toes above their levels.
pub(super) fn contacts(
    times: &[f64],
    paths: &[(Sole, Vec<Point3<f64>>, f64)],
    up: &Vector3<f64>,
    length: f64,
) -> Vec<Contact> {
    let on_ground: Vec<Vec<bool>> = paths
        .iter()
        .map(|(_, path, level)| {
            let near = |k: usize| path[k].coords.dot(up) - level < HEIGHT * length;
            let slow = |k: usize| speed(times, path, k) < SPEED * length;
            smoothed(times, (0..times.len()).map(|k| near(k) && slow(k)).collect())
        })
        .collect();
    // The toes count where both are on the ground: the ankle rolls over them.
    let at = |k: usize| (0..paths.len()).rev().find(|p| on_ground[*p][k]).map(|p| paths[p].0);
    let mut contacts: Vec<Contact> = Vec::new();
    for k in 0..times.len() {
        let Some(point) = at(k) else { continue };
        match contacts.last_mut() {
            Some(last) if last.point == point && last.last + 1 == k => last.last = k,
            _ => contacts.push(Contact { point, first: k, last: k }),
        }
    }
    contacts
}

/// Speed at a sample, from its neighbors.
fn speed(times: &[f64], path: &[Point3<f64>], k: usize) -> f64 {
    let (before, after) = (k.saturating_sub(1), (k + 1).min(times.len() - 1));
    let duration = times[after] - times[before];
    if duration > 0.0 { (path[after] - path[before]).norm() / duration } else { 0.0 }
}

/// Without interruptions and then without runs that are shorter than [`SHORTEST`]; those at the ends of the motion may go on beyond it.
fn smoothed(times: &[f64], mut on: Vec<bool>) -> Vec<bool> {
    for value in [false, true] {
        let mut k = 0;
        while k < on.len() {
            let end = (k..on.len()).find(|e| on[*e] != on[k]).unwrap_or(on.len());
            if on[k] == value && k > 0 && end < on.len() && times[end] - times[k] < SHORTEST {
                on[k..end].fill(!value);
            }
            k = end;
        }
    }
    on
}
