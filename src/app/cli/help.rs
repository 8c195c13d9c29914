//! What `--help` says beyond the options: the commands in groups, exit codes, examples.

use std::fmt::Write as _;

use clap::Command;

/// The commands by what they are for, in the order of the help.
const GROUPS: [(&str, &[&str]); 6] = [
    ("Clips", &["stabilize", "motion", "probe"]),
    ("Photos", &["rectify", "retarget"]),
    ("Meshes", &["mesh", "deform", "modes", "morph", "blend", "compose", "render"]),
    ("Characters", &["skeleton", "skin", "pose"]),
    ("Pipelines", &["run", "check", "plan", "graph", "stages", "schema"]),
    ("Tools", &["solve", "completions"]),
];

/// The exit codes, for every command.
const EXIT_CODES: &str = "  0    done
  1    internal error
  2    wrong command line or pipeline file
  3    finished, but some items failed
  65   bad input
  73   cannot write the output
  75   temporary failure: try again
  130  interrupted (143: terminated)
";

/// Three command lines for each command, by its path below the program.
const EXAMPLES: [(&str, [&str; 3]); 29] = [
    (
        "",
        [
            "plumbline stabilize shaky.mp4 -o steady.mp4",
            "plumbline rectify wide.jpg -o straight.jpg",
            "plumbline run stabilize --set batch.foreach='clips/*.mp4'",
        ],
    ),
    (
        "stabilize",
        [
            "plumbline stabilize shaky.mp4 -o steady.mp4",
            "plumbline stabilize clips/ --out-dir steady/ --keep 90% -y",
            "plumbline stabilize walk.mp4 -o walk-steady.mp4 --smoothness 1 --report walk.html",
        ],
    ),
    (
        "motion",
        [
            "plumbline motion walk.mp4 -o walk.motion.json",
            "plumbline motion walk.mp4 --colmap model/",
            "plumbline motion walk.mp4 --gltf camera.glb --csv camera.csv",
        ],
    ),
    ("probe", ["plumbline probe clip.mp4", "plumbline probe clip.mp4 --json", "plumbline probe frames/%05d.png"]),
    (
        "rectify",
        [
            "plumbline rectify wide.jpg -o straight.jpg",
            "plumbline rectify fisheye.jpg -o flat.jpg --lens equidistant --fov 180 --to perspective",
            "plumbline rectify photos/ --out-dir straight/ --size 50%",
        ],
    ),
    (
        "retarget",
        [
            "plumbline retarget photo.jpg -o square.jpg --size 1:1",
            "plumbline retarget photo.jpg -o narrow.jpg --size 800x --importance painted.png",
            "plumbline retarget clip.mp4 -o vertical.mp4 --size 9:16 --stabilize",
        ],
    ),
    (
        "mesh",
        [
            "plumbline mesh info model.obj",
            "plumbline mesh repair scan.ply -o clean.ply",
            "plumbline mesh convert models/ --out-dir glb/ --format glb",
        ],
    ),
    (
        "mesh info",
        ["plumbline mesh info model.obj", "plumbline mesh info models/", "plumbline mesh info model.glb --json"],
    ),
    (
        "mesh repair",
        [
            "plumbline mesh repair scan.ply -o clean.ply",
            "plumbline mesh repair scan.stl -o clean.obj --weld 1e-6",
            "plumbline mesh repair scans/ --out-dir clean/ --format ply",
        ],
    ),
    (
        "mesh convert",
        [
            "plumbline mesh convert model.obj -o model.glb",
            "plumbline mesh convert model.glb -o model.stl --ascii",
            "plumbline mesh convert models/ --out-dir ply/ --format ply -y",
        ],
    ),
    (
        "deform",
        [
            "plumbline deform cactus.obj --handles bend.json -o bent.obj",
            "plumbline deform cactus.obj --handles bend.json -o bent.glb --frames 24",
            "plumbline deform cactus.obj --handles bend.json -o bent.obj --render bent.png --view front",
        ],
    ),
    (
        "modes",
        [
            "plumbline modes model.obj -o modes.npz",
            "plumbline modes model.obj -k 20 -o modes.npz",
            "plumbline modes model.obj --parts parts.json --part-count 6",
        ],
    ),
    (
        "morph",
        [
            "plumbline morph sit.obj stand.obj -o frames/",
            "plumbline morph sit.obj stand.obj -o morph.glb --seconds 4",
            "plumbline morph giraffe.obj dog.obj -o frames/ --landmarks pairs.json --frames 48",
        ],
    ),
    (
        "blend",
        [
            "plumbline blend sit.obj stand.obj --paint weights.json -o mixed.obj",
            "plumbline blend sit.obj stand.obj --paint weights.json -o mixed.glb --frames 24",
            "plumbline blend cat.obj dog.obj --paint weights.json --landmarks pairs.json -o mixed.obj",
        ],
    ),
    (
        "compose",
        [
            "plumbline compose body.obj head.obj --seam seam.json -o joined.obj",
            "plumbline compose body.obj head.obj --seam seam.json -o joined.obj --report joined.json",
            "plumbline compose body.obj head.obj --seam seam.json -o joined.obj --print-pipeline",
        ],
    ),
    (
        "render",
        [
            "plumbline render model.obj -o model.png",
            "plumbline render models/ --out-dir pictures/ --view 30,20",
            "plumbline render model.obj -o model.png --size 1920x1080 --wireframe",
        ],
    ),
    (
        "skeleton",
        [
            "plumbline skeleton model.obj -o skeleton.json",
            "plumbline skeleton model.obj -o rigged.glb --joints 20",
            "plumbline skeleton models/ --out-dir rigs/ --format bvh",
        ],
    ),
    (
        "skin",
        [
            "plumbline skin weights body.obj --skeleton rig.json -o weights.json",
            "plumbline skin weights body.obj --skeleton rig.bvh -o weights.json --method biharmonic",
            "plumbline skin train body.glb --examples pose1.obj pose2.obj -o body.skin",
        ],
    ),
    (
        "skin weights",
        [
            "plumbline skin weights body.obj --skeleton rig.json -o weights.json",
            "plumbline skin weights body.obj --skeleton rig.bvh -o weights.json --method biharmonic",
            "plumbline skin weights body.obj --skeleton rig.json -o weights.json --influences 4",
        ],
    ),
    (
        "skin train",
        [
            "plumbline skin train body.glb --examples pose1.obj pose2.obj -o body.skin",
            "plumbline skin train body.obj --skeleton rig.json --examples pose1.obj pose2.obj -o body.skin",
            "plumbline skin train body.glb --examples pose1.obj pose2.obj --held-out pose3.obj -o body.skin",
        ],
    ),
    (
        "pose",
        [
            "plumbline pose humanoid.glb --clip walk -o walk/",
            "plumbline pose humanoid.glb --pose wave.json -o waving.glb --rig",
            "plumbline pose body.obj --skeleton rig.json --pose wave.json -o waving.obj --render waving.png",
        ],
    ),
    (
        "run",
        [
            "plumbline run job.toml",
            "plumbline run stabilize --set batch.foreach='clips/*.mp4' --set vars.out=steady",
            "plumbline run job.toml --jobs 2 -y",
        ],
    ),
    (
        "check",
        [
            "plumbline check job.toml",
            "plumbline check stabilize --set out.crf=20",
            "plumbline check job.toml --message-format json",
        ],
    ),
    ("plan", ["plumbline plan job.toml", "plumbline plan stabilize", "plumbline plan job.toml --set run.threads=4"]),
    (
        "graph",
        [
            "plumbline graph job.toml",
            "plumbline graph stabilize --format mermaid",
            "plumbline graph job.toml --format dot",
        ],
    ),
    ("stages", ["plumbline stages", "plumbline stages video.smooth", "plumbline stages photo.rectify"]),
    ("schema", ["plumbline schema", "plumbline schema lines", "plumbline schema motion"]),
    (
        "solve",
        [
            "plumbline solve A.mtx",
            "plumbline solve A.mtx b.mtx -o x.mtx",
            "plumbline solve A.mtx --ordering nd --picture fill.png",
        ],
    ),
    ("completions", ["plumbline completions bash", "plumbline completions zsh", "plumbline completions fish"]),
];

/// The program's definition with groups, exit codes and examples.
pub(super) fn complete(command: Command) -> Command {
    let groups = grouped(&command);
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{groups}{}:\n{{options}}{{after-help}}",
        heading(&command, "Options")
    );
    with_footers(command.help_template(template), "")
}

/// The list of commands, by group.
fn grouped(command: &Command) -> String {
    let width = command.get_subcommands().map(|c| c.get_name().len()).max().unwrap_or_default();
    let mut text = String::new();
    for (group, names) in GROUPS {
        // Writing to a string does not fail, here and below.
        let _ = writeln!(text, "{}:", heading(command, group));
        for sub in names.iter().filter_map(|name| command.find_subcommand(name)) {
            let about = sub.get_about().map(ToString::to_string).unwrap_or_default();
            // Writing to a string does not fail.
            let _ = writeln!(text, "  {}  {about}", literal(command, sub.get_name(), width));
        }
        text += "\n";
    }
    text += "`plumbline COMMAND --help` describes a command and its options.\n\n";
    text
}

/// Exit codes and examples at the end of the long help of a command and of those below it.
fn with_footers(command: Command, path: &str) -> Command {
    let mut text = format!("{}:\n{EXIT_CODES}", heading(&command, "Exit codes"));
    if let Some(examples) = examples_of(path) {
        let _ = writeln!(text, "\n{}:", heading(&command, "Examples"));
        for example in examples {
            let _ = writeln!(text, "  {example}");
        }
    }
    let below = |sub: Command| {
        let path = format!("{path} {}", sub.get_name());
        with_footers(sub, path.trim())
    };
    command.after_long_help(text.trim_end().to_owned()).mut_subcommands(below)
}

/// The examples of a command.
fn examples_of(path: &str) -> Option<[&'static str; 3]> {
    EXAMPLES.iter().find(|(of, _)| *of == path).map(|(_, examples)| *examples)
}

/// Text in the style of clap's headings, which is dropped where the output is no terminal.
fn heading(command: &Command, text: &str) -> String {
    let style = command.get_styles().get_header();
    format!("{style}{text}{style:#}")
}

/// A name in the style of clap's literals, padded to `width`.
fn literal(command: &Command, name: &str, width: usize) -> String {
    let style = command.get_styles().get_literal();
    format!("{style}{name}{style:#}{}", " ".repeat(width - name.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_command_is_in_exactly_one_group() {
        let command = super::super::command();
        let listed: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        for sub in command.get_subcommands() {
            let count = listed.iter().filter(|name| **name == sub.get_name()).count();
            assert_eq!(count, 1, "{}", sub.get_name());
        }
        assert_eq!(listed.len(), command.get_subcommands().count(), "no group names a command that is not there");
    }

    /// The words of a command line; quotes keep what they hold together.
    fn words(line: &str) -> Vec<String> {
        let mut words = vec![String::new()];
        let mut quoted = false;
        for c in line.chars() {
            match (c, words.last_mut()) {
                ('\'', _) => quoted = !quoted,
                (' ', _) if !quoted => words.push(String::new()),
                (c, Some(word)) => word.push(c),
                (_, None) => {}
            }
        }
        words
    }

    fn check(command: &Command, root: &Command, path: &str) {
        let examples = examples_of(path).unwrap_or_else(|| panic!("`{path}` has no examples"));
        for example in examples {
            let read = root.clone().try_get_matches_from(words(example));
            assert!(read.is_ok(), "{example}: {}", read.err().map(|e| e.to_string()).unwrap_or_default());
            assert!(example.starts_with(format!("plumbline {path}").trim_end()), "{example} is no example of {path}");
        }
        let help = command.clone().render_long_help().to_string();
        assert!(help.contains("Exit codes:") && examples.iter().all(|e| help.contains(e)), "{help}");
        let short = command.clone().render_help().to_string();
        assert!(!short.contains("Exit codes:") && !short.contains("Examples:\n  plumbline"), "{short}");
        for sub in command.get_subcommands() {
            check(sub, root, format!("{path} {}", sub.get_name()).trim());
        }
    }

    #[test]
    fn every_example_of_every_command_is_a_command_line_that_it_reads() {
        let root = super::super::command();
        check(&root, &root, "");
    }
}
