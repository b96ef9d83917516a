"""Vectors, areas and orders that several stages need. Rows of arrays are vectors; the last axis is theirs."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Complexes, Floats, Ints

Summed = TypeVar("Summed", Ints, Floats, Complexes)


def dot(a: Floats, b: Summed) -> Summed:
    """(…,) products of vectors (…, d)."""
    product = a * b  # sums over a short last axis are slow
    return np.asarray(sum((product[..., i] for i in range(1, product.shape[-1])), start=product[..., 0]))


def lengths(vectors: Floats) -> Floats:
    """(…,) of vectors (…, d)."""
    return np.asarray(np.sqrt(dot(vectors, vectors)))


def cross(a: Floats, b: Floats) -> Floats:
    """(n, 3) vector products of vectors (n, 3), in less than half the time of NumPy's own, of any shapes."""
    (x, y, z), (u, v, w) = np.ascontiguousarray(a.T), np.ascontiguousarray(b.T)
    product = np.empty((len(a), 3))
    np.subtract(y * w, z * v, out=product[:, 0])
    np.subtract(z * u, x * w, out=product[:, 1])
    np.subtract(x * v, y * u, out=product[:, 2])
    return product


def dot_first(a: Floats, b: Floats) -> Floats:
    """(…,) products of vectors (3, …), coordinates first: NumPy runs along the vectors then."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def cross_first(a: Floats, b: Floats) -> Floats:
    """(3, …) vector products of vectors (3, …), coordinates first."""
    (x, y, z), (u, v, w) = a, b
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u])


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


def weighted(values: Floats, which: Ints, weights: Floats) -> Floats:
    """(k, d) Σ weights · values[which], of values (n, d); which, weights: (k, c)."""
    k, c = which.shape
    table = csr_array((weights.ravel(), which.ravel(), np.arange(k + 1) * c), shape=(k, len(values)))
    return np.asarray(table @ values)


def quarter_turn(a: Floats) -> Floats:
    """(…, 2) vectors turned to the left by 90°."""
    return np.stack([-a[..., 1], a[..., 0]], axis=-1)


def plane_axes(normal: Floats) -> Floats:
    """(n, 2, 3) orthonormal, right-handed with the unit normals (n, 3)."""
    upright = np.ascontiguousarray(normal.T)
    least = np.zeros_like(upright)
    least[np.abs(upright).argmin(axis=0), np.arange(len(normal))] = 1.0
    x = cross_first(upright, least)
    length = np.sqrt(dot_first(x, x))
    x /= np.where(length > 0, length, 1.0)
    return np.ascontiguousarray(np.stack([x, cross_first(upright, x)]).transpose(2, 0, 1))


def face_normals(vertices: Floats, faces: Ints) -> Floats:
    """(m, 3) normals of triangles, their length twice the area."""
    at = [coordinate[np.ascontiguousarray(faces.T)] for coordinate in np.ascontiguousarray(vertices.T)]
    (ax, bx), (ay, by), (az, bz) = ((x[1] - x[0], x[2] - x[0]) for x in at)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]).T


def plane_areas(corners: Complexes) -> Floats:
    """(m,) areas of triangles (m, 3) in the plane, of either orientation."""
    p, q, r = corners.T
    return np.asarray(abs(((q - p).conj() * (r - p)).imag) / 2)


def outline_area(corner: Complexes) -> float:
    """Of a polygon (k,) in the plane, counted positive where it is counter-clockwise."""
    return float((corner.conj() * np.roll(corner, -1)).imag.sum()) / 2


def face_areas(vertices: Floats, faces: Ints) -> Floats:
    """(m,) areas of triangles."""
    normal = face_normals(vertices, faces)
    return np.asarray(np.sqrt(dot(normal, normal)) / 2)


def stable_order(key: Ints, n: int) -> Ints:
    """Stable argsort of integers 0 … n − 1, faster than NumPy's of long ones: it counts short ones; a key
    and its place in one integer are quick to sort; and a sparse matrix is transposed by counting."""
    k = len(key)
    if n <= 2**16:
        return np.argsort(key.astype(np.uint16), kind="stable")
    if n * k < 2**62:
        return np.sort(key * k + np.arange(k)) % k
    matrix = csr_array((np.ones(k, dtype=np.int8), key, np.arange(k + 1)), shape=(k, n))
    return np.asarray(matrix.tocsc().indices, dtype=np.int64)


def linked(one: Ints, other: Ints, n: int) -> tuple[int, Ints]:
    """How many parts n elements are in if the pairs (k,) belong together, and (n,) the number of each one's
    part, in the order of their lowest elements."""
    graph = csr_array((np.ones(len(one), dtype=np.int8), (one, other)), shape=(n, n))
    count, part = connected_components(graph, directed=False)
    return int(count), np.asarray(part, dtype=np.int64)


def pair_key(one: Ints, other: Ints, n: int) -> Ints:
    """(k,) one number for each pair of numbers below n, in either order."""
    return np.asarray(np.minimum(one, other) * n + np.maximum(one, other))


def orbits(following: Ints) -> tuple[Ints, int]:
    """(n,) number of the cycle or path of each element, in the order of their lowest elements, and how many
    there are. following: (n,) the next element, −1 at the end of a path; none follows two."""
    n = len(following)
    at, lowest = np.where(following >= 0, following, np.arange(n)), np.arange(n)
    ends = following < 0
    for _ in range(n.bit_length() + 1):  # lowest from each one to where it points, twice as far every time
        reached = lowest.take(at)
        open_ones = (reached != lowest) & ~ends.take(at)
        lowest = np.minimum(lowest, reached)
        if not open_ones.any():
            break
        at = at.take(at)
    on_path = np.flatnonzero(ends.take(at))
    of_path = np.full(n, n)
    np.minimum.at(of_path, at[on_path], lowest[on_path])
    lowest[on_path] = of_path[at[on_path]]
    first = lowest == np.arange(n)
    return (np.cumsum(first) - 1).take(lowest), int(np.count_nonzero(first))


def sums_to_root(values: Summed, up: Ints, root: int) -> Summed:
    """Sums along the way to the root of a tree, by pointer jumping: log(depth) rounds, and rounding grows no
    faster. up: (n,) the node above each, root for the root itself."""
    total, up = values.copy(), up.copy()
    while (up != root).any():
        total += total[up]
        up = up[up]
    return total
