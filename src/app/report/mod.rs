//! Reports: of a clip on one page with figures, plots and pictures in a single HTML file; of photos and meshes as tables; all as JSON too.
//!
//! Data in, bytes out: nothing is measured here, and nothing is fetched by the page: style, plots (SVG) and pictures (JPEG as
//! `data:` addresses) are inside it, and it forbids the browser to look anywhere else. There is no script. The page is well-formed
//! XML too, so that programs can read it.
//!
//! Plots keep their labels at the size of the text at any width: only the plotted area is stretched, by a nested `svg` whose
//! lines keep their width; labels are placed by percentages around it.

mod axis;
mod cameras;
mod color;
mod data;
mod document;
mod escape;
mod figures;
mod page;
mod pictures;
mod plot;
mod segments;
mod timeline;

pub use data::{Cameras, Change, Chart, Clip, Crop, Curve, Curves, Moment, Outcome, Report, Segment, ShotVerdict};
pub use document::{ReportFormat, document};
pub use page::page;
pub use pictures::{Picture, View};
