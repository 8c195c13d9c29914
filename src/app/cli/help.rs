//! What `--help` says beyond the options: the commands in groups, exit codes, examples.

use std::fmt::Write as _;

use clap::Command;

use super::extension::Extension;

/// The commands by what they are for, in the order of the help.
const GROUPS: [(&str, &[&str]); 6] = [
    ("Clips", &["stabilize", "motion", "probe"]),
    ("Photos", &["rectify", "retarget"]),
    ("Meshes", &["mesh", "deform", "modes", "morph", "blend", "compose", "render"]),
    ("Characters", &["skeleton", "skin", "pose"]),
    ("Pipelines", &["run", "check", "plan", "task", "graph", "stages", "schema"]),
    ("Tools", &["solve", "cache", "doctor", "completions"]),
];

/// The exit codes, for every command.
const EXIT_CODES: &str = "  0    done
  1    internal error
  2    wrong command line or pipeline file
  3    finished, but some items failed, or a clip is cut short
  4    a plan of another version, or whose input changed
  65   bad input
  73   cannot write the output
  75   temporary failure: try again
  130  interrupted (143: terminated, 129: its terminal was closed)
";

/// Three command lines for each command, below its name; an empty line ends them.
const EXAMPLES: &str = include_str!("examples.txt");

/// The program's definition with groups, exit codes and examples.
pub(super) fn complete(command: Command, extensions: &[Extension]) -> Command {
    let groups = grouped(&command, extensions);
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{groups}{}:\n{{options}}{{after-help}}",
        heading(&command, "Options")
    );
    with_footers(command.help_template(template), "", extensions)
}

/// The list of commands, by group.
fn grouped(command: &Command, extensions: &[Extension]) -> String {
    let width = command.get_subcommands().map(|c| c.get_name().len()).max().unwrap_or_default();
    let mut groups: Vec<(&str, Vec<String>)> =
        GROUPS.iter().map(|(group, names)| (*group, names.iter().map(ToString::to_string).collect())).collect();
    for extension in extensions {
        let name = (extension.command)().get_name().to_owned();
        match groups.iter_mut().find(|(group, _)| *group == extension.group) {
            Some((_, names)) => names.push(name),
            None => groups.push((extension.group, vec![name])),
        }
    }
    let mut text = String::new();
    for (group, names) in groups {
        // Writing to a string does not fail, here and below.
        let _ = writeln!(text, "{}:", heading(command, group));
        for sub in names.iter().filter_map(|name| command.find_subcommand(name)) {
            let about = sub.get_about().map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(text, "  {}  {about}", literal(command, sub.get_name(), width));
        }
        text += "\n";
    }
    text += "`plumbline COMMAND --help` describes a command and its options.\n\n";
    text
}

/// Exit codes and examples at the end of the long help of a command and of those below it.
fn with_footers(command: Command, path: &str, extensions: &[Extension]) -> Command {
    let mut text = format!("{}:\n{EXIT_CODES}", heading(&command, "Exit codes"));
    let other = extensions.iter().find(|extension| (extension.command)().get_name() == path);
    if let Some(examples) = other.map(|extension| extension.examples).or_else(|| examples_of(path)) {
        let _ = write!(text, "\n{}:\n{examples}", heading(&command, "Examples"));
    }
    let below = |sub: Command| {
        let path = format!("{path} {}", sub.get_name());
        with_footers(sub, path.trim(), extensions)
    };
    command.after_long_help(text.trim_end().to_owned()).mut_subcommands(below)
}

/// The examples of a command, one on a line.
fn examples_of(path: &str) -> Option<&'static str> {
    let name = format!("plumbline {path}");
    EXAMPLES.split("\n\n").find_map(|section| section.strip_prefix(name.trim_end())?.strip_prefix(":\n"))
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
        let shown = || command.get_subcommands().filter(|sub| !sub.is_hide_set());
        for sub in shown() {
            let count = listed.iter().filter(|name| **name == sub.get_name()).count();
            assert_eq!(count, 1, "{}", sub.get_name());
        }
        assert_eq!(listed.len(), shown().count(), "no group names a command that is not there");
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
        let examples: Vec<&str> = examples.lines().map(str::trim_start).collect();
        assert_eq!(examples.len(), 3, "{path}");
        for example in &examples {
            let read = root.clone().try_get_matches_from(words(example));
            assert!(read.is_ok(), "{example}: {}", read.err().map(|e| e.to_string()).unwrap_or_default());
            assert!(example.starts_with(format!("plumbline {path}").trim_end()), "{example} is no example of {path}");
        }
        let help = command.clone().render_long_help().to_string();
        assert!(help.contains("Exit codes:") && examples.iter().all(|e| help.contains(e)), "{help}");
        let short = command.clone().render_help().to_string();
        assert!(!short.contains("Exit codes:") && !short.contains("Examples:\n  plumbline"), "{short}");
        for sub in command.get_subcommands().filter(|sub| !sub.is_hide_set()) {
            check(sub, root, format!("{path} {}", sub.get_name()).trim());
        }
    }

    #[test]
    fn every_example_of_every_command_is_a_command_line_that_it_reads() {
        let root = super::super::command();
        check(&root, &root, "");
    }
}
