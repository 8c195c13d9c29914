//! Frames for the encoder: pooled memory and pixel format conversion.

use std::sync::Arc;

use super::MediaError;
use super::av::{self, AvError, AvFrame, Pix, PlanarFrame, Scaler, SideData};
use super::encoder_choice::{Choice, Fit};
use super::info::{VideoInfo, describe};
use plumbline_image::{ColorDescription, Frame, FrameBuffer, PixelFormat};

/// Writable frames whose memory is used again: taken on any thread, given back by being dropped or written.
#[derive(Clone)]
pub struct FramePool {
    pool: Arc<av::FramePool>,
    format: PixelFormat,
    size: (usize, usize),
}

impl FramePool {
    /// Frames of the size and format of `video`.
    ///
    /// # Errors
    /// [`MediaError::NoMemory`].
    pub fn new(video: &VideoInfo) -> Result<Self, MediaError> {
        let fail = |e| MediaError::internal("preparing frames", e);
        let (size, format) = ((video.width, video.height), video.format);
        let pix = Pix::from_planar(format).ok_or_else(|| fail(AvError::INVALID))?;
        Ok(Self { pool: Arc::new(av::FramePool::new(pix, size.0, size.1).map_err(fail)?), format, size })
    }

    /// A writable frame; its samples are unspecified.
    ///
    /// # Errors
    /// [`MediaError::NoMemory`].
    pub fn get(&self) -> Result<Frame, MediaError> {
        let planar = self.planar()?;
        Ok(Frame::from_buffer(self.format, self.size.0, self.size.1, Box::new(planar)))
    }

    fn planar(&self) -> Result<PlanarFrame, MediaError> {
        self.pool.get_planar(self.format).map_err(|e| MediaError::internal("a new frame", e))
    }
}

impl std::fmt::Debug for FramePool {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "FramePool {{ {} }}", describe(self.size.0, self.size.1, self.format))
    }
}

/// How frames become pictures for the encoder.
pub(super) struct Surface {
    pool: FramePool,
    pix: Pix,
    fit: Fit,
    /// Pictures of the encoder's format, where it is not the frames' own.
    packed: Option<av::FramePool>,
    scaler: Option<Scaler>,
    color: ColorDescription,
}

impl Surface {
    pub(super) fn new(choice: &Choice, video: &VideoInfo) -> Result<Self, MediaError> {
        let fail = |e| MediaError::internal("preparing the encoder's frames", e);
        let (size, format) = ((video.width, video.height), video.format);
        let own = Pix::from_planar(format).ok_or_else(|| fail(AvError::INVALID))?;
        let pool = FramePool::new(video)?;
        let other = choice.fit != Fit::Same;
        let packed = if other { Some(av::FramePool::new(choice.pix, size.0, size.1).map_err(fail)?) } else { None };
        let (conversion, written) = colors(video, choice.pix);
        let converts = choice.fit == Fit::Converted;
        let scaler = if converts { Some(Scaler::new(own, choice.pix, size, &conversion).map_err(fail)?) } else { None };
        Ok(Self { pool, pix: choice.pix, fit: choice.fit, packed, scaler, color: written })
    }

    pub(super) fn blank(&self) -> Result<Frame, MediaError> {
        self.pool.get()
    }

    pub(super) fn pool(&self) -> FramePool {
        self.pool.clone()
    }

    /// Meaning of the samples that the encoder gets.
    pub(super) fn color(&self) -> ColorDescription {
        self.color
    }

    /// `frame` as the encoder takes it, with its time and its side data.
    pub(super) fn picture(&mut self, mut frame: Frame, pts: i64, duration: i64) -> Result<AvFrame, MediaError> {
        let fail = |e: AvError| MediaError::internal("handing a frame to the encoder", e);
        let side = frame.extra.take();
        let shared = frame.buffer_mut().as_any().downcast_ref::<PlanarFrame>().map(|p| p.frame().share());
        let picture = match shared {
            Some(shared) => shared.map_err(fail)?,
            None => self.copied(&frame)?.frame().share().map_err(fail)?,
        };
        let mut picture = match self.fit {
            Fit::Same => picture,
            _ => self.converted(picture)?,
        };
        if picture.pix() != Some(self.pix) {
            picture.relabel(self.pix).map_err(fail)?;
        }
        if let Some(side) = side.as_deref().and_then(|s| s.downcast_ref::<SideData>())
            && !picture.has_side_data()
        {
            picture.attach(side).map_err(fail)?;
        }
        picture.prepare_for_encoder(pts, duration);
        Ok(picture)
    }

    /// A frame in memory of another layer, row by row.
    fn copied(&self, frame: &Frame) -> Result<PlanarFrame, MediaError> {
        let mut planar = self.pool.planar()?;
        for i in 0..frame.format.planes() {
            let (w, h) = frame.format.plane_size(i, frame.width, frame.height);
            let row = w * frame.format.bytes_per_sample();
            let (from, from_stride) = frame.buffer().plane(i);
            let Some((to, to_stride)) = planar.plane_mut(i) else { continue };
            for y in 0..h {
                to[y * to_stride..][..row].copy_from_slice(&from[y * from_stride..][..row]);
            }
        }
        Ok(planar)
    }

    fn converted(&mut self, picture: AvFrame) -> Result<AvFrame, MediaError> {
        let fail = |e: AvError| MediaError::internal("converting a frame for the encoder", e);
        let Some(pool) = &self.packed else { return Ok(picture) };
        let mut out = pool.get().map_err(fail)?;
        if let Some(scaler) = &mut self.scaler {
            scaler.convert(&picture, &mut out).map_err(fail)?;
        } else {
            let planar = PlanarFrame::new(picture, self.pool.format).map_err(|_| fail(AvError::INVALID))?;
            av::pack(&planar, &mut out).map_err(fail)?;
        }
        Ok(out)
    }
}

/// Color for the conversion, and color as the result is tagged. Between RGB and YUV the matrix is the source's where it has
/// one, else BT.709 for high definition and BT.601 below, as players assume.
fn colors(video: &VideoInfo, to: Pix) -> (ColorDescription, ColorDescription) {
    let (color, from_yuv) = (video.color, video.format.is_yuv());
    let guess = if video.height >= 720 { 1 } else { 6 };
    let matrix = if matches!(color.matrix, 0 | 2) { guess } else { color.matrix };
    match (from_yuv, to.is_rgb()) {
        (true, true) => {
            let conversion = ColorDescription { matrix, ..color };
            (conversion, ColorDescription { matrix: 0, full_range: Some(true), ..color })
        }
        (false, false) if video.format.planes() >= 3 => {
            let converted = ColorDescription { matrix, full_range: Some(false), ..color };
            (converted, converted)
        }
        _ => (color, color),
    }
}
