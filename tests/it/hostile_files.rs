//! Files made to harm, through the built program: paths that lead out of a file's folder, pipes in place of files, small files that
//! would take much memory or time.

use std::path::Path;
use std::process::Command;

use crate::support::program::{err, names, plumbline_in, succeed};

/// A triangle whose buffer is the file `uri`.
fn triangle(uri: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"uri":"{uri}","byteLength":36}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}]}}"#
    )
}

fn write(path: &Path, bytes: impl AsRef<[u8]>) {
    std::fs::create_dir_all(path.parent().expect("in a folder")).expect("a folder");
    std::fs::write(path, bytes).expect("a file");
}

#[test]
fn buffers_outside_the_folder_of_a_mesh_are_opened_only_where_that_is_allowed() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let floats: Vec<u8> =
        [0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    write(&at("secret/points.bin"), &floats);
    write(&at("in/points.bin"), &floats);
    #[cfg(unix)]
    std::os::unix::fs::symlink(at("secret/points.bin"), at("in/link.bin")).expect("a link");
    let absolute = at("secret/points.bin");
    let absolute = absolute.to_str().expect("UTF-8");
    for uri in ["../secret/points.bin", "%2e%2e/secret/points.bin", "..%2Fsecret%2fpoints.bin", "link.bin", absolute] {
        write(&at("in/a.gltf"), triangle(uri));
        for command in
            [&["mesh", "convert", "in/a.gltf", "-o", "out.obj"][..], &["render", "in/a.gltf", "-o", "out.png"]]
        {
            let ran = plumbline_in(folder.path(), command);
            assert_eq!(ran.status.code(), Some(65), "{uri}: {}", err(&ran));
            let told = err(&ran);
            assert!(told.contains("in/a.gltf") && told.contains("leads outside the folder"), "{uri}: {told}");
            assert!(told.contains("--allow-path"), "{uri}: {told}");
            assert!(!at("out.obj").exists() && !at("out.png").exists());
            let allowed = [command, &["--allow-path", "secret", "--overwrite"]].concat();
            succeed(folder.path(), &allowed);
            let result = at(command.last().expect("an output"));
            assert!(result.exists(), "{uri}");
            std::fs::remove_file(result).expect("the result");
        }
    }
    write(&at("in/a.gltf"), triangle("points.bin"));
    succeed(folder.path(), &["mesh", "convert", "in/a.gltf", "-o", "out.obj"]);
    // In a pipeline file, relative to its folder.
    write(&at("in/a.gltf"), triangle("../secret/points.bin"));
    let file = "version = 1\n[run]\nallow_paths = [\"../secret\"]\n[stage.a]\nuse = \"mesh.load\"\npath = \"../in/a.gltf\"\n\
                [stage.b]\nuse = \"mesh.save\"\ninputs = [\"a\"]\npath = \"../b.obj\"\n";
    write(&at("files/convert.toml"), file);
    succeed(folder.path(), &["run", "files/convert.toml"]);
    write(&at("files/convert.toml"), file.replace("allow_paths = [\"../secret\"]", ""));
    let ran = plumbline_in(folder.path(), &["run", "files/convert.toml", "--set", "b.path=c.obj"]);
    assert!(ran.status.code() == Some(65) && err(&ran).contains("run.allow_paths"), "{}", err(&ran));
    succeed(folder.path(), &["run", "files/convert.toml", "--set", "b.path=c.obj", "--allow-path", "secret"]);
    assert!(at("b.obj").exists() && at("c.obj").exists());
}

#[test]
#[cfg(unix)]
fn a_pipe_in_place_of_a_file_is_refused_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let media = |name: &str| format!("{}/media/{name}", env!("CARGO_MANIFEST_DIR"));
    for name in ["p.obj", "p.glb", "p.json", "p.png", "p.toml", "p.mtx", "p.bvh", "buffer.bin"] {
        assert!(Command::new("mkfifo").arg(at(name)).status().expect("mkfifo").success());
    }
    write(&at("a.gltf"), triangle("buffer.bin"));
    let bar = media("mesh-bar.ply");
    let made = names(folder.path());
    for args in [
        &["mesh", "info", "p.obj"][..],
        &["mesh", "info", "p.glb"],
        &["mesh", "info", "a.gltf"],
        &["deform", &bar, "--handles", "p.json", "-o", "out.ply"],
        &["skin", "weights", &bar, "--skeleton", "p.bvh", "-o", "out.json"],
        &["rectify", "p.png", "-o", "out.png"],
        &["run", "p.toml"],
        &["solve", "p.mtx"],
        &["morph", &bar, &bar, "--landmarks", "p.json", "-o", "out.ply"],
    ] {
        let started = std::time::Instant::now();
        let ran = plumbline_in(folder.path(), args);
        let told = err(&ran);
        assert!(!ran.status.success() && told.contains("a named pipe, not a regular file"), "{args:?}: {told}");
        assert!(started.elapsed().as_secs() < 30, "{args:?}");
        assert_eq!(names(folder.path()), made, "{args:?}");
    }
}

/// Peak memory, kB, and status of a command; `None` where the system does not measure.
#[cfg(target_os = "linux")]
fn measured(folder: &Path, args: &[&str]) -> (u64, Option<i32>, String) {
    let program = env!("CARGO_BIN_EXE_plumbline");
    // The limit ends a reader that takes all memory before the machine suffers; above it is reported as failed.
    let script = format!("ulimit -v 8000000; exec {program} \"$@\"");
    let mut command = Command::new("sh");
    command.current_dir(folder).args(["-c", &script, "sh"]).args(args).env("RAYON_NUM_THREADS", "2");
    command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped());
    let mut child = command.spawn().expect("the program");
    let mut told = String::new();
    let mut peak = 0;
    let status = format!("/proc/{}/status", child.id());
    let ended = loop {
        if let Ok(text) = std::fs::read_to_string(&status)
            && let Some(line) = text.lines().find(|l| l.starts_with("VmHWM"))
        {
            peak = peak.max(line.split_whitespace().nth(1).and_then(|n| n.parse().ok()).unwrap_or(0));
        }
        match child.try_wait().expect("a child") {
            Some(status) => break status,
            None => std::thread::park_timeout(std::time::Duration::from_millis(2)),
        }
    };
    if let Some(mut pipe) = child.stderr.take() {
        std::io::Read::read_to_string(&mut pipe, &mut told).expect("text");
    }
    (peak, ended.code(), told)
}

/// Motions whose numbers are as short as they can be: the bar is ten times the file and 200 MB.
#[test]
#[cfg(target_os = "linux")]
fn dense_motions_take_memory_in_proportion_to_their_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let bar = format!("{}/media/mesh-bar.ply", env!("CARGO_MANIFEST_DIR"));
    let hierarchy = |joints: usize, channels: &str| {
        let joint = |k: usize| format!("ROOT a{k}\n{{\nOFFSET 0 0 {k}\nCHANNELS {channels}\n}}\n");
        format!("HIERARCHY\n{}", (0..joints).map(joint).collect::<String>())
    };
    let motion =
        |frames: usize, line: &str| format!("MOTION\nFrames: {frames}\nFrame Time: 0.04\n{}", line.repeat(frames));
    let row = "0 ".repeat(200) + "\n";
    for (name, text, status) in [
        ("short.bvh", hierarchy(200, "1 Xrotation") + &motion(25_000, &row), 0),
        ("long.bvh", hierarchy(200, "1 Xrotation") + &motion(60_000, &row), 65),
        ("one.bvh", hierarchy(1, "3 Xrotation Yrotation Zrotation") + &motion(2_000_000, "0 0 0\n"), 0),
        ("still.bvh", hierarchy(1000, "0") + &motion(4_000_000, ""), 0),
    ] {
        write(&folder.path().join(name), &text);
        let args = ["pose", &bar, "--skeleton", name, "-o", "out.glb", "--overwrite"];
        let (peak, ended, told) = measured(folder.path(), &args);
        assert_eq!(ended, Some(status), "{name}: {told}");
        let most = (10 * text.len() as u64 + 200_000_000) / 1024;
        assert!(peak < most, "{name}: {peak} of {most} kB");
    }
}

/// Small files that would take much memory, or unbounded time, by the sizes that they announce.
#[test]
#[cfg(target_os = "linux")]
fn small_files_take_little_memory_whatever_they_announce() {
    let folder = tempfile::tempdir().expect("a folder");
    let gltf = |accessors: &str, rest: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"accessors":[{accessors}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}]{rest}}}"#
        )
    };
    let zeros = gltf(r#"{"componentType":5126,"count":200000000,"type":"VEC3"}"#, "");
    let nodes = format!(r#","nodes":[{}{{}}]"#, "{},".repeat(1_000_000));
    let many_nodes = gltf(r#"{"componentType":5126,"count":3,"type":"VEC3"}"#, &nodes);
    let materials = format!(r#","materials":[{}{{}}]"#, "[[1]],".repeat(700_000));
    let many_values = gltf(r#"{"componentType":5126,"count":3,"type":"VEC3"}"#, &materials);
    let mut bvh = "HIERARCHY\n".to_owned();
    for _ in 0..50 {
        bvh += "ROOT a\n{\nCHANNELS 0\n}\n";
    }
    bvh += "MOTION\nFrames: 4000000\nFrame Time: 0.1\n";
    let sets: Vec<String> =
        (1..60).map(|k| format!(r#""a{k:03}": {{"union": ["a{:03}", "a{:03}"]}}"#, k - 1, k - 1)).collect();
    let laughs = format!(
        r#"{{"format": "plumbline.handles", "version": 1, "sets": {{"a000": {{"indices": [0]}}, {}}}, "handles": [{{"vertices": "a059"}}]}}"#,
        sets.join(",")
    );
    for (name, text) in [
        ("zeros.gltf", &zeros),
        ("nodes.gltf", &many_nodes),
        ("values.gltf", &many_values),
        ("a.bvh", &bvh),
        ("laughs.json", &laughs),
    ] {
        write(&folder.path().join(name), text);
    }
    let bar = format!("{}/media/mesh-bar.ply", env!("CARGO_MANIFEST_DIR"));
    for (args, status, message) in [
        (&["mesh", "info", "zeros.gltf"][..], 65, "export the model with fewer instances"),
        (&["mesh", "info", "nodes.gltf"], 65, "bytes of memory"),
        (&["mesh", "info", "values.gltf"], 65, "bytes of memory"),
        (&["skin", "weights", &bar, "--skeleton", "a.bvh", "-o", "out.json"], 65, ""),
        (&["deform", &bar, "--handles", "laughs.json", "-o", "out.ply"], 65, ""),
    ] {
        let (peak, ended, told) = measured(folder.path(), args);
        // Two of them are files as good as any, once they are read with care.
        let expected = ended == Some(status) || message.is_empty() && ended == Some(0);
        assert!(expected && told.contains(message), "{args:?}: {ended:?} {told}");
        assert!(peak < 260_000, "{args:?}: {peak} kB");
    }
}
