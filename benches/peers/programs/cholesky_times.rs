//! Times of factoring and solving one matrix: `cholesky_times amd|nd A.bin` (the format of `benches/peers/cholesky.py`).
//!
//! Prints JSON: entries of the factor, CPU seconds of analysis, factorization and a solve for three right-hand sides, the least
//! of several runs each.

use std::error::Error;

use plumbline::num::run::Run;
use plumbline::num::sparse::{Cholesky, CompactFactor, Ordering, SparseMatrix};

pub(super) fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = super::args().collect();
    let [_, order, path] = &args[..] else { return Err("usage: cholesky_times amd|nd A.bin".into()) };
    let a = read(&std::fs::read(path)?)?;
    let ordering = if order == "nd" { Ordering::GraphDissection } else { Ordering::Amd };
    let began = cpu_seconds();
    let mut cholesky = Cholesky::analyze(a.pattern(), &ordering)?;
    let analyze = cpu_seconds() - began;
    let mut failed = None;
    let factor = least(|| failed = cholesky.factor(&a, &Run::default()).err());
    failed.map_or(Ok(()), Err)?;
    let mut compact = CompactFactor::new(&cholesky);
    let b: Vec<[f64; 3]> = (0..a.n()).map(|i| [0.0, 1.0, 2.0].map(|k| (i as f64 + k).sin())).collect();
    let mut x = b.clone();
    let solve = least(|| {
        x.copy_from_slice(&b);
        compact.solve_points(&mut x);
    });
    let nnz = cholesky.nnz();
    println!("{{\"nnz\": {nnz}, \"analyze\": {analyze}, \"factor\": {factor}, \"solve\": {solve}}}");
    Ok(())
}

/// Seconds of the quickest of at least three runs.
fn least(mut f: impl FnMut()) -> f64 {
    let (began, mut best, mut runs) = (cpu_seconds(), f64::INFINITY, 0);
    while runs < 3 || (cpu_seconds() - began < 0.4 && runs < 200) {
        let start = cpu_seconds();
        f();
        best = best.min(cpu_seconds() - start);
        runs += 1;
    }
    best
}

/// CPU time of the process.
#[expect(unsafe_code, reason = "the standard library has no clock of CPU time")]
fn cpu_seconds() -> f64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `t` is a valid place for the one value that the call writes.
    unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &raw mut t) };
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

fn read(bytes: &[u8]) -> Result<SparseMatrix, Box<dyn Error>> {
    let (head, rest) = bytes.split_at_checked(16).ok_or("the file ends early")?;
    let size = |k: usize| u64::from_le_bytes(std::array::from_fn(|b| head[8 * k + b])) as usize;
    let (n, m) = (size(0), size(1));
    if rest.len() < 16 * m {
        return Err("the file ends early".into());
    }
    let index = |k: usize| u32::from_le_bytes(std::array::from_fn(|b| rest[4 * k + b])) as usize;
    let value = |k: usize| f64::from_le_bytes(std::array::from_fn(|b| rest[8 * (m + k) + b]));
    let triplets: Vec<_> = (0..m).map(|k| (index(k), index(m + k), value(k))).collect();
    Ok(SparseMatrix::from_triplets(n, &triplets)?)
}
