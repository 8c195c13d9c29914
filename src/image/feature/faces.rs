//! Faces: where they are and how sure the detector is.
//!
//! The detector is the funnel-structured cascade of SeetaFace, as ported by the package `rustface`; this file alone names
//! it. Its frontal model is embedded (`model/`, with its license). It finds frontal faces turned by up to about 30°, and
//! misses profiles and faces below some 25 px of the picture it looks at; boxes by hand are always possible.
//!
//! # Reference
//! S. Wu, M. Kan, Z. He, S. Shan, X. Chen, *Funnel-structured cascade for multi-view face detection with
//! alignment-awareness*, Neurocomputing 221 (2017).

use rustface::{Detector, ImageData, Model};

use crate::{Frame, Plane, analysis_luma};
use plumbline_num::math::{Point2, Rect};
use plumbline_num::run::{Run, Stopped};

/// The frontal model of SeetaFace Detection 1.0.
const MODEL: &[u8] = include_bytes!("model/seeta_fd_frontal_v1.0.bin");

/// A face in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Its box, px of the picture: from the eyebrows to below the mouth, as the detector draws it.
    pub rect: Rect,
    /// How sure: the detector's own score, 8 to about 30 for real faces; infinite for a box drawn by hand.
    pub score: f64,
}

/// What counts as a face, and how closely to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceOptions {
    /// Scores from here on count. Below 8 the boxes on foliage and brickwork outnumber the faces.
    pub min_score: f64,
    /// The longer side of the picture that is searched, px. Twice as much finds faces half as large in four times the time.
    pub max_side: usize,
}

impl Default for FaceOptions {
    fn default() -> Self {
        Self { min_score: 8.0, max_side: 800 }
    }
}

/// The detector with its model read.
pub struct FaceDetector {
    model: Model,
    options: FaceOptions,
}

impl std::fmt::Debug for FaceDetector {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FaceDetector").field("options", &self.options).finish_non_exhaustive()
    }
}

impl FaceDetector {
    /// Reads the embedded model.
    pub fn new(options: FaceOptions) -> Self {
        let model = rustface::read_model(MODEL).expect("the embedded model is the one that the package ships");
        Self { model, options }
    }

    /// The faces of a frame, surest first. A frame whose memory does not hold its planes, or one below 40 px, has none.
    ///
    /// The search itself, a fraction of a second at the default size, cannot be stopped: the package has no way to.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn detect(&self, frame: &Frame, run: &Run) -> Result<Vec<Face>, Stopped> {
        let mut luma = Plane::new(0, 0);
        if frame.width == 0 || frame.height == 0 || !analysis_luma(frame, self.options.max_side, &mut luma) {
            return Ok(Vec::new());
        }
        run.check()?;
        let scale = (frame.width as f64 / luma.width() as f64, frame.height as f64 / luma.height() as f64);
        run.complete(self.detect_luma(&luma, scale))
    }

    fn detect_luma(&self, luma: &Plane<u8>, scale: (f64, f64)) -> Vec<Face> {
        let (w, h) = (luma.width(), luma.height());
        if w.min(h) < MIN_SIDE {
            return Vec::new();
        }
        let packed: Vec<u8> = (0..h).flat_map(|y| luma.as_ref().row(y).iter().copied()).collect();
        let found = self.detector().detect(&ImageData::new(&packed, w as u32, h as u32));
        let mut faces: Vec<Face> = found
            .iter()
            .map(|face| {
                let b = face.bbox();
                let corner = |x: f64, y: f64| Point2::new(x * scale.0, y * scale.1);
                let (x, y) = (f64::from(b.x()), f64::from(b.y()));
                let rect = Rect { min: corner(x, y), max: corner(x + f64::from(b.width()), y + f64::from(b.height())) };
                Face { rect, score: face.score() }
            })
            .filter(|face| face.score >= self.options.min_score)
            .collect();
        let order = |a: &Face, b: &Face| b.score.total_cmp(&a.score).then(a.rect.min.x.total_cmp(&b.rect.min.x));
        faces.sort_by(order);
        faces
    }

    fn detector(&self) -> Box<dyn Detector> {
        let mut detector = rustface::create_detector_with_model(self.model.clone());
        // The package's own filter refuses thresholds of 0 and below; what remains is filtered here.
        detector.set_score_thresh(self.options.min_score.max(0.01));
        detector.set_min_face_size(20);
        detector.set_pyramid_scale_factor(0.8);
        detector.set_slide_window_step(4, 4);
        detector
    }
}

/// The cascade's window is 40 px wide: a smaller picture has no room for it.
const MIN_SIDE: usize = 40;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Layout, PixelFormat};

    #[test]
    fn the_embedded_model_reads_and_finds_no_face_in_a_gradient() {
        let mut frame = Frame::new(PixelFormat::opaque(Layout::Gray, 8), 160, 120);
        for y in 0..120 {
            for (x, v) in frame.plane8_mut(0).expect("own").row_mut(y).iter_mut().enumerate() {
                *v = (x + y / 2) as u8;
            }
        }
        assert_eq!(FaceDetector::new(FaceOptions::default()).detect(&frame, &Run::default()), Ok(Vec::new()));
    }

    #[test]
    fn pictures_too_small_for_the_window_have_no_faces() {
        let detector = FaceDetector::new(FaceOptions::default());
        for (w, h) in [(0, 0), (1, 1), (39, 400), (400, 20)] {
            assert_eq!(
                detector.detect(&Frame::new(PixelFormat::opaque(Layout::Gbr, 8), w, h), &Run::default()),
                Ok(Vec::new()),
                "{w}×{h}"
            );
        }
    }
}
