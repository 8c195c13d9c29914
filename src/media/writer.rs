//! Streaming encode: frames in, a finished file out, with everything else of the source in it.
//!
//! The encoder runs in the source's own time base, so that every frame keeps its timestamp to the tick as far as the
//! container can say it. Frames from [`VideoWriter::new_frame`] come from a pool and go to the encoder without a copy; so do
//! frames straight from a reader. Packets of the other streams are fetched by the [`Copier`] as the video advances.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use super::av::{Demuxer, Dictionary, Encoder, Muxer, OutputFormat, Packet, Rational};
use super::copier::Copier;
use super::encoder_choice::{Choice, choose, choose_still, loss};
use super::encoder_settings::settings;
use super::error::reason;
use super::info::{VideoInfo, describe};
use super::output::Partial;
use super::part::{PartHeader, PartReader, Seam, write_end, write_packet};
use super::surface::Surface;
use super::{FrameSpan, Input, MediaError, Output, PassthroughStreams, WriteOptions, WriteReport, av};
use plumbline_image::Frame;
use plumbline_num::files::{AtomicFile, IfExists};

/// A file being written.
pub struct VideoWriter {
    encoder: Encoder,
    muxer: Option<Muxer>,
    copier: Option<Copier>,
    partial: Partial,
    output: Output,
    surface: Surface,
    info: VideoInfo,
    video_stream: usize,
    /// Durations by time, for encoders that lose them.
    durations: HashMap<i64, i64>,
    shift: i64,
    packet: Packet,
    /// The part file that the packets go to instead of a container.
    part: Option<BufWriter<File>>,
    /// Parts that were appended.
    seam: Seam,
    report: WriteReport,
}

/// A file that is whole and has no name yet; dropped without [`SealedVideo::publish`] it is removed.
#[derive(Debug)]
pub struct SealedVideo {
    partial: Partial,
    report: WriteReport,
}

impl SealedVideo {
    /// Where the file is, or the folder with the files of a sequence, and the name or the pattern that it gets; `None` for standard
    /// output.
    pub fn names(&self) -> Option<(&Path, &Path)> {
        self.partial.names()
    }

    /// Syncs the file to the disk and gives it its name.
    ///
    /// # Errors
    /// [`MediaError::Output`] where the name was taken meanwhile and may not be replaced, or the system refuses.
    pub fn publish(self) -> Result<WriteReport, MediaError> {
        self.partial.publish()?;
        Ok(self.report)
    }
}

impl VideoWriter {
    /// Starts writing `output`: `video` describes the frames, `source` provides all other streams and metadata.
    ///
    /// # Errors
    /// Targets that must not or cannot be written, encoders that do not exist or refuse, and with `strict` every loss.
    pub fn create(
        output: &Output,
        source: &Input,
        video: &VideoInfo,
        options: &WriteOptions,
    ) -> Result<Self, MediaError> {
        output.check(source, options.overwrite)?;
        let format = output.format()?;
        let mut warnings = Warnings { strict: options.strict, list: Vec::new() };
        let (choice, encoder, surface) = open_encoder(output, format, video, options, &mut warnings)?;
        for kind in &video.hdr.dynamic {
            warnings.add(format!(
                "{kind} metadata are left out: no encoder here writes what changes from scene to scene"
            ))?;
        }
        let partial = output.begin(IfExists::overwrite(options.overwrite))?;
        av::log::forget();
        let fail = |e| MediaError::writing(output.path(), e);
        let mut muxer = Muxer::create(format, &partial.url()).map_err(fail)?;
        let picture = source.demux()?;
        let start_us = source.span_us(&picture).0.unwrap_or(0);
        let mut copier = donor(source, options).map(Copier::open).transpose()?;
        let own = matches!(options.passthrough, PassthroughStreams::OfSource);
        let template = Template { encoder: &encoder, picture: &picture, video, own };
        let video_stream =
            template.add_streams(&mut muxer, copier.as_mut(), format, &mut warnings).map_err(|e| e.at(output))?;
        if let Some(copier) = &copier {
            muxer.set_chapters(&super::chapters::trimmed(copier.source(), copier.clip())).map_err(fail)?;
        }
        let shift = Rational::MICRO.rescale(-start_us, video.av_timebase());
        if output.is_sequence() {
            copier = None;
        }
        muxer.write_header(header_options(output, format, &muxer_tags(copier.as_ref()))).map_err(fail)?;
        let report = WriteReport {
            encoder: choice.encoder.name(),
            pixel_format: choice.pix.name(),
            container: format.name(),
            warnings: warnings.list,
            ..WriteReport::default()
        };
        Ok(Self {
            encoder,
            muxer: Some(muxer),
            copier,
            partial,
            output: output.clone(),
            surface,
            info: video.clone(),
            video_stream,
            durations: HashMap::new(),
            shift,
            packet: Packet::new(),
            part: None,
            seam: Seam::default(),
            report,
        })
    }

    /// Starts a part of `output`: the encoded pictures of some successive frames, of which the first is a key frame, in the file `part`.
    /// [`Self::append`] joins parts to the output. `options` are those of the output.
    ///
    /// # Errors
    /// As of [`Self::create`].
    pub fn create_part(
        part: &Path,
        output: &Output,
        video: &VideoInfo,
        options: &WriteOptions,
    ) -> Result<Self, MediaError> {
        let format = output.format()?;
        let mut warnings = Warnings { strict: options.strict, list: Vec::new() };
        let (choice, encoder, surface) = open_encoder(output, format, video, options, &mut warnings)?;
        let failed = |e: std::io::Error| MediaError::writing_io(part, &e);
        let if_exists = IfExists::overwrite(options.overwrite);
        let mut unfinished = AtomicFile::next_to(part, if_exists).map_err(failed)?;
        let file = unfinished.file().ok_or_else(|| failed(std::io::ErrorKind::Unsupported.into()))?;
        let mut out = BufWriter::new(file.try_clone().map_err(failed)?);
        let encoder_name = choice.encoder.name();
        PartHeader::of(&encoder_name, &encoder, video.av_timebase()).write(&mut out).map_err(failed)?;
        let report = WriteReport {
            encoder: encoder_name,
            pixel_format: choice.pix.name(),
            container: format.name(),
            warnings: warnings.list,
            ..WriteReport::default()
        };
        Ok(Self {
            encoder,
            muxer: None,
            copier: None,
            partial: Partial::File { partial: unfinished, target: part.to_owned(), if_exists },
            output: output.clone(),
            surface,
            info: video.clone(),
            video_stream: 0,
            durations: HashMap::new(),
            shift: 0,
            packet: Packet::new(),
            part: Some(out),
            seam: Seam::default(),
            report,
        })
    }

    /// Appends the encoded pictures of a part file, which must be those of the frames `span`, in place of frames to encode; parts come in
    /// their order. Nothing of a part is written before its frames are counted and their times compared.
    ///
    /// # Errors
    /// [`MediaError::Input`]: a part that is damaged, has other frames, begins with no key frame, or was encoded with other settings or
    /// another version of the encoder. [`MediaError::DiskFull`], [`MediaError::Output`].
    pub fn append(&mut self, part: &Path, span: &FrameSpan) -> Result<(), MediaError> {
        let mut part = PartReader::open(part)?;
        if part.header != PartHeader::of(&self.report.encoder, &self.encoder, self.info.av_timebase()) {
            let problem = "the encoded part was made with other settings or another encoder; render it again";
            return Err(part.refused(problem));
        }
        let records = part.records()?;
        let decoded_at = self.seam.add(&part, &records, span)?;
        let mut packet = Packet::new();
        for (k, (record, dts)) in records.iter().zip(decoded_at).enumerate() {
            if !part.next(k, &mut packet)? {
                return Err(part.refused("the encoded part changed while it was read"));
            }
            let moved = |time: i64| Some(time.saturating_add(self.shift));
            packet.set_times(moved(record.pts), moved(dts));
            self.mux(&mut packet)?;
            self.report.frames += 1;
        }
        Ok(())
    }

    /// A writable frame of the source's format from the writer's pool; the samples are unspecified.
    ///
    /// # Errors
    /// [`MediaError::NoMemory`].
    pub fn new_frame(&self) -> Result<Frame, MediaError> {
        self.surface.blank()
    }

    /// A pool of the same frames, for other threads to draw from.
    pub fn frame_pool(&self) -> super::FramePool {
        self.surface.pool()
    }

    /// What was lost or changed, known from the start.
    pub fn warnings(&self) -> &[String] {
        &self.report.warnings
    }

    /// Encodes the next frame; times must increase. Frames in memory of another layer are copied, all others are not.
    ///
    /// # Errors
    /// [`MediaError::Internal`] where the frame is not like the video announced; [`MediaError::DiskFull`],
    /// [`MediaError::Output`].
    pub fn write(&mut self, frame: Frame) -> Result<(), MediaError> {
        let got = describe(frame.width, frame.height, frame.format);
        let expected = describe(self.info.width, self.info.height, self.info.format);
        if got != expected {
            let reason = format!("a frame of {got} was handed to a writer for {expected}");
            return Err(MediaError::Internal { doing: "writing a frame".to_owned(), reason });
        }
        let pts = frame.pts.0.saturating_add(self.shift);
        let duration = if frame.duration > 0 { frame.duration } else { self.info.mean_ticks() };
        let picture = self.surface.picture(frame, pts, duration)?;
        self.durations.insert(pts, duration);
        av::log::forget();
        self.encoder.send(Some(&picture)).map_err(|e| self.encoding(e))?;
        drop(picture);
        self.report.frames += 1;
        self.drain()
    }

    /// Finishes the file, syncs it to the disk and gives it its name.
    ///
    /// # Errors
    /// As [`VideoWriter::write`]; the unfinished file is removed.
    pub fn finish(self) -> Result<WriteReport, MediaError> {
        self.seal()?.publish()
    }

    /// Writes what is left to the file, which has its name once it is [published](SealedVideo::publish): in between the caller may
    /// note what is about to appear.
    ///
    /// # Errors
    /// As [`VideoWriter::write`]; the unfinished file is removed.
    pub fn seal(mut self) -> Result<SealedVideo, MediaError> {
        self.encoder.send(None).map_err(|e| self.encoding(e))?;
        self.drain()?;
        let fail = |e| MediaError::writing(self.output.path(), e);
        if let (Some(copier), Some(muxer)) = (&mut self.copier, &mut self.muxer) {
            copier.pump(muxer, None).map_err(fail)?;
            self.report.copied_packets = copier.copied;
            self.report.copied_videos = copier.videos();
            self.report.warnings.extend(copier.warnings());
        }
        if let Some(muxer) = self.muxer.take() {
            muxer.finish().map_err(fail)?;
        }
        if let Some(mut part) = self.part.take() {
            let ended = write_end(&mut part, self.report.frames).and_then(|()| part.flush());
            ended.map_err(|e| MediaError::writing_io(self.output.path(), &e))?;
        }
        Ok(SealedVideo { partial: self.partial, report: self.report })
    }

    fn encoding(&self, error: av::AvError) -> MediaError {
        let frame = format!("frame {}", self.report.frames);
        MediaError::encoder_refused(&self.report.encoder, &frame, &reason(error))
    }

    /// Writes what the encoder has ready, and the other streams' packets that belong before it.
    fn drain(&mut self) -> Result<(), MediaError> {
        while self.encoder.receive(&mut self.packet).map_err(|e| self.encoding(e))? {
            let pts = self.packet.pts().unwrap_or_default();
            let known = self.durations.remove(&pts).unwrap_or_else(|| self.info.mean_ticks());
            self.packet.set_duration(known);
            if let Some(part) = &mut self.part {
                write_packet(part, &self.packet).map_err(|e| MediaError::writing_io(self.output.path(), &e))?;
                continue;
            }
            let mut packet = std::mem::replace(&mut self.packet, Packet::new());
            self.mux(&mut packet)?;
            self.packet = packet;
        }
        Ok(())
    }

    /// Writes a packet to the container, and the other streams' packets that belong before it.
    fn mux(&mut self, packet: &mut Packet) -> Result<(), MediaError> {
        let base = self.info.av_timebase();
        let until = packet.dts().map(|t| base.rescale(t, Rational::MICRO));
        let fail = |e| MediaError::writing(self.output.path(), e);
        let Some(muxer) = &mut self.muxer else { return Ok(()) };
        if let Some(copier) = &mut self.copier {
            copier.pump(muxer, Some(until.unwrap_or(i64::MIN))).map_err(fail)?;
        }
        packet.rescale(base, muxer.time_base(self.video_stream));
        packet.set_stream(self.video_stream);
        muxer.write(packet).map_err(fail)
    }
}

/// Collects what is lost, or makes an error of it.
struct Warnings {
    strict: bool,
    list: Vec<String>,
}

impl Warnings {
    fn add(&mut self, what: String) -> Result<(), MediaError> {
        if self.strict {
            return Err(MediaError::Usage { problem: format!("{what} (refused because of strict)") });
        }
        tracing::warn!("{what}");
        self.list.push(what);
        Ok(())
    }
}

/// The clip that everything beside the pictures comes from.
fn donor<'i>(source: &'i Input, options: &'i WriteOptions) -> Option<&'i Input> {
    let donor = match &options.passthrough {
        PassthroughStreams::OfSource => source,
        PassthroughStreams::Of(other) => other,
        PassthroughStreams::None => return None,
    };
    (!donor.is_sequence()).then_some(donor)
}

/// Opens the first encoder that takes the video; what only the last one refuses is an error.
fn open_encoder(
    output: &Output,
    format: OutputFormat,
    video: &VideoInfo,
    options: &WriteOptions,
    warnings: &mut Warnings,
) -> Result<(Choice, Encoder, Surface), MediaError> {
    let choices = if output.is_sequence() {
        vec![choose_still(&output.path().extension().unwrap_or_default().to_string_lossy(), video.format)?]
    } else {
        output.check_codec(options.codec)?;
        choose(options.codec, &options.encoder, video.format)?
    };
    let mut opened = Err(MediaError::Internal { doing: "choosing an encoder".into(), reason: "none is left".into() });
    for choice in choices {
        let mut losses = Warnings { strict: warnings.strict, list: Vec::new() };
        opened = open_choice(choice, format, video, options, &mut losses);
        match &opened {
            Ok(_) => {
                warnings.list.append(&mut losses.list);
                break;
            }
            Err(e) => tracing::info!("{e}"),
        }
    }
    opened
}

fn open_choice(
    mut choice: Choice,
    format: OutputFormat,
    video: &VideoInfo,
    options: &WriteOptions,
    warnings: &mut Warnings,
) -> Result<(Choice, Encoder, Surface), MediaError> {
    if let Some(change) = super::odd_size::avoid(&mut choice, video, options.strict)? {
        warnings.add(change)?;
    }
    if let Some(lost) = loss(video.format, choice.pix) {
        let (encoder, pix) = (choice.encoder.name(), choice.pix.name());
        warnings.add(format!("{encoder} encodes {pix}: {lost}"))?;
    }
    let surface = Surface::new(&choice, video)?;
    let open = || -> Result<Result<Encoder, av::AvError>, MediaError> {
        let mut settings = settings(&choice, video, surface.color(), options)?;
        settings.global_header = format.wants_global_header();
        Ok(Encoder::open(choice.encoder, settings))
    };
    let summary = format!("{} in {}", describe(video.width, video.height, video.format), choice.pix.name());
    av::log::forget();
    // A library that gives no reason may have lacked a thread for a moment: what is wrong with the settings is refused again.
    let encoder = match open()? {
        Err(av::AvError::EXTERNAL) => open()?,
        first => first,
    };
    let encoder = encoder.map_err(|e| MediaError::encoder_refused(&choice.encoder.name(), &summary, &reason(e)))?;
    Ok((choice, encoder, surface))
}

/// An error while streams are added: FFmpeg's, or a loss that is not allowed.
enum AddError {
    Av(av::AvError),
    Media(MediaError),
}

impl AddError {
    fn at(self, output: &Output) -> MediaError {
        match self {
            Self::Av(e) => MediaError::writing(output.path(), e),
            Self::Media(e) => e,
        }
    }
}

impl From<av::AvError> for AddError {
    fn from(e: av::AvError) -> Self {
        Self::Av(e)
    }
}

impl From<MediaError> for AddError {
    fn from(e: MediaError) -> Self {
        Self::Media(e)
    }
}

/// What the stream of the pictures is made from.
struct Template<'a> {
    encoder: &'a Encoder,
    picture: &'a Demuxer,
    video: &'a VideoInfo,
    /// The other streams come from the same clip.
    own: bool,
}

impl Template<'_> {
    /// Adds all streams, in the order of the clip where they are of one, and tags. Returns the index of the video.
    fn add_streams(
        &self,
        muxer: &mut Muxer,
        copier: Option<&mut Copier>,
        format: OutputFormat,
        warnings: &mut Warnings,
    ) -> Result<usize, AddError> {
        let Some(copier) = copier else { return self.add_video(muxer) };
        let pictures = if self.own { Some(self.video.stream) } else { copier.video()? };
        let mut index = if self.own { None } else { Some(self.add_video(muxer)?) };
        for i in 0..copier.source().stream_count() {
            if Some(i) == pictures {
                copier.skip(i);
                if self.own {
                    index = Some(self.add_video(muxer)?);
                }
            } else if format.name() == "image2" {
                copier.skip(i);
            } else if let Some(lost) = copier.plan(i, muxer, format)? {
                warnings.add(lost)?;
            }
        }
        muxer.set_metadata(muxer_tags(Some(copier)));
        index.map_or_else(|| self.add_video(muxer), Ok)
    }

    fn add_video(&self, muxer: &mut Muxer) -> Result<usize, AddError> {
        let index = muxer.add_encoded(self.encoder, self.picture.stream(self.video.stream))?;
        let hdr = &self.video.hdr;
        muxer.set_hdr(index, hdr.mastering.as_deref(), hdr.light.as_deref())?;
        Ok(index)
    }
}

/// Tags of the whole file; those that describe the old container are left out.
fn muxer_tags(copier: Option<&Copier>) -> Vec<(String, String)> {
    let container = ["major_brand", "minor_version", "compatible_brands", "encoder", "DURATION"];
    let tags = copier.map(|c| c.source().metadata()).unwrap_or_default();
    tags.into_iter().filter(|(k, _)| !container.contains(&k.as_str())).collect()
}

fn header_options(output: &Output, format: OutputFormat, tags: &[(String, String)]) -> Dictionary {
    let mut options = Dictionary::new();
    if matches!(format.name().as_str(), "mp4" | "mov") {
        // Keys with dots are QuickTime's own; the plain iTunes list would drop them.
        let keys = if tags.iter().any(|(k, _)| k.contains('.')) { "+use_metadata_tags" } else { "" };
        let layout = if output.is_stdout() { "+frag_keyframe+empty_moov+delay_moov" } else { "" };
        let flags = format!("{keys}{layout}");
        if !flags.is_empty() {
            options.set("movflags", &flags);
        }
    }
    options
}

impl std::fmt::Debug for VideoWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "VideoWriter {{ {} }}", self.output.path().display())
    }
}
