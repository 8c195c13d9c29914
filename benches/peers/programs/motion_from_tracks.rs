//! Reads tracks as text and prints the inter-frame motion.
//!
//! Input: a line `width height fps frames`, then per frame a line `F n` and `n` lines `id x y …` (px, pixel centers at
//! integer + 0.5). Output, one line per frame: quality, model, points, inliers, coverage, residual, the nine entries of the
//! homography, then `a b tx ty` of the similarity, then the ids of the points judged background.

use plumbline::num::time::Timestamp;
use plumbline::video::motion::{MotionEstimator, ReadoutEstimator};
use plumbline::video::track::{FrameQuality, FrameTracks, Observation};

#[expect(clippy::unnecessary_wraps, reason = "the programs are called through one type")]
pub(super) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let text = std::io::read_to_string(std::io::stdin()).expect("readable standard input");
    let mut lines = text.lines();
    let header: Vec<f64> = numbers(lines.next().expect("a header line"));
    let mut estimator = MotionEstimator::new(header[0] as u32, header[1] as u32);
    let mut readout = ReadoutEstimator::new(header[1] as u32);
    let mut frame = 0;
    while let Some(line) = lines.next() {
        let count: usize = line.trim_start_matches("F ").parse().expect("F n");
        let observations: Vec<Observation> = (0..count)
            .map(|_| {
                let v = numbers(lines.next().expect("a point line"));
                Observation { id: v[0] as u32, x: v[1] as f32, y: v[2] as f32, background: true }
            })
            .collect();
        let tracks = FrameTracks { pts: Timestamp(frame), observations, quality: FrameQuality::default() };
        let started = std::time::Instant::now();
        let m = estimator.push(&tracks);
        readout.push(&m.similarity, estimator.background_pairs());
        eprintln!("{}", started.elapsed().as_micros());
        let h: Vec<String> = m.homography.matrix().transpose().iter().map(ToString::to_string).collect();
        let s = m.similarity;
        let background: Vec<String> = tracks
            .observations
            .iter()
            .zip(estimator.background())
            .filter(|(_, b)| **b)
            .map(|(p, _)| p.id.to_string())
            .collect();
        println!(
            "{:?} {:?} {} {} {:.3} {:.4} | {} | {} {} {} {} | {}",
            m.quality,
            m.model,
            m.points,
            m.inliers,
            m.coverage,
            m.residual_px,
            h.join(" "),
            s.a,
            s.b,
            s.t.x,
            s.t.y,
            background.join(" ")
        );
        frame += 1;
    }
    eprintln!("readout {:?}", readout.estimate());
    Ok(())
}

fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace().map(|v| v.parse().expect("a number")).collect()
}
