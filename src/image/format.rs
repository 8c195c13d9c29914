//! Planar pixel formats. Packed and semi-planar sources are unpacked without loss before they enter a [`super::Frame`].

/// What the planes of a frame hold, and how they are subsampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Layout {
    /// One plane of luma.
    Gray,
    /// Y, U, V with chroma halved both ways.
    Yuv420,
    /// Y, U, V with chroma halved horizontally.
    Yuv422,
    /// Y, U, V with chroma halved vertically.
    Yuv440,
    /// Y, U, V with chroma quartered horizontally.
    Yuv411,
    /// Y, U, V at full size.
    Yuv444,
    /// Green, blue, red at full size.
    Gbr,
}

/// A planar format: layout, depth, and whether a full-size alpha plane follows the color planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PixelFormat {
    /// Color planes and their subsampling.
    pub layout: Layout,
    /// Bits per sample, 8 to 16; more than 8 are stored as native-endian `u16` in the low bits.
    pub bits: u8,
    /// An alpha plane stands last.
    pub alpha: bool,
}

impl PixelFormat {
    /// An opaque format.
    pub const fn opaque(layout: Layout, bits: u8) -> Self {
        Self { layout, bits, alpha: false }
    }

    /// Number of planes, alpha included.
    pub const fn planes(self) -> usize {
        let color = if matches!(self.layout, Layout::Gray) { 1 } else { 3 };
        color + self.alpha as usize
    }

    /// Bytes of one sample: 1 or 2.
    pub const fn bytes_per_sample(self) -> usize {
        if self.bits > 8 { 2 } else { 1 }
    }

    /// `(log2 horizontal, log2 vertical)` subsampling of plane `i`.
    pub const fn subsampling(self, i: usize) -> (u32, u32) {
        match (self.layout, i) {
            (Layout::Yuv420, 1 | 2) => (1, 1),
            (Layout::Yuv422, 1 | 2) => (1, 0),
            (Layout::Yuv440, 1 | 2) => (0, 1),
            (Layout::Yuv411, 1 | 2) => (2, 0),
            _ => (0, 0),
        }
    }

    /// Width and height of plane `i` of a `width×height` frame, px of that plane; odd sizes round up.
    pub const fn plane_size(self, i: usize, width: usize, height: usize) -> (usize, usize) {
        let (sx, sy) = self.subsampling(i);
        (width.div_ceil(1 << sx), height.div_ceil(1 << sy))
    }

    /// True where chroma planes hold signed color differences around mid-gray.
    pub const fn is_yuv(self) -> bool {
        !matches!(self.layout, Layout::Gray | Layout::Gbr)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_sizes_round_chroma_up() {
        let f = PixelFormat::opaque(Layout::Yuv420, 8);
        assert_eq!(f.plane_size(0, 641, 361), (641, 361));
        assert_eq!(f.plane_size(1, 641, 361), (321, 181));
        assert_eq!(PixelFormat { alpha: true, ..f }.plane_size(3, 641, 361), (641, 361));
    }
}
