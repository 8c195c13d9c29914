//! Convex planar polygons with texture and light coordinates, and rays against them.

use super::Vec3;

/// How a polygon is painted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Material {
    /// Index into the textures of the scene.
    pub texture: usize,
    /// Size of the texture on the surface, m; `None`: it covers the polygon's bounding rectangle once.
    pub tile_m: Option<f32>,
    /// Factor on the texture's color.
    pub tint: [f32; 3],
}

/// Color of the light that reaches a surface, on a regular grid over its bounding rectangle.
#[derive(Clone, Debug)]
pub(super) struct LightMap {
    pub cols: usize,
    pub rows: usize,
    /// `rows × cols`, linear.
    pub values: Vec<Vec3>,
}

/// A convex polygon in a plane, seen from the side of its normal only.
#[derive(Clone, Debug)]
pub struct Polygon {
    pub(super) vertices: Vec<Vec3>,
    pub(super) normal: Vec3,
    /// Upper left corner of the bounding rectangle as the viewer sees it.
    pub(super) origin: Vec3,
    /// Unit vectors to the viewer's right and down, and the rectangle's size along them, m.
    pub(super) axes: [Vec3; 2],
    pub(super) size: [f32; 2],
    /// The vertices in the coordinates of the axes, m.
    pub(super) flat: Vec<[f32; 2]>,
    pub(super) material: Material,
    pub(super) light: LightMap,
    center: Vec3,
    radius: f32,
}

impl Polygon {
    /// The polygon through `vertices` (in order, convex, planar), visible from the side that `outward` points to.
    pub(super) fn new(vertices: Vec<Vec3>, outward: Vec3, material: Material) -> Self {
        let cross = (vertices[1] - vertices[0]).cross(&(vertices[2] - vertices[0])).normalize();
        let normal = if cross.dot(&outward) < 0.0 { -cross } else { cross };
        // "Down" on a wall is the world's; on the ground and on ceilings, towards -z.
        let hint = if normal.y.abs() > 0.99 { -Vec3::z() } else { Vec3::y() };
        let down = (hint - normal * normal.dot(&hint)).normalize();
        let right = -down.cross(&normal);
        let along = |axis: &Vec3| {
            let values = vertices.iter().map(|v| v.dot(axis));
            values.fold((f32::MAX, f32::MIN), |(low, high), v| (low.min(v), high.max(v)))
        };
        let ((s0, s1), (t0, t1)) = (along(&right), along(&down));
        let origin = right * s0 + down * t0 + normal * normal.dot(&vertices[0]);
        let flat = vertices.iter().map(|v| [(v - origin).dot(&right), (v - origin).dot(&down)]).collect();
        let center = vertices.iter().sum::<Vec3>() / vertices.len() as f32;
        let radius = vertices.iter().map(|v| (v - center).norm()).fold(0.0, f32::max);
        let light = LightMap { cols: 1, rows: 1, values: vec![Vec3::repeat(1.0)] };
        let (axes, size) = ([right, down], [s1 - s0, t1 - t0]);
        Self { vertices, normal, origin, axes, size, flat, material, light, center, radius }
    }

    /// Distance along the ray `from + d·direction` (unit) to the polygon, if it is hit between `near` and `far` from either side.
    pub(super) fn hit(&self, from: Vec3, direction: Vec3, near: f32, far: f32) -> Option<f32> {
        let to_center = self.center - from;
        let along = to_center.dot(&direction);
        if along + self.radius < near || along - self.radius > far {
            return None;
        }
        if to_center.norm_squared() - along * along > self.radius * self.radius {
            return None;
        }
        let d = (self.origin - from).dot(&self.normal) / direction.dot(&self.normal);
        if !(d > near && d < far) {
            return None;
        }
        let p = from + direction * d - self.origin;
        self.covers(p.dot(&self.axes[0]), p.dot(&self.axes[1])).then_some(d)
    }

    /// Mean of the vertices.
    pub(super) fn center(&self) -> Vec3 {
        self.center
    }

    /// Whether the polygon may reach the plane through `from` with (any-length) normal `across`; no false negatives.
    pub(super) fn may_cross(&self, from: Vec3, across: Vec3) -> bool {
        let d = (self.center - from).dot(&across);
        d * d <= self.radius * self.radius * across.norm_squared()
    }

    /// Whether the point at (`s`, `t`) m along the axes lies inside.
    fn covers(&self, s: f32, t: f32) -> bool {
        let n = self.flat.len();
        let side = |i: usize| {
            let ([s0, t0], [s1, t1]) = (self.flat[i], self.flat[(i + 1) % n]);
            (s1 - s0) * (t - t0) - (t1 - t0) * (s - s0)
        };
        (0..n).all(|i| side(i) >= 0.0) || (0..n).all(|i| side(i) <= 0.0)
    }
}

/// A growing set of polygons.
#[derive(Default)]
pub(super) struct Shapes {
    pub polygons: Vec<Polygon>,
}

impl Shapes {
    /// An upright rectangle centered at `center`, `width × height` m, facing `normal` (horizontal).
    pub(super) fn panel(&mut self, center: Vec3, normal: Vec3, [width, height]: [f32; 2], material: Material) {
        let (right, down) = (-Vec3::y().cross(&normal) * (width / 2.0), Vec3::y() * (height / 2.0));
        let corners = vec![center - right - down, center + right - down, center + right + down, center - right + down];
        self.polygons.push(Polygon::new(corners, normal, material));
    }

    /// A box standing on the point `foot`, turned by `yaw` rad about the vertical; no bottom.
    pub(super) fn cuboid(&mut self, foot: Vec3, [width, height, depth]: [f32; 3], yaw: f32, material: Material) {
        let (sin, cos) = yaw.sin_cos();
        let (x, z) = (Vec3::new(cos, 0.0, -sin) * (width / 2.0), Vec3::new(sin, 0.0, cos) * (depth / 2.0));
        let up = Vec3::new(0.0, -height, 0.0);
        let middle = foot + up / 2.0;
        for (out, length) in [(x, depth), (-x, depth), (z, width), (-z, width)] {
            self.panel(middle + out, out.normalize(), [length, height], material);
        }
        let top = vec![foot + up - x - z, foot + up + x - z, foot + up + x + z, foot + up - x + z];
        self.polygons.push(Polygon::new(top, up, material));
    }

    /// A truncated cone of `sides` flat sides around the segment from `a` to `b`.
    pub(super) fn prism(
        &mut self,
        [a, b]: [Vec3; 2],
        [radius_a, radius_b]: [f32; 2],
        sides: usize,
        material: Material,
    ) {
        let axis = (b - a).normalize();
        let first = axis.cross(&if axis.x.abs() < 0.9 { Vec3::x() } else { Vec3::z() }).normalize();
        let second = axis.cross(&first);
        let spoke = |k: usize| {
            let (sin, cos) = (std::f32::consts::TAU * k as f32 / sides as f32).sin_cos();
            first * cos + second * sin
        };
        for k in 0..sides {
            let (u, v) = (spoke(k), spoke(k + 1));
            let corners = vec![a + u * radius_a, a + v * radius_a, b + v * radius_b, b + u * radius_b];
            self.polygons.push(Polygon::new(corners, u + v, material));
        }
        for (center, radius, out) in [(a, radius_a, -axis), (b, radius_b, axis)] {
            let rim = (0..sides).map(|k| center + spoke(k) * radius).collect();
            self.polygons.push(Polygon::new(rim, out, material));
        }
    }

    /// A ball of `2·sides × sides` facets, squeezed by `flatness` in height.
    pub(super) fn ball(&mut self, center: Vec3, radius: f32, flatness: f32, sides: usize, material: Material) {
        let at = |i: usize, j: usize| {
            let (sin, cos) = (std::f32::consts::PI * j as f32 / sides as f32).sin_cos();
            let (sin_l, cos_l) = (std::f32::consts::PI * i as f32 / sides as f32).sin_cos();
            Vec3::new(sin * cos_l, -cos * flatness, sin * sin_l) * radius
        };
        for j in 0..sides {
            for i in 0..2 * sides {
                let ring = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let outward = ring.iter().sum::<Vec3>();
                let corners = match j {
                    0 => vec![ring[0], ring[2], ring[3]],
                    _ if j + 1 == sides => vec![ring[0], ring[1], ring[2]],
                    _ => ring.to_vec(),
                };
                let corners = corners.into_iter().map(|v| center + v).collect();
                self.polygons.push(Polygon::new(corners, outward, material));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Material = Material { texture: 0, tile_m: None, tint: [1.0; 3] };

    #[test]
    fn text_on_a_panel_reads_from_left_to_right_for_whoever_faces_it() {
        let mut shapes = Shapes::default();
        shapes.panel(Vec3::new(-4.0, -2.0, 5.0), Vec3::x(), [2.0, 1.0], PLAIN);
        let panel = &shapes.polygons[0];
        let right = Vec3::y().cross(&-Vec3::x());
        assert!((panel.axes[0] - right).norm() < 1e-6, "{:?}", panel.axes[0]);
        assert!((panel.axes[1] - Vec3::y()).norm() < 1e-6);
        assert_eq!(panel.size, [2.0, 1.0]);
    }

    #[test]
    fn rays_hit_inside_and_miss_outside() {
        let mut shapes = Shapes::default();
        shapes.panel(Vec3::new(0.0, 0.0, 5.0), -Vec3::z(), [2.0, 1.0], PLAIN);
        let hit = |x: f32, y: f32| shapes.polygons[0].hit(Vec3::new(x, y, 0.0), Vec3::z(), 0.0, 100.0);
        assert_eq!(hit(0.9, 0.4), Some(5.0));
        assert_eq!(hit(1.1, 0.0), None);
        assert_eq!(hit(0.0, 0.6), None);
        assert_eq!(shapes.polygons[0].hit(Vec3::zeros(), -Vec3::z(), 0.0, 100.0), None, "behind");
    }

    #[test]
    fn solids_are_closed_and_face_outwards() {
        let mut shapes = Shapes::default();
        shapes.prism([Vec3::zeros(), Vec3::new(0.3, -2.0, 0.1)], [0.4, 0.2], 6, PLAIN);
        shapes.ball(Vec3::new(5.0, 0.0, 0.0), 1.0, 0.8, 5, PLAIN);
        for (solid, inside) in
            [(&shapes.polygons[..8], Vec3::new(0.15, -1.0, 0.05)), (&shapes.polygons[8..], Vec3::new(5.0, 0.0, 0.0))]
        {
            for p in solid {
                assert!(p.normal.dot(&(p.vertices[0] - inside)) > 0.0);
            }
            for k in 0..50 {
                let (a, b) = (k as f32 * 2.399, (k as f32 / 49.0) * 1.9 - 0.95);
                let ring = (1.0 - b * b).sqrt();
                let direction = Vec3::new(ring * a.cos(), b, ring * a.sin());
                let hits = solid.iter().filter(|p| p.hit(inside, direction, 0.0, 10.0).is_some()).count();
                assert!(hits >= 1, "a ray from inside escapes in direction {direction:?}");
            }
        }
    }
}
