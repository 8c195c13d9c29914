//! Tracks given points between two pictures and times it: the program that `benches/peers/klt.py` and
//! `tests/oracle/klt.py` hold against OpenCV.
//!
//! `klt_frames DIR PASSES [THREADS]` reads `DIR/000.pgm`, `001.pgm`, … and, per consecutive pair `i`, `DIR/points_III.bin`
//! (little-endian `f32` pairs, pixel centers at integers); writes `DIR/ours_III.bin`, three `f32` per point: the position
//! and the forward–backward distance, which is negative for points that were lost. Prints one JSON object with CPU
//! seconds per frame, the best of the passes.

use std::path::{Path, PathBuf};

use plumbline::image::{Plane, PlaneRef, Pyramid};
use plumbline::video::track::track;

type Failure = Box<dyn std::error::Error>;

/// Levels of the comparison: `maxLevel = 3`.
const LEVELS: usize = 4;

pub(super) fn main() -> Result<(), Failure> {
    let args: Vec<String> = super::args().collect();
    let [_, dir, passes, ..] = args.as_slice() else { return Err("usage: klt_frames DIR PASSES [THREADS]".into()) };
    let threads = args.get(3).map_or(Ok(1), |n| n.parse())?;
    rayon::ThreadPoolBuilder::new().num_threads(threads).use_current_thread().build_global()?;
    let clip = Clip::read(Path::new(dir))?;
    let passes: usize = passes.parse()?;
    let mut best = Timing { pyramids: f64::MAX, track: f64::MAX };
    for _ in 0..passes {
        let timing = clip.run(None)?;
        best = Timing { pyramids: best.pyramids.min(timing.pyramids), track: best.track.min(timing.track) };
    }
    clip.run(Some(Path::new(dir)))?;
    let mut out = std::io::stdout();
    std::io::Write::write_fmt(&mut out, format_args!("{}\n", best.to_json()))?;
    Ok(())
}

/// CPU milliseconds per pair of frames.
struct Timing {
    /// One pyramid.
    pyramids: f64,
    /// Forward, backward and the check.
    track: f64,
}

impl Timing {
    fn to_json(&self) -> String {
        serde_json::json!({ "pyramid_ms": self.pyramids, "track_ms": self.track }).to_string()
    }
}

struct Clip {
    frames: Vec<Plane<u8>>,
    points: Vec<Vec<[f32; 2]>>,
}

impl Clip {
    fn read(dir: &Path) -> Result<Self, Failure> {
        let numbered = |stem: &str, i: usize, end: &str| -> PathBuf { dir.join(format!("{stem}{i:03}.{end}")) };
        let frames: Vec<_> = (0..)
            .map(|i| numbered("", i, "pgm"))
            .take_while(|p| p.exists())
            .map(|p| read_pgm(&p))
            .collect::<Result<_, _>>()?;
        let points = (0..frames.len().saturating_sub(1)).map(|i| read_points(&numbered("points_", i, "bin")));
        Ok(Self { points: points.collect::<Result<_, _>>()?, frames })
    }

    /// One pass; the matches are written into `dir` where one is given.
    fn run(&self, dir: Option<&Path>) -> Result<Timing, Failure> {
        let (mut prev, mut next) = (Pyramid::new(), Pyramid::new());
        let mut timing = Timing { pyramids: 0.0, track: 0.0 };
        let pairs = self.points.len() as f64;
        prev.rebuild(self.frames[0].as_ref(), LEVELS);
        for (i, points) in self.points.iter().enumerate() {
            let start = cpu_ms();
            next.rebuild(self.frames[i + 1].as_ref(), LEVELS);
            let built = cpu_ms();
            let matches = track(&prev, &next, points, points);
            timing.track += (cpu_ms() - built) / pairs;
            timing.pyramids += (built - start) / pairs;
            if let Some(dir) = dir {
                let rows = matches.iter().map(|m| match m {
                    Some(m) => [m.position[0] - 0.5, m.position[1] - 0.5, m.forward_backward_px],
                    None => [0.0, 0.0, -1.0],
                });
                let bytes: Vec<u8> = rows.flatten().flat_map(f32::to_le_bytes).collect();
                std::fs::write(dir.join(format!("ours_{i:03}.bin")), bytes)?;
            }
            std::mem::swap(&mut prev, &mut next);
        }
        Ok(timing)
    }
}

/// CPU time of the process, ms.
#[allow(unsafe_code)] // the standard library has no clock of CPU time
fn cpu_ms() -> f64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `t` is a valid place for the one value that the call writes.
    unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &raw mut t) };
    t.tv_sec as f64 * 1e3 + t.tv_nsec as f64 * 1e-6
}

fn read_points(path: &Path) -> Result<Vec<[f32; 2]>, Failure> {
    let bytes = std::fs::read(path)?;
    let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]) + 0.5;
    Ok(bytes.chunks_exact(8).map(|b| [float(&b[..4]), float(&b[4..])]).collect())
}

/// A binary PGM of 8 bits without comments: `P5 width height 255`, each followed by one white space, then the samples.
fn read_pgm(path: &Path) -> Result<Plane<u8>, Failure> {
    let bytes = std::fs::read(path)?;
    let fields: Vec<&[u8]> = bytes.splitn(5, u8::is_ascii_whitespace).collect();
    let [b"P5", width, height, b"255", samples] = fields.as_slice() else {
        return Err(format!("{}: not a binary PGM of 8 bits without comments", path.display()).into());
    };
    let number = |field: &[u8]| -> Result<usize, Failure> { Ok(std::str::from_utf8(field)?.parse()?) };
    let (width, height) = (number(width)?, number(height)?);
    let plane = PlaneRef::new(samples, width, height, width).ok_or("fewer samples than the header says")?;
    Ok(Plane::from_fn(width, height, |x, y| plane.row(y)[x]))
}
