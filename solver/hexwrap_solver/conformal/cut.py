"""A cut from loop 0 to loop 1 that opens the annulus into a disk, and the sheets it gives the corners.

The cut is a path of edges. Every vertex stands where the triangles to the *right* of the cut put it (seen
from loop 0 towards loop 1; loop 0 runs with the surface on its left, so it starts to the right of the cut
and comes back on its left). Corners on the left of the cut stand one turn further: sheet 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, connected_components

from hexwrap_solver.arrays import Ints


@dataclass(frozen=True)
class Cut:
    """path: (p,) vertices from loop 0 to loop 1. sheet: (m, 3) power of g per corner.
    twin: (m, 3) face across the edge opposite to each corner, −1 at the boundary and across the cut."""

    path: Ints
    sheet: Ints
    twin: Ints


def cut_open(faces: Ints, loops: tuple[Ints, Ints], n: int) -> Cut:
    """The cut along a shortest path of edges. faces: (m, 3) of an annulus with n vertices."""
    path = _shortest_path(faces, loops, n)
    twin, crossing, left = _twins(faces, path, n)
    return Cut(path, _sheets(faces, path, twin, crossing, left, n), twin)


def _shortest_path(faces: Ints, loops: tuple[Ints, Ints], n: int) -> Ints:
    """Fewest edges from any vertex of loop 0 to any of loop 1, through an extra vertex n tied to loop 0."""
    tail = np.concatenate([faces.ravel(), np.full(len(loops[0]), n)])
    head = np.concatenate([np.roll(faces, -1, axis=1).ravel(), loops[0]])
    # edges along or into the source loop are of no use, those leaving the goal loop neither
    graph = sparse.csr_matrix((np.ones(len(tail), dtype=np.int8), (tail, head)), shape=(n + 1, n + 1))
    order, previous = breadth_first_order(graph, n, directed=False)
    rank = np.full(n + 1, n + 1)
    rank[order] = np.arange(len(order))
    path = [int(loops[1][np.argmin(rank[loops[1]])])]
    while previous[path[-1]] != n:
        path.append(int(previous[path[-1]]))
    return np.array(path[::-1], dtype=np.int64)


def _twins(faces: Ints, path: Ints, n: int) -> tuple[Ints, Ints, Ints]:
    """twin (see Cut); positions in faces.ravel()-like order of the half-edges on the cut, and of those of
    them whose face is on its left."""
    tail = faces[:, [1, 2, 0]].ravel()
    head = faces[:, [2, 0, 1]].ravel()
    key = np.minimum(tail, head) * n + np.maximum(tail, head)
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    paired = np.flatnonzero(ordered[1:] == ordered[:-1])
    one, other = order[paired], order[paired + 1]
    twin = np.full(len(key), -1, dtype=np.int64)
    twin[one], twin[other] = other // 3, one // 3
    along = np.minimum(path[1:], path[:-1]) * n + np.maximum(path[1:], path[:-1])
    found = np.searchsorted(ordered, along)
    crossing = np.concatenate([order[found], order[found + 1]])
    twin[crossing] = -1
    following = np.full(n, -1, dtype=np.int64)
    following[path[:-1]] = path[1:]
    left = crossing[following[tail[crossing]] == head[crossing]]
    return twin.reshape(-1, 3), crossing, left


def _sheets(faces: Ints, path: Ints, twin: Ints, crossing: Ints, left: Ints, n: int) -> Ints:
    """1 at the corners to the left of the cut, 0 elsewhere: corners at path vertices, joined around them
    across every edge but those of the cut, fall into a left and a right fan each."""
    on_path = np.zeros(n, dtype=bool)
    on_path[path] = True
    flat = faces.ravel()
    near = np.flatnonzero(on_path[flat])
    place = np.full(len(flat), -1, dtype=np.int64)
    place[near] = np.arange(len(near))
    joints = []
    for step in (1, 2):  # the two edges at a corner are opposite to the other two corners
        face, k = near // 3, (near % 3 + step) % 3
        across = twin[face, k]
        inside = across >= 0
        same = faces[across[inside]] == flat[near[inside], None]
        joints.append((near[inside], 3 * across[inside] + same.argmax(axis=1)))
    start, end = (np.concatenate(parts) for parts in zip(*joints, strict=True))
    graph = sparse.coo_matrix(
        (np.ones(len(start), dtype=np.int8), (place[start], place[end])), shape=(len(near), len(near))
    )
    fan = connected_components(graph, directed=False)[1]
    touching = np.concatenate([3 * (left // 3) + (left % 3 + s) % 3 for s in (1, 2)])
    left_fans = np.unique(fan[place[touching]])
    sheet = np.zeros(len(flat), dtype=np.int64)
    sheet[near] = np.isin(fan, left_fans)
    return sheet.reshape(-1, 3)
