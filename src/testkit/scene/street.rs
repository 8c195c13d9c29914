//! The street: two rows of houses, a clock tower at the end, and things at every depth between them.

use super::geometry::{Material, Polygon, Shapes};
use super::texture::Texture;
use super::{Scene, Vec3, light, paint};

/// Textures, in the order in which [`textures`] paints them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[rustfmt::skip]
pub(super) enum Look {
    RedBrick, PaleBrick, Plaster, Cobbles, Slabs, Wood, Leaves, Roof, WindowA, WindowB, Door, Stripes, Speckled, Cloth,
    Cafe, Books, Flowers, Concert, Bakery, Clock,
}

const WHITE: [f32; 3] = [1.0; 3];
/// Half the distance between the rows of houses, m.
const HALF_WIDTH: f32 = 4.6;
/// Length of the street, m.
const END: f32 = 46.0;

impl Scene {
    /// Builds, paints and lights the street; a second or two of work. The same seed gives the same street.
    pub fn street(seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut shapes = Shapes::default();
        ground(&mut shapes);
        for side in [-1.0, 1.0] {
            let mut z = -9.0;
            while z < END - 2.0 {
                let width = 5.2 + 2.2 * rng.f32();
                house(&mut shapes, &mut rng, side, z, width);
                z += width;
            }
        }
        tower(&mut shapes);
        furniture(&mut shapes, &mut rng);
        light::bake(&mut shapes.polygons);
        Self { polygons: shapes.polygons, textures: textures() }
    }
}

fn look(look: Look, tile_m: f32, tint: [f32; 3]) -> Material {
    Material { texture: look as usize, tile_m: Some(tile_m), tint }
}

fn once(look: Look) -> Material {
    Material { texture: look as usize, tile_m: None, tint: WHITE }
}

fn textures() -> Vec<Texture> {
    const BIG: usize = 1024;
    let sign = |lines: &'static [&'static str], ground: [f32; 3], ink: [f32; 3], ornament| {
        Texture::paint(512, move |u, v| paint::sign(u, v, lines, ground, ink, ornament))
    };
    let (cream, dark) = ([0.93, 0.89, 0.78], [0.16, 0.14, 0.18]);
    vec![
        Texture::paint(BIG, |u, v| paint::bricks(u, v, [0.62, 0.30, 0.23], 11)),
        Texture::paint(BIG, |u, v| paint::bricks(u, v, [0.70, 0.60, 0.47], 12)),
        Texture::paint(BIG, |u, v| paint::plaster(u, v, [0.86, 0.84, 0.80], 13)),
        Texture::paint(BIG, |u, v| paint::cobbles(u, v, 14)),
        Texture::paint(BIG, |u, v| paint::slabs(u, v, 15)),
        Texture::paint(512, |u, v| paint::wood(u, v, [0.56, 0.40, 0.26], 16)),
        Texture::paint(512, |u, v| paint::leaves(u, v, 17)),
        Texture::paint(512, |u, v| paint::roof(u, v, 18)),
        Texture::paint(512, |u, v| paint::window(u, v, [0.92, 0.91, 0.87], 19)),
        Texture::paint(512, |u, v| paint::window(u, v, [0.30, 0.42, 0.36], 20)),
        Texture::paint(512, |u, v| paint::door(u, v, [0.22, 0.36, 0.42], 21)),
        Texture::paint(256, |u, v| paint::stripes(u, v, [0.72, 0.20, 0.18])),
        Texture::paint(256, |u, v| paint::speckled(u, v, [0.34, 0.33, 0.34], 22)),
        Texture::paint(256, |u, v| paint::cloth(u, v, [0.78, 0.24, 0.18], [0.98, 0.86, 0.62])),
        sign(&["CAFE", "PLUMB"], [0.16, 0.30, 0.27], cream, false),
        sign(&["BOOKS", "OLD+NEW"], [0.42, 0.16, 0.20], cream, false),
        sign(&["FLOWERS"], cream, [0.20, 0.42, 0.24], true),
        sign(&["STEADY", "HANDS", "LIVE 8PM"], [0.95, 0.72, 0.24], dark, true),
        sign(&["BAKERY", "SINCE 1809"], [0.22, 0.27, 0.42], cream, false),
        Texture::paint(512, clock),
    ]
}

/// A clock's face at ten past ten.
fn clock(u: f32, v: f32) -> [f32; 3] {
    let (x, y) = (u - 0.5, v - 0.5);
    let (r, angle) = (x.hypot(y), x.atan2(-y));
    let hand = |turn: f32, length: f32, half: f32| {
        let (sin, cos) = (turn * std::f32::consts::TAU).sin_cos();
        let (along, off) = (x * sin - y * cos, x * cos + y * sin);
        along > -0.04 && along < length && off.abs() < half
    };
    let hour = (angle / std::f32::consts::TAU * 12.0).rem_euclid(1.0);
    let tick = r > 0.36 && r < 0.43 && !(0.06..=0.94).contains(&hour);
    if r > 0.47 || tick || hand(2.0 / 12.0, 0.34, 0.012) || hand(10.0 / 12.0 + 0.014, 0.24, 0.02) {
        return [0.15, 0.13, 0.12];
    }
    [0.95, 0.93, 0.86]
}

/// A horizontal rectangle that faces up.
fn slab(shapes: &mut Shapes, [x0, x1]: [f32; 2], [z0, z1]: [f32; 2], y: f32, material: Material) {
    let corners = [(x0, z0), (x1, z0), (x1, z1), (x0, z1)].map(|(x, z)| Vec3::new(x, y, z));
    shapes.polygons.push(Polygon::new(corners.to_vec(), -Vec3::y(), material));
}

/// Roadway, pavements and kerbs, in pieces so that the light map keeps its spacing.
fn ground(shapes: &mut Shapes) {
    let edge = HALF_WIDTH + 0.6;
    for k in 0..4 {
        let z = [-10.0 + 16.0 * k as f32, 6.0 + 16.0 * k as f32];
        slab(shapes, [-2.7, 2.7], z, 0.0, look(Look::Cobbles, 2.4, [1.15; 3]));
        for (x, pavement, inwards) in [(-2.7, [-edge, -2.7], Vec3::x()), (2.7, [2.7, edge], -Vec3::x())] {
            slab(shapes, pavement, z, -0.13, look(Look::Slabs, 2.0, WHITE));
            let middle = Vec3::new(x, -0.065, f32::midpoint(z[0], z[1]));
            shapes.panel(middle, inwards, [16.0, 0.13], look(Look::Slabs, 2.0, [0.8; 3]));
        }
    }
    slab(shapes, [-60.0, 60.0], [END + 8.0, 140.0], 0.02, look(Look::Leaves, 9.0, [0.8, 0.9, 0.6]));
}

/// One house: a wall with rows of windows, a ground floor with door, shop or window, and a roof.
fn house(shapes: &mut Shapes, rng: &mut fastrand::Rng, side: f32, z: f32, width: f32) {
    let (floors, set_back) = (1 + rng.usize(0..3), 0.35 * rng.f32());
    let height = 3.3 + 2.7 * floors as f32;
    let tints = [[1.0, 0.94, 0.82], [0.98, 0.82, 0.62], [0.82, 0.90, 0.96], [0.92, 0.72, 0.62], [0.86, 0.95, 0.80]];
    let wall = match rng.usize(0..4) {
        0 => look(Look::RedBrick, 2.1, WHITE),
        1 => look(Look::PaleBrick, 2.1, WHITE),
        _ => look(Look::Plaster, 3.5, tints[rng.usize(0..tints.len())]),
    };
    let (front, facing) = (side * (HALF_WIDTH + set_back), Vec3::new(-side, 0.0, 0.0));
    let depth = 6.0;
    let foot = Vec3::new(front + side * depth / 2.0, 0.0, z + width / 2.0);
    shapes.cuboid(foot, [depth, height, width], 0.0, wall);
    let on_wall = |y: f32, along: f32, out: f32| Vec3::new(front - side * out, y, z + along);
    gable(shapes, on_wall(-height, 0.0, 0.35), [side * (depth + 0.7), width], rng.bool());
    let columns = if width > 6.3 { 3 } else { 2 };
    let windows = if rng.bool() { Look::WindowA } else { Look::WindowB };
    for (floor, column) in (1..=floors).flat_map(|f| (0..columns).map(move |c| (f, c))) {
        let along = width * (column as f32 + 0.5) / columns as f32;
        let y = -(3.3 + 2.7 * (floor as f32 - 1.0) + 1.45);
        opening(shapes, on_wall(y, along, 0.0), facing, [1.15, 1.6], once(windows));
    }
    let shop = rng.usize(0..7);
    opening(shapes, on_wall(-1.2, 0.95, 0.0), facing, [1.05, 2.14], once(Look::Door));
    opening(shapes, on_wall(-1.55, width - 1.8, 0.0), facing, [2.2, 1.7], once(windows));
    let signs = [Look::Cafe, Look::Books, Look::Bakery];
    if let Some(name) = signs.get(shop) {
        shapes.panel(on_wall(-2.95, width - 1.8, 0.06), facing, [2.5, 0.62], once(*name));
        awning(shapes, on_wall(-2.55, width - 1.8, 0.0), side, 2.6);
    } else {
        let poster = if shop.is_multiple_of(2) { Look::Concert } else { Look::Flowers };
        shapes.panel(on_wall(-1.75, width * 0.5 - 0.35, 0.03), facing, [0.8, 1.15], once(poster));
    }
    // A sign that hangs over the pavement, legible from both ends of the street.
    if rng.usize(0..3) > 0 {
        let name = [Look::Cafe, Look::Books, Look::Flowers, Look::Bakery][rng.usize(0..4)];
        let center = on_wall(-3.3, 0.35, 0.65);
        for facing in [Vec3::z(), -Vec3::z()] {
            shapes.panel(center + facing * 0.03, facing, [0.95, 0.75], once(name));
        }
        shapes.prism(
            [on_wall(-3.75, 0.35, 0.0), on_wall(-3.75, 0.35, 1.2)],
            [0.025; 2],
            5,
            look(Look::Speckled, 1.0, [0.4; 3]),
        );
    }
}

/// A window or door with a frame that stands out and a sill.
fn opening(shapes: &mut Shapes, center: Vec3, facing: Vec3, [width, height]: [f32; 2], material: Material) {
    shapes.panel(center + facing * 0.05, facing, [width, height], material);
    let stone = look(Look::Slabs, 1.6, [1.12; 3]);
    let thick = |w: f32, d: f32| if facing.x.abs() > 0.5 { [d, w] } else { [w, d] };
    for (y, extra) in [(height / 2.0 + 0.11, 0.30), (-height / 2.0, 0.16)] {
        let [w, d] = thick(width + extra, 0.28);
        shapes.cuboid(center + Vec3::new(0.0, y, 0.0), [w, 0.11, d], 0.0, stone);
    }
    for edge in [-1.0, 1.0] {
        let [w, d] = thick(0.09, 0.2);
        let along = Vec3::y().cross(&facing) * (edge * (width / 2.0 + 0.045));
        shapes.cuboid(center + along + Vec3::new(0.0, height / 2.0, 0.0), [w, height, d], 0.0, stone);
    }
}

/// A roof over a rectangle from `corner`, `depth` along x and `width` along z, its ridge along the street or across it.
fn gable(shapes: &mut Shapes, corner: Vec3, [depth, width]: [f32; 2], across: bool) {
    let (tiles, rise) = (look(Look::Roof, 2.4, WHITE), 1.9);
    let at = |a: f32, b: f32, up: f32| corner + Vec3::new(depth * a, -rise * up, width * b);
    let (low, ridge) = if across {
        (
            [[at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0)], [at(0.0, 1.0, 0.0), at(1.0, 1.0, 0.0)]],
            [at(0.0, 0.5, 1.0), at(1.0, 0.5, 1.0)],
        )
    } else {
        (
            [[at(0.0, 0.0, 0.0), at(0.0, 1.0, 0.0)], [at(1.0, 0.0, 0.0), at(1.0, 1.0, 0.0)]],
            [at(0.5, 0.0, 1.0), at(0.5, 1.0, 1.0)],
        )
    };
    for [a, b] in low {
        shapes.polygons.push(Polygon::new(vec![a, b, ridge[1], ridge[0]], -Vec3::y(), tiles));
    }
    for end in 0..2 {
        let outward = ridge[end] - ridge[1 - end];
        let plaster = look(Look::Plaster, 3.5, [0.9, 0.86, 0.8]);
        shapes.polygons.push(Polygon::new(vec![low[0][end], low[1][end], ridge[end]], outward, plaster));
    }
}

/// A striped awning that leans out from a wall.
fn awning(shapes: &mut Shapes, top: Vec3, side: f32, width: f32) {
    let half = Vec3::new(0.0, 0.0, width / 2.0);
    let out = Vec3::new(-side * 1.0, 0.42, 0.0);
    let corners = vec![top - half, top + half, top + half + out, top - half + out];
    for facing in [-Vec3::y(), Vec3::y()] {
        shapes.polygons.push(Polygon::new(corners.clone(), facing, once(Look::Stripes)));
    }
    shapes.panel(top + out + Vec3::new(0.0, 0.09, 0.0), Vec3::new(-side, 0.0, 0.0), [width, 0.18], once(Look::Stripes));
}

/// What closes the street: a town hall with a gate and a clock tower, and hills behind it.
fn tower(shapes: &mut Shapes) {
    let stone = look(Look::PaleBrick, 2.6, [1.05, 1.0, 0.92]);
    let (front, facing) = (END - 0.02, -Vec3::z());
    shapes.cuboid(Vec3::new(0.0, 0.0, END + 4.0), [16.0, 9.0, 8.0], 0.0, stone);
    shapes.cuboid(Vec3::new(0.0, 0.0, END + 1.4), [4.2, 15.5, 3.6], 0.0, stone);
    let base = END - 0.42;
    shapes.panel(Vec3::new(0.0, -12.6, base), facing, [2.9, 2.9], once(Look::Clock));
    opening(shapes, Vec3::new(0.0, -8.4, base), facing, [1.4, 2.4], once(Look::WindowA));
    opening(shapes, Vec3::new(0.0, -1.6, base), facing, [2.2, 3.2], once(Look::Door));
    for x in [-6.2, -3.8, 3.8, 6.2] {
        opening(shapes, Vec3::new(x, -6.2, front), facing, [1.3, 2.0], once(Look::WindowA));
        opening(shapes, Vec3::new(x, -2.2, front), facing, [1.3, 2.0], once(Look::WindowA));
    }
    let peak = Vec3::new(0.0, -20.0, END + 1.4);
    let corner = |x: f32, z: f32| Vec3::new(2.4 * x, -15.5, END + 1.4 + 2.1 * z);
    let ring = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    for k in 0..4 {
        let (a, b) = (ring[k], ring[(k + 1) % 4]);
        let outward = (a + b) / 2.0 - Vec3::new(0.0, -15.5, END + 1.4);
        shapes.polygons.push(Polygon::new(vec![a, b, peak], outward, look(Look::Roof, 2.4, [0.55, 0.62, 0.68])));
    }
    for (x, z, radius) in [(-34.0, 110.0, 34.0), (22.0, 125.0, 40.0), (62.0, 100.0, 30.0)] {
        shapes.ball(Vec3::new(x, 8.0, z), radius, 0.55, 8, look(Look::Leaves, 14.0, [0.75, 0.9, 0.7]));
    }
}

/// Lamps, trees, crates, barrels, planters and benches along both pavements.
fn furniture(shapes: &mut Shapes, rng: &mut fastrand::Rng) {
    let iron = look(Look::Speckled, 1.0, [0.42, 0.46, 0.46]);
    for k in 0..14 {
        let (side, z) = (if k % 2 == 0 { 1.0 } else { -1.0 }, 1.8 + 3.1 * k as f32 + rng.f32());
        let at = |x: f32| Vec3::new(side * x, -0.13, z);
        match k % 7 {
            0 | 5 => tree(shapes, rng, at(3.05)),
            1 | 4 => lamp(shapes, at(2.95), iron),
            2 => crates(shapes, rng, at(2.6)),
            3 => {
                let barrel = look(Look::Wood, 0.9, [1.0, 0.85, 0.7]);
                for (dx, dz) in [(0.0, 0.0), (0.5, 0.35)] {
                    let foot = at(3.0) + Vec3::new(dx, 0.0, dz);
                    shapes.prism([foot, foot + Vec3::new(0.0, -0.42, 0.0)], [0.24, 0.3], 10, barrel);
                    shapes.prism(
                        [foot + Vec3::new(0.0, -0.42, 0.0), foot + Vec3::new(0.0, -0.85, 0.0)],
                        [0.3, 0.24],
                        10,
                        barrel,
                    );
                }
            }
            _ => bench(shapes, at(3.3)),
        }
    }
}

fn tree(shapes: &mut Shapes, rng: &mut fastrand::Rng, foot: Vec3) {
    shapes.cuboid(foot, [0.9, 0.4, 0.9], 0.0, look(Look::Wood, 0.8, [0.8, 0.75, 0.7]));
    let top = foot + Vec3::new(0.1, -2.5, 0.0);
    shapes.prism([foot, top], [0.13, 0.08], 7, look(Look::Wood, 0.5, [0.55, 0.5, 0.45]));
    for _ in 0..5 {
        let off = Vec3::new(rng.f32() - 0.5, -0.8 * rng.f32(), rng.f32() - 0.5) * 1.1;
        shapes.ball(top + off, 0.5 + 0.3 * rng.f32(), 0.85, 5, look(Look::Leaves, 1.3, [1.15, 1.15, 0.95]));
    }
}

fn lamp(shapes: &mut Shapes, foot: Vec3, iron: Material) {
    let up = |y: f32| foot + Vec3::new(0.0, -y, 0.0);
    shapes.prism([foot, up(0.5)], [0.11, 0.07], 8, iron);
    shapes.prism([up(0.5), up(3.2)], [0.05, 0.035], 6, iron);
    shapes.prism([up(3.2), up(3.6)], [0.12, 0.19], 6, look(Look::Plaster, 1.0, [1.25, 1.2, 1.0]));
    shapes.prism([up(3.6), up(3.85)], [0.24, 0.03], 6, iron);
}

fn crates(shapes: &mut Shapes, rng: &mut fastrand::Rng, foot: Vec3) {
    for (x, y, z, size) in [(0.0, 0.0, 0.0, 0.7), (0.1, 0.7, 0.05, 0.55), (0.25, 0.0, 0.8, 0.6)] {
        let away = foot.x.signum();
        let at = foot + Vec3::new(away * (0.3 + x), -y, z);
        shapes.cuboid(at, [size; 3], rng.f32() - 0.5, look(Look::Wood, 0.9, [1.1, 1.0, 0.85]));
    }
}

fn bench(shapes: &mut Shapes, foot: Vec3) {
    let boards = look(Look::Wood, 0.6, [0.9, 0.95, 0.8]);
    let away = foot.x.signum();
    for z in [-0.7, 0.7] {
        shapes.cuboid(foot + Vec3::new(0.0, 0.0, z), [0.4, 0.42, 0.1], 0.0, look(Look::Speckled, 1.0, [0.5; 3]));
    }
    shapes.cuboid(foot + Vec3::new(0.0, -0.42, 0.0), [0.48, 0.06, 1.7], 0.0, boards);
    shapes.cuboid(foot + Vec3::new(away * 0.22, -0.5, 0.0), [0.05, 0.45, 1.7], 0.0, boards);
}
