//! Decodes a clip and encodes it again, everything else passed through: `transcode IN OUT [CRF] [PRESET] [THREADS]`.
//!
//! Decode and encode run on threads of their own, joined by a bounded channel, as a program that works on the frames in
//! between would do.

use plumbline::media::{Input, MediaError, Output, ReadOptions, VideoReader, VideoWriter, WriteOptions};

/// Frames that wait between the threads: enough to even out, few enough to be nothing in memory.
const QUEUE: usize = 4;

pub(super) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = super::args().skip(1).collect();
    let [from, to, ..] = args.as_slice() else {
        return Err("usage: transcode IN OUT [CRF] [PRESET] [THREADS]".into());
    };
    let threads = args.get(4).map_or(Ok(0), |t| t.parse())?;
    let input = Input::parse(from)?;
    let mut reader = VideoReader::open(&input, &ReadOptions { threads, ..ReadOptions::default() })?;
    let options = WriteOptions {
        crf: args.get(2).map(|c| c.parse()).transpose()?,
        preset: args.get(3).cloned(),
        threads,
        overwrite: true,
        ..WriteOptions::default()
    };
    let mut writer = VideoWriter::create(&Output::parse(to), &input, reader.info(), &options)?;
    let (send, frames) = crossbeam::channel::bounded(QUEUE);
    let (read, written) = std::thread::scope(|scope| {
        let decoding = scope.spawn(move || -> Result<_, MediaError> {
            while let Some(frame) = reader.next_frame()? {
                if send.send(frame).is_err() {
                    break;
                }
            }
            Ok(reader.report())
        });
        let written = frames.into_iter().try_for_each(|frame| writer.write(frame)).and_then(|()| writer.finish());
        (decoding.join(), written)
    });
    let read = read.map_err(|_| "the decoding thread panicked")??;
    let written = written?;
    eprintln!("read {read}; wrote {} frames with {}", written.frames, written.encoder);
    written.warnings.iter().for_each(|w| eprintln!("warning: {w}"));
    Ok(())
}
