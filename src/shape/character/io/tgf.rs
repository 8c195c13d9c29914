//! Trivial graph files (`.tgf`): joints and the bones between them.
//!
//! ```text
//! 1 0.1 0.2 0.3         index, position; the rest of the line is ignored
//! 2 0.5 0.2 0.3
//! #
//! 1 2                   a bone, from the parent to the child
//! #                     further sections are ignored
//! ```
//!
//! If no joint has two parents, bones are directed from parent to child; otherwise the first joint of each component is the root and bones
//! lead away from it. Joints are named by their indices.

use std::collections::HashMap;
use std::fmt::Write as _;

use nalgebra::Vector3;

use super::Rig;
use super::text::{malformed, shown};
use crate::character::skeleton::MAX_JOINTS;
use crate::character::{Joint, RigFileError, Skeleton};
use plumbline_num::math::Trs;

const FORMAT: &str = "TGF";

/// Parses a skeleton.
///
/// # Errors
/// [`RigFileError::Content`], and errors of the joints.
pub fn parse_tgf(text: &str) -> Result<Rig, RigFileError> {
    let (mut number_of, mut at): (HashMap<&str, u32>, Vec<Vector3<f64>>) = (HashMap::new(), Vec::new());
    let (mut names, mut edges) = (Vec::new(), Vec::new());
    let (mut section, mut skipped) = (0, 0);
    for (k, line) in text.lines().enumerate() {
        let fault = |told: String| malformed(FORMAT, k + 1, told);
        let words: Vec<&str> = line.split_whitespace().collect();
        match (section, words.as_slice()) {
            (_, []) => {}
            (_, [word, ..]) if word.starts_with('#') => section += 1,
            (0, [name, position @ ..]) => {
                let number = |i: usize| position.get(i).and_then(|w| w.parse().ok()).filter(|x: &f64| x.is_finite());
                let [Some(x), Some(y), Some(z)] = [number(0), number(1), number(2)] else {
                    return Err(fault(format!("joint {} needs three finite numbers for its place", shown(name))));
                };
                if at.len() >= MAX_JOINTS {
                    return Err(fault(format!("more than {MAX_JOINTS} joints")));
                }
                if number_of.insert(name, at.len() as u32).is_some() {
                    return Err(fault(format!("a second joint {}", shown(name))));
                }
                at.push(Vector3::new(x, y, z));
                names.push((*name).to_owned());
            }
            (1, [a, b, ..]) => {
                let missing = |name: &str| fault(format!("there is no joint {}", shown(name)));
                let known = |name: &str| number_of.get(name).copied().ok_or_else(|| missing(name));
                edges.push((k + 1, [known(a)?, known(b)?]));
            }
            (1, _) => return Err(fault("a bone needs two joints".to_owned())),
            _ => skipped += 1,
        }
    }
    let parents = parents(at.len(), &edges)?;
    let joint = |(j, name): (usize, String)| {
        let from = parents[j].map_or_else(Vector3::zeros, |p| at[p as usize]);
        Joint { name, parent: parents[j], rest: Trs::from_translation(at[j] - from), limits: None }
    };
    let skeleton = Skeleton::new(names.into_iter().enumerate().map(joint).collect())?;
    let warnings =
        if skipped > 0 { vec![format!("lines after the bones are left out ({skipped})")] } else { Vec::new() };
    Ok(Rig { skeleton, clips: Vec::new(), warnings })
}

/// A line number and a bone.
type Edge = (usize, [u32; 2]);

fn parents(joints: usize, edges: &[Edge]) -> Result<Vec<Option<u32>>, RigFileError> {
    let mut directed = vec![None; joints];
    let twice = edges.iter().any(|(_, [a, b])| directed[*b as usize].replace(*a).is_some());
    if !twice {
        return Ok(directed);
    }
    let mut beside: Vec<Vec<(usize, u32)>> = vec![Vec::new(); joints];
    for &(line, [a, b]) in edges {
        beside[a as usize].push((line, b));
        beside[b as usize].push((line, a));
    }
    let (mut parents, mut seen) = (vec![None; joints], vec![false; joints]);
    for root in 0..joints {
        let mut open = vec![root];
        if std::mem::replace(&mut seen[root], true) {
            continue;
        }
        while let Some(j) = open.pop() {
            let above = parents[j];
            for &(line, other) in beside[j].iter().filter(|(_, other)| above != Some(*other)) {
                if std::mem::replace(&mut seen[other as usize], true) {
                    return Err(malformed(FORMAT, line, "this bone closes a cycle; a skeleton is a tree"));
                }
                parents[other as usize] = Some(j as u32);
                open.push(other as usize);
            }
        }
    }
    Ok(parents)
}

/// Writes the joints at rest as a graph, numbered from 1.
pub fn tgf_text(skeleton: &Skeleton) -> String {
    let mut text = String::new();
    for (k, p) in skeleton.rest_positions().iter().enumerate() {
        let _ = writeln!(text, "{} {} {} {}", k + 1, p.x, p.y, p.z);
    }
    text.push_str("#\n");
    for (k, joint) in skeleton.joints().iter().enumerate() {
        if let Some(parent) = joint.parent {
            let _ = writeln!(text, "{} {}", parent + 1, k + 1);
        }
    }
    text
}
