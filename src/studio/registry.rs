//! The workspaces, and which of them opens which file.

use std::io;
use std::path::Path;
use std::sync::Arc;

use crate::content::Content;
use crate::session::{Document, Surroundings};
use crate::workspace::Workspace;

/// A kind of document.
#[derive(Clone, Copy)]
pub struct Kind {
    /// Name of the workspace.
    pub name: &'static str,
    /// Whether it opens a file of this content.
    pub opens: fn(&Content) -> bool,
    /// Begins to open a file, under an id.
    pub start: fn(&str, &Path, Surroundings) -> io::Result<Arc<Document>>,
}

impl std::fmt::Debug for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

#[cfg_attr(not(any(test, debug_assertions)), allow(dead_code))]
const fn kind<W: Workspace>(opens: fn(&Content) -> bool) -> Kind {
    Kind { name: W::NAME, opens, start: Document::open::<W> }
}

/// All kinds. The first that opens a file has it.
pub const KINDS: &[Kind] = &[
    kind::<crate::character::CharacterWorkspace>(|content| {
        *content == Content::Character || content.has_stage(&["character.pose"])
    }),
    kind::<crate::mesh::MeshWorkspace>(|content| *content == Content::Mesh || content.has_stage(&["mesh.deform"])),
    kind::<crate::photo::PhotoWorkspace>(|content| *content == Content::Photo || content.has_stage(&["photo.rectify"])),
    #[cfg(any(test, debug_assertions))]
    kind::<crate::fake::Fake>(|content| *content == Content::Fake),
];

/// The kind of document that a file of this content is.
pub fn kind_of(content: &Content) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| (kind.opens)(content))
}
