//! `video.stmap`: the map of each frame as a picture, sampled where the renderer would sample it.
//!
//! The pixel at column `i`, row `j` of the output contains the position `(x, y)` of the source from which its center
//! `(i + ½, j + ½)` comes:
//!
//! ```text
//! R = x / W,      G = 1 − y / H,
//! ```
//!
//! both −1 where the map is not defined. A map without any warp is therefore `R = (i + ½)/W`, `G = 1 − (j + ½)/H`.

use std::fs::File;
use std::path::Path;

use rayon::prelude::*;

use super::clip::chain::Chain;
use super::clip::stream::for_each_frame;
use super::files::cannot;
use super::prelude::*;
use crate::pipeline::paths::to_path;
use plumbline_image::warp::Lattice;
use plumbline_image::write_exr;
use plumbline_num::files::AtomicFile;
use plumbline_num::math::Point2;

/// Settings of `video.stmap`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StMapSettings {
    /// The folder to fill with `frame_000000.exr`, `frame_000001.exr`, …
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// The picture may not show anything outside the source, as where `video.render` has `border = "crop"`
    pub keep_inside: bool,
}

impl Default for StMapSettings {
    fn default() -> Self {
        Self { path: String::new(), keep_inside: true }
    }
}

impl Stage for StMapSettings {
    const KIND: &'static str = "video.stmap";
    const SUMMARY: &'static str = "writes each frame's map as a 32-bit EXR: R = x/W, G = 1 − y/H of the source";
    const INPUTS: &'static [Port] = &[
        Port::one("frames", PortType::Frames, "the pictures that the maps are of"),
        Port::many("warps", PortType::Warp, "maps, applied in this order and composed"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the files")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        // Two floats per pixel, and the library's blocks of them, for as many frames as threads; eight of them as a bound.
        vec![MemoryCost { what: "maps being written", bytes_per_px: 8.0 * 16.0, ..MemoryCost::default() }]
    }

    fn fills(&self) -> Vec<&str> {
        vec![&self.path]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let source = context.required(stage, "frames")?.from;
        let folder = to_path(&self.path);
        let (input, reader) = context.open(source)?;
        let chain = Chain::of(context, stage, self.keep_inside)?;
        chain.check(input.name(), reader.info())?;
        context.job.progress.begin(context.pass.index, "maps", chain.frames().or(reader.info().frames_estimate));
        let size = (reader.info().width, reader.info().height);
        let models = chain.models(&context.job.run())?;
        let mut maps = chain.maps(models.as_ref(), reader.info())?;
        let unfinished = begin(&folder)?;
        let (mut waiting, mut written) = (Vec::new(), 0);
        let report = for_each_frame(context.job, reader, |frame| {
            waiting.push(maps.next(&frame)?);
            if waiting.len() == context.job.threads.min(AT_ONCE) {
                write_all(&mut waiting, &mut written, unfinished.path(), size)?;
            }
            Ok(())
        })?;
        write_all(&mut waiting, &mut written, unfinished.path(), size)?;
        chain.check_length(input.name(), report.frames)?;
        context.job.publishing(unfinished.path(), &folder)?;
        unfinished.publish_into(&folder, context.job.if_exists()).map_err(|e| cannot(&folder, &e))?;
        context.summary.outputs.push(folder);
        Ok(HandedOn)
    }

    fn preflight(&self) -> Result<(), RunError> {
        begin(&to_path(&self.path)).map(drop)
    }
}

/// Most maps that are written at once.
const AT_ONCE: usize = 8;

/// Writes the maps that wait, the first of which is number `written`.
fn write_all(
    waiting: &mut Vec<Lattice>,
    written: &mut usize,
    folder: &Path,
    source: (usize, usize),
) -> Result<(), RunError> {
    let write = |(k, lattice): (usize, &Lattice)| {
        let path = folder.join(format!("frame_{:06}.exr", *written + k));
        let (red, green) = channels(lattice, source);
        let file = File::create(&path).map_err(|e| cannot(&path, &e))?;
        write_exr(lattice.size(), [("R", red), ("G", green)], file).map_err(|e| cannot(&path, &e))
    };
    waiting.par_iter().enumerate().try_for_each(write)?;
    *written += waiting.len();
    waiting.clear();
    Ok(())
}

/// `R` and `G` of every pixel, row by row, for a source of so many px.
fn channels(lattice: &Lattice, source: (usize, usize)) -> (Vec<f32>, Vec<f32>) {
    let (width, height) = lattice.size();
    let position = |i: usize, j: usize| lattice.src_from_out(Point2::new(i as f64 + 0.5, j as f64 + 0.5));
    let value = |(i, j)| {
        let shown = position(i, j).map(|p| ((p.x / source.0 as f64) as f32, (1.0 - p.y / source.1 as f64) as f32));
        shown.unwrap_or((-1.0, -1.0))
    };
    (0..height).flat_map(|j| (0..width).map(move |i| (i, j))).map(value).unzip()
}

/// Starts the folder whose files will go to `folder`.
fn begin(folder: &Path) -> Result<AtomicFile, RunError> {
    AtomicFile::sequence_in(folder).map_err(|e| cannot(folder, &e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::warp::WarpField;
    use plumbline_num::math::{Homography, Similarity2, Vec2};

    #[test]
    fn a_map_that_moves_nothing_holds_the_pixels_own_places() {
        let field = WarpField::from_forward_homography(&Homography::identity()).expect("regular");
        let (red, green) = channels(&Lattice::new(&field, 50, 30), (50, 30));
        for j in 0..30 {
            for i in 0..50 {
                let expected = ((i as f64 + 0.5) / 50.0, 1.0 - (j as f64 + 0.5) / 30.0);
                assert_eq!((red[50 * j + i], green[50 * j + i]), (expected.0 as f32, expected.1 as f32));
            }
        }
    }

    #[test]
    fn a_picture_moved_to_the_right_comes_from_the_left_and_up_is_more() {
        let moved = Similarity2 { t: Vec2::new(5.0, 3.0), ..Similarity2::IDENTITY }.to_homography();
        let field = WarpField::from_forward_homography(&moved).expect("regular");
        let (red, green) = channels(&Lattice::new(&field, 50, 30), (50, 30));
        assert!((red[50 * 10 + 20] - 15.5 / 50.0).abs() < 1e-6);
        assert!((green[50 * 10 + 20] - (1.0 - 7.5 / 30.0)).abs() < 1e-6);
    }
}
