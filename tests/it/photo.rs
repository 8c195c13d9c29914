//! Still pictures, by running the program: files in, files out, maps, batches, bad input.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use plumbline::app::cli::pipeline_of;
use plumbline::app::pipeline::draw::{GraphFormat, draw};
use plumbline::app::pipeline::shipped::shipped;
use plumbline::app::pipeline::{check, print, read};
use plumbline::image::still::{
    LoadOptions, Photo, SaveOptions, StillFormat, encode, frame_of_rgb, load, rgb_of_frame, size,
};
use plumbline::image::{Frame, Layout, PixelFormat};

use crate::pipeline::source;
use crate::support::program::{err, names, plumbline_in};

/// A picture with stripes, a disk and a gradient.
fn rgb(width: usize, height: usize) -> Vec<u8> {
    let pixel = |i: usize| {
        let (x, y) = (i % width, i / width);
        let disk = (x as f64 - 0.3 * width as f64).hypot(y as f64 - 0.5 * height as f64) < 0.2 * height as f64;
        let stripe = if (x / 16) % 2 == 0 { 200 } else { 60 };
        if disk { [230, 40, 30] } else { [stripe, (y * 255 / height) as u8, (x * 255 / width) as u8] }
    };
    (0..width * height).flat_map(pixel).collect()
}

fn photo(width: usize, height: usize) -> Photo {
    let frame = frame_of_rgb(&rgb(width, height), width, height).expect("as many as it takes");
    Photo::new(frame)
}

fn write(photo: &Photo, path: &Path) {
    let mut out = Cursor::new(Vec::new());
    let format = StillFormat::of_name(path).expect("a known name");
    encode(photo, format, SaveOptions::default(), &mut out).expect("it can be written");
    fs::write(path, out.into_inner()).expect("a file");
}

fn pixels(path: &Path) -> (Vec<[u8; 3]>, (usize, usize)) {
    let photo = load(path, LoadOptions::default()).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    (rgb_of_frame(&photo.frame).expect("a still frame"), (photo.frame.width, photo.frame.height))
}

#[test]
fn a_graph_without_a_map_resizes_and_one_that_changes_nothing_copies_every_sample() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write(&photo(300, 200), &folder.path().join("in.png"));
    for (setting, expected) in
        [("", (300, 200)), ("size = \"150x50\"\n", (150, 50)), ("size = \"450x300\"\n", (450, 300))]
    {
        let text = format!(
            "version = 1\n[stage.photo]\nuse = \"image.load\"\npath = \"in.png\"\n[stage.drawn]\nuse = \"image.render\"\n\
             inputs = [\"photo\"]\n{setting}[stage.out]\nuse = \"image.save\"\ninputs = [\"drawn\"]\npath = \"out.png\"\n"
        );
        fs::write(folder.path().join("job.toml"), text).expect("a small file");
        let run = plumbline_in(folder.path(), &["run", "job.toml", "--overwrite"]);
        assert_eq!(run.status.code(), Some(0), "{}", err(&run));
        let (after, size) = pixels(&folder.path().join("out.png"));
        assert_eq!(size, expected);
        if setting.is_empty() {
            assert_eq!(after, pixels(&folder.path().join("in.png")).0, "nothing to do costs nothing");
        }
    }
    assert_eq!(names(folder.path()), ["in.png", "job.toml", "out.png"]);
}

#[test]
fn pixels_of_photos_are_sampled_once() {
    for name in ["rectify", "retarget"] {
        let graph = read(shipped(name).expect("shipped"), &[]).expect("no faults").graph;
        let out = graph.stages.iter().position(|s| s.kind.name == "image.save").expect("a sink");
        assert_eq!(graph.resamples(out), 1, "{name}");
    }
    let twice = "version = 1\n[stage.photo]\nuse = \"image.load\"\npath = \"a.png\"\n[stage.one]\nuse = \"image.render\"\n\
                 inputs = [\"photo\"]\n[stage.two]\nuse = \"image.render\"\ninputs = [\"one\"]\n[stage.out]\nuse = \"image.save\"\n\
                 inputs = [\"two\"]\npath = \"b.png\"\n";
    let problems = read(source(twice), &[]).expect_err("two resamples");
    assert!(problems.problems.iter().any(|p| p.code == "two-resamples"), "{}", problems.render(false, 100));
}

#[test]
fn retarget_writes_picture_map_grid_and_report() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write(&photo(480, 320), &folder.path().join("a.jpg"));
    let args = ["retarget", "a.jpg", "-o", "b.png", "--size", "300x320", "--export-map", "m", "--report", "r.json"];
    let run = plumbline_in(folder.path(), &[&args[..], &["--faces", "off"]].concat());
    assert_eq!(run.status.code(), Some(0), "{}", err(&run));
    assert_eq!(names(folder.path()), ["a.jpg", "b.png", "m.exr", "m_mesh.npy", "m_x.npy", "m_y.npy", "r.json"]);
    assert_eq!(pixels(&folder.path().join("b.png")).1, (300, 320));
    let x = fs::read(folder.path().join("m_x.npy")).expect("written");
    let header = String::from_utf8_lossy(&x[10..128]).into_owned();
    assert!(header.contains("'shape': (320, 300,)"), "{header}");
    let value = |i: usize| f32::from_le_bytes(x[128 + 4 * i..132 + 4 * i].try_into().expect("four bytes"));
    // The border is exact: the outer half pixels of the output lie in those of the source.
    assert!(
        value(0) > -0.5 && value(0) < 1.0 && value(299) < 479.5 && value(299) > 478.0,
        "{} {}",
        value(0),
        value(299)
    );
    let report: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("r.json")).expect("written")).expect("JSON");
    assert_eq!(report["grid"]["folds"], 0);
    assert_eq!(report["output"]["size"], serde_json::json!([300, 320]));
    let grid = plumbline_in(
        folder.path(),
        &["retarget", "a.jpg", "-o", "g.png", "--size", "300x320", "--grid", "--faces", "off"],
    );
    assert_eq!(grid.status.code(), Some(0), "{}", err(&grid));
    assert_ne!(pixels(&folder.path().join("g.png")).0, pixels(&folder.path().join("b.png")).0);
}

#[test]
fn rectify_takes_a_lens_by_its_model_and_makes_fixed_projections_and_optimized_ones() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write(&photo(480, 360), &folder.path().join("a.jpg"));
    for to in ["perspective", "stereographic", "panini:0.7", "optimized"] {
        let args =
            ["rectify", "a.jpg", "-o", "b.png", "--lens", "equidistant", "--fov", "110", "--to", to, "--overwrite"];
        let run = plumbline_in(folder.path(), &[&args[..], &["--faces", "off", "--lines", "off"]].concat());
        assert_eq!(run.status.code(), Some(0), "{to}: {}", err(&run));
        let (w, h) = size(&folder.path().join("b.png"), LoadOptions::default()).expect("a picture");
        assert!(w.abs_diff(480) <= 1 && h > 100, "{to}: {w}×{h}");
    }
    let unknown = plumbline_in(folder.path(), &["rectify", "a.jpg", "-o", "c.png", "--lines", "off", "--faces", "off"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(err(&unknown).contains("the lens is not known"), "{}", err(&unknown));
}

#[test]
fn depth_and_transparency_go_through_a_map() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut frame = Frame::new(PixelFormat { layout: Layout::Gbr, bits: 16, alpha: true }, 90, 60);
    frame.color.full_range = Some(true);
    for (plane, y) in (0..4).flat_map(|p| (0..60).map(move |y| (p, y))) {
        frame.plane16_mut(plane).expect("16 bit").row_mut(y).fill(if plane == 3 { 65_535 } else { 12_345 + 257 });
    }
    write(&Photo { frame, ..photo(1, 1) }, &folder.path().join("a.tif"));
    let run = plumbline_in(folder.path(), &["retarget", "a.tif", "-o", "b.tiff", "--size", "60x60", "--faces", "off"]);
    assert_eq!(run.status.code(), Some(0), "{}", err(&run));
    let after = load(&folder.path().join("b.tiff"), LoadOptions::default()).expect("sound");
    assert_eq!(after.frame.format, PixelFormat { layout: Layout::Gbr, bits: 16, alpha: true });
    assert_eq!(after.frame.plane16(1).expect("16 bit").row(30)[30], 12_345 + 257);
}

#[test]
fn one_bad_file_does_not_stop_the_others() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in ["a.png", "b.png", "c.png"] {
        write(&photo(120, 80), &folder.path().join(name));
    }
    let whole = fs::read(folder.path().join("b.png")).expect("written");
    fs::write(folder.path().join("b.png"), &whole[..whole.len() / 2]).expect("half a file");
    fs::write(folder.path().join("notes.txt"), "no picture").expect("a small file");
    let args = ["retarget", ".", "--out-dir", "out", "--size", "2:3", "--lines", "off", "--faces", "off"];
    let run = plumbline_in(folder.path(), &args);
    assert_eq!(run.status.code(), Some(3), "{}", err(&run));
    assert!(err(&run).contains("1 of 3 items failed") && err(&run).contains("b.png: the file is"), "{}", err(&run));
    assert_eq!(names(&folder.path().join("out")), ["a.png", "c.png"], "nothing is left of the bad one");
    assert_eq!(pixels(&folder.path().join("out/a.png")).1, (53, 80));
}

#[test]
fn bad_input_and_bad_options_are_refused_with_words() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    write(&photo(64, 48), &at("a.png"));
    fs::write(at("move.gif"), b"GIF89a\x01\0\x01\0\0\0\0;").expect("a small file");
    fs::write(at("x.nef"), b"II*\0\x08\0\0\0").expect("a small file");
    fs::write(at("empty.jpg"), b"").expect("a small file");
    fs::write(at("exists.png"), b"").expect("a small file");
    let base = |input: &'static str, out: &'static str, size: &'static str| {
        vec!["retarget", input, "-o", out, "--size", size, "--lines", "off", "--faces", "off"]
    };
    let cases: [(&str, Vec<&str>, i32, &str); 12] = [
        ("gif", base("move.gif", "o.png", "9:16"), 65, "GIF is not read here"),
        ("raw", base("x.nef", "o.png", "9:16"), 65, "develop it"),
        ("empty", base("empty.jpg", "o.png", "9:16"), 65, "an empty file"),
        ("missing", base("none.png", "o.png", "9:16"), 65, "none.png: cannot be read"),
        ("format", base("a.png", "o.heic", "9:16"), 2, "ends like no picture that is written here"),
        ("zero", base("a.png", "o.png", "0x10"), 2, "no size"),
        ("huge", base("a.png", "o.png", "100000x10"), 2, "no size"),
        ("exists", base("a.png", "exists.png", "9:16"), 73, "--overwrite"),
        ("itself", base("a.png", "a.png", "9:16"), 2, "written over its input"),
        ("bomb", [base("a.png", "o.png", "9:16"), vec!["--max-pixels", "1000"]].concat(), 65, "--max-pixels"),
        ("stdin", base("-", "o.png", "9:16"), 2, "not read from standard input"),
        (
            "mask",
            [base("a.png", "o.png", "9:16"), vec!["--importance", "empty.jpg"]].concat(),
            65,
            "empty.jpg: an empty",
        ),
    ];
    for (name, args, code, message) in cases {
        let run = plumbline_in(folder.path(), &args);
        assert_eq!(run.status.code(), Some(code), "{name}: {}", err(&run));
        assert!(err(&run).contains(message), "{name}: {}", err(&run));
        assert!(!at("o.png").exists(), "{name}: nothing is written");
    }
}

#[test]
fn options_mean_a_pipeline_that_reads_back_as_the_same() {
    let cases: [&[&str]; 8] = [
        &["rectify", "a.jpg", "-o", "b.jpg"],
        &["rectify", "p/*.jpg", "q c.png", "--out-dir", "d/", "--lines", "off", "--faces", "off", "--jobs", "2"],
        &[
            "rectify",
            "odd ${x}.jpg",
            "-o",
            "b $${y}.tif",
            "--lens",
            "equidistant",
            "--fov",
            "150",
            "--fov-axis",
            "d",
            "--to",
            "panini:0.5",
            "--view",
            "-20,5",
            "--crop",
            "16:9",
            "--size",
            "1600x900",
            "--border",
            "mirror",
        ],
        &["retarget", "a.jpg", "-o", "b.webp", "--size", "9:16", "--importance", "m.png", "--lines", "auto"],
        &["retarget", "a.jpg", "-o", "b.jpg", "--size", "640x480", "--lines", "l.json", "--faces", "f.json", "--grid"],
        &[
            "retarget",
            "a.heic",
            "--out-dir",
            "d",
            "--size",
            "1:1",
            "--quality",
            "80",
            "--max-pixels",
            "1000000",
            "--interpolation",
            "lanczos3",
            "--overwrite",
        ],
        &["rectify", "a.png", "-o", "b.png", "--rectangle", "--crop", "16:9", "--save-lines", "l.json"],
        &["rectify", "a.jpg", "-o", "b.png", "--crop", "none", "--border", "transparent"],
    ];
    for (i, options) in cases.into_iter().enumerate() {
        let file = pipeline_of(["plumbline"].iter().chain(options)).expect("options in order");
        let printed = print(&file);
        let built = check(file).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        let loaded = read(source(&printed), &[]).unwrap_or_else(|p| panic!("{printed}\n{}", p.render(false, 100)));
        assert_eq!(loaded, built, "{printed}");
        insta::assert_snapshot!(format!("print_pipeline_{i}"), printed);
    }
    for (options, message) in [
        (
            &["rectify", "a.jpg", "-o", "b.jpg", "--rectangle", "--lens", "l.json"][..],
            "--lens does not go with --rectangle",
        ),
        (&["rectify", "a.jpg", "-o", "b.jpg", "--rectangle", "--crop", "none"], "does not go with --rectangle"),
        (&["rectify", "a.jpg", "-o", "b.jpg", "--lines", "off", "--save-lines", "l.json"], "nothing to write"),
        (&["rectify", "a.jpg", "-o", "b.jpg", "--suffix", "_x"], "cannot be used with"),
        (&["retarget", "a.jpg", "b.jpg", "-o", "c.jpg", "--size", "1:1"], "there are 2 pictures"),
        (&["rectify", "*.jpg", "-o", "c.jpg"], "may be many pictures"),
        (&["rectify", "a.jpg", "--suffix", "x/y"], "a part of a file's name"),
        (&["rectify", "a.jpg", "b.jpg", "--out-dir", "d", "--lines", "l.json"], "is for one picture"),
        (&["rectify", "a.jpg", "-o", "b.jpg", "--fov", "400"], "out of range (expected 1 to 360)"),
        (&["rectify", "a.jpg", "-o", "b.jpg", "--view", "0,100"], "no direction"),
        (&["rectify", "a.jpg", "-o", "b.jpg", "--to", "fish"], "no projection"),
        (&["retarget", "a.jpg", "-o", "b.jpg", "--size", "1:1", "--quality", "0"], "1..=100"),
    ] {
        let refused = pipeline_of(["plumbline"].iter().chain(options)).expect_err(message);
        assert!(refused.contains(message), "{refused}");
    }
}

#[test]
fn the_commands_build_the_shipped_graphs() {
    for (name, options) in [("rectify", &[][..]), ("retarget", &["--size", "1:1"])] {
        let base = ["plumbline", name, "a.jpg", "--out-dir", "d"];
        let built = check(pipeline_of(base.iter().chain(options)).expect("options in order")).expect("no faults");
        let read = read(shipped(name).expect("shipped"), &[]).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        assert_eq!(draw(&built.graph, GraphFormat::Mermaid), draw(&read.graph, GraphFormat::Mermaid));
        for stage in read.graph.stages.iter().filter(|s| !matches!(s.name.as_str(), "out" | "photo" | "lines")) {
            let ours = built.graph.stage(&stage.name).expect("the same stages");
            assert_eq!(ours.settings.to_json(), stage.settings.to_json(), "{name}: {}", stage.name);
        }
    }
}

#[test]
fn a_picture_of_one_pixel_across_is_rectified_without_lines() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    for (name, width, height) in [("row.png", 9000, 1), ("column.png", 1, 9000)] {
        write(&photo(width, height), &folder.join(name));
        let args = ["rectify", name, "--lens", "rectilinear", "--fov", "100", "-o", "out.png", "--overwrite"];
        let run = plumbline_in(folder, &args);
        // Where the view shows nothing of so narrow a picture, its options are at fault.
        assert!(matches!(run.status.code(), Some(0 | 2)), "{name}: {}", err(&run));
        assert!(!err(&run).contains("internal error"), "{name}: {}", err(&run));
    }
}
