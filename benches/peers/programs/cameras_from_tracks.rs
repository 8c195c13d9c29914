//! Reads tracks as text and prints the cameras that saw them, as JSON.
//!
//! Input as for `motion_from_tracks`: a line `width height fps frames`, then per frame a line `F n` and `n` lines `id x y`
//! (px, pixel centers at integer + 0.5), ids ascending. Argument: `--global` takes all rows to be captured at once. Output: the
//! verdict, its figures, the lens, per frame `{"q": [w, x, y, z], "t": [x, y, z]}` (`cam_from_world`) or `null`.

use plumbline::num::math::Point2;
use plumbline::num::run::Run;
use plumbline::video::motion::sfm::{SfmOptions, TrackTable, reconstruct};
use serde_json::json;

#[expect(clippy::unnecessary_wraps, reason = "the programs are called through one type")]
pub(super) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let text = std::io::read_to_string(std::io::stdin()).expect("readable standard input");
    let mut lines = text.lines();
    let header: Vec<f64> = numbers(lines.next().expect("a header line"));
    let mut frames: Vec<Vec<(u32, Point2)>> = Vec::new();
    while let Some(line) = lines.next() {
        let count: usize = line.trim_start_matches("F ").parse().expect("F n");
        let point = |v: Vec<f64>| (v[0] as u32, Point2::new(v[1], v[2]));
        frames.push((0..count).map(|_| point(numbers(lines.next().expect("a point line")))).collect());
    }
    let started = std::time::Instant::now();
    let table = TrackTable::new(header[0] as u32, header[1] as u32, frames);
    let options = SfmOptions { focal: None, rolling_shutter: !super::args().any(|a| a == "--global") };
    let found = reconstruct(&table, &options, &Run::default()).expect("a run that never stops");
    let seconds = started.elapsed().as_secs_f64();
    let pose = |p: &plumbline::camera::CameraPose| {
        let (q, t) = (p.rotation.into_inner(), p.translation);
        json!({ "q": [q.w, q.i, q.j, q.k], "t": [t.x, t.y, t.z] })
    };
    let scene = &found.scene;
    println!(
        "{}",
        json!({
            "verdict": found.verdict, "reason": found.reason, "figures": found.figures, "seconds": seconds,
            "focal": scene.intrinsics.focal, "k1": scene.intrinsics.k1, "readout": scene.readout,
            "poses": scene.poses.iter().map(|p| p.as_ref().map(pose)).collect::<Vec<_>>(),
        })
    );
    Ok(())
}

fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace().map(|v| v.parse().expect("a number")).collect()
}
