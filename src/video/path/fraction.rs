//! The fraction per frame, between the current view (0) and a target view (1), at which the frame still covers the output.
//!
//! `a_t = max { s : the view at fraction s fits }` is found by bisection for all frames at once. The fraction used,
//!
//! ```text
//! s_t = Σ_k g_k m_{t+k},      m_t = min { a_k : |k − t| ≤ r },      g: Gaussian of reach r, reflected at the ends,
//! ```
//!
//! changes slowly and is nowhere above `a_t`: a mean over `|k| ≤ r` of minima that all count `a_t`.

use std::ops::Range;

use super::chain::spread;
use super::lowpass::half_kernel;

/// Halvings of the bisection: an error of 1/64 of the correction is not visible, and each halving maps all frames once more.
const HALVINGS: usize = 6;

/// Standard deviation, s, of the mean over time: a transition over some seconds looks like motion of the camera itself.
const SIGMA_S: f64 = 0.8;

/// `a_t`. `fits` takes one fraction per frame and returns which frames cover the view at their fraction.
///
/// # Errors
/// Those of `fits`.
pub fn attainable_fractions<E>(
    frames: usize,
    mut fits: impl FnMut(&[f64]) -> Result<Vec<bool>, E>,
) -> Result<Vec<f64>, E> {
    let (mut inside, mut outside) = (vec![0.0; frames], vec![1.0; frames]);
    let bisect = |inside: &mut [f64], outside: &mut [f64], fraction: &[f64], fits: &[bool]| {
        for (t, fits) in fits.iter().enumerate().take(frames) {
            *if *fits { &mut inside[t] } else { &mut outside[t] } = fraction[t];
        }
    };
    let whole = vec![1.0; frames];
    bisect(&mut inside, &mut outside, &whole, &fits(&whole)?);
    for _ in 0..HALVINGS {
        if inside == outside {
            break;
        }
        let middle: Vec<f64> = inside.iter().zip(&outside).map(|(a, b)| 0.5 * (a + b)).collect();
        bisect(&mut inside, &mut outside, &middle, &fits(&middle)?);
    }
    Ok(inside)
}

/// `s_t` for each of the `shots`, whose frames follow each other every `period_s`.
pub fn smoothed_fractions(
    attainable: &[f64],
    shots: &[Range<usize>],
    period_s: impl Fn(&Range<usize>) -> f64,
) -> Vec<f64> {
    let of_shot = |shot: &Range<usize>| {
        let a = &attainable[shot.clone()];
        let sigma = (SIGMA_S / period_s(shot)).max(0.3);
        let reach = half_kernel(sigma).len() - 1;
        let near = |t: usize| t.saturating_sub(reach)..(t + reach + 1).min(a.len());
        let least: Vec<f64> = (0..a.len()).map(|t| a[near(t)].iter().copied().fold(1.0, f64::min)).collect();
        // A fraction of one must not be lowered by rounding.
        spread(&least, sigma).into_iter().map(|s| if s > 1.0 - 1e-9 { 1.0 } else { s.max(0.0) })
    };
    shots.iter().filter(|shot| !shot.is_empty()).flat_map(|shot| of_shot(shot).collect::<Vec<_>>()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_fraction_that_fits_is_found_from_below() {
        let limits = [1.0, 0.0, 0.37, 0.99, 1.5, -1.0];
        let fits = |s: &[f64]| Ok::<_, ()>(s.iter().zip(&limits).map(|(s, l)| s <= l).collect());
        let found = attainable_fractions(6, fits).expect("no fault");
        for (found, limit) in found.iter().zip(limits.map(|l: f64| l.clamp(0.0, 1.0))) {
            assert!(*found <= limit && *found > limit - 1.0 / 60.0, "{found} for {limit}");
        }
        assert_eq!((found[0], found[1]), (1.0, 0.0));
        assert_eq!(attainable_fractions(3, |_| Err("torn")), Err("torn"));
    }

    #[test]
    fn fractions_change_slowly_and_never_exceed_the_attainable_ones() {
        let mut random = fastrand::Rng::with_seed(3);
        let shots = [0..170, 170..172, 172..400];
        let attainable: Vec<f64> =
            (0..400).map(|t| if t % 37 < 2 || t < 3 { random.f64() } else { 1.0 - 0.1 * random.f64() }).collect();
        let fractions = smoothed_fractions(&attainable, &shots, |_| 1.0 / 30.0);
        assert_eq!(fractions.len(), 400);
        for (t, (s, a)) in fractions.iter().zip(&attainable).enumerate() {
            assert!((0.0..=a + 1e-12).contains(s), "frame {t}: {s} of {a}");
        }
        for shot in shots {
            assert!(fractions[shot].windows(2).all(|s| (s[1] - s[0]).abs() < 0.03), "a jump");
        }
    }

    #[test]
    fn fractions_fall_and_rise_monotonically_around_a_frame_that_does_not_fit() {
        let mut attainable = vec![1.0; 600];
        attainable[300] = 0.2;
        let fractions = smoothed_fractions(&attainable, std::slice::from_ref(&(0..600)), |_| 1.0 / 30.0);
        assert!((fractions[300] - 0.2).abs() < 1e-9 && fractions[0] == 1.0 && fractions[599] == 1.0);
        assert!(
            fractions[..=300].windows(2).all(|s| s[1] <= s[0] + 1e-12)
                && fractions[300..].windows(2).all(|s| s[1] >= s[0] - 1e-12)
        );
    }
}
