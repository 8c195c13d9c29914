//! Completion of holes in a still picture by patches from the rest of it.
//!
//! Every small patch that touches the hole shall look like some patch that is known. With `N(q)` the known patch nearest to
//! the one at `q`, and `d(q)` its distance,
//!
//! ```text
//! find  N(q) = argmin_p ‖P_q − P_p‖²,      vote  I(x) = Σ_q w_q I(x − q + N(q)) / Σ_q w_q,   x ∈ P_q,
//! ```
//!
//! in turn, from coarse to fine (`search.rs`, `vote.rs`). `w_q` falls with `d(q)` and with the depth of `q` in the hole. This
//! is done on a small copy; in the picture itself the pixels are copied from where the small one found them, and means of
//! copies where neighbors disagree.
//!
//! **Limits.** What is made is what is there: skies, walls, floors and foliage go on, a second half of a face or of a car is not
//! invented, and long lines through a large hole may break. The result does not depend on the number of threads.
//!
//! # References
//! Y. Wexler, E. Shechtman, M. Irani, *Space-time completion of video*, PAMI 29 (2007).
//! C. Barnes, E. Shechtman, A. Finkelstein, D. Goldman, *PatchMatch*, ACM Trans. Graph. (SIGGRAPH) 28 (2009).

mod level;
mod search;
mod vote;

use super::RenderError;
use crate::{Frame, Plane};
use level::Level;
use plumbline_num::run::Run;
use search::Search;

/// Longest side of the working copy, px: bounds the time.
const WORKING_SIDE: usize = 384;
/// Longest side of the coarsest level, px. Smaller, textures become gray and are mistaken for plain walls.
const MIN_SIDE: usize = 100;
/// Iterations of search and vote on the coarsest level, and on the others.
const ITERATIONS: (usize, usize) = (16, 5);

/// Fills the pixels of `frame` where `shown` is below 255; a frame of gray or color planes of full size, alpha left alone.
///
/// Nothing changes where nothing is shown at all.
///
/// # Errors
/// [`RenderError::Plane`] where the frame's memory does not hold its planes; [`RenderError::Interrupted`], and the frame is as it
/// was.
pub fn complete(frame: &mut Frame, shown: &Plane<u8>, run: &Run) -> Result<(), RenderError> {
    let fine = Level::of_frame(frame, shown, WORKING_SIDE)?;
    if fine.known.iter().all(|k| *k) || !fine.known.contains(&true) {
        return Ok(());
    }
    let mut levels = vec![fine];
    while let Some(next) = levels.last().filter(|l| l.width.max(l.height) > MIN_SIDE).and_then(Level::halved) {
        levels.push(next);
    }
    let (mut done, all) = (0, ITERATIONS.0 + ITERATIONS.1 * (levels.len() - 1));
    let mut field: Option<(Vec<u32>, usize, usize)> = None;
    let mut filled: Option<Level> = None;
    while let Some(mut level) = levels.pop() {
        match filled.take() {
            None => level.fill_smoothly(),
            Some(coarse) => level.fill_from(&coarse),
        }
        let mut search = Search::new(&level, field.as_ref());
        let rounds = if field.is_none() { ITERATIONS.0 } else { ITERATIONS.1 };
        for round in 0..rounds {
            run.step((done + round) as f64 / all as f64)?;
            search.improve(&level, run)?;
            vote::vote(&mut level, &search);
        }
        done += rounds;
        field = Some((search.nearest, level.width, level.height));
        filled = Some(level);
    }
    match (filled, field) {
        (Some(level), Some((nearest, ..))) => finish(frame, shown, &level, &nearest, run),
        _ => Ok(()),
    }
}

/// Copies pixels of the picture to where the small copy found them missing. Nothing is written before all are found.
fn finish(frame: &mut Frame, shown: &Plane<u8>, level: &Level, nearest: &[u32], run: &Run) -> Result<(), RenderError> {
    let size = (frame.width, frame.height);
    let scale = (level.width as f64 / size.0 as f64, level.height as f64 / size.1 as f64);
    let narrow = frame.format.bytes_per_sample() == 1;
    let most = ((1_u32 << frame.format.bits) - 1) as f32;
    let unwritable = |plane| RenderError::Plane { plane, role: "destination" };
    let mut found = Vec::with_capacity(level.channels.len());
    for plane in 0..level.channels.len() {
        let source = vote::Copier { shown, level, nearest, scale, channel: plane };
        found.push(if narrow {
            let before = frame.plane8(plane).ok_or_else(|| unwritable(plane))?;
            source.values(|x, y| f32::from(before.row(y)[x]) / 255.0, size, run)?
        } else {
            let before = frame.plane16(plane).ok_or_else(|| unwritable(plane))?;
            source.values(|x, y| f32::from(before.row(y)[x]) / most, size, run)?
        });
    }
    for (plane, values) in found.into_iter().enumerate() {
        let pixels = vote::hole(shown, size).zip(values);
        if narrow {
            let mut out = frame.plane8_mut(plane).ok_or_else(|| unwritable(plane))?;
            pixels.for_each(|((x, y), v)| out.row_mut(y)[x] = (255.0 * v).round().clamp(0.0, 255.0) as u8);
        } else {
            let mut out = frame.plane16_mut(plane).ok_or_else(|| unwritable(plane))?;
            pixels.for_each(|((x, y), v)| out.row_mut(y)[x] = (most * v).round().clamp(0.0, most) as u16);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Layout, PixelFormat};

    /// Upright stripes under a plain sky, and what of it is shown.
    fn scene(shown: impl Fn(usize, usize) -> bool) -> (Frame, Frame, Plane<u8>) {
        let (w, h) = (200, 140);
        let mut whole = Frame::new(PixelFormat::opaque(Layout::Gbr, 8), w, h);
        for plane in 0..3 {
            let mut out = whole.plane8_mut(plane).expect("8 bit");
            for y in 0..h {
                for (x, v) in out.row_mut(y).iter_mut().enumerate() {
                    let stripe = if x % 20 < 10 { 60 } else { 180 };
                    *v = if y < 60 { 150 + 20 * plane as u8 } else { stripe + 10 * plane as u8 };
                }
            }
        }
        let mask = Plane::from_fn(w, h, |x, y| if shown(x, y) { 255 } else { 0 });
        let mut cut = Frame::new(whole.format, w, h);
        for plane in 0..3 {
            for y in 0..h {
                let row = whole.plane8(plane).expect("8 bit").row(y).to_vec();
                let mut out = cut.plane8_mut(plane).expect("8 bit");
                out.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = if shown(x, y) { row[x] } else { 0 });
            }
        }
        (whole, cut, mask)
    }

    /// Mean difference in the hole, gray levels.
    fn off(a: &Frame, b: &Frame, shown: &Plane<u8>) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (y, x) in (0..a.height).flat_map(|y| (0..a.width).map(move |x| (y, x))) {
            if shown.as_ref().row(y)[x] < 255 {
                let [v, w] = [a, b].map(|f| f.plane8(1).expect("8 bit").row(y)[x]);
                sum += f64::from(v.abs_diff(w));
                count += 1.0;
            }
        }
        sum / count
    }

    #[test]
    fn repeating_patterns_continue_into_corners_and_shown_pixels_stay_to_the_bit() {
        let hole = |x: usize, y: usize| x + y > 30 && (199 - x) + (139 - y) > 36;
        let (whole, mut cut, shown) = scene(hole);
        complete(&mut cut, &shown, &Run::default()).expect("planes");
        assert!(off(&whole, &cut, &shown) < 12.0, "{}", off(&whole, &cut, &shown));
        for (y, x) in (0..140).flat_map(|y| (0..200).map(move |x| (y, x))).filter(|&(y, x)| hole(x, y)) {
            assert_eq!(cut.plane8(2).expect("8 bit").row(y)[x], whole.plane8(2).expect("8 bit").row(y)[x]);
        }
    }

    #[test]
    fn a_whole_picture_and_one_that_shows_nothing_stay_as_they_are() {
        for all in [true, false] {
            let (_, mut cut, shown) = scene(|_, _| all);
            let before = cut.plane8(0).expect("8 bit").row(100).to_vec();
            complete(&mut cut, &shown, &Run::default()).expect("planes");
            assert_eq!(cut.plane8(0).expect("8 bit").row(100), before);
        }
    }

    #[test]
    fn filling_is_repeatable() {
        let fill = || {
            let (_, mut cut, shown) = scene(|x, y| x > 25 || y > 30);
            complete(&mut cut, &shown, &Run::default()).expect("planes");
            (0..30).flat_map(|y| cut.plane8(0).expect("8 bit").row(y).to_vec()).collect::<Vec<_>>()
        };
        assert_eq!(fill(), fill());
    }
}
