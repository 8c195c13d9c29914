//! `plumbline solve`: sparse linear systems from Matrix Market files.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::failure::Failure;
use super::print;
use crate::pipeline::Exit;
use crate::pipeline::solve::{Approach, Method as Factorization, SolveJob, solve};

/// Options of `plumbline solve`.
#[derive(Debug, Args)]
pub(super) struct SolveArgs {
    /// The matrix, Matrix Market
    #[arg(value_name = "A.mtx")]
    matrix: PathBuf,
    /// Right-hand sides, Matrix Market; without them, those whose solution is 1 throughout
    #[arg(value_name = "B.mtx")]
    rhs: Option<PathBuf>,
    /// Elimination order of a symmetric matrix
    #[arg(long, value_enum, default_value = "amd")]
    ordering: Order,
    /// Solver
    #[arg(long, value_enum, default_value = "auto")]
    method: Method,
    /// Add UᵀU to a positive definite matrix, by low-rank updates of its factor
    #[arg(long, value_name = "U.mtx", conflicts_with = "method")]
    update: Option<PathBuf>,
    /// Subtract UᵀU from a positive definite matrix, by low-rank downdates of its factor
    #[arg(long, value_name = "U.mtx", conflicts_with = "method")]
    downdate: Option<PathBuf>,
    /// Write the solution, Matrix Market
    #[arg(short, long, value_name = "X.mtx")]
    output: Option<PathBuf>,
    /// Write a report: fill, operations, residual and condition
    #[arg(long, value_name = "FILE.html|FILE.json")]
    report: Option<PathBuf>,
    /// Draw matrix and factor in all four orders, side by side
    #[arg(long, value_name = "FILE.png")]
    picture: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Order {
    /// As numbered in the file
    Natural,
    /// Reverse Cuthill-McKee: a narrow band
    Rcm,
    /// Approximate minimum degree
    Amd,
    /// Nested dissection of the graph
    Nd,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Method {
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

impl SolveArgs {
    pub(super) fn run(self) -> Result<Exit, Failure> {
        let approach = match self.method {
            Method::Auto => Approach::Direct(Factorization::Auto),
            Method::Cholesky => Approach::Direct(Factorization::Cholesky),
            Method::Simplicial => Approach::Direct(Factorization::SimplicialCholesky),
            Method::Ldlt => Approach::Direct(Factorization::Ldlt),
            Method::Lu => Approach::Direct(Factorization::Lu),
            Method::Qr => Approach::Direct(Factorization::Qr),
            Method::Cg => Approach::ConjugateGradients,
            Method::GaussSeidel => Approach::GaussSeidel,
        };
        let job = SolveJob {
            matrix: self.matrix,
            rhs: self.rhs,
            ordering: self.ordering as usize,
            approach,
            update: self.update,
            downdate: self.downdate,
            output: self.output,
            report: self.report,
            picture: self.picture,
        };
        print(&solve(&job)?);
        Ok(Exit::Done)
    }
}
