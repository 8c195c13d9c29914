//! Which mode drew which frames, and why: a strip over time and a table.

use std::fmt::Write;

use super::data::{Report, Segment};
use super::escape::Text;
use super::figures::{percent, shift};
use super::timeline::Timeline;

/// Share of the strip from which a segment has room for its number, and for its mode as well.
const ROOM: (f64, f64) = (0.05, 0.25);

/// Style of a mode; modes that are not known share one.
pub(super) fn class(mode: &str) -> &'static str {
    match mode {
        "unchanged" => "mode unchanged",
        "similarity" => "mode similarity",
        "rotation" => "mode rotation",
        "homography" => "mode homography",
        "mesh" => "mode mesh",
        "subspace" => "mode subspace",
        "3d" => "mode in-space",
        _ => "mode",
    }
}

/// Appends the section.
pub(super) fn section(out: &mut String, report: &Report, line: &Timeline<'_>) {
    if report.segments.is_empty() {
        return;
    }
    out.push_str("<section aria-labelledby=\"segments\"><h2 id=\"segments\">How each part was drawn</h2>\n");
    strip(out, &report.segments, line);
    table(out, &report.segments, line);
    out.push_str("</section>\n");
}

fn strip(out: &mut String, segments: &[Segment], line: &Timeline<'_>) {
    out.push_str("<figure class=\"plot\"><figcaption><h3>Mode over time</h3><ul class=\"legend\">");
    let mut modes: Vec<&str> = Vec::new();
    for segment in segments {
        if !modes.contains(&segment.mode.as_str()) {
            modes.push(&segment.mode);
            let _ = write!(out, "<li><b class=\"{}\"></b>{}</li>", class(&segment.mode), Text(&segment.mode));
        }
    }
    out.push_str("</ul></figcaption><svg class=\"strip\" role=\"img\" aria-label=\"Mode of each segment over time\">");
    for (i, segment) in segments.iter().enumerate() {
        let (x, width) = line.span(&segment.frames);
        let number = i + 1;
        let label = match width {
            w if w >= ROOM.1 => format!("{number} · {}", segment.mode),
            w if w >= ROOM.0 => number.to_string(),
            _ => String::new(),
        };
        let (x, width, class) = (100.0 * x, 100.0 * width, class(&segment.mode));
        let _ = write!(
            out,
            "<svg class=\"{class}\" x=\"{x:.3}%\" width=\"{width:.3}%\" height=\"100%\"><title>{}</title>\
             <rect width=\"100%\" height=\"100%\"/><line y2=\"100%\"/><text x=\"50%\" y=\"50%\">{}</text></svg>",
            Text(format!("{number}: {}, {}", segment.mode, segment.reason)),
            Text(label)
        );
    }
    for (share, label) in line.axis.ticks() {
        let x = 100.0 * share;
        let _ = write!(out, "<rect class=\"tick\" x=\"{x:.2}%\" y=\"100%\" width=\"1\" height=\"4\"/>");
        let _ = write!(out, "<text class=\"x\" x=\"{x:.2}%\" y=\"100%\" dy=\"1.35em\">{} s</text>", Text(label));
    }
    out.push_str("</svg></figure>\n");
}

fn table(out: &mut String, segments: &[Segment], line: &Timeline<'_>) {
    out.push_str(
        "<table class=\"stacked\"><caption>Segments, with the reason for each mode</caption><thead><tr>\
         <th scope=\"col\">No.</th><th scope=\"col\">Mode</th><th scope=\"col\">Frames</th><th scope=\"col\">Time</th>\
         <th scope=\"col\">Kept</th><th scope=\"col\">Shake</th><th scope=\"col\">Why</th></tr></thead><tbody>\n",
    );
    for (i, segment) in segments.iter().enumerate() {
        let (frames, time) = line.words(&segment.frames);
        let kept = segment.crop.map_or_else(|| "–".to_owned(), percent);
        let shake = segment.shake.map_or_else(|| "–".to_owned(), |s| shift(s.before.px, s.after.px));
        let _ = writeln!(
            out,
            "<tr><td data-name=\"No.\">{}</td><th scope=\"row\"><b class=\"{}\"></b>{}</th><td data-name=\"Frames\">{frames}</td>\
             <td data-name=\"Time\">{time}</td><td data-name=\"Kept\">{kept}</td><td data-name=\"Shake\">{shake}</td>\
             <td class=\"text\">{}</td></tr>",
            i + 1,
            class(&segment.mode),
            Text(&segment.mode),
            Text(&segment.reason)
        );
    }
    out.push_str("</tbody></table>\n");
}
