//! Finds the faces of pictures: the program that `benches/peers/faces.py` counts with.
//!
//! `faces_of_image MIN_SIZE FILE...` prints one JSON object per picture: `faces`, rows of x y width height score (px; the score a
//! probability), and the `seconds` that it took, all threads at work. `MIN_SIZE` is that of `FaceOptions`.

use std::io::Write;
use std::time::Instant;

use plumbline::image::feature::{Face, FaceDetector, FaceOptions};
use plumbline::image::still::{LoadOptions, load};
use plumbline::num::run::Run;

pub(super) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = super::args().skip(1);
    let min_size = args.next().ok_or("faces_of_image MIN_SIZE FILE...")?.parse()?;
    let detector = FaceDetector::new(FaceOptions { min_size, ..FaceOptions::default() });
    let mut out = std::io::stdout();
    for path in args {
        let photo = load(path.as_ref(), LoadOptions::default())?;
        let began = Instant::now();
        let found = detector.detect(&photo.frame, &Run::default())?;
        let seconds = began.elapsed().as_secs_f64();
        let row = |f: &Face| [f.rect.min.x, f.rect.min.y, f.rect.width(), f.rect.height(), f.score];
        let line = serde_json::json!({ "faces": found.iter().map(row).collect::<Vec<_>>(), "seconds": seconds });
        writeln!(out, "{line}")?;
    }
    Ok(())
}
