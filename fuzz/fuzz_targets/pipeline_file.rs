//! Any bytes as a pipeline file: checked without a panic, every fault renderable, and what is accepted prints to itself.

#![no_main]

use libfuzzer_sys::fuzz_target;
use plumbline::pipeline::{Source, print, read};

fuzz_target!(|bytes: &[u8]| {
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
});
