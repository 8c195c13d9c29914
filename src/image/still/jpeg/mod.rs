//! JPEG: its markers read before decoding, and encoding in bands on all threads.
//!
//! A restart marker lets a decoder begin anew: prediction starts from zero and the bits at a byte. Bands of whole rows of
//! blocks, each coded as if it were a picture of its own with the same tables, therefore join to one picture by restart
//! markers between them and one interval in the header (ITU-T T.81, E.1.4 and F.1.1.5.1).

mod inks;
mod multi_picture;
mod segments;

use std::io::Write;

use jpeg_encoder::{ChromaSubsamplingMethod, Encoder, EncodingError, ImageBuffer, JpegColorType, SamplingFactor};
use rayon::prelude::*;

pub(super) use inks::read_rgb;
pub(super) use multi_picture::{EncodedMap, gain_map, joined};
use segments::segment;
pub(super) use segments::{Found, MAX_EXIF, MAX_IPTC, MAX_XMP, Written, exif_and_profile, found};

use super::bands::Bands;
use super::save::check_side;
use super::{StillError, StillFormat};
use crate::{Layout, PlaneRef};

/// Quality from which chroma is not subsampled.
const FULL_CHROMA: u8 = 90;
/// Bands of a large picture: enough to balance threads, few enough that restart markers cost below a kilobyte.
const BANDS: usize = 24;
/// Longest restart interval, blocks.
const MAX_INTERVAL: usize = 65_535;

/// True for the codes of frame headers.
fn is_frame(code: u8) -> bool {
    matches!(code, 0xc0..=0xcf) && !matches!(code, 0xc4 | 0xc8 | 0xcc)
}

/// What the frame header of a file says.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    /// Width and height, px.
    pub(super) size: (usize, usize),
    /// Its colors are four inks.
    pub(super) inks: bool,
}

/// The head of a JPEG file that can be decoded here.
///
/// # Errors
/// [`StillError::Depth`]; [`StillError::Truncated`] for a file that ends before its picture does.
pub(super) fn check(bytes: &[u8]) -> Result<Head, StillError> {
    let mut at = 2;
    let mut head = None;
    loop {
        let Some(s) = segment(bytes, at) else {
            let cut = at + 4 > bytes.len();
            return Err(if cut {
                StillError::Truncated
            } else {
                StillError::Damaged("no marker where one should be".into())
            });
        };
        if s.end > bytes.len() {
            return Err(StillError::Truncated);
        }
        if is_frame(s.code) {
            head = Some(frame_header(s.code, &bytes[s.start..s.end])?);
        }
        at = s.end;
        if s.code == 0xda {
            break;
        }
    }
    let head = head.ok_or_else(|| StillError::Damaged("no picture in it".to_owned()))?;
    // Coded data escape every 0xff, so that the end of the picture cannot be mistaken.
    let ends = bytes[at..].windows(2).any(|w| w == [0xff, 0xd9]);
    if ends { Ok(head) } else { Err(StillError::Truncated) }
}

fn frame_header(code: u8, header: &[u8]) -> Result<Head, StillError> {
    let [bits, h1, h0, w1, w0, components, ..] = *header else { return Err(StillError::Truncated) };
    let side = |high, low| usize::from(u16::from_be_bytes([high, low]));
    match (code, bits, components) {
        (0xc3 | 0xc5..=0xcf, ..) => {
            Err(StillError::Depth("lossless, hierarchical and arithmetic JPEG files".to_owned()))
        }
        (_, 8, 1 | 3 | 4) => Ok(Head { size: (side(w1, w0), side(h1, h0)), inks: components == 4 }),
        (_, 8, n) => Err(StillError::Damaged(format!("{n} components"))),
        (_, bits, _) => Err(StillError::Depth(format!("JPEG files of {bits} bits per sample"))),
    }
}

/// Writes 8-bit pixels without alpha.
pub(super) fn encode(
    bands: &Bands<'_>,
    quality: u8,
    metadata: &Written<'_>,
    mut out: impl Write,
) -> Result<(), StillError> {
    let (width, height) = bands.size();
    check_side((width, height), StillFormat::Jpeg, 65_500)?;
    let color = bands.format().layout == Layout::Gbr;
    let block = if color && quality < FULL_CHROMA { 16 } else { 8 };
    let (across, down) = (width.div_ceil(block), height.div_ceil(block));
    let rows = down.div_ceil(BANDS).clamp(1, (MAX_INTERVAL / across).max(1));
    let coded = (0..down.div_ceil(rows)).into_par_iter().map(|i| {
        let first = i * rows * block;
        let band = bands.band(first..height.min(first + rows * block))?;
        let frame = band.frame();
        let planes: Option<Vec<_>> = (0..frame.format.planes()).map(|plane| frame.plane8(plane)).collect();
        let planes = planes.ok_or(StillError::Layout)?;
        let none = Written::default();
        let rows = Rows { planes: &planes, first: band.first, height: (height - first).min(rows * block) };
        rows.encode(quality, if i == 0 { metadata } else { &none }).map_err(|e| StillError::Encode(e.to_string()))
    });
    let coded: Vec<Vec<u8>> = coded.collect::<Result<_, _>>()?;
    join(&coded, height as u16, (rows * across) as u16, &mut out)
}

/// Writes the bands as one picture.
fn join(bands: &[Vec<u8>], height: u16, interval: u16, out: &mut impl Write) -> Result<(), StillError> {
    let odd = || StillError::Encode("the encoder wrote no scan".to_owned());
    let mut write = |bytes: &[u8]| out.write_all(bytes).map_err(StillError::Write);
    for (i, band) in bands.iter().enumerate() {
        let (frame, scan) = landmarks(band).ok_or_else(odd)?;
        if i == 0 {
            // Height stands behind the precision in the frame header.
            write(&band[..=frame])?;
            write(&height.to_be_bytes())?;
            write(&band[frame + 3..scan])?;
            if bands.len() > 1 {
                let [high, low] = interval.to_be_bytes();
                write(&[0xff, 0xdd, 0, 4, high, low])?;
            }
            write(&band[scan..band.len() - 2])?;
        } else {
            write(&[0xff, 0xd0 + ((i - 1) % 8) as u8])?;
            let scan = segment(band, scan).ok_or_else(odd)?;
            write(&band[scan.end..band.len() - 2])?;
        }
    }
    write(&[0xff, 0xd9])
}

/// Where the content of the frame header and the scan's marker begin.
fn landmarks(bytes: &[u8]) -> Option<(usize, usize)> {
    let (mut at, mut frame) = (2, None);
    loop {
        let s = segment(bytes, at)?;
        if is_frame(s.code) {
            frame = Some(s.start);
        }
        if s.code == 0xda {
            return frame.map(|f| (f, at));
        }
        at = s.end;
    }
}

/// Rows of a picture, as a picture of its own.
struct Rows<'p> {
    planes: &'p [PlaneRef<'p, u8>],
    first: usize,
    height: usize,
}

impl Rows<'_> {
    fn encode(self, quality: u8, metadata: &Written<'_>) -> Result<Vec<u8>, EncodingError> {
        let mut out = Vec::with_capacity(self.planes[0].width() * self.height / 2);
        let mut encoder = Encoder::new(&mut out, quality);
        let full = quality >= FULL_CHROMA || self.planes.len() == 1;
        encoder.set_sampling_factor(if full { SamplingFactor::F_1_1 } else { SamplingFactor::F_2_2 });
        encoder.set_chroma_subsampling_method(ChromaSubsamplingMethod::Average);
        metadata.add_to(&mut encoder)?;
        encoder.encode_image(self)?;
        Ok(out)
    }
}

/// Gray of a color difference and the rounding of its sums, in 16-bit fixed point.
const CENTER: i32 = (128 << 16) + 32_767;

impl ImageBuffer for Rows<'_> {
    fn get_jpeg_color_type(&self) -> JpegColorType {
        if self.planes.len() == 1 { JpegColorType::Luma } else { JpegColorType::Ycbcr }
    }

    fn width(&self) -> u16 {
        self.planes[0].width() as u16
    }

    fn height(&self) -> u16 {
        self.height as u16
    }

    fn fill_buffers(&self, y: u16, buffers: &mut [Vec<u8>; 4]) {
        let row = |i: usize| self.planes[i].row(self.first + usize::from(y));
        if self.planes.len() == 1 {
            buffers[0].extend_from_slice(row(0));
            return;
        }
        let (g, b, r) = (row(0), row(1), row(2));
        // JFIF's YCbCr = that of BT.601 over the full range, in 16-bit fixed point.
        let mix = |w: [i32; 3], offset: i32| {
            r.iter().zip(g).zip(b).map(move |((&r, &g), &b)| {
                ((w[0] * i32::from(r) + w[1] * i32::from(g) + w[2] * i32::from(b) + offset) >> 16) as u8
            })
        };
        buffers[0].extend(mix([19_595, 38_470, 7_471], 32_768));
        buffers[1].extend(mix([-11_059, -21_709, 32_768], CENTER));
        buffers[2].extend(mix([32_768, -27_439, -5_329], CENTER));
    }
}
