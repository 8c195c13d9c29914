//! Scalar kernels.

use super::{Columns, Motion, PackedVertex};

pub(super) fn linear_blend(vertices: &[PackedVertex], maps: &[Columns], out: &mut [[f32; 3]]) {
    for (vertex, x) in vertices.iter().zip(out) {
        *x = blended(vertex, maps);
    }
}

pub(super) fn dual_quaternion(
    vertices: &[PackedVertex],
    scales: Option<&[Columns]>,
    motions: &[Motion],
    out: &mut [[f32; 3]],
) {
    for (vertex, x) in vertices.iter().zip(out) {
        *x = moved(vertex, motions, scales.map_or(vertex.position, |scales| blended(vertex, scales)));
    }
}

/// `Σ wⱼ Mⱼ x`.
fn blended(vertex: &PackedVertex, maps: &[Columns]) -> [f32; 3] {
    let mut sum = [0.0_f32; 16];
    for (w, j) in vertex.weights.iter().zip(vertex.joints) {
        for (s, m) in sum.iter_mut().zip(&maps[j as usize]) {
            *s += w * m;
        }
    }
    let [x, y, z] = vertex.position;
    [0, 1, 2].map(|k| sum[k] * x + sum[4 + k] * y + (sum[8 + k] * z + sum[12 + k]))
}

/// `y + 2 (u × (u × y + a y + f) + a f − e u) / (a² + |u|²)`.
fn moved(vertex: &PackedVertex, motions: &[Motion], y: [f32; 3]) -> [f32; 3] {
    let pivot = &motions[vertex.joints[0] as usize];
    let mut sum = [0.0_f32; 8];
    for (w, j) in vertex.weights.iter().zip(vertex.joints) {
        let q = &motions[j as usize];
        let dot: f32 = (0..4).map(|k| pivot[k] * q[k]).sum();
        let w = if dot < 0.0 { -w } else { *w };
        for (s, c) in sum.iter_mut().zip(q) {
            *s += w * c;
        }
    }
    let [ux, uy, uz, a, fx, fy, fz, e] = sum;
    let (u, f) = ([ux, uy, uz], [fx, fy, fz]);
    let length = ux * ux + uy * uy + uz * uz + a * a;
    let inverse = if length > 0.0 { 2.0 / length } else { 0.0 };
    let s = cross(u, y);
    let s = [0, 1, 2].map(|k| s[k] + a * y[k] + f[k]);
    let n = cross(u, s);
    [0, 1, 2].map(|k| y[k] + inverse * (n[k] + a * f[k] - e * u[k]))
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
