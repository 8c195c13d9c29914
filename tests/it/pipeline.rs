//! Pipeline files: what is refused and how that reads, what is drawn and planned.

use plumbline::app::pipeline::draw::{GraphFormat, draw};
use plumbline::app::pipeline::memory::ClipShape;
use plumbline::app::pipeline::port::PortType;
use plumbline::app::pipeline::shipped::{SHIPPED, shipped};
use plumbline::app::pipeline::{Pipeline, Plan, Problems, Source, read};

pub(crate) fn source(text: &str) -> Source {
    Source { name: "test.toml".into(), text: text.into(), base: None }
}

fn faults(text: &str, set: &[&str]) -> Problems {
    let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
    read(source(text), &set).expect_err("the file has faults")
}

fn stabilize() -> Pipeline {
    read(shipped("stabilize").expect("shipped"), &[]).expect("no faults")
}

/// A correct pipeline of one clip, to put faults into.
pub(crate) const GOOD: &str = r#"version = 1

[stage.source]
use  = "video.decode"
path = "in.mp4"

[stage.tracks]
use    = "video.track"
inputs = ["source"]

[stage.motion]
use    = "video.motion"
inputs = ["tracks"]

[stage.path]
use    = "video.smooth"
inputs = ["motion"]

[stage.warp]
use    = "video.warp"
inputs = ["tracks", "path"]

[stage.steady]
use    = "video.render"
inputs = ["source", "warp"]

[stage.out]
use    = "video.encode"
inputs = ["steady", "source.audio"]
path   = "out.mp4"
"#;

#[test]
fn every_fault_is_reported_at_once_with_its_line_and_a_remedy() {
    let several = r#"
version = 1
vers = 2

[vars]
crf = 18
Bad = 1

[batch]
foreach = "clips/*.mp4"
job = 2
retries = -1

[stage.source]
use  = "video.decode"
path = "${item.paht}"
start = "1:99"

[stage.tracks]
use    = "video.trak"
inputs = ["source"]

[stage.motion]
use    = "video.motion"
inputs = ["tracks"]
rolling_shutter = 0.5

[stage.path]
use        = "video.smooth"
inputs     = ["motion"]
keep       = 1.5
smoothness = nan
method     = "gausian"
zoom       = 3

[stage.out]
use    = "video.encode"
inputs = { frames = "path", sound = "source" }
cfr    = 18
crf    = "${vars.cfr}"
strict = "yes"
"#;
    insta::assert_snapshot!("faults_of_settings", faults(several, &[]).render(false, 100));

    let edges = r#"
version = 1

[stage.source]
use  = "video.decode"
path = "a.mp4"

[stage.tracks]
use    = "video.track"
inputs = "source"

[stage.motion]
use    = "video.motion"
inputs = { tracks = "trcks" }

[stage.path]
use    = "video.smooth"
inputs = ["motion.path"]

[stage.warp]
use    = "video.warp"
inputs = { tracks = ["tracks", "tracks"], path = "motion" }

[stage.steady]
use    = "video.render"
inputs = { frames = "source.audio" }

[stage.out]
use    = "video.encode"
inputs = ["source", "source.audio", "source", "steady"]
path   = "b.mp4"
"#;
    insta::assert_snapshot!("faults_of_edges", faults(edges, &[]).render(false, 100));
}

#[test]
fn faults_of_the_whole_file_read_well() {
    let cycle = GOOD.replace("inputs = [\"source\"]\n\n[stage.motion]", "inputs = [\"steady\"]\n\n[stage.motion]");
    let disabled = GOOD.replace("use    = \"video.motion\"", "use    = \"video.motion\"\nenable = false");
    let twice = format!(
        "{GOOD}\n[stage.again]\nuse = \"video.render\"\ninputs = [\"steady\", \"warp\"]\n[stage.second]\nuse = \"video.encode\"\ninputs = [\"again\"]\npath = \"c.mp4\"\n"
    );
    let no_sink = &GOOD[..GOOD.find("[stage.out]").unwrap_or(0)];
    let conflict = format!("{GOOD}crf = 60\nbitrate = \"6M\"\n");
    let range = format!("{GOOD}crf = 60\n");
    let none = format!("{GOOD}crf = 18\ncodec = \"ffv1\"\n");
    let trimmed = GOOD.replace("path = \"in.mp4\"", "path = \"in.mp4\"\nstart = 00:00:12\nend = 10");
    let no_batch = GOOD.replace("out.mp4", "${item.stem}.mp4");
    let no_landmarks = r#"
version = 1

[stage.a]
use  = "mesh.load"
path = "a.obj"

[stage.b]
use  = "mesh.load"
path = "b.obj"

[stage.shapes]
use    = "mesh.morph"
inputs = { mesh = "a", other = "b" }
over   = "sphere"
refine = 0.01

[stage.out]
use    = "mesh.save"
inputs = ["shapes"]
path   = "shapes.ply"
frames = 9
"#;
    let cases: [(&str, &str, &[&str]); 17] = [
        ("syntax", "version = 1\n[stage.a\nuse = 3", &[]),
        ("duplicate_key", "version = 1\nname = \"a\"\nname = \"b\"\n", &[]),
        ("no_version", "[stage.a]\nuse = \"video.decode\"\npath = \"a\"\n", &[]),
        ("new_version", "version = 7\n", &[]),
        ("empty", "version = 1\n", &[]),
        ("types", "version = 1\nname = 3\nvars = 2\nstage = \"x\"\n", &[]),
        ("cycle", &cycle, &[]),
        ("disabled", &disabled, &[]),
        ("two_resamples", &twice, &[]),
        ("no_sink", no_sink, &[]),
        ("crf_and_bitrate", &conflict, &[]),
        ("crf_of_codec", &range, &[]),
        ("crf_of_lossless", &none, &[]),
        ("trim", &trimmed, &[]),
        ("over_without_landmarks", no_landmarks, &[]),
        ("item_without_batch", &no_batch, &[]),
        (
            "set",
            GOOD,
            &["nonsense", "oot.crf=3", "path.keep=0", "vars.X=1", "run.threads=many", ".=", "out.enable=maybe"],
        ),
    ];
    for (name, text, set) in cases {
        insta::assert_snapshot!(format!("fault_{name}"), faults(text, set).render(false, 100));
    }
}

#[test]
fn faults_for_programs_carry_line_and_column() {
    let text = GOOD.replace("path   = \"out.mp4\"", "path   = \"out.mp4\"\ncfr = 3");
    insta::assert_snapshot!(format!("{:#}", faults(&text, &[]).to_json()));
}

#[test]
fn a_shipped_file_begins_with_a_comment_and_has_no_faults() {
    for (name, text) in SHIPPED {
        assert!(text.starts_with("# "), "{name} says what it does");
        let pipeline =
            read(shipped(name).expect("shipped"), &[]).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        insta::assert_snapshot!(format!("graph_{name}"), draw(&pipeline.graph, GraphFormat::Text));
        insta::assert_snapshot!(format!("plan_{name}"), Plan::of(&pipeline.graph).describe(&pipeline.graph, None));
    }
}

#[test]
fn a_graph_is_drawn_in_every_format() {
    let graph = stabilize().graph;
    for format in [GraphFormat::Mermaid, GraphFormat::Dot, GraphFormat::Json] {
        insta::assert_snapshot!(format!("draw_{format:?}"), draw(&graph, format));
    }
}

#[test]
fn a_plan_of_a_known_clip_is_in_bytes() {
    let graph = stabilize().graph;
    let clip = ClipShape { width: 1920, height: 1080, frame_bytes: 1920 * 1080 * 3 / 2, frames: Some(300) };
    insta::assert_snapshot!(Plan::of(&graph).describe(&graph, Some(&clip)));
}

#[test]
fn pictures_are_opened_anew_in_each_pass_and_all_else_is_handed_on() {
    let graph = stabilize().graph;
    let plan = Plan::of(&graph);
    let names = |stages: &[usize]| -> Vec<String> { stages.iter().map(|&s| graph.stages[s].name.clone()).collect() };
    let passes: Vec<Vec<String>> = plan.passes.iter().map(|p| names(&p.stages)).collect();
    assert_eq!(passes, [vec!["source", "tracks", "motion", "path"], vec!["source", "warp", "steady", "out"]]);
    let handed: Vec<&str> = plan.passes[0].hands_on.iter().map(|(_, port)| *port).collect();
    assert_eq!(handed, ["tracks", "motion", "path"]);
    assert!(plan.passes[1].hands_on.is_empty());
}

#[test]
fn a_source_that_only_the_result_needs_is_opened_in_the_last_pass_alone() {
    let text = GOOD.replace("inputs = [\"source\", \"warp\"]", "inputs = [\"big\", \"warp\"]");
    let text = format!("{text}\n[stage.big]\nuse = \"video.decode\"\npath = \"big.mp4\"\n");
    let graph = read(source(&text), &[]).expect("no faults").graph;
    let big = graph.stages.iter().position(|s| s.name == "big").expect("big");
    let runs: Vec<bool> = Plan::of(&graph).passes.iter().map(|p| p.stages.contains(&big)).collect();
    assert_eq!(runs, [false, true]);
}

#[test]
fn memory_does_not_grow_with_pictures_of_a_longer_clip() {
    let graph = stabilize().graph;
    let plan = Plan::of(&graph);
    let bytes = |frames| {
        let clip = ClipShape { width: 1920, height: 1080, frame_bytes: 3_110_400, frames: Some(frames) };
        plan.passes.iter().map(|p| p.memory(&graph, Some(&clip))).max().unwrap_or(0)
    };
    assert_eq!(bytes(300), bytes(108_000), "the pass that holds most holds no more for an hour");
}

#[test]
fn pixels_are_interpolated_once() {
    for (name, _) in SHIPPED {
        let graph = read(shipped(name).expect("shipped"), &[]).expect("no faults").graph;
        for (i, stage) in graph.stages.iter().enumerate() {
            assert!(graph.resamples(i) <= 1, "{name}: {}", stage.name);
        }
        if graph.gives(PortType::Mesh) {
            continue; // no picture comes in
        }
        let out = graph.stages.iter().position(|s| matches!(s.kind.name, "video.encode" | "image.save"));
        assert_eq!(out.map(|out| graph.resamples(out)), Some(1), "{name}");
    }
}

#[test]
fn a_lone_reference_gives_its_type_and_the_environment_what_is_asked_for() {
    let text =
        format!("{GOOD}crf = \"${{vars.crf}}\"\nstrict = \"${{env.PLUMBLINE_TEST_UNSET:-true}}\"\n[vars]\ncrf = 21\n");
    let pipeline = read(source(&text), &[]).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
    let out = pipeline.graph.stage("out").expect("out").settings.to_json();
    assert_eq!((&out["crf"], &out["strict"]), (&21.0.into(), &true.into()));
    let set = ["vars.crf=30".to_owned()];
    let out = read(source(&text), &set).expect("no faults").graph.stage("out").expect("out").settings.to_json();
    assert_eq!(out["crf"], 30.0, "an option wins over the file");
}

#[test]
fn relative_paths_start_from_the_text_that_holds_them() {
    let text = GOOD.replace("in.mp4", "${vars.clip}");
    let text = format!("{text}\n[vars]\nclip = \"in.mp4\"\n");
    let from = Source { name: "jobs/a.toml".into(), text, base: Some("jobs".into()) };
    let path = |set: &[String], stage: &str| {
        let pipeline = read(from.clone(), set).expect("no faults");
        pipeline.graph.stage(stage).expect("stage").settings.to_json()["path"].clone()
    };
    assert_eq!(path(&[], "source"), "jobs/in.mp4", "a variable brings its own folder");
    assert_eq!(path(&[], "out"), "jobs/out.mp4");
    assert_eq!(path(&["vars.clip=x.mp4".into()], "source"), "x.mp4", "an option is typed in the working directory");
    assert_eq!(path(&["source.path=/abs.mp4".into()], "source"), "/abs.mp4");
    let standard = Source { text: GOOD.replace("in.mp4", "-"), ..from.clone() };
    let graph = read(standard, &[]).expect("no faults").graph;
    let source = graph.stage("source").expect("source").settings.to_json();
    assert_eq!(source["path"], "-", "standard input has no folder");
}

#[test]
fn a_number_that_names_a_file_stays_a_name() {
    let pipeline = read(source(GOOD), &["source.path=123".into()]).expect("no faults");
    assert_eq!(pipeline.graph.stage("source").expect("source").settings.to_json()["path"], "123");
}

#[test]
fn a_disabled_stage_and_an_optional_edge_to_it_fall_away() {
    let text = format!(
        "{GOOD}\n[stage.extra]\nuse = \"video.encode\"\ninputs = [\"steady\"]\npath = \"x.mp4\"\nenable = false\n"
    );
    let pipeline = read(source(&text), &[]).expect("no faults");
    assert!(pipeline.graph.stage("extra").is_none());
    let printed = read(source(&plumbline::app::pipeline::print(&pipeline.file)), &[]).expect("no faults");
    assert_eq!(printed, pipeline, "printing keeps it disabled");
    let kept = read(source(&text), &["extra.enable=true".into()]).expect("no faults");
    assert!(kept.graph.stage("extra").is_some());
}

#[test]
fn a_fault_of_syntax_hides_no_other_fault_and_invents_none() {
    // Each text has one fault of syntax and a misspelled setting further down.
    let end =
        "[stage.out]\nuse = \"video.encode\"\ninputs = [\"steady\", \"source.audio\"]\npath = \"out.mp4\"\ncfr = 3\n";
    let good = GOOD.split("[stage.out]").next().expect("its beginning");
    let faulty = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        format!("{}{end}", good.replacen(from, to, 1))
    };
    for (name, text) in [
        ("value", faulty("path = \"in.mp4\"", "path = in.mp4")),
        ("string", faulty("path = \"in.mp4\"", "path = \"in.mp4")),
        ("long string", faulty("path = \"in.mp4\"", "path = \"\"\"in.mp4")),
        ("no value", faulty("path = \"in.mp4\"", "path =")),
        ("two values", faulty("path = \"in.mp4\"", "path = \"in.mp4\" \"x\"")),
        ("no key", faulty("path = \"in.mp4\"", "path = \"in.mp4\"\n= 3")),
        ("no equals", faulty("path = \"in.mp4\"", "path = \"in.mp4\"\nstart")),
        ("open list", faulty("[\"source\", \"warp\"]", "[\"source\", \"warp\"")),
        ("open list over lines", faulty("[\"source\", \"warp\"]", "[\n  \"source\",\n  \"warp\",\n")),
        ("list without comma", faulty("[\"source\", \"warp\"]", "[\n  \"source\"\n  \"warp\"\n]")),
        ("open table", faulty("inputs = [\"motion\"]", "inputs = { motion = \"motion\"")),
        ("header", faulty("[stage.motion]", "[stage.motion")),
        ("header of a list", faulty("[stage.motion]", "[[stage.motion]")),
        ("kind", faulty("use    = \"video.track\"", "use    = video.track")),
        ("key twice", faulty("path = \"in.mp4\"", "path = \"in.mp4\"\npath = \"b.mp4\"")),
        (
            "table twice",
            faulty("[stage.motion]", "[stage.tracks]\nuse = \"video.track\"\ninputs = [\"source\"]\n[stage.motion]"),
        ),
        ("version", faulty("version = 1", "version = one")),
        ("number", faulty("path = \"in.mp4\"", "path = \"in.mp4\"\nstart = 1.2.3")),
    ] {
        let found = faults(&text, &[]);
        let shown = found.render(false, 100);
        let codes: Vec<&str> = found.problems.iter().map(|p| p.code).collect();
        assert_eq!(codes, ["syntax", "unknown-key"], "{name}: {shown}");
        let line = text.lines().position(|l| l == "cfr = 3").map(|at| at + 1);
        let at = found.problems[1].labels.first().map(|(span, _)| found.sources.line_column(*span).0);
        assert_eq!(at, line, "{name}: {shown}");
    }
    // Several at once, in their order.
    let text = faulty("path = \"in.mp4\"", "path = in.mp4")
        .replace("[\"motion\"]", "[\"motion\"")
        .replace("cfr = 3", "crf = x");
    let found = faults(&text, &["steady.interpolatoin=lanczos"]);
    let lines: Vec<usize> = found
        .problems
        .iter()
        .filter(|p| p.code == "syntax")
        .map(|p| found.sources.line_column(p.labels[0].0).0)
        .collect();
    assert_eq!(lines.len(), 3, "{}", found.render(false, 100));
    assert!(lines.is_sorted() && found.problems.iter().any(|p| p.code == "unknown-key"), "{lines:?}");
}

#[test]
fn any_text_is_read_to_its_end_without_a_panic() {
    let pieces = [
        "[",
        "]",
        "=",
        "\"",
        "'",
        "\n",
        "a",
        "é",
        ".",
        ",",
        "{",
        "}",
        "#",
        "\"\"\"",
        "\\",
        " ",
        "[stage.a]\n",
        "use = 1\n",
    ];
    let mut state = 7_u32;
    for _ in 0..3000 {
        let mut text = String::new();
        for _ in 0..(state % 23) {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            text += pieces[(state >> 16) as usize % pieces.len()];
        }
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        assert!(!faults(&text, &[]).problems.is_empty(), "{text:?}");
    }
}

#[test]
fn of_many_faults_fifty_are_printed_and_the_others_counted() {
    let many: Vec<String> = (0..2000).map(|i| format!("key{i} = {i}\n")).collect();
    let many = many.concat();
    let found = faults(&format!("version = 1\n[stage.a]\nuse = \"video.decode\"\npath = \"a.mp4\"\n{many}"), &[]);
    let text = found.render(false, 100);
    let shown = text.matches("has no setting").count();
    let further = found.problems.len() - shown;
    assert_eq!(shown, 50);
    assert!(text.ends_with(&format!("and {further} further errors\n")), "{}", &text[text.len() - 200..]);
    let json = found.to_json();
    let list = json.as_array().expect("a list");
    assert_eq!((list.len(), &list[50]["code"]), (51, &"further".into()));
    // Faults of syntax as well.
    let many = "x =\n".repeat(500);
    assert!(faults(&many, &[]).problems.len() <= 60);
}
