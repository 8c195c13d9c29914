//! Why a template does not fit.

use crate::character::CharacterError;
use plumbline_num::run::Stopped;

/// Why a template was not fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// Input: a template that has no extent.
    #[error("the template has {joints} joints in one place; to be fitted it needs two joints apart")]
    Template {
        /// Its joints.
        joints: usize,
    },
    /// Input: a curve that has no extent.
    #[error(
        "the curve in the middle has {nodes} nodes and no limb longer than it is thick: a template needs a surface with limbs; leave it out, or fit it to \
         another mesh"
    )]
    Curve {
        /// Its nodes.
        nodes: usize,
    },
    /// Input: a node with a number that is not finite.
    #[error("node {node} of the curve is not finite")]
    NotFinite {
        /// The node.
        node: usize,
    },
    /// Input: an edge to a node that does not exist.
    #[error("an edge of the curve ends at node {node}, but there are {nodes}, numbered from 0")]
    NoSuchNode {
        /// Number of the node.
        node: u32,
        /// Nodes of the curve.
        nodes: usize,
    },
    /// Numerics: frames that are none.
    #[error(transparent)]
    Character(#[from] CharacterError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}
