//! `plumbline solve`, by running the program.

use std::fmt::Write as _;
use std::path::Path;

use plumbline::num::sparse::read_matrix_market;

use crate::support::program::{err, out, plumbline_in};

/// Laplacian of a `side²` grid plus `shift`, lower triangle.
fn grid(side: usize, shift: f64) -> String {
    let n = side * side;
    let mut entries = Vec::new();
    for i in 0..n {
        let (x, y) = (i % side, i / side);
        let right = (x + 1 < side).then_some(i + 1);
        let below = (y + 1 < side).then_some(i + side);
        let degree = usize::from(x > 0) + usize::from(y > 0) + right.iter().len() + below.iter().len();
        entries.push((i, i, degree as f64 + shift));
        entries.extend([right, below].into_iter().flatten().map(|j| (j, i, -1.0)));
    }
    let mut text = format!("%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {}\n", entries.len());
    for (i, j, v) in entries {
        let _ = writeln!(text, "{} {} {v}", i + 1, j + 1);
    }
    text
}

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).expect("a writable folder");
}

#[test]
fn a_system_is_solved_reported_and_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), "a.mtx", &grid(12, 0.25));
    for method in ["auto", "cholesky", "simplicial", "ldlt", "lu", "qr", "cg", "gauss-seidel"] {
        let args =
            ["solve", "a.mtx", "--method", method, "--ordering", "nd", "-o", "x.mtx", "--report", "r.json", "-y"];
        let output = plumbline_in(folder.path(), &args);
        assert_eq!(output.status.code(), Some(0), "{method}: {}", err(&output));
        let x = std::fs::read_to_string(folder.path().join("x.mtx")).expect("written");
        let x = read_matrix_market(&x).expect("Matrix Market");
        assert_eq!((x.rows(), x.columns(), x.nnz()), (144, 1, 144));
        assert!(x.entries().all(|(_, _, v)| (v - 1.0).abs() < 1e-8), "{method}");
        let report = std::fs::read_to_string(folder.path().join("r.json")).expect("written");
        let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
        let name = if method == "auto" { "cholesky" } else { method };
        assert_eq!((&report["method"], &report["ordering"]), (&name.into(), &"nd".into()));
        assert!(report["solutions"][0]["residual"].as_f64() < Some(1e-9), "{report}");
        assert!(out(&output).contains("nd         nnz(L)") && out(&output).contains('←'), "{}", out(&output));
    }
    let output = plumbline_in(folder.path(), &["solve", "a.mtx", "--picture", "p.png"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(std::fs::read(folder.path().join("p.png")).expect("written").starts_with(b"\x89PNG"));
}

#[test]
fn a_condition_that_leaves_few_digits_is_warned_of() {
    let folder = tempfile::tempdir().expect("a folder");
    for (least, warns) in [("1e-3", false), ("1e-12", true)] {
        let matrix =
            format!("%%MatrixMarket matrix coordinate real symmetric\n3 3 4\n1 1 2\n2 2 1\n3 3 {least}\n2 1 1\n");
        write(folder.path(), "a.mtx", &matrix);
        let output = plumbline_in(folder.path(), &["solve", "a.mtx", "--method", "cholesky"]);
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        let text = out(&output);
        assert_eq!(text.contains("the condition leaves about 3 digits"), warns, "{text}");
        assert_eq!(text.contains("warning"), warns, "{text}");
    }
}

#[test]
fn low_rank_changes_solve_the_changed_system() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), "a.mtx", &grid(12, 0.25));
    let header = "%%MatrixMarket matrix coordinate real general";
    write(folder.path(), "more.mtx", &format!("{header}\n2 144 3\n1 5 2.0\n1 90 -1.0\n2 17 3.0\n"));
    write(folder.path(), "less.mtx", &format!("{header}\n1 144 1\n1 17 2.0\n"));
    for changes in [&["--update", "more.mtx"][..], &["--update", "more.mtx", "--downdate", "less.mtx"]] {
        let args = [&["solve", "a.mtx", "--report", "r.json", "-y"][..], changes].concat();
        let output = plumbline_in(folder.path(), &args);
        assert_eq!(output.status.code(), Some(0), "{changes:?}: {}", err(&output));
        let report = std::fs::read_to_string(folder.path().join("r.json")).expect("written");
        let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
        assert!(report["solutions"][0]["error"].as_f64() < Some(1e-9), "{report}");
        assert_eq!(report["method"], "low-rank update");
    }
    write(folder.path(), "narrow.mtx", &format!("{header}\n1 7 1\n1 1 2.0\n"));
    let output = plumbline_in(folder.path(), &["solve", "a.mtx", "--update", "narrow.mtx"]);
    assert_eq!(output.status.code(), Some(2), "{}", err(&output));
    assert!(err(&output).contains("narrow.mtx: has 7 columns (expected 144)"), "{}", err(&output));
    write(folder.path(), "all.mtx", &format!("{header}\n1 144 1\n1 17 9.0\n"));
    let output = plumbline_in(folder.path(), &["solve", "a.mtx", "--downdate", "all.mtx"]);
    assert_eq!(output.status.code(), Some(65), "{}", err(&output));
    assert!(err(&output).contains("a.mtx: subtracting row 0 "), "{}", err(&output));
}

#[test]
fn failures_to_solve_are_reported_by_their_cause_and_leave_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let tall = "%%MatrixMarket matrix coordinate real general\n3 2 3\n1 1 1\n2 2 1\n3 1 1\n";
    let wide = "%%MatrixMarket matrix coordinate real general\n2 3 3\n1 1 1\n2 2 1\n2 3 1\n";
    write(folder.path(), "floating.mtx", &grid(4, 0.0));
    write(folder.path(), "tall.mtx", tall);
    write(folder.path(), "wide.mtx", wide);
    write(folder.path(), "empty.mtx", "");
    write(folder.path(), "cut.mtx", "%%MatrixMarket matrix coordinate real general\n2 2 3\n1 1 1\n2 2 1\n");
    write(folder.path(), "nan.mtx", "%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 nan\n");
    write(folder.path(), "sum.mtx", "%%MatrixMarket matrix coordinate real general\n1 1 2\n1 1 1e308\n1 1 1e308\n");
    write(folder.path(), "huge.mtx", "%%MatrixMarket matrix coordinate real general\n99999999999 9 1\n1 1 1\n");
    write(folder.path(), "sides.mtx", "%%MatrixMarket matrix coordinate real general\n300 1000000 1\n1 1 1\n");
    let line = (1..=300).map(|i| format!("{i} {i} 1\n")).collect::<Vec<_>>().concat();
    write(folder.path(), "line.mtx", &format!("%%MatrixMarket matrix coordinate real general\n300 300 300\n{line}"));
    std::fs::write(folder.path().join("bytes.mtx"), b"%%MatrixMarket \xff").expect("a writable folder");
    write(folder.path(), "bad.mtx", "%%MatrixMarket matrix coordinate real general\n2 2 1\n1 9 1\n");
    let cases: [(&[&str], i32, &str); 16] = [
        (&["floating.mtx", "--method", "cholesky"], 65, "has no constraint; fix one of its unknowns"),
        (&["floating.mtx"], 65, "the component of 16 unknown(s) that contains unknown 0 has no constraint"),
        (&["empty.mtx"], 65, "empty.mtx: line 1: expected `%%MatrixMarket"),
        (&["cut.mtx"], 65, "cut.mtx: line 4: the file ends after 2 of 3 entries"),
        (&["nan.mtx"], 65, "nan.mtx: line 3: `nan` is not finite"),
        (&["sum.mtx"], 65, "sum.mtx: entry (0, 0) of the matrix is not finite"),
        (&["huge.mtx"], 65, "huge.mtx: line 2: 99999999999×9 is too large for 1 entries"),
        (&["bytes.mtx"], 65, "bytes.mtx: cannot be read"),
        (&["line.mtx", "sides.mtx"], 2, "sides.mtx: has 1000000 right-hand sides, 300000000 values"),
        (&["wide.mtx"], 2, "2 equations do not determine 3 unknowns"),
        (&["tall.mtx", "--method", "lu"], 2, "is 3×2, not square"),
        (&["tall.mtx", "floating.mtx"], 2, "floating.mtx: has 16 rows (expected 3)"),
        (&["tall.mtx", "--picture", "p.png"], 2, "--picture needs a symmetric matrix"),
        (&["bad.mtx"], 65, "bad.mtx: line 3: column `9` is out of range (expected 1 to 2)"),
        (&["none.mtx"], 65, "none.mtx: cannot be read"),
        (&["tall.mtx", "-o", "none/x.mtx"], 73, "none/x.mtx: cannot be written"),
    ];
    for (args, code, message) in cases {
        let args: Vec<&str> = ["solve"].iter().chain(args).copied().collect();
        let output = plumbline_in(folder.path(), &args);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {}", err(&output));
        assert!(err(&output).contains(message), "{args:?}: {}", err(&output));
        assert_eq!(out(&output), "");
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 12, "nothing but the inputs");
}
