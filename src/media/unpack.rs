//! Decoded pictures become [`Frame`]s: as they are where their planes are laid out so, by moving samples otherwise.

use std::sync::Arc;

use super::MediaError;
use super::av::{AvError, AvFrame, FramePool, Pix, PlanarFrame, Route, Scaler, unpack};
use super::info::describe;
use plumbline_image::{ColorDescription, PixelFormat};

/// Turns pictures of one size and format into planar ones.
pub(super) struct Unpacker {
    pix: Pix,
    size: (usize, usize),
    format: PixelFormat,
    pool: FramePool,
    widen: Option<Scaler>,
}

impl Unpacker {
    /// An unpacker for pictures like `frame`.
    pub(super) fn new(frame: &AvFrame, name: &str) -> Result<Self, MediaError> {
        let unsupported = |format: String| {
            let known = "(planar, packed or palette integer formats are)";
            MediaError::input(name, format!("pixel format {format} is not supported {known}"))
        };
        let pix = frame.pix().ok_or_else(|| unsupported("unknown".into()))?;
        let (format, widened) = match pix.route() {
            Route::Direct(format) | Route::Repack(format) => (format, false),
            Route::Widen(format) => (format, true),
            Route::Refused => return Err(unsupported(pix.name())),
        };
        let target = Pix::from_planar(format).ok_or_else(|| unsupported(pix.name()))?;
        let size = frame.size();
        let fail = |e| MediaError::internal("preparing frames", e);
        let pool = FramePool::new(target, size.0, size.1).map_err(fail)?;
        let color = ColorDescription { full_range: Some(true), ..frame.color() };
        let widen = if widened { Some(Scaler::new(pix, target, size, &color).map_err(fail)?) } else { None };
        Ok(Self { pix, size, format, pool, widen })
    }

    /// Format of the pictures that come out.
    pub(super) fn format(&self) -> PixelFormat {
        self.format
    }

    /// FFmpeg's name of the format that goes in.
    pub(super) fn source_format(&self) -> String {
        self.pix.name()
    }

    /// A fresh picture of the outgoing format.
    pub(super) fn blank(&self) -> Result<PlanarFrame, MediaError> {
        self.pool.get_planar(self.format).map_err(|e| MediaError::internal("preparing frames", e))
    }

    /// Size and format in words where `frame` is not like the first one.
    pub(super) fn differs(&self, frame: &AvFrame) -> Option<(String, String)> {
        if frame.pix() == Some(self.pix) && frame.size() == self.size {
            return None;
        }
        let (w, h) = frame.size();
        let format = frame.pix().map_or_else(|| "unknown".into(), Pix::name);
        let was = format!("{}×{} px {}", self.size.0, self.size.1, self.pix.name());
        Some((was, format!("{w}×{h} px {format}")))
    }

    /// The planar picture; side data stay with the source frame.
    pub(super) fn unpack(&mut self, frame: AvFrame) -> Result<PlanarFrame, MediaError> {
        let fail = |e: AvError| MediaError::internal("unpacking a frame", e);
        let frame = match PlanarFrame::new(frame, self.format) {
            Ok(planar) => return Ok(planar),
            Err(frame) => frame,
        };
        let mut planar = self.blank()?;
        match &mut self.widen {
            Some(scaler) => scaler.convert(&frame, planar.frame_mut()).map_err(fail)?,
            None => unpack(&frame, &mut planar).map_err(fail)?,
        }
        Ok(planar)
    }

    pub(super) fn describe(&self) -> String {
        describe(self.size.0, self.size.1, self.format)
    }
}

/// Side data of a decoded picture in the form in which frames carry them.
pub(super) fn extra(frame: &AvFrame) -> Option<Arc<dyn std::any::Any + Send + Sync>> {
    frame.side_data().map(|side| Arc::new(side) as Arc<dyn std::any::Any + Send + Sync>)
}
