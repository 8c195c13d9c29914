//! British spellings: accepted wherever an option or a word is spelled in the American way, and shown nowhere.

use clap::Command;

/// Parts of words in American and in British spelling.
const SPELLINGS: [(&str, &str); 6] = [
    ("stabiliz", "stabilis"),
    ("optimiz", "optimis"),
    ("center", "centre"),
    ("color", "colour"),
    ("gray", "grey"),
    ("neighbor", "neighbour"),
];

/// The British spelling of `word`, where it differs.
pub(super) fn british(word: &str) -> Option<String> {
    let spelled = SPELLINGS.iter().fold(word.to_owned(), |word, (ours, theirs)| word.replace(ours, theirs));
    (spelled != word).then_some(spelled)
}

/// The same command, whose options and subcommands also have their British names.
pub(super) fn accept_british(command: Command) -> Command {
    let command = command.mut_args(|arg| match arg.get_long().and_then(british) {
        Some(spelled) => arg.alias(spelled),
        None => arg,
    });
    let alias = british(command.get_name());
    let command = if let Some(alias) = alias { command.alias(alias) } else { command };
    command.mut_subcommands(accept_british)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn british_spellings_of_options_commands_and_choices_are_accepted_and_hidden() {
        assert_eq!(british("colors").as_deref(), Some("colours"));
        assert_eq!(british("smoothness"), None);
        let command = super::super::command();
        for args in [
            &["plumbline", "stabilise", "a.mp4", "-o", "b.mp4"][..],
            &["plumbline", "retarget", "a.mp4", "--size", "9:16", "-o", "b.mp4", "--stabilise"],
            &["plumbline", "render", "a.obj", "-o", "b.png", "--colours"],
            &["plumbline", "rectify", "a.jpg", "-o", "b.jpg", "--to", "optimised"],
        ] {
            let read = command.clone().try_get_matches_from(args);
            assert!(read.is_ok(), "{}", read.err().map(|e| e.to_string()).unwrap_or_default());
        }
        let help = command.clone().render_long_help().to_string();
        assert!(!help.contains("stabilise"), "{help}");
    }
}
