//! TIFF files of floating-point samples, 16, 32 or 64 bit, as 16-bit integers.
//!
//! Numbers keep their encoding: 0 is black, 1 is white, and the color profile, which says what lies between, travels along. A frame
//! holds nothing brighter than white: what is above 1 becomes white, what is below 0 or no number becomes black, and a
//! warning says how many samples that were.

use std::io::{BufRead, Seek};

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};

use super::container::SPARE;
use super::{LoadOptions, StillError};
use crate::{Layout, PixelFormat};

/// Excess over white that is rounding: half a step of 16 bit.
const ROUNDING: f64 = 0.5 / 65_535.0;

/// A file whose head was read.
pub(super) struct Floats<'r> {
    decoder: Box<dyn Decode + 'r>,
    pub(super) size: (usize, usize),
    pub(super) format: PixelFormat,
}

/// Decoding, whatever is read from.
trait Decode {
    /// All samples, and those of a plane where colors are stored apart.
    fn samples(&mut self) -> Result<(DecodingResult, Option<usize>), StillError>;
}

impl<R: BufRead + Seek> Decode for Decoder<R> {
    fn samples(&mut self) -> Result<(DecodingResult, Option<usize>), StillError> {
        let mut samples = DecodingResult::U8(Vec::new());
        let layout = self.read_image_to_buffer(&mut samples).map_err(damaged)?;
        let bytes = samples.as_buffer(0).as_bytes().len();
        if bytes < layout.complete_len {
            return Err(StillError::Damaged("planes of more samples than it has pixels".to_owned()));
        }
        Ok((samples, layout.plane_stride.filter(|_| layout.planes > 1).map(usize::from)))
    }
}

fn damaged(error: tiff::TiffError) -> StillError {
    match error {
        tiff::TiffError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => StillError::Truncated,
        tiff::TiffError::IoError(e) => StillError::Read(e),
        other => StillError::Damaged(other.to_string()),
    }
}

impl<'r> Floats<'r> {
    /// Reads the head of a file.
    pub(super) fn open(reader: impl BufRead + Seek + 'r, options: LoadOptions) -> Result<Self, StillError> {
        let mut decoder = Decoder::new(reader).map_err(damaged)?;
        let (width, height) = decoder.dimensions().map_err(damaged)?;
        options.check(u64::from(width), u64::from(height))?;
        let kind = decoder.colortype().map_err(damaged)?;
        let (layout, alpha, bits) = match kind {
            ColorType::Gray(bits) => (Layout::Gray, false, bits),
            ColorType::GrayA(bits) => (Layout::Gray, true, bits),
            ColorType::RGB(bits) => (Layout::Gbr, false, bits),
            ColorType::RGBA(bits) => (Layout::Gbr, true, bits),
            other => return Err(StillError::Depth(format!("floating-point samples of kind {other:?}"))),
        };
        let size = (width as usize, height as usize);
        let format = PixelFormat { layout, bits: 16, alpha };
        let bytes = size.0 * size.1 * format.planes() * usize::from(bits).div_ceil(8);
        let mut limits = Limits::unlimited();
        limits.decoding_buffer_size = bytes;
        limits.intermediate_buffer_size = bytes + SPARE as usize;
        limits.ifd_value_size = SPARE as usize;
        Ok(Self { decoder: Box::new(decoder.with_limits(limits)), size, format })
    }

    /// Decodes packed samples.
    pub(super) fn read(mut self, packed: &mut [u16], warnings: &mut Vec<String>) -> Result<(), StillError> {
        let (samples, plane) = self.decoder.samples()?;
        let channels = self.format.planes();
        let mut found = Found::default();
        let read = match samples {
            DecodingResult::F16(v) => {
                fill(packed, &v, (channels, plane.map(|p| p / 2)), &mut found, |v| f64::from(f32::from(v)))
            }
            DecodingResult::F32(v) => fill(packed, &v, (channels, plane.map(|p| p / 4)), &mut found, f64::from),
            DecodingResult::F64(v) => fill(packed, &v, (channels, plane.map(|p| p / 8)), &mut found, |v| v),
            _ => return Err(StillError::Depth("samples of two kinds".to_owned())),
        };
        read.ok_or_else(|| StillError::Damaged("fewer samples than its size asks for".to_owned()))?;
        found.report(packed.len(), warnings);
        Ok(())
    }
}

/// Writes samples as integers; `plane` is the number of samples of a plane where colors are stored apart.
fn fill<S: Copy>(
    packed: &mut [u16],
    samples: &[S],
    (channels, plane): (usize, Option<usize>),
    found: &mut Found,
    value: impl Fn(S) -> f64,
) -> Option<()> {
    for (i, to) in packed.iter_mut().enumerate() {
        let at = plane.map_or(i, |plane| i % channels * plane + i / channels);
        *to = found.integer(value(*samples.get(at)?));
    }
    Some(())
}

/// What samples were found that a frame does not hold.
#[derive(Debug, Default)]
struct Found {
    above: usize,
    below: usize,
    undefined: usize,
    max: f64,
}

impl Found {
    fn integer(&mut self, value: f64) -> u16 {
        if value.is_nan() {
            self.undefined += 1;
            return 0;
        }
        self.above += usize::from(value > 1.0 + ROUNDING);
        self.below += usize::from(value < -ROUNDING);
        self.max = self.max.max(value);
        // Conversion saturates.
        (value * 65_535.0).round() as u16
    }

    fn report(&self, samples: usize, warnings: &mut Vec<String>) {
        let percent = |count: usize| 100.0 * count as f64 / samples as f64;
        if self.above > 0 {
            let brightest = if self.max < 1e4 { format!("{:.3}", self.max) } else { format!("{:.2e}", self.max) };
            warnings.push(format!(
                "{:.2} % of its samples are brighter than white (1; the brightest is {brightest}) and became white; \
                 scale the picture first to keep them",
                percent(self.above)
            ));
        }
        if self.below > 0 {
            warnings.push(format!("{:.2} % of its samples are below black (0) and became black", percent(self.below)));
        }
        if self.undefined > 0 {
            warnings.push(format!("{} of its samples are no numbers (NaN) and became black", self.undefined));
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::exif::Order;
    use super::super::{Photo, decode};
    use super::*;
    use std::io::Cursor;

    /// An uncompressed file of samples in rows, colors in turn or one plane after another.
    pub(in super::super) fn file(
        order: Order,
        (width, height, channels): (u32, u32, u16),
        bits: u16,
        planar: bool,
        samples: &[f64],
    ) -> Vec<u8> {
        let coded = |v: f64| match bits {
            16 => order.bytes16(half(v)).to_vec(),
            32 => order.bytes32((v as f32).to_bits()).to_vec(),
            _ if order == Order::Little => v.to_le_bytes().to_vec(),
            _ => v.to_be_bytes().to_vec(),
        };
        let size = u32::from(bits) / 8;
        let mut out = if order == Order::Little { b"II*\0".to_vec() } else { b"MM\0*".to_vec() };
        out.extend(order.bytes32(0));
        out.extend(samples.iter().flat_map(|v| coded(*v)));
        // Lists of more numbers than an entry holds.
        let plane = width * height * size;
        let bytes = plane * u32::from(channels);
        let lists = out.len() as u32;
        for list in [bits, 3] {
            out.extend((0..channels).flat_map(|_| order.bytes16(list)));
        }
        let planes = if planar { u32::from(channels) } else { 1 };
        let of_strips = out.len() as u32;
        out.extend((0..planes).flat_map(|i| order.bytes32(8 + i * plane)));
        out.extend((0..planes).flat_map(|_| order.bytes32(bytes / planes)));
        let directory = (out.len() as u32).next_multiple_of(2);
        out.resize(directory as usize, 0);
        out[4..8].copy_from_slice(&order.bytes32(directory));
        let short = |v: u16| {
            let [a, b] = order.bytes16(v);
            [a, b, 0, 0]
        };
        let shorts = |v: u16, at: u32| if channels > 2 { order.bytes32(at) } else { short(v) };
        let longs = |v: u32, at: u32| order.bytes32(if planes > 1 { at } else { v });
        let kind = if channels < 3 { 1 } else { 2 };
        let entries = [
            (256, 4, 1, order.bytes32(width)),
            (257, 4, 1, order.bytes32(height)),
            (258, 3, u32::from(channels), shorts(bits, lists)),
            (259, 3, 1, short(1)),
            (262, 3, 1, short(kind)),
            (273, 4, planes, longs(8, of_strips)),
            (277, 3, 1, short(channels)),
            (278, 4, 1, order.bytes32(height)),
            (279, 4, planes, longs(bytes, of_strips + 4 * planes)),
            (284, 3, 1, short(if planar { 2 } else { 1 })),
            (339, 3, u32::from(channels), shorts(3, lists + 2 * u32::from(channels))),
        ];
        out.extend(order.bytes16(entries.len() as u16));
        for (tag, kind, count, value) in entries {
            out.extend([&order.bytes16(tag)[..], &order.bytes16(kind), &order.bytes32(count), &value].concat());
        }
        out.extend([0; 4]);
        out
    }

    /// IEEE half precision of numbers that it holds.
    fn half(v: f64) -> u16 {
        let bits = (v as f32).to_bits();
        let (sign, exponent, mantissa) = (bits >> 16 & 0x8000, (bits >> 23 & 0xff) as i32 - 112, bits >> 13 & 0x3ff);
        let exponent = if v.is_nan() || v.is_infinite() { 31 } else { exponent };
        if v == 0.0 { 0 } else { sign as u16 | (exponent as u16) << 10 | mantissa as u16 | u16::from(v.is_nan()) }
    }

    fn read(bytes: &[u8]) -> Photo {
        decode(Cursor::new(bytes), LoadOptions::default()).expect("sound")
    }

    fn row(photo: &Photo, plane: usize) -> &[u16] {
        photo.frame.plane16(plane).expect("16 bit").row(0)
    }

    #[test]
    fn numbers_from_0_to_1_become_16_bit_at_any_depth_order_and_layout() {
        let samples = [0.0, 0.25, 0.5, 1.0, 0.125, 0.75];
        let expected = |v: f64| (v * 65_535.0).round() as u16;
        for (order, bits) in [Order::Little, Order::Big].into_iter().flat_map(|o| [(o, 16), (o, 32), (o, 64)]) {
            let photo = read(&file(order, (6, 1, 1), bits, false, &samples));
            assert_eq!(photo.warnings, [""; 0]);
            assert_eq!(row(&photo, 0)[..6], samples.map(expected), "{order:?} {bits}");
            // Two pixels of red, green and blue, in turn and in planes.
            let photo = read(&file(order, (2, 1, 3), bits, false, &samples));
            assert_eq!([2, 0, 1].map(|p| row(&photo, p)[1]), [1.0, 0.125, 0.75].map(expected), "{order:?} {bits}");
            let photo = read(&file(order, (2, 1, 3), bits, true, &samples));
            assert_eq!([2, 0, 1].map(|p| row(&photo, p)[1]), [0.25, 1.0, 0.75].map(expected), "{order:?} {bits}");
        }
    }

    #[test]
    fn what_a_frame_does_not_hold_is_clipped_and_said() {
        for bits in [16, 32, 64] {
            let samples = [4.0, f64::INFINITY, -0.5, f64::NAN, f64::NEG_INFINITY, 0.5, 0.5, 0.5];
            let photo = read(&file(Order::Little, (8, 1, 1), bits, false, &samples));
            assert_eq!(row(&photo, 0)[..6], [65_535, 65_535, 0, 0, 0, 32_768], "{bits}");
            let said = photo.warnings.join("; ");
            for part in ["25.00 % of its samples are brighter", "25.00 % of its samples are below", "1 of its samples"]
            {
                assert!(said.contains(part), "{part}: {said}");
            }
        }
    }

    #[test]
    fn mutated_files_of_floats_never_panic_and_are_refused_where_they_are_cut() {
        let mut rng = fastrand::Rng::with_seed(2);
        let samples: Vec<f64> = (0..5 * 4 * 3).map(|i| f64::from(i) / 60.0).collect();
        for planar in [false, true] {
            let whole = file(Order::Big, (5, 4, 3), 32, planar, &samples);
            for _ in 0..2000 {
                let mut wild = whole.clone();
                for _ in 0..rng.usize(1..6) {
                    let at = rng.usize(..wild.len());
                    wild[at] = rng.u8(..);
                }
                let _ = decode(Cursor::new(&wild), LoadOptions { max_pixels: 1 << 16 });
            }
            for length in (0..whole.len()).step_by(7) {
                assert!(decode(Cursor::new(&whole[..length]), LoadOptions::default()).is_err(), "{length}");
            }
        }
    }
}
