//! The page as a whole.

use std::fmt::Write;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::data::{Change, Moment, Report};
use super::escape::Text;
use super::pictures::Picture;
use super::plot::chart;
use super::timeline::Timeline;
use super::{cameras, figures, segments};

/// The look of the page; it may hold none of the letters that XML needs for itself.
pub(super) const STYLE: &str = include_str!("style.css");

/// What the browser may load: what is inside the page, and nothing else.
pub(super) const POLICY: &str = "default-src 'none'; img-src data:; style-src 'unsafe-inline'";

/// The page: HTML that is well-formed XML as well.
pub fn page(report: &Report) -> String {
    let line = Timeline::of(report);
    let mut out = String::new();
    head(&mut out, report);
    figures::glance(&mut out, report);
    warnings(&mut out, &report.warnings);
    out.push_str("</header>\n<main>\n");
    moments(&mut out, report, &line);
    path(&mut out, report, &line);
    segments::section(&mut out, report, &line);
    if let Some(cameras) = &report.cameras {
        cameras::section(&mut out, cameras, &line);
    }
    figures::table(&mut out, report);
    let version = env!("CARGO_PKG_VERSION");
    let _ = write!(out, "</main>\n<footer><p>Made by plumbline {version}.</p></footer>\n</body>\n</html>\n");
    out
}

fn head(out: &mut String, report: &Report) {
    let name = Text(report.clip.short_name());
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <meta name=\"color-scheme\" content=\"light dark\"/>\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{}\"/>\n\
         <link rel=\"icon\" href=\"data:,\"/>\n<title>{name} – stabilization report</title>\n<style>\n{STYLE}</style>\n\
         </head>\n<body>\n<header>\n<p class=\"kind\">Stabilization report</p>\n<h1>{name}</h1>\n<p>{}</p>\n",
        Text(POLICY),
        Text(subtitle(report))
    );
}

/// Size, length and shots in one line.
fn subtitle(report: &Report) -> String {
    let ((width, height), frames) = (report.clip.shown_size(), report.times_s.len());
    let mut parts =
        vec![format!("{width}×{height} px"), format!("{frames} {}", if frames == 1 { "frame" } else { "frames" })];
    let (Some(first), Some(last)) = (report.times_s.first(), report.times_s.last()) else { return parts.join(" · ") };
    if frames > 1 {
        // The last frame is shown as long as the others.
        let seconds = (last - first) * frames as f64 / (frames - 1) as f64;
        parts.push(format!("{seconds:.1} s"));
    }
    if report.shots.len() > 1 {
        parts.push(format!("{} shots", report.shots.len()));
    }
    parts.join(" · ")
}

fn warnings(out: &mut String, warnings: &[String]) {
    if warnings.is_empty() {
        return;
    }
    out.push_str("<aside class=\"warnings\" aria-label=\"Warnings\"><h2>Please note</h2><ul>");
    for warning in warnings {
        let _ = write!(out, "<li>{}</li>", Text(warning));
    }
    out.push_str("</ul></aside>\n");
}

fn moments(out: &mut String, report: &Report, line: &Timeline<'_>) {
    if report.moments.is_empty() {
        return;
    }
    out.push_str(
        "<section aria-labelledby=\"frames\"><h2 id=\"frames\">Frames</h2>\n<p class=\"note\">Of each part of the clip the frame that was moved \
         most: the original, then the result.</p>\n<div class=\"moments\">\n",
    );
    for Moment { frame, what, pictures: Change { before, after } } in &report.moments {
        let tall = if before.height > before.width { " tall" } else { "" };
        let _ = write!(out, "<figure class=\"moment{tall}\"><div>");
        picture(out, before, "original", *frame);
        picture(out, after, "result", *frame);
        let time = line.times_s.get(*frame).map_or_else(String::new, |t| format!(", {t:.2} s"));
        let _ = writeln!(out, "</div><figcaption><b>Frame {frame}{time}</b> {}</figcaption></figure>", Text(what));
    }
    out.push_str("</div></section>\n");
}

fn picture(out: &mut String, picture: &Picture, label: &str, frame: usize) {
    let alt = format!("Frame {frame} of the {label}");
    let (width, height) = (picture.width, picture.height);
    let _ = write!(
        out,
        "<span><img alt=\"{}\" width=\"{width}\" height=\"{height}\" src=\"data:image/jpeg;base64,",
        Text(alt)
    );
    STANDARD.encode_string(&picture.jpeg, out);
    let _ = write!(out, "\"/><small>{label}</small></span>");
}

fn path(out: &mut String, report: &Report, line: &Timeline<'_>) {
    if report.path.is_empty() && report.crop_over_time.is_none() {
        return;
    }
    out.push_str("<section aria-labelledby=\"path\"><h2 id=\"path\">Path of the camera</h2>\n");
    let _ = write!(out, "<p class=\"note\">{}</p>\n<div class=\"plots\">", Text(&report.path_note));
    report.path.iter().chain(&report.crop_over_time).for_each(|c| chart(out, c, line));
    out.push_str("</div></section>\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Cameras, Chart, Clip, Curve, Curves, Segment, ShotVerdict};

    /// A page with something in each of its parts.
    fn full() -> Report {
        let curve = |name: &str| Curve { name: name.to_owned(), values: vec![0.0, 1.0, f64::NAN, 2.0] };
        let two = Curves::Two(Change { before: curve("original"), after: curve("result") });
        let chart = |title: &str| Chart {
            title: title.to_owned(),
            unit: "px".to_owned(),
            least_span: 1.0,
            curves: two.clone(),
        };
        let picture = Picture { jpeg: vec![1, 2, 3], width: 4, height: 3 };
        let segment = |frames, mode: &str| Segment {
            frames,
            mode: mode.to_owned(),
            reason: "a < b".to_owned(),
            ..Segment::default()
        };
        Report {
            clip: Clip { name: "<b>&\".mp4".to_owned(), size: (640, 360), rotation: 90, fps: Some(25.0) },
            times_s: vec![0.0, 0.04, 0.08, 0.12],
            shots: vec![0..2, 2..4],
            segments: vec![segment(0..2, "mesh"), segment(2..4, "something new")],
            path: vec![chart("x & y")],
            path_note: "where it looked".to_owned(),
            crop_over_time: Some(Chart { curves: Curves::One(curve("kept")), ..Chart::default() }),
            cameras: Some(Cameras { shots: vec![ShotVerdict::default()], path: vec![chart("z")] }),
            moments: vec![Moment {
                frame: 2,
                what: "moved".to_owned(),
                pictures: Change { before: picture.clone(), after: picture },
            }],
            warnings: vec!["mind the <gap>".to_owned()],
            ..Report::default()
        }
    }

    /// Fails unless tags close in the order in which they open.
    fn well_formed(page: &str) {
        let mut open: Vec<&str> = Vec::new();
        let (_, mut rest) = page.split_once("<!DOCTYPE html>").expect("a doctype");
        while let Some((_, tag)) = rest.split_once('<') {
            let (tag, after) = tag.split_once('>').expect("tags end");
            rest = after;
            assert_eq!(tag.matches('"').count() % 2, 0, "quotes are paired: {tag}");
            let name = tag.split([' ', '/']).find(|w| !w.is_empty()).expect("a name");
            if tag.starts_with('/') {
                assert_eq!(open.pop(), Some(name), "closed in order");
            } else if !tag.ends_with('/') {
                open.push(name);
            }
        }
        assert!(open.is_empty(), "{open:?} stay open");
    }

    #[test]
    fn a_page_is_well_formed_whatever_it_contains() {
        well_formed(&page(&full()));
        well_formed(&page(&Report::default()));
        assert!(!STYLE.contains(['<', '&']), "a style sheet that XML can hold");
    }

    #[test]
    fn names_are_text_and_nothing_leads_out_of_the_page() {
        let page = page(&full());
        assert!(page.contains("<title>&lt;b&gt;&amp;&quot;.mp4 – stabilization report</title>"));
        assert!(!page.contains("<b>&") && !page.contains("://") && !page.contains("<script"));
        for target in page.split("src=\"").skip(1).chain(page.split("href=\"").skip(1)) {
            assert!(target.starts_with("data:"), "{}", &target[..40.min(target.len())]);
        }
    }

    #[test]
    fn a_page_is_named_after_the_file_and_has_its_size_as_shown() {
        let page = |name: &str, rotation| {
            let clip = Clip { name: name.to_owned(), size: (640, 360), rotation, fps: None };
            page(&Report { clip, times_s: vec![0.0, 0.5], ..Report::default() })
        };
        let turned = page("a/b c.mp4", 270);
        assert!(turned.contains("<h1>b c.mp4</h1>\n<p>360×640 px · 2 frames · 1.0 s</p>"));
        assert!(turned.contains("<td>a/b c.mp4</td>") && turned.contains("640×360 px, shown turned by 270°"));
        assert!(page("frames/", 180).contains("<h1>frames</h1>\n<p>640×360 px"));
        assert!(page("-", 0).contains("<h1>-</h1>"));
    }

    #[test]
    fn every_part_is_there_once_and_left_out_where_there_is_nothing_to_tell() {
        let (full, empty) = (page(&full()), page(&Report::default()));
        for part in ["id=\"frames\"", "id=\"path\"", "id=\"segments\"", "id=\"space\"", "class=\"warnings\""] {
            assert_eq!((full.matches(part).count(), empty.matches(part).count()), (1, 0), "{part}");
        }
        assert_eq!((full.matches("id=\"figures\"").count(), empty.matches("id=\"figures\"").count()), (1, 1));
        assert_eq!((full.matches("<img ").count(), full.matches(" alt=\"Frame 2 of").count()), (2, 2));
    }
}
