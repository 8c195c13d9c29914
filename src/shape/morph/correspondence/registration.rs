//! Non-rigid registration of a surface to another one with landmarks.
//!
//! ```text
//! E(x) = w_S Σ_{t ~ u} |Tₜ − Tᵤ|² + w_I Σ_t |Tₜ − I|² + w_C Σᵥ |xᵥ − cᵥ|²      s.t.  x_l = the landmark's target
//! ```
//!
//! `Tₜ` is the affine map of triangle `t` with a fourth vertex along its normal, linear in the unknowns; `cᵥ` is the closest point
//! to `xᵥ` on the target whose normal does not oppose that of `xᵥ`. `w_C` is 0 first, then grows from 1 to 5000 while `c` is
//! updated; all systems have one sparsity pattern. Finally every vertex is projected to its `c`.
//!
//! The surface is first aligned by the similarity of the landmarks, and lengths are in diagonals of the target, so that the weights
//! are independent of the model. Departures from the paper: landmarks are hard constraints throughout, and there is a last
//! iteration at the largest weight.
//!
//! # Reference
//! R. W. Sumner, J. Popović, *Deformation transfer for triangle meshes*, SIGGRAPH 2004, section 5.

use std::cell::Cell;
use std::sync::Arc;

use nalgebra::{Matrix3, Matrix3x4, Point3, Vector3};

use super::super::MorphError;
use super::super::bvh::{Bvh, CORNERS, SurfacePoint};
use super::super::rigid::landmark_similarity;
use super::super::trajectory::neighbors;
use super::unfolding::unfold;
use crate::mesh::TriMesh;
use crate::mesh::operators::max_multiplications;
use plumbline_num::run::Run;
use plumbline_num::sparse::{Cholesky, CompactFactor, Ordering, Pattern, SparseMatrix};

/// Weight of a quadratic term towards the aligned positions: keeps components without a landmark in place while `w_C = 0`. Far above
/// rounding (pivots of 10⁻¹³ for entries of 10⁴ of short edges), far below all other weights.
const REGULARIZATION: f64 = 1e-6;

/// Tests of triangles in searches for closest points, for each triangle of both surfaces. Of twelve pairs of unlike models none took
/// more than 1000 (10 to 30 a search, with removal of fold-overs); a layered surface is refused after a fraction of a millisecond per
/// triangle.
const MAX_TESTS_PER_TRIANGLE: usize = 5000;

/// Options of the registration.
#[derive(Clone, Debug, PartialEq)]
pub struct RegistrationOptions {
    /// Weight `w_S` of the smoothness term.
    pub smoothness: f64,
    /// Weight `w_I` of the identity term.
    pub identity: f64,
    /// Weight `w_C` of the closest-point term in each iteration.
    pub closeness: Vec<f64>,
}

impl Default for RegistrationOptions {
    fn default() -> Self {
        Self { smoothness: 1.0, identity: 0.001, closeness: vec![0.0, 1.0, 20.0, 400.0, 5000.0, 5000.0] }
    }
}

/// Maps the vertices of `first` to points on `second`.
///
/// # Errors
/// [`MorphError::Landmarks`] for fewer than three or collinear ones, [`MorphError::Empty`], [`MorphError::Layered`],
/// [`MorphError::Numerics`], [`MorphError::Interrupted`].
pub fn register(
    first: &TriMesh,
    second: &TriMesh,
    landmarks: &[(u32, u32)],
    options: &RegistrationOptions,
    run: &Run,
) -> Result<Vec<SurfacePoint>, MorphError> {
    let unit = second.diagonal();
    let pair = |l: &(u32, u32)| (first.positions()[l.0 as usize], second.positions()[l.1 as usize]);
    let align = landmark_similarity(landmarks.iter().map(pair))?;
    let initial = first.with_positions(first.positions().iter().map(|p| align * p / unit).collect())?;
    let goal = second.with_positions(second.positions().iter().map(|p| p / unit).collect())?;
    run.check()?;
    let target = Target::new(&goal, "second", first.triangle_count())?;
    let mut system = System::new(&initial, landmarks, &goal, options)?;
    let mut x = initial.positions().to_vec();
    for (k, &closeness) in options.closeness.iter().enumerate() {
        run.step(k as f64 / options.closeness.len() as f64)?;
        let points = if closeness > 0.0 { target.closest_points(&initial, &x, run)? } else { Vec::new() };
        x = system.solve(closeness, &points, run)?;
    }
    let mut points = target.closest_points(&initial, &x, run)?;
    for &(v, w) in landmarks {
        points[v as usize] = target.vertex(w);
    }
    let mut fixed = vec![false; points.len()];
    for l in landmarks {
        fixed[l.0 as usize] = true;
    }
    unfold(&initial, &target, &fixed, &mut points, run)?;
    let in_units = |p: SurfacePoint| SurfacePoint {
        squared: p.squared * unit * unit,
        ..SurfacePoint::on(second, p.triangle, p.weights)
    };
    Ok(points.into_iter().map(in_units).collect())
}

/// A triangle of each vertex, and which of its corners the vertex is; `None` for isolated vertices.
pub(super) fn corner_of_vertices(mesh: &TriMesh) -> Vec<Option<(u32, usize)>> {
    let mut corner_of = vec![None; mesh.vertex_count()];
    for (t, corners) in (0..).zip(mesh.triangles()) {
        corners.iter().enumerate().for_each(|(k, &v)| corner_of[v as usize] = Some((t, k)));
    }
    corner_of
}

/// A surface that is searched for closest points; the work is bounded over all searches.
pub(super) struct Target<'m> {
    mesh: &'m TriMesh,
    which: &'static str,
    bvh: Bvh,
    normals: Vec<Vector3<f64>>,
    corner_of_vertex: Vec<Option<(u32, usize)>>,
    area: f64,
    /// Tests that are left.
    tests: Cell<usize>,
    most: usize,
}

impl<'m> Target<'m> {
    /// The surface of a mesh, which errors call `which`; it is searched from a surface of so many triangles.
    pub(super) fn new(mesh: &'m TriMesh, which: &'static str, triangles: usize) -> Result<Self, MorphError> {
        let area = mesh.area();
        if !(area > 0.0) {
            return Err(MorphError::Empty { which });
        }
        let normals = (0..mesh.triangle_count()).map(|t| mesh.area_normal(t)).collect();
        let (bvh, corner_of_vertex) = (Bvh::new(mesh), corner_of_vertices(mesh));
        let most = MAX_TESTS_PER_TRIANGLE * (mesh.triangle_count() + triangles);
        Ok(Self { mesh, which, bvh, normals, corner_of_vertex, area, tests: Cell::new(most), most })
    }

    /// The closest point of accepted triangles.
    fn search(&self, point: &Point3<f64>, accept: impl Fn(u32) -> bool) -> Result<Option<SurfacePoint>, MorphError> {
        let (found, tests) = self.bvh.nearest_counted(point, accept);
        let left = self.tests.get().checked_sub(tests);
        self.tests.set(left.unwrap_or(0));
        left.map(|_| found).ok_or(MorphError::Layered { which: self.which, most: self.most })
    }

    /// The closest point whose normal does not oppose `normal`; the closest point if there is none.
    pub(super) fn closest_facing(
        &self,
        point: &Point3<f64>,
        normal: &Vector3<f64>,
    ) -> Result<SurfacePoint, MorphError> {
        match self.search(point, |t| self.normals[t as usize].dot(normal) > 0.0)? {
            Some(facing) => Ok(facing),
            None => self.nearest(point),
        }
    }

    /// The closest point.
    pub(super) fn nearest(&self, point: &Point3<f64>) -> Result<SurfacePoint, MorphError> {
        self.search(point, |_| true)?.ok_or(MorphError::Empty { which: self.which })
    }

    /// Area of the surface.
    pub(super) fn area(&self) -> f64 {
        self.area
    }

    /// Normal of a triangle, of length twice its area.
    pub(super) fn normal(&self, triangle: u32) -> Vector3<f64> {
        self.normals[triangle as usize]
    }

    /// The closest facing points of all vertices of a mesh at the positions `x`.
    pub(super) fn closest_points(
        &self,
        mesh: &TriMesh,
        x: &[Point3<f64>],
        run: &Run,
    ) -> Result<Vec<SurfacePoint>, MorphError> {
        let now = mesh.with_positions(x.to_vec())?;
        let closest = |(p, n): (&Point3<f64>, Vector3<f64>)| {
            run.check()?;
            self.closest_facing(p, &n)
        };
        x.iter().zip(now.vertex_normals()).map(closest).collect()
    }

    /// A vertex as a surface point.
    pub(super) fn vertex(&self, v: u32) -> SurfacePoint {
        let (triangle, corner) = self.corner_of_vertex[v as usize].unwrap_or((0, 0));
        SurfacePoint { triangle, weights: CORNERS[corner], point: self.mesh.positions()[v as usize], squared: 0.0 }
    }
}

/// The least-squares system of all iterations: vertices, then one fourth vertex per triangle.
struct System {
    start: Vec<Point3<f64>>,
    vertices: usize,
    unknown: Vec<Option<u32>>,
    fixed: Vec<Option<Point3<f64>>>,
    matrix: SparseMatrix,
    /// `(free, fixed, value)`.
    coupling: Vec<(u32, u32, f64)>,
    rhs: Vec<Vector3<f64>>,
    cholesky: Cholesky,
}

/// `T` as a linear function of a triangle's four vertices: `T = Σⱼ xⱼ Gⱼᵀ`, `G` `3 × 4`.
struct Affine {
    vertices: [u32; 4],
    gradients: Matrix3x4<f64>,
}

impl System {
    fn new(
        start: &TriMesh,
        landmarks: &[(u32, u32)],
        goal: &TriMesh,
        options: &RegistrationOptions,
    ) -> Result<Self, MorphError> {
        let (n, m) = (start.vertex_count(), start.triangle_count());
        let mut points = start.positions().to_vec();
        let affine: Vec<Affine> = (0..m).map(|t| Affine::new(start, t, n, &mut points)).collect();
        let mut fixed = vec![None; n + m];
        for &(v, w) in landmarks {
            fixed[v as usize] = Some(goal.positions()[w as usize]);
        }
        let mut used = vec![false; n + m];
        affine.iter().flat_map(|a| a.vertices).for_each(|v| used[v as usize] = true);
        // Unreferenced vertices are fixed.
        for v in (0..n).filter(|&v| !used[v]) {
            fixed[v].get_or_insert(points[v]);
        }
        let mut entries = Entries { triplets: Vec::new(), rhs: vec![Vector3::zeros(); n + m] };
        entries.smoothness(&affine, &neighbors(start.triangles()), 2.0 * options.smoothness);
        entries.identity(&affine, options.identity);
        Self::assembled(points, n, fixed, entries)
    }

    fn assembled(
        start: Vec<Point3<f64>>,
        vertices: usize,
        fixed: Vec<Option<Point3<f64>>>,
        entries: Entries,
    ) -> Result<Self, MorphError> {
        let free: Vec<usize> = (0..start.len()).filter(|&v| fixed[v].is_none()).collect();
        let mut unknown = vec![None; start.len()];
        free.iter().enumerate().for_each(|(k, &v)| unknown[v] = Some(k as u32));
        let (mut inner, mut coupling) = (Vec::with_capacity(entries.triplets.len()), Vec::new());
        for (i, j, value) in entries.triplets {
            match (unknown[i as usize], unknown[j as usize]) {
                (Some(a), Some(b)) => inner.push((a as usize, b as usize, value)),
                (Some(a), None) => coupling.push((a, j, value)),
                (None, Some(b)) => coupling.push((b, i, value)),
                (None, None) => {}
            }
        }
        let pattern = Arc::new(Pattern::new(free.len(), inner.iter().map(|&(i, j, _)| (i, j)))?);
        let mut matrix = SparseMatrix::zeros(Arc::clone(&pattern));
        for (i, j, value) in inner {
            let slot = pattern.slot(i, j).expect("an entry of this pattern");
            matrix.values_mut()[slot] += value;
        }
        let positions = free.iter().map(|&v| start[v].coords.into()).collect();
        let ordering = Ordering::NestedDissection(positions);
        let cholesky = Cholesky::analyze_within(&pattern, &ordering, max_multiplications(pattern.n()))?;
        Ok(Self { start, vertices, unknown, fixed, matrix, coupling, rhs: entries.rhs, cholesky })
    }

    /// The minimizer with the closest points `places`; without the closest-point term if empty.
    fn solve(&mut self, closeness: f64, points: &[SurfacePoint], run: &Run) -> Result<Vec<Point3<f64>>, MorphError> {
        let mut matrix = self.matrix.clone();
        let mut rhs = vec![[0.0; 3]; matrix.n()];
        let free = self.unknown.iter().enumerate().filter_map(|(v, k)| k.map(|k| (v, k as usize)));
        for (v, k) in free {
            rhs[k] = (self.rhs[v] + self.start[v].coords * REGULARIZATION).into();
            let diagonal = matrix.pattern().column_starts()[k] as usize;
            matrix.values_mut()[diagonal] += REGULARIZATION;
            if let Some(point) = points.get(v) {
                matrix.values_mut()[diagonal] += closeness;
                (0..3).for_each(|c| rhs[k][c] += closeness * point.point[c]);
            }
        }
        for &(k, v, value) in &self.coupling {
            let point = self.fixed[v as usize].expect("coupled to a fixed vertex");
            (0..3).for_each(|c| rhs[k as usize][c] -= value * point[c]);
        }
        self.cholesky.factor(&matrix, run)?;
        CompactFactor::new(&self.cholesky).solve_points(&mut rhs);
        let position = |v: usize| match (self.unknown[v], self.fixed[v]) {
            (Some(k), _) => Point3::from(rhs[k as usize]),
            (None, fixed) => fixed.unwrap_or(self.start[v]),
        };
        Ok((0..self.vertices).map(position).collect())
    }
}

impl Affine {
    /// The map of a triangle at rest; appends its fourth vertex to `places`.
    fn new(mesh: &TriMesh, t: usize, vertices: usize, points: &mut Vec<Point3<f64>>) -> Self {
        let [a, b, c] = mesh.corners(t);
        let normal = mesh.area_normal(t);
        // The length of an edge; a degenerate triangle has no fourth vertex.
        let length = normal.norm().sqrt();
        let fourth = if length > 0.0 { normal / length } else { Vector3::zeros() };
        points.push(a + fourth);
        let inverse = Matrix3::from_columns(&[b - a, c - a, fourth]).try_inverse().filter(|m| m.amax() < 1e12);
        let inverse = inverse.unwrap_or_else(Matrix3::zeros);
        let first = -(inverse.row(0) + inverse.row(1) + inverse.row(2));
        let gradients = Matrix3x4::from_columns(&[
            first.transpose(),
            inverse.row(0).transpose(),
            inverse.row(1).transpose(),
            inverse.row(2).transpose(),
        ]);
        let [i, j, k] = mesh.triangles()[t];
        Self { vertices: [i, j, k, (vertices + t) as u32], gradients }
    }
}

/// Entries of the normal equations.
struct Entries {
    triplets: Vec<(u32, u32, f64)>,
    rhs: Vec<Vector3<f64>>,
}

impl Entries {
    fn smoothness(&mut self, affine: &[Affine], neighbors: &[Vec<u32>], weight: f64) {
        for (t, around) in neighbors.iter().enumerate() {
            for &u in around.iter().filter(|&&u| (t as u32) < u) {
                let (a, b) = (&affine[t], &affine[u as usize]);
                let mut row: Vec<(u32, Vector3<f64>)> = Vec::with_capacity(8);
                for (of, sign) in [(a, 1.0), (b, -1.0)] {
                    for (k, &v) in of.vertices.iter().enumerate() {
                        let g = of.gradients.column(k) * sign;
                        match row.iter_mut().find(|r| r.0 == v) {
                            Some(same) => same.1 += g,
                            None => row.push((v, g)),
                        }
                    }
                }
                self.squares(&row, weight);
            }
        }
    }

    fn identity(&mut self, affine: &[Affine], weight: f64) {
        for a in affine {
            let row: Vec<_> =
                a.vertices.iter().enumerate().map(|(k, &v)| (v, a.gradients.column(k).into_owned())).collect();
            self.squares(&row, weight);
            // The target of coordinate c of T is the c-th unit vector.
            for (v, g) in &row {
                self.rhs[*v as usize] += g * weight;
            }
            // The fourth vertex of a degenerate triangle needs a diagonal entry.
            if a.gradients.amax() == 0.0 {
                self.triplets.push((a.vertices[3], a.vertices[3], weight));
            }
        }
    }

    fn squares(&mut self, row: &[(u32, Vector3<f64>)], weight: f64) {
        for (k, (i, g)) in row.iter().enumerate() {
            self.triplets.extend(row[..=k].iter().map(|(j, h)| (*i, *j, weight * g.dot(h))));
        }
    }
}
