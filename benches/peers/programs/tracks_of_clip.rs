//! Follows the points of a clip and prints their tracks as text, the input of `cameras_from_tracks`:
//! `tracks_of_clip CLIP [MAX_FRAMES]`.

use std::io::Write;

use plumbline::media::{Input, ReadOptions, VideoReader};
use plumbline::video::track::{FrameTracks, TrackOptions, Tracker};

pub(super) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = super::args().skip(1).collect();
    let [clip, ..] = args.as_slice() else { return Err("usage: tracks_of_clip CLIP [MAX_FRAMES]".into()) };
    let most = args.get(1).map_or(Ok(usize::MAX), |n| n.parse())?;
    let mut reader = VideoReader::open(&Input::parse(clip)?, &ReadOptions::default())?;
    let (width, height) = (reader.info().width, reader.info().height);
    let mut tracker = Tracker::new(width, height, TrackOptions::default(), None)?;
    let mut frames: Vec<FrameTracks> = Vec::new();
    while let Some(frame) = reader.next_frame()?.filter(|_| frames.len() < most) {
        frames.push(tracker.push(&frame));
    }
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    writeln!(out, "{width} {height} 30 {}", frames.len())?;
    for frame in &frames {
        writeln!(out, "F {}", frame.observations.len())?;
        for o in &frame.observations {
            writeln!(out, "{} {} {}", o.id, o.x, o.y)?;
        }
    }
    Ok(())
}
