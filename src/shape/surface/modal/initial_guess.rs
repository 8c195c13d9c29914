//! Initial guesses from the low modes.
//!
//! ```text
//! min_{R, t, q}  Σ_k λ_k q_k² + W Σ_h a_h ‖R (x_h + Σ_k q_k u_k(h)) + t − target_h‖²
//! ```
//!
//! A small problem once the modes are known: rigid motion and coefficients alternate. The guess has the low-frequency components
//! of the pose, which local/global iterations find last. Large coefficients inflate the surface, since displacements are
//! linear; one local/global iteration corrects that.
//!
//! # Reference
//! Q. Huang, M. Wicke, B. Adams, L. Guibas, *Shape decomposition using modal analysis*, Computer Graphics Forum 28 (2009).

use nalgebra::{DMatrix, DVector, Matrix3, Point3, Vector3};

use super::Modes;
use crate::mesh::TriMesh;
use crate::mesh::operators::barycentric_areas;
use crate::surface::{HandlePose, Handles, SurfaceError};
use plumbline_num::math::nearest_rotation;

/// `W` over the highest `λ`, for handles with the total weight of the surface: handles are met to a tenth of what the modes can
/// reach. Much larger values amplify high modes for small errors of the low ones.
const HANDLE_WEIGHT: f64 = 100.0;
/// Iterations of rigid motion and coefficients; they converge in a few.
const ITERATIONS: usize = 20;

/// Positions of all vertices for a pose of the handles, by a rigid motion and the low modes.
///
/// # Errors
/// [`SurfaceError::NoHandle`], [`SurfaceError::NoSuchVertex`], [`SurfaceError::Pose`], [`SurfaceError::NotFinite`].
///
/// # Panics
/// If the modes are those of another mesh.
pub fn modal_initial_guess(
    mesh: &TriMesh,
    modes: &Modes,
    handles: &Handles,
    pose: &HandlePose,
) -> Result<Vec<Point3<f64>>, SurfaceError> {
    pose.check(handles)?;
    let vertices = mesh.vertex_count();
    assert!(modes.vectors.iter().all(|u| u.len() == vertices), "one displacement per vertex");
    if handles.is_empty() {
        return Err(SurfaceError::NoHandle);
    }
    if let Some(&vertex) = handles.vertices().iter().find(|&&v| v as usize >= vertices) {
        return Err(SurfaceError::NoSuchVertex { vertex, vertices });
    }
    let reduced = Reduced::new(mesh, modes, handles);
    let targets: Vec<Vector3<f64>> = pose.positions().iter().map(|p| p.coords).collect();
    let mut q = DVector::zeros(modes.values.len());
    let mut motion = reduced.rigid(&q, &targets);
    for _ in 0..ITERATIONS {
        q = reduced.coefficients(&motion, &targets);
        motion = reduced.rigid(&q, &targets);
    }
    let (rotation, from, to) = motion;
    let position = |(v, p): (usize, &Point3<f64>)| {
        let moved = modes.vectors.iter().zip(q.iter()).fold(p.coords, |sum, (u, q)| sum + u[v] * *q);
        Point3::from(to + rotation * (moved - from))
    };
    Ok(mesh.positions().iter().enumerate().map(position).collect())
}

/// `(rotation, from, to)` of `y = to + rotation (x − from)`.
type Rigid = (Matrix3<f64>, Vector3<f64>, Vector3<f64>);

/// The problem restricted to the handles.
struct Reduced {
    rest: Vec<Vector3<f64>>,
    /// Modes at the handles: by handle, then by mode.
    modes: Vec<Vec<Vector3<f64>>>,
    /// `W a_h`.
    weights: Vec<f64>,
    /// `diag λ + W Σ a u uᵀ`, factored; `None` without modes.
    factor: Option<nalgebra::Cholesky<f64, nalgebra::Dyn>>,
}

impl Reduced {
    fn new(mesh: &TriMesh, modes: &Modes, handles: &Handles) -> Self {
        let at = |v: u32| v as usize;
        let areas = barycentric_areas(mesh);
        let whole: f64 = areas.iter().sum();
        let constrained: f64 = handles.vertices().iter().map(|&v| areas[at(v)]).sum();
        let highest = modes.values.last().copied().unwrap_or(1.0);
        let scale =
            if constrained > 0.0 { HANDLE_WEIGHT * highest * whole / constrained } else { HANDLE_WEIGHT * highest };
        let weight = |&v: &u32| scale * if constrained > 0.0 { areas[at(v)] } else { 1.0 };
        let weights: Vec<f64> = handles.vertices().iter().map(weight).collect();
        let rest = handles.vertices().iter().map(|&v| mesh.positions()[at(v)].coords).collect();
        let of_handle = |&v: &u32| modes.vectors.iter().map(|u| u[at(v)]).collect();
        let at_handles: Vec<Vec<Vector3<f64>>> = handles.vertices().iter().map(of_handle).collect();
        let mut normal = DMatrix::from_diagonal(&DVector::from_column_slice(&modes.values));
        for (u, w) in at_handles.iter().zip(&weights) {
            for i in 0..u.len() {
                for j in 0..u.len() {
                    normal[(i, j)] += w * u[i].dot(&u[j]);
                }
            }
        }
        Self { rest, modes: at_handles, weights, factor: normal.cholesky() }
    }

    /// Positions of the handles after the modes, before the rigid motion.
    fn posed(&self, q: &DVector<f64>) -> Vec<Vector3<f64>> {
        let moved =
            |(x, u): (&Vector3<f64>, &Vec<Vector3<f64>>)| u.iter().zip(q.iter()).fold(*x, |sum, (u, q)| sum + u * *q);
        self.rest.iter().zip(&self.modes).map(moved).collect()
    }

    fn rigid(&self, q: &DVector<f64>, targets: &[Vector3<f64>]) -> Rigid {
        let posed = self.posed(q);
        // Handles without area have equal positive weights.
        let total: f64 = self.weights.iter().sum();
        let mean = |points: &[Vector3<f64>]| {
            points.iter().zip(&self.weights).map(|(p, w)| p * (w / total)).sum::<Vector3<f64>>()
        };
        let (from, to) = (mean(&posed), mean(targets));
        let pairs = posed.iter().zip(targets).zip(&self.weights);
        let covariance: Matrix3<f64> = pairs.map(|((x, y), w)| (y - to) * (x - from).transpose() * (w / total)).sum();
        (nearest_rotation(&covariance), from, to)
    }

    fn coefficients(&self, (rotation, from, to): &Rigid, targets: &[Vector3<f64>]) -> DVector<f64> {
        let modes = self.modes.first().map_or(0, Vec::len);
        let mut right = DVector::zeros(modes);
        for (((x, u), w), target) in self.rest.iter().zip(&self.modes).zip(&self.weights).zip(targets) {
            let offset = rotation.transpose() * (target - to) + from - x;
            u.iter().enumerate().for_each(|(k, u)| right[k] += w * u.dot(&offset));
        }
        self.factor.as_ref().map_or_else(|| DVector::zeros(modes), |factor| factor.solve(&right))
    }
}
