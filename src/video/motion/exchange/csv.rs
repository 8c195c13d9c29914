//! The cameras of a clip as a table: one line per frame, empty cells where nothing is known.
//!
//! ```text
//! frame,pts,time_s,shot,tier,verdict,cameras,qw,qx,qy,qz,tx,ty,tz,center_x,center_y,center_z,focal,k1
//! ```
//!
//! `tier` and `verdict` are those of the motion in the picture, `cameras` the verdict on the shot's cameras in space, as in the
//! motion file. `q` and `t` are world to camera; `center` is the camera center, in the coordinates of its shot.

use std::io::{self, Write};

use serde::Serialize;

use crate::motion::{ClipMotion, FrameCamera};

const HEADER: &str =
    "frame,pts,time_s,shot,tier,verdict,cameras,qw,qx,qy,qz,tx,ty,tz,center_x,center_y,center_z,focal,k1";
/// Columns of a camera.
const CAMERA_COLUMNS: usize = 12;

/// Writes the table of a clip.
///
/// # Errors
/// Those of `out`.
pub fn write_csv(motion: &ClipMotion, mut out: impl Write) -> io::Result<()> {
    writeln!(out, "{HEADER}")?;
    for (k, frame) in motion.frames.iter().enumerate() {
        let (pts, time_s) = (frame.pts.0, motion.timebase.seconds(frame.pts));
        let shot = motion.shot_of(k).unwrap_or(0);
        let cameras = motion.cameras.as_ref();
        let verdict = cameras.and_then(|c| c.shots.iter().find(|s| s.frames.contains(&k)));
        let verdict = verdict.map_or_else(String::new, |s| word(&s.verdict));
        write!(out, "{k},{pts},{time_s:.6},{shot},{},{},{verdict}", word(&frame.model), word(&frame.quality))?;
        match cameras.and_then(|c| c.frames.get(k)).copied().flatten() {
            Some(camera) => row(&camera).iter().try_for_each(|v| write!(out, ",{v}"))?,
            None => write!(out, "{}", ",".repeat(CAMERA_COLUMNS))?,
        }
        writeln!(out)?;
    }
    out.flush()
}

fn row(camera: &FrameCamera) -> [f64; CAMERA_COLUMNS] {
    let (q, t, c) = (camera.pose.rotation, camera.pose.translation, camera.pose.center());
    let lens = camera.intrinsics;
    [q.w, q.i, q.j, q.k, t.x, t.y, t.z, c.x, c.y, c.z, lens.focal, lens.k1]
}

/// The word by which the motion file names a value.
fn word(value: &impl Serialize) -> String {
    let json = serde_json::to_value(value).unwrap_or_default();
    json.as_str().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::exchange::tests::walk;

    #[test]
    fn every_frame_has_a_line_and_every_line_all_cells() {
        let (motion, _) = walk();
        let mut bytes = Vec::new();
        write_csv(&motion, &mut bytes).expect("memory");
        let text = String::from_utf8(bytes).expect("text");
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        assert_eq!(lines.len(), motion.frames.len() + 1);
        assert!(lines.iter().all(|l| l.len() == HEADER.split(',').count()));
        let at = |line: usize, column: &str| {
            let column = lines[0].iter().position(|c| *c == column).expect("a column");
            lines[line][column]
        };
        assert_eq!((at(1, "frame"), at(3, "pts"), at(3, "time_s")), ("0", "1000", "0.080000"));
        assert_eq!((at(1, "verdict"), at(2, "verdict"), at(2, "cameras")), ("shot_start", "measured", "3d"));
        assert_eq!(
            (at(5, "qw"), at(5, "center_z"), at(5, "k1"), at(5, "shot")),
            ("", "", "", "0"),
            "frame 4 has no camera"
        );
        let center: Vec<f64> =
            ["center_x", "center_y", "center_z"].iter().map(|c| at(4, c).parse().expect("a number")).collect();
        let expected = motion.cameras.expect("cameras").frames[3].expect("a camera").pose.center();
        assert_eq!(center, [expected.x, expected.y, expected.z]);
    }
}
