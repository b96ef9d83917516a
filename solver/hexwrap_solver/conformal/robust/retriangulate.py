"""Better triangles inside the flat pieces of a refined mesh.

What was one triangle of the sent mesh stays flat however often its edges are split, so the edges inside it
may be flipped without changing the surface.
"""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.surface.topology import half_edges, next_half_edge, twins

#: Opposite angles that add up to less than this beyond π are left: rounding must not flip to and fro.
TOLERANCE = 1e-9
MAX_ROUNDS = 200


def flatten_out(vertices: Floats, faces: Ints, parent: Ints) -> Ints:
    """(m, 3) the faces with every edge between two of one parent Delaunay. parent: (m,)."""
    children = np.bincount(parent)
    some = np.flatnonzero(children[parent] > 1)
    used, local = np.unique(faces[some], return_inverse=True)
    points, part, owner = vertices[used], local.reshape(-1, 3), parent[some]
    for _ in range(MAX_ROUNDS):
        twin = twins(part, len(points))
        h = np.flatnonzero(np.arange(part.size) < twin)
        h = h[owner[h // 3] == owner[twin[h] // 3]]
        h = h[angle_sums_opposite(points, part, h, twin[h]) > np.pi + TOLERANCE]
        if not len(h):
            break
        h = h[_first_come(h // 3, twin[h] // 3, len(part))]
        _flip(part, h, twin[h])
    improved = faces.copy()
    improved[some] = used[part]
    return improved


def angle_sums_opposite(points: Floats, faces: Ints, one: Ints, other: Ints) -> Floats:
    """(k,) the two angles that edges are seen under from their faces, from both half-edges."""
    return np.asarray(_seen_under(points, faces, one) + _seen_under(points, faces, other))


def _seen_under(points: Floats, faces: Ints, h: Ints) -> Floats:
    tail, head = half_edges(faces)
    apex = points[faces.ravel()[next_half_edge(next_half_edge(h))]]
    a, b = points[tail[h]] - apex, points[head[h]] - apex
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("kd,kd->k", a, b)))


def _first_come(one: Ints, other: Ints, m: int) -> Bools:
    """Of pairs of faces, those no face of which an earlier pair claims."""
    rank = np.arange(len(one))
    first = np.full(m, len(one))
    np.minimum.at(first, np.concatenate([one, other]), np.tile(rank, 2))
    return np.asarray((first[one] == rank) & (first[other] == rank))


def _flip(faces: Ints, h: Ints, t: Ints) -> None:
    """Turns the edges of half-edges h (a → b, apex c) and t (b → a, apex d) into c – d, in place."""
    flat = faces.ravel()
    a, b = flat[h], flat[t]
    c, d = flat[next_half_edge(next_half_edge(h))], flat[next_half_edge(next_half_edge(t))]
    faces[h // 3] = np.stack([a, d, c], axis=1)
    faces[t // 3] = np.stack([d, b, c], axis=1)
