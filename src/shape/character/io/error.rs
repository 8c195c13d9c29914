//! What a file of a skeleton or of a movement can be refused for.

use crate::character::skeleton_file::SkeletonFileError;
use crate::character::{CharacterError, ClipError};
use crate::mesh::MeshError;

/// Why a file could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RigFileError {
    /// Input: a text that is not what its format asks for.
    #[error("{format}, line {line}: {fault}")]
    Malformed {
        /// The format.
        format: &'static str,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong, the value, and what to do.
        fault: String,
    },
    /// Input: a name whose extension is none of those that are read or written.
    #[error("not a skeleton file by its name's extension (expected {expected})")]
    UnknownFormat {
        /// Extensions that are known here.
        expected: &'static str,
    },
    /// Input: a model without anything that moves it.
    #[error(
        "the model has no skin and nothing that moves; give a skeleton and weights (`plumbline skeleton`, `plumbline skin weights` \
         make them)"
    )]
    NoSkin,
    /// Input: a node that no translation, rotation and scale hold.
    #[error("the matrix of node {node:?} shears; a joint can only be moved, turned and scaled")]
    Shear {
        /// Name of the node.
        node: String,
    },
    /// Input: two skins that bind one joint in ways that no single surface allows.
    #[error(
        "skin {skin} binds joint {joint:?} otherwise than the skins before it, and not by one map for all its joints"
    )]
    Bindings {
        /// The skin, numbered from 0.
        skin: usize,
        /// Name of the joint.
        joint: String,
    },
    /// Input: a skeleton that the format cannot hold.
    #[error("{format} cannot hold the skeleton: {fault}")]
    Unwritable {
        /// The format.
        format: &'static str,
        /// Why not.
        fault: String,
    },
    /// Input: a file beyond the limit.
    #[error("{bytes} bytes are too many (at most {most})")]
    TooLarge {
        /// Bytes of the file.
        bytes: u64,
        /// The most there may be.
        most: u64,
    },
    /// Input: what the joints, weights or frames are refused for.
    #[error(transparent)]
    Character(#[from] CharacterError),
    /// Input: what the movement is refused for.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// Input: what the surface is refused for.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Input: what our own skeleton file is refused for.
    #[error(transparent)]
    Skeleton(#[from] SkeletonFileError),
    /// Environment: the file cannot be read.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// One of the other faults, in this file.
    #[error("{path}: {fault}")]
    InFile {
        /// The file.
        path: String,
        /// What is wrong with it.
        fault: Box<RigFileError>,
    },
}

impl RigFileError {
    /// The same fault, of this file; those that name their file already stay.
    pub(super) fn of_file(self, path: &std::path::Path) -> Self {
        match self {
            Self::Mesh(MeshError::InFile { .. }) | Self::InFile { .. } => self,
            fault => Self::InFile { path: path.display().to_string(), fault: Box::new(fault) },
        }
    }
}
