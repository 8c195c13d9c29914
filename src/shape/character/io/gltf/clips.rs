//! Node animations as clips.

use super::joints::Joints;
use crate::character::{
    CharacterError, Clip, Curve, Interpolation, Keys, MorphTrack, RigFileError, RotationKeys, Track,
};
use crate::mesh::NO_VALUE;
use crate::mesh::model::articulation::{Articulation, Channel, ChannelInterpolation, Property};

/// The clips; channels of nodes that are not joints are dropped with a warning.
pub(super) fn read(
    articulation: &Articulation,
    joints: &Joints,
    warnings: &mut Vec<String>,
) -> Result<Vec<Clip>, RigFileError> {
    let mut first_target = Vec::new();
    let mut targets = 0;
    for instance in &articulation.instances {
        first_target.push(targets as u32);
        targets += instance.targets.len();
    }
    let (mut clips, mut skipped): (Vec<Clip>, usize) = (Vec::new(), 0);
    for (k, animation) in articulation.animations.iter().enumerate() {
        let (mut tracks, mut morphs) = (Vec::new(), Vec::new());
        for channel in &animation.channels {
            let joint = joints.of_node[channel.node as usize];
            match channel.property {
                Property::Weights => {
                    let instance = articulation.instance_at(channel.node);
                    morphs.extend(
                        instance.map(|i| morph_tracks(channel, first_target[i])).transpose()?.into_iter().flatten(),
                    );
                }
                _ if joint == NO_VALUE => skipped += 1,
                _ => tracks.push(Track { joint, curve: curve(channel)? }),
            }
        }
        let base = animation.name.clone().filter(|n| !n.is_empty()).unwrap_or_else(|| format!("clip {k}"));
        let same = clips.iter().filter(|c| c.name() == base).count();
        let name = if same > 0 { format!("{base} ({})", k + 1) } else { base };
        clips.push(Clip::new(name, tracks, morphs)?);
    }
    if skipped > 0 {
        warnings.push(format!("channels of nodes that move no part of the surface are left out ({skipped})"));
    }
    Ok(clips)
}

fn curve(channel: &Channel) -> Result<Curve, CharacterError> {
    Ok(match channel.property {
        Property::Translation => Curve::Translation(keys(channel, 3, 0)?),
        Property::Scale => Curve::Scale(keys(channel, 3, 0)?),
        Property::Rotation | Property::Weights => Curve::Rotation(RotationKeys::new(keys(channel, 4, 0)?)?),
    })
}

fn morph_tracks(channel: &Channel, first: u32) -> Result<Vec<MorphTrack>, CharacterError> {
    let width = channel.values.len() / (channel.times.len() * channel.interpolation.per_key());
    let track = |k: usize| Ok(MorphTrack { target: first + k as u32, keys: keys(channel, width, k)? });
    (0..width).map(track).collect()
}

/// `N` components from component `from` of rows of `width`.
fn keys<const N: usize>(channel: &Channel, width: usize, from: usize) -> Result<Keys<N>, CharacterError> {
    let rows: Vec<[f64; N]> =
        channel.values.chunks_exact(width).map(|row| std::array::from_fn(|k| row[from + k])).collect();
    let (values, interpolation) = match channel.interpolation {
        ChannelInterpolation::Step => (rows, Interpolation::Step),
        ChannelInterpolation::Linear => (rows, Interpolation::Linear),
        ChannelInterpolation::CubicSpline => {
            let part = |p: usize| rows.iter().skip(p).step_by(3).copied().collect::<Vec<_>>();
            (part(1), Interpolation::Cubic { arriving: part(0), leaving: part(2) })
        }
    };
    Keys::new(channel.times.clone(), values, interpolation)
}
