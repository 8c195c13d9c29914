//! Renders a clip of a synthetic street, seen by a hand-held camera, with sound, and the true cameras beside it.
//!
//!     cargo run --release --example render_clip -- --preset street-walk --out media
//!
//! writes `media/street-walk.mp4` and `media/street-walk.truth.json`. Needs the `ffmpeg` command.

#![allow(clippy::print_stdout)] // an example program: this is its interface

use std::error::Error;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use clap::{Parser, ValueEnum};
use plumbline::image::canvas::Canvas;
use plumbline_testkit::scene::{HandHeld, Polygon, Pose, RATE_HZ, Scene, View, Walk, passer_by, street_sound};

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Preset {
    /// Down the street: depth, parallax, a global shutter.
    StreetWalk,
    /// Somebody walks through the picture of a camera with a rolling shutter.
    RollingPasser,
}

/// Renders a clip whose cameras are known.
#[derive(Parser)]
struct Options {
    #[arg(long, value_enum, default_value_t = Preset::StreetWalk)]
    preset: Preset,
    /// Folder to write into
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// Name of the files, without suffix [default: the preset's]
    #[arg(long)]
    name: Option<String>,
    #[arg(long, default_value = "960x540", value_parser = size)]
    size: (usize, usize),
    #[arg(long, default_value_t = 360)]
    frames: usize,
    #[arg(long, default_value_t = 30.0)]
    fps: f64,
    /// Seed of the street and of the shake
    #[arg(long, default_value_t = 4)]
    seed: u64,
    /// Strength of the shake; 1: 0.6° and 2 cm root mean square
    #[arg(long, default_value_t = 1.0)]
    shake: f64,
    /// Rolling-shutter readout, s [default: the preset's]
    #[arg(long)]
    readout: Option<f64>,
    /// Focal length as a share of the width
    #[arg(long, default_value_t = 0.85)]
    focal: f64,
    /// Also write NAME.stable.mp4: the same moments from the intended path, without shake or rolling shutter
    #[arg(long)]
    stable: bool,
    /// Constant rate factor of the H.264 encoder
    #[arg(long, default_value_t = 25)]
    crf: u32,
    /// Write only this frame, as NAME.png
    #[arg(long)]
    still: Option<usize>,
}

fn size(text: &str) -> Result<(usize, usize), String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    parsed
        .filter(|(w, h)| *w >= 16 && *h >= 16 && w % 2 == 0 && h % 2 == 0)
        .ok_or_else(|| format!("size {text} is invalid (expected WIDTHxHEIGHT, both even and at least 16)"))
}

/// The scene, the camera's path and what walks by, at any time.
struct Shot {
    scene: Scene,
    path: HandHeld,
    view: View,
    passer: bool,
    duration_s: f64,
}

impl Shot {
    fn new(o: &Options) -> Self {
        let duration_s = o.frames as f64 / o.fps;
        let passer = o.preset == Preset::RollingPasser;
        let walk = if passer { Walk::Aside } else { Walk::Ahead };
        let readout_s = o.readout.unwrap_or(if passer { 0.02 } else { 0.0 });
        let (width, height) = o.size;
        Self {
            scene: Scene::street(o.seed),
            path: HandHeld::new(walk, duration_s, o.shake, o.seed + 1),
            view: View { width, height, focal_px: o.focal * width as f64, readout_s },
            passer,
            duration_s,
        }
    }

    fn movers(&self, t: f64) -> Vec<Polygon> {
        if !self.passer {
            return Vec::new();
        }
        // Through the picture in the middle two thirds of the clip, then away down the street.
        let s = t - self.duration_s / 6.0;
        let mut movers = passer_by(s, [-4.4, 7.6], [1.15, 0.12], [1.0; 3]);
        movers.extend(passer_by(t + 0.4, [0.9, 19.0], [-0.05, -0.85], [0.35, 0.85, 0.6]));
        movers
    }

    fn shaky(&self, t: f64) -> Canvas {
        self.view.render(&self.scene, &self.movers(t), |offset| self.path.shaken(t + offset))
    }

    fn stable(&self, t: f64) -> Canvas {
        let view = View { readout_s: 0.0, ..self.view };
        view.render(&self.scene, &self.movers(t), |_| self.path.intended(t))
    }
}

fn encoder(o: &Options, target: &Path, sound: &Path) -> std::io::Result<std::process::Child> {
    let (width, height) = o.size;
    Command::new("ffmpeg")
        .args(["-y", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"])
        .args(["-s", &format!("{width}x{height}"), "-r", &o.fps.to_string(), "-i", "-"])
        .args(["-f", "s16le", "-ar", &RATE_HZ.to_string(), "-ac", "2", "-i"])
        .arg(sound)
        .args(["-vf", "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p", "-colorspace", "bt709"])
        .args(["-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"])
        .args(["-c:v", "libx264", "-preset", "slow", "-crf", &o.crf.to_string()])
        .args(["-c:a", "aac", "-b:a", "96k", "-movflags", "+faststart", "-fflags", "+bitexact"])
        .arg(target)
        .stdin(Stdio::piped())
        .spawn()
}

fn film(o: &Options, target: &Path, frame: impl Fn(f64) -> Canvas) -> Result<(), Box<dyn Error>> {
    let began = Instant::now();
    let mut sound = tempfile::NamedTempFile::new()?;
    sound.write_all(bytemuck::cast_slice(&street_sound(o.frames as f64 / o.fps, o.seed)))?;
    let mut encoder = encoder(o, target, sound.path())?;
    let mut pipe = encoder.stdin.take().ok_or("ffmpeg takes no input")?;
    for i in 0..o.frames {
        pipe.write_all(frame(i as f64 / o.fps).as_bytes())?;
    }
    drop(pipe);
    if !encoder.wait()?.success() {
        return Err(format!("ffmpeg failed on {}", target.display()).into());
    }
    println!("{}: {} frames, {:.1} fps", target.display(), o.frames, o.frames as f64 / began.elapsed().as_secs_f64());
    Ok(())
}

/// The true cameras: `[qw, qx, qy, qz, tx, ty, tz]` of `cam_from_world` per frame.
fn truth(o: &Options, shot: &Shot) -> serde_json::Value {
    let round = |v: f64| (v * 1e7).round() / 1e7;
    let row = |pose: Pose| pose.quaternion_and_translation().map(round);
    let times = || (0..o.frames).map(|i| i as f64 / o.fps);
    serde_json::json!({
        "format": "plumbline.truth", "version": 1,
        "width": o.size.0, "height": o.size.1, "fps": o.fps, "frames": o.frames,
        "focal_px": shot.view.focal_px, "pixel_center": 0.5, "readout_s": shot.view.readout_s,
        "seed": o.seed, "shake": o.shake,
        "cam_from_world": "[qw, qx, qy, qz, tx, ty, tz]; x right, y down, z forward; m; pose of the middle row",
        "shaky": times().map(|t| row(shot.path.shaken(t))).collect::<Vec<_>>(),
        "stable": times().map(|t| row(shot.path.intended(t))).collect::<Vec<_>>(),
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let o = Options::parse();
    fs::create_dir_all(&o.out)?;
    let preset = o.preset.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned());
    let name = o.name.clone().unwrap_or(preset);
    let shot = Shot::new(&o);
    let file = |suffix: &str| o.out.join(format!("{name}{suffix}"));
    if let Some(i) = o.still {
        let t = i as f64 / o.fps;
        let began = Instant::now();
        let canvas = if o.stable { shot.stable(t) } else { shot.shaky(t) };
        println!("{}: rendered in {:.2} s", file(".png").display(), began.elapsed().as_secs_f64());
        image::save_buffer(
            file(".png"),
            canvas.as_bytes(),
            canvas.width() as u32,
            canvas.height() as u32,
            image::ColorType::Rgb8,
        )?;
        return Ok(());
    }
    film(&o, &file(".mp4"), |t| shot.shaky(t))?;
    if o.stable {
        film(&o, &file(".stable.mp4"), |t| shot.stable(t))?;
    }
    fs::write(file(".truth.json"), serde_json::to_string(&truth(&o, &shot))? + "\n")?;
    Ok(())
}
