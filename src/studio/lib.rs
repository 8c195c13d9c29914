//! The studio: meshes, characters and photos edited by hand in the browser, over the same engine.
//!
//! A document is a value ([`workspace::Workspace::Document`]): what a pipeline file and its side files say. An edit is a function from a
//! document to another one; the history is a list of documents. What can be computed again (a factor, a solved surface) belongs to
//! the workspace, and is brought up to date in slices on the thread of the document ([`session`]). The page draws; it solves nothing.

mod browser;
pub mod character;
pub mod command;
pub mod content;
pub mod downloads;
pub mod error;
#[cfg(any(test, debug_assertions))]
mod fake;
pub mod files;
pub mod history;
pub mod mesh;
pub mod outbox;
pub mod photo;
mod pipeline_file;
pub mod protocol;
pub mod recovery;
pub mod registry;
pub mod secret;
pub mod server;
pub mod session;
mod tar;
mod watched;
pub mod workspace;
