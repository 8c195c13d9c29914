//! The field's words: private ones of earlier versions do not come back into public names and help texts.

use std::collections::BTreeSet;
use std::path::Path;

use crate::public_surface::{LIBRARIES, surface};
use crate::support::program::{out, plumbline_in};

/// Words that no public name has, and what to write instead.
const NAMES: [(&str, &str); 9] = [
    ("least fewest", "min"),
    ("farthest widest", "max"),
    ("covering watching beside", "crop correction, importance, side by side"),
    ("tier", "motion model, segment outcome"),
    ("bender stray", "warp solver, path deviation"),
    ("bodies rehearse feed", "builtin stages, preflight, render inputs"),
    ("companions unfinished", "passthrough streams, atomic file"),
    ("web heights crowns unhook", "curve graph, geodesic extrema, corner clusters, rim hooks"),
    ("hopeless faint idle aside", "the name of what is bounded"),
];

/// Words that neither a public name nor a help text has.
const REPLACED: [(&str, &str); 15] = [
    ("wish wishes", "the enum itself, or a choice"),
    ("rounds", "iterations"),
    ("share", "fraction or ratio"),
    ("turn turns turned turning", "rotation"),
    ("place places", "position or point"),
    ("way ways", "path or trajectory"),
    ("tell tells told telling", "report or print"),
    ("lies stands", "is"),
    ("believe believed doubt", "weight or standard deviation"),
    ("dear", "costly"),
    ("held unheld", "constrained, unconstrained"),
    ("gauge", "distortion metrics"),
    ("judgment sighting foretold", "loss, observation, held-out prediction"),
    ("salience", "saliency"),
    ("arctangent", "field-of-view (FOV) model"),
];

/// Terms with such a word in them: taken out before the words are compared.
const TERMS: [&str; 3] = ["in place", "held out", "web p"];

/// Words of a text in lower case; names are taken apart at capitals, underscores and digits.
fn words(text: &str) -> BTreeSet<String> {
    let mut spaced = String::with_capacity(text.len() + text.len() / 4);
    let mut before = ' ';
    for c in text.chars() {
        if c.is_uppercase() && before.is_lowercase() {
            spaced.push(' ');
        }
        spaced.push(if c.is_alphabetic() { c.to_ascii_lowercase() } else { ' ' });
        before = c;
    }
    for term in TERMS {
        spaced = spaced.replace(term, " ");
    }
    spaced.split(' ').filter(|w| !w.is_empty()).map(str::to_owned).collect()
}

/// Replaced words of a text, each with what to write.
fn found(text: &str, replaced: &[(&'static str, &'static str)]) -> Vec<(&'static str, &'static str)> {
    let words = words(text);
    let each = replaced.iter().flat_map(|&(old, new)| old.split(' ').map(move |old| (old, new)));
    each.filter(|(old, _)| words.contains(*old)).collect()
}

fn assert_none(faults: &[String]) {
    assert!(faults.is_empty(), "{} places have a word that was replaced:\n{}", faults.len(), faults.join("\n"));
}

/// The help text of a command and of all below it.
fn help_texts(mut command: clap::Command, path: &str, texts: &mut Vec<(String, String)>) {
    let name = format!("{path} {}", command.get_name()).trim_start().to_owned();
    texts.push((name.clone(), command.render_long_help().to_string()));
    for below in command.get_subcommands().filter(|c| c.get_name() != "help") {
        help_texts(below.clone(), &name, texts);
    }
}

/// What `plumbline stages` prints, of the list and of each kind.
fn stage_texts() -> Vec<(String, String)> {
    let print = |args: &[&str]| (args.join(" "), out(&plumbline_in(Path::new("."), args)));
    let list = print(&["stages"]);
    let kinds: Vec<_> =
        list.1.lines().filter_map(|l| l.split_whitespace().next()).filter(|w| w.contains('.')).collect();
    let each: Vec<_> = kinds.iter().map(|kind| print(&["stages", kind])).collect();
    each.into_iter().chain([list.clone()]).collect()
}

#[test]
fn public_names_are_the_words_of_the_field() {
    let (mut faults, banned) = (Vec::new(), [&NAMES[..], &REPLACED[..]].concat());
    for krate in LIBRARIES {
        for (file, items) in surface(krate) {
            for item in items {
                faults.extend(
                    found(&item, &banned).iter().map(|(old, new)| format!("{krate}/{file}: `{item}`: {old} -> {new}")),
                );
            }
        }
    }
    assert_none(&faults);
}

#[test]
fn help_texts_use_the_words_of_the_field() {
    let mut faults = Vec::new();
    let mut texts = stage_texts();
    help_texts(plumbline::app::cli::command(), "", &mut texts);
    assert!(texts.len() > 60, "{} texts: the walk lost some", texts.len());
    for (name, text) in texts {
        for line in text.lines() {
            faults.extend(
                found(line, &REPLACED).iter().map(|(old, new)| format!("{name}: {}: {old} -> {new}", line.trim())),
            );
        }
    }
    assert_none(&faults);
}

#[test]
fn names_are_split_into_words_and_terms_are_allowed() {
    assert_eq!(found("pub const LEAST_AREA: f64", &NAMES), [("least", "min")]);
    assert_eq!(found("pub fn how_it_turns(CropWish)", &REPLACED).len(), 2);
    assert!(found("pub fn solve_in_place(held_out: &WebP)", &REPLACED).is_empty());
    assert!(found("pub struct Widespread", &NAMES).is_empty());
}
