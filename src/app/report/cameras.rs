//! What was found out about the cameras in space: a table of verdicts and, where they are drawn, their path.

use std::fmt::Write;

use super::axis::number;
use super::data::{Cameras, ShotVerdict};
use super::escape::Text;
use super::figures::percent;
use super::plot::chart;
use super::timeline::Timeline;

/// Columns of the table.
const COLUMNS: [&str; 9] =
    ["Frames", "Verdict", "Registered", "Points", "Reprojection", "Angle", "Coverage", "Focal length", "Why"];

/// Appends the section.
pub(super) fn section(out: &mut String, cameras: &Cameras, line: &Timeline<'_>) {
    out.push_str("<section aria-labelledby=\"space\"><h2 id=\"space\">Cameras in space</h2>\n");
    if !cameras.path.is_empty() {
        out.push_str(
            "<p class=\"note\">Place and direction of the real camera and of the virtual one, from the first camera of each shot: x to the \
             right, y down, z ahead; yaw to the right, pitch up, roll clockwise. Lengths are in units of the scene, whose \
             true scale no camera can tell.</p>\n<div class=\"plots\">",
        );
        cameras.path.iter().for_each(|c| chart(out, c, line));
        out.push_str("</div>\n");
    }
    out.push_str("<table class=\"stacked\"><caption>Reconstruction of each shot</caption><thead><tr>");
    for name in COLUMNS {
        let _ = write!(out, "<th scope=\"col\">{name}</th>");
    }
    out.push_str("</tr></thead><tbody>\n");
    cameras.shots.iter().for_each(|shot| row(out, shot, line));
    out.push_str(
        "</tbody></table>\n<p class=\"note\">Registered: frames with a camera. Reprojection: mean distance of the points from \
         where the cameras see them. Angle: median over the points of the widest angle under which they are seen; small ones \
         leave depth open. Coverage: share of the picture with such points. Focal length: with one standard deviation.</p>\
         </section>\n",
    );
}

fn row(out: &mut String, shot: &ShotVerdict, line: &Timeline<'_>) {
    let (frames, _) = line.words(&shot.frames);
    let known = |text: String| if shot.registered > 0 { text } else { "–".to_owned() };
    let sigma = shot.sigma_ln_focal.map_or_else(|| "not determined".to_owned(), |s| format!("±{}", percent(s)));
    let focal =
        if shot.focal_px > 0.0 { format!("{} px, {sigma}", number(shot.focal_px, 0)) } else { "–".to_owned() };
    let cells = [
        ("Frames", frames),
        ("Verdict", shot.verdict.clone()),
        ("Registered", format!("{} of {}", shot.registered, shot.frames.len())),
        ("Points", shot.points.to_string()),
        ("Reprojection", known(format!("{} px", number(shot.reprojection_px, 2)))),
        ("Angle", known(format!("{}°", number(shot.angle_deg, 2)))),
        ("Coverage", known(percent(shot.coverage))),
        ("Focal length", known(focal)),
    ];
    out.push_str("<tr>");
    for (name, text) in cells {
        let _ = match name {
            "Verdict" => write!(out, "<th scope=\"row\">{}</th>", Text(text)),
            _ => write!(out, "<td data-name=\"{name}\">{}</td>", Text(text)),
        };
    }
    let _ = writeln!(out, "<td class=\"text\">{}</td></tr>", Text(&shot.reason));
}
