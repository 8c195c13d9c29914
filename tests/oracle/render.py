"""Floating-point reference for the renderer: prints the table that `tests/it/render_oracle.rs` compares with.

A 12-bit image given by a formula is sampled through a backward homography with each kernel, by direct summation in
float64: no tables, no fixed point, no lattice. Usage: python tests/oracle/render.py
"""

import numpy as np

WIDTH, HEIGHT = 320, 200
BACK = np.array([[0.93, 0.021, 7.3], [-0.017, 0.94, 4.9], [1.1e-5, -1.6e-5, 1.0]])
POINTS = [(20, 20), (77, 31), (150, 100), (151, 100), (233, 57), (201, 144), (64, 171), (290, 180)]


def image():
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    return np.round(2048 + 900 * np.sin(0.35 * x + 0.2 * y) + 800 * np.cos(0.27 * y - 0.11 * x))


def four_tap(t, band=2 / 3 * np.pi):
    """Weights of the samples -1..2: least squares over the frequencies 0..band, solved with Lagrange multipliers."""
    omega = (np.arange(4000) + 0.5) * band / 4000
    j = np.arange(-1, 3)
    waves = np.exp(1j * np.outer(omega, j))
    gram, target = (waves.conj().T @ waves).real, (waves.conj().T @ np.exp(1j * omega * t)).real
    constraints = np.array([np.ones(4), j])
    system = np.block([[gram, constraints.T], [constraints, np.zeros((2, 2))]])
    return np.linalg.solve(system, np.r_[target, 1, t])[:4]


def bicubic(x):
    t = -x % 1.0
    j = int(round(x + t))
    return four_tap(t)[j + 1] if -1 <= j <= 2 else 0.0


def lanczos3(x):
    return np.sinc(x) * np.sinc(x / 3) if abs(x) < 3 else 0.0


def bilinear(x):
    return max(0.0, 1 - abs(x))


def sample(img, kernel, x, y):
    """Value at the position (x, y), pixel centers at integer + 0.5."""
    u, v = x - 0.5, y - 0.5
    i, j = int(np.floor(u)), int(np.floor(v))
    wx = np.array([kernel(k - u) for k in range(i - 2, i + 4)])
    wy = np.array([kernel(k - v) for k in range(j - 2, j + 4)])
    patch = img[j - 2 : j + 4, i - 2 : i + 4]
    return (wy / wy.sum()) @ patch @ (wx / wx.sum())


img = image()
for name, kernel in [("Bilinear", bilinear), ("Bicubic", bicubic), ("Lanczos3", lanczos3)]:
    row = []
    for px, py in POINTS:
        s = BACK @ [px + 0.5, py + 0.5, 1.0]
        row.append(f"{sample(img, kernel, s[0] / s[2], s[1] / s[2]):.2f}")
    print(f"(Interpolation::{name}, [{', '.join(row)}]),")
