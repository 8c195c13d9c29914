//! Mesh files through the built program, the meshes of `media/`, and real ones where they are.

use std::path::{Path, PathBuf};

use plumbline::num::run::Run;
use plumbline::shape::mesh::io::{WriteOptions, decode_model, encode_model};
use plumbline::shape::mesh::{HalfEdges, MeshFormat, Model, ReadLimits, RepairOptions, Weld, read_model, repair};
use serde_json::Value;

use crate::support::missing::real_media;
use crate::support::program::{err, names, out, plumbline_in, succeed};

fn media(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("media").join(name).display().to_string()
}

fn json(output: &std::process::Output) -> Value {
    serde_json::from_str(&out(output)).expect("JSON")
}

#[test]
fn info_reports_the_contents_of_files_and_what_repair_would_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let told = |name: &str| out(&succeed(folder.path(), &["mesh", "info", &media(name)]));
    assert!(told("mesh-one-triangle.obj").contains("3 vertices, 1 triangles, 3 edges"));
    assert!(told("mesh-moebius.off").contains("3 edges cut open where the surface has only one side"));
    assert!(told("mesh-two-components.ply").contains("2 components"));
    assert!(
        told("mesh-non-manifold-edge.off").contains("1 edges with more than two triangles taken apart (first: 0 to 1)")
    );
    assert!(told("mesh-zero-area.obj").contains("1 triangles without area removed by flipping an edge"));
    assert!(
        told("mesh-bar.ply").contains("closed and oriented")
            && told("mesh-bar.ply").ends_with("repair: nothing to do\n")
    );
    let cube = json(&succeed(folder.path(), &["mesh", "info", "--json", &media("mesh-polygons.obj")]));
    assert_eq!(
        (&cube[0]["polygons"], &cube[0]["colors"], &cube[0]["facts"]["volume"]),
        (&6.into(), &8.into(), &1.0.into())
    );
    assert_eq!(cube[0]["groups"][2]["group"], "z");
}

#[test]
fn vertices_that_are_not_finite_are_mended_where_meshes_are_repaired_or_skeletons_are_extracted() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let told = "not finite are set to the mean of their neighbors: 1, the first of them 7 (numbered from 0)";
    for args in [&["mesh", "repair"][..], &["skeleton"]] {
        let ran = plumbline_in(folder, &[args, &[&media("mesh-nan.ply"), "-o", "out.glb", "--overwrite"]].concat());
        assert!(ran.status.success(), "{}", err(&ran));
        assert!([out(&ran), err(&ran)].concat().contains(told), "{} {}", out(&ran), err(&ran));
    }
}

#[test]
fn bad_files_are_refused_with_their_line_and_do_not_stop_the_others() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, message) in [
        ("mesh-nan.ply", "vertex 7 (numbered from 0) has a coordinate that is not finite"),
        ("mesh-truncated.ply", "the file is cut short"),
        ("mesh-outside.gltf", "\"../outside.bin\" leads outside the folder of the file"),
        ("mesh-bad-index.obj", "OBJ, line 5: vertex -9 counts from the end, but only 3 stand before this line"),
        ("none.obj", "no such file; check the name"),
    ] {
        let ran = plumbline_in(folder.path(), &["mesh", "convert", &media(name), "-o", "out.ply"]);
        assert_eq!(ran.status.code(), Some(65), "{name}: {}", err(&ran));
        assert!(err(&ran).contains(message) && err(&ran).contains(name), "{name}: {}", err(&ran));
    }
    assert!(names(folder.path()).is_empty());
    let batch = [&media("mesh-bar.ply")[..], &media("mesh-nan.ply"), &media("mesh-moebius.off")];
    let ran =
        plumbline_in(folder.path(), &[&["mesh", "convert", "--out-dir", ".", "--format", "obj"], &batch[..]].concat());
    assert_eq!(ran.status.code(), Some(3), "{}", err(&ran));
    assert_eq!(names(folder.path()), ["mesh-bar.obj", "mesh-moebius.obj"]);
}

#[test]
fn targets_are_checked_before_anything_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::copy(media("mesh-bar.ply"), folder.join("a.ply")).expect("a copy");
    let bytes = std::fs::read(folder.join("a.ply")).expect("a file");
    for (args, status, message) in [
        (&["a.ply", "-o", "a.ply", "--overwrite"][..], 2, "is an input; results never replace inputs"),
        (&["a.ply", "-o", "b.xyz"], 2, "the extension is none of obj, ply, off, stl, gltf, glb"),
        (&["a.ply", "a.ply", "-o", "b.obj"], 2, "2 inputs and one --output; give --out-dir or --suffix"),
        (&["a.ply", "a.ply", "--out-dir", "x"], 2, "two inputs would be written as"),
        (&["a.ply"], 2, "--out-dir"),
        (&["a.ply", "-o", "none/b.obj"], 73, "cannot be written"),
    ] {
        let ran = plumbline_in(folder, &[&["mesh", "convert"], args].concat());
        assert_eq!(ran.status.code(), Some(status), "{args:?}: {}", err(&ran));
        assert!(err(&ran).contains(message), "{args:?}: {}", err(&ran));
    }
    succeed(folder, &["mesh", "convert", "a.ply", "-o", "b.stl"]);
    let again = plumbline_in(folder, &["mesh", "convert", "a.ply", "-o", "b.stl"]);
    assert_eq!(again.status.code(), Some(73), "{}", err(&again));
    assert!(err(&again).contains("`b.stl` exists; allow to replace it with --overwrite"));
    succeed(folder, &["mesh", "convert", "a.ply", "-o", "b.stl", "--overwrite"]);
    assert_eq!(
        (names(folder), std::fs::read(folder.join("a.ply")).ok()),
        (vec!["a.ply".into(), "b.stl".into()], Some(bytes))
    );
}

#[cfg(unix)]
#[test]
fn targets_that_are_no_files_are_refused_by_their_kind_also_through_links() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    std::fs::copy(media("mesh-bar.ply"), folder.join("a.ply")).expect("a copy");
    std::fs::create_dir(folder.join("folder.ply")).expect("a folder");
    let made = std::process::Command::new("mkfifo").arg(folder.join("pipe.ply")).status().expect("mkfifo runs");
    assert!(made.success());
    let _socket = std::os::unix::net::UnixListener::bind(folder.join("socket.ply")).expect("a socket");
    for kind in ["folder", "pipe", "socket"] {
        let link = folder.join(format!("{kind}-link.ply"));
        std::os::unix::fs::symlink(format!("{kind}.ply"), link).expect("a link");
    }
    // A device only through a link: a fault of the test would replace that of the machine.
    std::os::unix::fs::symlink("/dev/null", folder.join("device-link.ply")).expect("a link");
    let before = names(folder);
    let kept = "not a regular file; it is not replaced; give the name of a new file";
    for (target, message) in [
        ("folder", "a folder, not a regular file; give the path of a file in it".to_owned()),
        ("folder-link", "a folder, not a regular file; give the path of a file in it".to_owned()),
        ("pipe", format!("a named pipe, {kept}")),
        ("pipe-link", format!("a named pipe, {kept}")),
        ("socket", format!("a socket, {kept}")),
        ("socket-link", format!("a socket, {kept}")),
        ("device-link", format!("a device, {kept}")),
    ] {
        for args in [&["convert"][..], &["convert", "--overwrite"], &["repair"], &["repair", "--overwrite"]] {
            let output = format!("{target}.ply");
            let ran = plumbline_in(folder, &[&["mesh"], args, &["a.ply", "-o", &output]].concat());
            let expected = format!("error: {output}: cannot be written: {message}\n");
            assert_eq!((ran.status.code(), err(&ran)), (Some(73), expected), "{args:?}");
        }
    }
    assert_eq!(names(folder), before);
}

#[test]
fn repair_writes_a_manifold_and_reports_its_changes() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let told = out(&succeed(folder, &["mesh", "repair", &media("mesh-hourglass.stl"), "-o", "fixed.glb"]));
    assert!(told.contains("17 vertices joined with another in the same place"), "{told}");
    assert!(told.contains("1 vertices split where several sheets meet"), "{told}");
    let fixed = read_model(&folder.join("fixed.glb"), &ReadLimits::default(), &Run::default()).expect("a mesh");
    assert_eq!((fixed.mesh().vertex_count(), fixed.mesh().triangle_count()), (8, 8));
    HalfEdges::new(fixed.mesh()).expect("a manifold");
    let report = json(&succeed(folder, &["mesh", "repair", &media("mesh-moebius.off"), "-o", "m.ply", "--json"]));
    assert_eq!(
        (&report[0]["repair"]["unorientable_cuts"], &report[0]["written"]["path"]),
        (&3.into(), &"m.ply".into())
    );
    let told =
        out(&succeed(folder, &["mesh", "repair", &media("mesh-hourglass.stl"), "-o", "g.ply", "--weld", "gaps"]));
    assert!(told.contains("17 vertices joined with another in the same place") && !told.contains("gap"), "{told}");
    let wrong = plumbline_in(folder, &["mesh", "repair", &media("mesh-bar.ply"), "-o", "x.ply", "--weld", "2"]);
    assert!(
        err(&wrong).contains("2 is out of range (0 to 0.1); exact, gaps and never are the other choices"),
        "{}",
        err(&wrong)
    );
}

/// All mesh files in a folder and below.
fn mesh_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            mesh_files(&path, found);
        } else if MeshFormat::of_name(&path).is_some() {
            found.push(path);
        }
    }
}

#[test]
fn real_meshes_keep_their_shape_through_repair_and_every_format() {
    let Some(root) = real_media("mesh") else { return };
    let mut files = Vec::new();
    mesh_files(&root, &mut files);
    assert!(files.len() > 50, "{} meshes", files.len());
    for path in files {
        let name = path.display();
        let model = match read_model(&path, &ReadLimits::default(), &Run::default()) {
            Ok(model) => model,
            Err(e) => {
                assert!(name.to_string().contains("nan") && e.to_string().contains("vertex 17 "), "{e}");
                continue;
            }
        };
        let repaired =
            repair(model.mesh(), &RepairOptions::default(), &Run::default()).expect("a run that never stops");
        HalfEdges::new(&repaired.mesh).expect("repair makes oriented manifolds");
        let again =
            repair(&repaired.mesh, &RepairOptions { weld: Weld::Never, ..RepairOptions::default() }, &Run::default())
                .expect("a run that never stops");
        assert!(again.report.is_clean(), "{name}: {}", again.report);
        same_shape(&model, &name.to_string());
        same_shape(&model.repaired(&repaired), &name.to_string());
    }
}

/// Writes the model in every format and reads it back.
fn same_shape(model: &Model, name: &str) {
    use MeshFormat::{Glb, Gltf, Obj, Off, Ply, Stl};
    let mesh = model.mesh();
    let largest = mesh.positions().iter().map(|p| p.coords.amax()).fold(0.0, f64::max);
    for format in [Obj, Ply, Off, Stl, Gltf, Glb] {
        let bytes = encode_model(model, format, &WriteOptions::default(), &Run::default()).expect("it can be written");
        let again =
            decode_model(&bytes, format, None, &ReadLimits::default(), &Run::default()).expect("own files are read");
        let other = again.mesh();
        let parts = [Gltf, Glb].contains(&format) && !model.groups().all.is_empty() | !model.materials().all.is_empty();
        let tolerance = match format {
            Stl => 1e-7 * largest,
            Gltf | Glb => 2e-6 * mesh.diagonal(),
            _ => 0.0,
        };
        assert_eq!(other.triangle_count(), mesh.triangle_count(), "{name} as {format}");
        // Parts stand one after the other there: the sums remain.
        if parts {
            assert!((other.area() - mesh.area()).abs() <= 1e-5 * mesh.area(), "{name} as {format}");
            continue;
        }
        for t in 0..mesh.triangle_count() {
            for (p, q) in mesh.corners(t).iter().zip(other.corners(t)) {
                assert!((p - q).norm() <= tolerance, "{name} as {format}: triangle {t}, {p} {q}");
            }
        }
        if [Obj, Ply, Off].contains(&format) {
            assert_eq!(again.faces(), model.faces(), "{name} as {format}");
        }
        if format == Obj {
            assert_eq!(
                (again.texture(), again.normals(), again.colors()),
                (model.texture(), model.normals(), model.colors()),
                "{name}"
            );
        }
    }
}

#[test]
fn meshes_are_written_in_other_units_and_with_another_axis_up() {
    let folder = tempfile::tempdir().expect("a folder");
    let bar = media("mesh-bar.ply");
    let positions = |name: &Path| {
        let model = read_model(name, &ReadLimits::default(), &Run::default()).expect("a mesh");
        model.mesh().positions().to_vec()
    };
    succeed(folder.path(), &["mesh", "convert", &bar, "-o", "bar.obj", "--unit", "mm:m", "--up", "z:y"]);
    let (before, after) = (positions(Path::new(&bar)), positions(&folder.path().join("bar.obj")));
    assert_eq!(before.len(), after.len());
    for (p, q) in before.iter().zip(&after) {
        let expected = nalgebra::Point3::new(p.x, p.z, -p.y) * 1e-3;
        assert!((q - expected).norm() < 1e-9, "{p} to {q}");
    }
    // A factor and a unit both count.
    succeed(folder.path(), &["mesh", "convert", &bar, "-o", "large.obj", "--unit", "in:cm", "--scale", "10"]);
    let large = positions(&folder.path().join("large.obj"));
    assert!(before.iter().zip(&large).all(|(p, q)| (q.coords - 25.4 * p.coords).norm() < 1e-6));
    for wrong in [["--unit", "mm:parsec"], ["--unit", "mm"], ["--up", "w:y"], ["--scale", "0"], ["--scale", "1e13"]] {
        let output = plumbline_in(folder.path(), &["mesh", "convert", &bar, "-o", "no.obj", wrong[0], wrong[1]]);
        assert_eq!(output.status.code(), Some(2), "{wrong:?}: {}", err(&output));
        assert!(err(&output).contains(wrong[0]), "{}", err(&output));
    }
    assert_eq!(names(folder.path()), ["bar.obj", "large.obj"]);
}
