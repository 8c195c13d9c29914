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
    let n = chain.len() as isize;
    // Step k leads from frame k−1 to frame k; mirrored: steps −1, −2, … repeat steps 1, 2, … after the (empty) step 0.
    let step = |k: isize| {
        let m = if k < 1 { 1 - k } else { k };
        let m = if m > n - 1 { 2 * (n - 1) - m + 1 } else { m };
        chain.step[m.clamp(1, n - 1) as usize]
    };
    (0..n)
        .map(|t| {
            let (mut log, mut d) = (C64::new(0.0, 0.0), C64::new(0.0, 0.0));
            let (mut from_past, mut from_future) = (Pose::IDENTITY, Pose::IDENTITY);
            for (k, &w) in kernel.iter().enumerate().skip(1) {
                from_past = from_past.after(step(t + 1 - k as isize));
                from_future = from_future.after(step(t + k as isize).inverse());
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
