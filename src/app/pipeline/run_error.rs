//! Why an instance failed, and whose fault it is.

use super::problem::Problems;
use plumbline_media::{Fault, MediaError};
use plumbline_num::limits::Shortage;
use plumbline_num::run::Stopped;
use plumbline_photo::PhotoError;
use plumbline_shape::character::CharacterError;
use plumbline_shape::morph::MorphError;
use plumbline_shape::surface::SurfaceError;
use plumbline_video::stabilize::StabilizeError;

/// Why an instance failed. The message says what, where, the value, the allowed range and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The pipeline or the command line is wrong.
    #[error("{0}")]
    Config(Problems),
    /// The options do not fit the clip or the file to write.
    #[error("{0}")]
    Usage(String),
    /// The input is missing, damaged or of an unsupported kind.
    #[error("{0}")]
    Input(String),
    /// The output cannot be written.
    #[error("{0}")]
    Output(String),
    /// Something outside failed that may work next time: memory, threads, a busy device.
    #[error("{0}")]
    Temporary(String),
    /// The user stopped the run.
    #[error("interrupted; nothing was left under the final name")]
    Interrupted,
    /// A fault of this program.
    #[error("internal error: {0}; please report it")]
    Internal(String),
}

/// Exit statuses of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// All done.
    Done = 0,
    /// A fault of this program.
    Internal = 1,
    /// Bad command line or pipeline file.
    Usage = 2,
    /// Finished, some items failed.
    Partial = 3,
    /// A plan of another version, or whose input changed.
    OtherPlan = 4,
    /// Bad input.
    Input = 65,
    /// Cannot write.
    Output = 73,
    /// Try again.
    Temporary = 75,
    /// Stopped by SIGHUP: its terminal was closed.
    HungUp = 129,
    /// Stopped by Ctrl-C.
    Interrupted = 130,
    /// Stopped by SIGTERM.
    Terminated = 143,
}

impl From<Stopped> for RunError {
    fn from(stopped: Stopped) -> Self {
        match stopped {
            Stopped::Interrupted => Self::Interrupted,
            Stopped::OutOfTime => Self::Temporary(stopped.to_string()),
        }
    }
}

/// A temporary failure where an error says that the process has too little of something, else `fault`.
fn shortage_or(error: &(dyn std::error::Error + 'static), fault: fn(String) -> RunError) -> RunError {
    match Shortage::of(error) {
        Some(shortage) => RunError::Temporary(format!("{error} ({shortage})")),
        None => fault(error.to_string()),
    }
}

impl From<PhotoError> for RunError {
    fn from(error: PhotoError) -> Self {
        match error {
            PhotoError::Interrupted(stopped) => stopped.into(),
            PhotoError::Option(_) | PhotoError::Output(_) => Self::Usage(error.to_string()),
            _ => shortage_or(&error, Self::Input),
        }
    }
}

impl From<StabilizeError> for RunError {
    fn from(error: StabilizeError) -> Self {
        match error {
            StabilizeError::Interrupted(stopped) => stopped.into(),
            StabilizeError::Options(text) => Self::Usage(text),
            StabilizeError::PathFileWithoutCameras => {
                let wanted = "`cameras = true` on video.motion, and its tracks here";
                Self::Input(format!("a path file needs the cameras of the clip: {wanted}"))
            }
            StabilizeError::Store(_) => Self::Temporary(error.to_string()),
            _ => shortage_or(&error, Self::Input),
        }
    }
}

impl From<MediaError> for RunError {
    fn from(error: MediaError) -> Self {
        if let MediaError::Interrupted(stopped) = error {
            return stopped.into();
        }
        let text = error.to_string();
        match error.fault() {
            Fault::Usage => Self::Usage(text),
            Fault::Input => Self::Input(text),
            Fault::Output => Self::Output(text),
            Fault::Environment => Self::Temporary(text),
            Fault::Internal => Self::Internal(text),
        }
    }
}

impl From<SurfaceError> for RunError {
    fn from(error: SurfaceError) -> Self {
        match error {
            SurfaceError::Interrupted(stopped) => stopped.into(),
            SurfaceError::Option { .. } | SurfaceError::Convergence(_) => Self::Usage(error.to_string()),
            other => shortage_or(&other, Self::Input),
        }
    }
}

impl From<MorphError> for RunError {
    fn from(error: MorphError) -> Self {
        match error {
            MorphError::Interrupted(stopped) => stopped.into(),
            other => shortage_or(&other, Self::Input),
        }
    }
}

impl From<CharacterError> for RunError {
    fn from(error: CharacterError) -> Self {
        match error {
            CharacterError::Interrupted(stopped) => stopped.into(),
            CharacterError::Option(_) => Self::Usage(error.to_string()),
            other => shortage_or(&other, Self::Input),
        }
    }
}

impl RunError {
    /// Names the file or mesh `what` in a fault of the input; other errors stay as they are.
    #[must_use]
    pub fn about(self, what: impl std::fmt::Display) -> Self {
        match self {
            Self::Input(text) => Self::Input(format!("{what}: {text}")),
            other => other,
        }
    }

    /// The error that it is: where a library reports in words what the system said, a limit of this process is not the
    /// fault of input or output.
    #[must_use]
    pub(crate) fn settled(self) -> Self {
        let (Self::Input(text) | Self::Output(text) | Self::Usage(text) | Self::Internal(text)) = &self else {
            return self;
        };
        match Shortage::in_text(text) {
            Some(shortage) => Self::Temporary(format!("{text} ({shortage})")),
            None => self,
        }
    }

    /// The exit status, which says whose fault it is.
    pub fn exit(&self) -> Exit {
        match self {
            Self::Config(_) | Self::Usage(_) => Exit::Usage,
            Self::Input(_) => Exit::Input,
            Self::Output(_) => Exit::Output,
            Self::Temporary(_) => Exit::Temporary,
            Self::Interrupted => Exit::Interrupted,
            Self::Internal(_) => Exit::Internal,
        }
    }

    /// What it says, without what its display adds; [`RunError::of_message`] makes it whole again.
    pub(super) fn into_message(self) -> String {
        match self {
            Self::Internal(text) => text,
            other => other.to_string(),
        }
    }

    /// The error of a fault with this exit status.
    pub(super) fn of_message(exit: u8, text: String) -> Self {
        let is = |known: Exit| exit == known as u8;
        match text {
            _ if is(Exit::Interrupted) || is(Exit::Terminated) || is(Exit::HungUp) => Self::Interrupted,
            text if is(Exit::Usage) => Self::Usage(text),
            text if is(Exit::Input) => Self::Input(text),
            text if is(Exit::Output) => Self::Output(text),
            text if is(Exit::Temporary) => Self::Temporary(text),
            text => Self::Internal(text),
        }
    }

    /// Another try may succeed.
    pub fn is_temporary(&self) -> bool {
        matches!(self, Self::Temporary(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::warp::WarpError;
    use plumbline_num::energy::EnergyError;
    use plumbline_num::limits::Resource;
    use plumbline_num::sparse::SparseError;

    #[test]
    fn too_little_memory_in_a_solver_is_temporary_whatever_error_it_is_wrapped_in() {
        let factor = || SparseError::OutOfMemory { unknowns: 7, source: Shortage(Resource::Memory) };
        let warp = || WarpError::Energy(EnergyError::Solve(factor()));
        let all: [RunError; 7] = [
            SurfaceError::Solve(factor()).into(),
            CharacterError::Solve(factor()).into(),
            CharacterError::Surface(SurfaceError::Solve(factor())).into(),
            MorphError::Numerics(factor()).into(),
            PhotoError::Energy(EnergyError::Solve(factor())).into(),
            PhotoError::Warp(warp()).into(),
            StabilizeError::Warp { frame: 3, reason: warp() }.into(),
        ];
        for error in all {
            let text = error.to_string();
            assert_eq!(error.exit(), Exit::Temporary, "{text}");
            assert!(text.contains("out of memory for the factor of 7 unknowns"), "{text}");
            assert!(text.ends_with(&format!("({})", Shortage(Resource::Memory))), "{text}");
        }
        let other = RunError::from(SurfaceError::Solve(SparseError::Pivot { unknown: 7 }));
        assert_eq!(other.exit(), Exit::Input, "{other}");
    }
}
