//! Finds the straight edges of pictures and times it: the program that `tests/oracle/segments.py` holds against OpenCV.
//!
//! `segments_of_image FILE.png...` prints one JSON object per line and picture: `segments`, rows of x₀ y₀ x₁ y₁ width score
//! (px, pixel centers at integer + 0.5), and `seconds_per_megapixel`, the best of three passes on one thread.

use std::io::Write;
use std::time::Instant;

use plumbline::image::Plane;
use plumbline::image::feature::segments;

const PASSES: usize = 3;

pub(super) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = std::io::stdout();
    for path in super::args().skip(1) {
        let gray = image::open(&path)?.into_luma8();
        let (w, h) = (gray.width() as usize, gray.height() as usize);
        let luma = Plane::from_fn(w, h, |x, y| f32::from(gray.as_raw()[y * w + x]));
        let (mut found, mut best) = (Vec::new(), f64::MAX);
        for _ in 0..PASSES {
            let began = Instant::now();
            found = segments(luma.as_ref(), 0.0);
            best = best.min(began.elapsed().as_secs_f64());
        }
        let rows: Vec<_> = found.iter().map(|s| [s.start.x, s.start.y, s.end.x, s.end.y, s.width, s.score]).collect();
        let line = serde_json::json!({ "segments": rows, "seconds_per_megapixel": best / (1e-6 * (w * h) as f64) });
        writeln!(out, "{line}")?;
    }
    Ok(())
}
