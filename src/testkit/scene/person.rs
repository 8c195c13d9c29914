//! Somebody who walks by: a torso, a head, arms and legs that swing, all of flat facets.

use super::Vec3;
use super::geometry::{Material, Polygon, Shapes};
use super::light;
use super::street::Look;

/// Duration of a stride (both feet once), s.
const STRIDE_S: f32 = 1.05;

/// The walker at `t` seconds who passes `start` (x, z in m) at t = 0 with `velocity` (x, z in m/s), in
/// a coat tinted by `coat`.
pub fn passer_by(t: f64, start: [f64; 2], velocity: [f64; 2], coat: [f32; 3]) -> Vec<Polygon> {
    let t32 = t as f32;
    let at = Vec3::new((start[0] + velocity[0] * t) as f32, 0.0, (start[1] + velocity[1] * t) as f32);
    let ahead = Vec3::new(velocity[0] as f32, 0.0, velocity[1] as f32).try_normalize(1e-9).unwrap_or(Vec3::x());
    let phase = t32 / STRIDE_S * std::f32::consts::TAU;
    let mut shapes = Shapes::default();
    body(&mut shapes, at, ahead, phase, coat);
    for polygon in &mut shapes.polygons {
        light::unshadowed(polygon);
    }
    shapes.polygons
}

fn body(shapes: &mut Shapes, at: Vec3, ahead: Vec3, phase: f32, coat: [f32; 3]) {
    let look = |look: Look, tint: [f32; 3]| Material { texture: look as usize, tile_m: Some(0.7), tint };
    let (coat, jeans) = (look(Look::Cloth, coat), look(Look::Speckled, [0.5, 0.7, 1.5]));
    let (skin, hair, shoe) =
        (look(Look::Plaster, [1.1, 0.8, 0.62]), look(Look::Speckled, [0.7, 0.5, 0.35]), look(Look::Speckled, [0.4; 3]));
    let aside = Vec3::y().cross(&ahead);
    // The body rises when one leg is upright, and falls when both are spread.
    let hip = at + Vec3::new(0.0, -0.92 + 0.025 * (2.0 * phase).cos().abs(), 0.0);
    let (chest, neck) =
        (hip + Vec3::new(0.0, -0.5, 0.0) + ahead * 0.03, hip + Vec3::new(0.0, -0.58, 0.0) + ahead * 0.04);
    shapes.prism([hip + Vec3::new(0.0, 0.12, 0.0), chest], [0.19, 0.23], 8, coat);
    shapes.prism([chest, neck], [0.23, 0.09], 8, coat);
    shapes.prism([neck, neck + Vec3::new(0.0, -0.09, 0.0)], [0.06, 0.06], 6, skin);
    let head = neck + Vec3::new(0.0, -0.2, 0.0) + ahead * 0.02;
    shapes.ball(head, 0.125, 1.2, 6, skin);
    shapes.ball(head + Vec3::new(0.0, -0.035, 0.0) - ahead * 0.025, 0.135, 1.1, 6, hair);
    for (side, swing) in [(1.0, phase.sin()), (-1.0, -phase.sin())] {
        let joint = hip + aside * (0.1 * side);
        let knee = joint + Vec3::new(0.0, 0.44, 0.0) + ahead * (0.24 * swing + 0.05);
        // The foot that swings forward is lifted.
        let lift = 0.09 * (phase + if side > 0.0 { 0.0 } else { std::f32::consts::PI }).cos().max(0.0);
        let mut ankle = knee + Vec3::new(0.0, 0.40, 0.0) + ahead * (0.16 * swing - 0.08);
        ankle.y = -0.09 - lift;
        shapes.prism([joint, knee], [0.105, 0.08], 6, jeans);
        shapes.prism([knee, ankle], [0.08, 0.055], 6, jeans);
        shapes.cuboid(
            ankle + ahead * 0.06 + Vec3::new(0.0, 0.09, 0.0),
            [0.11, 0.1, 0.27],
            ahead.x.atan2(ahead.z),
            shoe,
        );
        let sole = ankle + Vec3::new(0.0, 0.088, 0.0) + ahead * 0.06;
        let corner = |a: f32, b: f32| sole + aside * a + ahead * b;
        let corners = vec![corner(-0.05, -0.13), corner(0.05, -0.13), corner(0.05, 0.13), corner(-0.05, 0.13)];
        shapes.polygons.push(Polygon::new(corners, Vec3::y(), shoe));
        let shoulder = chest + aside * (0.25 * side);
        let elbow = shoulder + Vec3::new(0.0, 0.28, 0.0) - ahead * (0.14 * swing);
        let hand = elbow + Vec3::new(0.0, 0.24, 0.0) + ahead * (0.1 - 0.14 * swing);
        shapes.prism([shoulder, elbow], [0.075, 0.06], 6, coat);
        shapes.prism([elbow, hand], [0.06, 0.045], 6, coat);
        shapes.ball(hand, 0.055, 1.0, 4, skin);
    }
}
