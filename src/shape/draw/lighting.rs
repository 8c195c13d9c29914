//! Light that travels with the camera: a key light from the upper left, a weak fill from the right, a sky above a ground.
//!
//! Directions are in the camera's axes (x right, y down, z forward) and point towards the light; colors are linear.

use nalgebra::Vector3;

type Vec3 = Vector3<f32>;

const KEY: ([f32; 3], [f32; 3]) = ([-0.42, -0.62, -0.66], [0.78, 0.76, 0.72]);
const FILL: ([f32; 3], [f32; 3]) = ([0.80, -0.10, -0.59], [0.15, 0.17, 0.20]);
/// Light of a face that looks up, and of one that looks down.
const SKY: [f32; 3] = [0.30, 0.32, 0.35];
const GROUND: [f32; 3] = [0.13, 0.12, 0.11];
/// How much of the key light a polished spot throws back, and how small the spot is.
const GLOSS: f32 = 0.10;
const GLOSS_POWER: i32 = 24;
/// Colors that mean numbers are lit less unevenly, so that they can be compared with the legend: share of the even light.
const EVEN: f32 = 0.45;

/// The lights, ready for the pixel loops.
pub(super) struct Lights {
    key: (Vec3, Vec3),
    fill: (Vec3, Vec3),
    even: f32,
}

impl Lights {
    /// `legible`: the colors of the surface mean something.
    pub(super) fn new(legible: bool) -> Self {
        let light = |(direction, color): ([f32; 3], [f32; 3])| (Vec3::from(direction).normalize(), Vec3::from(color));
        Self { key: light(KEY), fill: light(FILL), even: if legible { EVEN } else { 0.0 } }
    }

    /// Linear color of a place with unit normal `n` towards the viewer, seen along the unit direction `view`.
    pub(super) fn on(&self, color: Vec3, n: &Vec3, view: &Vec3) -> Vec3 {
        let up = 0.5 - 0.5 * n.y;
        let mut light = Vec3::from(GROUND) + (Vec3::from(SKY) - Vec3::from(GROUND)) * up;
        for (direction, strength) in [&self.key, &self.fill] {
            light += strength * n.dot(direction).max(0.0);
        }
        let half = (self.key.0 - view).normalize();
        let gloss = GLOSS * (1.0 - self.even) * n.dot(&half).max(0.0).powi(GLOSS_POWER);
        color.component_mul(&(light * (1.0 - self.even) + Vec3::repeat(self.even))) + self.key.1 * gloss
    }
}
