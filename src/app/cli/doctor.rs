//! `plumbline doctor`: the program and the machine it runs on, as a report of a fault needs them.

use std::fmt::Write as _;
use std::io::IsTerminal;
use std::path::Path;

use super::print;
use crate::pipeline::Exit;
use crate::pipeline::cache::Cache;
use crate::pipeline::memory::human_bytes;
use crate::pipeline::options::RunSettings;
use crate::pipeline::paths::to_path;
use plumbline_media::{Codec, FfmpegBuild, encoders};

/// Limits of a process that runs have met, by their names in `/proc/self/limits`.
const LIMITS: [&str; 6] =
    ["Max address space", "Max data size", "Max processes", "Max open files", "Max file size", "Max stack size"];

/// Variables that change what the program does.
const VARIABLES: [&str; 9] = [
    "PLUMBLINE_LOG",
    "PLUMBLINE_CACHE",
    "TMPDIR",
    "LANG",
    "LC_ALL",
    "NO_COLOR",
    "TERM",
    "RAYON_NUM_THREADS",
    "LD_LIBRARY_PATH",
];

/// Prints the report.
pub(super) fn run() -> Exit {
    print(&report());
    Exit::Done
}

fn report() -> String {
    let mut text = String::new();
    let mut line = |name: &str, what: &str| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name:<12}{what}");
    };
    let build = if cfg!(debug_assertions) { "debug build" } else { "release build" };
    line("plumbline", &format!("{}, {build}", env!("CARGO_PKG_VERSION")));
    line("system", &system());
    let ffmpeg = FfmpegBuild::linked();
    line("FFmpeg", &ffmpeg.to_string());
    line("built with", &ffmpeg.configuration);
    for codec in Codec::ALL {
        let found: Vec<String> = encoders(codec).into_iter().map(|encoder| encoder.name).collect();
        let found = if found.is_empty() { "no encoder".to_owned() } else { found.join(", ") };
        line(codec.name(), &found);
    }
    line("fonts", "none used: texts in pictures are drawn by the program itself");
    line("temporary", &temporary());
    line("cache", &cache());
    for (name, limit) in limits() {
        line("limit", &format!("{name}: {limit}"));
    }
    for name in VARIABLES {
        if let Some(value) = std::env::var_os(name) {
            line("variable", &format!("{name}={}", value.display()));
        }
    }
    let terminal = |yes| if yes { "a terminal" } else { "no terminal" };
    let (out, err) = (std::io::stdout().is_terminal(), std::io::stderr().is_terminal());
    line("output", &format!("standard output is {}, standard error is {}", terminal(out), terminal(err)));
    text
}

fn system() -> String {
    let mut parts = vec![format!("{} {}", std::env::consts::OS, std::env::consts::ARCH)];
    let first_line = |path: &str| Some(std::fs::read_to_string(path).ok()?.lines().next()?.to_owned());
    parts.extend(first_line("/proc/sys/kernel/osrelease").map(|release| format!("kernel {release}")));
    parts.push(match std::thread::available_parallelism() {
        Ok(count) => format!("{count} processors"),
        Err(error) => format!("processors unknown ({error})"),
    });
    let memory = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    for (key, what) in [("MemTotal:", "memory"), ("MemAvailable:", "available")] {
        let found = memory.lines().find_map(|l| l.strip_prefix(key)?.trim().strip_suffix("kB")?.trim().parse().ok());
        parts.extend(found.map(|kb: f64| format!("{what} {:.1} GiB", kb / (1 << 20) as f64)));
    }
    parts.join(", ")
}

/// The folder for temporary files, and whether one can be made there.
fn temporary() -> String {
    let folder = std::env::temp_dir();
    match tempfile::tempfile_in(&folder) {
        Ok(_) => format!("{}, files can be made", folder.display()),
        Err(error) => format!("{}, no file can be made: {error}", folder.display()),
    }
}

/// The folder of the cache, and whether it can be used.
fn cache() -> String {
    let Some(used) = RunSettings::default().cache_use() else { return "none".to_owned() };
    let folder = to_path(&used.folder);
    let state = match Cache::existing(&folder, false).and_then(|cache| cache.map(|cache| cache.usage()).transpose()) {
        Ok(None) => "nothing in it yet".to_owned(),
        Ok(Some(usage)) => format!("{} results, {}", usage.entries, human_bytes(usage.bytes)),
        Err(error) => format!("not used: {error}"),
    };
    format!("{}, {state}", folder.display())
}

/// Name and value of each limit of this process; none where the system does not show them.
fn limits() -> Vec<(String, String)> {
    let text = std::fs::read_to_string(Path::new("/proc/self/limits")).unwrap_or_default();
    let limit = |name: &&str| {
        let rest = text.lines().find_map(|l| l.strip_prefix(*name))?;
        let mut words = rest.split_whitespace();
        let (soft, _hard, unit) = (words.next()?, words.next()?, words.next().unwrap_or_default());
        let soft = if soft == "unlimited" { soft.to_owned() } else { format!("{soft} {unit}") };
        Some((name.trim_start_matches("Max ").to_owned(), soft.trim_end().to_owned()))
    };
    LIMITS.iter().filter_map(limit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_report_names_program_libraries_encoders_and_limits() {
        let text = report();
        for word in ["plumbline", "FFmpeg", "avcodec", "--", "h264", "libx264", "temporary", "files can be made"] {
            assert!(text.contains(word), "{word}: {text}");
        }
        if cfg!(target_os = "linux") {
            assert!(text.contains("open files: ") && text.contains("kernel "), "{text}");
        }
    }
}
