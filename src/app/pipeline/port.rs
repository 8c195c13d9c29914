//! Typed ports: what flows between stages.

use std::fmt;

/// What an edge carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PortType {
    /// Pictures of a clip with their times. A re-openable source, not a channel: each pass opens it anew.
    Frames,
    /// Everything of a clip that is not its picture: audio, subtitles, data, chapters and tags, copied untouched.
    Audio,
    /// Points followed through the frames.
    Tracks,
    /// How the camera moved from frame to frame.
    Motion,
    /// The virtual camera: where the picture shall be.
    Path,
    /// A map per frame from output to source; no pixel is touched yet.
    Warp,
    /// A still picture.
    Image,
    /// Lines of a picture that are straight in the world.
    Lines,
    /// Boxes around faces.
    Faces,
    /// The importance of each position of a picture.
    Importance,
    /// A surface of triangles, with what else its file contains, at rest and posed.
    Mesh,
    /// Joints in a forest, with movements of them.
    Skeleton,
    /// A file that was written.
    File,
}

impl PortType {
    /// It carries pixels.
    pub const fn is_picture(self) -> bool {
        matches!(self, Self::Frames | Self::Image)
    }

    /// The name in files, graphs and messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Frames => "frames",
            Self::Audio => "audio",
            Self::Tracks => "tracks",
            Self::Motion => "motion",
            Self::Path => "path",
            Self::Image => "image",
            Self::Lines => "lines",
            Self::Faces => "faces",
            Self::Importance => "importance",
            Self::Warp => "warp",
            Self::Mesh => "mesh",
            Self::Skeleton => "skeleton",
            Self::File => "file",
        }
    }
}

impl fmt::Display for PortType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How many edges an input port takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arity {
    /// Exactly one.
    One,
    /// None or one.
    Optional,
    /// One or more, in order.
    Many,
    /// Any number, in order; none will do.
    Any,
}

impl Arity {
    /// It takes a list.
    pub const fn is_list(self) -> bool {
        matches!(self, Self::Many | Self::Any)
    }

    /// It must be connected.
    pub const fn is_required(self) -> bool {
        matches!(self, Self::One | Self::Many)
    }
}

/// One port of a stage kind.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// Its name.
    pub name: &'static str,
    /// What it carries.
    pub data: PortType,
    /// How many edges it takes; outputs feed any number.
    pub arity: Arity,
    /// What it is for, in one line.
    pub doc: &'static str,
}

impl Port {
    /// An input that must be connected, or an output.
    pub const fn one(name: &'static str, data: PortType, doc: &'static str) -> Self {
        Self { name, data, arity: Arity::One, doc }
    }

    /// An input that may be left open.
    pub const fn optional(name: &'static str, data: PortType, doc: &'static str) -> Self {
        Self { name, data, arity: Arity::Optional, doc }
    }

    /// An input that takes a list, which may be empty.
    pub const fn any(name: &'static str, data: PortType, doc: &'static str) -> Self {
        Self { name, data, arity: Arity::Any, doc }
    }

    /// An input that takes a list.
    pub const fn many(name: &'static str, data: PortType, doc: &'static str) -> Self {
        Self { name, data, arity: Arity::Many, doc }
    }
}
