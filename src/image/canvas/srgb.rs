//! Between sRGB and linear light: colors are mixed and lit in linear light, and stored as sRGB.

use std::sync::LazyLock;

use super::Rgb;

/// sRGB byte → linear light in [0, 1].
pub static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|i| linear_from_srgb(i as f32 / 255.0)));

fn linear_from_srgb(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Linear light in [0, 1] → sRGB in [0, 1].
pub fn srgb_from_linear(v: f32) -> f32 {
    if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// Linear light to sRGB bytes, by table.
pub struct Encode {
    table: Vec<u8>,
}

impl Default for Encode {
    fn default() -> Self {
        Self::new()
    }
}

impl Encode {
    const STEPS: usize = 8192;

    /// The table, to half an sRGB step.
    pub fn new() -> Self {
        let byte = |i| (srgb_from_linear(i as f32 / Self::STEPS as f32) * 255.0).round() as u8;
        Self { table: (0..=Self::STEPS).map(byte).collect() }
    }

    /// The bytes of a color in linear light; values outside [0, 1] are clamped.
    pub fn apply(&self, color: nalgebra::Vector3<f32>) -> Rgb {
        let byte = |v: f32| self.table[(v.clamp(0.0, 1.0) * Self::STEPS as f32 + 0.5) as usize];
        [byte(color.x), byte(color.y), byte(color.z)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_and_linear_are_inverse() {
        for i in 0..=255 {
            let v = i as f32 / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(v)) - v).abs() < 1e-5);
        }
    }

    #[test]
    fn every_byte_comes_back_from_linear_light() {
        let encode = Encode::new();
        for byte in 0..=255_u8 {
            let [r, ..] = encode.apply(nalgebra::Vector3::repeat(LINEAR[usize::from(byte)]));
            // The darkest bytes are closer than the table's steps.
            assert!(r.abs_diff(byte) <= u8::from(byte < 16), "{byte} came back as {r}");
        }
    }
}
