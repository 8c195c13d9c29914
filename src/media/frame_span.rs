//! Some successive frames of a clip, by their times: what one of several processes reads or writes of it.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::av::{AvError, Packet};
use super::{Input, MediaError, error};
use plumbline_num::time::Timestamp;

/// Successive frames of a clip, by index and by the times that they must have.
///
/// # Example
/// ```
/// use plumbline_media::FrameSpan;
/// use plumbline_num::time::Timestamp;
///
/// let times = [0, 512, 1024, 1536].map(Timestamp);
/// let span = FrameSpan::of(&times, 1..3).expect("frames of the clip");
/// assert_eq!((span.start, span.last, span.end), (512, 1024, Some(1536)));
/// assert_eq!(FrameSpan::of(&times, 3..5), None);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FrameSpan {
    /// Indices of the frames in the clip.
    pub frames: Range<usize>,
    /// Time of the first, ticks.
    pub start: i64,
    /// Time of the last, ticks.
    pub last: i64,
    /// Time of the frame behind the last, ticks; `None` at the end of the clip.
    pub end: Option<i64>,
}

impl FrameSpan {
    /// The frames `frames` of the clip whose frames have these times; `None` where it has them not, or they are none.
    pub fn of(times: &[Timestamp], frames: Range<usize>) -> Option<Self> {
        let [start, .., last] = *times.get(frames.clone())? else {
            let [only] = *times.get(frames.clone())? else { return None };
            return Some(Self { start: only.0, last: only.0, end: times.get(frames.end).map(|t| t.0), frames });
        };
        Some(Self { start: start.0, last: last.0, end: times.get(frames.end).map(|t| t.0), frames })
    }

    /// Whether as many frames were there, with these times of the first and the last.
    pub fn is_of(&self, count: u64, first: i64, last: i64) -> bool {
        count == self.frames.len() as u64 && (first, last) == (self.start, self.last)
    }
}

/// Times of the frames of a clip in their order, by its packets: nothing is decoded. Decoding may give others where the clip is damaged,
/// which [`super::VideoReader::open_span`] reports.
///
/// # Errors
/// As of [`super::VideoReader::open`]; [`MediaError::Input`] for packets without a time, and two frames at the same time.
pub fn frame_times(input: &Input) -> Result<Vec<Timestamp>, MediaError> {
    let mut demuxer = input.demux()?;
    let refused = |problem: String| MediaError::input(input.name(), problem);
    let stream = input.video_of(&demuxer)?.ok_or_else(|| refused("has no video stream".to_owned()))?;
    (0..demuxer.stream_count()).filter(|i| *i != stream).for_each(|i| demuxer.discard(i));
    let (mut packet, mut times) = (Packet::new(), Vec::new());
    loop {
        match demuxer.read(&mut packet) {
            Ok(true) if packet.stream() != stream || packet.is_discarded() => {}
            Ok(true) => {
                let untimed = || refused(format!("packet {} has no time", times.len()));
                times.push(Timestamp(packet.pts().ok_or_else(untimed)?));
            }
            Ok(false) => break,
            Err(AvError::EXIT) => return Err(plumbline_num::run::Stopped::Interrupted.into()),
            Err(e) => {
                return Err(refused(format!("reading failed after {} packets: {}", times.len(), error::reason(e))));
            }
        }
    }
    times.sort_unstable();
    match times.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(refused(format!("two frames have the time {}", pair[0].0))),
        None => Ok(times),
    }
}
