//! Sparse table of the responses of vertices to shapes and joints, and its product with the coefficients of a pose.
//!
//! Responses decay away from the joint. Per vertex the smallest ones are dropped as long as their sum stays below [`MAX_TRUNCATION`] of the
//! diagonal: shapes at their largest coefficient in the training poses, joints for a rotation of one radian and a translation of half the
//! diagonal. A dropped joint's response is added to the nearest kept ancestor, or else to the vertex's strongest joint: rigid motions stay
//! exact, and poses hardly separate a joint from its parent. Vertices with the same joints are grouped by eight, so that a product reads
//! each number once, in order. Numbers are in single precision relative to the center of the mesh.

use nalgebra::{Matrix3, Matrix4, Point3, Vector3};
use rayon::prelude::*;

use super::super::surface_of_gradients::SurfaceOfGradients;
use super::{Coordinates, Parts};
use plumbline_num::run::{Run, Stopped};

/// Largest truncation per vertex, relative to the diagonal.
const MAX_TRUNCATION: f64 = 4e-4;
/// Vertices per row: the width of a 256-bit register.
const LANES: usize = 8;
/// Stretches below this are the rounding of a single-precision rotation.
const STRETCH_TOLERANCE: f64 = 1e-6;
/// Rows per parallel task.
const CHUNK_ROWS: usize = 64;

/// A number for each vertex of a row.
type Lane = [f32; LANES];
/// Three coordinates.
type Lanes = [Lane; 3];

/// The responses of a row of vertices to one joint.
#[derive(Clone, Debug)]
struct Block {
    bone: u32,
    /// End of its shapes in the list of shapes; they start at the end of the block before.
    shapes_end: u32,
}

/// The table, row by row.
#[derive(Clone, Debug)]
pub(super) struct Table {
    middle: Point3<f64>,
    /// Vertices in row order; the last row is padded with the last vertex.
    order: Vec<u32>,
    vertices: usize,
    /// Start of each row in blocks, shapes and numbers; one more entry for the ends.
    rows: Vec<[u32; 3]>,
    blocks: Vec<Block>,
    /// Shape indices of the blocks.
    shapes: Vec<u32>,
    /// Per block `g + h` and its weight, then its shapes.
    numbers: Vec<Lane>,
    /// `h` of each block, for joints that stretch.
    blended: Vec<Lanes>,
}

/// Response of a vertex to a joint: `g`, `h` and its weight.
type JointResponse = (u32, [f32; 7]);
/// Response of a vertex to a shape.
type ShapeResponse = (u32, [f32; 3]);

/// Responses of a vertex.
#[derive(Clone, Debug, Default)]
struct Sparse {
    joints: Vec<JointResponse>,
    shapes: Vec<ShapeResponse>,
}

impl Table {
    /// Solves for all shapes and joints.
    pub(super) fn new(surface: &mut SurfaceOfGradients, parts: &Parts, run: &Run) -> Result<Self, Stopped> {
        let rest = surface.rest().to_vec();
        let (low, high) = bounds(&rest);
        let (middle, diagonal) = (nalgebra::center(&low, &high), (high - low).norm());
        let budget = (MAX_TRUNCATION * diagonal) as f32;
        let mut found = solved(surface, parts, &middle, budget, run)?;
        let bones: Vec<u32> = parts.groups.iter().flat_map(|s| std::iter::repeat_n(s.bone, s.shape_count())).collect();
        let rest: Vec<Vector3<f32>> = rest.iter().map(|p| (p - middle).cast::<f32>()).collect();
        let tree = Tree { bones: &bones, parents: &parts.parents };
        let each = found.par_iter_mut().zip(&rest);
        each.for_each(|(vertex, p)| vertex.leave_out(&tree, p, budget, diagonal as f32));
        let mut order: Vec<u32> = (0..rest.len() as u32).collect();
        let key = |v: &u32| found[*v as usize].joints.iter().map(|j| j.0).collect::<Vec<_>>();
        order.sort_by_cached_key(key);
        let mut table = Self {
            middle,
            vertices: rest.len(),
            order,
            rows: vec![[0; 3]],
            blocks: Vec::new(),
            shapes: Vec::new(),
            numbers: Vec::new(),
            blended: Vec::new(),
        };
        for row in 0..rest.len().div_ceil(LANES) {
            run.check()?;
            table.push_row(row, &found, &bones);
        }
        Ok(table)
    }

    /// Appends a row with the union of its vertices' responses.
    fn push_row(&mut self, row: usize, found: &[Sparse], bones: &[u32]) {
        let lane = |l: usize| &found[self.order[(row * LANES + l).min(self.vertices - 1)] as usize];
        let vertices: [&Sparse; LANES] = std::array::from_fn(lane);
        let mut shapes: Vec<u32> = vertices.iter().flat_map(|v| v.shapes.iter().map(|s| s.0)).collect();
        shapes.sort_unstable();
        shapes.dedup();
        let joints = vertices.iter().flat_map(|v| v.joints.iter().map(|j| j.0));
        let mut joints: Vec<u32> = joints.chain(shapes.iter().map(|&s| bones[s as usize])).collect();
        joints.sort_unstable();
        joints.dedup();
        for bone in joints {
            let response: [[f32; 7]; LANES] =
                std::array::from_fn(|l| vertices[l].joints.iter().find(|j| j.0 == bone).map_or([0.0; 7], |j| j.1));
            self.numbers.extend((0..3).map(|k| response.map(|h| h[k] + h[3 + k])));
            self.numbers.push(response.map(|h| h[6]));
            self.blended.push([3, 4, 5].map(|k| response.map(|h| h[k])));
            for &shape in shapes.iter().filter(|&&s| bones[s as usize] == bone) {
                let moved: [[f32; 3]; LANES] =
                    std::array::from_fn(|l| vertices[l].shapes.iter().find(|s| s.0 == shape).map_or([0.0; 3], |s| s.1));
                self.numbers.extend((0..3).map(|k| moved.map(|m| m[k])));
                self.shapes.push(shape);
            }
            self.blocks.push(Block { bone, shapes_end: self.shapes.len() as u32 });
        }
        self.rows.push([self.blocks.len() as u32, self.shapes.len() as u32, self.numbers.len() as u32]);
    }

    /// The surface in a pose.
    pub(super) fn positions(&self, coordinates: &Coordinates, matrices: &[Matrix4<f64>]) -> Vec<Point3<f64>> {
        let there: Vec<Point3<f64>> = matrices.iter().map(|m| m.transform_point(&self.middle)).collect();
        // Relative to the mean joint position, so that single precision suffices far from the origin.
        let from = Point3::from(there.iter().map(|p| p.coords).sum::<Vector3<f64>>() / there.len().max(1) as f64);
        let joints: Vec<JointMotion> = (matrices.iter().zip(&there).zip(&coordinates.rotations))
            .map(|((m, there), rotation)| JointMotion::new(rotation, m, &(there - from)))
            .collect();
        let shapes: Vec<f32> = coordinates.shapes.iter().map(|z| *z as f32).collect();
        let mut rows = vec![[[0.0; LANES]; 3]; self.rows.len() - 1];
        let chunks = rows.par_chunks_mut(CHUNK_ROWS).enumerate();
        chunks.for_each(|(c, rows)| {
            for (r, x) in rows.iter_mut().enumerate() {
                *x = self.row(c * CHUNK_ROWS + r, &joints, &shapes);
            }
        });
        let mut positions = vec![from; self.vertices];
        for (vertices, x) in self.order.chunks(LANES).zip(&rows) {
            for (l, &v) in vertices.iter().enumerate() {
                positions[v as usize] += Vector3::new(x[0][l], x[1][l], x[2][l]).cast::<f64>();
            }
        }
        positions
    }

    fn row(&self, row: usize, joints: &[JointMotion], coordinates: &[f32]) -> Lanes {
        let ([first, mut shape, at], [end, _, stop]) = (self.rows[row], self.rows[row + 1]);
        let mut numbers = &self.numbers[at as usize..stop as usize];
        let mut sum = [[0.0; LANES]; 3];
        for (block, blended) in (first as usize..end as usize).map(|b| (&self.blocks[b], &self.blended[b])) {
            let joint = &joints[block.bone as usize];
            let ([x, y, z, weight], mut rest) = numbers.split_first_chunk().expect("as many as blocks say");
            let mut own = [*x, *y, *z];
            for k in &self.shapes[shape as usize..block.shapes_end as usize] {
                let (moved, after) = rest.split_first_chunk::<3>().expect("as many as blocks say");
                own.iter_mut().zip(moved).for_each(|(own, u)| add(own, coordinates[*k as usize], u));
                rest = after;
            }
            (numbers, shape) = (rest, block.shapes_end);
            for ((sum, rotation), there) in sum.iter_mut().zip(&joint.rotation).zip(&joint.there) {
                for l in 0..LANES {
                    sum[l] +=
                        rotation[0] * own[0][l] + rotation[1] * own[1][l] + rotation[2] * own[2][l] + there * weight[l];
                }
            }
            if let Some(stretch) = &joint.stretch {
                for (sum, stretch) in sum.iter_mut().zip(stretch) {
                    blended.iter().zip(stretch).for_each(|(h, s)| add(sum, *s, h));
                }
            }
        }
        sum
    }
}

#[inline]
fn add(sum: &mut Lane, factor: f32, lane: &Lane) {
    for (s, x) in sum.iter_mut().zip(lane) {
        *s += factor * x;
    }
}

/// A joint in a pose, row-major.
struct JointMotion {
    rotation: [[f32; 3]; 3],
    /// Posed center of the mesh under this joint.
    there: [f32; 3],
    /// The map minus its rotation, if significant.
    stretch: Option<[[f32; 3]; 3]>,
}

impl JointMotion {
    fn new(rotation: &Matrix3<f64>, matrix: &Matrix4<f64>, there: &Vector3<f64>) -> Self {
        let stretch = matrix.fixed_view::<3, 3>(0, 0) - rotation;
        let rows = |m: &Matrix3<f64>| std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)] as f32));
        Self {
            rotation: rows(rotation),
            there: std::array::from_fn(|c| there[c] as f32),
            stretch: (stretch.amax() > STRETCH_TOLERANCE).then(|| rows(&stretch)),
        }
    }
}

impl Sparse {
    /// Drops the smallest responses of the vertex at `p`: half the budget for shapes, half for joints. Kept joints are in descending order of
    /// weight.
    fn leave_out(&mut self, tree: &Tree<'_>, p: &Vector3<f32>, budget: f32, diagonal: f32) {
        let size = |s: &ShapeResponse| Vector3::from(s.1).norm();
        self.shapes.sort_by(|a, b| size(a).total_cmp(&size(b)));
        let mut left = 0.5 * budget;
        let dropped = self.shapes.iter().take_while(|s| spend(&mut left, size(s))).count();
        self.shapes.drain(..dropped);
        // A joint displaces the vertex by its weight times the translation, and by the rotation about it.
        let cost = |h: &[f32; 7]| {
            let about = Vector3::new(h[0] + h[3], h[1] + h[4], h[2] + h[5]) - p * h[6];
            about.norm() + h[6].abs() * 0.5 * diagonal
        };
        self.joints.sort_by(|a, b| cost(&a.1).total_cmp(&cost(&b.1)));
        let mut left = 0.5 * budget;
        let needed = |bone: u32| self.shapes.iter().any(|s| tree.bones[s.0 as usize] == bone);
        let last = self.joints.len().saturating_sub(1);
        let (mut kept, mut given): (Vec<JointResponse>, Vec<JointResponse>) = (Vec::new(), Vec::new());
        for (k, response) in self.joints.drain(..).enumerate() {
            let leaves = k < last && !needed(response.0) && spend(&mut left, cost(&response.1));
            if leaves { given.push(response) } else { kept.push(response) }
        }
        kept.sort_by(|a, b| b.1[6].total_cmp(&a.1[6]).then(a.0.cmp(&b.0)));
        for (bone, response) in given {
            let mut above = std::iter::successors(Some(bone), |b| tree.parents[*b as usize]);
            let heir = above.find_map(|b| kept.iter().position(|k| k.0 == b)).unwrap_or(0);
            kept[heir].1.iter_mut().zip(response).for_each(|(h, g)| *h += g);
        }
        self.joints = kept;
    }
}

/// The hierarchy of shapes and joints.
struct Tree<'a> {
    /// Joint of each shape.
    bones: &'a [u32],
    parents: &'a [Option<u32>],
}

/// Deducts a cost; whether the budget sufficed.
fn spend(left: &mut f32, cost: f32) -> bool {
    *left -= cost;
    *left >= 0.0
}

fn bounds(points: &[Point3<f64>]) -> (Point3<f64>, Point3<f64>) {
    let Some(first) = points.first() else { return (Point3::origin(), Point3::origin()) };
    points.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)))
}

/// Responses of each vertex, without those far below the budget.
fn solved(
    surface: &mut SurfaceOfGradients,
    parts: &Parts,
    middle: &Point3<f64>,
    budget: f32,
    run: &Run,
) -> Result<Vec<Sparse>, Stopped> {
    let rest: Vec<Vector3<f64>> = surface.rest().iter().map(|p| p - middle).collect();
    let mut found = vec![Sparse::default(); rest.len()];
    let sheet = |t: usize| &parts.groups[parts.group_of[t] as usize];
    let starts: Vec<usize> = (0..parts.group_of.len())
        .scan(0, |at, t| Some(std::mem::replace(at, *at + 1 + sheet(t).shape_count())))
        .collect();
    let map = |at: usize| Matrix3::from_column_slice(&parts.maps[at]).cast::<f64>();
    for bone in 0..parts.parents.len() as u32 {
        run.check()?;
        let weight = |v: usize| parts.weights.weight(v, bone);
        let own = |t: usize| if sheet(t).bone == bone { map(starts[t]) } else { Matrix3::zeros() };
        let gradients_part = surface.solve(own, |_| Vector3::zeros());
        let blended_part = surface.solve(|_| Matrix3::zeros(), |v| rest[v] * weight(v));
        let weights = surface.solve(|_| Matrix3::zeros(), |v| Vector3::new(weight(v), 0.0, 0.0));
        for (v, vertex) in found.iter_mut().enumerate() {
            let (g, h, w) = (gradients_part[v], blended_part[v], weights[v].x);
            let all = [g.x, g.y, g.z, h.x, h.y, h.z, w].map(|x| x as f32);
            if all.iter().any(|x| *x != 0.0) {
                vertex.joints.push((bone, all));
            }
        }
    }
    // Fewer than 1024 responses of this size fit the budget, so smaller ones are dropped at once.
    let speck = budget / 1024.0;
    let mut number = 0;
    for (s, one) in parts.groups.iter().enumerate() {
        for k in 0..one.shape_count() {
            run.check()?;
            let own =
                |t: usize| if parts.group_of[t] as usize == s { map(starts[t] + 1 + k) } else { Matrix3::zeros() };
            for (vertex, u) in found.iter_mut().zip(surface.solve(own, |_| Vector3::zeros())) {
                let u: [f32; 3] = u.coords.cast::<f32>().into();
                if Vector3::from(u).norm() > speck {
                    vertex.shapes.push((number, u));
                }
            }
            number += 1;
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_response_of_a_dropped_joint_goes_to_its_nearest_kept_ancestor() {
        // A chain of four; the vertex follows the first most, the third a little and the fourth hardly.
        let parents = [None, Some(0), Some(1), Some(2)];
        let tree = Tree { bones: &[], parents: &parents };
        let response = |w: f32| [0.0, 0.0, 0.0, w, 0.0, 0.0, w];
        let mut vertex = Sparse {
            joints: vec![(0, response(0.7)), (2, response(0.3 - 1e-5)), (3, response(1e-5))],
            shapes: Vec::new(),
        };
        vertex.leave_out(&tree, &Vector3::x(), 1e-3, 10.0);
        assert_eq!(vertex.joints, [(0, response(0.7)), (2, response(0.3))]);
        // Joints of kept shapes are kept, whatever their weight.
        let mut vertex =
            Sparse { joints: vec![(0, response(1.0)), (3, response(0.0))], shapes: vec![(0, [1.0, 0.0, 0.0])] };
        vertex.leave_out(&Tree { bones: &[3], parents: &parents }, &Vector3::x(), 1e-3, 10.0);
        assert_eq!((vertex.joints.len(), vertex.shapes.len()), (2, 1));
    }
}
