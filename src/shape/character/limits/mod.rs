//! How far a joint may turn.
//!
//! The turn from rest is `R = R_restᵀ R_pose`, in the frame of the joint at rest. It is split into a twist `T` about the bone's
//! axis `a`, done first, and a swing `S` that moves the axis by the shortest way: `R = S T`. The swing's rotation vector lies in
//! the plane across the axis; limits hold it in an ellipse and the twist's angle in an interval.

mod projection;

use nalgebra::{Unit, Vector3};

use super::CharacterError;
pub use projection::SwingTwist;

/// An ellipse for the swing and an interval for the twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Axis of the twist, in the joint's frame: mostly along the bone.
    pub axis: Unit<Vector3<f64>>,
    /// First axis of the swing's ellipse, across `axis`; the second is `axis × across`.
    pub across: Unit<Vector3<f64>>,
    /// Largest turn about `across` and about `axis × across`, rad, each in 0 ..= π.
    pub swing: [f64; 2],
    /// Least and largest twist, rad, in −π ..= π.
    pub twist: [f64; 2],
}

impl Limits {
    /// A round cone about an axis, and a twist to both sides.
    pub fn cone(axis: Unit<Vector3<f64>>, swing: f64, twist: f64) -> Self {
        Self { axis, across: across(&axis), swing: [swing; 2], twist: [-twist, twist] }
    }

    /// Refuses what no rotation keeps, and axes that are not perpendicular.
    ///
    /// # Errors
    /// [`CharacterError::Limits`].
    pub fn check(&self, joint: &str) -> Result<(), CharacterError> {
        let refused = |what, value: String, expected| {
            Err(CharacterError::Limits { joint: joint.to_owned(), what, value, expected })
        };
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

/// Some direction across another.
fn across(axis: &Vector3<f64>) -> Unit<Vector3<f64>> {
    Unit::new_normalize(axis.cross(&Vector3::ith(axis.iamin(), 1.0)))
}
