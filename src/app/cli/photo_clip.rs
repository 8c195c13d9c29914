//! `rectify` and `retarget` on clips: the same options, as a graph over frames. A clip is recognized by its name.

use clap::Args;

use super::clip::{LengthArg, clip_extension};
use super::failure::Failure;
use super::options::{Given, Offer, Setting};
use super::photo::PhotoArgs;
use super::target::Names;
use crate::pipeline::items::{CLIP_EXTENSIONS, PHOTO_EXTENSIONS, Search, has_extension};
use crate::pipeline::options::BatchSettings;
use crate::pipeline::paths::to_path;
use crate::pipeline::{PipelineFile, StageEntry};
use crate::stages::{
    DecodeSettings, EncodeSettings, MotionSettings, RenderSettings, SmoothSettings, TrackSettings, WarpSettings,
};

/// Options that only clips have.
#[derive(Debug, Args)]
pub(super) struct PhotoClipArgs {
    /// Also stabilize the clip, in the same interpolation
    #[arg(long, help_heading = "Clips")]
    pub(super) stabilize: bool,
    #[command(flatten)]
    decode: Given<Decode>,
    #[command(flatten, next_help_heading = "Clips")]
    length: LengthArg,
    #[command(flatten)]
    encode: Given<Encode>,
}

/// Options for `video.decode`.
struct Decode;

impl Offer for Decode {
    type Kind = DecodeSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("start").also("ss").value("TIME").under("Clips"),
        Setting::of("end").value("TIME").under("Clips"),
        Setting::of("stream").value("N").under("Clips"),
        Setting::of("allow_playlist").under("Clips"),
    ];
}

/// Options for `video.encode`.
struct Encode;

impl Offer for Encode {
    type Kind = EncodeSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("codec").value("CODEC").aliases(&[("hevc", "h265")]).under("Clips"),
        Setting::of("crf").value("Q").under("Clips"),
    ];
}

impl PhotoClipArgs {
    /// Refuses options of clips where all inputs are photos.
    pub(super) fn refuse_for_photos(&self) -> Result<(), Failure> {
        let (decode, encode) = (&self.decode.settings, &self.encode.settings);
        let given = [
            (self.stabilize, "--stabilize"),
            (decode.start.is_some(), "--start"),
            (decode.end.is_some(), "--end"),
            (self.length.is_given(), "--duration"),
            (decode.stream.is_some(), "--stream"),
            (decode.allow_playlist, "--allow-playlist"),
            (encode.codec.is_some(), "--codec"),
            (encode.crf.is_some(), "--crf"),
        ];
        refuse(&given, "is for clips, but the inputs are pictures")
    }

    /// Stages that stabilize a clip: `path` and `warp`.
    pub(super) fn steady() -> Vec<StageEntry> {
        let path = StageEntry::built("path", &SmoothSettings::default()).input("motion", "motion");
        let warp = StageEntry::built("warp", &WarpSettings::default());
        vec![path, warp.input("tracks", "tracks").input("path", "path").input("motion", "motion")]
    }

    /// The pipeline of a command: decode, the stages that make the maps, render through `warps`, encode.
    pub(super) fn pipeline(
        &self,
        name: &str,
        photo: &PhotoArgs,
        render: &RenderSettings,
        warps: &[&str],
        stages: Vec<StageEntry>,
    ) -> Result<PipelineFile, Failure> {
        refuse(&photo.for_pictures_only(), "is for pictures, but the inputs are clips")?;
        let extension = clip_extension(self.encode.settings.codec, &photo.inputs);
        let Names { source, output } = photo.target.names(&photo.inputs, "clips", extension)?;
        let decode = self.length.applied(DecodeSettings { path: source, ..self.decode.settings.clone() });
        let encode = EncodeSettings { path: output, ..self.encode.settings.clone() };
        let mut all = vec![StageEntry::built("source", &decode)];
        all.extend(stages);
        all.push(StageEntry::built("drawn", render).input("frames", "source").inputs("warps", warps));
        all.push(StageEntry::built("out", &encode).input("frames", "drawn").input("audio", "source.audio"));
        let jobs = if photo.jobs == 0 { BatchSettings::default().jobs } else { photo.jobs };
        Ok(PipelineFile { batch: photo.target.batch(&photo.inputs, jobs), ..PipelineFile::built(name, all) })
    }
}

/// Stages `tracks` and `motion`; the points are carried through the map `lens` where there is one.
pub(super) fn analysis(lens: Option<&str>) -> Vec<StageEntry> {
    let tracks = StageEntry::built("tracks", &TrackSettings::default()).input("frames", "source");
    let tracks = if let Some(lens) = lens { tracks.input("lens", lens) } else { tracks };
    vec![tracks, StageEntry::built("motion", &MotionSettings::default()).input("tracks", "tracks")]
}

/// Whether the inputs are clips.
pub(super) fn are_clips(photo: &PhotoArgs) -> Result<bool, Failure> {
    let inputs = &photo.inputs;
    let clips = inputs.iter().filter(|input| is_clip(input, !photo.target.no_recurse)).count();
    if clips > 0 && clips < inputs.len() {
        let message = "some inputs are clips and some are pictures; give each kind a run of its own";
        return Err(Failure::usage(message.to_owned()));
    }
    Ok(clips > 0)
}

/// A name that ends like a clip's, or a folder that holds clips and no photos.
fn is_clip(input: &str, recurse: bool) -> bool {
    let path = &to_path(input);
    let holds = |extensions: &[&str]| {
        let search = Search { extensions, recurse, ..Search::default() };
        search.paths(&[input.to_owned()]).is_ok_and(|files| files.iter().any(|path| has_extension(path, extensions)))
    };
    if path.is_dir() {
        holds(&CLIP_EXTENSIONS) && !holds(&PHOTO_EXTENSIONS)
    } else {
        has_extension(path, &CLIP_EXTENSIONS)
    }
}

/// Refuses the first option that was given.
pub(super) fn refuse(options: &[(bool, &str)], why: &str) -> Result<(), Failure> {
    match options.iter().find(|(given, _)| *given) {
        Some((_, option)) => Err(Failure::usage(format!("{option} {why}"))),
        None => Ok(()),
    }
}
