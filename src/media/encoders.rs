//! Which encoders there are on this machine: built in *and* able to open.
//!
//! FFmpeg lists device encoders on machines that have no such device. Each of these is therefore opened once on a small
//! picture; those in software need no trial.

use serde::Serialize;

use super::av::{Dictionary, Encoder, EncoderSettings, Rational, find_encoder};
use super::encoder_choice::{choose, fit, hardware, software};
use super::{Codec, EncoderChoice, MediaError};
use plumbline_image::{ColorDescription, Layout, PixelFormat};

/// An encoder that works here.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct EncoderInfo {
    /// FFmpeg's name, as [`super::WriteOptions::encoder`] takes it.
    pub name: String,
    /// Runs on a device.
    pub hardware: bool,
}

/// The encoders of `codec` that work on this machine, the preferred one first.
pub fn encoders(codec: Codec) -> Vec<EncoderInfo> {
    let info = |name: &&'static str, hardware| EncoderInfo { name: (*name).to_owned(), hardware };
    let software = software(codec).iter().filter(|n| find_encoder(n).is_some()).map(|n| info(n, false));
    let hardware = hardware(codec).iter().filter(|n| opens(n)).map(|n| info(n, true));
    software.chain(hardware).collect()
}

/// Side of the test picture, px: above the minimum of every device.
const TRIAL: usize = 256;

/// Refuses an encoder that is not available on this machine.
///
/// # Errors
/// [`MediaError::Usage`], with the encoders that there are.
pub fn check_encoder(codec: Codec, choice: &EncoderChoice) -> Result<(), MediaError> {
    choose(codec, choice, PixelFormat::opaque(Layout::Yuv420, 8)).map(drop)
}

/// True where the encoder of this name opens on a small picture.
pub(super) fn opens(name: &str) -> bool {
    let format = PixelFormat::opaque(Layout::Yuv420, 8);
    let Some(choice) = find_encoder(name).and_then(|e| fit(e, format)) else { return false };
    let settings = EncoderSettings {
        pix: choice.pix,
        width: TRIAL,
        height: TRIAL,
        time_base: Rational { num: 1, den: 25 },
        frame_rate: Rational { num: 25, den: 1 },
        sample_aspect: Rational { num: 1, den: 1 },
        color: ColorDescription::default(),
        chroma_location: 0,
        bit_rate: None,
        threads: 1,
        global_header: false,
        options: Dictionary::new(),
    };
    Encoder::open(choice.encoder, settings).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_codec_has_an_encoder_in_software_and_devices_come_last() {
        for codec in Codec::ALL {
            let found = encoders(codec);
            assert!(found.first().is_some_and(|e| !e.hardware), "{codec:?}: {found:?}");
            assert!(found.is_sorted_by_key(|e| e.hardware));
        }
    }
}
