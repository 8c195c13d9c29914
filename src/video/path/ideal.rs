//! Virtual paths without the constraint of the frame: Gaussian mean, least-squares polynomial, tripod.

use super::chain::Chain;
use super::lowpass::half_kernel;
use super::pose::{C64, Pose};
use super::regression::polynomial as fitted;
use plumbline_num::math::median;

/// The windows of the Gaussian mean of the path; scale near 1.
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

/// The windows of the least-squares polynomial over time of the path.
///
/// With `A_t = (z_t, d_t)` the motion from the shot's first frame to frame `t`, the camera is at `c_t = A_t⁻¹(0)` of the first
/// frame. With the least-squares polynomials `c̄`, `l̄` of `degree` of `c_t` and `log z_t`, the window is
/// `(z_t e^{−l̄_t}, A_t(c̄_t))`: through it the scene moves as seen from `c̄`, with polynomial log-zoom and rotation.
pub(super) fn polynomial(chain: &Chain, degree: usize) -> Vec<Pose> {
    let from_first = chain.motion_from_first();
    let logs: Vec<C64> = summed(chain.step.iter().map(|s| s.z.ln()));
    let centers: Vec<C64> = from_first.iter().map(|a| a.inverse().d).collect();
    let times: Vec<f64> = chain.rate.iter().scan(0.0, |at, rate| (*at += 1.0 / rate, Some(*at)).1).collect();
    let fits = fitted(&times, &centers, degree).into_iter().zip(fitted(&times, &logs, degree));
    let window =
        |((a, log), (center, mean)): ((&Pose, &C64), (C64, C64))| Pose { z: (log - mean).exp(), d: a.apply(center) };
    from_first.iter().zip(&logs).zip(fits).map(window).collect()
}

/// The windows with the angle at which the roll of the picture is the shot's mean.
pub(super) fn leveled(chain: &Chain, windows: &[Pose]) -> Vec<Pose> {
    let angles: Vec<C64> = summed(chain.step.iter().map(|s| C64::new(s.z.arg(), 0.0)));
    let mean = angles.iter().sum::<C64>() / angles.len() as f64;
    let level =
        |(window, angle): (&Pose, &C64)| Pose { z: C64::from_polar(window.z.norm(), (angle - mean).re), ..*window };
    windows.iter().zip(&angles).map(level).collect()
}

fn summed(steps: impl Iterator<Item = C64>) -> Vec<C64> {
    steps.scan(C64::new(0.0, 0.0), |sum, step| (*sum += step, Some(*sum)).1).collect()
}

/// The windows that follow the content of one reference frame, which then does not move.
///
/// The reference is the frame nearest to the median position, which minimizes the crop.
pub(super) fn tripod(chain: &Chain) -> Vec<Pose> {
    let from_first = chain.motion_from_first();
    let middle = |of: &dyn Fn(&Pose) -> f64| median(&mut from_first.iter().map(of).collect::<Vec<_>>()).unwrap_or(0.0);
    let middle = C64::new(middle(&|p| p.d.re), middle(&|p| p.d.im));
    let far = |p: &Pose| (p.d - middle).norm_sqr();
    let reference = from_first.iter().min_by(|a, b| far(a).total_cmp(&far(b))).copied().unwrap_or(Pose::IDENTITY);
    from_first.iter().map(|p| p.after(reference.inverse())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(step: Pose, n: usize) -> Chain {
        Chain { step: vec![step; n], rate: vec![1.0; n], fps: 30.0 }
    }

    #[test]
    fn the_gaussian_mean_reproduces_constant_pan_rotation_and_zoom() {
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
    fn through_a_linear_path_the_scene_moves_at_constant_velocity_and_through_a_parabola_at_constant_acceleration() {
        let mut random = fastrand::Rng::with_seed(5);
        let mut shaky = chain(Pose::IDENTITY, 120);
        for step in shaky.step.iter_mut().skip(1) {
            let mut noise = |size: f64| size * (random.f64() - 0.5);
            *step = Pose {
                z: C64::from_polar(1.0 + noise(0.01), noise(0.02)),
                d: C64::new(0.01 + noise(0.02), noise(0.02)),
            };
        }
        for degree in [1, 2] {
            let windows = polynomial(&shaky, degree);
            let seen = shaky.seen_through(&windows).motion_from_first();
            // Where the first frame's camera looked, as the viewer sees it move, at one zoom and angle.
            let position = |t: usize| (seen[t].inverse().d, seen[t].z.ln());
            let differences = |k: usize| {
                let at = |i: usize| position(10 * k + 10 * i);
                let [a, b, c, d] = [at(0), at(1), at(2), at(3)];
                let third = (d.0 - c.0 * 3.0 + b.0 * 3.0 - a.0, d.1 - c.1 * 3.0 + b.1 * 3.0 - a.1);
                let second = (c.0 - b.0 * 2.0 + a.0, c.1 - b.1 * 2.0 + a.1);
                if degree == 1 { second } else { third }
            };
            for k in 0..8 {
                let (position, log) = differences(k);
                assert!(position.norm() < 1e-9 && log.norm() < 1e-9, "degree {degree} at {k}: {position} {log}");
            }
        }
    }

    #[test]
    fn constant_and_accelerated_pans_are_reproduced_exactly() {
        let accelerated = |a: f64| {
            let mut chain = chain(Pose::IDENTITY, 90);
            for (t, step) in chain.step.iter_mut().enumerate().skip(1) {
                step.d = C64::new(0.01 + a * t as f64, -0.02);
            }
            chain
        };
        let off = |chain: &Chain, degree: usize| {
            polynomial(chain, degree).iter().map(|p| (p.z - 1.0).norm() + p.d.norm()).fold(0.0, f64::max)
        };
        assert!(off(&accelerated(0.0), 1) < 1e-12 && off(&accelerated(1e-4), 2) < 1e-12);
        assert!(off(&accelerated(1e-4), 1) > 0.01);
        let mut uneven = accelerated(0.0);
        for (t, (step, rate)) in uneven.step.iter_mut().zip(&mut uneven.rate).enumerate().skip(1) {
            *rate = 1.0 + 0.5 * (t as f64).sin();
            step.d /= *rate;
        }
        assert!(off(&uneven, 1) < 1e-12, "even in time, not from frame to frame");
    }

    #[test]
    fn leveled_windows_have_one_angle_and_keep_position_and_size() {
        let mut random = fastrand::Rng::with_seed(6);
        let mut rolling = chain(Pose::IDENTITY, 60);
        rolling.step.iter_mut().skip(1).for_each(|s| s.z = C64::from_polar(1.0, 0.1 * (random.f64() - 0.4)));
        let windows = gaussian(&rolling, 0.3);
        let level = leveled(&rolling, &windows);
        assert!(rolling.seen_through(&level).step.iter().all(|s| s.z.arg().abs() < 1e-12));
        assert!(level.iter().zip(&windows).all(|(a, b)| a.d == b.d && (a.z.norm() - b.z.norm()).abs() < 1e-12));
        let mean = level.iter().map(|p| p.z.arg()).sum::<f64>() / 60.0;
        assert!(mean.abs() < 1e-12, "{mean}");
    }

    #[test]
    fn through_a_tripod_nothing_moves() {
        let chain = chain(Pose { z: C64::from_polar(1.001, 0.002), d: C64::new(0.01, -0.02) }, 50);
        for (t, s) in chain.seen_through(&tripod(&chain)).step.iter().enumerate() {
            assert!((s.z - 1.0).norm() < 1e-12 && s.d.norm() < 1e-12, "step {t}: {s:?}");
        }
    }
}
