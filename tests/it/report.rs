//! The page of `--report`, as the built program writes it.

use std::path::Path;

use crate::support::clips::{make, shaky, workshop};
use crate::support::program::{err, names, out, plumbline_in, succeed};

/// `clip.mp4`: 40 shaky frames.
fn clip(folder: &Path) {
    make(folder, "clip.mp4", &format!("{} -c:v libx264 -crf 12 -preset ultrafast -pix_fmt yuv420p", shaky(1.6)));
}

fn page(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).expect("a page")
}

/// Fails unless tags close in the order in which they open.
fn well_formed(page: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page.strip_prefix("<!DOCTYPE html>").expect("a doctype");
    while let Some((_, tag)) = rest.split_once('<') {
        let (tag, after) = tag.split_once('>').expect("tags end");
        rest = after;
        let name = tag.trim_start_matches('/').split([' ', '/']).next().expect("a name");
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name), "closed in order");
        } else if !tag.ends_with('/') {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?} stay open");
}

#[test]
fn a_page_describes_the_run_and_needs_nothing_else() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    let args = ["stabilize", "clip.mp4", "-o", "steady.mp4", "--report", "page.html", "--compare", "--mode", "mesh"];
    let ran = succeed(folder, &args);
    assert_eq!(out(&ran), "steady.mp4\nsteady.compare.mp4\npage.html\n", "the page is a result too");
    assert_eq!(names(folder), ["clip.mp4", "page.html", "steady.compare.mp4", "steady.mp4"]);
    let page = page(folder, "page.html");
    well_formed(&page);
    assert!(!page.contains("://") && !page.contains("<script"), "no host, no script");
    for told in ["<title>clip.mp4 – ", "320×180 px", "40 frames", "1.6 s", "steady.mp4, steady.compare.mp4", "libx264"]
    {
        assert!(page.contains(told), "{told}");
    }
    for chart in ["Shake", "x, to the right", "y, down", "Angle, clockwise", "Zoom", "Picture kept", "Mode over time"] {
        assert!(page.contains(&format!("<h3>{chart}<")), "{chart}");
    }
    assert_eq!((page.matches("<path class=\"before\"").count(), page.matches("<path class=\"after\"").count()), (5, 6));
    assert_eq!((page.matches(" of the original\"").count(), page.matches(" of the result\"").count()), (6, 6));
    assert_eq!(page.matches("src=\"data:image/jpeg;base64,/9j/").count(), 12);
    let curves = page.split(" d=\"").skip(1).filter_map(|d| d.split('"').next());
    assert!(curves.into_iter().all(|d| d.starts_with("M0.0 ") && !d.contains(|c: char| !"ML0123456789. ".contains(c))));
    assert!(!page.contains("id=\"space\""), "no cameras in space were looked for");
    // The summary and the page are of one run.
    let shake =
        err(&ran).split_once("shake     before ").and_then(|(_, s)| s.split_once(" px")).map(|s| s.0.to_owned());
    assert!(page.contains(&format!("<dd>{} → ", shake.expect("a shake"))));
}

#[test]
fn cameras_in_space_are_reported_with_their_figures() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    succeed(folder, &["stabilize", "clip.mp4", "-o", "steady.mp4", "--report", "page.html", "--mode", "3d"]);
    let page = page(folder, "page.html");
    well_formed(&page);
    for told in ["id=\"space\"", "Reprojection", "Focal length", "<td data-name=\"Registered\">"] {
        assert!(page.contains(told), "{told}");
    }
}

#[test]
fn the_page_does_not_depend_on_the_number_of_threads() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    let run = |threads: &str| {
        let args = ["stabilize", "clip.mp4", "-o", "steady.mkv", "--report", "page.html", "--overwrite", "--end", "1"];
        succeed(folder, &[&args[..], &["--codec", "ffv1", "--threads", threads]].concat());
        page(folder, "page.html")
    };
    assert!(run("1") == run("3"), "the same bytes");
}

#[test]
fn a_page_that_exists_is_refused_before_any_work() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    std::fs::write(folder.join("page.html"), "mine").expect("written");
    let args = ["stabilize", "clip.mp4", "-o", "steady.mp4", "--report", "page.html"];
    let refused = plumbline_in(folder, &args);
    assert_eq!(refused.status.code(), Some(73));
    assert!(err(&refused).contains("`page.html` exists"), "{}", err(&refused));
    assert_eq!((page(folder, "page.html").as_str(), names(folder).len()), ("mine", 2));
    succeed(folder, &[&args[..], &["--overwrite"]].concat());
    assert!(page(folder, "page.html").starts_with("<!DOCTYPE html>"));
}

#[test]
fn a_report_of_another_format_or_for_standard_output_is_refused() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    std::fs::copy(folder.join("clip.mp4"), folder.join("other.mp4")).expect("copied");
    let stabilize = |args: &[&str]| {
        let refused = plumbline_in(folder, &[&["stabilize"], args].concat());
        assert_eq!(refused.status.code(), Some(2), "{args:?}");
        err(&refused)
    };
    let other = stabilize(&["clip.mp4", "-o", "out.mp4", "--report", "page.txt"]);
    assert!(other.contains("`page.txt` is no name for a report (expected the extension .html or .json)"), "{other}");
    let standard = stabilize(&["clip.mp4", "-o", "out.mp4", "--report", "-"]);
    assert!(standard.contains("a report cannot be written to standard output"), "{standard}");
    std::fs::rename(folder.join("other.mp4"), folder.join("other.html")).expect("renamed");
    let input = stabilize(&["other.html", "-o", "out.mp4", "--report", "other.html"]);
    assert!(input.contains("would be written over its input"), "{input}");
    let twice = stabilize(&["clip.mp4", "-o", "out.html", "--report", "out.html"]);
    assert!(twice.contains("would be written twice"), "{twice}");
    assert_eq!(names(folder), ["clip.mp4", "other.html"]);
}

/// A pipeline over two clips whose pages are `path`, with no other result.
fn pipeline(path: &str) -> String {
    let stage = |name: &str, kind: &str, rest: &str| format!("[stage.{name}]\nuse = \"video.{kind}\"\n{rest}\n");
    let stages = [
        stage("source", "decode", "path = \"${item.path}\""),
        stage("tracks", "track", "inputs = [\"source\"]"),
        stage("motion", "motion", "inputs = [\"tracks\"]"),
        stage("path", "smooth", "inputs = [\"motion\"]"),
        stage("warp", "warp", "inputs = { tracks = \"tracks\", path = \"path\", motion = \"motion\" }"),
        stage("steady", "render", "inputs = { frames = \"source\", warps = [\"warp\"] }"),
        stage("page", "report", &format!("inputs = [\"steady\", \"path\", \"motion\"]\npath = \"{path}\"")),
    ];
    format!("version = 1\n[batch]\nforeach = [\"a.mp4\", \"b.mp4\"]\n{}", stages.concat())
}

#[test]
fn a_pipeline_may_write_pages_alone_each_with_a_name_of_its_own() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    for name in ["a.mp4", "b.mp4"] {
        std::fs::copy(folder.join("clip.mp4"), folder.join(name)).expect("copied");
    }
    std::fs::write(folder.join("one.toml"), pipeline("page.html")).expect("written");
    std::fs::write(folder.join("each.toml"), pipeline("${item.stem}.html")).expect("written");
    let refused = plumbline_in(folder, &["run", "one.toml"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(err(&refused).contains("`page.html` would be written twice"), "{}", err(&refused));
    succeed(folder, &["run", "each.toml"]);
    for name in ["a", "b"] {
        let page = page(folder, &format!("{name}.html"));
        well_formed(&page);
        assert!(page.contains(&format!("<h1>{name}.mp4</h1>")) && page.matches("<img ").count() == 12);
    }
}
