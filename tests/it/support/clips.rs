//! Small clips made on the fly by the `ffmpeg` program, which also serves as an independent reader of our results.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::missing::{has_ffmpeg, real_media};
use plumbline::media::{
    Input, MediaError, Output, ReadOptions, ReadReport, VideoReader, VideoWriter, WriteOptions, WriteReport,
};

/// A folder for the files of one test, or `None` (with the reason printed) where `ffmpeg` is not installed.
pub(crate) fn workshop() -> Option<tempfile::TempDir> {
    has_ffmpeg().then(|| tempfile::tempdir().expect("a temporary folder"))
}

/// A real clip from the folder that `PLUMBLINE_MEDIA` names, or `None` with the reason printed.
pub(crate) fn real_clip(name: &str) -> Option<PathBuf> {
    real_media(&format!("video/{name}"))
}

fn output_of(program: &str, args: &[&str]) -> String {
    let done = Command::new(program).args(args).output().expect("the program runs");
    assert!(done.status.success(), "{program} {args:?}: {}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8_lossy(&done.stdout).into_owned()
}

/// Runs `ffmpeg` with `args` (split at spaces) and the file `name` in `folder` as its result.
pub(crate) fn make(folder: &Path, name: &str, args: &str) -> PathBuf {
    let path = folder.join(name);
    let text = path.to_str().expect("UTF-8");
    let args: Vec<&str> = ["-v", "error", "-y"].into_iter().chain(args.split_whitespace()).chain([text]).collect();
    output_of("ffmpeg", &args);
    path
}

/// A moving pattern of `frames` frames at 25/s, 160×120 px, as an input of `ffmpeg`.
pub(crate) fn pattern(frames: u32) -> String {
    format!("-f lavfi -i testsrc2=size=160x120:rate=25:duration={}", f64::from(frames) / 25.0)
}

/// A shaky pan over a still texture, 320×180 px at 25/s, as options of `ffmpeg`; times of frames as `n / 25`.
pub(crate) fn shaky(seconds: f64) -> String {
    let texture = "nullsrc=s=440x300:r=25:d=0.04,geq=lum='random(1)*255':cb='128+60*sin(X/40)':cr='128+60*cos(Y/30)',\
                   gblur=sigma=3,lutyuv=y='clip((val-128)*8+128,16,235)',loop=loop=-1:size=1,setpts=N/25/TB";
    let x = "50+n*0.6+6*sin(n*1.9)+5*sin(n*0.77)";
    let y = "60+5*sin(n*2.3)+6*cos(n*0.61)";
    format!("-f lavfi -i {texture},crop=w=320:h=180:x='{x}':y='{y}':exact=1 -t {seconds}")
}

/// Display times of all video frames, s, as `ffprobe` reads them.
pub(crate) fn times(path: &Path) -> Vec<f64> {
    let entries = "frame=best_effort_timestamp_time";
    let text = probe(path, &["-select_streams", "v:0", "-show_entries", entries, "-of", "csv=p=0"]);
    text.lines().filter_map(|l| l.trim_matches(',').parse().ok()).collect()
}

/// What `ffprobe` prints for `args`.
pub(crate) fn probe(path: &Path, args: &[&str]) -> String {
    let path = path.to_str().expect("UTF-8");
    let args: Vec<&str> = ["-v", "error"].into_iter().chain(args.iter().copied()).chain([path]).collect();
    output_of("ffprobe", &args)
}

/// One value of the first video stream, as `ffprobe` names it.
pub(crate) fn video_field(path: &Path, field: &str) -> String {
    let entries = format!("stream={field}");
    probe(path, &["-select_streams", "v:0", "-show_entries", &entries, "-of", "csv=p=0"]).trim().to_owned()
}

/// Checksums of the packets of `streams` (`a`, `s`), undecoded, without their times.
pub(crate) fn packet_sums(path: &Path, streams: &str) -> Vec<String> {
    let path = path.to_str().expect("UTF-8");
    let text = output_of(
        "ffmpeg",
        &["-v", "error", "-i", path, "-map", &format!("0:{streams}"), "-c", "copy", "-f", "framemd5", "-"],
    );
    text.lines().filter(|l| !l.starts_with('#')).filter_map(|l| l.split(',').nth(5)).map(str::to_owned).collect()
}

/// Checksums of the decoded video frames in the pixel format `pix`.
pub(crate) fn picture_sums(path: &Path, pix: &str) -> Vec<String> {
    filtered_sums(path, "null", pix)
}

/// The same of frames that went through a filter of `ffmpeg`, such as `crop=320:180:0:0`.
pub(crate) fn filtered_sums(path: &Path, filter: &str, pix: &str) -> Vec<String> {
    let path = path.to_str().expect("UTF-8");
    let args = [
        "-v",
        "error",
        "-i",
        path,
        "-map",
        "0:v:0",
        "-vf",
        filter,
        "-fps_mode",
        "passthrough",
        "-pix_fmt",
        pix,
        "-f",
        "framemd5",
        "-",
    ];
    let text = output_of("ffmpeg", &args);
    text.lines().filter(|l| !l.starts_with('#')).filter_map(|l| l.split(',').nth(5)).map(str::to_owned).collect()
}

/// An input by its path.
pub(crate) fn input(path: &Path) -> Input {
    Input::parse(path.to_str().expect("UTF-8")).expect("the clip is there")
}

/// An output by its path.
pub(crate) fn output(path: &Path) -> Output {
    Output::parse(path.to_str().expect("UTF-8"))
}

/// Options for encoding fast.
pub(crate) fn fast() -> WriteOptions {
    WriteOptions { preset: Some("ultrafast".into()), threads: 1, ..WriteOptions::default() }
}

/// Reads `from` and writes every frame of it to `to`.
pub(crate) fn transcode(
    from: &Input,
    to: &Path,
    options: &WriteOptions,
) -> Result<(ReadReport, WriteReport), MediaError> {
    let mut reader = VideoReader::open(from, &ReadOptions { threads: 1, ..ReadOptions::default() })?;
    let mut writer = VideoWriter::create(&output(to), from, reader.info(), options)?;
    while let Some(frame) = reader.next_frame()? {
        writer.write(frame)?;
    }
    Ok((reader.report(), writer.finish()?))
}
