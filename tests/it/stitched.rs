//! Stitched panoramas and irregular borders, by running the program.

use std::fs;
use std::path::Path;

use plumbline::image::still::{LoadOptions, Photo, SaveOptions, StillFormat, encode, frame_of_rgb, load, rgb_of_frame};
use plumbline::photo::rectangle::Outline;

use crate::support::missing::real_media;
use crate::support::program::{err, out, plumbline_in};

fn at(folder: &Path, name: &str) -> Photo {
    load(&folder.join(name), LoadOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// A room of `media/` cut out along arcs, as stitching leaves them, on white.
fn cut_room(folder: &Path, name: &str) {
    let media = Path::new(env!("CARGO_MANIFEST_DIR")).join("media/room-rectilinear-100.jpg");
    let photo = load(&media, LoadOptions::default()).expect("a room");
    let (w, h) = (photo.frame.width as f64, photo.frame.height as f64);
    let mut pixels = rgb_of_frame(&photo.frame).expect("a still frame");
    for (k, pixel) in pixels.iter_mut().enumerate() {
        let (x, y) = ((k as f64 % w) / w, (k as f64 / w).floor() / h);
        let bow = (x * std::f64::consts::TAU).sin().abs();
        if !(y > 0.03 + 0.1 * bow && y < 0.96 - 0.07 * bow && x > 0.03 + 0.05 * y && x < 0.98 - 0.06 * y) {
            *pixel = [255; 3];
        }
    }
    let samples: Vec<u8> = pixels.into_iter().flatten().collect();
    let frame = frame_of_rgb(&samples, w as usize, h as usize).expect("as many as it takes");
    let cut = Photo::new(frame);
    let mut file = fs::File::create(folder.join(name)).expect("a file");
    let format = StillFormat::of_name(Path::new(name)).expect("a known name");
    encode(&cut, format, SaveOptions::default(), &mut file).expect("written");
}

fn report(folder: &Path, name: &str) -> serde_json::Value {
    serde_json::from_slice(&fs::read(folder.join(name)).expect("a report")).expect("JSON")
}

#[test]
fn a_cut_out_room_becomes_a_full_rectangle_with_and_without_being_asked() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    cut_room(folder, "room.jpg");
    for (name, asked) in [("a", &["--rectangle"][..]), ("b", &[])] {
        let (made, told) = (format!("{name}.png"), format!("{name}.json"));
        let base = ["rectify", "room.jpg", "-o", &made, "--faces", "off", "--report", &told];
        let run = plumbline_in(folder, &[&base[..], asked].concat());
        assert_eq!(run.status.code(), Some(0), "{}", err(&run));
        assert_eq!(err(&run).contains("looks stitched"), asked.is_empty(), "{}", err(&run));
        let report = report(folder, &told);
        assert_eq!((&report["outside_shown"], &report["grid"]["folds"]), (&0.0.into(), &0.into()), "{report:#}");
        let lines = report["lines"].as_array().expect("a list");
        assert!(lines.len() > 5, "{report:#}");
        let px = |line: &serde_json::Value, what: &str| line[what].as_f64().expect("px");
        let off = lines.iter().map(|line| px(line, "max_px") / px(line, "length_px")).sum::<f64>() / lines.len() as f64;
        assert!(off <= 0.001, "{off} of their length in the mean");
        let pixels = rgb_of_frame(&at(folder, &made).frame).expect("a still frame");
        let white = pixels.iter().filter(|p| p.iter().all(|v| *v > 250)).count();
        assert!(white * 1000 < pixels.len(), "{white} of {} pixels are white", pixels.len());
    }
    assert_eq!(at(folder, "a.png").frame.width, at(folder, "b.png").frame.width);
    let run = plumbline_in(
        folder,
        &["rectify", "room.jpg", "-o", "c.png", "--faces", "off", "--lines", "off", "--rectangle", "--size", "500x300"],
    );
    assert_eq!(run.status.code(), Some(0), "{}", err(&run));
    assert_eq!((at(folder, "c.png").frame.width, at(folder, "c.png").frame.height), (500, 300));
}

#[test]
fn a_picture_without_a_border_is_no_stitched_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let media = Path::new(env!("CARGO_MANIFEST_DIR")).join("media/room-rectilinear-100.jpg");
    let room = media.to_string_lossy();
    let run = plumbline_in(
        folder.path(),
        &["rectify", &room, "-o", "a.png", "--faces", "off", "--lines", "off", "--rectangle"],
    );
    assert_eq!(run.status.code(), Some(65), "{}", err(&run));
    assert!(err(&run).contains("nothing lies around the picture"), "{}", err(&run));
}

#[test]
fn found_lines_are_saved_switched_off_and_read_back() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let media = Path::new(env!("CARGO_MANIFEST_DIR")).join("media/room-kb-125.jpg");
    let (room, lens) = (media.to_string_lossy(), media.with_extension("lens.json"));
    let lens = lens.to_string_lossy();
    let run = |extra: &[&str]| {
        let base = ["rectify", &room, "--lens", &lens, "--faces", "off", "--overwrite", "-o", "a.png"];
        let run = plumbline_in(folder, &[&base[..], extra].concat());
        assert_eq!(run.status.code(), Some(0), "{}", err(&run));
    };
    run(&["--lines", "auto", "--save-lines", "l.json", "--report", "auto.json"]);
    run(&["--lines", "l.json", "--save-lines", "again-l.json", "--report", "again.json"]);
    assert_eq!(report(folder, "l.json"), report(folder, "again-l.json"));
    let (auto, again) = (report(folder, "auto.json"), report(folder, "again.json"));
    let lines = |report: &serde_json::Value| report["lines"].as_array().expect("a list").clone();
    assert!(lines(&auto).len() > 5);
    let names = |report: &serde_json::Value| lines(report).iter().map(|l| l["name"].clone()).collect::<Vec<_>>();
    assert_eq!(names(&auto), names(&again));
    assert_eq!(auto["output"]["size"][0], again["output"]["size"][0]);
    let mut saved = report(folder, "l.json");
    let name = saved["lines"][0]["name"].clone();
    saved["lines"][0]["off"] = true.into();
    fs::write(folder.join("l.json"), saved.to_string()).expect("a file");
    run(&["--lines", "l.json", "--report", "less.json"]);
    let less = lines(&report(folder, "less.json"));
    assert_eq!(less.len() + 1, lines(&auto).len());
    assert!(less.iter().all(|line| line["name"] != name));
}

#[test]
fn an_uncropped_picture_is_transparent_or_filled_where_it_shows_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let media = Path::new(env!("CARGO_MANIFEST_DIR")).join("media/room-kb-125.jpg");
    let (room, lens) = (media.to_string_lossy(), media.with_extension("lens.json"));
    let lens = lens.to_string_lossy();
    for (border, name) in [("black", "black.png"), ("transparent", "clear.png"), ("fill", "full.png")] {
        let args = [
            "rectify",
            &room,
            "-o",
            name,
            "--lens",
            &lens,
            "--to",
            "stereographic",
            "--lines",
            "off",
            "--faces",
            "off",
            "--crop",
            "none",
            "--size",
            "400x300",
            "--border",
            border,
        ];
        let run = plumbline_in(folder, &args);
        assert_eq!(run.status.code(), Some(0), "{}", err(&run));
    }
    let [black, clear, full] = ["black.png", "clear.png", "full.png"].map(|name| at(folder, name));
    assert_eq!((black.frame.format.alpha, clear.frame.format.alpha, full.frame.format.alpha), (false, true, false));
    let [before, seen, after] = [&black, &clear, &full].map(|still| rgb_of_frame(&still.frame).expect("RGB"));
    let alpha = clear.frame.plane8(clear.frame.format.planes() - 1).expect("8 bit");
    let (mut hole, mut dark) = (0, 0);
    let whole = |k: usize| {
        let around = |n: usize, most: usize| n.saturating_sub(1)..(n + 2).min(most);
        around(k / 400, 300).all(|y| alpha.row(y)[around(k % 400, 400)].iter().all(|v| *v == 255))
    };
    for (k, ((b, a), seen)) in before.iter().zip(&after).zip(&seen).enumerate() {
        match alpha.row(k / 400)[k % 400] {
            // Beside what is missing kernels have mixed the two; that rim is made anew.
            255 if whole(k) => assert_eq!(a, seen, "what is shown stays"),
            0 => {
                assert_eq!(*b, [0; 3]);
                (hole, dark) = (hole + 1, dark + u32::from(a.iter().all(|v| *v < 12)));
            }
            _ => {}
        }
    }
    assert!(hole > 1000 && dark * 50 < hole, "{dark} of {hole} pixels stayed dark");
    assert!(Outline::of_frame(&clear.frame).is_some());
    assert!(!out(&plumbline_in(folder, &["stages", "photo.rectangle"])).is_empty());
}

#[test]
fn a_clip_without_focal_length_is_refused_with_what_to_give() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let clip = Path::new(env!("CARGO_MANIFEST_DIR")).join("media/street-walk.mp4");
    let run = plumbline_in(folder.path(), &["rectify", &clip.to_string_lossy(), "-o", "a.mp4"]);
    assert_eq!(run.status.code(), Some(2), "{}", err(&run));
    assert!(err(&run).contains("states no focal length") && err(&run).contains("--fov"), "{}", err(&run));
}

#[test]
fn real_photos_are_not_taken_for_stitched_and_stitched_ones_are() {
    for (name, stitched) in [
        ("photo/misc/rectangling_1.jpg", true),
        ("photo/misc/rectangling_2.jpg", true),
        ("photo/fisheye/nebula_disk7.jpg", false),
        ("photo/fisheye/ocam_matsuren.jpg", false),
        ("photo/fisheye/defisheye_example1.jpg", false),
        ("photo/fisheye_calib/nebula_01.jpg", false),
        ("photo/portrait/yzhq_13_116.jpg", false),
    ] {
        let Some(path) = real_media(name) else { return };
        let photo = load(&path, LoadOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let found = Outline::of_frame(&photo.frame).is_some_and(|outline| outline.is_stitched());
        assert_eq!(found, stitched, "{name}");
    }
}
