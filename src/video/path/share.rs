//! How far a wish can be followed: a share of the way to it, frame by frame, that the frame still covers.
//!
//! `a_t = max { s : the view at share s of the way fits }` is found by bisection for all frames at once. The share used,
//!
//! ```text
//! s_t = Σ_k g_k m_{t+k},      m_t = min { a_k : |k − t| ≤ r },      g: Gaussian of reach r, reflected at the ends,
//! ```
//!
//! changes slowly and is nowhere above `a_t`: a mean over `|k| ≤ r` of minima that all count `a_t`.

use std::ops::Range;

use super::chain::spread;
use super::lowpass::half_kernel;

/// Halvings of the bisection: a sixty-fourth of the way is not seen.
const HALVINGS: usize = 6;

/// Standard deviation, s, of the mean over time: a change that takes some seconds is taken for the camera's own.
const SIGMA_S: f64 = 0.8;

/// `a_t`, with `fits` telling for one share per frame where the frames cover what would be shown there.
///
/// # Errors
/// What `fits` says.
pub fn attainable_shares<E>(
    frames: usize,
    mut fits: impl FnMut(&[f64]) -> Result<Vec<bool>, E>,
) -> Result<Vec<f64>, E> {
    let (mut inside, mut outside) = (vec![0.0; frames], vec![1.0; frames]);
    let settle = |inside: &mut [f64], outside: &mut [f64], tried: &[f64], fits: &[bool]| {
        for (t, fits) in fits.iter().enumerate().take(frames) {
            *if *fits { &mut inside[t] } else { &mut outside[t] } = tried[t];
        }
    };
    let whole = vec![1.0; frames];
    settle(&mut inside, &mut outside, &whole, &fits(&whole)?);
    for _ in 0..HALVINGS {
        if inside == outside {
            break;
        }
        let middle: Vec<f64> = inside.iter().zip(&outside).map(|(a, b)| 0.5 * (a + b)).collect();
        settle(&mut inside, &mut outside, &middle, &fits(&middle)?);
    }
    Ok(inside)
}

/// `s_t` for each of the `shots`, whose frames follow each other every `period_s`.
pub fn even_shares(attainable: &[f64], shots: &[Range<usize>], period_s: impl Fn(&Range<usize>) -> f64) -> Vec<f64> {
    let of_shot = |shot: &Range<usize>| {
        let a = &attainable[shot.clone()];
        let sigma = (SIGMA_S / period_s(shot)).max(0.3);
        let reach = half_kernel(sigma).len() - 1;
        let near = |t: usize| t.saturating_sub(reach)..(t + reach + 1).min(a.len());
        let least: Vec<f64> = (0..a.len()).map(|t| a[near(t)].iter().copied().fold(1.0, f64::min)).collect();
        // Where nothing is held back, rounding shall not either.
        spread(&least, sigma).into_iter().map(|s| if s > 1.0 - 1e-9 { 1.0 } else { s.max(0.0) })
    };
    shots.iter().filter(|shot| !shot.is_empty()).flat_map(|shot| of_shot(shot).collect::<Vec<_>>()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_share_that_fits_is_found_from_below() {
        let limits = [1.0, 0.0, 0.37, 0.99, 1.5, -1.0];
        let fits = |s: &[f64]| Ok::<_, ()>(s.iter().zip(&limits).map(|(s, l)| s <= l).collect());
        let found = attainable_shares(6, fits).expect("no fault");
        for (found, limit) in found.iter().zip(limits.map(|l: f64| l.clamp(0.0, 1.0))) {
            assert!(*found <= limit && *found > limit - 1.0 / 60.0, "{found} for {limit}");
        }
        assert_eq!((found[0], found[1]), (1.0, 0.0));
        assert_eq!(attainable_shares(3, |_| Err("torn")), Err("torn"));
    }

    #[test]
    fn shares_change_slowly_and_nowhere_exceed_what_is_attainable() {
        let mut random = fastrand::Rng::with_seed(3);
        let shots = [0..170, 170..172, 172..400];
        let attainable: Vec<f64> =
            (0..400).map(|t| if t % 37 < 2 || t < 3 { random.f64() } else { 1.0 - 0.1 * random.f64() }).collect();
        let shares = even_shares(&attainable, &shots, |_| 1.0 / 30.0);
        assert_eq!(shares.len(), 400);
        for (t, (s, a)) in shares.iter().zip(&attainable).enumerate() {
            assert!((0.0..=a + 1e-12).contains(s), "frame {t}: {s} of {a}");
        }
        for shot in shots {
            assert!(shares[shot].windows(2).all(|s| (s[1] - s[0]).abs() < 0.03), "a jump");
        }
    }

    #[test]
    fn a_moment_that_does_not_fit_is_prepared_for_and_forgotten() {
        let mut attainable = vec![1.0; 600];
        attainable[300] = 0.2;
        let shares = even_shares(&attainable, std::slice::from_ref(&(0..600)), |_| 1.0 / 30.0);
        assert!((shares[300] - 0.2).abs() < 1e-9 && shares[0] == 1.0 && shares[599] == 1.0);
        assert!(
            shares[..=300].windows(2).all(|s| s[1] <= s[0] + 1e-12)
                && shares[300..].windows(2).all(|s| s[1] >= s[0] - 1e-12)
        );
    }
}
