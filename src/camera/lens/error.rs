//! What can be wrong with a lens.

/// A lens that cannot be, or does not fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LensError {
    /// A size that is no size.
    #[error("picture size {0} × {1} px is invalid (expected two finite numbers above 0)")]
    Size(f64, f64),
    /// A field of view that is not an angle, or more than the projection can show.
    #[error(
        "a {axis} field of view of {degrees:.6}° is invalid for the {projection} projection (expected above 0° and {bound} \
         {limit_deg:.4}°): give another angle or another projection"
    )]
    FieldOfView {
        /// What was asked for.
        degrees: f64,
        /// Along which axis.
        axis: &'static str,
        /// Name of the projection.
        projection: &'static str,
        /// `below` or `at most`.
        bound: &'static str,
        /// The limit.
        limit_deg: f64,
    },
    /// A picture whose shape is not that of the picture the lens was measured on.
    #[error(
        "the lens is for {}×{} px (aspect {:.4}) and the picture is {}×{} px (aspect {:.4}){}: give the lens of this \
         picture's shape, or a picture that is neither cropped nor turned",
        .lens.0, .lens.1, .lens.0 / .lens.1, .picture.0, .picture.1, .picture.0 / .picture.1,
        turned(*.lens, *.picture)
    )]
    Aspect {
        /// Size the lens is for, px.
        lens: (f64, f64),
        /// Size of the picture, px.
        picture: (f64, f64),
    },
    /// A parameter that leaves the lens without a field.
    #[error("{name} = {value} is invalid (expected {expected})")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },
}

/// Says so where the one picture is the other turned by a right angle.
fn turned(lens: (f64, f64), picture: (f64, f64)) -> &'static str {
    if super::same_shape(lens, (picture.1, picture.0)) { "; it looks turned by 90°" } else { "" }
}
