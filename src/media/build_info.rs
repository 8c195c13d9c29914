//! Which FFmpeg runs: for reports of faults.

use std::fmt;

use super::av::build;

/// The FFmpeg that is linked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FfmpegBuild {
    /// Version as a whole, such as `5.1.6`.
    pub release: String,
    /// Libraries with major, minor and micro version.
    pub libraries: Vec<(&'static str, [u32; 3])>,
    /// Options that it was built with.
    pub configuration: String,
    /// License that these options put it under.
    pub license: String,
}

impl FfmpegBuild {
    /// Asks the libraries.
    ///
    /// ```
    /// let ffmpeg = plumbline_media::FfmpegBuild::linked();
    /// assert!(ffmpeg.libraries.iter().any(|(name, [major, ..])| *name == "avcodec" && *major >= 59));
    /// ```
    pub fn linked() -> Self {
        Self {
            release: build::release(),
            libraries: build::libraries().to_vec(),
            configuration: build::configuration(),
            license: build::license(),
        }
    }
}

impl fmt::Display for FfmpegBuild {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {}", self.release, self.license)?;
        self.libraries.iter().try_for_each(|(name, [a, b, c])| write!(f, ", {name} {a}.{b}.{c}"))
    }
}
