"""Vectors, areas and orders that several stages need. Rows of arrays are vectors; the last axis is theirs."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from scipy.sparse import csr_array

from hexwrap_solver.arrays import Complexes, Floats, Ints

Summed = TypeVar("Summed", Ints, Floats, Complexes)


def dot(a: Floats, b: Floats) -> Floats:
    """(…,) products of vectors (…, d)."""
    return np.asarray(np.einsum("...d,...d->...", a, b))


def lengths(vectors: Floats) -> Floats:
    """(…,) of vectors (…, d)."""
    return np.asarray(np.sqrt(dot(vectors, vectors)))


def cross(a: Floats, b: Floats) -> Floats:
    """(n, 3) vector products of vectors (n, 3); NumPy's own, of any shapes, takes half as long again."""
    (x, y, z), (u, v, w) = a.T, b.T
    product = np.empty((len(a), 3))
    product[:, 0], product[:, 1], product[:, 2] = y * w - z * v, z * u - x * w, x * v - y * u
    return product


def normalize(vectors: Floats) -> Floats:
    """(…, d) vectors at length one, zero vectors kept."""
    length = lengths(vectors)[..., None]
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def angles_between(one: Floats, two: Floats) -> Floats:
    """(n,) angles between vectors (n, 3), 0 … π; small ones keep their digits, unlike those of arccos."""
    return np.asarray(np.arctan2(lengths(cross(one, two)), dot(one, two)))


def cross_2d(a: Floats, b: Floats) -> Floats:
    """(…,) of vectors (…, 2): positive where b lies to the left of a."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def quarter_turn(a: Floats) -> Floats:
    """(…, 2) vectors turned to the left by 90°."""
    return np.stack([-a[..., 1], a[..., 0]], axis=-1)


def plane_axes(normal: Floats) -> Floats:
    """(n, 2, 3) orthonormal, right-handed with the unit normals (n, 3)."""
    least = np.zeros_like(normal)
    least[np.arange(len(normal)), np.abs(normal).argmin(axis=1)] = 1.0
    x = normalize(cross(normal, least))
    return np.stack([x, cross(normal, x)], axis=1)


def face_normals(vertices: Floats, faces: Ints) -> Floats:
    """(m, 3) normals of triangles, their length twice the area."""
    at = [coordinate[np.ascontiguousarray(faces.T)] for coordinate in np.ascontiguousarray(vertices.T)]
    (ax, bx), (ay, by), (az, bz) = ((x[1] - x[0], x[2] - x[0]) for x in at)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]).T


def face_areas(vertices: Floats, faces: Ints) -> Floats:
    """(m,) areas of triangles."""
    normal = face_normals(vertices, faces)
    return np.asarray(np.sqrt(dot(normal, normal)) / 2)


def stable_order(key: Ints, n: int) -> Ints:
    """Stable argsort of integers 0 … n − 1 in linear time: NumPy counts short integers, and a sparse matrix
    is transposed by counting."""
    if n <= 2**16:
        return np.argsort(key.astype(np.uint16), kind="stable")
    k = len(key)
    matrix = csr_array((np.ones(k, dtype=np.int8), key, np.arange(k + 1)), shape=(k, n))
    return np.asarray(matrix.tocsc().indices, dtype=np.int64)


def sums_to_root(values: Summed, up: Ints, root: int) -> Summed:
    """Sums along the way to the root of a tree, by pointer jumping: log(depth) rounds, and rounding grows no
    faster. up: (n,) the node above each, root for the root itself."""
    total, up = values.copy(), up.copy()
    while (up != root).any():
        total += total[up]
        up = up[up]
    return total
