//! What the fuzz targets do with any bytes. The integration tests run the same on mutated examples, for toolchains without a
//! fuzzer.

use plumbline::motion::ClipMotion;
use plumbline::pipeline::{Source, print, read};

/// A motion file of any bytes is refused or read, never a panic; what was read can be written and read again.
pub(crate) fn motion_file(bytes: &[u8]) {
    if let Ok(clip) = ClipMotion::from_json(bytes) {
        let mut text = Vec::new();
        if clip.write_json(&mut text).is_ok() {
            ClipMotion::from_json(&text[..]).expect("own files are read");
        }
    }
}

/// Any bytes as a pipeline file: checked without a panic, every fault renderable, and what is accepted prints to itself.
pub(crate) fn pipeline_file(bytes: &[u8]) {
    let source = |text: String| Source { name: "fuzz.toml".into(), text, base: None };
    match read(source(String::from_utf8_lossy(bytes).into_owned()), &[]) {
        Err(problems) => {
            assert!(!problems.problems.is_empty());
            let _ = (problems.render(false, 80), problems.to_json());
        }
        Ok(pipeline) => {
            let again = read(source(print(&pipeline.file)), &[]).expect("what is printed is accepted");
            assert_eq!(again, pipeline);
        }
    }
}
