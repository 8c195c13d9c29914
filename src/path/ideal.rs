//! Virtual cameras that ignore the frame's edge: the Gaussian mean of the motion, and no motion.

use super::chain::Chain;
use super::lowpass::half_kernel;
use super::pose::{C64, Pose};

/// Where each frame's window would stand if the camera had moved along the Gaussian mean of its path; scale near 1.
///
/// With `M_{t←k}` the motion from frame `k` to frame `t`, the window is `exp Σₖ gₖ log M_{t←k}` for scale and rotation and
/// `Σₖ gₖ dₖ` for the center. Beyond the shot's ends the velocity is mirrored, so that a steady pan stays that pan.
pub(super) fn gaussian(chain: &Chain, sigma_s: f64) -> Vec<Pose> {
    let kernel = half_kernel(chain.frames(sigma_s).max(0.3));
    let last = chain.len() - 1;
    // Step k leads from frame k−1 to frame k. Beyond the ends the steps repeat in reverse: 2, 1 | 1, 2, …, n−1 | n−1, …
    let before = |t: usize, k: usize| if t + 1 > k { t + 1 - k } else { (k - t).min(last) };
    let after = |t: usize, k: usize| if t + k <= last { t + k } else { (2 * last + 1).saturating_sub(t + k).max(1) };
    (0..=last)
        .map(|t| {
            let (mut log, mut d) = (C64::new(0.0, 0.0), C64::new(0.0, 0.0));
            let (mut from_past, mut from_future) = (Pose::IDENTITY, Pose::IDENTITY);
            for (k, &w) in kernel.iter().enumerate().skip(1) {
                from_past = from_past.after(chain.step[before(t, k)]);
                from_future = from_future.after(chain.step[after(t, k)].inverse());
                log += (from_past.z.ln() + from_future.z.ln()) * w;
                d += (from_past.d + from_future.d) * w;
            }
            Pose { z: log.exp(), d }
        })
        .collect()
}

/// Where the content of one frame of the shot stands in every frame: shown there, it does not move at all.
///
/// The frame chosen is the one nearest to the median position, so that the least is cropped.
pub(super) fn tripod(chain: &Chain) -> Vec<Pose> {
    let from_first: Vec<Pose> = chain
        .step
        .iter()
        .scan(Pose::IDENTITY, |at, s| {
            *at = s.after(*at);
            Some(*at)
        })
        .collect();
    let middle = C64::new(median(from_first.iter().map(|p| p.d.re)), median(from_first.iter().map(|p| p.d.im)));
    let far = |p: &Pose| (p.d - middle).norm_sqr();
    let reference = from_first.iter().min_by(|a, b| far(a).total_cmp(&far(b))).copied().unwrap_or(Pose::IDENTITY);
    from_first.iter().map(|p| p.after(reference.inverse())).collect()
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut v: Vec<f64> = values.collect();
    v.sort_by(f64::total_cmp);
    v.get(v.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(step: Pose, n: usize) -> Chain {
        Chain { step: vec![step; n], rate: vec![1.0; n], fps: 30.0 }
    }

    #[test]
    fn the_gaussian_mean_of_a_steady_pan_or_turn_or_zoom_is_itself() {
        let still = C64::new(0.0, 0.0);
        for step in [
            Pose { z: C64::new(1.0, 0.0), d: C64::new(0.01, -0.02) },
            Pose { z: C64::from_polar(1.0, 0.01), d: still },
            Pose { z: C64::new(1.01, 0.0), d: still },
        ] {
            for (t, p) in gaussian(&chain(step, 80), 0.5).into_iter().enumerate() {
                assert!((p.z - 1.0).norm() < 1e-9 && p.d.norm() < 1e-9, "{step:?}, frame {t}: {p:?}");
            }
        }
    }

    #[test]
    fn a_shot_shorter_than_the_kernel_is_averaged_within_itself() {
        for n in 2..6 {
            assert!(gaussian(&chain(Pose::IDENTITY, n), 5.0).iter().all(|p| *p == Pose::IDENTITY));
        }
    }

    #[test]
    fn through_a_tripod_nothing_moves() {
        let chain = chain(Pose { z: C64::from_polar(1.001, 0.002), d: C64::new(0.01, -0.02) }, 50);
        for (t, s) in chain.seen_through(&tripod(&chain)).step.iter().enumerate() {
            assert!((s.z - 1.0).norm() < 1e-12 && s.d.norm() < 1e-12, "step {t}: {s:?}");
        }
    }
}
