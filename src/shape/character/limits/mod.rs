//! Rotation limits of joints.
//!
//! The rotation from rest is `R = R_restᵀ R_pose`, in the joint frame at rest. It is decomposed into a twist `T` about the bone axis `a`,
//! applied first, and a swing `S`, the shortest rotation that moves the axis: `R = S T`. The rotation vector of the swing is
//! perpendicular to `a`. Limits are an ellipse for it and an interval for the twist angle.

mod projection;

use nalgebra::{Unit, Vector3};

use super::CharacterError;
pub use projection::SwingTwist;

/// Swing ellipse and twist interval of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Twist axis, in the joint frame; usually along the bone.
    pub axis: Unit<Vector3<f64>>,
    /// First axis of the swing ellipse, perpendicular to `axis`; the second is `axis × across`.
    pub across: Unit<Vector3<f64>>,
    /// Largest swing about `across` and about `axis × across`, rad, each in 0 ..= π.
    pub swing: [f64; 2],
    /// Smallest and largest twist, rad, in −π ..= π.
    pub twist: [f64; 2],
}

impl Limits {
    /// A circular swing cone about an axis and a symmetric twist interval.
    pub fn cone(axis: Unit<Vector3<f64>>, swing: f64, twist: f64) -> Self {
        Self { axis, across: across(&axis), swing: [swing; 2], twist: [-twist, twist] }
    }

    /// Rejects values out of range and axes that are not perpendicular.
    ///
    /// # Errors
    /// [`CharacterError::Input`].
    pub fn check(&self, joint: &str) -> Result<(), CharacterError> {
        let refused = |what: &str, value: String, expected: &str| {
            Err(CharacterError::Input(format!(
                "the {what} {value} of joint {joint:?} is invalid (expected {expected})"
            )))
        };
        // 1e-9: π converted from 180° and back may exceed itself by rounding.
        let pi = std::f64::consts::PI + 1e-9;
        if let Some(swing) = self.swing.iter().find(|s| !(**s >= 0.0 && **s <= pi)) {
            return refused("swing", format!("{swing} rad"), "0 to π");
        }
        let [least, largest] = self.twist;
        if !(least >= -pi && least <= largest && largest <= pi) {
            return refused("twist", format!("{least} to {largest} rad"), "−π ≤ least ≤ largest ≤ π");
        }
        if !(self.axis.dot(&self.across).abs() < 1e-6) {
            let value = format!("{:?}", [self.across.x, self.across.y, self.across.z]);
            return refused("swing axis", value, "a direction across the twist's axis");
        }
        Ok(())
    }
}

/// A unit vector perpendicular to `axis`.
fn across(axis: &Vector3<f64>) -> Unit<Vector3<f64>> {
    Unit::new_normalize(axis.cross(&Vector3::ith(axis.iamin(), 1.0)))
}
