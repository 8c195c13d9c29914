//! What shapes and joints do to vertices, and its product with the coordinates of a pose.
//!
//! A shape is near zero away from its joint. Per vertex what moves it least is left out, until what is left out together could move it
//! by [`LEFT_OUT`] of the diagonal in poses like those learnt from; what a joint that is left out would hold is held by the joint that
//! the vertex follows most, so that rigid motions stay exact. Vertices of the same joints stand side by side, eight at a time, so
//! that a product reads each number once, in order. Numbers are of single precision about the middle of the mesh.

use nalgebra::{Matrix3, Matrix4, Point3, Vector3};
use rayon::prelude::*;

use super::super::surface_of_gradients::SurfaceOfGradients;
use super::{Coordinates, Parts};

/// What may be left out, of the diagonal.
const LEFT_OUT: f64 = 1e-4;
/// Vertices side by side.
const LANES: usize = 8;
/// Rows that a thread takes at once.
const AT_ONCE: usize = 64;

/// A number for each of a row of vertices.
type Lane = [f32; LANES];
/// Three.
type Lanes = [Lane; 3];

/// What one joint does to a row of vertices.
#[derive(Clone, Debug)]
struct Block {
    bone: u32,
    /// Where its shapes end in the list of shapes; they begin where those of the block before end.
    shapes_end: u32,
}

/// The product, row by row.
#[derive(Clone, Debug)]
pub(super) struct Table {
    middle: Point3<f64>,
    /// Vertices in the order of the rows; the last row is filled with the last vertex.
    order: Vec<u32>,
    vertices: usize,
    /// Where the blocks of each row begin, the shapes and the numbers; and the ends.
    rows: Vec<[u32; 3]>,
    blocks: Vec<Block>,
    /// Shapes of the blocks.
    shapes: Vec<u32>,
    /// Of each block `g`, `h`, its weight, then its shapes.
    numbers: Vec<Lane>,
}

/// What one joint does to a vertex: `g`, `h` and its weight.
type Held = (u32, [f32; 7]);
/// What one shape does to a vertex.
type Moved = (u32, [f32; 3]);

/// What moves a vertex.
#[derive(Clone, Debug, Default)]
struct Sparse {
    joints: Vec<Held>,
    shapes: Vec<Moved>,
}

impl Table {
    /// Solves for all shapes and joints.
    pub(super) fn new(surface: &mut SurfaceOfGradients, parts: &Parts) -> Self {
        let rest = surface.rest().to_vec();
        let (low, high) = bounds(&rest);
        let (middle, diagonal) = (nalgebra::center(&low, &high), (high - low).norm());
        let budget = (LEFT_OUT * diagonal) as f32;
        let mut found = solved(surface, parts, &middle, budget);
        let bones: Vec<u32> = parts.sheets.iter().flat_map(|s| std::iter::repeat_n(s.bone, s.shape_count())).collect();
        found.par_iter_mut().for_each(|vertex| vertex.leave_out(&bones, budget, diagonal as f32));
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
        };
        for row in 0..rest.len().div_ceil(LANES) {
            table.push_row(row, &found, &bones);
        }
        table
    }

    /// Appends a row: what moves any of its vertices.
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
            let held: [[f32; 7]; LANES] =
                std::array::from_fn(|l| vertices[l].joints.iter().find(|j| j.0 == bone).map_or([0.0; 7], |j| j.1));
            self.numbers.extend((0..7).map(|k| held.map(|h| h[k])));
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
        // From where the joints are in the mean, so that single precision does far from the origin.
        let from = Point3::from(there.iter().map(|p| p.coords).sum::<Vector3<f64>>() / there.len().max(1) as f64);
        let joints: Vec<JointMotion> = (matrices.iter().zip(&there).zip(&coordinates.turns))
            .map(|((m, there), turn)| JointMotion::new(turn, m, &(there - from)))
            .collect();
        let shapes: Vec<f32> = coordinates.shapes.iter().map(|z| *z as f32).collect();
        let mut rows = vec![[[0.0; LANES]; 3]; self.rows.len() - 1];
        let chunks = rows.par_chunks_mut(AT_ONCE).enumerate();
        chunks.for_each(|(c, rows)| {
            for (r, x) in rows.iter_mut().enumerate() {
                *x = self.row(c * AT_ONCE + r, &joints, &shapes);
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
        let ([first, mut shape, at], [end, ..]) = (self.rows[row], self.rows[row + 1]);
        let mut numbers = self.numbers[at as usize..].iter();
        let mut sum = [[0.0; LANES]; 3];
        for block in &self.blocks[first as usize..end as usize] {
            let mut three =
                || -> [&Lane; 3] { std::array::from_fn(|_| numbers.next().expect("as many as blocks say")) };
            let (mut own, held) = (three().map(|lane| *lane), three());
            let weight = numbers.next().expect("as many as blocks say");
            let joint = &joints[block.bone as usize];
            for k in &self.shapes[shape as usize..block.shapes_end as usize] {
                let z = coordinates[*k as usize];
                for own in &mut own {
                    add(own, z, numbers.next().expect("as many as blocks say"));
                }
            }
            shape = block.shapes_end;
            for (c, sum) in sum.iter_mut().enumerate() {
                for k in 0..3 {
                    add(sum, joint.turn[c][k], &own[k]);
                    add(sum, joint.map[c][k], held[k]);
                }
                add(sum, joint.there[c], weight);
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

/// A joint in a pose, by rows.
struct JointMotion {
    turn: [[f32; 3]; 3],
    map: [[f32; 3]; 3],
    /// Where it takes the middle.
    there: [f32; 3],
}

impl JointMotion {
    fn new(turn: &Matrix3<f64>, matrix: &Matrix4<f64>, there: &Vector3<f64>) -> Self {
        Self {
            turn: std::array::from_fn(|r| std::array::from_fn(|c| turn[(r, c)] as f32)),
            map: std::array::from_fn(|r| std::array::from_fn(|c| matrix[(r, c)] as f32)),
            there: std::array::from_fn(|c| there[c] as f32),
        }
    }
}

impl Sparse {
    /// Leaves out what moves the vertex least, half the budget of shapes and half of joints. Joints that stay are in the order of
    /// their weights.
    fn leave_out(&mut self, bones: &[u32], budget: f32, diagonal: f32) {
        let size = |s: &Moved| Vector3::from(s.1).norm();
        self.shapes.sort_by(|a, b| size(a).total_cmp(&size(b)));
        let mut left = 0.5 * budget;
        let dropped = self.shapes.iter().take_while(|s| spend(&mut left, size(s))).count();
        self.shapes.drain(..dropped);
        // Turns differ by 2 at most, and origins by the diagonal of a surface that holds together.
        let cost = |h: &[f32; 7]| {
            let [a, b, c, d, e, f, w] = *h;
            2.0 * (Vector3::new(a, b, c).norm() + Vector3::new(d, e, f).norm()) + w.abs() * diagonal
        };
        self.joints.sort_by(|a, b| cost(&a.1).total_cmp(&cost(&b.1)));
        let mut left = 0.5 * budget;
        let needed = |bone: u32| self.shapes.iter().any(|s| bones[s.0 as usize] == bone);
        let (mut kept, mut given) = (Vec::new(), [0.0; 7]);
        let last = self.joints.len().saturating_sub(1);
        for (k, (bone, held)) in self.joints.drain(..).enumerate() {
            if k < last && !needed(bone) && spend(&mut left, cost(&held)) {
                given.iter_mut().zip(held).for_each(|(g, h)| *g += h);
            } else {
                kept.push((bone, held));
            }
        }
        kept.sort_by(|a: &Held, b: &Held| b.1[6].total_cmp(&a.1[6]).then(a.0.cmp(&b.0)));
        if let Some((_, held)) = kept.first_mut() {
            held.iter_mut().zip(given).for_each(|(h, g)| *h += g);
        }
        self.joints = kept;
    }
}

/// Whether there is that much left.
fn spend(left: &mut f32, cost: f32) -> bool {
    *left -= cost;
    *left >= 0.0
}

fn bounds(points: &[Point3<f64>]) -> (Point3<f64>, Point3<f64>) {
    let Some(first) = points.first() else { return (Point3::origin(), Point3::origin()) };
    points.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)))
}

/// What moves each vertex, less what is far below the budget.
fn solved(surface: &mut SurfaceOfGradients, parts: &Parts, middle: &Point3<f64>, budget: f32) -> Vec<Sparse> {
    let rest: Vec<Vector3<f64>> = surface.rest().iter().map(|p| p - middle).collect();
    let mut found = vec![Sparse::default(); rest.len()];
    let sheet = |t: usize| &parts.sheets[parts.sheet_of[t] as usize];
    let starts: Vec<usize> = (0..parts.sheet_of.len())
        .scan(0, |at, t| Some(std::mem::replace(at, *at + 1 + sheet(t).shape_count())))
        .collect();
    let map = |at: usize| Matrix3::from_column_slice(&parts.maps[at]).cast::<f64>();
    for bone in 0..parts.parents.len() as u32 {
        let weight = |v: usize| parts.weights.weight(v, bone);
        let own = |t: usize| if sheet(t).bone == bone { map(starts[t]) } else { Matrix3::zeros() };
        let turned = surface.solve(own, |_| Vector3::zeros());
        let held = surface.solve(|_| Matrix3::zeros(), |v| rest[v] * weight(v));
        let weights = surface.solve(|_| Matrix3::zeros(), |v| Vector3::new(weight(v), 0.0, 0.0));
        for (v, vertex) in found.iter_mut().enumerate() {
            let (g, h, w) = (turned[v], held[v], weights[v].x);
            let all = [g.x, g.y, g.z, h.x, h.y, h.z, w].map(|x| x as f32);
            if all.iter().any(|x| *x != 0.0) {
                vertex.joints.push((bone, all));
            }
        }
    }
    // More than as many of this size are never left out.
    let speck = budget / 1024.0;
    let mut number = 0;
    for (s, one) in parts.sheets.iter().enumerate() {
        for k in 0..one.shape_count() {
            let own =
                |t: usize| if parts.sheet_of[t] as usize == s { map(starts[t] + 1 + k) } else { Matrix3::zeros() };
            for (vertex, u) in found.iter_mut().zip(surface.solve(own, |_| Vector3::zeros())) {
                let u: [f32; 3] = u.coords.cast::<f32>().into();
                if Vector3::from(u).norm() > speck {
                    vertex.shapes.push((number, u));
                }
            }
            number += 1;
        }
    }
    found
}
