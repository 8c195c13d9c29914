#!/usr/bin/env python3
"""`plumbline solve` against SciPy: solutions by every method, residuals, fill of an order, condition, refusals."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import numpy as np
    import scipy.io
    import scipy.sparse as sp
    import scipy.sparse.linalg as spla
    from scipy.sparse.csgraph import structural_rank
except ImportError as missing:
    print(f"sparse: {missing}")
    sys.exit(77)

PROGRAM = os.environ["PLUMBLINE_BIN"]


def grid(side, shift):
    """Laplacian of a grid with `shift` on its diagonal: eigenvalues are known in closed form."""
    line = sp.diags([-np.ones(side - 1), np.r_[1.0, 2 * np.ones(side - 2), 1.0], -np.ones(side - 1)], [-1, 0, 1])
    eye = sp.identity(side)
    return sp.kron(line, eye) + sp.kron(eye, line) + shift * sp.identity(side * side)


def run(folder, a, b, *options, symmetry=None):
    scipy.io.mmwrite(folder / "a.mtx", sp.coo_matrix(a), symmetry=symmetry or "general", precision=17)
    scipy.io.mmwrite(folder / "b.mtx", np.asarray(b).reshape(a.shape[0], -1), precision=17)
    command = [PROGRAM, "solve", "a.mtx", "b.mtx", "-o", "x.mtx", "--overwrite", "--report", "report.json", *options]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        return done.returncode, done.stderr, None
    return 0, scipy.io.mmread(folder / "x.mtx"), json.loads((folder / "report.json").read_text())


def check(name, holds, told=""):
    if not holds:
        sys.exit(f"sparse: {name} fails {told}")


def solutions(folder, rng):
    definite = grid(20, 0.3)
    n = definite.shape[0]
    wild = sp.random(n, n, 0.01, random_state=rng) + sp.diags(rng.uniform(2, 3, n))
    cases = [(definite, "symmetric", m) for m in ("auto", "cholesky", "simplicial", "ldlt", "lu", "qr", "cg")]
    cases += [(grid(20, -1.7), "symmetric", m) for m in ("auto", "lu")] + [(wild, "general", m) for m in ("auto", "lu", "qr")]
    for a, symmetry, method in cases:
        b = rng.normal(size=(n, 2))
        code, x, report = run(folder, a, b, "--method", method, symmetry=symmetry)
        check(f"{method} runs", code == 0, x)
        expected = spla.spsolve(sp.csc_matrix(a), b)
        miss = np.abs(x - expected).max() / np.abs(expected).max()
        check(f"{method}, {symmetry}", miss < (1e-7 if method == "cg" else 1e-10), miss)
        told = max(s["residual"] for s in report["solutions"])
        found = max(np.linalg.norm(b[:, k] - a @ x[:, k]) / np.linalg.norm(b[:, k]) for k in range(2))
        check(f"{method}: residual", abs(told - found) < 1e-12, (told, found))


def least_squares(folder, rng):
    a = sp.vstack([sp.random(90, 30, 0.1, random_state=rng), sp.identity(30)])
    b = rng.normal(size=120)
    code, x, report = run(folder, a, b)
    expected = np.linalg.lstsq(a.toarray(), b, rcond=None)[0]
    check("least squares", code == 0 and report["method"] == "qr" and np.abs(x[:, 0] - expected).max() < 1e-11)


def figures(folder, rng):
    a = grid(25, 1e-3)
    code, _, report = run(folder, a, rng.normal(size=a.shape[0]), symmetry="symmetric")
    exact = np.linalg.cond(a.toarray(), 1)
    check("condition", code == 0 and exact / 3 <= report["condition"] <= exact * (1 + 1e-6), (exact, report["condition"]))
    # SciPy's LU without pivoting in the natural order has the factor of Cholesky.
    lu = spla.splu(sp.csc_matrix(a), permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    natural = next(o for o in report["orderings"] if o["ordering"] == "natural")
    check("fill in the natural order", natural["nnz"] == lu.L.nnz, (natural["nnz"], lu.L.nnz))
    columns = np.diff(lu.L.tocsc().indptr).astype(float)
    check("flops", abs(natural["flops"] - (columns**2).sum()) < 0.5)
    best = {o["ordering"]: o["nnz"] for o in report["orderings"]}
    check("orders that dissect fill less", best["amd"] < natural["nnz"] and best["nd"] < natural["nnz"], best)


def refusals(folder, rng):
    floating = grid(6, 0.0)
    code, told, _ = run(folder, floating, rng.normal(size=36), "--method", "cholesky", symmetry="symmetric")
    check("a floating grid", code == 65 and "has no constraint" in told, told)
    rank = sp.csc_matrix(np.outer(np.arange(1, 6), np.ones(5)))
    check("an oracle that knows", structural_rank(rank) == 5)
    code, told, _ = run(folder, rank, np.ones(5), "--method", "lu")
    check("a matrix of rank 1", code == 65 and "singular to working precision" in told, told)
    code, told, _ = run(folder, sp.csc_matrix(np.triu(np.ones((3, 3)))), np.ones(3), "--method", "cholesky")
    check("a triangle as a symmetric matrix", code == 2 and "not symmetric" in told, told)


def main():
    rng = np.random.default_rng(5)
    with tempfile.TemporaryDirectory() as folder:
        for part in (solutions, least_squares, figures, refusals):
            part(Path(folder), rng)


if __name__ == "__main__":
    main()
