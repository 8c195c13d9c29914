//! Sound for the street: soft chords, footsteps and a little wind, so that one hears whether sound passes through.

use std::f32::consts::TAU;

/// Samples per second.
pub const RATE_HZ: u32 = 48_000;

/// Duration of a chord, s.
const CHORD_S: f32 = 3.0;
/// Semitones above A2: a calm progression.
const CHORDS: [[i32; 4]; 4] = [[0, 7, 12, 16], [5, 9, 12, 17], [-3, 4, 9, 12], [-5, 2, 7, 11]];
const STEP_S: f32 = 0.52;

/// `duration_s` seconds of interleaved stereo, 16 bit, [`RATE_HZ`].
pub fn street_sound(duration_s: f64, seed: u64) -> Vec<i16> {
    let count = (duration_s * f64::from(RATE_HZ)) as usize;
    let mut rng = fastrand::Rng::with_seed(seed);
    let (mut wind, mut thump) = (0.0_f32, 0.0_f32);
    let mut samples = Vec::with_capacity(2 * count);
    for i in 0..count {
        let t = i as f32 / RATE_HZ as f32;
        let white = rng.f32() * 2.0 - 1.0;
        wind += (white - wind) * 0.02;
        let breath = 0.10 * wind * (1.0 + 0.6 * (TAU * 0.11 * t).sin());
        let since = t % STEP_S;
        thump += (white - thump) * 0.12;
        let step = thump * 0.55 * (-since * 38.0).exp() + 0.22 * (TAU * 82.0 * since).sin() * (-since * 30.0).exp();
        let left_foot = ((t / STEP_S) as u32).is_multiple_of(2);
        let chord = 0.16 * pad(t);
        let fade = (t / 0.4).min(1.0) * ((duration_s as f32 - t) / 0.8).clamp(0.0, 1.0);
        for near in [left_foot, !left_foot] {
            let value = (chord + breath + step * if near { 1.0 } else { 0.6 }) * fade;
            samples.push((value.clamp(-1.0, 1.0) * 30_000.0) as i16);
        }
    }
    samples
}

/// The chord at `t`, each note of three slightly detuned partials, crossfaded into the next.
fn pad(t: f32) -> f32 {
    let index = (t / CHORD_S) as usize;
    let within = t / CHORD_S - index as f32;
    let fade = ((within - 0.85) / 0.15).clamp(0.0, 1.0);
    let chord = |k: usize| CHORDS[k % CHORDS.len()].iter().map(|n| note(*n, t)).sum::<f32>() / 4.0;
    chord(index) * (1.0 - fade) + chord(index + 1) * fade
}

fn note(semitones: i32, t: f32) -> f32 {
    let f = 110.0 * (semitones as f32 / 12.0).exp2();
    let partial = |factor: f32, level: f32| level * (TAU * (f * factor * t).fract()).sin();
    partial(1.0, 0.6) + partial(2.003, 0.25) + partial(0.997, 0.3) + partial(3.001, 0.08)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sound_has_its_length_does_not_clip_and_ends_quietly() {
        let samples = street_sound(2.0, 1);
        assert_eq!(samples.len(), 2 * 2 * RATE_HZ as usize);
        assert!(samples.iter().all(|s| s.unsigned_abs() < 29_000));
        assert!(samples.iter().any(|s| s.unsigned_abs() > 3_000), "silence");
        assert!(samples[samples.len() - 100..].iter().all(|s| s.unsigned_abs() < 200));
    }
}
