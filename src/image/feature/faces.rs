//! Faces: where they are and how sure the detector is.
//!
//! The detector is the full-range network of BlazeFace, run by the package `rten`; this file alone names it. The network is embedded
//! (`model/`, with its license). It looks at a square picture of 192 px, in which faces of some 12 px to most of the side are found, also
//! profiles, tilted heads and faces with glasses. A picture is looked at as a whole, and, where smaller faces count, in squares of half
//! its longer side that overlap by half; a face that is seen in several counts once, where the detector is surest. Faces below a
//! thirtieth of the longer side are missed; boxes by hand are always possible.
//!
//! # Reference
//! V. Bazarevsky, Y. Kartynnik, A. Vakunov, K. Raveendran, M. Grundmann, *BlazeFace: sub-millisecond neural face detection on mobile GPUs*,
//! 2019; the model card *MediaPipe BlazeFace (full range)*, 2021.

use std::sync::Arc;

use rten::{Model, RunOptions, ThreadPool};
use rten_tensor::NdTensor;

use super::lab_picture::SmallRgb;
use crate::Frame;
use plumbline_num::math::{Point2, Rect};
use plumbline_num::run::{Run, Stopped};

/// The network, as ONNX.
const MODEL: &[u8] = include_bytes!("model/blazeface_full_range.onnx");
/// Side of the square that it looks at, px.
const SIDE: usize = 192;
/// Cells along that side, each of which may hold the center of a face.
const CELLS: usize = 48;
/// The longer side of the picture, in squares without overlap. On eleven portraits and groups halves find the faces that thirds find,
/// at .78 and above, in half the time, and nothing else; quarters find a few smaller ones, and take hands and windows for faces at .75 to .84.
const SQUARES: usize = 2;
/// The smallest face that one look finds, as a fraction of its side.
const FOUND_IN_A_SQUARE: f64 = 1.0 / 16.0;
/// Fraction of the smaller of two boxes from which on they are one face.
const SAME: f64 = 0.3;

/// A face in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Its box, px of the picture: from the middle of the forehead to the chin, as the detector draws it.
    pub rect: Rect,
    /// How sure: the detector's probability, .8 and above for most faces; infinite for a box drawn by hand.
    pub score: f64,
}

/// What counts as a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceOptions {
    /// Scores from here on count, 0 to 1. Below .75 come hands and windows, beside a few faces that look away.
    pub min_score: f64,
    /// The smallest face that is looked for, as a fraction of the longer side of the picture. From a sixteenth on one look at the whole
    /// picture does, in place of five to ten; none finds faces below a thirtieth.
    pub min_size: f64,
}

impl Default for FaceOptions {
    fn default() -> Self {
        Self { min_score: 0.75, min_size: 1.0 / 30.0 }
    }
}

/// The detector with its network read.
pub struct FaceDetector {
    model: Model,
    /// Threads of the network: those that the caller has.
    threads: Arc<ThreadPool>,
    options: FaceOptions,
}

impl std::fmt::Debug for FaceDetector {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FaceDetector").field("options", &self.options).finish_non_exhaustive()
    }
}

impl FaceDetector {
    /// Reads the embedded network.
    pub fn new(options: FaceOptions) -> Self {
        let model = Model::load_static_slice(MODEL).expect("the embedded network is the one that the tests read");
        Self { model, threads: Arc::new(ThreadPool::with_num_threads(rayon::current_num_threads())), options }
    }

    /// The faces of a frame, surest first. A frame whose memory does not hold its planes, or one without pixels, has none.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn detect(&self, frame: &Frame, run: &Run) -> Result<Vec<Face>, Stopped> {
        let squares = if self.options.min_size < FOUND_IN_A_SQUARE { SQUARES } else { 1 };
        let Some(picture) = SmallRgb::of_frame(frame, squares * SIDE) else { return Ok(Vec::new()) };
        let (width, height) = (picture.width, picture.height);
        let mut faces = Vec::new();
        for pixels_per_px in (1..=squares).rev() {
            let side = SIDE * pixels_per_px;
            for y in starts(height, side) {
                for x in starts(width, side) {
                    run.check()?;
                    self.look(&picture, (x, y), pixels_per_px, &mut faces);
                }
            }
        }
        let order = |a: &Face, b: &Face| b.score.total_cmp(&a.score).then(a.rect.min.x.total_cmp(&b.rect.min.x));
        faces.sort_by(order);
        let scale = (frame.width as f64 / width as f64, frame.height as f64 / height as f64);
        Ok(once(faces).into_iter().map(|face| in_frame(&face, scale, frame)).collect())
    }

    /// Adds what the network finds in a square of the picture, of which `step` pixels are one of its own.
    fn look(&self, picture: &SmallRgb, corner: (isize, isize), step: usize, faces: &mut Vec<Face>) {
        let square = square(picture, corner, step);
        let [input] = self.model.input_ids() else { return };
        let [boxes, scores] = self.model.output_ids() else { return };
        let options = RunOptions::default().with_thread_pool(Some(self.threads.clone()));
        let answer = self.model.run_n(vec![(*input, square.into())], [*boxes, *scores], Some(options));
        let [boxes, scores] = answer.expect("a network and a picture that fit each other");
        let boxes: NdTensor<f32, 3> = boxes.try_into().expect("sixteen numbers per cell");
        let scores: NdTensor<f32, 3> = scores.try_into().expect("one number per cell");
        for cell in 0..CELLS * CELLS {
            let score = 1.0 / (1.0 + f64::from(-scores[[0, cell, 0]]).exp());
            if score < self.options.min_score {
                continue;
            }
            let [x, y, w, h] = [0, 1, 2, 3].map(|k| f64::from(boxes[[0, cell, k]]));
            let middle = |k: usize| (k as f64 + 0.5) * (SIDE / CELLS) as f64;
            let at = |x: f64, y: f64| Point2::new(corner.0 as f64 + step as f64 * x, corner.1 as f64 + step as f64 * y);
            let (x, y) = (middle(cell % CELLS) + x, middle(cell / CELLS) + y);
            let rect = Rect { min: at(x - 0.5 * w, y - 0.5 * h), max: at(x + 0.5 * w, y + 0.5 * h) };
            faces.push(Face { rect, score });
        }
    }
}

/// Where squares of this side start along a side of the picture: evenly, overlapping by half at least; one in the middle where it covers
/// all.
fn starts(length: usize, side: usize) -> impl Iterator<Item = isize> {
    let (length, side) = (length as isize, side as isize);
    let count =
        if length <= side { 1 } else { 2 * (length - side) / side + 1 + isize::from(2 * (length - side) % side > 0) };
    (0..count).map(move |k| if count == 1 { (length - side) / 2 } else { (length - side) * k / (count - 1) })
}

/// A square of the picture as the network takes it: planes of red, green and blue, from −1 to 1, black outside.
fn square(picture: &SmallRgb, corner: (isize, isize), step: usize) -> NdTensor<f32, 4> {
    let mut square = NdTensor::full([1, 3, SIDE, SIDE], -1.0);
    let area = (step * step) as f32;
    for y in 0..SIDE {
        for x in 0..SIDE {
            let mut sum = [0.0; 3];
            for (i, j) in (0..step * step).map(|k| (k % step, k / step)) {
                let at = (corner.0 + (step * x + i) as isize, corner.1 + (step * y + j) as isize);
                if let Some(rgb) = picture.at(at) {
                    sum.iter_mut().zip(rgb).for_each(|(sum, v)| *sum += v);
                }
            }
            for (c, sum) in sum.into_iter().enumerate() {
                square[[0, c, y, x]] = 2.0 * sum / area - 1.0;
            }
        }
    }
    square
}

/// Of boxes that share much of the smaller one, the surest; they come surest first.
fn once(faces: Vec<Face>) -> Vec<Face> {
    let mut kept: Vec<Face> = Vec::new();
    for face in faces {
        if !kept.iter().any(|other| shared(&face.rect, &other.rect) >= SAME) {
            kept.push(face);
        }
    }
    kept
}

/// The common area of two boxes as a fraction of the smaller one.
fn shared(a: &Rect, b: &Rect) -> f64 {
    let side = |min: [f64; 2], max: [f64; 2]| (max[0].min(max[1]) - min[0].max(min[1])).max(0.0);
    let common = side([a.min.x, b.min.x], [a.max.x, b.max.x]) * side([a.min.y, b.min.y], [a.max.y, b.max.y]);
    let area = |r: &Rect| (r.max.x - r.min.x) * (r.max.y - r.min.y);
    let smaller = area(a).min(area(b));
    if smaller > 0.0 { common / smaller } else { 0.0 }
}

/// In px of the frame, whole ones within it: processors differ in the digits beyond.
fn in_frame(face: &Face, scale: (f64, f64), frame: &Frame) -> Face {
    let within = |v: f64, side: usize| v.round().clamp(0.0, side as f64);
    let at = |p: Point2| Point2::new(within(p.x * scale.0, frame.width), within(p.y * scale.1, frame.height));
    Face { rect: Rect { min: at(face.rect.min), max: at(face.rect.max) }, score: face.score }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Layout, PixelFormat};

    #[test]
    fn the_embedded_network_reads_and_finds_no_face_in_a_gradient() {
        let mut frame = Frame::new(PixelFormat::opaque(Layout::Gray, 8), 160, 120);
        for y in 0..120 {
            for (x, v) in frame.plane8_mut(0).expect("own").row_mut(y).iter_mut().enumerate() {
                *v = (x + y / 2) as u8;
            }
        }
        assert_eq!(FaceDetector::new(FaceOptions::default()).detect(&frame, &Run::default()), Ok(Vec::new()));
    }

    #[test]
    fn pictures_of_any_size_are_looked_at() {
        let detector = FaceDetector::new(FaceOptions::default());
        for (w, h) in [(0, 0), (1, 1), (39, 400), (3000, 2)] {
            let frame = Frame::new(PixelFormat::opaque(Layout::Gbr, 8), w, h);
            assert_eq!(detector.detect(&frame, &Run::default()), Ok(Vec::new()), "{w}×{h}");
        }
    }

    #[test]
    fn squares_cover_a_side_and_overlap_by_half() {
        for (length, side) in [(100, 192), (192, 192), (193, 192), (288, 192), (384, 192), (288, 384), (1000, 192)] {
            let all: Vec<isize> = starts(length, side).collect();
            let (length, side) = (length as isize, side as isize);
            assert!(all[0] <= 0 && all[all.len() - 1] + side >= length, "{length} {side}: {all:?}");
            assert!(all.windows(2).all(|w| 2 * (w[1] - w[0]) <= side + 2), "{length} {side}: {all:?}");
        }
    }

    #[test]
    fn a_face_that_is_seen_twice_counts_once() {
        let face =
            |x: f64, score| Face { rect: Rect { min: Point2::new(x, 0.0), max: Point2::new(x + 10.0, 10.0) }, score };
        let kept = once(vec![face(0.0, 0.95), face(3.0, 0.9), face(8.0, 0.85)]);
        assert_eq!(kept, [face(0.0, 0.95), face(8.0, 0.85)]);
    }
}
