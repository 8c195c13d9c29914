//! Holds a clip steady: `cargo run --release --example stabilize -- shaky.mp4 steady.mp4 [KEEP]`.
//!
//! `KEEP` is the fraction of the picture's width and height that is kept at least, 0.3 to 1; the default is 0.85. Less makes the
//! clip calmer and the picture narrower.

#![allow(clippy::print_stdout, reason = "a program that prints its result")]

use std::env;
use std::error::Error;

use plumbline::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = env::args().skip(1).collect();
    let [input, output, rest @ ..] = args.as_slice() else { return Err("usage: stabilize IN OUT [KEEP]".into()) };
    let keep = rest.first().map_or(Ok(0.85), |text| text.parse())?;
    let run = Run { progress: Progress::new(|done| eprint!("\r{:3.0} %", 100.0 * done)), ..Run::default() };

    // First pass: points are followed through all frames. This costs most of the time and does not depend on KEEP.
    let clip = ClipFile::open(input)?;
    let stabilizer = Stabilizer::new(StabilizerOptions::default().with_keep(keep))?;
    let analysis = stabilizer.analyze(&clip, &run.part(0.0, 0.5))?;

    // Between the passes: the path of the virtual camera. No frame is read.
    let plan = stabilizer.plan(&analysis, &run.silent())?;

    // Second pass: each frame is sampled once through its map. To render into something else than a file, read the frames
    // yourself and ask `plan.maps()` for one map after the other.
    let written = clip.render(&plan, output, &run.part(0.5, 1.0))?;
    eprintln!();

    let shake = plan
        .summary()
        .shake
        .map_or(String::new(), |s| format!(", shake {:.2} px before and {:.2} px after", s.before.px, s.after.px));
    println!("{output}: {} frames{shake}", written.frames);
    Ok(())
}
