//! Models as files and back.

use super::*;
use crate::motion::exchange::tests::walk;

/// Files of `model` in a folder; `extension`: those that end so.
fn written(model: &Model, extension: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, write) in FILES.iter().filter(|(name, _)| name.ends_with(extension)) {
        let mut bytes = Vec::new();
        write(model, &mut bytes).expect("memory");
        std::fs::write(folder.path().join(name), bytes).expect("a small file");
    }
    folder
}

fn model() -> Model {
    let (motion, tracks) = walk();
    let mut models = models_of(&motion, &tracks).expect("a store");
    assert_eq!((models.len(), models[0].0), (1, 0));
    models.remove(0).1
}

#[test]
fn a_model_is_read_back_from_text_and_from_binary() {
    let model = model();
    for extension in [".txt", ".bin"] {
        let folder = written(&model, extension);
        assert_eq!(Model::read(folder.path()).expect("own files"), model, "{extension}");
    }
}

#[test]
fn images_are_the_frames_with_a_camera_and_their_observations_reproject() {
    let model = model();
    let names: Vec<&str> = model.images.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names[3..], ["frame_000003.png", "frame_000005.png"]);
    assert_eq!(model.cameras.len(), 1, "one lens for all");
    let lens = model.cameras[0].intrinsics;
    let mut observations = 0;
    for image in &model.images {
        for (index, s) in image.observations.iter().enumerate() {
            let point = model.points.iter().find(|p| Some(p.id) == s.point).expect("a point");
            let seen = lens.project(&image.pose.apply(&point.position)).expect("in front");
            assert!(((s.at - seen).norm() - 0.1).abs() < 0.01, "written as it was tracked");
            assert!(point.track.contains(&(image.id, index as u32)));
            observations += 1;
        }
    }
    assert_eq!(observations, model.points.iter().map(|p| p.track.len()).sum::<usize>());
    assert!(model.points.iter().all(|p| (p.error_px - 0.1).abs() < 0.01));
}

#[test]
fn cameras_that_failed_make_no_model() {
    let (mut motion, tracks) = walk();
    motion.cameras.as_mut().expect("cameras").shots[0].verdict = crate::motion::sfm::SfmVerdict::Failed;
    assert!(models_of(&motion, &tracks).expect("a store").is_empty());
    motion.cameras = None;
    assert!(models_of(&motion, &tracks).expect("a store").is_empty());
}

#[test]
fn an_outlier_is_no_observation_of_its_point() {
    let (motion, mut tracks) = walk();
    let mut frame = tracks.read(5).expect("stored");
    frame.observations[0].x += 4.0;
    let strayed = u64::from(frame.observations[0].id);
    let mut moved = crate::track::TrackStore::new().expect("a temporary folder");
    for k in 0..5 {
        moved.push(&tracks.read(k).expect("stored")).expect("in range");
    }
    moved.push(&frame).expect("in range");
    tracks = moved;
    let model = models_of(&motion, &tracks).expect("a store").remove(0).1;
    let last = model.images.last().expect("images");
    assert!(last.name.ends_with("5.png") && last.observations.iter().all(|s| s.point != Some(strayed)));
}

#[test]
fn a_clip_comes_back_from_its_model() {
    let (motion, tracks) = walk();
    let found = ImportedClip::new(&[model()], 6, (640, 360)).expect("it fits");
    let cameras = motion.cameras.expect("cameras");
    assert_eq!(found.cameras.frames, cameras.frames);
    assert_eq!(found.shots, [ImportedShot { frames: 0..6, images: 5 }]);
    let positions = |c: &crate::motion::ClipCameras| c.points.iter().map(|p| p.position).collect::<Vec<_>>();
    assert_eq!(positions(&found.cameras), positions(&cameras));
    for (k, seen) in found.tracks.iter().enumerate() {
        let expected = if k == 4 { Vec::new() } else { tracks.read(k).expect("stored").observations };
        assert_eq!(seen.len(), expected.len(), "frame {k}");
        assert!(seen.iter().zip(&expected).all(|(a, b)| (a.x, a.y) == (b.x, b.y) && b.id == 3 * a.id + 1));
    }
    let figures = found.cameras.shots[0].figures;
    assert!((figures.reprojection_px - 0.1).abs() < 0.01 && figures.registered == 5 && figures.angle > 0.05);
}

#[test]
fn images_follow_the_frames_by_number_from_0_or_1_or_by_order() {
    let named = |numbers: &[usize]| {
        let mut model = model();
        model.images.truncate(numbers.len());
        model.images.iter_mut().zip(numbers).for_each(|(i, n)| i.name = format!("img{n}.jpg"));
        model
    };
    let frames = |numbers: &[usize], frames: usize| -> Vec<usize> {
        let found = ImportedClip::new(&[named(numbers)], frames, (640, 360)).expect("it fits");
        (0..frames).filter(|&k| found.cameras.frames[k].is_some()).collect()
    };
    assert_eq!(frames(&[0, 2, 3], 6), [0, 2, 3]);
    assert_eq!(frames(&[1, 2, 6], 6), [0, 1, 5], "6 of 6 counts from 1");
    assert_eq!(frames(&[10, 30, 20], 3), [0, 1, 2], "as many images as frames");
    let refused = |models: &[Model], size| ImportedClip::new(models, 6, size).expect_err("refused").to_string();
    assert_eq!(refused(&[named(&[0, 7])], (640, 360)), "image \"img7.jpg\" is of frame 7, and the clip has 6 frames");
    assert!(refused(&[named(&[0, 1]), named(&[1, 2])], (640, 360)).contains("of the same frame"));
    assert!(refused(&[named(&[0, 2]), named(&[1, 3])], (640, 360)).contains("interleave"));
    assert_eq!(refused(&[named(&[0, 1])], (320, 180)), "camera 1 is of 640×360 px, and the clip of 320×180 px");
    assert_eq!(refused(&[], (640, 360)), "the model has no image");
    let shots = ImportedClip::new(&[named(&[3, 4]), named(&[0, 1])], 6, (640, 360)).expect("they fit").shots;
    assert_eq!(shots.iter().map(|s| s.frames.clone()).collect::<Vec<_>>(), [0..3, 3..6], "cut where a model begins");
}

#[test]
fn a_damaged_model_is_refused_with_its_location() {
    let model = model();
    let refused = |extension: &str, name: &str, change: &dyn Fn(&mut Vec<u8>)| {
        let folder = written(&model, extension);
        let file = folder.path().join(name);
        let mut bytes = std::fs::read(&file).expect("written");
        change(&mut bytes);
        std::fs::write(&file, bytes).expect("a small file");
        Model::read(folder.path()).expect_err(name).to_string()
    };
    let text = |from: &'static str, to: &'static str| {
        move |bytes: &mut Vec<u8>| *bytes = String::from_utf8_lossy(bytes).replacen(from, to, 1).into_bytes()
    };
    let lens = refused(".txt", "cameras.txt", &text("SIMPLE_RADIAL", "OPENCV"));
    assert!(lens.starts_with("cameras.txt, line 3: camera model OPENCV"), "{lens}");
    assert!(
        refused(".txt", "images.txt", &text("\n4 ", "\n4 nan ")).contains("line 10: NaN (expected a finite number)")
    );
    assert!(
        refused(".txt", "images.txt", &text("1 1 0 0 0", "1 2 0 0 0"))
            .contains("line 4: [2.0, 0.0, 0.0, 0.0] (expected a q")
    );
    assert!(refused(".txt", "points3D.txt", &text("128 128", "128 999")).contains("line 3: \"999\" (expected a color"));
    assert!(refused(".bin", "images.bin", &|b| b.truncate(300)).contains("images.bin, entry 0"));
    assert!(refused(".bin", "images.bin", &|b| b.push(0)).contains("entry 5: 1 bytes too many"));
    assert!(refused(".bin", "points3D.bin", &|b| b[7] = 1).contains("expected no more entries than fit in the file"));
    assert!(refused(".bin", "cameras.bin", &|b| b[12] = 4).contains("entry 0: camera model number 4"));
    assert!(
        refused(".bin", "points3D.bin", &|b| b.iter_mut().skip(8).take(1).for_each(|v| *v = 0))
            .contains("(expected a point")
    );
    let empty = tempfile::tempdir().expect("a temporary folder");
    assert!(Model::read(empty.path()).expect_err("nothing").to_string().contains("has no COLMAP model"));
}

#[test]
fn lenses_that_are_special_cases_of_ours_are_read() {
    let lens_of = |model: &str, p: &[f64]| lens(model, p).map(|l| (l.focal, l.center.x, l.k1));
    assert_eq!(lens_of("SIMPLE_PINHOLE", &[500.0, 320.0, 180.0]), Some((500.0, 320.0, 0.0)));
    assert_eq!(lens_of("PINHOLE", &[500.0, 500.0, 320.0, 180.0]), Some((500.0, 320.0, 0.0)));
    assert_eq!(lens_of("RADIAL", &[500.0, 320.0, 180.0, 0.1, 0.0]), Some((500.0, 320.0, 0.1)));
    assert_eq!(lens_of("RADIAL", &[500.0, 320.0, 180.0, 0.1, 0.02]), None);
    assert_eq!(lens_of("PINHOLE", &[500.0, 510.0, 320.0, 180.0]), None);
    assert_eq!(lens_of("SIMPLE_RADIAL", &[-500.0, 320.0, 180.0, 0.0]), None);
}

#[test]
fn files_with_damage_anywhere_are_read_or_refused_but_never_panic() {
    let model = model();
    let mut random = fastrand::Rng::with_seed(12);
    for (name, write) in FILES {
        let mut good = Vec::new();
        write(&model, &mut good).expect("memory");
        for _ in 0..1000 {
            let mut bytes = good.clone();
            for _ in 0..random.usize(1..5) {
                let at = random.usize(..bytes.len());
                bytes[at] = if random.bool() { random.u8(..) } else { *random.choice(b"0123 -.e\n#").expect("some") };
            }
            if random.bool() {
                bytes.truncate(random.usize(..=bytes.len()));
            }
            let _ = match name {
                "cameras.bin" => binary::read_cameras(&bytes).map(drop),
                "images.bin" => binary::read_images(&bytes).map(drop),
                "points3D.bin" => binary::read_points(&bytes).map(drop),
                "cameras.txt" => text::read_cameras(&bytes).map(drop),
                "images.txt" => text::read_images(&bytes).map(drop),
                _ => text::read_points(&bytes).map(drop),
            };
        }
    }
}
