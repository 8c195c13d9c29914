//! Names of cameras and lenses, compared as people write them.

use std::collections::BTreeSet;

/// Words and numbers of a name: `EF-S10-22mm f/3.5-4.5` is `ef s 10 22 mm f 3.5 4.5`.
pub(super) fn words(name: &str) -> BTreeSet<String> {
    let mut words = BTreeSet::new();
    let mut word = String::new();
    let mut numeric = false;
    for c in name.chars().flat_map(char::to_lowercase).chain(" ".chars()) {
        let digit = c.is_ascii_digit() || c == '.' && numeric;
        let letter = c.is_alphabetic() || c == '+';
        if !word.is_empty() && (!(digit || letter) || digit != numeric) {
            // `4.0` is `4`, a final dot none of the number's.
            let trimmed =
                if numeric && word.contains('.') { word.trim_end_matches('0').trim_end_matches('.') } else { &word };
            words.insert(trimmed.to_owned());
            word.clear();
        }
        if digit || letter {
            word.push(c);
            numeric = digit;
        }
    }
    words
}

/// Words that do not distinguish lenses.
const COMMON: [&str; 4] = ["mm", "f", "lens", "with"];

/// Similarity of two names, 0 to 1: the fraction of words in common.
pub(super) fn likeness(a: &BTreeSet<String>, b: &BTreeSet<String>) -> f64 {
    let telling = |w: &&String| !COMMON.contains(&w.as_str());
    let common = a.intersection(b).filter(telling).count();
    let all = a.union(b).filter(telling).count();
    if all == 0 { 0.0 } else { common as f64 / all as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spellings_of_one_lens_have_the_same_words() {
        assert_eq!(words("EF-S10-22mm f/3.5-4.5 USM"), words("EF-S 10-22 mm F3.5-4.5 USM"));
        assert_eq!(words("10.5mm f/2.80"), words("f/2.8 10.5 mm"));
        assert_eq!(likeness(&words("10.5mm f/2.8 Fisheye"), &words("Fisheye 10.5 f2.8")), 1.0);
        assert!(likeness(&words("10.5mm f/2.8"), &words("16mm f/2.8")) < 0.5);
        assert_eq!(likeness(&words(""), &words("mm")), 0.0);
    }
}
