//! Other units and another axis up.
//!
//! Files do not say what a unit is, nor which axis points up; glTF means meters and y, CAD programs mostly mean millimeters and z. With
//! `x ↦ S x`, `S = s R`, every point of a model is replaced by its image and every transform `T` of a node by `S T S⁻¹`, so that nodes, bind
//! poses, morph targets and animations keep to one another:
//!
//! ```text
//! translation t ↦ s R t,      rotation q ↦ R q R⁻¹,      scale per axis: permuted as R permutes the axes.
//! ```

use std::str::FromStr;
use std::sync::Arc;

use nalgebra::{Matrix3, Matrix4, Vector3};

use super::articulation::{Articulation, NodeTransform, Property};
use super::{MeshError, Model};

/// An axis of coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// The first.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

impl FromStr for Axis {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "x" => Ok(Self::X),
            "y" => Ok(Self::Y),
            "z" => Ok(Self::Z),
            _ => Err(format!("{text:?} is no axis (x, y, z)")),
        }
    }
}

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LengthUnit {
    meters: f64,
}

impl LengthUnit {
    /// One of this unit in meters.
    pub fn meters(self) -> f64 {
        self.meters
    }
}

impl FromStr for LengthUnit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let meters = match text {
            "mm" => 1e-3,
            "cm" => 1e-2,
            "m" => 1.0,
            "in" => 0.0254,
            "ft" => 0.3048,
            _ => return Err(format!("{text:?} is no unit of length (mm, cm, m, in, ft)")),
        };
        Ok(Self { meters })
    }
}

/// A change of coordinates: a scale, and a rotation of one axis to another.
///
/// # Example
/// ```
/// use nalgebra::Point3;
/// use plumbline_shape::mesh::model::{Axis, CoordinateChange};
/// use plumbline_shape::mesh::{Model, shapes};
///
/// let millimeters = Model::of_mesh(shapes::bar([1, 1, 2], [10.0, 10.0, 20.0]));
/// let change = CoordinateChange { scale: 1e-3, ..CoordinateChange::up(Axis::Z, Axis::Y) };
/// let (low, high) = millimeters.with_coordinates(&change)?.mesh().bounding_box().expect("vertices");
/// assert!(((high - low).y - 0.02).abs() < 1e-12);
/// # Ok::<(), plumbline_shape::mesh::MeshError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoordinateChange {
    /// The new length of what had the length 1: above 0.
    pub scale: f64,
    /// The axis that is rotated, and the one where it goes.
    pub up: (Axis, Axis),
}

impl Default for CoordinateChange {
    fn default() -> Self {
        Self { scale: 1.0, up: (Axis::Y, Axis::Y) }
    }
}

impl CoordinateChange {
    /// Rotates one axis to another about the third, and keeps lengths.
    pub fn up(from: Axis, to: Axis) -> Self {
        Self { up: (from, to), ..Self::default() }
    }

    /// Whether nothing changes.
    pub fn is_identity(&self) -> bool {
        self.scale == 1.0 && self.up.0 == self.up.1
    }

    /// `R`, a rotation that takes axes to axes.
    fn rotation(&self) -> Matrix3<f64> {
        let (from, to) = (self.up.0 as usize, self.up.1 as usize);
        let mut rotation = Matrix3::identity();
        if from != to {
            rotation.set_column(from, &Vector3::ith(to, 1.0));
            rotation.set_column(to, &Vector3::ith(from, -1.0));
        }
        rotation
    }
}

impl Model {
    /// The model in other coordinates, with all that belongs to it: normals, nodes, bind poses, morph targets and animations.
    ///
    /// # Errors
    /// [`MeshError::NotFinite`] where a coordinate would be too large for a number, [`MeshError::Articulation`] where a number of a node,
    /// a target or an animation would be.
    pub fn with_coordinates(&self, change: &CoordinateChange) -> Result<Self, MeshError> {
        let rotation = change.rotation();
        let positions = self.mesh.positions().iter().map(|p| change.scale * (rotation * p)).collect();
        let mut changed = self.clone();
        changed.mesh = self.mesh.with_positions(positions)?;
        if let Some(normals) = &mut changed.normals {
            normals.values.iter_mut().for_each(|normal| turn(normal, &rotation, 1.0));
        }
        if let Some(articulation) = &mut changed.articulation {
            let articulation = Arc::make_mut(articulation);
            articulated(articulation, &rotation, change.scale);
            if !all_finite(articulation) {
                return Err(MeshError::Articulation { fault: "too large for a number in these units".to_owned() });
            }
        }
        Ok(changed)
    }
}

/// `v ↦ s R v`.
fn turn(v: &mut [f64], rotation: &Matrix3<f64>, scale: f64) {
    let turned = scale * (rotation * Vector3::new(v[0], v[1], v[2]));
    v.copy_from_slice(turned.as_slice());
}

/// Scales per axis, of the turned axes.
fn permute(v: &mut [f64], rotation: &Matrix3<f64>) {
    turn(v, &rotation.abs(), 1.0);
}

/// Replaces all transforms of an articulation by those of other coordinates. `R` permutes the axes, with signs; it may mirror.
pub(in crate::mesh) fn articulated(articulation: &mut Articulation, rotation: &Matrix3<f64>, scale: f64) {
    // The axis of a rotation is mirrored against a vector.
    let handedness = rotation.determinant();
    let to = (scale * rotation).to_homogeneous();
    let back = (rotation.transpose() / scale).to_homogeneous();
    let conjugated = |matrix: &Matrix4<f64>| to * matrix * back;
    for node in &mut articulation.nodes {
        match &mut node.transform {
            NodeTransform::Matrix(matrix) => *matrix = conjugated(matrix),
            NodeTransform::Trs { translation, rotation: quaternion, scale: axes } => {
                turn(translation, rotation, scale);
                turn(&mut quaternion[..3], rotation, handedness);
                permute(axes, rotation);
            }
        }
    }
    let binds = articulation.skins.iter_mut().flat_map(|skin| &mut skin.inverse_binds);
    binds.for_each(|bind| *bind = conjugated(bind));
    for target in articulation.instances.iter_mut().flat_map(|instance| &mut instance.targets) {
        target.offsets.iter_mut().for_each(|offset| turn(offset, rotation, scale));
        target.normals.iter_mut().for_each(|normal| turn(normal, rotation, 1.0));
    }
    for channel in articulation.animations.iter_mut().flat_map(|animation| &mut animation.channels) {
        // Tangents of splines change as their values do.
        let width = if channel.property == Property::Rotation { 4 } else { 3 };
        for value in channel.values.chunks_exact_mut(width) {
            match channel.property {
                Property::Translation => turn(value, rotation, scale),
                Property::Rotation => turn(&mut value[..3], rotation, handedness),
                Property::Scale => permute(value, rotation),
                Property::Weights => break,
            }
        }
    }
}

/// Whether every number of an articulation is finite.
pub(in crate::mesh) fn all_finite(articulation: &Articulation) -> bool {
    let all = |values: &[f64]| values.iter().all(|v| v.is_finite());
    let nodes = articulation.nodes.iter().all(|node| match &node.transform {
        NodeTransform::Matrix(matrix) => all(matrix.as_slice()),
        NodeTransform::Trs { translation, rotation, scale } => all(translation) && all(rotation) && all(scale),
    });
    nodes
        && articulation.skins.iter().flat_map(|skin| &skin.inverse_binds).all(|bind| all(bind.as_slice()))
        && articulation.instances.iter().flat_map(|i| &i.targets).flat_map(|target| &target.offsets).all(|o| all(o))
        && articulation.animations.iter().flat_map(|a| &a.channels).all(|channel| all(&channel.values))
}

#[cfg(test)]
mod tests {
    use super::super::articulation::{ChannelInterpolation, Instance, MorphTarget, Node, NodeSkin};
    use super::*;
    use crate::mesh::shapes;
    use nalgebra::Point3;

    fn apart(a: &Matrix4<f64>, b: &Matrix4<f64>) -> f64 {
        (a - b).abs().max()
    }

    #[test]
    fn the_axis_goes_where_it_is_sent_and_shapes_are_not_mirrored() {
        for from in [Axis::X, Axis::Y, Axis::Z] {
            for to in [Axis::X, Axis::Y, Axis::Z] {
                let rotation = CoordinateChange::up(from, to).rotation();
                assert_eq!(rotation * Vector3::ith(from as usize, 1.0), Vector3::ith(to as usize, 1.0));
                assert_eq!(rotation.determinant(), 1.0);
            }
        }
    }

    #[test]
    fn nodes_binds_targets_and_animations_keep_to_the_mesh() {
        let mesh = shapes::bar([1, 1, 2], [1.0, 1.0, 2.0]);
        let vertices = mesh.vertex_count();
        let trs = NodeTransform::Trs {
            translation: [1.0, 2.0, 3.0],
            rotation: [0.1, -0.3, 0.2, 0.9],
            scale: [1.0, 2.0, 0.5],
        };
        let root = Node { transform: trs, ..Node::default() };
        let shear = Matrix4::new(1.0, 0.3, 0.0, 2.0, 0.0, 1.0, 0.1, 0.0, 0.2, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, 1.0);
        let child = Node { parent: Some(0), transform: NodeTransform::Matrix(shear), ..Node::default() };
        let target = MorphTarget { vertices: vec![0], offsets: vec![[0.0, 0.0, 1.0]], ..MorphTarget::default() };
        let channel = |property, values: &[f64]| super::super::articulation::Channel {
            node: 0,
            property,
            interpolation: ChannelInterpolation::default(),
            times: vec![0.0],
            values: values.to_vec(),
        };
        let articulation = Articulation {
            nodes: vec![root, child],
            roots: vec![0],
            skins: vec![NodeSkin { joints: vec![0], inverse_binds: vec![shear], ..NodeSkin::default() }],
            instances: vec![Instance { node: 1, targets: vec![target], ..Instance::default() }],
            instance_of_vertex: vec![0; vertices],
            animations: vec![super::super::articulation::Animation {
                name: None,
                channels: vec![
                    channel(Property::Translation, &[1.0, 2.0, 3.0]),
                    channel(Property::Rotation, &[0.1, -0.3, 0.2, 0.9]),
                    channel(Property::Scale, &[1.0, 2.0, 0.5]),
                    channel(Property::Weights, &[0.25, 0.5, 0.75]),
                ],
            }],
            ..Articulation::default()
        };
        let model = Model::of_mesh(mesh).with_articulation(Some(articulation)).expect("indices in range");
        let change = CoordinateChange { scale: 0.25, ..CoordinateChange::up(Axis::Z, Axis::Y) };
        let changed = model.with_coordinates(&change).expect("finite");
        let to = (change.scale * change.rotation()).to_homogeneous();
        let back = to.try_inverse().expect("a similarity");
        let (before, after) = (model.articulation().expect("nodes"), changed.articulation().expect("nodes"));
        for (old, new) in before.world_from_nodes().iter().zip(after.world_from_nodes()) {
            assert!(apart(&(to * old * back), &new) < 1e-12, "{new}");
        }
        assert!(apart(&(to * shear * back), &after.skins[0].inverse_binds[0]) < 1e-12);
        assert_eq!(after.instances[0].targets[0].offsets, [[0.0, 0.25, 0.0]]);
        let channels = &after.animations[0].channels;
        // What is animated at its rest value is the node at rest.
        let NodeTransform::Trs { translation, rotation, scale } = &after.nodes[0].transform else {
            panic!("a TRS node")
        };
        assert_eq!((&channels[0].values[..], &channels[1].values[..]), (&translation[..], &rotation[..]));
        assert_eq!((&channels[2].values[..], &channels[3].values[..]), (&scale[..], &[0.25, 0.5, 0.75][..]));
        // And back again.
        let inverse = CoordinateChange { scale: 4.0, ..CoordinateChange::up(Axis::Y, Axis::Z) };
        let again = changed.with_coordinates(&inverse).expect("finite");
        let far = |(p, q): (&Point3<f64>, &Point3<f64>)| (p - q).norm();
        assert!(again.mesh().positions().iter().zip(model.mesh().positions()).map(far).fold(0.0, f64::max) < 1e-12);
    }

    #[test]
    fn what_no_number_holds_is_refused() {
        let model = Model::of_mesh(shapes::bar([1, 1, 1], [1e300, 1.0, 1.0]));
        let change = CoordinateChange { scale: 1e30, ..CoordinateChange::default() };
        assert!(matches!(model.with_coordinates(&change), Err(MeshError::NotFinite { .. })));
        let far =
            NodeTransform::Trs { translation: [1e300, 0.0, 0.0], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0; 3] };
        let nodes = vec![Node { transform: far, ..Node::default() }];
        let mesh = shapes::bar([1, 1, 1], [1.0, 1.0, 1.0]);
        let articulation = Articulation {
            nodes,
            instances: vec![Instance::default()],
            instance_of_vertex: vec![0; mesh.vertex_count()],
            ..Articulation::default()
        };
        let model = Model::of_mesh(mesh).with_articulation(Some(articulation)).expect("indices in range");
        assert!(matches!(model.with_coordinates(&change), Err(MeshError::Articulation { .. })));
    }
}
