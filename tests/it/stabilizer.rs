//! The stabilizer as a library: the same maps as the program, without graph and command line.

use std::path::Path;

use plumbline::image::Frame;
use plumbline::image::render::{Border, Interpolation, RenderOptions, Renderer};
use plumbline::image::warp::Lattice;
use plumbline::media::{self, Input, MediaError, Ratio, ReadOptions, VideoReader};
use plumbline::num::run::Run;
use plumbline::video::stabilize::{ClipInfo, FrameSource, ModelChoice, Stabilizer, StabilizerOptions};

use crate::support::clips::workshop;
use crate::support::program::succeed;

/// A clip read by FFmpeg.
struct Clip(Input);

impl Clip {
    fn open(path: &Path, end_s: Option<f64>) -> Self {
        let input = Input::parse(path.to_str().expect("a plain path")).expect("a clip");
        Self(input.trimmed(None, end_s).expect("a span"))
    }

    fn reader(&self) -> Result<VideoReader, MediaError> {
        VideoReader::open(&self.0, &ReadOptions::default())
    }
}

impl FrameSource for Clip {
    type Error = MediaError;

    fn info(&self) -> ClipInfo {
        let reader = self.reader().expect("opens");
        let video = reader.info();
        ClipInfo {
            frame_rate: video.frame_rate.map(Ratio::value),
            frames: video.frames_estimate,
            focal_px: media::probe(&self.0).ok().and_then(|p| p.focal_px()),
            ..ClipInfo::new(video.width, video.height, video.timebase)
        }
    }

    fn frames(&self) -> Result<impl Iterator<Item = Result<Frame, MediaError>>, MediaError> {
        let mut reader = self.reader()?;
        Ok(std::iter::from_fn(move || reader.next_frame().transpose()))
    }
}

/// All samples of a frame, plane by plane.
fn samples(frame: &Frame) -> Vec<Vec<u8>> {
    let rows = |i: usize| {
        let plane = frame.plane8(i).expect("8 bit");
        (0..plane.height()).flat_map(|y| plane.row(y).to_vec()).collect()
    };
    (0..frame.format.planes()).map(rows).collect()
}

#[test]
fn the_library_renders_what_the_program_renders_bit_for_bit() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let walk = Path::new(env!("CARGO_MANIFEST_DIR")).join("media/street-walk.mp4");
    let clip = walk.to_str().expect("a plain path");
    for mode in [ModelChoice::Auto, ModelChoice::Mesh] {
        let word = mode.to_string();
        let args = ["stabilize", clip, "-o", "steady.mkv", "--codec", "ffv1", "--end", "1.6", "--overwrite"];
        succeed(folder, &[&args[..], &["--mode", &word]].concat());
        let rendered = Clip::open(&folder.join("steady.mkv"), None);

        let source = Clip::open(&walk, Some(1.6));
        let mut options = StabilizerOptions::default();
        options.warp.mode = mode;
        options.motion.cameras = mode == ModelChoice::Auto;
        let stabilizer = Stabilizer::new(options).expect("in range");
        let analysis = stabilizer.analyze(&source, &Run::default()).expect("a clip with texture");
        let plan = stabilizer.plan(&analysis, &Run::default()).expect("a path");
        let mut maps = plan.maps().expect("a grid");
        let renderer =
            Renderer::new(RenderOptions { interpolation: Interpolation::Bicubic, border: Border::Replicate });
        let mut compared = 0;
        for (frame, expected) in source.frames().expect("opens").zip(rendered.frames().expect("opens")) {
            let (frame, expected) = (frame.expect("a frame"), expected.expect("a frame"));
            let map = maps.next(&frame).expect("a map");
            let size = (frame.width, frame.height);
            let mut result = Frame::new(frame.format, frame.width, frame.height);
            renderer.render(&frame, &Lattice::between(&map, size, size), &mut result).expect("one format");
            assert!(samples(&result) == samples(&expected), "{mode}, frame {compared}");
            compared += 1;
        }
        assert_eq!(compared, 48, "{mode}");
    }
}
