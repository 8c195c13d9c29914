//! Transforms of nodes, and the axes and unit of a file.
//!
//! ```text
//! parent_from_node = T · O_r P_r (R_pre R R_post⁻¹) P_r⁻¹ · O_s P_s S P_s⁻¹
//! ```
//!
//! with the translation T, the offset O and pivot P of rotation and scale, R by Euler angles in the order of the node, R_pre and R_post
//! in the order x, y, z. This is a translation, a rotation and a scale:
//!
//! ```text
//! q = R_pre R R_post⁻¹,    t = T + O_r + P_r + q (O_s + P_s − P_r − S P_s).
//! ```
//!
//! # Inheritance of scale
//! With the linear part G = Q Σ of the parent's `world_from_node`, Q the product of the rotations above, the world's linear part of a node
//! of rotation q and scale S is
//!
//! ```text
//! type 0 (RrSs)  Q q Σ S,      type 1 (RSrs)  Q Σ q S,      type 2 (Rrs)  Q q Σ S_parent⁻¹ S.
//! ```
//!
//! Where Σ is uniform the first two are equal and the third is a factor of S; else the node gets a matrix.

use nalgebra::{Matrix3, Matrix4, UnitQuaternion, Vector3};

use super::binary::Tree;
use super::properties::{Numbers, properties, template};
use crate::mesh::model::articulation::NodeTransform;
use plumbline_num::math::Trs;

/// Maximum difference of the factors of a uniform scale, relative to the largest.
const UNIFORM: f64 = 1e-6;
/// Maximum error of a matrix that is written as translation, rotation and scale, relative to its largest entry.
const EXACT: f64 = 1e-9;

/// The axes about which a node rotates, first to last, of orders 0 to 5.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 2, 0], [1, 0, 2], [2, 0, 1], [2, 1, 0]];

/// Parts of the transform of a node. Angles in degrees, as in the file.
#[derive(Clone, Debug)]
pub(super) struct NodeParts {
    pub(super) translation: Vector3<f64>,
    pub(super) rotation: Vector3<f64>,
    pub(super) scaling: Vector3<f64>,
    pre_rotation: Vector3<f64>,
    post_rotation: Vector3<f64>,
    rotation_offset: Vector3<f64>,
    rotation_pivot: Vector3<f64>,
    scaling_offset: Vector3<f64>,
    scaling_pivot: Vector3<f64>,
    geometric: [Vector3<f64>; 3],
    order: i32,
    pub(super) inherit: i32,
    /// Whether order, pre- and post-rotation act.
    active: bool,
    /// Whether pre- and post-rotation act on limits only.
    limits_only: bool,
}

impl Default for NodeParts {
    fn default() -> Self {
        let (zero, one) = (Vector3::zeros(), Vector3::repeat(1.0));
        Self {
            translation: zero,
            rotation: zero,
            scaling: one,
            pre_rotation: zero,
            post_rotation: zero,
            rotation_offset: zero,
            rotation_pivot: zero,
            scaling_offset: zero,
            scaling_pivot: zero,
            geometric: [zero, zero, one],
            order: 0,
            inherit: 1,
            active: true,
            limits_only: false,
        }
    }
}

impl NodeParts {
    /// The defaults of a file.
    pub(super) fn defaults(tree: &Tree<'_>) -> Self {
        let mut parts = Self::default();
        if let Some(record) = template(tree, "Model") {
            parts.read(tree, record);
        }
        parts
    }

    /// Sets what the properties of a record say.
    pub(super) fn read(&mut self, tree: &Tree<'_>, record: u32) {
        for (name, numbers) in properties(tree, record) {
            match name {
                b"Lcl Translation" => numbers.set_vector(&mut self.translation),
                b"Lcl Rotation" => numbers.set_vector(&mut self.rotation),
                b"Lcl Scaling" => numbers.set_vector(&mut self.scaling),
                b"PreRotation" => numbers.set_vector(&mut self.pre_rotation),
                b"PostRotation" => numbers.set_vector(&mut self.post_rotation),
                b"RotationOffset" => numbers.set_vector(&mut self.rotation_offset),
                b"RotationPivot" => numbers.set_vector(&mut self.rotation_pivot),
                b"ScalingOffset" => numbers.set_vector(&mut self.scaling_offset),
                b"ScalingPivot" => numbers.set_vector(&mut self.scaling_pivot),
                b"GeometricTranslation" => numbers.set_vector(&mut self.geometric[0]),
                b"GeometricRotation" => numbers.set_vector(&mut self.geometric[1]),
                b"GeometricScaling" => numbers.set_vector(&mut self.geometric[2]),
                b"RotationOrder" => numbers.set_integer(&mut self.order),
                b"InheritType" => numbers.set_integer(&mut self.inherit),
                b"RotationActive" => numbers.set_flag(&mut self.active),
                b"RotationSpaceForLimitOnly" => numbers.set_flag(&mut self.limits_only),
                _ => {}
            }
        }
    }

    /// Whether the rotation has an order that is read as x, y, z.
    pub(super) fn has_unknown_order(&self) -> bool {
        self.active && !(0..ORDERS.len() as i32).contains(&self.order)
    }

    /// Whether the translation depends on rotation and scale.
    pub(super) fn has_pivots(&self) -> bool {
        [self.rotation_pivot, self.scaling_offset, self.scaling_pivot].iter().any(|v| *v != Vector3::zeros())
    }

    /// Length of the pivots and offsets, in the units of the file.
    pub(super) fn pivot_length(&self) -> f64 {
        self.rotation_pivot.norm() + self.scaling_offset.norm() + self.scaling_pivot.norm()
    }

    /// `R_pre R R_post⁻¹` of Euler angles. Without the flag `RotationActive` the order is x, y, z, and R_pre and R_post are the identity.
    pub(super) fn quaternion(&self, angles: Vector3<f64>) -> UnitQuaternion<f64> {
        if !self.active {
            return euler(angles, ORDERS[0]);
        }
        let order = usize::try_from(self.order).ok().and_then(|k| ORDERS.get(k)).unwrap_or(&ORDERS[0]);
        if self.limits_only {
            return euler(angles, *order);
        }
        let post = euler(self.post_rotation, ORDERS[0]);
        euler(self.pre_rotation, ORDERS[0]) * euler(angles, *order) * post.inverse()
    }

    /// The node's frame by its translation, Euler angles and scale.
    pub(super) fn frame(&self, translation: Vector3<f64>, angles: Vector3<f64>, scale: Vector3<f64>) -> Trs {
        let rotation = self.quaternion(angles);
        let behind = self.scaling_offset + self.scaling_pivot - self.rotation_pivot;
        let swung = rotation * (behind - scale.component_mul(&self.scaling_pivot));
        let translation = translation + self.rotation_offset + self.rotation_pivot + swung;
        Trs { translation, rotation, scale }
    }

    /// The frame at rest.
    pub(super) fn rest(&self) -> Trs {
        self.frame(self.translation, self.rotation, self.scaling)
    }

    /// `node_from_geometry`.
    pub(super) fn node_from_geometry(&self) -> Matrix4<f64> {
        let [translation, angles, scale] = self.geometric;
        Trs { translation, rotation: euler(angles, ORDERS[0]), scale }.matrix()
    }
}

/// The rotation by angles in degrees about the axes of an order, the first axis first.
fn euler(degrees: Vector3<f64>, order: [usize; 3]) -> UnitQuaternion<f64> {
    let about =
        |axis: usize| UnitQuaternion::from_axis_angle(&Vector3::ith_axis(axis), (degrees[axis] % 360.0).to_radians());
    let [first, second, third] = order.map(about);
    third * second * first
}

/// What a node inherits, in the world.
#[derive(Clone, Copy)]
pub(super) struct Inherited {
    linear: Matrix3<f64>,
    rotation: UnitQuaternion<f64>,
    /// Scale of the node itself.
    scale: Vector3<f64>,
}

impl Default for Inherited {
    fn default() -> Self {
        Self { linear: Matrix3::identity(), rotation: UnitQuaternion::identity(), scale: Vector3::repeat(1.0) }
    }
}

/// The transform of a node in its hierarchy.
pub(super) struct Placed {
    pub(super) transform: NodeTransform,
    /// What its children inherit.
    pub(super) passed_on: Inherited,
    /// Factor of its scale, also where this is animated.
    pub(super) scale: f64,
    /// Whether an animation of it is approximate: its inheritance is neither the usual nor a factor of its scale.
    pub(super) approximate: bool,
}

/// The transform of a node by what it inherits.
pub(super) fn place(parts: &NodeParts, parent: &Inherited) -> Placed {
    let mut frame = parts.rest();
    let (mut scale, mut matrix) = (1.0, None);
    let mut approximate = !(0..=2).contains(&parts.inherit);
    if parts.inherit == 0 || parts.inherit == 2 {
        let stretch = parent.rotation.to_rotation_matrix().matrix().transpose() * parent.linear;
        let of_parent = if parts.inherit == 2 { parent.scale } else { Vector3::repeat(1.0) };
        // Scales of the parent that the node inherits: below its rotation, or not at all.
        let back = of_parent.map(|s| if s == 0.0 { 0.0 } else { 1.0 / s });
        let below = stretch * Matrix3::from_diagonal(&back);
        if let (Some(above), Some(below)) = (uniform(&stretch), uniform(&below)) {
            scale = if above == 0.0 { 1.0 } else { below / above };
        } else {
            approximate = true;
            let own = frame.rotation.to_rotation_matrix().matrix() * below * Matrix3::from_diagonal(&frame.scale);
            matrix = stretch.try_inverse().map(|inverse| inverse * own);
        }
    }
    frame.scale *= scale;
    let mut whole = frame.matrix();
    if let Some(linear) = matrix {
        whole.fixed_view_mut::<3, 3>(0, 0).copy_from(&linear);
        frame = Trs::from_matrix(&whole);
    }
    let exact = frame.is_finite() && (frame.matrix() - whole).amax() <= EXACT * whole.amax();
    let transform = if exact { of_frame(&frame) } else { NodeTransform::Matrix(whole) };
    let passed_on = Inherited {
        linear: parent.linear * whole.fixed_view::<3, 3>(0, 0),
        rotation: parent.rotation * frame.rotation,
        scale: parts.scaling,
    };
    Placed { transform, passed_on, scale, approximate }
}

fn of_frame(frame: &Trs) -> NodeTransform {
    NodeTransform::Trs {
        translation: frame.translation.into(),
        rotation: frame.rotation.coords.into(),
        scale: frame.scale.into(),
    }
}

/// The factor of a matrix that scales uniformly.
fn uniform(matrix: &Matrix3<f64>) -> Option<f64> {
    let factor = matrix[(0, 0)];
    let rest = (matrix - Matrix3::from_diagonal_element(factor)).amax();
    (rest <= UNIFORM * factor.abs()).then_some(factor)
}

/// Axes and unit of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Coordinates {
    /// Ours from those of the file: a permutation of axes with signs.
    pub(super) rotation: Matrix3<f64>,
    /// Meters in a unit of the file.
    pub(super) meters: f64,
    /// Whether the file names axes or a unit that make no sense: y is up then, and the unit a centimeter.
    pub(super) doubtful: bool,
}

impl Coordinates {
    /// By the global settings: the axis to the right becomes x, the one up y, the front z.
    pub(super) fn of(tree: &Tree<'_>) -> Self {
        let (mut axes, mut signs, mut unit) = ([0, 1, 2], [1, 1, 1], 1.0_f64);
        if let Some(record) = tree.child(None, "GlobalSettings") {
            for (name, numbers) in properties(tree, record) {
                let set = |numbers: Numbers, to: &mut i32| numbers.set_integer(to);
                match name {
                    b"CoordAxis" => set(numbers, &mut axes[0]),
                    b"UpAxis" => set(numbers, &mut axes[1]),
                    b"FrontAxis" => set(numbers, &mut axes[2]),
                    b"CoordAxisSign" => set(numbers, &mut signs[0]),
                    b"UpAxisSign" => set(numbers, &mut signs[1]),
                    b"FrontAxisSign" => set(numbers, &mut signs[2]),
                    b"UnitScaleFactor" => numbers.set(&mut unit),
                    _ => {}
                }
            }
        }
        let mut rotation = Matrix3::<f64>::zeros();
        for (row, (&axis, &sign)) in axes.iter().zip(&signs).enumerate() {
            if let Some(entry) = usize::try_from(axis).ok().filter(|&a| a < 3).map(|a| &mut rotation[(row, a)]) {
                *entry = if sign < 0 { -1.0 } else { 1.0 };
            }
        }
        let (known, possible) = (rotation.determinant().abs() == 1.0, unit > 0.0);
        Self {
            rotation: if known { rotation } else { Matrix3::identity() },
            meters: 0.01 * if possible { unit } else { 1.0 },
            doubtful: !(known && possible),
        }
    }

    pub(super) fn is_mirrored(&self) -> bool {
        self.rotation.determinant() < 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_is_the_product_of_the_parts() {
        let parts = NodeParts {
            pre_rotation: Vector3::new(10.0, -40.0, 70.0),
            post_rotation: Vector3::new(-5.0, 25.0, 15.0),
            rotation_offset: Vector3::new(1.0, 2.0, 3.0),
            rotation_pivot: Vector3::new(-2.0, 0.5, 1.0),
            scaling_offset: Vector3::new(0.3, 0.2, 0.1),
            scaling_pivot: Vector3::new(4.0, -1.0, 2.0),
            order: 4,
            ..NodeParts::default()
        };
        let (t, r, s) = (Vector3::new(5.0, 6.0, 7.0), Vector3::new(30.0, 50.0, -80.0), Vector3::new(2.0, 0.5, 1.5));
        let moved = |v: &Vector3<f64>| Matrix4::new_translation(v);
        let about = |axis: usize, degrees: f64| {
            UnitQuaternion::from_axis_angle(&Vector3::ith_axis(axis), degrees.to_radians()).to_homogeneous()
        };
        // Order 4: z, x, y.
        let rotation = about(1, r.y) * about(0, r.x) * about(2, r.z);
        let xyz = |v: &Vector3<f64>| about(2, v.z) * about(1, v.y) * about(0, v.x);
        let expected = moved(&t)
            * moved(&parts.rotation_offset)
            * moved(&parts.rotation_pivot)
            * xyz(&parts.pre_rotation)
            * rotation
            * xyz(&parts.post_rotation).transpose()
            * moved(&-parts.rotation_pivot)
            * moved(&parts.scaling_offset)
            * moved(&parts.scaling_pivot)
            * Matrix4::new_nonuniform_scaling(&s)
            * moved(&-parts.scaling_pivot);
        assert!((parts.frame(t, r, s).matrix() - expected).amax() < 1e-13);
    }

    #[test]
    fn rotation_orders_are_products_of_rotations_about_axes() {
        let angles: Vector3<f64> = Vector3::new(20.0, 30.0, 40.0);
        for (k, order) in ORDERS.iter().enumerate() {
            let parts = NodeParts { order: k as i32, ..NodeParts::default() };
            let mut expected = UnitQuaternion::identity();
            for &axis in order {
                expected =
                    UnitQuaternion::from_axis_angle(&Vector3::ith_axis(axis), angles[axis].to_radians()) * expected;
            }
            assert!(parts.quaternion(angles).angle_to(&expected) < 1e-12, "{k}");
        }
    }

    #[test]
    fn scale_is_inherited_by_the_type_of_the_node() {
        let parent = NodeParts {
            rotation: Vector3::new(0.0, 0.0, 30.0),
            scaling: Vector3::new(2.0, 3.0, 0.5),
            ..NodeParts::default()
        };
        let above = place(&parent, &Inherited::default()).passed_on;
        let q = parent.quaternion(parent.rotation).to_rotation_matrix().into_inner();
        let stretch = Matrix3::from_diagonal(&parent.scaling);
        for inherit in 0..3 {
            let node = NodeParts {
                rotation: Vector3::new(40.0, 0.0, 70.0),
                scaling: Vector3::new(1.0, 2.0, 1.0),
                inherit,
                ..NodeParts::default()
            };
            let r = node.quaternion(node.rotation).to_rotation_matrix().into_inner();
            let s = Matrix3::from_diagonal(&node.scaling);
            let expected = match inherit {
                0 => q * r * stretch * s,
                1 => q * stretch * r * s,
                _ => q * r * s,
            };
            let placed = place(&node, &above);
            assert!((placed.passed_on.linear - expected).amax() < 1e-12, "{inherit}");
            assert_eq!(placed.approximate, inherit != 1);
        }
        // A uniform scale of the parent is a factor.
        let even = NodeParts { scaling: Vector3::repeat(4.0), ..parent };
        let above = place(&even, &Inherited::default()).passed_on;
        let child = NodeParts { inherit: 2, ..NodeParts::default() };
        let placed = place(&child, &above);
        assert!((placed.scale - 0.25).abs() < 1e-12 && !placed.approximate);
    }
}
