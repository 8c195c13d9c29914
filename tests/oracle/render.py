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


def cubic(x, a=-0.5):
    x = abs(x)
    if x < 1:
        return ((a + 2) * x - (a + 3)) * x * x + 1
    return (((x - 5) * x + 8) * x - 4) * a if x < 2 else 0.0


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
for name, kernel in [("Bilinear", bilinear), ("Bicubic", cubic), ("Lanczos3", lanczos3)]:
    row = []
    for px, py in POINTS:
        s = BACK @ [px + 0.5, py + 0.5, 1.0]
        row.append(f"{sample(img, kernel, s[0] / s[2], s[1] / s[2]):.2f}")
    print(f"(Interpolation::{name}, [{', '.join(row)}]),")
