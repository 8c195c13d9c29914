//! Files of marks in a picture: lines (`NAME.lines.json`) and faces (`NAME.faces.json`).
//!
//! ```json
//! {
//!   "format": "plumbline.lines", "version": 1, "pixel_center": 0.5,
//!   "source": { "width": 4000, "height": 3000 },
//!   "lines": [
//!     { "name": "door", "points": [[812.5, 640], [803.1, 1120.5], [801, 1702]], "orientation": "vertical" },
//!     { "name": "branch", "points": [[10, 20], [900, 30]], "off": true }
//!   ]
//! }
//! ```
//!
//! - `points`: two or more positions in the order in which they lie along the line. Two are the ends of a line whose course
//!   between them is given by the lens; more are measurements of it.
//! - `orientation`: how the line shall lie in the output: `"free"` (also `null`, or left out), `"horizontal"`, `"vertical"`,
//!   or an angle in degrees from +x towards +y (clockwise on a screen).
//! - `off`: the line is kept in the file and not used. What was found by itself can be saved, switched off by hand line by
//!   line, and read back.
//!
//! ```json
//! { "format": "plumbline.faces", "version": 1, "source": { "width": 4000, "height": 3000 },
//!   "faces": [ { "name": "left", "x": 1391, "y": 387, "w": 261, "h": 261 } ] }
//! ```
//!
//! A face is the rectangle from `(x, y)` to `(x + w, y + h)`, edges of pixels being integers.
//!
//! Positions are px of the source, pixel centers at integer + 0.5; a file that says `"pixel_center": 0` is shifted on
//! reading. Unknown keys, other versions, and a source of another size are refused. Bare lists are read as well, as other
//! programs write them: `[{"id", "points", "orientation": null | "h" | "v" | degrees}, …]` with centers at integers, and
//! `[{"id", "x", "y", "w", "h"}, …]`.

mod check;
mod faces;
mod header;
mod lines;
mod orientation;
#[cfg(test)]
mod tests;

#[cfg(feature = "schema")]
pub use faces::faces_schema;
pub use faces::{FacesFile, MarkedFace};
#[cfg(feature = "schema")]
pub use lines::lines_schema;
pub use lines::{LinesFile, MarkedLine};
