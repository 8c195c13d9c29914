//! The figures of a run: the few that matter at a glance, and all of them before and after.

use std::fmt::Write;

use super::axis::number;
use super::data::Report;
use super::escape::Text;
use plumbline_video::stabilize::ShakeSummary;

/// A share as percent.
pub(super) fn percent(share: f64) -> String {
    format!("{} %", number(100.0 * share, 1))
}

/// Shake before and after, px.
pub(super) fn shift(before: f64, after: f64) -> String {
    format!("{} → {}\u{a0}px", number(before, 2), number(after, 2))
}

/// Appends the figures at a glance.
pub(super) fn glance(out: &mut String, report: &Report) {
    out.push_str("<dl class=\"glance\">");
    let mut card = |name: &str, value: &str, note: &str| {
        let (name, value, note) = (Text(name), Text(value), Text(note));
        let _ = write!(out, "<div><dt>{name}</dt><dd>{value}</dd><dd class=\"note\">{note}</dd></div>");
    };
    if let Some(ShakeSummary { before, after }) = report.shake {
        card("Shake", &shift(before.px, after.px), &left(before.px, after.px));
        let angle = format!("{}° → {}°", number(before.deg, 2), number(after.deg, 2));
        card("Shake, angle", &angle, &left(before.deg, after.deg));
    }
    if let Some(crop) = report.crop {
        let least = crop.least.map(|l| format!("; least {}", percent(l))).unwrap_or_default();
        card("Picture kept", &percent(crop.mean), &format!("of width and height{least}"));
    }
    if let Some((mode, share)) = main_mode(report) {
        card("Drawn by", mode, &format!("in {} % of the frames", number(100.0 * share, 0)));
    }
    out.push_str("</dl>\n");
}

/// What is left of a shake.
fn left(before: f64, after: f64) -> String {
    if before > 0.0 { format!("{} % is left", number(100.0 * after / before, 0)) } else { "there was none".to_owned() }
}

/// The mode of most frames, and their share.
fn main_mode(report: &Report) -> Option<(&str, f64)> {
    let frames = |mode: &str| report.segments.iter().filter(|s| s.mode == mode).map(|s| s.frames.len()).sum::<usize>();
    let all: usize = report.segments.iter().map(|s| s.frames.len()).sum();
    // Of modes with as many frames, the first on the clip.
    let mode = report.segments.iter().rev().max_by_key(|s| frames(&s.mode))?.mode.as_str();
    (all > 0).then(|| (mode, frames(mode) as f64 / all as f64))
}

/// Appends the table of all figures, before and after.
pub(super) fn table(out: &mut String, report: &Report) {
    out.push_str(
        "<section aria-labelledby=\"figures\"><h2 id=\"figures\">Before and after</h2>\n<table class=\"files\"><thead><tr><td></td>\
         <th scope=\"col\">Original</th><th scope=\"col\">Result</th></tr></thead><tbody>\n",
    );
    for (name, before, after) in rows(report) {
        let (name, before, after) = (Text(name), Text(before), Text(after));
        let _ = writeln!(out, "<tr><th scope=\"row\">{name}</th><td>{before}</td><td>{after}</td></tr>");
    }
    out.push_str(
        "</tbody></table>\n<p class=\"note\">Shake is how far the picture strays from its own course, the mean over half a \
         second: root of the mean square over the frames, as the camera moved before and as it is shown after.</p></section>\n",
    );
}

type Row = (&'static str, String, String);

fn rows(report: &Report) -> Vec<Row> {
    let none = || "–".to_owned();
    let (clip, outcome) = (&report.clip, &report.outcome);
    let size = |(w, h): (u32, u32)| format!("{w}×{h} px");
    let turned = if clip.rotation == 0 { String::new() } else { format!(", shown turned by {}°", clip.rotation) };
    let of_size = |s: (u32, u32)| format!("{}{turned}", size(s));
    let mut rows = vec![
        ("File", clip.name.clone(), if outcome.files.is_empty() { none() } else { outcome.files.join(", ") }),
        ("Picture", of_size(clip.size), outcome.size.map_or_else(none, of_size)),
        ("Frames", report.times_s.len().to_string(), outcome.size.map_or_else(none, |_| outcome.frames.to_string())),
    ];
    if let Some(fps) = clip.fps {
        let text = number(fps, 3);
        let text = format!("{} per second", text.trim_end_matches('0').trim_end_matches('.'));
        rows.push(("Frame rate", text.clone(), text));
    }
    if let Some(ShakeSummary { before, after }) = report.shake {
        rows.push(("Shake", format!("{} px", number(before.px, 2)), format!("{} px", number(after.px, 2))));
        rows.push(("Shake, angle", format!("{}°", number(before.deg, 2)), format!("{}°", number(after.deg, 2))));
    }
    if let Some(crop) = report.crop {
        let least = crop.least.map(|l| format!(", least {}", percent(l))).unwrap_or_default();
        rows.push(("Width and height kept", percent(1.0), format!("{}{least}", percent(crop.mean))));
    }
    if let Some(readout) = report.readout_s {
        rows.push(("Rolling shutter", format!("{} ms readout", number(1e3 * readout, 1)), "corrected".to_owned()));
    }
    rows.extend(outcome.encoder.clone().map(|encoder| ("Encoder", none(), encoder)));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Segment;
    use plumbline_video::stabilize::Shake;

    fn segment(frames: std::ops::Range<usize>, mode: &str) -> Segment {
        Segment { frames, mode: mode.to_owned(), ..Segment::default() }
    }

    #[test]
    fn the_main_mode_is_that_of_most_frames_and_of_two_alike_the_first() {
        let of = |segments: Vec<Segment>| {
            let report = Report { segments, ..Report::default() };
            main_mode(&report).map(|(mode, share)| (mode.to_owned(), share))
        };
        let parts = vec![segment(0..10, "mesh"), segment(10..22, "3d"), segment(22..30, "mesh")];
        assert_eq!(of(parts), Some(("mesh".to_owned(), 0.6)));
        assert_eq!(of(vec![segment(0..5, "3d"), segment(5..10, "mesh")]), Some(("3d".to_owned(), 0.5)));
        assert_eq!(of(Vec::new()), None);
    }

    #[test]
    fn a_figure_that_is_not_known_is_left_out_or_a_dash() {
        let rows = rows(&Report::default());
        assert_eq!(rows.iter().map(|r| r.0).collect::<Vec<_>>(), ["File", "Picture", "Frames"]);
        assert_eq!((rows[0].2.as_str(), rows[1].2.as_str()), ("–", "–"));
        let none = Shake { px: 0.0, deg: 0.0 };
        let steady = ShakeSummary { before: none, after: none };
        let mut out = String::new();
        glance(&mut out, &Report { shake: Some(steady), ..Report::default() });
        assert!(out.contains("<dd>0.00 → 0.00\u{a0}px</dd><dd class=\"note\">there was none</dd>"), "{out}");
    }
}
