//! Which encoder, and in which pixel format.
//!
//! Among the formats that an encoder takes, the one that loses least is chosen: the same samples in the same places, else
//! the same samples in other places, else the format with the smallest loss in the order alpha, color model, chroma
//! resolution, depth; ties go to the format with the least excess.

use super::av::{EncoderCodec, Pix, Route, find_encoder};
use super::encoders::{encoders, opens};
use super::{Codec, EncoderChoice, MediaError};
use plumbline_image::PixelFormat;

/// How planes become what the encoder takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    /// The same bytes.
    Same,
    /// The same samples in other places.
    Packed,
    /// Other samples.
    Converted,
}

/// An encoder and the format it gets.
#[derive(Clone, Copy)]
pub(super) struct Choice {
    pub(super) encoder: EncoderCodec,
    pub(super) pix: Pix,
    pub(super) fit: Fit,
}

/// Encoders of a codec, the preferred one first. Those that run on a device are taken only where they are asked for.
pub(super) fn software(codec: Codec) -> &'static [&'static str] {
    match codec {
        Codec::H264 => &["libx264", "libopenh264"],
        Codec::Hevc => &["libx265"],
        Codec::Av1 => &["libsvtav1", "libaom-av1", "librav1e"],
        Codec::Prores => &["prores_ks"],
        Codec::Ffv1 => &["ffv1"],
    }
}

/// Encoders of a codec that run on a device.
pub(super) fn hardware(codec: Codec) -> &'static [&'static str] {
    match codec {
        Codec::H264 => &["h264_nvenc", "h264_vaapi", "h264_qsv", "h264_videotoolbox", "h264_amf", "h264_v4l2m2m"],
        Codec::Hevc => &["hevc_nvenc", "hevc_vaapi", "hevc_qsv", "hevc_videotoolbox", "hevc_amf", "hevc_v4l2m2m"],
        Codec::Av1 => &["av1_nvenc", "av1_vaapi", "av1_qsv", "av1_amf"],
        Codec::Prores => &["prores_videotoolbox"],
        Codec::Ffv1 => &[],
    }
}

/// Encoders for `codec` as wished, each with the format that suits `format` best: the one to try, and what to fall back on.
pub(super) fn choose(codec: Codec, choice: &EncoderChoice, format: PixelFormat) -> Result<Vec<Choice>, MediaError> {
    match choice {
        EncoderChoice::Software => Ok(vec![in_software(codec, format)?]),
        EncoderChoice::Named(name) => Ok(vec![named(codec, name, format)?]),
        EncoderChoice::Hardware => {
            let found = on_device(codec, format).next();
            let reason = || format!("no device for it works on this machine (tried {})", join(hardware(codec)));
            let wanted = || format!("{} on a device", codec.name());
            Ok(vec![found.ok_or_else(|| missing(codec, &wanted(), &reason()))?])
        }
        EncoderChoice::Auto => {
            let lossless = on_device(codec, format).filter(|c| loss(format, c.pix).is_none());
            let mut choices: Vec<Choice> = lossless.collect();
            choices.extend(in_software(codec, format));
            if choices.is_empty() { Ok(vec![in_software(codec, format)?]) } else { Ok(choices) }
        }
    }
}

fn in_software(codec: Codec, format: PixelFormat) -> Result<Choice, MediaError> {
    let choices: Vec<_> = software(codec).iter().filter_map(|n| fit(find_encoder(n)?, format)).collect();
    let lossless = choices.iter().find(|c| c.fit != Fit::Converted || loss(format, c.pix).is_none());
    let none = || missing(codec, codec.name(), "this FFmpeg was built without one");
    lossless.or(choices.first()).copied().ok_or_else(none)
}

fn on_device(codec: Codec, format: PixelFormat) -> impl Iterator<Item = Choice> {
    hardware(codec).iter().filter(|n| opens(n)).filter_map(move |n| fit(find_encoder(n)?, format))
}

fn named(codec: Codec, name: &str, format: PixelFormat) -> Result<Choice, MediaError> {
    let encoder = find_encoder(name).ok_or_else(|| missing(codec, name, "this FFmpeg was built without it"))?;
    if ![software(codec), hardware(codec)].concat().contains(&name) {
        return Err(missing(codec, name, &format!("it is none of the encoders known for {}", codec.name())));
    }
    if hardware(codec).contains(&name) && !opens(name) {
        return Err(missing(codec, name, "the device for it is missing on this machine"));
    }
    fit(encoder, format).ok_or_else(|| missing(codec, name, "it takes no pixel format that can be made"))
}

/// The error that names the encoders which do work.
fn missing(codec: Codec, wanted: &str, reason: &str) -> MediaError {
    let names: Vec<String> = encoders(codec).into_iter().map(|e| e.name).collect();
    let available = if names.is_empty() { "none".into() } else { names.join(", ") };
    MediaError::Usage { problem: format!("no encoder for {wanted}: {reason}; available: {available}") }
}

fn join(names: &[&str]) -> String {
    if names.is_empty() { "none: there is none for this codec".into() } else { names.join(", ") }
}

/// The encoder for pictures of a numbered sequence, by the extension.
pub(super) fn choose_still(extension: &str, format: PixelFormat) -> Result<Choice, MediaError> {
    let name = match extension.to_ascii_lowercase().as_str() {
        "png" => "png",
        "tif" | "tiff" => "tiff",
        "jpg" | "jpeg" => "mjpeg",
        "dpx" => "dpx",
        "bmp" => "bmp",
        _ => "",
    };
    find_encoder(name).and_then(|encoder| fit(encoder, format)).ok_or_else(|| MediaError::Usage {
        problem: format!(
            "no encoder for pictures named .{extension}: no encoder is known for this extension; available: png, tif, jpg, dpx, bmp"
        ),
    })
}

/// The format of `encoder` that loses least.
pub(super) fn fit(encoder: EncoderCodec, format: PixelFormat) -> Option<Choice> {
    let mut formats = encoder.formats();
    if !formats.is_empty() && formats.iter().all(|f| f.is_hardware()) {
        // Surfaces are filled from these two.
        formats = ["nv12", "p010le"].into_iter().filter_map(Pix::from_name).collect();
    }
    let own = Pix::from_planar(format)?;
    let choice = |pix, fit| Some(Choice { encoder, pix, fit });
    if formats.is_empty() || formats.contains(&own) {
        return choice(own, Fit::Same);
    }
    if let Some(pix) = formats.iter().find(|f| f.planar() == Some(format)) {
        return choice(*pix, Fit::Same);
    }
    let packed = |f: &&Pix| f.route() == Route::Repack(format) && f.name() != "pal8";
    if let Some(pix) = formats.iter().find(packed) {
        return choice(*pix, Fit::Packed);
    }
    let usable = formats.into_iter().filter(|f| !f.is_hardware() && f.name() != "pal8" && f.bits() >= 8);
    let nearest = usable.min_by_key(|f| (losses(format, *f), excess(format, *f), f.is_full_range_by_name()))?;
    choice(nearest, Fit::Converted)
}

/// Alpha, color model, chroma and depth that a conversion loses, as numbers to compare.
fn losses(from: PixelFormat, to: Pix) -> (bool, bool, u8, u8) {
    let (sx, sy) = from.subsampling(1);
    let (tx, ty) = if from.planes() < 3 { (0, 0) } else { to.chroma_shift() };
    let chroma = tx.saturating_sub(sx as u8) + ty.saturating_sub(sy as u8);
    let colorless = from.planes() >= 3 && to.is_gray();
    let chroma = if colorless { u8::MAX } else { chroma };
    let model = from.planes() >= 3 && to.is_rgb() == from.is_yuv();
    (from.alpha && !to.has_alpha(), model, chroma, from.bits.saturating_sub(to.bits()))
}

fn excess(from: PixelFormat, to: Pix) -> (u8, u8, bool) {
    let (sx, sy) = from.subsampling(1);
    let (tx, ty) = to.chroma_shift();
    let chroma = (sx as u8).saturating_sub(tx) + (sy as u8).saturating_sub(ty);
    (to.bits().saturating_sub(from.bits), chroma, to.has_alpha() && !from.alpha)
}

/// What the conversion from `from` to `to` loses, in words; `None` where nothing is.
pub(super) fn loss(from: PixelFormat, to: Pix) -> Option<String> {
    let (alpha, model, chroma, bits) = losses(from, to);
    let parts: Vec<String> = [
        alpha.then(|| "the alpha channel is dropped".to_owned()),
        model.then(|| format!("colors are converted to {}", if to.is_rgb() { "RGB" } else { "YUV" })),
        (chroma == u8::MAX).then(|| "color is dropped".to_owned()),
        (1..u8::MAX).contains(&chroma).then(|| "chroma resolution is reduced".to_owned()),
        (bits > 0).then(|| format!("depth falls from {} to {} bit", from.bits, to.bits())),
    ]
    .into_iter()
    .flatten()
    .collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::Layout;

    fn chosen(codec: Codec, format: PixelFormat) -> (String, Fit) {
        let choice = first(codec, format);
        (choice.pix.name(), choice.fit)
    }

    fn first(codec: Codec, format: PixelFormat) -> Choice {
        choose(codec, &EncoderChoice::Software, format).expect("an encoder")[0]
    }

    fn refusal(codec: Codec, choice: &EncoderChoice) -> Option<String> {
        choose(codec, choice, PixelFormat::opaque(Layout::Yuv420, 8)).err().map(|e| e.to_string())
    }

    #[test]
    fn formats_that_the_encoder_takes_are_kept() {
        for (codec, layout, bits, name) in [
            (Codec::H264, Layout::Yuv420, 8, "yuv420p"),
            (Codec::H264, Layout::Yuv422, 10, "yuv422p10le"),
            (Codec::H264, Layout::Yuv444, 8, "yuv444p"),
            (Codec::Hevc, Layout::Yuv420, 12, "yuv420p12le"),
            (Codec::Ffv1, Layout::Gbr, 12, "gbrp12le"),
            (Codec::Av1, Layout::Yuv444, 10, "yuv444p10le"),
        ] {
            assert_eq!(chosen(codec, PixelFormat::opaque(layout, bits)), (name.to_owned(), Fit::Same));
        }
    }

    #[test]
    fn samples_are_only_moved_where_that_suffices() {
        let (name, fit) = chosen(Codec::Ffv1, PixelFormat::opaque(Layout::Gbr, 8));
        assert_eq!(fit, Fit::Packed, "{name}");
        let png = choose_still("png", PixelFormat { layout: Layout::Gbr, bits: 16, alpha: true }).expect("png");
        assert_eq!((png.pix.name().as_str(), png.fit), ("rgba64be", Fit::Packed));
    }

    #[test]
    fn the_nearest_format_is_taken_and_the_loss_is_named() {
        let twelve = PixelFormat::opaque(Layout::Yuv420, 12);
        let choice = first(Codec::H264, twelve);
        assert_eq!(choice.pix.name(), "yuv420p10le");
        assert_eq!(loss(twelve, choice.pix).as_deref(), Some("depth falls from 12 to 10 bit"));
        let alpha = PixelFormat { layout: Layout::Yuv420, bits: 8, alpha: true };
        let choice = first(Codec::H264, alpha);
        assert_eq!(choice.pix.name(), "yuv420p");
        assert_eq!(loss(alpha, choice.pix).as_deref(), Some("the alpha channel is dropped"));
        let choice = first(Codec::Prores, alpha);
        assert_eq!(choice.pix.name(), "yuva444p10le");
        assert_eq!(loss(alpha, choice.pix), None);
        let rgb = PixelFormat::opaque(Layout::Gbr, 8);
        let choice = first(Codec::H264, rgb);
        assert_eq!(choice.pix.name(), "yuv444p");
        assert_eq!(loss(rgb, choice.pix).as_deref(), Some("colors are converted to YUV"));
        let old = PixelFormat::opaque(Layout::Yuv411, 8);
        assert_eq!(loss(old, first(Codec::H264, old).pix), None);
    }

    #[test]
    fn an_encoder_that_does_not_exist_is_named_with_those_that_do() {
        let text = refusal(Codec::H264, &EncoderChoice::Named("h264_magic".into())).expect("refused");
        let expected = "no encoder for h264_magic: this FFmpeg was built without it; available: libx264";
        assert!(text.starts_with(expected), "{text}");
        let text = refusal(Codec::H264, &EncoderChoice::Named("ffv1".into())).expect("refused");
        assert!(
            text.starts_with("no encoder for ffv1: it is none of the encoders known for h264; available: "),
            "{text}"
        );
        let text = refusal(Codec::Ffv1, &EncoderChoice::Hardware).expect("refused");
        assert!(text.ends_with("(tried none: there is none for this codec); available: ffv1"), "{text}");
    }

    #[test]
    fn a_device_that_is_missing_is_refused_when_asked_for_and_passed_over_by_auto() {
        for codec in [Codec::H264, Codec::Hevc, Codec::Av1] {
            let devices: Vec<_> = encoders(codec).into_iter().filter(|e| e.hardware).collect();
            let choices = choose(codec, &EncoderChoice::Auto, PixelFormat::opaque(Layout::Yuv420, 8)).expect("one");
            assert_eq!(choices.len(), devices.len() + 1, "devices that open first, software last");
            assert!(choices.last().is_some_and(|c| software(codec).contains(&c.encoder.name().as_str())));
            if !devices.is_empty() {
                continue;
            }
            let text = refusal(codec, &EncoderChoice::Hardware).expect("refused");
            assert!(text.contains("on a device: no device for it works on this machine (tried "), "{text}");
            assert!(text.contains(&format!("available: {}", encoders(codec)[0].name)), "{text}");
            for name in hardware(codec).iter().filter(|n| find_encoder(n).is_some()) {
                let text = refusal(codec, &EncoderChoice::Named((*name).to_owned())).expect("refused");
                assert!(text.contains("the device for it is missing on this machine; available: "), "{text}");
            }
        }
    }
}
