//! The command line, by running the program.

use std::path::Path;
use std::process::Output;

use plumbline::app::cli::pipeline_of;
use plumbline::app::pipeline::draw::{GraphFormat, draw};
use plumbline::app::pipeline::shipped::shipped;
use plumbline::app::pipeline::{check, print, read};

use crate::pipeline::source;
use crate::support::program::{err, out, plumbline_in};

fn plumbline(args: &[&str]) -> Output {
    plumbline_in(Path::new("."), args)
}

#[test]
fn help_says_what_there_is() {
    insta::assert_snapshot!("help", out(&plumbline(&["--help"])));
    for command in [
        "stabilize",
        "rectify",
        "retarget",
        "motion",
        "deform",
        "modes",
        "morph",
        "blend",
        "compose",
        "render",
        "run",
        "check",
        "plan",
        "graph",
        "stages",
        "schema",
        "solve",
        "probe",
        "completions",
    ] {
        insta::assert_snapshot!(format!("help_{command}"), out(&plumbline(&[command, "--help"])));
    }
}

#[test]
fn stage_kinds_are_described_from_the_registry() {
    insta::assert_snapshot!("stages", out(&plumbline(&["stages"])));
    for kind in plumbline::app::stages::KINDS {
        insta::assert_snapshot!(format!("stages_{}", kind.name), out(&plumbline(&["stages", kind.name])));
    }
}

#[test]
fn a_bad_command_line_exits_2_names_what_is_allowed_and_prints_no_result() {
    let cases: [(&str, &[&str], &str); 13] = [
        ("no target", &["stabilize", "a.mp4"], "--output <OUTPUT>|--out-dir <DIR>|--suffix <TEXT>"),
        ("two targets", &["stabilize", "a.mp4", "-o", "b.mp4", "--out-dir", "d"], "cannot be used with"),
        ("keep", &["stabilize", "a.mp4", "-o", "b.mp4", "--keep", "140%"], "out of range (expected 0.3 to 1)"),
        ("nan", &["stabilize", "a.mp4", "-o", "b.mp4", "--smoothness", "nan"], "out of range (expected 0.05 to 30)"),
        ("mode", &["stabilize", "a.mp4", "-o", "b.mp4", "--mode", "mash"], "a similar value exists: 'mesh'"),
        (
            "shutter",
            &["stabilize", "a.mp4", "-o", "b.mp4", "--rolling-shutter", "2"],
            "a readout time above 0 up to 0.1 s",
        ),
        (
            "crf",
            &["stabilize", "a.mp4", "-o", "b.mp4", "--crf", "60"],
            "`crf` = 60 is out of range for `h264` (expected 0 to 51)",
        ),
        ("both", &["stabilize", "a.mp4", "-o", "b.mp4", "--crf", "20", "--bitrate", "6M"], "cannot be used with"),
        ("many", &["stabilize", "a.mp4", "b.mp4", "-o", "c.mp4"], "there are 2 clips; use --out-dir"),
        ("glob", &["stabilize", "*.mp4", "-o", "c.mp4"], "may be many clips"),
        ("compare", &["stabilize", "a.mp4", "-o", "-", "--compare"], "--compare needs a file name with an extension"),
        ("no file", &["run", "stabilice"], "there is no pipeline file `stabilice` (shipped ones: `stabilize`"),
        ("no kind", &["stages", "video.smoth"], "did you mean `video.smooth`?"),
    ];
    for (name, args, message) in cases {
        let output = plumbline(args);
        assert_eq!(output.status.code(), Some(2), "{name}: {}", err(&output));
        assert!(err(&output).contains(message), "{name}: {}", err(&output));
        assert!(err(&output).starts_with("error: "), "{name}: {}", err(&output));
        assert_eq!(out(&output), "", "{name}: standard output carries results only");
    }
}

#[test]
fn the_output_may_not_be_the_input() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("a.mp4"), "x").expect("a small file");
    let same = plumbline_in(folder.path(), &["stabilize", "a.mp4", "-o", "./a.mp4", "--overwrite"]);
    assert_eq!(same.status.code(), Some(2));
    assert!(err(&same).contains("`./a.mp4` would be written over its input"), "{}", err(&same));
    let here = plumbline_in(folder.path(), &["stabilize", ".", "--out-dir", ".", "--overwrite"]);
    assert!(err(&here).contains("would be written over its input"), "{}", err(&here));
    let missing = plumbline_in(folder.path(), &["stabilize", "*.mov", "--out-dir", "d"]);
    assert!(err(&missing).contains("no file matches *.mov"), "{}", err(&missing));
}

#[test]
fn check_reports_faults_to_people_and_programs() {
    let good = plumbline(&["check", "stabilize"]);
    assert_eq!(
        (good.status.code(), out(&good).as_str()),
        (Some(0), "stabilize.toml (shipped): no faults; 7 stages in 2 passes\n")
    );
    let bad = plumbline(&["check", "stabilize", "--set", "out.cfr=3", "--message-format", "json"]);
    assert_eq!(bad.status.code(), Some(2));
    let list: serde_json::Value = serde_json::from_slice(&bad.stdout).expect("JSON");
    assert_eq!(list[0]["help"], "did you mean `crf`?");
    assert_eq!(list[0]["span"]["column"], 5);
}

#[test]
fn plan_graph_and_schema_print_results() {
    insta::assert_snapshot!("plan", out(&plumbline(&["plan", "stabilize"])));
    assert!(out(&plumbline(&["graph", "stabilize", "--format", "mermaid"])).starts_with("flowchart LR\n"));
    assert!(out(&plumbline(&["graph", "stabilize", "--format", "dot"])).starts_with("digraph"));
    let schema: serde_json::Value = serde_json::from_slice(&plumbline(&["schema"]).stdout).expect("JSON");
    assert_eq!(schema, plumbline::app::pipeline::schema());
    for (format, word) in [
        ("lines", "plumbline.lines"),
        ("faces", "plumbline.faces"),
        ("lens", "fx"),
        ("motion", "readout_s"),
        ("path", "wanted"),
    ] {
        let printed = plumbline(&["schema", format]);
        let schema: serde_json::Value = serde_json::from_slice(&printed.stdout).expect("JSON");
        assert!(schema["properties"].is_object() && schema.to_string().contains(word), "{format}: {schema}");
    }
}

#[test]
fn completions_know_the_commands() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(out(&plumbline(&["completions", shell])).contains("stabilize"), "{shell}");
    }
}

#[test]
fn options_mean_a_pipeline_that_reads_back_as_the_same() {
    let cases: [&[&str]; 7] = [
        &["a.mp4", "-o", "b.mp4"],
        &["a.mp4", "b c.mov", "--out-dir", "d/"],
        &["odd ${item.stem} \"name\".mp4", "-o", "$${x}.mkv", "--compare", "--export-motion", "m ${y}.json"],
        &[
            "clips/*.mp4",
            "--out-dir",
            "out",
            "--codec",
            "prores",
            "--overwrite",
            "--threads",
            "2",
            "--progress",
            "json",
        ],
        &[
            "frames/%05d.png",
            "-o",
            "-",
            "--start",
            "1:02.5",
            "--end",
            "90",
            "--rolling-shutter",
            "0.02",
            "--bitrate",
            "6M",
        ],
        &[
            "a.avi",
            "--out-dir",
            "d",
            "--border",
            "fill",
            "--fill-memory",
            "1GiB",
            "--mode",
            "mesh",
            "--path",
            "gaussian",
            "--smoothness",
            "2.5",
            "--min-crop",
            "0.7",
            "--zoom",
            "adaptive",
            "--mask",
            "m.png",
            "--interpolation",
            "lanczos3",
            "--codec",
            "av1",
            "--crf",
            "30",
            "--preset",
            "6",
            "--strict",
            "--compare",
        ],
        &["a.mp4", "-o", "b.mp4", "--motion", "m.json", "--path-file", "p.json", "--export-stmap", "maps"],
    ];
    for (i, options) in cases.into_iter().enumerate() {
        let args = ["plumbline", "stabilize"].iter().chain(options);
        let file = pipeline_of(args).expect("options in order");
        let printed = print(&file);
        let built = check(file).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        let loaded = read(source(&printed), &[]).unwrap_or_else(|p| panic!("{printed}\n{}", p.render(false, 100)));
        assert_eq!(loaded, built, "{printed}");
        insta::assert_snapshot!(format!("print_pipeline_{i}"), printed);
    }
}

#[test]
fn the_command_builds_the_shipped_graphs() {
    for (name, options) in [("stabilize", &[][..]), ("stabilize-3d", &["--mode", "3d"])] {
        let args = ["plumbline", "stabilize", "a.mp4", "--out-dir", "d"].iter().chain(options);
        let file = pipeline_of(args).expect("options in order");
        let built = check(file).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        let read = read(shipped(name).expect("shipped"), &[]).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        assert_eq!(draw(&built.graph, GraphFormat::Mermaid), draw(&read.graph, GraphFormat::Mermaid));
        for stage in read.graph.stages.iter().filter(|s| s.name != "out" && s.name != "source") {
            let ours = built.graph.stage(&stage.name).expect("the same stages");
            assert_eq!(ours.settings.to_json(), stage.settings.to_json(), "{name}: {}", stage.name);
        }
    }
}

#[test]
fn print_pipeline_of_the_program_is_a_file_that_check_accepts() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let printed = plumbline(&["stabilize", "a.mp4", "-o", "b.mp4", "--crf", "20", "--print-pipeline"]);
    let file = folder.path().join("job.toml");
    std::fs::write(&file, &printed.stdout).expect("a small file");
    let checked = plumbline_in(folder.path(), &["check", "job.toml"]);
    assert_eq!(checked.status.code(), Some(0), "{}", err(&checked));
    let again = plumbline_in(folder.path(), &["run", "job.toml", "--print-pipeline"]);
    assert_eq!(again.stdout, printed.stdout);
}

#[test]
fn the_document_on_commands_names_every_command_and_exit_status() {
    let document = std::fs::read_to_string("docs/COMMANDS.md").expect("a document");
    for command in plumbline::app::cli::command().get_subcommands().filter(|command| !command.is_hide_set()) {
        assert!(document.contains(&format!("| `{}` |", command.get_name())), "{}", command.get_name());
    }
    for status in [0, 1, 2, 3, 65, 73, 75] {
        assert!(document.contains(&format!("\n| {status} | ")), "{status}");
    }
}

/// What `--print-pipeline` prints for `args`.
fn printed(args: &[&str]) -> String {
    let file = pipeline_of(["plumbline"].iter().chain(args)).unwrap_or_else(|e| panic!("{args:?}: {e}"));
    let text = print(&file);
    check(file).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
    text
}

#[test]
fn a_suffix_names_results_and_folders_take_the_further_files_of_many_inputs() {
    let many = ["a.mp4", "b.mp4", "--suffix", "_steady", "--report", "pages/", "--export-motion", "motion"];
    let text = printed(&[&["stabilize"], &many[..], &["--export-stmap", "maps", "--compare"]].concat());
    for path in [
        "${item.dir}/${item.stem}_steady.${item.ext}",
        "${item.dir}/${item.stem}_steady.compare.${item.ext}",
        "pages/${item.rel}/${item.stem}_steady.html",
        "motion/${item.rel}/${item.stem}_steady.motion.json",
        "maps/${item.rel}/${item.stem}_steady",
    ] {
        assert!(text.contains(&format!("path = \"{path}\"")), "{path}: {text}");
    }
    let photos = ["rectify", "p/*.jpg", "--out-dir", "d", "--suffix", "-flat", "--report", "r", "--save-lines", "l"];
    let text = printed(&photos);
    for path in [
        "d/${item.rel}/${item.stem}-flat.png",
        "r/${item.rel}/${item.stem}-flat.html",
        "l/${item.rel}/${item.stem}-flat.lines.json",
    ] {
        let kept = path.replace(".png", ".${item.ext}");
        assert!(text.contains(&format!("path = \"{path}\"")) || text.contains(&kept), "{path}: {text}");
    }
    let one = printed(&["stabilize", "a.mp4", "--suffix", "_s", "--report", "a.json"]);
    assert!(one.contains("path = \"a.json\""), "one input names its report itself: {one}");
}

#[test]
fn settings_of_a_file_are_the_defaults_of_options_and_reach_settings_without_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("mine.toml");
    let text = "version = 1\n[video.smooth]\nreserve = 0.03\n[video.encode]\ncrf = 25\npreset = \"fast\"\n\
                [mesh.render]\nwireframe = true\n[run]\nthreads = 3\n";
    std::fs::write(&file, text).expect("a small file");
    let settings = file.to_str().expect("UTF-8");
    let clip = printed(&["stabilize", "a.mp4", "-o", "b.mp4", "--settings", settings, "--crf", "23"]);
    for line in ["reserve = 0.03", "crf = 23.0", "preset = \"fast\"", "threads = 3"] {
        assert!(clip.lines().any(|l| l.trim().replace("  ", " ") == line), "{line}: {clip}");
    }
    assert!(!clip.contains("wireframe"), "settings of kinds that a command does not use are left out: {clip}");
    assert!(printed(&["render", "a.obj", "-o", "a.png", "--settings", settings]).contains("wireframe = true"));
    std::fs::write(&file, "[video.smooth]\nkeeep = 0.7\n").expect("a small file");
    let wrong = plumbline(&["stabilize", "a.mp4", "-o", "b.mp4", "--settings", settings]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(err(&wrong).contains("did you mean `keep`?") && err(&wrong).contains("mine.toml:2:1"), "{}", err(&wrong));
    std::fs::write(&file, "[video.encode]\ncrf = 18\n").expect("a small file");
    let explicit = printed(&["stabilize", "a.mp4", "-o", "b.mp4", "--settings", settings]);
    assert!(explicit.contains("crf = 18"), "{explicit}");
}
