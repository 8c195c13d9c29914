"""The best that one 2D mesh per frame can do: the second baseline of `ideal.py`.

A grid of cells over the source frame; the vertices are complex numbers, x + iy. To where the homography takes the frame, each
vertex adds a displacement d, the one of least

    sum over sightings |B d - (target - H(source))|^2 + w * sum over cell corners |d_c - d_a - k (d_b - d_a)|^2,

B bilinear in the cell of the sighting, and a, b, c a corner of a cell and its two neighbors, c - a = k (b - a) in the grid: the
second sum is the similarity term of content-preserving warps (Liu, Gleicher, Jin, Agarwala 2009), zero where the displacements
are a similarity. Which w is best is not known beforehand; the caller tries each of WEIGHTS and keeps the one whose picture is
nearest to the ideal, so that no choice of the weight would do better.
"""

from functools import cache

import cv2
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

CELLS = 64, 36
WEIGHTS = tuple(10.0**e for e in range(-4, 2))
STEPS = 6


@cache
def similarity_term(width, height):
    """One complex row per corner of each cell: how far it is from keeping its right angle and the lengths of its arms."""
    across, down = CELLS
    vertex = np.arange((across + 1) * (down + 1)).reshape(down + 1, across + 1)
    corners = [vertex[:-1, :-1], vertex[:-1, 1:], vertex[1:, 1:], vertex[1:, :-1]]
    step = [width / across, 1j * height / down, -width / across, -1j * height / down]
    blocks = []
    for n in range(4):
        a, b, c = (corners[m % 4].ravel() for m in (n, n + 1, n + 3))
        k = -step[n - 1] / step[n]
        row = np.arange(a.size)
        data = np.repeat([k - 1, -k, 1], a.size)
        blocks.append(sp.csr_matrix((data, (np.tile(row, 3), np.concatenate([a, b, c]))), (a.size, vertex.size)))
    return sp.vstack(blocks).tocsr()


def bilinear(points, width, height):
    """One real row per point: its weights of the four vertices of its cell."""
    across, down = CELLS
    x, y = points[:, 0] * across / (width - 1), points[:, 1] * down / (height - 1)
    i, j = np.clip(x.astype(int), 0, across - 1), np.clip(y.astype(int), 0, down - 1)
    u, v = x - i, y - j
    first, row = j * (across + 1) + i, np.arange(len(points))
    data = np.concatenate([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v])
    columns = np.concatenate([first, first + 1, first + across + 1, first + across + 2])
    return sp.csr_matrix((data, (np.tile(row, 4), columns)), (len(points), (across + 1) * (down + 1)))


@cache
def at_pixels(width, height):
    y, x = np.mgrid[:height, :width]
    return bilinear(np.stack([x.ravel(), y.ravel()], axis=1), width, height)


def displacements(source, target, homography, weight, width, height):
    """The field d of the mesh at every pixel of the source frame, rows of (dx, dy)."""
    b, s = bilinear(source, width, height), similarity_term(width - 1, height - 1)
    miss = target - cv2.perspectiveTransform(source[:, None], homography)[:, 0]
    normal = (b.T @ b + weight * (s.conj().T @ s)).tocsc()
    d = splu(normal).solve(b.T @ (miss @ [1, 1j]))
    field = at_pixels(width, height) @ d
    return np.stack([field.real, field.imag], axis=1).reshape(height, width, 2).astype(np.float32)


def drawn(frame, homography, field):
    """`frame` under x -> H(x) + d(x). At a pixel y of the result, x = H^-1(y - d(x)) is iterated from d = 0."""
    height, width = frame.shape[:2]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    result, back = np.stack([x, y], axis=2), np.linalg.inv(homography)
    d = np.zeros_like(result)
    for _ in range(STEPS):
        source = cv2.perspectiveTransform(result - d, back)
        d = cv2.remap(field, source, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    source = cv2.perspectiveTransform(result - d, back)
    return cv2.remap(frame, source, None, cv2.INTER_CUBIC)


def candidates(frame, source, target, homography):
    """The frame through the mesh of each of WEIGHTS."""
    height, width = frame.shape[:2]
    for weight in WEIGHTS:
        yield weight, drawn(frame, homography, displacements(source, target, homography, weight, width, height))
