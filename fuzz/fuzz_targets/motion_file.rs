//! A motion file of any bytes is refused or read, never a panic; what was read can be written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use plumbline::motion::ClipMotion;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(clip) = ClipMotion::from_json(bytes) {
        let mut text = Vec::new();
        if clip.write_json(&mut text).is_ok() {
            ClipMotion::from_json(&text).expect("own files are read");
        }
    }
});
