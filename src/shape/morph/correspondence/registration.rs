//! A surface laid over another: smoothly deformed until it lies on it, its landmarks on theirs.
//!
//! ```text
//! E(x) = w_S Σ_{t ~ u} |Tₜ − Tᵤ|² + w_I Σ_t |Tₜ − I|² + w_C Σᵥ |xᵥ − cᵥ|²      s.t.  x_l = the landmark's place
//! ```
//!
//! `Tₜ` is the affine map of triangle `t` and a fourth vertex along its normal, linear in the unknowns; `cᵥ` is the place of the
//! other surface nearest to `xᵥ` whose normal does not point the other way. With `w_C = 0` first, then growing from 1 to 5000 while
//! `c` is found anew, all least squares over one pattern. Then every vertex is put on its `c`.
//!
//! Before, the surface is brought to the other by the similarity of the landmarks, and lengths are measured in diagonals of the other:
//! the weights then mean the same for all models. Departs from the paper in that landmarks stay exact throughout, and in a last
//! round at the largest weight.
//!
//! # Reference
//! R. W. Sumner, J. Popović, *Deformation transfer for triangle meshes*, SIGGRAPH 2004, section 5.

use std::sync::Arc;

use nalgebra::{Matrix3, Matrix3x4, Point3, Similarity3, Vector3};

use super::super::MorphError;
use super::super::bvh::{Bvh, Nearest};
use super::super::rigid::nearest_similarity;
use super::super::trajectory::neighbors;
use super::unfolding::unfold;
use crate::mesh::TriMesh;
use plumbline_num::run::Run;
use plumbline_num::sparse::{Cholesky, CompactFactor, Ordering, Pattern, SparseMatrix};

/// Every vertex is drawn this faintly to where the similarity of the landmarks put it: pieces without a landmark stay there while
/// nothing else holds them. Far above rounding (pivots of 10⁻¹³ against the 10⁴ of short edges), far below all weights.
const FAINT: f64 = 1e-6;

/// How a surface is laid over another.
#[derive(Clone, Debug, PartialEq)]
pub struct RegistrationOptions {
    /// `w_S`.
    pub smoothness: f64,
    /// `w_I`.
    pub identity: f64,
    /// `w_C` of each round.
    pub closeness: Vec<f64>,
}

impl Default for RegistrationOptions {
    fn default() -> Self {
        Self { smoothness: 1.0, identity: 0.001, closeness: vec![0.0, 1.0, 20.0, 400.0, 5000.0, 5000.0] }
    }
}

/// Where the vertices of `first` lie on `second`: one place per vertex.
///
/// # Errors
/// [`MorphError::Landmarks`] for fewer than three or on one line, [`MorphError::Empty`], [`MorphError::Numerics`],
/// [`MorphError::Interrupted`].
pub fn register(
    first: &TriMesh,
    second: &TriMesh,
    landmarks: &[(u32, u32)],
    options: &RegistrationOptions,
    run: &Run,
) -> Result<Vec<Nearest>, MorphError> {
    let unit = second.diagonal();
    let near = brought_near(first, second, landmarks)?;
    let scaled = |p: &Point3<f64>| p / unit;
    let start = first.with_positions(near.iter().map(scaled).collect())?;
    let goal = second.with_positions(second.positions().iter().map(scaled).collect())?;
    run.check()?;
    let target = Target::new(&goal)?;
    let mut system = System::new(&start, landmarks, &goal, options)?;
    let mut x = start.positions().to_vec();
    for (k, &closeness) in options.closeness.iter().enumerate() {
        run.step(k as f64 / options.closeness.len() as f64)?;
        let places = if closeness > 0.0 { target.places(&start, &x, run)? } else { Vec::new() };
        x = system.solve(closeness, &places, run)?;
    }
    let mut places = target.places(&start, &x, run)?;
    for &(v, w) in landmarks {
        places[v as usize] = target.vertex(w);
    }
    let mut held = vec![false; places.len()];
    for l in landmarks {
        held[l.0 as usize] = true;
    }
    unfold(&start, &target, &held, &mut places, run)?;
    let in_units = |p: Nearest| {
        let corners = second.corners(p.triangle as usize);
        let point = corners.iter().zip(p.weights).map(|(c, w)| c.coords * w).sum::<Vector3<f64>>();
        Nearest { point: Point3::from(point), squared: p.squared * unit * unit, ..p }
    };
    Ok(places.into_iter().map(in_units).collect())
}

/// The first mesh after the similarity of the landmarks.
pub(super) fn brought_near(
    first: &TriMesh,
    second: &TriMesh,
    landmarks: &[(u32, u32)],
) -> Result<Vec<Point3<f64>>, MorphError> {
    let from: Vec<_> = landmarks.iter().map(|l| first.positions()[l.0 as usize]).collect();
    let to: Vec<_> = landmarks.iter().map(|l| second.positions()[l.1 as usize]).collect();
    let (map, rank): (Similarity3<f64>, usize) = nearest_similarity(&from, &to, &vec![1.0; from.len()], true);
    if landmarks.len() < 3 || rank < 2 {
        return Err(MorphError::Landmarks { given: landmarks.len(), expected: 3 });
    }
    Ok(first.positions().iter().map(|p| map * p).collect())
}

/// The surface on which the other is laid.
pub(super) struct Target<'m> {
    mesh: &'m TriMesh,
    bvh: Bvh,
    normals: Vec<Vector3<f64>>,
    triangle_of_vertex: Vec<Option<(u32, usize)>>,
    area: f64,
}

impl<'m> Target<'m> {
    pub(super) fn new(mesh: &'m TriMesh) -> Result<Self, MorphError> {
        let area = mesh.area();
        if !(area > 0.0) {
            return Err(MorphError::Empty { which: "second" });
        }
        let mut triangle_of_vertex = vec![None; mesh.vertex_count()];
        for (t, corners) in mesh.triangles().iter().enumerate() {
            corners.iter().enumerate().for_each(|(k, v)| triangle_of_vertex[*v as usize] = Some((t as u32, k)));
        }
        let normals = (0..mesh.triangle_count()).map(|t| mesh.area_normal(t)).collect();
        Ok(Self { mesh, bvh: Bvh::new(mesh), normals, triangle_of_vertex, area })
    }

    /// The place nearest to a point whose normal does not point away from `normal`; any where none does.
    pub(super) fn place(&self, point: &Point3<f64>, normal: &Vector3<f64>) -> Result<Nearest, MorphError> {
        let facing = self.bvh.nearest(point, |t| self.normals[t as usize].dot(normal) > 0.0);
        facing.or_else(|| self.bvh.nearest(point, |_| true)).ok_or(MorphError::Empty { which: "second" })
    }

    /// The place nearest to a point.
    pub(super) fn nearest(&self, point: &Point3<f64>) -> Option<Nearest> {
        self.bvh.nearest(point, |_| true)
    }

    /// Area of the surface.
    pub(super) fn area(&self) -> f64 {
        self.area
    }

    /// Normal of a triangle, as long as twice its area.
    pub(super) fn normal(&self, triangle: u32) -> Vector3<f64> {
        self.normals[triangle as usize]
    }

    /// Places for all vertices of a mesh at other positions.
    pub(super) fn places(&self, mesh: &TriMesh, x: &[Point3<f64>], run: &Run) -> Result<Vec<Nearest>, MorphError> {
        let now = mesh.with_positions(x.to_vec())?;
        let place = |(p, n): (&Point3<f64>, Vector3<f64>)| {
            run.check()?;
            self.place(p, &n)
        };
        x.iter().zip(now.vertex_normals()).map(place).collect()
    }

    /// A vertex as a place.
    pub(super) fn vertex(&self, v: u32) -> Nearest {
        let (triangle, corner) = self.triangle_of_vertex[v as usize].unwrap_or((0, 0));
        let mut weights = [0.0; 3];
        weights[corner] = 1.0;
        Nearest { triangle, weights, point: self.mesh.positions()[v as usize], squared: 0.0 }
    }
}

/// The least squares of all rounds: vertices, then one fourth vertex per triangle.
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
        let mut places = start.positions().to_vec();
        let affine: Vec<Affine> = (0..m).map(|t| Affine::new(start, t, n, &mut places)).collect();
        let mut fixed = vec![None; n + m];
        for &(v, w) in landmarks {
            fixed[v as usize] = Some(goal.positions()[w as usize]);
        }
        let mut used = vec![false; n + m];
        affine.iter().flat_map(|a| a.vertices).for_each(|v| used[v as usize] = true);
        // A vertex that no triangle names stays where it is.
        for v in (0..n).filter(|&v| !used[v]) {
            fixed[v].get_or_insert(places[v]);
        }
        let mut entries = Entries { triplets: Vec::new(), rhs: vec![Vector3::zeros(); n + m] };
        entries.smoothness(&affine, &neighbors(start.triangles()), 2.0 * options.smoothness);
        entries.identity(&affine, options.identity);
        Self::assembled(places, n, fixed, entries)
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
            let slot = pattern.slot(i, j).expect("a place of this pattern");
            matrix.values_mut()[slot] += value;
        }
        let positions = free.iter().map(|&v| start[v].coords.into()).collect();
        let cholesky = Cholesky::analyze(&pattern, &Ordering::NestedDissection(positions))?;
        Ok(Self { start, vertices, unknown, fixed, matrix, coupling, rhs: entries.rhs, cholesky })
    }

    /// The minimizer with the vertices drawn to `places`, none where there are none.
    fn solve(&mut self, closeness: f64, places: &[Nearest], run: &Run) -> Result<Vec<Point3<f64>>, MorphError> {
        let mut matrix = self.matrix.clone();
        let mut rhs = vec![[0.0; 3]; matrix.n()];
        let free = self.unknown.iter().enumerate().filter_map(|(v, k)| k.map(|k| (v, k as usize)));
        for (v, k) in free {
            rhs[k] = (self.rhs[v] + self.start[v].coords * FAINT).into();
            let diagonal = matrix.pattern().column_starts()[k] as usize;
            matrix.values_mut()[diagonal] += FAINT;
            if let Some(place) = places.get(v) {
                matrix.values_mut()[diagonal] += closeness;
                (0..3).for_each(|c| rhs[k][c] += closeness * place.point[c]);
            }
        }
        for &(k, v, value) in &self.coupling {
            let place = self.fixed[v as usize].expect("coupled to what is fixed");
            (0..3).for_each(|c| rhs[k as usize][c] -= value * place[c]);
        }
        self.cholesky.factor(&matrix, run)?;
        CompactFactor::new(&self.cholesky).solve_points(&mut rhs);
        let place = |v: usize| match (self.unknown[v], self.fixed[v]) {
            (Some(k), _) => Point3::from(rhs[k as usize]),
            (None, fixed) => fixed.unwrap_or(self.start[v]),
        };
        Ok((0..self.vertices).map(place).collect())
    }
}

impl Affine {
    /// The map of a triangle at rest; `places` gains its fourth vertex.
    fn new(mesh: &TriMesh, t: usize, vertices: usize, places: &mut Vec<Point3<f64>>) -> Self {
        let [a, b, c] = mesh.corners(t);
        let normal = mesh.area_normal(t);
        // As long as an edge, whatever the shape; anything that is not flat serves a triangle without area.
        let length = normal.norm().sqrt();
        let fourth = if length > 0.0 { normal / length } else { Vector3::zeros() };
        places.push(a + fourth);
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
            // Coordinate c of T is wanted as the c-th unit vector.
            for (v, g) in &row {
                self.rhs[*v as usize] += g * weight;
            }
            // Whatever the triangle's shape, something holds its fourth vertex.
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
