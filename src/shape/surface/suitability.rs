//! Methods that do not suit a surface or a deformation, recognized by the result, and the method to use instead.

use std::fmt;

use super::{DeformOptions, DeformReport, Method, RotationEstimation};
use crate::mesh::operators::CotangentRule;

/// Change of the volume, relative, above which a method is unsuitable. Bends by `arap` change it by a few percent; triangle cells, which
/// do not resist bending, and linearized rotations lose 20 to 43 % in bends by 90 degrees.
const MAX_VOLUME_CHANGE: f64 = 0.1;

/// Why a method does not suit a deformation; its text names the method to use.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Unsuitable {
    /// Cells of spokes with edges of negative weight: stretching them lowers the energy.
    NegativeWeights {
        /// Number of edges.
        edges: usize,
    },
    /// Triangles as cells of a closed surface, whose volume has changed.
    BendingWithoutResistance {
        /// Volume over the rest volume.
        volume_ratio: f64,
    },
    /// Linear rotation estimation, after which the volume has changed or faces are flipped.
    LargeRotations {
        /// Volume over the rest volume; `None` for an open surface.
        volume_ratio: Option<f64>,
        /// Number of flipped faces.
        flipped_faces: usize,
    },
}

impl Unsuitable {
    /// Why the method does not suit the deformation with this report, if so.
    pub fn of(method: Method, options: &DeformOptions, report: &DeformReport) -> Option<Self> {
        let shape = &report.shape;
        let changed = shape.volume_ratio.filter(|v| (v - 1.0).abs() > MAX_VOLUME_CHANGE);
        match method {
            Method::ArapSpokes if report.negative_weights > 0 && options.cotangents == CotangentRule::Raw => {
                Some(Self::NegativeWeights { edges: report.negative_weights })
            }
            Method::ArapElements => changed.map(|volume_ratio| Self::BendingWithoutResistance { volume_ratio }),
            Method::Laplacian
                if options.rotation_estimation == RotationEstimation::Linear
                    && (changed.is_some() || shape.flipped_faces > 0) =>
            {
                let (volume_ratio, flipped_faces) = (shape.volume_ratio, shape.flipped_faces);
                Some(Self::LargeRotations { volume_ratio, flipped_faces })
            }
            _ => None,
        }
    }
}

impl fmt::Display for Unsuitable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NegativeWeights { edges } => write!(
                f,
                "{edges} edges have negative weights, and stretching them lowers the energy of arap-spokes: take the method arap, \
                 or cotangents clamped"
            ),
            Self::BendingWithoutResistance { volume_ratio } => write!(
                f,
                "the volume is {:.0} % of that at rest, since arap-elements does not resist bending: take the method arap",
                100.0 * volume_ratio
            ),
            Self::LargeRotations { volume_ratio, flipped_faces } => {
                let volume = volume_ratio.map(|v| format!("the volume is {:.0} % of that at rest", 100.0 * v));
                let flipped = (*flipped_faces > 0).then(|| format!("{flipped_faces} faces are flipped"));
                let effects: Vec<String> = volume.into_iter().chain(flipped).collect();
                write!(
                    f,
                    "{}, since linear rotation estimation is for small rotations: take another rotation estimation, or the method arap",
                    effects.join(" and ")
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::surface::{Convergence, Deformer, HandlePose, Handles, InitialGuess};
    use nalgebra::{Point3, UnitQuaternion, Vector3};
    use plumbline_num::run::Run;

    /// What is said of a bar whose upper end is bent by an angle in degrees.
    fn bent(method: Method, options: &DeformOptions, degrees: f64) -> Option<String> {
        let bar = shapes::bar([4, 4, 16], [1.0, 1.0, 4.0]);
        let (low, high) = bar.bounding_box().expect("it has vertices");
        let at_end = |v: &u32| [low.z, high.z].contains(&bar.positions()[*v as usize].z);
        let handles = Handles::exact((0..bar.vertex_count() as u32).filter(at_end)).expect("two ends");
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), degrees.to_radians());
        let center = nalgebra::center(&low, &high);
        let target = |v: &u32| {
            let p = bar.positions()[*v as usize];
            if p.z == high.z { center + rotation * (p - center) } else { p }
        };
        let targets: Vec<Point3<f64>> = handles.vertices().iter().map(target).collect();
        let run = Run::default();
        let mut deformer = Deformer::new(method, &bar, &handles, options, &run).expect("prefactored");
        let done = deformer.deform(&HandlePose::new(targets), InitialGuess::Auto, &Convergence::default(), &run);
        Unsuitable::of(method, options, &done.expect("solved").report).map(|u| u.to_string())
    }

    #[test]
    fn methods_that_lose_the_volume_name_the_method_to_use() {
        let linear = DeformOptions { rotation_estimation: RotationEstimation::Linear, ..DeformOptions::default() };
        for (method, options, of) in [
            (Method::ArapElements, DeformOptions::default(), "arap-elements does not resist bending"),
            (Method::Laplacian, linear, "linear rotation estimation is for small rotations"),
        ] {
            let said = bent(method, &options, 120.0).expect("unsuitable");
            assert!(said.contains(of) && said.contains("the method arap"), "{said}");
            assert_eq!(bent(method, &options, 2.0), None, "{method:?}");
        }
        assert_eq!(bent(Method::ArapSpokes, &DeformOptions::default(), 120.0), None, "no weight is negative");
    }
}
