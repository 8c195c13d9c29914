//! Pixel formats: FFmpeg's numbers, their meaning, and the planar format that represents them without loss.

use ffmpeg_next::ffi;

use super::dict::{c_string, string};
use plumbline_image::{Layout, PixelFormat};

/// A valid pixel format of the linked FFmpeg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pix(ffi::AVPixelFormat);

/// How pictures of a format come into planes of one depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Route {
    /// They are laid out so already.
    Direct(PixelFormat),
    /// Samples only change places (semi-planar, packed, palette, big-endian).
    Repack(PixelFormat),
    /// Fewer than eight bits: widened to eight.
    Widen(PixelFormat),
    /// Not representable (floating point, raw sensor data, hardware surfaces).
    Refused,
}

impl Pix {
    pub(super) fn raw(self) -> ffi::AVPixelFormat {
        self.0
    }

    /// FFmpeg's number of the format.
    pub(super) fn number(self) -> i32 {
        self.0 as i32
    }

    /// The format of that number, where FFmpeg describes it.
    pub(crate) fn from_raw(number: i32) -> Option<Self> {
        let mut descriptor = std::ptr::null();
        loop {
            // SAFETY: null starts the walk over FFmpeg's static table, any other value came from it.
            descriptor = unsafe { ffi::av_pix_fmt_desc_next(descriptor) };
            if descriptor.is_null() {
                return None;
            }
            // SAFETY: a descriptor of the table.
            let id = unsafe { ffi::av_pix_fmt_desc_get_id(descriptor) };
            if id as i32 == number {
                return Some(Self(id));
            }
        }
    }

    pub(super) fn from_enum(raw: ffi::AVPixelFormat) -> Option<Self> {
        (raw != ffi::AVPixelFormat::AV_PIX_FMT_NONE).then_some(Self(raw))
    }

    pub(crate) fn from_name(name: &str) -> Option<Self> {
        let name = c_string(name);
        // SAFETY: a zero-terminated string.
        Self::from_enum(unsafe { ffi::av_get_pix_fmt(name.as_ptr()) })
    }

    pub(crate) fn name(self) -> String {
        // SAFETY: static names.
        unsafe { string(ffi::av_get_pix_fmt_name(self.0)) }
    }

    pub(super) fn descriptor(self) -> &'static ffi::AVPixFmtDescriptor {
        // SAFETY: every `Pix` is a format that FFmpeg describes; its table is static.
        unsafe { ffi::av_pix_fmt_desc_get(self.0).as_ref() }.expect("a constructed format has a descriptor")
    }

    fn has(self, flag: i32) -> bool {
        self.descriptor().flags & flag as u64 != 0
    }

    pub(crate) fn is_hardware(self) -> bool {
        self.has(ffi::AV_PIX_FMT_FLAG_HWACCEL)
    }

    pub(crate) fn is_rgb(self) -> bool {
        self.has(ffi::AV_PIX_FMT_FLAG_RGB)
    }

    pub(crate) fn has_alpha(self) -> bool {
        self.has(ffi::AV_PIX_FMT_FLAG_ALPHA)
    }

    /// Luma alone, with or without alpha.
    pub(crate) fn is_gray(self) -> bool {
        self.descriptor().nb_components < 3 && !self.is_palette()
    }

    pub(super) fn is_palette(self) -> bool {
        self.has(ffi::AV_PIX_FMT_FLAG_PAL)
    }

    /// `yuvj…`: the format's name says full range.
    pub(crate) fn is_full_range_by_name(self) -> bool {
        self.name().starts_with("yuvj")
    }

    /// Bits of the deepest component.
    pub(crate) fn bits(self) -> u8 {
        let d = self.descriptor();
        d.comp[..usize::from(d.nb_components)].iter().map(|c| c.depth as u8).max().unwrap_or(0)
    }

    /// `(log2 horizontal, log2 vertical)` chroma subsampling.
    pub(crate) fn chroma_shift(self) -> (u8, u8) {
        (self.descriptor().log2_chroma_w, self.descriptor().log2_chroma_h)
    }

    /// The planar format that this *is*, byte for byte.
    pub(crate) fn planar(self) -> Option<PixelFormat> {
        match self.route() {
            Route::Direct(format) => Some(format),
            _ => None,
        }
    }

    /// How pictures of this format come into planes.
    pub(crate) fn route(self) -> Route {
        let d = self.descriptor();
        let comps = &d.comp[..usize::from(d.nb_components)];
        let exotic = ffi::AV_PIX_FMT_FLAG_HWACCEL | ffi::AV_PIX_FMT_FLAG_FLOAT | ffi::AV_PIX_FMT_FLAG_BAYER;
        if comps.is_empty() || self.has(exotic) || self.name().starts_with("xyz") {
            return Route::Refused;
        }
        if self.is_palette() {
            return Route::Repack(PixelFormat { layout: Layout::Gbr, bits: 8, alpha: true });
        }
        let Some(layout) = self.layout(comps.len()) else { return Route::Refused };
        let (bits, alpha) = (comps[0].depth as u8, self.has_alpha());
        if self.has(ffi::AV_PIX_FMT_FLAG_BITSTREAM) || bits < 8 || comps.iter().any(|c| c.depth != comps[0].depth) {
            return Route::Widen(PixelFormat { layout, bits: 8, alpha });
        }
        let format = PixelFormat { layout, bits, alpha };
        if self.is_planar_in_order(comps, format) { Route::Direct(format) } else { Route::Repack(format) }
    }

    /// The layout that has room for the components; gray with alpha takes that of RGB.
    fn layout(self, components: usize) -> Option<Layout> {
        if self.has(ffi::AV_PIX_FMT_FLAG_RGB) || components == 2 {
            return Some(Layout::Gbr);
        }
        match (components, self.descriptor().log2_chroma_w, self.descriptor().log2_chroma_h) {
            (1, ..) => Some(Layout::Gray),
            (_, 1, 1) => Some(Layout::Yuv420),
            (_, 1, 0) => Some(Layout::Yuv422),
            (_, 0, 1) => Some(Layout::Yuv440),
            (_, 2, 0) => Some(Layout::Yuv411),
            (_, 0, 0) => Some(Layout::Yuv444),
            _ => None, // 4:1:0 and the like
        }
    }

    fn is_planar_in_order(self, comps: &[ffi::AVComponentDescriptor], format: PixelFormat) -> bool {
        let endian = format.bits == 8 || self.has(ffi::AV_PIX_FMT_FLAG_BE) == cfg!(target_endian = "big");
        endian
            && comps.len() == format.planes()
            && comps.iter().enumerate().all(|(c, d)| {
                d.plane as usize == plane_of(format.layout, c)
                    && d.step as usize == format.bytes_per_sample()
                    && d.offset == 0
                    && d.shift == 0
            })
    }

    /// FFmpeg's format for planes of `format`; `None` where it has none.
    pub(crate) fn from_planar(format: PixelFormat) -> Option<Self> {
        let family = match format.layout {
            Layout::Gray => "gray",
            Layout::Yuv420 => "yuv420p",
            Layout::Yuv422 => "yuv422p",
            Layout::Yuv440 => "yuv440p",
            Layout::Yuv411 => "yuv411p",
            Layout::Yuv444 => "yuv444p",
            Layout::Gbr => "gbrp",
        };
        let family = match (format.alpha, format.layout) {
            (false, _) => family.to_owned(),
            (true, Layout::Gbr) => "gbrap".to_owned(),
            (true, _) => family.replace("yuv", "yuva"),
        };
        let endian = if cfg!(target_endian = "big") { "be" } else { "le" };
        let name = if format.bits == 8 { family } else { format!("{family}{}{endian}", format.bits) };
        Self::from_name(&name).filter(|p| p.planar() == Some(format))
    }
}

/// The plane that component `c` (Y U V A, or R G B A) lies in.
pub(super) fn plane_of(layout: Layout, c: usize) -> usize {
    match (layout, c) {
        (Layout::Gbr, 0) => 2,
        (Layout::Gbr, 1) => 0,
        (Layout::Gbr, 2) | (Layout::Gray, 1) => 1,
        (_, c) => c,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn route(name: &str) -> Route {
        Pix::from_name(name).expect("FFmpeg knows the format").route()
    }

    #[test]
    fn planar_formats_are_taken_as_they_are() {
        assert_eq!(route("yuv420p"), Route::Direct(PixelFormat::opaque(Layout::Yuv420, 8)));
        assert_eq!(route("yuvj444p"), Route::Direct(PixelFormat::opaque(Layout::Yuv444, 8)));
        assert_eq!(route("yuv422p10le"), Route::Direct(PixelFormat::opaque(Layout::Yuv422, 10)));
        assert_eq!(route("gbrp12le"), Route::Direct(PixelFormat::opaque(Layout::Gbr, 12)));
        let alpha = PixelFormat { layout: Layout::Yuv444, bits: 16, alpha: true };
        assert_eq!(route("yuva444p16le"), Route::Direct(alpha));
        assert_eq!(route("gray16le"), Route::Direct(PixelFormat::opaque(Layout::Gray, 16)));
    }

    #[test]
    fn packed_semi_planar_palette_and_foreign_endian_formats_only_change_places() {
        for (name, layout, bits) in [
            ("nv12", Layout::Yuv420, 8),
            ("p010le", Layout::Yuv420, 10),
            ("yuyv422", Layout::Yuv422, 8),
            ("rgb24", Layout::Gbr, 8),
            ("bgr0", Layout::Gbr, 8),
            ("rgb48be", Layout::Gbr, 16),
            ("yuv420p10be", Layout::Yuv420, 10),
        ] {
            assert_eq!(route(name), Route::Repack(PixelFormat::opaque(layout, bits)), "{name}");
        }
        for name in ["pal8", "rgba", "ya8"] {
            assert_eq!(route(name), Route::Repack(PixelFormat { layout: Layout::Gbr, bits: 8, alpha: true }), "{name}");
        }
    }

    #[test]
    fn what_integer_planes_cannot_hold_is_refused() {
        for name in ["gbrpf32le", "vaapi", "bayer_rggb8", "xyz12le", "yuv410p"] {
            assert_eq!(route(name), Route::Refused, "{name}");
        }
        assert_eq!(route("monob"), Route::Widen(PixelFormat::opaque(Layout::Gray, 8)));
        assert_eq!(route("rgb565le"), Route::Widen(PixelFormat::opaque(Layout::Gbr, 8)));
    }

    #[test]
    fn every_planar_format_finds_its_way_back() {
        for name in ["yuv420p", "yuv422p10le", "yuv444p12le", "yuva420p", "gbrp", "gbrap12le", "gray", "gray10le"] {
            let pix = Pix::from_name(name).expect("FFmpeg knows the format");
            assert_eq!(Pix::from_planar(pix.planar().expect("planar")).map(Pix::name).as_deref(), Some(name));
        }
        assert_eq!(Pix::from_planar(PixelFormat::opaque(Layout::Yuv420, 13)), None);
        assert_eq!(Pix::from_raw(-1), None);
        assert_eq!(Pix::from_raw(1 << 20), None);
    }
}
