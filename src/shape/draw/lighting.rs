//! Lights fixed to the camera: a key light from the upper left, a weak fill light from the right, hemispheric ambient light.
//!
//! Directions are in the camera's axes (x right, y down, z forward) and point towards the light; colors are linear.

use nalgebra::Vector3;

type Vec3 = Vector3<f32>;

const KEY: ([f32; 3], [f32; 3]) = ([-0.42, -0.62, -0.66], [0.78, 0.76, 0.72]);
const FILL: ([f32; 3], [f32; 3]) = ([0.80, -0.10, -0.59], [0.15, 0.17, 0.20]);
/// Ambient light of a face that points up, and of one that points down.
const SKY: [f32; 3] = [0.30, 0.32, 0.35];
const GROUND: [f32; 3] = [0.13, 0.12, 0.11];
/// Blinn–Phong specular strength and exponent: a faint, broad highlight that shows curvature and hides no color.
const GLOSS: f32 = 0.10;
const GLOSS_POWER: i32 = 24;
/// Fraction of uniform light on mapped values, so that their colors can be compared with the legend.
const UNIFORM: f32 = 0.45;

/// The lights, prepared for the pixel loops.
pub(super) struct Lights {
    key: (Vec3, Vec3),
    fill: (Vec3, Vec3),
    uniform: f32,
}

impl Lights {
    /// `legible`: the colors show values, so part of the light is uniform.
    pub(super) fn new(legible: bool) -> Self {
        let light = |(direction, color): ([f32; 3], [f32; 3])| (Vec3::from(direction).normalize(), Vec3::from(color));
        Self { key: light(KEY), fill: light(FILL), uniform: if legible { UNIFORM } else { 0.0 } }
    }

    /// Linear color of a point with unit normal `n` towards the viewer, seen along the unit direction `view`.
    pub(super) fn on(&self, color: Vec3, n: &Vec3, view: &Vec3) -> Vec3 {
        let up = 0.5 - 0.5 * n.y;
        let mut light = Vec3::from(GROUND) + (Vec3::from(SKY) - Vec3::from(GROUND)) * up;
        for (direction, strength) in [&self.key, &self.fill] {
            light += strength * n.dot(direction).max(0.0);
        }
        let half = (self.key.0 - view).normalize();
        let gloss = GLOSS * (1.0 - self.uniform) * n.dot(&half).max(0.0).powi(GLOSS_POWER);
        color.component_mul(&(light * (1.0 - self.uniform) + Vec3::repeat(self.uniform))) + self.key.1 * gloss
    }
}
