//! Animations: keyframes of node properties.

use super::super::document::{self, Channel as Described, Sampler};
use super::super::{fault, input::Input, item};
use super::{INTERPOLATIONS, PROPERTIES};
use crate::mesh::MeshError;
use crate::mesh::model::articulation::{Animation, Articulation, Channel, ChannelInterpolation, Property};

/// All animations, and the number of ignored channels: those of unknown properties and those without a target.
pub(in super::super) fn read(input: &Input<'_>, tree: &Articulation) -> Result<(Vec<Animation>, usize), MeshError> {
    let (mut animations, mut skipped) = (Vec::new(), 0);
    for (k, described) in input.document.animations.iter().enumerate() {
        let mut channels: Vec<Channel> = Vec::new();
        for (c, channel) in described.channels.iter().enumerate() {
            let at = format!("/animations/{k}/channels/{c}");
            match channel_of(input, tree, described, channel, (k, &at))? {
                None => skipped += 1,
                Some(new) if channels.iter().any(|old| (old.node, old.property) == (new.node, new.property)) => {
                    return Err(fault(at, format!("a second channel for {:?} of node {}", new.property, new.node)));
                }
                Some(new) => channels.push(new),
            }
        }
        animations.push(Animation { name: described.name.clone(), channels });
    }
    Ok((animations, skipped))
}

/// Reads one channel; `None` if it is ignored.
fn channel_of(
    input: &Input<'_>,
    tree: &Articulation,
    animation: &document::Animation,
    channel: &Described,
    (number, at): (usize, &str),
) -> Result<Option<Channel>, MeshError> {
    // Sampler, property and node.
    let sampler = item(&animation.samplers, channel.sampler, at, "sampler")?;
    let named = PROPERTIES.iter().find(|(_, path, _)| *path == channel.target.path);
    let Some(&(property, _, kind)) = named else { return Ok(None) };
    let Some(node) = channel.target.node else { return Ok(None) };
    item(&tree.nodes, node, at, "node")?;
    let node = node as u32;
    // Numbers per value.
    let width = match property {
        Property::Rotation => 4,
        Property::Translation | Property::Scale => 3,
        Property::Weights => match tree.instance_at(node).map_or(0, |i| tree.instances[i].targets.len()) {
            // No morph target in the scene: the channel has no effect.
            0 => return Ok(None),
            targets => targets,
        },
    };
    let at = format!("/animations/{number}/samplers/{}", channel.sampler);
    // Keys: times and values, with matching counts and finite.
    let interpolation = interpolation(sampler, &at)?;
    let times = times(input, sampler)?;
    let values = input.values(sampler.output, &[kind])?;
    let needed = times.len() * interpolation.per_key() * width;
    if values.numbers.len() != needed {
        let told = format!("{} keys need {needed} numbers, and there are {}", times.len(), values.numbers.len());
        return Err(fault(at, told));
    }
    if let Some(k) = values.numbers.iter().position(|x| !x.is_finite()) {
        let key = k / (width * interpolation.per_key());
        return Err(fault(at, format!("the value of key {key} is not finite")));
    }
    Ok(Some(Channel { node, property, interpolation, times, values: values.numbers }))
}

fn interpolation(sampler: &Sampler, at: &str) -> Result<ChannelInterpolation, MeshError> {
    let name = sampler.interpolation.as_deref().unwrap_or("LINEAR");
    let known = INTERPOLATIONS.iter().find(|(_, known)| *known == name).map(|(interpolation, _)| *interpolation);
    let told = || format!("{name:?} is no interpolation (LINEAR, STEP, CUBICSPLINE)");
    known.ok_or_else(|| fault(format!("{at}/interpolation"), told()))
}

/// Checks that times are finite, strictly increasing, and not empty.
fn times(input: &Input<'_>, sampler: &Sampler) -> Result<Vec<f64>, MeshError> {
    let times = input.values(sampler.input, &["SCALAR"])?.numbers;
    let at = |k: usize| format!("/accessors/{}, item {k}", sampler.input);
    if times.is_empty() {
        return Err(fault(
            format!("/accessors/{}", sampler.input),
            "has no key times; an animation has at least one key",
        ));
    }
    if let Some(k) = times.iter().position(|t| !t.is_finite()) {
        return Err(fault(at(k), format!("key time {} is not finite", times[k])));
    }
    if let Some(k) = times.windows(2).position(|t| t[0] >= t[1]) {
        let (a, b) = (times[k], times[k + 1]);
        return Err(fault(at(k + 1), format!("key time {b} s does not follow {a} s; times of keys must ascend")));
    }
    Ok(times)
}
