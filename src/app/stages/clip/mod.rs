//! What the kinds of clips have in common: the stream from the decoder to the encoders, and the maps that its frames pass through.

pub(crate) mod chain;
pub(crate) mod encoding;
mod filling;
pub(crate) mod sampling;
mod side_by_side;
pub(crate) mod sink;
pub(crate) mod stream;
pub(crate) mod summary;
