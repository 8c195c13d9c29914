//! Light of a clear afternoon, baked per polygon: a sun of finite size with shadows, and the sky, dimmed where
//! surroundings hide it (ambient occlusion).

use rayon::prelude::*;

use super::Vec3;
use super::bvh::Bvh;
use super::geometry::{LightMap, Polygon};

/// Towards the sun; behind the camera's right shoulder, so that one side of the street is lit.
const TO_SUN: [f32; 3] = [0.40, -0.80, -0.46];
const SUN: [f32; 3] = [3.3, 2.75, 2.05];
const SKY: [f32; 3] = [0.50, 0.62, 0.84];
const BOUNCE: [f32; 3] = [0.28, 0.24, 0.19];
/// Spread of the sun's rays: the edge of a shadow 5 m away is 15 cm soft.
const SUN_SPREAD: f32 = 0.03;
const SUN_RAYS: usize = 4;
const SKY_RAYS: usize = 14;
/// Maximum distance of occluders of the sky, m.
const REACH_M: f32 = 3.5;
/// Spacing of the light map, m: finer costs start-up time, coarser loses the shadows of poles.
const SPACING_M: f32 = 0.25;

/// Light on every polygon from sun and sky, shadowed by all of them.
pub(super) fn bake(polygons: &mut [Polygon]) {
    let tree = Bvh::new(polygons);
    let maps: Vec<_> = (0..polygons.len()).into_par_iter().map(|i| light_map(&tree, &polygons[i], i)).collect();
    for (polygon, map) in polygons.iter_mut().zip(maps) {
        polygon.light = map;
    }
}

/// Light without shadows, for moving objects.
pub(super) fn unshadowed(polygon: &mut Polygon) {
    let light = combine(polygon.normal, 0.35, 0.75);
    polygon.light = LightMap { cols: 1, rows: 1, values: vec![light] };
}

fn light_map(tree: &Bvh<'_>, polygon: &Polygon, index: usize) -> LightMap {
    let count = |length: f32| (length / SPACING_M).ceil().clamp(1.0, 300.0) as usize + 1;
    let (cols, rows) = (count(polygon.size[0]), count(polygon.size[1]));
    let value = |i: usize| {
        let step = |k: usize, n: usize| (k as f32 / (n - 1) as f32).clamp(0.004, 0.996);
        let (s, t) = (polygon.size[0] * step(i % cols, cols), polygon.size[1] * step(i / cols, rows));
        let at = polygon.origin + polygon.axes[0] * s + polygon.axes[1] * t + polygon.normal * 0.01;
        let mut rng = fastrand::Rng::with_seed((index as u64) << 32 | i as u64);
        let meets = |direction: Vec3, far: f32, any: bool| tree.nearest(index, at, direction, far, any);
        combine(polygon.normal, sunlit(polygon, meets, &mut rng), open_sky(polygon, meets, &mut rng))
    };
    LightMap { cols, rows, values: (0..cols * rows).map(value).collect() }
}

fn combine(normal: Vec3, sun: f32, sky: f32) -> Vec3 {
    let to_sun = Vec3::from(TO_SUN).normalize();
    let up = 0.5 - 0.5 * normal.y;
    Vec3::from(SUN) * (sun * normal.dot(&to_sun).max(0.0))
        + (Vec3::from(SKY) * (0.35 + 0.65 * up) + Vec3::from(BOUNCE) * (1.0 - up)) * sky
}

/// Visible fraction of the sun's disk; `meets(direction, far, any)` is the distance to the first hit of a ray.
fn sunlit(own: &Polygon, meets: impl Fn(Vec3, f32, bool) -> Option<f32>, rng: &mut fastrand::Rng) -> f32 {
    let to_sun = Vec3::from(TO_SUN).normalize();
    if own.normal.dot(&to_sun) <= 0.0 {
        return 0.0;
    }
    let mut jitter = || (rng.f32() - 0.5) * 2.0 * SUN_SPREAD;
    let rays: Vec<_> = (0..SUN_RAYS).map(|_| (to_sun + Vec3::new(jitter(), jitter(), jitter())).normalize()).collect();
    let free = rays.iter().filter(|d| meets(**d, 60.0, true).is_none()).count();
    free as f32 / SUN_RAYS as f32
}

/// Ambient visibility: the open fraction of the hemisphere over the surface, weighted by the cosine; nearer occluders
/// weigh more.
fn open_sky(own: &Polygon, meets: impl Fn(Vec3, f32, bool) -> Option<f32>, rng: &mut fastrand::Rng) -> f32 {
    let turn = rng.f32();
    let mut open = 0.0;
    for k in 0..SKY_RAYS {
        // A spiral over the hemisphere, turned at random, cosine-weighted.
        let (r2, angle) = ((k as f32 + 0.5) / SKY_RAYS as f32, (k as f32 * 0.618_034 + turn) * std::f32::consts::TAU);
        let (sin, cos) = angle.sin_cos();
        let flat = (own.axes[0] * cos + own.axes[1] * sin) * r2.sqrt();
        let direction = (flat + own.normal * (1.0 - r2).sqrt()).normalize();
        open += meets(direction, REACH_M, false).unwrap_or(REACH_M) / REACH_M;
    }
    open / SKY_RAYS as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::geometry::{Material, Shapes};

    #[test]
    fn a_roof_darkens_the_ground_below_it() {
        let plain = Material { texture: 0, tile_m: None, tint: [1.0; 3] };
        let square = |y: f32, half: f32| {
            [(-half, -half), (half, -half), (half, half), (-half, half)].map(|(x, z)| Vec3::new(x, y, z)).to_vec()
        };
        let mut shapes = Shapes::default();
        shapes.polygons.push(Polygon::new(square(0.0, 4.0), -Vec3::y(), plain));
        shapes.polygons.push(Polygon::new(square(-1.0, 1.0), -Vec3::y(), plain));
        bake(&mut shapes.polygons);
        let ground = &shapes.polygons[0].light;
        let at = |x: f32, z: f32| {
            let s = (Vec3::new(x, 0.0, z) - shapes.polygons[0].origin).dot(&shapes.polygons[0].axes[0]) / 8.0;
            let t = (Vec3::new(x, 0.0, z) - shapes.polygons[0].origin).dot(&shapes.polygons[0].axes[1]) / 8.0;
            let (i, j) =
                ((s * (ground.cols - 1) as f32).round() as usize, (t * (ground.rows - 1) as f32).round() as usize);
            ground.values[j * ground.cols + i].x
        };
        // The shadow of the roof's middle falls away from the sun.
        let shadow = at(-TO_SUN[0] / -TO_SUN[1], -TO_SUN[2] / -TO_SUN[1]);
        assert!(shadow < 0.3 * at(3.5, -3.5), "shadow {shadow}, open {}", at(3.5, -3.5));
    }
}
