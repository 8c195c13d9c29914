//! Temporal weights of tracked points.

/// Weight of a point in its `age`-th frame with `remaining` frames to live: a ramp up from its birth times a ramp down to
/// its death, each `ramp` frames long, so that no point starts or stops pulling at a mesh at once.
///
/// `age` counts from 0 at the first frame, `remaining` to 0 at the last; the weight is in (0, 1], and 1 everywhere for
/// `ramp` = 0. Liu et al. (2009) ramp over about 50 frames.
pub fn fade(age: u32, remaining: u32, ramp: u32) -> f64 {
    let rise = |frames: u32| (f64::from(frames) + 1.0).min(f64::from(ramp) + 1.0) / (f64::from(ramp) + 1.0);
    rise(age) * rise(remaining)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_rise_from_birth_fall_to_death_and_never_vanish() {
        let life: Vec<f64> = (0..200).map(|age| fade(age, 199 - age, 50)).collect();
        assert!(life.iter().all(|&w| w > 0.0 && w <= 1.0));
        assert!(life[..51].is_sorted() && life[149..].iter().rev().is_sorted());
        assert!(life[50..150].iter().all(|&w| w == 1.0));
        for w in life.windows(2) {
            assert!((w[1] - w[0]).abs() <= 1.0 / 51.0 + 1e-15, "steps of a ramp: {w:?}");
        }
    }

    #[test]
    fn time_reversal_changes_nothing() {
        for (age, remaining) in [(0, 9), (3, 70), (12, 12)] {
            assert_eq!(fade(age, remaining, 20), fade(remaining, age, 20));
        }
    }

    #[test]
    fn without_a_ramp_every_frame_counts_fully() {
        assert_eq!(fade(0, 0, 0), 1.0);
        assert_eq!(fade(u32::MAX, u32::MAX, u32::MAX), 1.0);
    }
}
