//! Discrete differential operators of a triangle mesh. Each is a sum over triangles, so that open, non-manifold and
//! inconsistently oriented meshes need no special case.
//!
//! ```text
//! gradient     (∇u)_t = Σₖ uₖ ∇φₖ                         per triangle, 1/length
//! divergence   (div X)ᵢ = −Σ_{t∋i} A_t ∇φᵢ · X_t           per vertex, integrated
//! Laplacian    (L u)ᵢ = Σⱼ w_ij (uᵢ − uⱼ) = −div ∇u        per vertex, integrated; positive semidefinite, rows sum to 0
//! mass         M = diag(areas of the vertices' cells)      the pointwise Laplacian is M⁻¹ L
//! ```
//!
//! `w_ij` is half the sum of the cotangents of the angles opposite the edge `ij` in its triangles. The contribution of a
//! triangle to `uᵀ L u` is `∫ |∇u|²` over it, hence never negative, even where an obtuse angle makes a *single* weight
//! negative.
//!
//! # Reference
//! U. Pinkall, K. Polthier, *Computing discrete minimal surfaces and their conjugates*, Experimental Mathematics 2 (1993);
//! M. Botsch, L. Kobbelt, M. Pauly, P. Alliez, B. Lévy, *Polygon Mesh Processing*, 2010, chapter 3.

mod cotangents;
mod density;
mod edge_weights;
mod gradient;
mod intrinsic_delaunay;
mod mass;

pub use cotangents::{CotangentRule, Cotangents};
pub(crate) use density::{Forming, factored_laplacian, max_multiplications};
pub use edge_weights::EdgeWeights;
pub use gradient::Gradient;
pub use mass::barycentric_areas;

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::*;
    use crate::mesh::TriMesh;

    /// A bumpy sheet with a border, skewed so that angles are obtuse here and there.
    fn sheet(n: usize) -> TriMesh {
        let positions = (0..n * n).map(|v| {
            let (x, y) = ((v % n) as f64 / n as f64, (v / n) as f64 / n as f64);
            Point3::new(x + 0.9 * y, y, 0.2 * (7.0 * x).sin() * (5.0 * y).cos())
        });
        let m = n as u32;
        let cell = |x: u32, y: u32| {
            let v = y * m + x;
            [[v, v + 1, v + m + 1], [v, v + m + 1, v + m]]
        };
        let triangles = (0..m - 1).flat_map(|y| (0..m - 1).flat_map(move |x| cell(x, y))).collect();
        TriMesh::new(positions.collect(), triangles).unwrap()
    }

    fn function(mesh: &TriMesh) -> Vec<f64> {
        mesh.positions().iter().map(|p| (3.0 * p.x).sin() + p.y * p.z - 0.3 * p.y).collect()
    }

    #[test]
    fn the_laplacian_is_minus_the_divergence_of_the_gradient() {
        let mesh = sheet(12);
        let u = function(&mesh);
        let gradient = Gradient::new(&mesh);
        let divergence = gradient.divergence(&gradient.apply(&u));
        let weights = EdgeWeights::cotangent(144, &Cotangents::new(&mesh, CotangentRule::Raw));
        assert!(weights.negative() > 0);
        let mut lu = vec![0.0; 144];
        weights.laplacian().unwrap().multiply(&u, &mut lu);
        for (l, d) in lu.iter().zip(&divergence) {
            assert!((l + d).abs() < 1e-12, "{l} {d}");
        }
    }

    #[test]
    fn gradients_of_linear_functions_are_their_tangential_slopes() {
        let mesh = sheet(7);
        let slope = Vector3::new(0.3, -1.2, 0.8);
        let u: Vec<f64> = mesh.positions().iter().map(|p| slope.dot(&p.coords) + 4.0).collect();
        for (t, g) in Gradient::new(&mesh).apply(&u).into_iter().enumerate() {
            let n = mesh.area_normal(t).normalize();
            assert!((g - (slope - n * n.dot(&slope))).norm() < 1e-12);
        }
    }

    #[test]
    fn a_quadratic_form_of_the_laplacian_is_the_energy_of_the_gradient() {
        let mesh = sheet(9);
        let u = function(&mesh);
        let gradient = Gradient::new(&mesh);
        let energy: f64 = gradient.apply(&u).iter().zip(gradient.areas()).map(|(g, a)| a * g.norm_squared()).sum();
        let weights = EdgeWeights::cotangent(81, &Cotangents::new(&mesh, CotangentRule::Raw));
        let form: f64 = weights.iter().map(|(i, j, w)| w * (u[i] - u[j]).powi(2)).sum();
        assert!((energy - form).abs() < 1e-12 * energy);
    }

    #[test]
    fn lumped_areas_are_positive_and_sum_to_the_area_of_the_surface() {
        let mesh = sheet(10);
        let areas = barycentric_areas(&mesh);
        assert!(areas.iter().all(|&a| a > 0.0));
        assert!((areas.iter().sum::<f64>() - mesh.area()).abs() < 1e-12 * mesh.area());
    }

    #[test]
    fn degenerate_triangles_have_zero_gradients_and_finite_areas() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]].map(Point3::from).to_vec();
        let mesh = TriMesh::new(positions, vec![[0, 1, 2], [1, 1, 2]]).unwrap();
        let gradient = Gradient::new(&mesh);
        assert_eq!(gradient.apply(&[1.0, 2.0, 5.0]), vec![Vector3::zeros(); 2]);
        assert_eq!(barycentric_areas(&mesh), vec![0.0; 3]);
    }

    #[test]
    fn operators_do_not_see_where_a_surface_stands_and_scale_with_it() {
        let mesh = sheet(6);
        let [here, there] = [0.0, 1e6].map(|offset| {
            let moved = mesh.positions().iter().map(|p| p * 1e3 + Vector3::repeat(offset)).collect();
            Cotangents::new(&mesh.with_positions(moved).unwrap(), CotangentRule::Raw)
        });
        let rest = Cotangents::new(&mesh, CotangentRule::Raw);
        for ((a, b), c) in rest.half().iter().zip(here.half()).zip(there.half()) {
            for k in 0..3 {
                assert!((a[k] - b[k]).abs() < 1e-12 && (a[k] - c[k]).abs() < 1e-8);
            }
        }
    }
}
