//! The options of [`WriteOptions`] in each encoder's own words.

use super::av::{Dictionary, EncoderSettings, Rational};
use super::encoder_choice::Choice;
use super::info::{Ratio, VideoInfo};
use super::{MediaError, WriteOptions};
use plumbline_image::ColorDescription;

/// Presets of x264, slowest last; other encoders' scales are mapped to them.
const PRESETS: [&str; 9] =
    ["ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow", "slower", "veryslow"];

/// Settings for an encoder of `choice`.
pub(super) fn settings(
    choice: &Choice,
    video: &VideoInfo,
    color: ColorDescription,
    options: &WriteOptions,
) -> Result<EncoderSettings, MediaError> {
    let name = choice.encoder.name();
    let unknown = Rational { num: 0, den: 1 };
    Ok(EncoderSettings {
        pix: choice.pix,
        width: video.width,
        height: video.height,
        time_base: video.av_timebase(),
        frame_rate: video.frame_rate.map_or(Rational { num: 25, den: 1 }, Ratio::av),
        sample_aspect: video.sample_aspect.map_or(unknown, Ratio::av),
        color,
        chroma_location: video.chroma_location,
        bit_rate: options.bitrate,
        threads: options.threads,
        global_header: false,
        options: dictionary(&name, video, options)?,
    })
}

fn dictionary(encoder: &str, video: &VideoInfo, options: &WriteOptions) -> Result<Dictionary, MediaError> {
    let refuse = |settings: &str, reason: &str| Err(MediaError::encoder_refused(encoder, settings, reason));
    let speed = match options.preset.as_deref() {
        None => None,
        Some(p) => match PRESETS.iter().position(|known| *known == p) {
            Some(i) => Some((p, i)),
            None => return refuse(&format!("preset \"{p}\""), &format!("one of {}", PRESETS.join(", "))),
        },
    };
    let scale = if encoder.contains("av1") { 63.0 } else { 51.0 };
    if let Some(crf) = options.crf.filter(|c| !(0.0..=scale).contains(c)) {
        return refuse(&format!("crf {crf}"), &format!("expected 0 to {scale}"));
    }
    if options.crf.is_some() && options.bitrate.is_some() {
        return refuse("both crf and bitrate", "give one of them");
    }
    let has_quality = !matches!(encoder, "ffv1" | "prores_ks" | "png" | "tiff" | "dpx" | "bmp" | "libopenh264");
    if options.crf.is_some() && !has_quality {
        return refuse("crf", "it has no constant-quality setting");
    }
    Ok(words(encoder, speed, video, options))
}

/// The options in the words of `encoder`; `speed` is the preset and its place in [`PRESETS`].
fn words(encoder: &str, speed: Option<(&str, usize)>, video: &VideoInfo, options: &WriteOptions) -> Dictionary {
    // Where a bit rate rules, no quality is given.
    let quality = |default: f64| options.bitrate.is_none().then(|| options.crf.unwrap_or(default));
    let crf = |default: f64| quality(default).map(|q| q.to_string());
    let whole = |default: f64| quality(default).map(|q| q.round().to_string());
    let step = |fast: f64, slow: f64| {
        speed.map(|(_, i)| (fast + (slow - fast) * i as f64 / (PRESETS.len() - 1) as f64).round().to_string())
    };
    let preset = speed.map(|(p, _)| p.to_owned());
    let hdr = super::hdr::x26x_parameters(&video.hdr, encoder);
    let words: Vec<(&str, Option<String>)> = match encoder {
        "libx264" => vec![("crf", crf(18.0)), ("preset", preset), ("x264-params", hdr)],
        "libx265" => {
            let pools = if options.threads > 0 { format!(":pools={}", options.threads) } else { String::new() };
            let hdr = hdr.map(|h| format!(":{h}")).unwrap_or_default();
            let params = format!("log-level=error{pools}{hdr}");
            vec![("crf", crf(20.0)), ("preset", preset), ("x265-params", Some(params))]
        }
        "libsvtav1" => vec![("crf", whole(25.0)), ("preset", step(12.0, 2.0))],
        "libaom-av1" => vec![("crf", whole(25.0)), ("cpu-used", step(8.0, 1.0)), ("row-mt", Some("1".into()))],
        "librav1e" => {
            vec![("qp", quality(25.0).map(|q| (q * 4.0).round().to_string())), ("speed", step(10.0, 1.0))]
        }
        "ffv1" => vec![("level", Some("3".into())), ("slicecrc", Some("1".into()))],
        "prores_ks" => vec![("vendor", Some("apl0".into()))],
        _ if encoder.ends_with("_nvenc") => {
            let preset = step(1.0, 7.0).map(|p| format!("p{p}"));
            vec![("cq", crf(20.0)), ("preset", preset), ("rc", Some("vbr".into()))]
        }
        _ if encoder.ends_with("_vaapi") => vec![("qp", whole(20.0))],
        _ if encoder.ends_with("_qsv") => vec![("global_quality", whole(20.0)), ("preset", preset)],
        _ => Vec::new(),
    };
    words.into_iter().filter_map(|(k, v)| Some((k.to_owned(), v?))).collect()
}
