"""Independent reference for modes: the quadratic form of the ARAP energy written cell by cell in dense algebra.

    python tests/oracle/modes.py

Every cell's turn is eliminated by numpy's least squares, not by the closed form of `src/shape/surface/modal/hessian.rs`; the
eigenvalues are scipy's. Prints the constants that `src/shape/surface/modal/tests.rs` compares with, for the bar made there.
"""
import numpy as np
from scipy.linalg import eigh

CELLS = 12


def bar(n):
    rings = []
    for i in range(n + 1):
        x = 0.5 * i
        width = 0.5 * (1 + 0.3 * np.sin(1.3 * x))
        rings += [[x, y * width, z * width] for y, z in [(-1, -0.7), (1, -0.7), (1, 0.7), (-1, 0.7)]]
    triangles = [[0, 2, 1], [0, 3, 2]]
    for i in range(n):
        for k in range(4):
            a, b = 4 * i + k, 4 * i + (k + 1) % 4
            triangles += [[a, b, a + 4], [b, b + 4, a + 4]]
    end = 4 * n
    triangles += [[end, end + 1, end + 2], [end, end + 2, end + 3]]
    return np.array(rings), np.array(triangles)


def cross_matrix(e):
    return np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])


p, triangles = bar(CELLS)
n = len(p)
H, area = np.zeros((3 * n, 3 * n)), np.zeros(n)
for t in triangles:
    area[t] += np.linalg.norm(np.cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]])) / 6
for i in range(n):
    # Rows of residuals sqrt(w) (d_a - d_b - c x e): D d - C c. Cotangents may be negative: complex roots keep their sign.
    D, C = [], []
    for t in triangles[(triangles == i).any(axis=1)]:
        for k in range(3):
            o, a, b = t[k], t[(k + 1) % 3], t[(k + 2) % 3]
            u, v = p[a] - p[o], p[b] - p[o]
            w = 0.5 * u.dot(v) / np.linalg.norm(np.cross(u, v))
            row = np.zeros((3, 3 * n))
            row[:, 3 * a:3 * a + 3], row[:, 3 * b:3 * b + 3] = np.eye(3), -np.eye(3)
            D.append(np.emath.sqrt(w) * row)
            C.append(np.emath.sqrt(w) * -cross_matrix(p[a] - p[b]))
    D, C = np.vstack(D).astype(complex), np.vstack(C).astype(complex)
    left = D - C @ np.linalg.solve(C.T @ C, C.T @ D)
    H += (left.T @ left).real / 3
values = eigh(H, np.diag(np.repeat(area, 3)), eigvals_only=True)
assert abs(values[:6]).max() < 1e-10 * values[6], values[:8]
print("[" + ", ".join(f"{v:.11g}" for v in values[6:12]) + "]")
