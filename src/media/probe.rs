//! What a media file holds.

use super::av::{Demuxer, Kind};

/// Kinds of the streams in words, as in "audio, subtitle".
pub(super) fn kinds(demuxer: &Demuxer) -> String {
    let names: Vec<_> = demuxer.streams().map(|s| kind_name(s.kind())).collect();
    if names.is_empty() { "nothing".into() } else { names.join(", ") }
}

/// A kind in words.
pub(super) fn kind_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Video => "video",
        Kind::Audio => "audio",
        Kind::Subtitle => "subtitle",
        Kind::Data => "data",
        Kind::Attachment => "attachment",
        Kind::Other => "unknown",
    }
}
