//! Animation stacks as animations.
//!
//! A curve node connects three curves (`d|X`, `d|Y`, `d|Z`) to a translation, rotation or scale of a node, or one to the weight of a
//! blend shape. Of a stack of layers the first that moves a property is read.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::curve::{AnimationCurve, Side};
use super::document::{Document, Kind};
use super::properties::properties;
use super::sampling::{MAX_ANGLE, MAX_DEVIATION, Samples, Source};
use super::transform::NodeParts;
use crate::mesh::MeshError;
use crate::mesh::model::articulation::{Animation, Channel, ChannelInterpolation, Property};

/// A node that may be animated.
pub(super) struct Animated<'a> {
    pub(super) model: u32,
    pub(super) parts: &'a NodeParts,
    /// Factor of its scale.
    pub(super) scale: f64,
    pub(super) approximate: bool,
}

/// Morph targets of an instance: its node, and the channel and rest weight of each target.
pub(super) struct Morphed {
    pub(super) node: u32,
    pub(super) channels: Vec<(u32, f64)>,
}

/// The animations, and what is left out of them.
#[derive(Default)]
pub(super) struct Read {
    pub(super) animations: Vec<Animation>,
    /// Curve nodes of further layers.
    pub(super) layers: usize,
    /// Animated nodes whose inheritance of scale is approximated.
    pub(super) approximate: usize,
    /// Channels that would need more samples for the tolerance.
    pub(super) coarse: usize,
}

/// Reads all stacks that move something.
pub(super) fn read(
    document: &Document<'_, '_>,
    nodes: &[Animated<'_>],
    morphed: &[Morphed],
) -> Result<Read, MeshError> {
    let stack_of = stacks(document)?;
    let mut read = Read::default();
    // Curve nodes by stack, what they move, and layer.
    let mut found: Vec<(u32, Moved, u32, u32)> = Vec::new();
    for (node, animated) in nodes.iter().enumerate() {
        for link in document.links(animated.model) {
            let property = match link.property {
                b"Lcl Translation" => Property::Translation,
                b"Lcl Rotation" => Property::Rotation,
                b"Lcl Scaling" => Property::Scale,
                _ => continue,
            };
            if let Some((stack, layer)) = stack_of[link.object as usize] {
                found.push((stack, Moved::Node(node as u32, property as u8), layer, link.object));
            }
        }
    }
    for (k, morphed) in morphed.iter().enumerate() {
        for (target, &(channel, _)) in morphed.channels.iter().enumerate() {
            document.open(channel)?;
            for link in document.links(channel).iter().filter(|link| link.property == b"DeformPercent") {
                if let Some((stack, layer)) = stack_of[link.object as usize] {
                    found.push((stack, Moved::Target(k as u32, target as u32), layer, link.object));
                }
            }
        }
    }
    found.sort_unstable();
    let all = found.len();
    found.dedup_by_key(|&mut (stack, moved, ..)| (stack, moved));
    read.layers = all - found.len();
    for of_stack in found.chunk_by(|a, b| a.0 == b.0) {
        let mut channels = Vec::new();
        for moved in of_stack.chunk_by(|a, b| a.1.object() == b.1.object()) {
            document.reader.run.check()?;
            match moved[0].1 {
                Moved::Node(node, _) => {
                    let animated = &nodes[node as usize];
                    read.approximate += usize::from(animated.approximate);
                    node_channels(document, node, animated, moved, &mut channels, &mut read.coarse)?;
                }
                Moved::Target(k, _) => {
                    let morphed = &morphed[k as usize];
                    channels.extend(weights_channel(document, morphed, moved, &mut read.coarse)?);
                }
            }
        }
        let name = Some(document.name(of_stack[0].0)).filter(|n| !n.is_empty());
        read.animations.push(Animation { name, channels });
    }
    Ok(read)
}

/// What a curve node moves: a property of a node, or a target of an instance.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Moved {
    Node(u32, u8),
    Target(u32, u32),
}

impl Moved {
    fn object(self) -> (bool, u32) {
        match self {
            Self::Node(node, _) => (false, node),
            Self::Target(instance, _) => (true, instance),
        }
    }
}

/// The stack and the number of the layer of each curve node, by object.
fn stacks(document: &Document<'_, '_>) -> Result<Vec<Option<(u32, u32)>>, MeshError> {
    let mut of_object = vec![None; document.objects.len()];
    let mut seen = vec![false; document.objects.len()];
    for stack in document.all(Kind::AnimationStack) {
        document.open(stack)?;
        for (number, layer) in document.parts(stack, Kind::AnimationLayer).enumerate() {
            if std::mem::replace(&mut seen[layer as usize], true) {
                continue;
            }
            for node in document.parts(layer, Kind::CurveNode) {
                of_object[node as usize].get_or_insert((stack, number as u32));
            }
        }
    }
    Ok(of_object)
}

/// Curves of up to three numbers, and the numbers without a curve.
struct Curves {
    curves: [Option<AnimationCurve>; 3],
    rest: Vector3<f64>,
}

impl Curves {
    fn read(document: &Document<'_, '_>, node: u32, rest: Vector3<f64>) -> Result<Self, MeshError> {
        document.open(node)?;
        let mut read = Self { curves: [None, None, None], rest };
        for (name, numbers) in properties(&document.reader.tree, document.object(node).record) {
            match name {
                b"d|X" | b"d|DeformPercent" => numbers.set(&mut read.rest.x),
                b"d|Y" => numbers.set(&mut read.rest.y),
                b"d|Z" => numbers.set(&mut read.rest.z),
                _ => {}
            }
        }
        for link in document.links(node).iter().filter(|l| document.object(l.object).kind == Kind::Curve) {
            let axis = match link.property {
                b"d|X" | b"d|DeformPercent" => 0,
                b"d|Y" => 1,
                b"d|Z" => 2,
                _ => continue,
            };
            if read.curves[axis].is_none() {
                read.curves[axis] = AnimationCurve::read(document, link.object)?;
            }
        }
        Ok(read)
    }

    fn at(&self, time: f64, side: Side) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| self.curves[axis].as_ref().map_or(self.rest[axis], |curve| curve.at(time, side)))
    }

    fn present(&self) -> impl Iterator<Item = &AnimationCurve> {
        self.curves.iter().flatten()
    }
}

/// Key times of curves, ascending; 0 without any.
fn union<'c>(curves: impl Iterator<Item = &'c AnimationCurve>) -> Vec<f64> {
    let mut times: Vec<f64> = curves.flat_map(AnimationCurve::times).copied().collect();
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();
    if times.is_empty() {
        times.push(0.0);
    }
    times
}

/// The channels of a node.
fn node_channels(
    document: &Document<'_, '_>,
    node: u32,
    animated: &Animated<'_>,
    moved: &[(u32, Moved, u32, u32)],
    channels: &mut Vec<Channel>,
    coarse: &mut usize,
) -> Result<(), MeshError> {
    let parts = animated.parts;
    let rest = |rest: Vector3<f64>| Curves { curves: [None, None, None], rest };
    let mut of_property = [rest(parts.translation), rest(parts.rotation), rest(parts.scaling)];
    let mut is_moved = [false; 3];
    for &(_, moved, _, curve_node) in moved {
        if let Moved::Node(_, property) = moved {
            let k = property as usize % 3;
            of_property[k] = Curves::read(document, curve_node, of_property[k].rest)?;
            is_moved[k] = true;
        }
    }
    let [translation, rotation, scale] = &of_property;
    let frame = |time: f64, side: Side| {
        parts.frame(translation.at(time, side), rotation.at(time, side), scale.at(time, side) * animated.scale)
    };
    let swing = |start: f64, end: f64| (rotation.at(end, Side::Before) - rotation.at(start, Side::After)).amax();
    let reader = document.reader;
    let mut add = |property: Property, samples: Vec<f64>, times: Vec<f64>, stepped: bool| {
        let interpolation = if stepped { ChannelInterpolation::Step } else { ChannelInterpolation::Linear };
        channels.push(Channel { node, property, interpolation, times, values: samples });
    };
    let check = |keys: &[f64]| {
        let told = || document.fault(animated.model, "its animations have too many keys for the size of the file");
        reader.spend_samples(keys.len()).then_some(()).ok_or_else(told)
    };
    // Vectors: translations with pivots follow the rotation and the scale too.
    let pivots = parts.has_pivots();
    for (property, k) in [(Property::Translation, 0), (Property::Scale, 2)] {
        let swings = k == 0 && pivots && is_moved[1];
        let all = k == 0 && pivots;
        let is_kept = is_moved[k] || all && is_moved.contains(&true);
        if !is_kept {
            continue;
        }
        let curves = || of_property.iter().enumerate().filter(|&(j, _)| j == k || all).flat_map(|(_, c)| c.present());
        let keys = union(curves());
        check(&keys)?;
        let at = |time: f64, side: Side| -> [f64; 3] {
            let frame = frame(time, side);
            if k == 0 { frame.translation } else { frame.scale }.into()
        };
        let stepped = curves().count() > 0 && curves().all(AnimationCurve::is_stepped);
        let range = range(&keys, &at) + if swings { parts.pivot_length() } else { 0.0 };
        let (samples, refused) = Source {
            keys: &keys,
            at: &at,
            between: &|a, b, u| std::array::from_fn(|c| a[c] * (1.0 - u) + b[c] * u),
            difference: &|a, b| (Vector3::from(*a) - Vector3::from(*b)).amax(),
            tolerance: MAX_DEVIATION * range,
            swing: &|start, end| if swings { swing(start, end) } else { 0.0 },
            stepped,
        }
        .samples(&|count| reader.spend_samples(count));
        *coarse += usize::from(refused);
        add(property, samples.values.into_flattened(), samples.times, stepped);
    }
    if is_moved[1] {
        let keys = union(rotation.present());
        check(&keys)?;
        let stepped = rotation.present().count() > 0 && rotation.present().all(AnimationCurve::is_stepped);
        let (mut samples, refused) = Source {
            keys: &keys,
            at: &|time, side| parts.quaternion(rotation.at(time, side)).coords.into(),
            between: &between_rotations,
            difference: &|a, b| unit(a).angle_to(&unit(b)),
            tolerance: MAX_ANGLE,
            swing: &swing,
            stepped,
        }
        .samples(&|count| reader.spend_samples(count));
        *coarse += usize::from(refused);
        continuous(&mut samples);
        add(Property::Rotation, samples.values.into_flattened(), samples.times, stepped);
    }
    Ok(())
}

/// Largest difference of the values at the keys in any coordinate.
fn range(keys: &[f64], at: &dyn Fn(f64, Side) -> [f64; 3]) -> f64 {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for value in keys.iter().map(|&t| Vector3::from(at(t, Side::After))) {
        low = low.inf(&value);
        high = high.sup(&value);
    }
    (high - low).amax()
}

fn unit(coordinates: &[f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::from(*coordinates))
}

/// Spherical linear interpolation on the shortest path.
fn between_rotations(a: &[f64; 4], b: &[f64; 4], u: f64) -> [f64; 4] {
    let [a, b] = [unit(a), unit(b)];
    (a * UnitQuaternion::from_scaled_axis((a.inverse() * b).scaled_axis() * u)).coords.into()
}

/// Signs of quaternions such that each is on the side of the one before.
fn continuous(samples: &mut Samples<4>) {
    for k in 1..samples.values.len() {
        let before = samples.values[k - 1];
        let dot: f64 = before.iter().zip(&samples.values[k]).map(|(a, b)| a * b).sum();
        if dot < 0.0 {
            samples.values[k] = samples.values[k].map(|x| -x);
        }
    }
}

/// The channel of the weights of all targets of an instance; `None` where all keep their weights at rest.
fn weights_channel(
    document: &Document<'_, '_>,
    morphed: &Morphed,
    moved: &[(u32, Moved, u32, u32)],
    coarse: &mut usize,
) -> Result<Option<Channel>, MeshError> {
    let mut of_target: Vec<Option<Curves>> = morphed.channels.iter().map(|_| None).collect();
    for &(_, moved, _, curve_node) in moved {
        if let Moved::Target(_, target) = moved {
            let rest = Vector3::repeat(100.0 * morphed.channels[target as usize].1);
            of_target[target as usize] = Some(Curves::read(document, curve_node, rest)?);
        }
    }
    let percent = |curves: &Curves, time: f64, side: Side| [curves.at(time, side).x];
    let reader = document.reader;
    let mut times = Vec::new();
    for curves in of_target.iter().flatten() {
        let keys = union(curves.curves[0].iter());
        let (samples, refused) = Source {
            keys: &keys,
            at: &|time, side| percent(curves, time, side),
            between: &|a: &[f64; 1], b: &[f64; 1], u| [a[0] * (1.0 - u) + b[0] * u],
            difference: &|a, b| (a[0] - b[0]).abs(),
            // Percent.
            tolerance: 100.0 * MAX_DEVIATION,
            swing: &|_, _| 0.0,
            stepped: false,
        }
        .samples(&|count| reader.spend_samples(count));
        *coarse += usize::from(refused);
        times.extend(samples.times);
    }
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();
    if times.is_empty() {
        return Ok(None);
    }
    if !reader.spend_samples(times.len().saturating_mul(of_target.len())) {
        let channel = morphed.channels[0].0;
        return Err(document.fault(channel, "its animations have too many keys for the size of the file"));
    }
    let mut values = Vec::with_capacity(times.len() * of_target.len());
    for &time in &times {
        for (curves, &(_, rest)) in of_target.iter().zip(&morphed.channels) {
            values.push(curves.as_ref().map_or(rest, |curves| percent(curves, time, Side::After)[0] / 100.0));
        }
    }
    Ok(Some(Channel {
        node: morphed.node,
        property: Property::Weights,
        interpolation: ChannelInterpolation::Linear,
        times,
        values,
    }))
}
