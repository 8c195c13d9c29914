//! `plumbline solve`: a linear system from files, solved, judged and drawn.

mod picture;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use serde_json::{Value as Json, json};

use super::run_error::RunError;
use crate::report::{ReportFormat, document};
use crate::stages::files::{cannot, write_whole};
use crate::stages::photo::still_error;
use plumbline_image::still::{Photo, SaveOptions, StillFormat, encode, frame_of_rgb};
use plumbline_num::document::read_text;
use plumbline_num::files::{AtomicFile, IfExists};
use plumbline_num::run::Run;
use plumbline_num::sparse::{
    FactorStructure, GaussSeidel, GeneralMatrix, IncompleteCholesky, Method as Factorization, Ordering, Pattern,
    SparseBuilder, SparseError, Stop, Updated, backward_error, conjugate_gradients, read_matrix_market,
    write_matrix_market,
};

/// Largest file that is read, bytes: a matrix of some ten million entries.
const MAX_FILE: u64 = 1 << 30;

/// Most values of all right-hand sides together: a gibibyte.
const MAX_SIDES: usize = 1 << 27;

/// The orderings that are compared, by name, in the order of [`Order`].
pub const ORDERINGS: [(&str, Ordering); 4] = [
    ("natural", Ordering::Natural),
    ("rcm", Ordering::ReverseCuthillMcKee),
    ("amd", Ordering::Amd),
    ("nd", Ordering::GraphDissection),
];

/// The order in which the unknowns of a symmetric matrix are eliminated.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Order {
    /// As numbered in the file
    Natural,
    /// Reverse Cuthill-McKee: a narrow band
    Rcm,
    /// Approximate minimum degree
    Amd,
    /// Nested dissection of the graph
    Nd,
}

/// How a system is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Cholesky, LDLt, LU or QR: the least expensive that the matrix allows
    Auto,
    /// LLt in blocks of columns
    Cholesky,
    /// LLt column by column
    Simplicial,
    /// LDLt for symmetric indefinite matrices
    Ldlt,
    /// LU with partial pivoting
    Lu,
    /// QR, for least squares
    Qr,
    /// Conjugate gradients with incomplete Cholesky
    Cg,
    /// Gauss-Seidel sweeps: for matrices with a dominant diagonal
    GaussSeidel,
}

/// What to solve, how, and what to write.
#[derive(Clone, Debug, Args)]
pub struct SolveJob {
    /// The matrix, Matrix Market
    #[arg(value_name = "A.mtx")]
    pub matrix: PathBuf,
    /// Right-hand sides, Matrix Market; without them, those whose solution is 1 throughout
    #[arg(value_name = "B.mtx")]
    pub rhs: Option<PathBuf>,
    /// Elimination order of a symmetric matrix
    #[arg(long, value_enum, default_value = "amd")]
    pub ordering: Order,
    /// Solver
    #[arg(long, value_enum, default_value = "auto")]
    pub method: Method,
    /// Add UᵀU to a positive definite matrix, by low-rank updates of its factor
    #[arg(long, value_name = "U.mtx", conflicts_with = "method")]
    pub update: Option<PathBuf>,
    /// Subtract UᵀU from a positive definite matrix, by low-rank downdates of its factor
    #[arg(long, value_name = "U.mtx", conflicts_with = "method")]
    pub downdate: Option<PathBuf>,
    /// Write the solution, Matrix Market
    #[arg(short, long, value_name = "X.mtx")]
    pub output: Option<PathBuf>,
    /// Write a report: fill, operations, residual and condition
    #[arg(long, value_name = "FILE.html|FILE.json")]
    pub report: Option<PathBuf>,
    /// Draw matrix and factor in all four orders, side by side
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
    /// Replace existing files
    #[arg(short = 'y', visible_short_alias = 'f', long)]
    pub overwrite: bool,
}

impl SolveJob {
    fn if_exists(&self) -> IfExists {
        IfExists::overwrite(self.overwrite)
    }

    /// Refuses what writing would refuse after long work.
    fn check_targets(&self) -> Result<(), RunError> {
        for path in [&self.output, &self.report, &self.picture].into_iter().flatten() {
            AtomicFile::next_to(path, self.if_exists()).map(drop).map_err(|e| cannot(path, &e))?;
        }
        Ok(())
    }
}

/// Solves; returns the report for people.
///
/// # Errors
/// [`RunError::Input`] where a file is not a matrix or the system has no solution, [`RunError::Usage`] where files or methods
/// do not fit each other, [`RunError::Output`], [`RunError::Interrupted`] where `run` ends.
pub fn solve(job: &SolveJob, run: &Run) -> Result<String, RunError> {
    let format = job.report.as_ref().map(|path| ReportFormat::of(&path.to_string_lossy()));
    let format = format.transpose().map_err(RunError::Usage)?;
    job.check_targets()?;
    let unchanged = read(&job.matrix)?;
    let changes = changes(job, unchanged.columns())?;
    let a = if changes.is_empty() { unchanged.clone() } else { changed(&unchanged, &changes, job)? };
    let (b, given) = match &job.rhs {
        Some(path) => (dense(&read(path)?, &a, path)?, true),
        None => (a.multiply(&vec![1.0; a.columns()]), false),
    };
    let symmetric = a.rows() == a.columns() && a.first_asymmetry().is_none();
    let pattern = symmetric.then(|| a.symmetric_pattern()).transpose().map_err(|e| said(&job.matrix, &e))?;
    if job.picture.is_some() && pattern.is_none() {
        return Err(RunError::Usage("--picture needs a symmetric matrix: it shows Cholesky factors".to_owned()));
    }
    let structures = structures(pattern.as_ref()).map_err(|e| said(&job.matrix, &e))?;
    let began = Instant::now();
    let solved =
        if changes.is_empty() { solved(job, &a, &b, run) } else { updated(job, &unchanged, &changes, &b, run) };
    let solved = solved.map_err(|e| said(&job.matrix, &e))?;
    let seconds = began.elapsed().as_secs_f64();
    let report = report(job, &a, &b, given, &structures, &solved, seconds);
    if let Some(path) = &job.output {
        write_whole(path, write_matrix_market(a.columns(), &solved.x), job.if_exists())?;
    }
    if let Some((path, format)) = job.report.as_ref().zip(format) {
        write_whole(path, document(&job.matrix.display().to_string(), &report, format), job.if_exists())?;
    }
    if let Some(path) = &job.picture {
        draw(path, &structures, job.if_exists())?;
    }
    Ok(words(&report))
}

fn said(path: &Path, error: &SparseError) -> RunError {
    let text = format!("{}: {error}", path.display());
    match error {
        SparseError::Interrupted(stopped) => (*stopped).into(),
        SparseError::OutOfMemory { .. } => RunError::Temporary(text),
        SparseError::NotSquare { .. } | SparseError::NotSymmetric { .. } | SparseError::Underdetermined { .. } => {
            RunError::Usage(text)
        }
        _ => RunError::Input(text),
    }
}

fn read(path: &Path) -> Result<GeneralMatrix, RunError> {
    let cannot = |why: &dyn std::fmt::Display| RunError::Input(format!("{}: cannot be read: {why}", path.display()));
    let text = read_text(path, MAX_FILE).map_err(|e| cannot(&e))?;
    read_matrix_market(&text).map_err(|e| said(path, &e))
}

/// The right-hand sides, column by column.
fn dense(b: &GeneralMatrix, a: &GeneralMatrix, path: &Path) -> Result<Vec<f64>, RunError> {
    if b.rows() != a.rows() {
        let (given, expected) = (b.rows(), a.rows());
        return Err(RunError::Usage(format!("{}: has {given} rows (expected {expected})", path.display())));
    }
    let size = b.rows().saturating_mul(b.columns());
    if size > MAX_SIDES {
        let columns = b.columns();
        let text = format!("{}: has {columns} right-hand sides, {size} values (at most {MAX_SIDES})", path.display());
        return Err(RunError::Usage(text));
    }
    let mut values = vec![0.0; size];
    b.entries().for_each(|(i, j, v)| values[i + j * b.rows()] = v);
    Ok(values)
}

type Structures<'a> = Vec<(&'static str, FactorStructure<'a>)>;

fn structures(pattern: Option<&Pattern>) -> Result<Structures<'_>, SparseError> {
    let Some(pattern) = pattern else { return Ok(Vec::new()) };
    ORDERINGS.iter().map(|(name, ordering)| Ok((*name, FactorStructure::new(pattern, ordering)?))).collect()
}

/// A solution and what is known of it.
struct Solved {
    x: Vec<f64>,
    method: &'static str,
    condition: Option<f64>,
    /// Refinement steps, or iterations.
    steps: usize,
}

/// A row `u` and its sign: `± uᵀu` is added to the matrix.
type Change = (Vec<(usize, f64)>, f64);

/// Most entries that all changes together may add to the matrix: four gibibytes of them.
const MAX_CHANGED: usize = 1 << 28;

fn changes(job: &SolveJob, unknowns: usize) -> Result<Vec<Change>, RunError> {
    let mut changes = Vec::new();
    for (path, sign) in [(&job.update, 1.0), (&job.downdate, -1.0)] {
        let Some(path) = path else { continue };
        let u = read(path)?;
        if u.columns() != unknowns {
            let text = format!("{}: has {} columns (expected {unknowns})", path.display(), u.columns());
            return Err(RunError::Usage(text));
        }
        let mut rows = vec![Vec::new(); u.rows()];
        u.entries().for_each(|(i, j, v)| rows[i].push((j, v)));
        changes.extend(rows.into_iter().map(|row| (row, sign)));
    }
    let entries = changes.iter().fold(0_usize, |sum, (row, _)| sum.saturating_add(row.len().saturating_mul(row.len())));
    if entries > MAX_CHANGED {
        let text =
            format!("the changes add {entries} entries to the matrix (at most {MAX_CHANGED}): give sparser rows");
        return Err(RunError::Usage(text));
    }
    Ok(changes)
}

/// The matrix with its changes, to judge the solution by.
fn changed(a: &GeneralMatrix, changes: &[Change], job: &SolveJob) -> Result<GeneralMatrix, RunError> {
    let mut sum = SparseBuilder::new(a.rows(), a.columns());
    a.entries().for_each(|(i, j, v)| {
        sum.add_entry(i, j, v);
    });
    for (row, sign) in changes {
        for &(i, u) in row {
            for &(j, v) in row {
                sum.add_entry(i, j, sign * u * v);
            }
        }
    }
    sum.build().map_err(|e| said(&job.matrix, &e))
}

/// Factors the matrix as it is in the file and takes the changes in by low-rank updates.
fn updated(job: &SolveJob, a: &GeneralMatrix, changes: &[Change], b: &[f64], run: &Run) -> Result<Solved, SparseError> {
    let mut system = Updated::new(a.symmetric()?, ORDERINGS[job.ordering as usize].1.clone(), run)?;
    for (row, sign) in changes {
        system.add(row, *sign, run)?;
    }
    let mut x = b.to_vec();
    system.solve(&mut x);
    Ok(Solved { x, method: "low-rank update", condition: None, steps: changes.len() })
}

fn solved(job: &SolveJob, a: &GeneralMatrix, b: &[f64], run: &Run) -> Result<Solved, SparseError> {
    let ordering = &ORDERINGS[job.ordering as usize].1;
    let (m, n) = (a.rows(), a.columns());
    let method = match job.method {
        Method::Auto => Factorization::Auto,
        Method::Cholesky => Factorization::Cholesky,
        Method::Simplicial => Factorization::SimplicialCholesky,
        Method::Ldlt => Factorization::Ldlt,
        Method::Lu => Factorization::Lu,
        Method::Qr => Factorization::Qr,
        Method::Cg | Method::GaussSeidel => return iterated(job.method, a, b, run),
    };
    let mut factor = a.factor(method, ordering, run)?;
    let mut x = factor.solve(b)?;
    let mut steps = 0;
    if m == n && n > 0 {
        for (b, x) in b.chunks_exact(n).zip(x.chunks_exact_mut(n)) {
            steps = steps.max(factor.refine(a, b, x)?.steps);
        }
    }
    let name = match factor.method() {
        Factorization::Auto | Factorization::Cholesky => "cholesky",
        Factorization::SimplicialCholesky => "simplicial",
        Factorization::Ldlt => "ldlt",
        Factorization::Lu => "lu",
        Factorization::Qr => "qr",
    };
    Ok(Solved { x, method: name, condition: factor.condition(a), steps })
}

fn iterated(method: Method, a: &GeneralMatrix, b: &[f64], run: &Run) -> Result<Solved, SparseError> {
    let a = a.symmetric()?;
    let stop = Stop::default();
    let mut x = vec![0.0; b.len()];
    let mut steps = 0;
    let columns = b.chunks(a.n().max(1)).zip(x.chunks_mut(a.n().max(1)));
    let method = if method == Method::GaussSeidel {
        let relaxation = GaussSeidel::new(&a)?;
        for (b, x) in columns {
            steps = steps.max(relaxation.solve(b, x, &stop, run)?.iterations);
        }
        "gauss-seidel"
    } else {
        let mut preconditioner = IncompleteCholesky::new(&a)?;
        for (b, x) in columns {
            steps = steps.max(conjugate_gradients(&a, b, x, &mut preconditioner, &stop, run)?.iterations);
        }
        "cg"
    };
    Ok(Solved { x, method, condition: None, steps })
}

fn report(
    job: &SolveJob,
    a: &GeneralMatrix,
    b: &[f64],
    given: bool,
    structures: &Structures<'_>,
    solved: &Solved,
    seconds: f64,
) -> Json {
    let orderings: Vec<Json> = structures
        .iter()
        .map(|(name, s)| json!({"ordering": name, "nnz": s.nnz(), "fill": s.fill(), "flops": s.flops()}))
        .collect();
    let columns = b.chunks(a.rows().max(1)).zip(solved.x.chunks(a.columns().max(1)));
    let judged: Vec<Json> = columns.map(|(b, x)| judge(a, b, x, given)).collect();
    json!({
        "matrix": {"rows": a.rows(), "columns": a.columns(), "entries": a.nnz(), "symmetric": !structures.is_empty()},
        "ordering": ORDERINGS[job.ordering as usize].0,
        "method": solved.method,
        "orderings": orderings,
        "condition": solved.condition,
        "steps": solved.steps,
        "solutions": judged,
        "seconds": seconds,
    })
}

/// How good one solution is.
fn judge(a: &GeneralMatrix, b: &[f64], x: &[f64], given: bool) -> Json {
    let norm = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
    let r: Vec<f64> = a.multiply(x).iter().zip(b).map(|(y, b)| b - y).collect();
    let ratio = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { part };
    let mut judged = json!({"residual": ratio(norm(&r), norm(b))});
    if a.rows() == a.columns() {
        judged["backward_error"] = json!(backward_error(a, b, x));
    } else {
        let slope = norm(&a.multiply_transposed(&r));
        judged["slope"] = json!(ratio(slope, a.norm_1() * norm(b)));
    }
    if !given {
        judged["error"] = json!(x.iter().map(|x| (x - 1.0).abs()).fold(0.0, f64::max));
    }
    judged
}

/// Digits of a solution below which the report warns: rounding of the input to single precision would show.
const MIN_DIGITS: f64 = 6.0;

/// The report for people.
fn words(report: &Json) -> String {
    let matrix = &report["matrix"];
    let kind = if matrix["symmetric"] == true { "symmetric" } else { "not symmetric" };
    let mut text =
        format!("matrix     {}×{}, {} entries, {kind}\n", matrix["rows"], matrix["columns"], matrix["entries"]);
    for ordering in report["orderings"].as_array().into_iter().flatten() {
        let chosen = if ordering["ordering"] == report["ordering"] { "←" } else { "" };
        let number = |key: &str| ordering[key].as_f64().unwrap_or(0.0);
        let name = ordering["ordering"].as_str().unwrap_or_default();
        let (nnz, fill, flops) = (&ordering["nnz"], number("fill"), number("flops"));
        let line = format!("{name:<10} nnz(L) {nnz:>12}   fill {fill:>8.2}   flops {flops:>9.2e}   {chosen}");
        let _ = writeln!(text, "{}", line.trim_end());
    }
    let _ = writeln!(text, "method     {} ({} steps)", report["method"].as_str().unwrap_or_default(), report["steps"]);
    if let Some(condition) = report["condition"].as_f64() {
        let _ = writeln!(text, "condition  about {condition:.1e} (1-norm)");
        let digits = -(condition * f64::EPSILON).log10();
        if !(digits >= MIN_DIGITS) {
            let _ = writeln!(
                text,
                "warning    the condition leaves about {:.0} digits of the solution: scale the unknowns, or if the matrix is a product \
                 AᵀA, solve A itself with --method qr",
                digits.max(0.0)
            );
        }
    }
    for solution in report["solutions"].as_array().into_iter().flatten() {
        let parts = [("residual", ""), ("backward_error", "backward error "), ("slope", "slope "), ("error", "error ")];
        let parts: Vec<String> =
            parts.iter().filter_map(|(key, word)| Some(format!("{word}{:.1e}", solution[key].as_f64()?))).collect();
        let _ = writeln!(text, "residual   {}", parts.join(", "));
    }
    text
}

fn draw(path: &Path, structures: &Structures<'_>, if_exists: IfExists) -> Result<(), RunError> {
    let canvas = picture::draw(structures);
    let frame = frame_of_rgb(canvas.as_bytes(), canvas.width(), canvas.height()).map_err(|e| still_error(path, &e))?;
    let photo = Photo::new(frame);
    let mut bytes = std::io::Cursor::new(Vec::new());
    encode(&photo, StillFormat::Png, SaveOptions::default(), &mut bytes).map_err(|e| still_error(path, &e))?;
    write_whole(path, bytes.get_ref(), if_exists)
}
