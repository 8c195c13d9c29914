//! Frames from a decoder on a thread of its own, through a bounded queue.

use crossbeam::channel::{self, Receiver, Sender};

use crate::pipeline::job::Job;
use crate::pipeline::run_error::RunError;
use crate::pipeline::threads::start;
use plumbline_image::Frame;
use plumbline_media::{MediaError, ReadReport, VideoReader};

/// Frames that wait between two threads. Two keep both busy; more only cost memory.
pub(crate) const QUEUE: usize = 2;

/// Decodes until the end, or until nobody listens any more.
pub(crate) fn decode(mut reader: VideoReader, frames: &Sender<Frame>) -> Result<ReadReport, MediaError> {
    while let Some(frame) = reader.next_frame()? {
        if frames.send(frame).is_err() {
            break;
        }
    }
    Ok(reader.report())
}

/// Calls `body` with every frame of `reader`, in order, while the next ones are decoded; reports progress.
pub(crate) fn for_each_frame(
    job: &Job<'_>,
    reader: VideoReader,
    mut body: impl FnMut(Frame) -> Result<(), RunError>,
) -> Result<ReadReport, RunError> {
    let (sender, frames) = channel::bounded(QUEUE);
    std::thread::scope(|scope| {
        let decoder = start(scope, "decoder", move || decode(reader, &sender))?;
        let worked = work(job, &frames, &mut body);
        drop(frames);
        let report = decoder.join().map_err(|_| RunError::Internal("the decoder's thread failed".to_owned()))?;
        worked?;
        Ok(report?)
    })
}

/// Passes something on; a closed queue means that its reader failed and will say why.
pub(crate) fn hand_on<T>(queue: &Sender<T>, item: T) -> Result<(), RunError> {
    queue.send(item).map_err(|_| RunError::Interrupted)
}

fn work(
    job: &Job<'_>,
    frames: &Receiver<Frame>,
    body: &mut impl FnMut(Frame) -> Result<(), RunError>,
) -> Result<(), RunError> {
    for (done, frame) in frames.iter().enumerate() {
        job.check_cancel()?;
        body(frame)?;
        job.progress.frames(done as u64 + 1);
    }
    Ok(())
}
