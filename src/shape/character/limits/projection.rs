//! Projection of rotations onto joint limits.
//!
//! In the coordinates `(x, y, θ)` of a rotation `R = exp(x e₁ + y e₂) · exp(θ a)`, `e₁ = across`, `e₂ = a × across`, limits are a convex
//! set: an ellipse of `(x, y)` times an interval of `θ`. Every convex combination of two allowed rotations is therefore allowed.

use nalgebra::{Unit, UnitQuaternion, Vector2, Vector3};

use super::Limits;

/// Swing–twist coordinates of a rotation from rest, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwingTwist {
    /// Swing about `across` and about `axis × across`.
    pub swing: Vector2<f64>,
    /// Twist about the axis, applied first.
    pub twist: f64,
}

impl Limits {
    /// The second axis of the swing ellipse.
    pub fn second(&self) -> Unit<Vector3<f64>> {
        Unit::new_normalize(self.axis.cross(&self.across))
    }

    /// Swing–twist decomposition: the twist in −π ..= π, the swing of norm at most π.
    pub fn split(&self, rotation: &UnitQuaternion<f64>) -> SwingTwist {
        let (w, along) = (rotation.w, rotation.imag().dot(&self.axis));
        // For a half rotation about a perpendicular axis the twist is undetermined: choose 0.
        let length = w.hypot(along);
        let (w, along) = if length > 1e-12 { (w / length, along / length) } else { (1.0, 0.0) };
        let twist = UnitQuaternion::new_unchecked(nalgebra::Quaternion::from_parts(w, self.axis.into_inner() * along));
        let swing = (rotation * twist.inverse()).scaled_axis();
        let angle = 2.0 * along.atan2(w);
        let angle = if angle > std::f64::consts::PI {
            angle - std::f64::consts::TAU
        } else if angle < -std::f64::consts::PI {
            angle + std::f64::consts::TAU
        } else {
            angle
        };
        SwingTwist { swing: Vector2::new(swing.dot(&self.across), swing.dot(&self.second())), twist: angle }
    }

    /// The rotation with these coordinates.
    pub fn rotation(&self, at: &SwingTwist) -> UnitQuaternion<f64> {
        let swing = self.across.into_inner() * at.swing.x + self.second().into_inner() * at.swing.y;
        UnitQuaternion::from_scaled_axis(swing) * UnitQuaternion::from_scaled_axis(self.axis.into_inner() * at.twist)
    }

    /// Distance of coordinates from the limits, rad; 0 inside.
    pub fn excess(&self, at: &SwingTwist) -> f64 {
        let nearest = self.nearest(at);
        (nearest.swing - at.swing).norm().max((nearest.twist - at.twist).abs())
    }

    /// Whether a rotation from rest is within the limits, up to `tolerance` rad.
    pub fn allows(&self, rotation: &UnitQuaternion<f64>, tolerance: f64) -> bool {
        self.excess(&self.split(rotation)) <= tolerance
    }

    /// The nearest allowed rotation from rest, in coordinates; `rotation` itself, bit for bit, if it is allowed.
    pub fn project(&self, rotation: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let at = self.split(rotation);
        let nearest = self.nearest(&at);
        if nearest == at { *rotation } else { self.rotation(&nearest) }
    }

    /// The nearest allowed coordinates.
    pub fn nearest(&self, at: &SwingTwist) -> SwingTwist {
        let [least, largest] = self.twist;
        SwingTwist { swing: in_ellipse(at.swing, self.swing), twist: at.twist.clamp(least, largest) }
    }
}

/// The point of an ellipse with half axes `a`, `b` that is nearest to `p`; `p` itself if inside.
///
/// Outside, it is `(a² x / (t + a²), b² y / (t + b²))` where `t > 0` is the only root of a decreasing function. Bisection finds it for
/// every eccentricity (D. Eberly, *Distance from a Point to an Ellipse*, 2013).
fn in_ellipse(p: Vector2<f64>, [a, b]: [f64; 2]) -> Vector2<f64> {
    if a == 0.0 || b == 0.0 {
        return Vector2::new(p.x.clamp(-a, a), p.y.clamp(-b, b));
    }
    let measure = |t: f64| (a * p.x / (t + a * a)).powi(2) + (b * p.y / (t + b * b)).powi(2) - 1.0;
    if measure(0.0) <= 0.0 {
        return p;
    }
    let (mut low, mut high) = (0.0, a.max(b) * p.norm());
    for _ in 0..200 {
        // Bisection halves the bracket until it is two adjacent numbers; 200 halvings are more than any exponent range in use needs.
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if measure(middle) > 0.0 { low = middle } else { high = middle }
    }
    // The end of the bracket with a non-positive measure, so that the point is inside to the last digit.
    Vector2::new(a * a * p.x / (high + a * a), b * b * p.y / (high + b * b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits() -> Limits {
        let axis = Unit::new_normalize(Vector3::new(0.2, 1.0, -0.3));
        Limits { swing: [0.9, 0.4], twist: [-0.2, 0.7], ..Limits::cone(axis, 1.0, 1.0) }
    }

    fn some_turns() -> impl Iterator<Item = UnitQuaternion<f64>> {
        (0..400).map(|k| {
            let k = f64::from(k);
            let axis = Vector3::new((k * 1.7).sin(), (k * 2.3).cos(), (k * 0.9).sin() + 0.1);
            UnitQuaternion::from_scaled_axis(axis.normalize() * (3.1 * (k * 0.37).sin()))
        })
    }

    #[test]
    fn swing_twist_coordinates_round_trip() {
        for rotation in some_turns() {
            let at = limits().split(&rotation);
            assert!(limits().rotation(&at).angle_to(&rotation) < 1e-7, "{rotation}");
            assert!(at.twist.abs() <= std::f64::consts::PI && at.swing.norm() <= std::f64::consts::PI + 1e-12);
        }
        let at = SwingTwist { swing: Vector2::new(0.5, -1.2), twist: 2.0 };
        let back = limits().split(&limits().rotation(&at));
        assert!((back.swing - at.swing).norm() < 1e-12 && (back.twist - at.twist).abs() < 1e-12);
    }

    #[test]
    fn the_projection_is_allowed_and_no_allowed_rotation_is_nearer() {
        let limits = limits();
        for rotation in some_turns() {
            let at = limits.split(&rotation);
            let near = limits.nearest(&at);
            assert!((near.swing.x / 0.9).powi(2) + (near.swing.y / 0.4).powi(2) <= 1.0 + 1e-12);
            assert!((-0.2..=0.7).contains(&near.twist));
            assert!(limits.allows(&limits.project(&rotation), 1e-9), "{rotation}");
            if limits.allows(&rotation, 0.0) {
                assert_eq!(limits.project(&rotation), rotation);
            }
            for k in 0..720 {
                let angle = f64::from(k).to_radians() * 0.5;
                let rim = Vector2::new(0.9 * angle.cos(), 0.4 * angle.sin());
                assert!((rim - at.swing).norm() >= (near.swing - at.swing).norm() - 1e-9);
            }
        }
    }

    #[test]
    fn a_hinge_keeps_its_axis() {
        let axis = Vector3::x_axis();
        let knee = Limits { axis: Vector3::y_axis(), across: axis, swing: [1.5, 0.0], twist: [0.0, 0.0] };
        for rotation in some_turns() {
            let allowed = knee.project(&rotation).scaled_axis();
            assert!(allowed.yz().norm() < 1e-12 && allowed.x.abs() <= 1.5 + 1e-12);
        }
        let bent = UnitQuaternion::from_scaled_axis(Vector3::x() * 0.7);
        assert_eq!(knee.project(&bent), bent);
    }
}
