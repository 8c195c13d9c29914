//! Color description of a frame, passed through unchanged; codes are those of ITU-T H.273.

/// Range, primaries, transfer, matrix and chroma siting of a frame. 2 is "unspecified" in each H.273 code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorDescription {
    /// `Some(true)`: full range (0 to 255 at 8 bit), `Some(false)`: limited (16 to 235), `None`: unspecified.
    pub full_range: Option<bool>,
    /// H.273 color primaries.
    pub primaries: u8,
    /// H.273 transfer characteristics.
    pub transfer: u8,
    /// H.273 matrix coefficients.
    pub matrix: u8,
    /// Offset of the first chroma sample from the first luma sample, in luma px: `[0, 0.5]` is "left" for 4:2:0,
    /// `[0.5, 0.5]` "center", `[0, 0]` "top-left". Meaningless where chroma is not subsampled.
    pub chroma_offset: [f32; 2],
}

impl Default for ColorDescription {
    fn default() -> Self {
        Self { full_range: None, primaries: 2, transfer: 2, matrix: 2, chroma_offset: [0.0, 0.5] }
    }
}
