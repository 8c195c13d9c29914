//! Segments of a JPEG file beside its picture: XMP and IPTC out of them and into them.
//!
//! | marker | begins with | holds |
//! | --- | --- | --- |
//! | APP1 | `Exif` | EXIF |
//! | APP1 | `http://ns.adobe.com/xap/1.0/` | an XMP packet |
//! | APP1 | `http://ns.adobe.com/xmp/extension/` | digest, full length, offset and a piece of extended XMP |
//! | APP2 | `ICC_PROFILE` | a piece of the profile |
//! | APP2 | `urn:iso:std:iso:ts:21496:-1` | how a gain map is applied |
//! | APP2 | `MPF` | which pictures follow the first (`multi_picture.rs`) |
//! | APP13 | `Photoshop 3.0` | a piece of a list of resources, with IPTC among them |
//!
//! # Reference
//! Adobe, *XMP specification part 3*, section 1.1.3; ITU-T T.81, B.1.1.4.

use std::ops::Range;

use jpeg_encoder::{Encoder, EncodingError, JfifWrite};

use super::super::save::Metadata;
use super::super::xmp::DIGEST;
use super::super::{Xmp, iptc};

/// Maximum size of EXIF, bytes: one segment.
pub(in super::super) const MAX_EXIF: usize = 65_527;
/// Maximum size of an XMP packet, bytes: one segment.
pub(in super::super) const MAX_XMP: usize = 65_533 - XMP.len();
/// Maximum size of IPTC, bytes: one segment.
pub(in super::super) const MAX_IPTC: usize = 65_533 - PHOTOSHOP.len() - 13;

pub(super) const XMP: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";
const EXTENSION: &[u8] = b"http://ns.adobe.com/xmp/extension/\0";
const EXIF: &[u8] = b"Exif\0\0";
const PROFILE: &[u8] = b"ICC_PROFILE\0";
pub(super) const ISO: &[u8] = b"urn:iso:std:iso:ts:21496:-1\0";
const PHOTOSHOP: &[u8] = b"Photoshop 3.0\0";
/// Bytes of extended XMP in a segment.
const PIECE: usize = 65_000;

/// A marker segment: its code, where its content begins and ends.
pub(super) struct Segment {
    pub(super) code: u8,
    pub(super) start: usize,
    pub(super) end: usize,
}

/// The segment that begins at or after `at`, where the file goes on so far.
pub(super) fn segment(bytes: &[u8], at: usize) -> Option<Segment> {
    let mut at = at;
    if *bytes.get(at)? != 0xff {
        return None;
    }
    while *bytes.get(at)? == 0xff {
        at += 1;
    }
    let code = bytes[at];
    let length = usize::from(u16::from_be_bytes([*bytes.get(at + 1)?, *bytes.get(at + 2)?]));
    (length >= 2).then_some(Segment { code, start: at + 3, end: at + 1 + length })
}

/// What the segments before a picture hold, as far as it is read from them.
#[derive(Debug, Default)]
pub(in super::super) struct Found {
    pub(in super::super) xmp: Option<Xmp>,
    pub(in super::super) iptc: Option<Vec<u8>>,
}

/// Where the contents of the segments of one kind before the picture are, without what they begin with.
pub(super) fn pieces<'b>(bytes: &'b [u8], code: u8, magic: &'b [u8]) -> impl Iterator<Item = Range<usize>> + 'b {
    let mut at = 2;
    let segments = std::iter::from_fn(move || {
        let s = segment(bytes, at).filter(|s| s.code != 0xda)?;
        at = s.end;
        Some(s)
    });
    let is = move |s: &Segment| s.code == code && bytes.get(s.start..s.end).is_some_and(|b| b.starts_with(magic));
    segments.filter(is).map(move |s| s.start + magic.len()..s.end)
}

/// The contents themselves.
pub(super) fn contents<'b>(bytes: &'b [u8], code: u8, magic: &'b [u8]) -> impl Iterator<Item = &'b [u8]> {
    pieces(bytes, code, magic).map(move |range| &bytes[range])
}

/// XMP and IPTC of a file.
pub(in super::super) fn found(bytes: &[u8]) -> Found {
    let packet = contents(bytes, 0xe1, XMP).next().map(<[u8]>::to_vec);
    let xmp = packet.map(|packet| Xmp { extended: extended(bytes, &packet), packet });
    let resources: Vec<u8> = contents(bytes, 0xed, PHOTOSHOP).flatten().copied().collect();
    Found { xmp, iptc: iptc::of_resources(&resources) }
}

/// EXIF and the profile of a file.
pub(in super::super) fn exif_and_profile(bytes: &[u8]) -> (Option<Vec<u8>>, Option<Vec<u8>>) {
    let exif = contents(bytes, 0xe1, EXIF).next().map(<[u8]>::to_vec);
    // Number and count of a piece, then its bytes.
    let mut parts: Vec<&[u8]> = contents(bytes, 0xe2, PROFILE).filter(|piece| piece.len() > 2).collect();
    parts.sort_by_key(|piece| piece[0]);
    let whole = parts.iter().enumerate().all(|(i, p)| usize::from(p[0]) == i + 1 && usize::from(p[1]) == parts.len());
    let profile = (whole && !parts.is_empty()).then(|| parts.iter().flat_map(|p| &p[2..]).copied().collect());
    (exif, profile)
}

/// Extended XMP of the digest that a packet names; `None` where a piece is missing.
fn extended(bytes: &[u8], packet: &[u8]) -> Option<Vec<u8>> {
    let digest = Xmp::digest(packet)?.as_bytes();
    let piece = |content: &'_ [u8]| {
        let (length, rest) = content.strip_prefix(digest)?.split_first_chunk::<4>()?;
        let offset = rest.first_chunk::<4>()?;
        Some((u32::from_be_bytes(*offset) as usize, u32::from_be_bytes(*length) as usize))
    };
    let numbered = contents(bytes, 0xe1, EXTENSION).filter_map(|c| Some((piece(c)?, &c[DIGEST + 8..])));
    let mut pieces: Vec<((usize, usize), &[u8])> = numbered.collect();
    pieces.sort_by_key(|((offset, _), _)| *offset);
    let length = pieces.first()?.0.1;
    let mut whole = Vec::new();
    for ((offset, full), content) in pieces {
        if offset != whole.len() || full != length {
            return None;
        }
        whole.extend_from_slice(content);
    }
    (whole.len() == length).then_some(whole)
}

/// What is written before the picture. Each fits into its segments.
#[derive(Clone, Copy, Debug, Default)]
pub(in super::super) struct Written<'m> {
    pub(in super::super) exif: Option<&'m [u8]>,
    pub(in super::super) icc: Option<&'m [u8]>,
    pub(in super::super) xmp: Option<&'m [u8]>,
    pub(in super::super) extended: Option<&'m [u8]>,
    pub(in super::super) iptc: Option<&'m [u8]>,
    /// Metadata of a gain map.
    pub(in super::super) iso: Option<&'m [u8]>,
}

impl<'m> Written<'m> {
    /// What of a photo's metadata is written.
    pub(in super::super) fn of(metadata: &'m Metadata) -> Self {
        Self {
            exif: metadata.exif.as_deref(),
            icc: metadata.icc.as_deref(),
            xmp: metadata.xmp.as_ref().map(|xmp| &xmp.packet[..]),
            extended: metadata.xmp.as_ref().and_then(|xmp| xmp.extended.as_deref()),
            iptc: metadata.iptc.as_deref(),
            iso: None,
        }
    }

    /// Adds the segments in the order in which cameras write them.
    pub(super) fn add_to<W: JfifWrite>(&self, encoder: &mut Encoder<W>) -> Result<(), EncodingError> {
        if let Some(block) = self.exif {
            encoder.add_exif_metadata(block)?;
        }
        if let Some(packet) = self.xmp {
            encoder.add_app_segment(1, [XMP, packet].concat())?;
        }
        let digest = self.xmp.and_then(Xmp::digest);
        if let (Some(extended), Some(digest)) = (self.extended, digest) {
            let length = (extended.len() as u32).to_be_bytes();
            for (i, piece) in extended.chunks(PIECE).enumerate() {
                let offset = ((i * PIECE) as u32).to_be_bytes();
                let content = [EXTENSION, digest.as_bytes(), &length, &offset, piece].concat();
                encoder.add_app_segment(1, content)?;
            }
        }
        if let Some(iim) = self.iptc {
            encoder.add_app_segment(13, [PHOTOSHOP, &iptc::resources(iim)].concat())?;
        }
        if let Some(profile) = self.icc {
            encoder.add_icc_profile(profile)?;
        }
        if let Some(content) = self.iso {
            encoder.add_app_segment(2, [ISO, content].concat())?;
        }
        Ok(())
    }
}
