//! Makes the straight lines of a wide-angle photo straight: `cargo run --release --example rectify -- IN LENS OUT [LINES]`.
//!
//! `LENS` is a lens file (`media/room-kb-125.lens.json`, or one of the formats that `read_lens` knows), `LINES` a file of marked
//! lines. Without it lines are found in the picture.

#![allow(clippy::print_stdout, reason = "a program that prints its result")]

use std::env;
use std::error::Error;

use plumbline::image::{Plane, analysis_luma};
use plumbline::photo::line_detection::{LineDetectionOptions, detect_lines};
use plumbline::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = env::args().skip(1).collect();
    let [input, lens, output, rest @ ..] = args.as_slice() else {
        return Err("usage: rectify IN LENS OUT [LINES]".into());
    };
    let run = Run::default();
    let photo = Photo::load(input)?;

    // The lens maps directions to pixels; its file says for which picture.
    let lens = read_lens(lens.as_ref(), &ExifFacts::default())?.lens;

    // What was straight in the world: marked by hand, or found on perspective views of the picture.
    let lines: Vec<Line> = if let Some(file) = rest.first() {
        LinesFile::read(file.as_ref(), photo.size())?.in_use().cloned().collect()
    } else {
        let mut luma = Plane::new(0, 0);
        if !analysis_luma(&photo.frame, 0, &mut luma) {
            return Err("the picture's memory is shared".into());
        }
        let levels = Plane::from_fn(luma.width(), luma.height(), |x, y| f32::from(luma.as_ref().row(y)[x]));
        let found = detect_lines(levels.as_ref(), Some(&lens), &LineDetectionOptions::default(), &run)?;
        found.lines.into_iter().map(|detected| detected.line).collect()
    };

    // The warp is solved on a grid over the viewing sphere; no pixel is touched yet.
    let picture =
        RectifyInput { lens: &lens, lines: &lines, soft_lines: &[], found: false, faces: &[], saliency: None };
    let warp = rectify(&picture, &RectifyOptions::default(), &run)?;

    // All pixels are sampled once.
    photo.rendered(&warp.field, warp.size, &run)?.save(output)?;

    let bent = warp.lines.iter().filter(|line| line.is_bent()).count();
    println!("{output}: {} × {} px, {} lines, {bent} of them still bent", warp.size.0, warp.size.1, lines.len());
    Ok(())
}
