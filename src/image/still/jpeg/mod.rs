//! JPEG: its markers read before decoding, and encoding in bands on all threads.
//!
//! A restart marker lets a decoder begin anew: prediction starts from zero and the bits at a byte. Bands of whole rows of
//! blocks, each coded as if it were a picture of its own with the same tables, therefore join to one picture by restart
//! markers between them and one interval in the header (ITU-T T.81, E.1.4 and F.1.1.5.1). The header is that of an encoder for a
//! picture of one pixel; its tables are read back for the coefficients (`blocks.rs`) and their bits (`scan.rs`).

mod blocks;
mod header;
mod inks;
mod multi_picture;
mod scan;
mod segments;

use std::io::Write;
use std::ops::Range;

use jpeg_encoder::{ColorType, Encoder, EncodingError, SamplingFactor};
use rayon::prelude::*;

pub(super) use inks::read_rgb;
pub(super) use multi_picture::{EncodedMap, gain_map, joined};
use segments::segment;
pub(super) use segments::{Found, MAX_EXIF, MAX_IPTC, MAX_XMP, Written, exif_and_profile, found};

use super::save::check_side;
use super::{StillError, StillFormat};
use crate::{Frame, Layout, PlaneRef};
use blocks::Rows;
use header::{Huffman, Quantization, Tables};
use scan::Bits;

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

/// Writes an 8-bit frame without alpha.
pub(super) fn encode(
    frame: &Frame,
    quality: u8,
    metadata: &Written<'_>,
    mut out: impl Write,
) -> Result<(), StillError> {
    check_side(frame, StillFormat::Jpeg, 65_500)?;
    let planes: Vec<PlaneRef<'_, u8>> =
        (0..frame.format.planes()).map(|i| frame.plane8(i)).collect::<Option<_>>().ok_or(StillError::Layout)?;
    let halved = frame.format.layout == Layout::Gbr && quality < FULL_CHROMA;
    let header = header_of_pixel(planes.len() > 1, quality, metadata).map_err(|e| StillError::Encode(e.to_string()))?;
    let odd = || StillError::Encode("the encoder wrote no tables".to_owned());
    let coders = Coder::all(&Tables::of(&header), planes.len()).ok_or_else(odd)?;
    let block = if halved { 16 } else { 8 };
    let (across, down) = (frame.width.div_ceil(block), frame.height.div_ceil(block));
    let rows = down.div_ceil(BANDS).clamp(1, (MAX_INTERVAL / across).max(1));
    let firsts: Vec<usize> = (0..down).step_by(rows).collect();
    let band =
        |first: usize| Band { planes: &planes, coders: &coders, blocks: first..(first + rows).min(down), halved };
    let bands: Vec<Vec<u8>> = firsts.into_par_iter().map(|first| band(first).coded()).collect();
    let size = (frame.width as u16, frame.height as u16);
    join(&header, size, &bands, (rows * across) as u16, &mut out)
}

/// A file of one pixel: what a header of any size has but the size.
fn header_of_pixel(color: bool, quality: u8, metadata: &Written<'_>) -> Result<Vec<u8>, EncodingError> {
    let mut out = Vec::new();
    let mut encoder = Encoder::new(&mut out, quality);
    let full = quality >= FULL_CHROMA || !color;
    encoder.set_sampling_factor(if full { SamplingFactor::F_1_1 } else { SamplingFactor::F_2_2 });
    metadata.add_to(&mut encoder)?;
    if color {
        encoder.encode(&[0; 3], 1, 1, ColorType::Rgb)?;
    } else {
        encoder.encode(&[0], 1, 1, ColorType::Luma)?;
    }
    Ok(out)
}

/// Writes the header with the size of the picture, and the bands as one scan.
fn join(
    header: &[u8],
    (width, height): (u16, u16),
    bands: &[Vec<u8>],
    interval: u16,
    out: &mut impl Write,
) -> Result<(), StillError> {
    let odd = || StillError::Encode("the encoder wrote no scan".to_owned());
    let mut write = |bytes: &[u8]| out.write_all(bytes).map_err(StillError::Write);
    let (frame, scan) = landmarks(header).ok_or_else(odd)?;
    // Height and width are behind the precision in the frame header.
    write(&header[..=frame])?;
    write(&height.to_be_bytes())?;
    write(&width.to_be_bytes())?;
    write(&header[frame + 5..scan])?;
    if bands.len() > 1 {
        let [high, low] = interval.to_be_bytes();
        write(&[0xff, 0xdd, 0, 4, high, low])?;
    }
    write(&header[scan..segment(header, scan).ok_or_else(odd)?.end])?;
    for (i, band) in bands.iter().enumerate() {
        if i > 0 {
            write(&[0xff, 0xd0 + ((i - 1) % 8) as u8])?;
        }
        write(band)?;
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

/// The tables of a channel.
struct Coder {
    quantization: Quantization,
    means: Huffman,
    rest: Huffman,
}

impl Coder {
    /// Those of luma, and where there are three channels of each color difference.
    fn all(tables: &Tables, channels: usize) -> Option<Vec<Self>> {
        let of = |kind: usize| {
            let (quantization, means) = (tables.quantization[kind].clone()?, tables.means[kind].clone()?);
            Some(Self { quantization, means, rest: tables.rest[kind].clone()? })
        };
        (0..channels).map(|channel| of(channel.min(1))).collect()
    }
}

/// Rows of blocks of a picture.
struct Band<'p> {
    planes: &'p [PlaneRef<'p, u8>],
    coders: &'p [Coder],
    blocks: Range<usize>,
    /// Color differences have half the resolution.
    halved: bool,
}

impl Band<'_> {
    /// Its bits, as those of a scan of its own.
    fn coded(&self) -> Vec<u8> {
        let (width, height) = (self.planes[0].width(), self.planes[0].height());
        let side = if self.halved { 16 } else { 8 };
        let across = width.div_ceil(side);
        let mut rows = Rows::new(across * side, side, self.planes.len());
        let mut bits = Bits::with_capacity(width * side * self.blocks.len() / 4);
        let (mut before, mut channels) = ([0; 3], [const { Vec::new() }; 4]);
        for block in self.blocks.clone() {
            for k in 0..side {
                rows.take(self.planes, (block * side + k).min(height - 1), k);
            }
            if self.halved {
                rows.halve_color(8);
            }
            // Luma of sixteen rows in two halves, and the color differences; or one row of blocks of each channel.
            let parts: &[(usize, usize, usize)] = if self.halved {
                &[(0, 0, 16), (0, 8, 16), (1, 0, 8), (2, 0, 8)]
            } else {
                &[(0, 0, 8), (1, 0, 8), (2, 0, 8)]
            };
            let parts = &parts[..if self.planes.len() == 1 { 1 } else { parts.len() }];
            for ((channel, first, wide), blocks) in parts.iter().zip(&mut channels) {
                rows.blocks(*channel, (*first, across * wide), &self.coders[*channel].quantization, blocks);
            }
            for x in 0..across {
                for ((channel, _, wide), blocks) in parts.iter().zip(&channels) {
                    let Coder { means, rest, .. } = &self.coders[*channel];
                    for block in &blocks[x * wide / 8..][..wide / 8] {
                        before[*channel] = bits.block(block, before[*channel], &means.codes, &rest.codes);
                    }
                }
            }
        }
        bits.finish()
    }
}
