//! Read access to one stream of a container.

use std::ffi::CStr;

use ffmpeg_next::ffi;

use super::Pix;
use super::dict::pairs;
use super::packet::some_ts;

/// A fraction as FFmpeg has it: 0/x is "unknown".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rational {
    pub(crate) num: i32,
    pub(crate) den: i32,
}

impl Rational {
    /// Microseconds, FFmpeg's base for whole-file times.
    pub(crate) const MICRO: Self = Self { num: 1, den: 1_000_000 };

    pub(crate) fn value(self) -> Option<f64> {
        (self.num > 0 && self.den > 0).then(|| self.num as f64 / self.den as f64)
    }

    /// `ticks` of this base in ticks of `to`, rounded to the nearest; saturates.
    pub(crate) fn rescale(self, ticks: i64, to: Self) -> i64 {
        let wide = i128::from(ticks) * i128::from(self.num) * i128::from(to.den);
        let per = (i128::from(self.den) * i128::from(to.num)).max(1);
        let half = if wide < 0 { -per / 2 } else { per / 2 };
        ((wide + half) / per).clamp(i64::MIN as i128, i64::MAX as i128) as i64
    }
}

impl From<ffi::AVRational> for Rational {
    fn from(r: ffi::AVRational) -> Self {
        Self { num: r.num, den: r.den }
    }
}

impl From<Rational> for ffi::AVRational {
    fn from(r: Rational) -> Self {
        Self { num: r.num, den: r.den }
    }
}

/// What a stream carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Video,
    Audio,
    Subtitle,
    Data,
    Attachment,
    Other,
}

/// A stream of an open container.
#[derive(Clone, Copy)]
pub(crate) struct StreamRef<'a>(pub(super) &'a ffi::AVStream);

impl<'a> StreamRef<'a> {
    pub(super) fn par(self) -> &'a ffi::AVCodecParameters {
        // SAFETY: a stream owns its parameters from creation to destruction.
        unsafe { &*self.0.codecpar }
    }

    pub(crate) fn kind(self) -> Kind {
        match self.par().codec_type {
            ffi::AVMediaType::AVMEDIA_TYPE_VIDEO => Kind::Video,
            ffi::AVMediaType::AVMEDIA_TYPE_AUDIO => Kind::Audio,
            ffi::AVMediaType::AVMEDIA_TYPE_SUBTITLE => Kind::Subtitle,
            ffi::AVMediaType::AVMEDIA_TYPE_DATA => Kind::Data,
            ffi::AVMediaType::AVMEDIA_TYPE_ATTACHMENT => Kind::Attachment,
            _ => Kind::Other,
        }
    }

    pub(crate) fn time_base(self) -> Rational {
        self.0.time_base.into()
    }

    pub(crate) fn start(self) -> Option<i64> {
        some_ts(self.0.start_time)
    }

    pub(crate) fn duration(self) -> Option<i64> {
        some_ts(self.0.duration).filter(|d| *d > 0)
    }

    pub(crate) fn frames(self) -> Option<u64> {
        u64::try_from(self.0.nb_frames).ok().filter(|n| *n > 0)
    }

    pub(crate) fn average_rate(self) -> Rational {
        self.0.avg_frame_rate.into()
    }

    pub(crate) fn base_rate(self) -> Rational {
        self.0.r_frame_rate.into()
    }

    /// The container's word on pixel aspect where it has one, else the codec's.
    pub(crate) fn sample_aspect(self) -> Rational {
        let container: Rational = self.0.sample_aspect_ratio.into();
        if container.num > 0 { container } else { self.par().sample_aspect_ratio.into() }
    }

    pub(crate) fn codec_name(self) -> String {
        // SAFETY: returns a static string for any identifier.
        unsafe { CStr::from_ptr(ffi::avcodec_get_name(self.par().codec_id)) }.to_string_lossy().into_owned()
    }

    pub(crate) fn codec_known(self) -> bool {
        self.par().codec_id != ffi::AVCodecID::AV_CODEC_ID_NONE
    }

    pub(crate) fn size(self) -> (i32, i32) {
        (self.par().width, self.par().height)
    }

    pub(crate) fn bit_rate(self) -> Option<u64> {
        u64::try_from(self.par().bit_rate).ok().filter(|r| *r > 0)
    }

    pub(crate) fn sample_rate(self) -> i32 {
        self.par().sample_rate
    }

    pub(crate) fn channels(self) -> i32 {
        self.par().ch_layout.nb_channels
    }

    /// The container or codec header says that the video is interlaced.
    pub(crate) fn declared_field_order(self) -> Option<bool> {
        use ffi::AVFieldOrder as F;
        match self.par().field_order {
            F::AV_FIELD_TT | F::AV_FIELD_TB => Some(true),
            F::AV_FIELD_BB | F::AV_FIELD_BT => Some(false),
            _ => None,
        }
    }

    /// FFmpeg's name of the pixel format that the headers announce.
    pub(crate) fn pixel_format(self) -> Option<String> {
        Pix::from_raw(self.par().format).map(Pix::name)
    }

    /// H.273 codes of primaries, transfer and matrix, and the range where it is known.
    pub(crate) fn color(self) -> (u8, u8, u8, Option<bool>) {
        let p = self.par();
        let range = match p.color_range {
            ffi::AVColorRange::AVCOL_RANGE_JPEG => Some(true),
            ffi::AVColorRange::AVCOL_RANGE_MPEG => Some(false),
            _ => None,
        };
        (p.color_primaries as i32 as u8, p.color_trc as i32 as u8, p.color_space as i32 as u8, range)
    }

    /// The stream's mastering display or content light data.
    pub(crate) fn has_hdr_metadata(self) -> bool {
        use ffi::AVPacketSideDataType as T;
        [T::AV_PKT_DATA_MASTERING_DISPLAY_METADATA, T::AV_PKT_DATA_CONTENT_LIGHT_LEVEL]
            .into_iter()
            .any(|t| self.side_data(t).is_some())
    }

    /// The container announces Dolby Vision.
    pub(crate) fn has_dolby_vision(self) -> bool {
        self.side_data(ffi::AVPacketSideDataType::AV_PKT_DATA_DOVI_CONF).is_some()
    }

    pub(crate) fn is_attached_picture(self) -> bool {
        self.0.disposition & (ffi::AV_DISPOSITION_ATTACHED_PIC | ffi::AV_DISPOSITION_TIMED_THUMBNAILS) != 0
    }

    /// QuickTime keeps chapter titles in a text track, which FFmpeg shows as data beside the chapters themselves.
    pub(crate) fn is_chapter_track(self) -> bool {
        let text = u32::from_le_bytes(*b"text");
        self.kind() == Kind::Data && self.par().codec_tag == text && self.0.discard == ffi::AVDiscard::AVDISCARD_ALL
    }

    pub(crate) fn is_default(self) -> bool {
        self.0.disposition & ffi::AV_DISPOSITION_DEFAULT != 0
    }

    /// True where the codec carries subtitles as text; false for pictures and for everything that is no subtitle.
    pub(crate) fn is_text_subtitle(self) -> bool {
        // SAFETY: null or a static descriptor.
        let descriptor = unsafe { ffi::avcodec_descriptor_get(self.par().codec_id).as_ref() };
        descriptor.is_some_and(|d| d.props & ffi::AV_CODEC_PROP_TEXT_SUB != 0)
    }

    pub(crate) fn metadata(self) -> Vec<(String, String)> {
        // SAFETY: the stream's own dictionary, alive as long as the stream.
        unsafe { pairs(self.0.metadata) }
    }

    /// The decoder's header (FFmpeg's extradata); empty where none is known.
    pub(crate) fn header(self) -> &'a [u8] {
        let codec = self.par();
        if codec.extradata.is_null() {
            return &[];
        }
        // SAFETY: readable for that many bytes while the stream lives.
        unsafe { std::slice::from_raw_parts(codec.extradata, codec.extradata_size.max(0) as usize) }
    }

    /// Bytes of the stream's side data of one type.
    pub(super) fn side_data(self, kind: ffi::AVPacketSideDataType) -> Option<&'a [u8]> {
        let mut size = 0;
        // SAFETY: a live stream; the result is null or readable for `size` bytes while the stream lives.
        unsafe {
            let data = ffi::av_stream_get_side_data(self.0, kind, &raw mut size);
            (!data.is_null()).then(|| std::slice::from_raw_parts(data, size))
        }
    }

    /// The 3×3 display matrix (16.16 fixed point, 2.30 in the last column), where there is one.
    pub(crate) fn display_matrix(self) -> Option<[i32; 9]> {
        let bytes = self.side_data(ffi::AVPacketSideDataType::AV_PKT_DATA_DISPLAYMATRIX)?;
        let mut matrix = [0; 9];
        for (m, b) in matrix.iter_mut().zip(bytes.as_chunks::<4>().0) {
            *m = i32::from_ne_bytes(*b);
        }
        (bytes.len() >= 36).then_some(matrix)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rescaling_rounds_to_the_nearest_tick_on_both_sides_of_zero() {
        let (third, milli) = (Rational { num: 1, den: 3 }, Rational { num: 1, den: 1000 });
        assert_eq!(third.rescale(1, milli), 333);
        assert_eq!(third.rescale(2, milli), 667);
        assert_eq!(third.rescale(-2, milli), -667);
        assert_eq!(milli.rescale(333, third), 1);
    }
}
