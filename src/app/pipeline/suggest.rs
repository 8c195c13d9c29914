//! "Did you mean …": the known name nearest to a mistyped one.

/// A sentence that names the likeliest of `known`, else lists them all; `None` where nothing is known.
pub fn did_you_mean<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let known: Vec<&str> = known.into_iter().collect();
    let limit = (wrong.chars().count() / 3).max(1);
    let nearest = known.iter().map(|k| (distance(wrong, k), *k)).min();
    match nearest {
        None => None,
        Some((d, name)) if d <= limit && d < name.len() => Some(format!("did you mean `{name}`?")),
        Some(_) if known.len() == 1 => Some(format!("expected {}", listed(&known))),
        Some(_) => Some(format!("expected one of {}", listed(&known))),
    }
}

/// `` `a`, `b` or `c` ``.
pub fn listed(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
    match quoted.split_last() {
        None => String::new(),
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
    }
}

/// Damerau–Levenshtein distance (optimal string alignment): insertions, deletions, substitutions and swaps of neighbours.
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().take(64).collect(), b.chars().take(64).collect());
    let mut rows: Vec<Vec<usize>> = vec![(0..=b.len()).collect()];
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let cost = usize::from(a[i - 1] != b[j - 1]);
            let mut best = (rows[i - 1][j] + 1).min(row[j - 1] + 1).min(rows[i - 1][j - 1] + cost);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(rows[i - 2][j - 2] + 1);
            }
            row.push(best);
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_slip_of_the_hand_costs_one() {
        for (a, b) in [("crf", "cfr"), ("smooth", "smoth"), ("warp", "warpp"), ("codec", "cadec")] {
            assert_eq!(distance(a, b), 1, "{a} {b}");
        }
        assert_eq!(distance("", "abc"), 3);
    }

    #[test]
    fn a_far_name_lists_what_is_known() {
        assert_eq!(did_you_mean("cfr", ["path", "crf"]).as_deref(), Some("did you mean `crf`?"));
        assert_eq!(did_you_mean("banana", ["path", "crf"]).as_deref(), Some("expected one of `path` or `crf`"));
        assert_eq!(did_you_mean("x", []), None);
    }
}
