//! Line plots over the frames of a clip, as SVG.
//!
//! The area of a plot is a square of [`SPAN`] units, stretched to whatever room the page has. A curve of more than a few points
//! per pixel is thinned column by column: of each column the first, the last, the least and the greatest value stay, in their
//! order, which draws the same pixels as all of them.
//!
//! # Reference
//! U. Jugel, Z. Jerzak, G. Hackenbroich, V. Markl: *M4: a visualization-oriented time series data aggregation*, VLDB 2014.

use std::fmt::Write;

use super::axis::Axis;
use super::data::{Change, Chart, Curve, Curves};
use super::escape::Text;
use super::segments::class;
use super::timeline::Timeline;

/// Units along each side of the plotted area.
const SPAN: f64 = 1000.0;

/// Columns that a thinned curve keeps: more than plots have pixels.
const COLUMNS: f64 = 1500.0;

/// Points up to which a curve is kept whole.
const FEW: usize = 6000;

/// Ticks of the vertical axis, about.
const TICKS: usize = 6;

/// Appends the figure of a chart.
pub(super) fn chart(out: &mut String, chart: &Chart, line: &Timeline<'_>) {
    let curves: Vec<(&Curve, &str)> = match &chart.curves {
        Curves::One(curve) => vec![(curve, "after")],
        Curves::Two(Change { before, after }) => vec![(before, "before"), (after, "after")],
    };
    let values = curves.iter().flat_map(|(c, _)| c.values.iter().copied());
    let axis = Axis::around(values, chart.least_span, TICKS);
    let names: Vec<&str> = curves.iter().map(|(c, _)| c.name.as_str()).collect();
    let unit = if chart.unit.is_empty() { String::new() } else { format!(" ({})", chart.unit) };
    let _ =
        write!(out, "<figure class=\"plot\"><figcaption><h3>{}<span>{}</span></h3>", Text(&chart.title), Text(unit));
    legend(out, &curves);
    let alt = format!("{} over time: {}", chart.title, names.join(" and "));
    let _ = write!(out, "</figcaption><svg class=\"plot\" role=\"img\" aria-label=\"{}\">", Text(alt));
    backdrop(out, line);
    axes(out, &axis, &line.axis);
    let _ =
        write!(out, "<svg viewBox=\"0 0 {SPAN} {SPAN}\" preserveAspectRatio=\"none\" width=\"100%\" height=\"100%\">");
    for (curve, class) in &curves {
        let _ = write!(out, "<path class=\"{class}\" d=\"{}\"/>", outline(&curve.values, &axis, line));
    }
    out.push_str("</svg></svg></figure>\n");
}

fn legend(out: &mut String, curves: &[(&Curve, &str)]) {
    out.push_str("<ul class=\"legend\">");
    for (curve, class) in curves {
        let _ = write!(out, "<li><i class=\"{class}\"></i>{}</li>", Text(&curve.name));
    }
    out.push_str("</ul>");
}

/// Every other shot shaded, and along the top the modes of the segments.
fn backdrop(out: &mut String, line: &Timeline<'_>) {
    for shot in line.shots.iter().skip(1).step_by(2) {
        let (x, width) = line.span(shot);
        let (x, width) = (100.0 * x, 100.0 * width);
        let _ = write!(out, "<rect class=\"shot\" x=\"{x:.3}%\" width=\"{width:.3}%\" height=\"100%\"/>");
    }
    for segment in line.segments {
        let (x, width) = line.span(&segment.frames);
        let (x, width, class) = (100.0 * x, 100.0 * width, class(&segment.mode));
        let _ = write!(out, "<rect class=\"{class}\" x=\"{x:.3}%\" width=\"{width:.3}%\" y=\"-5\" height=\"4\"/>");
    }
}

/// Grid, ticks and labels.
fn axes(out: &mut String, vertical: &Axis, horizontal: &Axis) {
    for (share, label) in vertical.ticks() {
        let y = 100.0 * (1.0 - share);
        let _ = write!(out, "<line class=\"grid\" x2=\"100%\" y1=\"{y:.2}%\" y2=\"{y:.2}%\"/>");
        let _ = write!(out, "<text class=\"y\" x=\"-6\" y=\"{y:.2}%\">{}</text>", Text(label));
    }
    out.push_str("<line class=\"axis\" x2=\"100%\" y1=\"100%\" y2=\"100%\"/>");
    for (share, label) in horizontal.ticks() {
        let x = 100.0 * share;
        let _ = write!(out, "<rect class=\"tick\" x=\"{x:.2}%\" y=\"100%\" width=\"1\" height=\"4\"/>");
        let _ = write!(out, "<text class=\"x\" x=\"{x:.2}%\" y=\"100%\" dy=\"1.35em\">{} s</text>", Text(label));
    }
}

/// The path of a curve. It is interrupted by what is not finite, and by cuts.
fn outline(values: &[f64], axis: &Axis, line: &Timeline<'_>) -> String {
    let mut out = String::new();
    for shot in line.shots {
        let shot = shot.start..shot.end.min(values.len());
        let mut frame = shot.start;
        while frame < shot.end {
            let run = values[frame..shot.end].iter().take_while(|v| v.is_finite()).count();
            let point = |f: usize| (SPAN * line.at(f), SPAN * (1.0 - axis.share(values[f])));
            let points: Vec<(f64, f64)> = (frame..frame + run).map(point).collect();
            stroke(&mut out, &if values.len() > FEW { thinned(&points) } else { points });
            frame += run.max(1);
        }
    }
    out
}

/// One uninterrupted line; a lone point is a dot.
fn stroke(out: &mut String, points: &[(f64, f64)]) {
    for (i, (x, y)) in points.iter().enumerate() {
        let _ = write!(out, "{}{x:.1} {y:.1}", if i == 0 { 'M' } else { 'L' });
    }
    if let [(x, y)] = points {
        let _ = write!(out, "L{x:.1} {y:.1}");
    }
}

/// Of every column the points that its pixels need.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let column = |p: &(f64, f64)| (p.0 * COLUMNS / SPAN) as i64;
    let mut out = Vec::new();
    for part in points.chunk_by(|a, b| column(a) == column(b)) {
        let by_height = |a: &usize, b: &usize| part[*a].1.total_cmp(&part[*b].1);
        let (least, most) = ((0..part.len()).min_by(by_height), (0..part.len()).max_by(by_height));
        let mut kept: Vec<usize> = [Some(0), least, most, Some(part.len() - 1)].into_iter().flatten().collect();
        kept.sort_unstable();
        kept.dedup();
        out.extend(kept.into_iter().map(|i| part[i]));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Report;

    fn report(frames: usize, cut: usize) -> Report {
        Report {
            times_s: (0..frames).map(|f| f as f64 / 25.0).collect(),
            shots: if cut > 0 { vec![0..cut, cut..frames] } else { std::iter::once(0..frames).collect() },
            ..Report::default()
        }
    }

    /// The strokes of a path, as points.
    fn strokes(d: &str) -> Vec<Vec<(f64, f64)>> {
        let point = |p: &str| {
            let (x, y) = p.split_once(' ').expect("two numbers");
            (x.parse().expect("x"), y.parse().expect("y"))
        };
        d.split('M').skip(1).map(|s| s.split('L').map(point).collect()).collect()
    }

    #[test]
    fn points_lie_where_the_axes_say() {
        let report = report(5, 0);
        let line = Timeline::of(&report);
        let values = [0.0, 10.0, 5.0, -10.0, 2.5];
        let axis = Axis::exact(-10.0, 10.0, 4);
        let drawn = strokes(&outline(&values, &axis, &line));
        let wanted = [(0.0, 500.0), (250.0, 0.0), (500.0, 250.0), (750.0, 1000.0), (1000.0, 375.0)];
        assert_eq!(drawn, [wanted.to_vec()]);
    }

    #[test]
    fn what_is_not_finite_and_a_cut_are_gaps() {
        let report = report(8, 5);
        let line = Timeline::of(&report);
        let values = [1.0, 2.0, f64::NAN, f64::INFINITY, 1.0, 2.0, 3.0, 4.0];
        let axis = Axis::around(values.into_iter(), 0.0, 4);
        let drawn = strokes(&outline(&values, &axis, &line));
        let lengths: Vec<usize> = drawn.iter().map(Vec::len).collect();
        assert!(drawn.iter().flatten().all(|(x, y)| x.is_finite() && y.is_finite()), "{drawn:?}");
        assert_eq!(lengths, [2, 2, 3], "two, a dot of two equal points, and the shot after the cut");
        assert_eq!(outline(&[f64::NAN; 8], &axis, &line), "");
        assert_eq!(outline(&[], &axis, &line), "");
    }

    #[test]
    fn one_frame_is_a_dot_in_the_middle_and_a_constant_a_line_through_it() {
        let one = report(1, 0);
        let axis = Axis::around([7.0].into_iter(), 0.0, 4);
        assert_eq!(outline(&[7.0], &axis, &Timeline::of(&one)), "M500.0 500.0L500.0 500.0");
        let three = report(3, 0);
        assert_eq!(outline(&[7.0; 3], &axis, &Timeline::of(&three)), "M0.0 500.0L500.0 500.0L1000.0 500.0");
    }

    #[test]
    fn a_thinned_curve_keeps_its_ends_and_every_extreme_of_every_column() {
        let mut random = fastrand::Rng::with_seed(3);
        let n = 50_000;
        let points: Vec<(f64, f64)> = (0..n).map(|i| (SPAN * f64::from(i) / f64::from(n - 1), random.f64())).collect();
        let kept = thinned(&points);
        assert!(kept.len() <= 4 * (COLUMNS as usize + 1), "{}", kept.len());
        assert_eq!((kept.first(), kept.last()), (points.first(), points.last()));
        assert!(kept.windows(2).all(|w| w[0].0 < w[1].0), "in order");
        let extremes = |points: &[(f64, f64)], column: i64| {
            let inside = points.iter().filter(|p| (p.0 * COLUMNS / SPAN) as i64 == column).map(|p| p.1);
            inside.fold((f64::MAX, f64::MIN), |(a, b), y| (a.min(y), b.max(y)))
        };
        for column in [0, 1, 700, 1499, 1500] {
            assert_eq!(extremes(&points, column), extremes(&kept, column), "{column}");
        }
    }
}
