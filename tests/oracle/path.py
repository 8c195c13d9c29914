"""Independent reference for the optimal path: a sideways shake, solved as a least-squares problem under bounds.

    python tests/oracle/path.py

With displacements along x only, a window pinned at the source's scale and a border that may show, the program of
`src/video/path/optimal.rs` falls apart into one in x whose only constraints are |P_t| <= (1 - min_crop) * half width.
scipy.optimize.lsq_linear (BVLS) solves that exactly. Prints the constants that `tests/it/path.rs` compares with.
"""
import numpy as np
from scipy.optimize import lsq_linear

N, FPS, WIDTH, HEIGHT, MIN_CROP, SMOOTHNESS_S = 120, 30.0, 640, 360, 0.9, 0.5
ACCELERATION_SHARE, LEAST_SHAKE, SHAKE_SIGMA_S, STRENGTH_SIGMA_S = 0.4, 2e-4, 0.5, 4.0


def kernel(sigma):
    k = np.arange(-int(4 * sigma + 1), int(4 * sigma + 1) + 1)
    w = np.exp(-0.5 * (k / sigma) ** 2)
    return w / w.sum()


def filtered(x, sigma, **pad):
    w = kernel(sigma)
    return np.convolve(np.pad(x, len(w) // 2, **pad), w, "valid")


def second_difference(n):
    return np.diff(np.eye(n), 2, axis=0)


t = np.arange(N)
unit = np.hypot(WIDTH, HEIGHT) / 2
x = (45 * np.sin(0.21 * t) + 12 * np.sin(1.3 * t) + 2 * t) / unit
x -= x[0]
shake = (x - filtered(x, SHAKE_SIGMA_S * FPS, mode="reflect", reflect_type="odd")) ** 2
strength = filtered(shake, STRENGTH_SIGMA_S * FPS, mode="symmetric")
weight = 1 / np.maximum(strength, LEAST_SHAKE**2)

# The content moves by x; a window moved by P shows x - P. Unknowns: P, then L.
A2, O, I = second_difference(N), np.zeros((N - 2, N)), np.eye(N)
root = np.sqrt(weight)[:, None]
lam = (SMOOTHNESS_S * FPS) ** 4 / 4
mu = (ACCELERATION_SHARE * SMOOTHNESS_S * FPS) ** 4 / 4
M = np.vstack([root * np.hstack([I, -I]), np.sqrt(mu) * root[2:] * np.hstack([A2, O]), np.sqrt(lam) * root[2:] * np.hstack([O, A2])])
b = np.concatenate([np.zeros(N), np.sqrt(mu) * root[2:, 0] * (A2 @ x), np.sqrt(lam) * root[2:, 0] * (A2 @ x)])
limit = (1 - MIN_CROP) * WIDTH / 2 / unit
bounds = np.concatenate([np.full(N, limit), np.full(N, np.inf)])
P = lsq_linear(M, b, (-bounds, bounds), method="bvls", tol=1e-14, max_iter=2000).x[:N] * unit
print("touching the bound:", int((np.abs(np.abs(P) - limit * unit) < 1e-6).sum()), "of", N, "frames")
for k in (0, 10, 25, 40, 60, 77, 95, 119):
    print(f"({k}, {P[k]:.6f}),")
