//! What a test needs and may be missing. A test that lacks something says so and passes on a developer's machine; where `CI`
//! is set it fails, so that no test passes there without having run.

use std::path::PathBuf;
use std::process::Command;

/// Whether a missing part is a failure.
fn in_ci() -> bool {
    std::env::var_os("CI").is_some_and(|v| !v.is_empty() && v != "false")
}

/// Reports that a test is skipped.
///
/// # Panics
/// Where `CI` is set.
pub(crate) fn skip(why: &str) {
    assert!(!in_ci(), "{why}, and CI is set: a test may not be skipped");
    eprintln!("skipped: {why}");
}

/// Whether the `ffmpeg` program runs; [`skip`]s where it does not.
pub(crate) fn has_ffmpeg() -> bool {
    let found = Command::new("ffmpeg").arg("-version").output().is_ok_and(|o| o.status.success());
    if !found {
        skip("the ffmpeg program is not on the path");
    }
    found
}

/// `path` in the folder of real media that `PLUMBLINE_MEDIA` names. `None`, with the reason printed, where the variable is
/// not set: real media are no part of the project, so that a clone without them passes in CI too.
///
/// # Panics
/// Where `CI` and the variable are set and the file is missing.
pub(crate) fn real_media(path: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("PLUMBLINE_MEDIA") else {
        eprintln!("skipped: {path} is not there (PLUMBLINE_MEDIA names the folder of real media, and is not set)");
        return None;
    };
    let found = PathBuf::from(folder).join(path);
    if !found.exists() {
        skip(&format!("{} does not exist", found.display()));
        return None;
    }
    Some(found)
}
