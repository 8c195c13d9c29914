//! Matrix Market files: matrices as text, as other programs of numerical linear algebra exchange them.
//!
//! Read strictly: the header, the number of entries, every index and every number must be right, and the first line that is
//! not is named. Memory stays in proportion to the file, whatever its size line claims.
//!
//! # Reference
//! R. F. Boisvert, R. Pozo, K. A. Remington, *The Matrix Market exchange formats*, NISTIR 5935, 1996.

use std::fmt::Write as _;

use super::{GeneralMatrix, SparseBuilder, SparseError};

/// Rows and columns that a file may have beyond its entries: empty ones, for which memory is needed all the same. A file of a hundred
/// bytes cannot ask for more than some megabytes.
const MAX_EMPTY: usize = 1 << 20;

#[derive(Clone, Copy, PartialEq)]
enum Symmetry {
    General,
    Symmetric,
    Skew,
}

struct Header {
    coordinate: bool,
    pattern: bool,
    integer: bool,
    symmetry: Symmetry,
}

/// Reads a matrix. Entries given twice are summed; those of `array` files that are zero are left out.
///
/// # Errors
/// [`SparseError::MatrixMarket`] names the line.
pub fn read_matrix_market(text: &str) -> Result<GeneralMatrix, SparseError> {
    let mut lines = text.lines().enumerate().map(|(k, line)| (k + 1, line));
    let (number, first) = lines.next().unwrap_or((1, ""));
    let header = Header::parse(first).map_err(|problem| SparseError::MatrixMarket { line: number, problem })?;
    let mut lines = lines.filter(|(_, line)| !line.trim_start().starts_with('%') && !line.trim().is_empty());
    let Some((at, size)) = lines.next() else {
        return Err(fault(number, "the size line is missing".to_owned()));
    };
    let body = Body { header, at, last: text.lines().count() };
    if body.header.coordinate { body.coordinate(size, lines) } else { body.array(size, lines) }
}

fn fault(line: usize, problem: String) -> SparseError {
    SparseError::MatrixMarket { line, problem }
}

impl Header {
    fn parse(line: &str) -> Result<Self, String> {
        let words: Vec<String> = line.split_whitespace().map(str::to_ascii_lowercase).collect();
        let [mark, object, format, field, symmetry] = &words[..] else {
            return Err("expected `%%MatrixMarket matrix coordinate|array real|integer|pattern \
                        general|symmetric|skew-symmetric`"
                .to_owned());
        };
        if mark != "%%matrixmarket" || object != "matrix" {
            return Err(format!("`{mark} {object}` is not `%%MatrixMarket matrix`"));
        }
        let coordinate = match format.as_str() {
            "coordinate" => true,
            "array" => false,
            other => return Err(format!("format `{other}` is unknown (expected coordinate or array)")),
        };
        if !matches!(field.as_str(), "real" | "integer" | "pattern") || (field == "pattern" && !coordinate) {
            return Err(format!("field `{field}` is not read (expected real or integer; pattern with coordinate)"));
        }
        let symmetry = match symmetry.as_str() {
            "general" => Symmetry::General,
            "symmetric" => Symmetry::Symmetric,
            "skew-symmetric" if field != "pattern" => Symmetry::Skew,
            other => {
                return Err(format!("symmetry `{other}` is not read (expected general, symmetric or skew-symmetric)"));
            }
        };
        Ok(Self { coordinate, pattern: field == "pattern", integer: field == "integer", symmetry })
    }

    fn value(&self, word: &str) -> Result<f64, String> {
        let value = if self.integer {
            word.parse::<i64>().map(|v| v as f64).map_err(|_| format!("`{word}` is not an integer"))?
        } else {
            word.parse::<f64>().map_err(|_| format!("`{word}` is not a number"))?
        };
        if value.is_finite() { Ok(value) } else { Err(format!("`{word}` is not finite")) }
    }
}

struct Body {
    header: Header,
    /// Line of the sizes.
    at: usize,
    /// Number of lines.
    last: usize,
}

impl Body {
    fn sizes<const N: usize>(&self, line: &str) -> Result<[usize; N], SparseError> {
        let numbers: Vec<usize> = line.split_whitespace().map_while(|w| w.parse().ok()).collect();
        let whole = numbers.len() == line.split_whitespace().count();
        let sizes = <[usize; N]>::try_from(numbers).ok().filter(|_| whole);
        sizes.ok_or_else(|| fault(self.at, format!("`{}` is not {N} sizes", line.trim())))
    }

    fn check(&self, rows: usize, columns: usize, entries: usize) -> Result<(), SparseError> {
        if self.header.symmetry != Symmetry::General && rows != columns {
            return Err(fault(self.at, format!("{rows}×{columns} is not square, as the symmetry demands")));
        }
        if rows.max(columns) > entries.saturating_add(MAX_EMPTY) {
            return Err(fault(self.at, format!("{rows}×{columns} is too large for {entries} entries")));
        }
        Ok(())
    }

    fn put(&self, builder: &mut SparseBuilder, (i, j): (usize, usize), value: f64) {
        builder.add_entry(i, j, value);
        match self.header.symmetry {
            Symmetry::Symmetric if i != j => drop(builder.add_entry(j, i, value)),
            Symmetry::Skew if i != j => drop(builder.add_entry(j, i, -value)),
            _ => {}
        }
    }

    fn coordinate<'a>(
        &self,
        size: &str,
        lines: impl Iterator<Item = (usize, &'a str)>,
    ) -> Result<GeneralMatrix, SparseError> {
        let [rows, columns, entries] = self.sizes(size)?;
        // Each entry takes a line.
        if entries > self.last {
            return Err(fault(self.at, format!("{entries} entries are announced, the file has {} lines", self.last)));
        }
        self.check(rows, columns, entries)?;
        let mut builder = SparseBuilder::new(rows, columns);
        let mut read = 0;
        for (number, line) in lines {
            read += 1;
            if read > entries {
                return Err(fault(number, format!("there are more than the {entries} entries announced")));
            }
            let (entry, value) = self.entry(line, rows, columns).map_err(|problem| fault(number, problem))?;
            self.put(&mut builder, entry, value);
        }
        if read < entries {
            return Err(fault(self.last, format!("the file ends after {read} of {entries} entries")));
        }
        builder.build()
    }

    fn entry(&self, line: &str, rows: usize, columns: usize) -> Result<((usize, usize), f64), String> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let expected = if self.header.pattern { 2 } else { 3 };
        if words.len() != expected {
            return Err(format!("an entry has {} words (expected {expected})", words.len()));
        }
        let index = |word: &str, size: usize, name: &str| {
            let index = word.parse::<usize>().ok().filter(|i| (1..=size).contains(i));
            index.map(|i| i - 1).ok_or_else(|| format!("{name} `{word}` is out of range (expected 1 to {size})"))
        };
        let (i, j) = (index(words[0], rows, "row")?, index(words[1], columns, "column")?);
        let value = if self.header.pattern { 1.0 } else { self.header.value(words[2])? };
        match self.header.symmetry {
            Symmetry::Symmetric | Symmetry::Skew if i < j => {
                Err(format!("entry ({}, {}) is above the diagonal of a symmetric matrix", i + 1, j + 1))
            }
            Symmetry::Skew if i == j => Err(format!("a skew-symmetric matrix has no entry ({}, {})", i + 1, j + 1)),
            _ => Ok(((i, j), value)),
        }
    }

    /// Column by column; of symmetric matrices the lower triangle, of skew-symmetric ones without the diagonal.
    fn array<'a>(
        &self,
        size: &str,
        mut lines: impl Iterator<Item = (usize, &'a str)>,
    ) -> Result<GeneralMatrix, SparseError> {
        let [rows, columns] = self.sizes(size)?;
        let first_row = |j: usize| match self.header.symmetry {
            Symmetry::General => 0,
            Symmetry::Symmetric => j,
            Symmetry::Skew => j + 1,
        };
        self.check(rows, columns, rows.saturating_mul(columns).min(self.last))?;
        let mut builder = SparseBuilder::new(rows, columns);
        for j in 0..columns {
            for i in first_row(j)..rows {
                let Some((number, line)) = lines.next() else {
                    return Err(fault(self.last, format!("the file ends before entry ({}, {})", i + 1, j + 1)));
                };
                let value = self.header.value(line.trim()).map_err(|problem| fault(number, problem))?;
                if value != 0.0 {
                    self.put(&mut builder, (i, j), value);
                }
            }
        }
        match lines.next() {
            Some((number, _)) => Err(fault(number, format!("there is more than the {rows}×{columns} entries"))),
            None => builder.build(),
        }
    }
}

/// Columns of `rows` values one after another, as a Matrix Market array; numbers read back exactly.
pub fn write_matrix_market(rows: usize, values: &[f64]) -> String {
    let columns = values.len().checked_div(rows).unwrap_or(0);
    let mut text = format!("%%MatrixMarket matrix array real general\n{rows} {columns}\n");
    for value in values {
        let _ = writeln!(text, "{value:e}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(text: &str) -> Vec<(usize, usize, f64)> {
        read_matrix_market(text).expect("a matrix").entries().collect()
    }

    #[test]
    fn every_kind_is_read() {
        let general =
            "%%MatrixMarket matrix coordinate real general\n% by hand\n\n2 3 3\n1 1 1.5\n2 3 -2e-1\n1 1 0.5\n";
        assert_eq!(entries(general), [(0, 0, 2.0), (1, 2, -0.2)]);
        let symmetric = "%%matrixmarket MATRIX Coordinate Integer Symmetric\n2 2 2\n1 1 4\n2 1 -3\n";
        assert_eq!(entries(symmetric), [(0, 0, 4.0), (1, 0, -3.0), (0, 1, -3.0)]);
        let skew = "%%MatrixMarket matrix coordinate real skew-symmetric\n2 2 1\n2 1 7\n";
        assert_eq!(entries(skew), [(1, 0, 7.0), (0, 1, -7.0)]);
        let pattern = "%%MatrixMarket matrix coordinate pattern general\n2 2 1\n2 1\n";
        assert_eq!(entries(pattern), [(1, 0, 1.0)]);
        let array = "%%MatrixMarket matrix array real general\n2 2\n1\n0\n3\n4\n";
        assert_eq!(entries(array), [(0, 0, 1.0), (0, 1, 3.0), (1, 1, 4.0)]);
        let triangle = "%%MatrixMarket matrix array real symmetric\n2 2\n1\n2\n4\n";
        assert_eq!(entries(triangle), [(0, 0, 1.0), (1, 0, 2.0), (0, 1, 2.0), (1, 1, 4.0)]);
        let skew = "%%MatrixMarket matrix array real skew-symmetric\n2 2\n2\n";
        assert_eq!(entries(skew), [(1, 0, 2.0), (0, 1, -2.0)]);
    }

    #[test]
    fn what_is_written_reads_back_exactly() {
        let values = [0.1, -1e-300, 1.0 / 3.0, 12345.678, 7.0, 1e22];
        let read = read_matrix_market(&write_matrix_market(3, &values)).expect("a matrix");
        assert_eq!((read.rows(), read.columns()), (3, 2));
        assert!(read.entries().map(|(_, _, v)| v).eq(values));
    }

    #[test]
    fn every_fault_names_its_line() {
        let coordinate = |rest: &str| format!("%%MatrixMarket matrix coordinate real general\n{rest}");
        let cases = [
            (String::new(), "line 1: expected `%%MatrixMarket matrix"),
            ("%%MatrixMarket matrix coordinate complex general\n1 1 0".into(), "line 1: field `complex` is not read"),
            ("%%MatrixMarket matrix coordinate real hermitian\n1 1 0".into(), "line 1: symmetry `hermitian`"),
            ("%%MatrixMarket vector coordinate real general\n".into(), "line 1: `%%matrixmarket vector` is not"),
            ("%%MatrixMarket matrix array pattern general\n1 1".into(), "line 1: field `pattern` is not read"),
            (coordinate("% only a comment\n"), "line 1: the size line is missing"),
            (coordinate("2 2\n"), "line 2: `2 2` is not 3 sizes"),
            (coordinate("2 2 x\n"), "line 2: `2 2 x` is not 3 sizes"),
            (coordinate("2 2 99\n1 1 1\n"), "line 2: 99 entries are announced, the file has 3 lines"),
            (coordinate("4000000000 2 1\n1 1 1\n"), "line 2: 4000000000×2 is too large for 1 entries"),
            (coordinate("2 2 2\n1 1 1\n"), "line 3: the file ends after 1 of 2 entries"),
            (coordinate("2 2 1\n1 1 1\n2 2 1\n"), "line 4: there are more than the 1 entries announced"),
            (coordinate("2 2 1\n3 1 1\n"), "line 3: row `3` is out of range (expected 1 to 2)"),
            (coordinate("2 2 1\n1 0 1\n"), "line 3: column `0` is out of range (expected 1 to 2)"),
            (coordinate("2 2 1\n1 1 nan\n"), "line 3: `nan` is not finite"),
            (coordinate("2 2 1\n1 1 1e999\n"), "line 3: `1e999` is not finite"),
            (coordinate("2 2 1\n1 1 one\n"), "line 3: `one` is not a number"),
            (coordinate("2 2 1\n1 1\n"), "line 3: an entry has 2 words (expected 3)"),
            (
                "%%MatrixMarket matrix coordinate real symmetric\n2 2 1\n1 2 1\n".into(),
                "line 3: entry (1, 2) is above the diagonal",
            ),
            ("%%MatrixMarket matrix coordinate real symmetric\n2 3 0\n".into(), "line 2: 2×3 is not square"),
            (
                "%%MatrixMarket matrix coordinate real skew-symmetric\n2 2 1\n1 1 1\n".into(),
                "line 3: a skew-symmetric matrix has no entry (1, 1)",
            ),
            (
                "%%MatrixMarket matrix coordinate integer general\n1 1 1\n1 1 1.5".into(),
                "line 3: `1.5` is not an integer",
            ),
            ("%%MatrixMarket matrix array real general\n2 1\n1\n".into(), "line 3: the file ends before entry (2, 1)"),
            ("%%MatrixMarket matrix array real general\n1 1\n1\n2\n".into(), "line 4: there is more than the 1×1"),
        ];
        for (text, expected) in cases {
            let error = read_matrix_market(&text).expect_err(expected).to_string();
            assert!(error.starts_with(expected), "{text:?}: {error}");
        }
    }
}
