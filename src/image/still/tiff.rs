//! TIFF: EXIF out of it, and an uncompressed writer that keeps EXIF.
//!
//! An EXIF block is itself a TIFF file without pixels. It becomes the beginning of the file that is written, byte for byte, so
//! that all its offsets stay true; pixels and profile follow, then a first directory that takes over the block's entries and
//! adds those of the picture:
//!
//! ```text
//! [EXIF block, its link set to ↓] [strips] [XMP, IPTC, profile] [lists] [first directory]
//! ```
//!
//! Gray with alpha is written as color with alpha: readers of the former are rare.

use std::io::{BufRead, Read, Seek, SeekFrom, Write};

use exif::experimental::Writer;
use exif::{Context, In, Reader, Tag};

use super::bands::Bands;
use super::exif::{LONG, Order, SHORT, first_directory};
use super::packed::{Sample, planes_of};
use super::save::Metadata;
use super::{StillError, Xmp, exif as block, iptc};
use crate::{Layout, PixelFormat};

/// Approximate size of a strip, bytes: large enough to compress, small enough that readers need not hold the picture.
const STRIP: usize = 1 << 20;
/// Strips that are made at once, on all threads.
const STRIPS: usize = 16;
/// Type of opaque bytes.
const UNDEFINED: u16 = 7;
const SAMPLE_FORMAT: u16 = 339;
/// Value of the former.
const FLOATING_POINT: u16 = 3;
const BYTE: u16 = 1;
const XMP: u16 = 700;
const IPTC: u16 = 33_723;
const ICC_PROFILE: u16 = 34_675;
const DNG_VERSION: u16 = 50_706;
const SUB_DIRECTORIES: u16 = 330;
const NEW_SUBFILE_TYPE: u16 = 254;

/// Tags that describe the storage of pixels, or repeat other tags: those of the old file are invalid in the new one. The last two are the
/// versions of DNG, which pictures developed from it may have still: a reader would take the samples for those of a sensor.
const STORAGE: [u16; 39] = [
    254, 255, 256, 257, 258, 259, 262, 263, 266, 273, 277, 278, 279, 280, 281, 284, 292, 293, 301, 317, 320, 322, 323,
    324, 325, 330, 338, 339, 340, 341, 347, 513, 514, 530, 700, 33_723, 34_675, 50_706, 50_707,
];

/// What a TIFF file says beside its pixels.
#[derive(Debug, Default)]
pub(super) struct TiffMetadata {
    /// EXIF, as a block of its own.
    pub(super) exif: Option<Vec<u8>>,
    /// ICC profile.
    pub(super) icc: Option<Vec<u8>>,
    /// XMP.
    pub(super) xmp: Option<Xmp>,
    /// IPTC.
    pub(super) iptc: Option<Vec<u8>>,
    /// Its samples are floating-point numbers.
    pub(super) floats: bool,
}

/// What a TIFF file says beside its pixels, as far as it can be read.
///
/// # Errors
/// [`StillError::Raw`] for raw files under another name.
pub(super) fn metadata(reader: &mut (impl BufRead + Seek), most: u64) -> Result<TiffMetadata, StillError> {
    let mut bytes = Vec::new();
    reader.seek(SeekFrom::Start(0)).map_err(StillError::Read)?;
    reader.by_ref().take(most).read_to_end(&mut bytes).map_err(StillError::Read)?;
    let Some((order, entries)) = first_directory(&bytes) else { return Ok(TiffMetadata::default()) };
    let has = |tag: u16| entries.iter().find(|e| e.tag == tag);
    let reduced = has(NEW_SUBFILE_TYPE).is_some_and(|e| e.value(order) & 1 == 1);
    if has(DNG_VERSION).is_some() {
        return Err(StillError::Raw("DNG".to_owned()));
    }
    if reduced && has(SUB_DIRECTORIES).is_some() {
        return Err(StillError::Raw("a small picture before the real one".to_owned()));
    }
    let content = |tag: u16| {
        let entry = has(tag)?;
        let size = if entry.kind(order) == LONG { 4 } else { 1 };
        let size = (entry.count(order) as usize).checked_mul(size)?;
        bytes.get(entry.value(order) as usize..)?.get(..size)
    };
    let icc = content(ICC_PROFILE).map(<[u8]>::to_vec);
    let xmp = content(XMP).map(|packet| Xmp { packet: packet.to_vec(), extended: None });
    let iptc = content(IPTC).and_then(iim);
    let kinds = has(SAMPLE_FORMAT).and_then(|e| e.first_short(&bytes, order));
    let floats = kinds == Some(FLOATING_POINT);
    Ok(TiffMetadata { icc, xmp, iptc, floats, exif: exif_of(bytes, order) })
}

/// IPTC of its tag. Writers that call it a list of longs may have swapped the bytes of each.
fn iim(bytes: &[u8]) -> Option<Vec<u8>> {
    let swapped = || bytes.chunks_exact(4).flat_map(|long| long.iter().rev().copied()).collect::<Vec<u8>>();
    iptc::of_resources(bytes).or_else(|| iptc::of_resources(&swapped()))
}

/// EXIF of a whole TIFF file.
fn exif_of(bytes: Vec<u8>, order: Order) -> Option<Vec<u8>> {
    let mut reader = Reader::new();
    reader.continue_on_error(true);
    let found = reader.read_raw(bytes).or_else(|e| e.distill_partial_result(|_| {})).ok()?;
    let wanted = |f: &&exif::Field| {
        f.ifd_num == In::PRIMARY
            && (f.tag.context() != Context::Tiff || !STORAGE.contains(&f.tag.number()) || f.tag == Tag::Orientation)
    };
    let mut writer = Writer::new();
    let mut any = false;
    for field in found.fields().filter(wanted) {
        writer.push_field(field);
        any = true;
    }
    let mut out = std::io::Cursor::new(Vec::new());
    let written = any && writer.write(&mut out, order == Order::Little).is_ok();
    written.then(|| out.into_inner())
}

/// Planes in the order of the file.
fn order_of(format: PixelFormat) -> &'static [usize] {
    match (format.layout, format.alpha) {
        (Layout::Gray, true) => &[0, 0, 0, 1],
        _ => planes_of(format),
    }
}

/// Writes pixels.
pub(super) fn encode(
    bands: &Bands<'_>,
    Metadata { exif, icc, xmp, iptc }: &Metadata,
    out: impl Write + Seek,
) -> Result<(), StillError> {
    let kept = exif.as_ref().and_then(|b| first_directory(b).map(|(order, entries)| (b, order, entries)));
    let (base, order, entries) = match kept {
        Some((bytes, order, entries)) => (bytes.clone(), order, entries),
        None => (b"II*\0\0\0\0\0".to_vec(), Order::Little, Vec::new()),
    };
    let (size, format) = (bands.size(), bands.format());
    let bytes = (size.0 * size.1 * order_of(format).len()) as u64 * format.bytes_per_sample() as u64;
    let whole = bytes
        + (base.len() + [icc, iptc].map(|m| m.as_ref().map_or(0, Vec::len)).iter().sum::<usize>()) as u64
        + (8 << 20);
    if u32::try_from(whole).is_err() {
        return Err(StillError::Encode(format!("{bytes} bytes of pixels are more than a TIFF file can hold (4 GiB)")));
    }
    let mut file = File { out, order, at: 0, entries: Vec::new() };
    file.put(&base)?;
    file.align()?;
    for entry in entries.into_iter().filter(|e| !STORAGE.contains(&e.tag) && e.tag != block::ORIENTATION) {
        file.entries.push((entry.tag, entry.bytes));
    }
    if format.bits == 8 {
        file.picture::<u8>(bands)?;
    } else {
        file.picture::<u16>(bands)?;
    }
    let packet = xmp.as_ref().map(|xmp| &xmp.packet);
    for (tag, kind, content) in
        [(XMP, BYTE, packet), (IPTC, UNDEFINED, iptc.as_ref()), (ICC_PROFILE, UNDEFINED, icc.as_ref())]
    {
        if let Some(content) = content.filter(|c| c.len() > 4) {
            let at = file.at;
            file.put(content)?;
            file.align()?;
            file.entry(tag, kind, content.len() as u32, order.bytes32(at));
        }
    }
    file.finish()
}

/// A file being written.
struct File<W> {
    out: W,
    order: Order,
    at: u32,
    entries: Vec<(u16, [u8; 12])>,
}

impl<W: Write + Seek> File<W> {
    fn put(&mut self, bytes: &[u8]) -> Result<(), StillError> {
        self.at += bytes.len() as u32;
        self.out.write_all(bytes).map_err(StillError::Write)
    }

    /// Goes to an even position, where directories and values must begin.
    fn align(&mut self) -> Result<(), StillError> {
        if self.at % 2 == 1 { self.put(&[0]) } else { Ok(()) }
    }

    fn entry(&mut self, tag: u16, kind: u16, count: u32, value: [u8; 4]) {
        let mut bytes = [0; 12];
        bytes[..2].copy_from_slice(&self.order.bytes16(tag));
        bytes[2..4].copy_from_slice(&self.order.bytes16(kind));
        bytes[4..8].copy_from_slice(&self.order.bytes32(count));
        bytes[8..].copy_from_slice(&value);
        self.entries.push((tag, bytes));
    }

    fn short(&mut self, tag: u16, value: u16) {
        let [a, b] = self.order.bytes16(value);
        self.entry(tag, SHORT, 1, [a, b, 0, 0]);
    }

    fn long(&mut self, tag: u16, value: usize) {
        self.entry(tag, LONG, 1, self.order.bytes32(value as u32));
    }

    /// An entry of several numbers, in the entry itself where they fit.
    fn list(&mut self, tag: u16, kind: u16, values: &[u32]) -> Result<(), StillError> {
        let one = |v: &u32| {
            if kind == SHORT { self.order.bytes16(*v as u16).to_vec() } else { self.order.bytes32(*v).to_vec() }
        };
        let bytes: Vec<u8> = values.iter().flat_map(one).collect();
        let mut value = [0; 4];
        if bytes.len() <= 4 {
            value[..bytes.len()].copy_from_slice(&bytes);
        } else {
            value = self.order.bytes32(self.at);
            self.put(&bytes)?;
        }
        self.entry(tag, kind, values.len() as u32, value);
        Ok(())
    }

    /// Strips of packed samples, and the entries that describe them.
    fn picture<S: Sample + Swap>(&mut self, bands: &Bands<'_>) -> Result<(), StillError> {
        let ((width, height), format) = (bands.size(), bands.format());
        let planes = order_of(format);
        let channels = planes.len();
        let row = width * channels;
        let rows = (STRIP / (row * size_of::<S>()).max(1)).clamp(1, height);
        let (mut offsets, mut counts) = (Vec::new(), Vec::new());
        let mut strips = vec![S::zeroed(); row * (rows * STRIPS).min(height)];
        for first in (0..height).step_by(rows * STRIPS) {
            let strips = &mut strips[..row * (rows * STRIPS).min(height - first)];
            bands.pack_rows(planes, first, strips)?;
            for v in strips.iter_mut() {
                *v = v.ordered(self.order);
            }
            for strip in strips.chunks(row * rows) {
                offsets.push(self.at);
                counts.push(size_of_val(strip) as u32);
                self.put(bytemuck::cast_slice(strip))?;
            }
        }
        self.align()?;
        self.long(256, width);
        self.long(257, height);
        self.list(258, SHORT, &vec![u32::from(format.bits); channels])?;
        self.short(259, 1);
        self.short(262, if channels == 1 { 1 } else { 2 });
        self.list(273, LONG, &offsets)?;
        self.short(block::ORIENTATION, 1);
        self.short(277, channels as u16);
        self.long(278, rows);
        self.list(279, LONG, &counts)?;
        self.short(284, 1);
        if format.alpha {
            // 2: not premultiplied.
            self.short(338, 2);
        }
        Ok(())
    }

    /// Writes the first directory, sorted, and the link to it.
    fn finish(mut self) -> Result<(), StillError> {
        self.align()?;
        let (order, at) = (self.order, self.at);
        self.entries.sort_by_key(|(tag, _)| *tag);
        let mut directory = order.bytes16(self.entries.len() as u16).to_vec();
        directory.extend(self.entries.iter().flat_map(|(_, bytes)| *bytes));
        directory.extend([0; 4]);
        self.put(&directory)?;
        self.out.seek(SeekFrom::Start(4)).map_err(StillError::Write)?;
        self.out.write_all(&order.bytes32(at)).map_err(StillError::Write)?;
        self.out.seek(SeekFrom::End(0)).map_err(StillError::Write)?;
        self.out.flush().map_err(StillError::Write)
    }
}

/// A sample in the byte order of a file.
trait Swap {
    fn ordered(self, order: Order) -> Self;
}

impl Swap for u8 {
    fn ordered(self, _: Order) -> Self {
        self
    }
}

impl Swap for u16 {
    fn ordered(self, order: Order) -> Self {
        if order == Order::Little { self.to_le() } else { self.to_be() }
    }
}
