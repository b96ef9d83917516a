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
from hexwrap_solver.surface.topology import half_edges, next_half_edge
from hexwrap_solver.surface.types import Surface


@dataclass(frozen=True)
class Cut:
    """path: (p,) vertices from loop 0 to loop 1. sheet: (m, 3) power of g per corner.
    twin: (3m,) half-edge on the other side of each (see ``surface.topology``), −1 at the boundary and across
    the cut."""

    path: Ints
    sheet: Ints
    twin: Ints


def cut_open(surface: Surface) -> Cut:
    """The cut along a shortest path of edges."""
    n, twin = len(surface.vertices), surface.twin.copy()
    start, end = half_edges(surface.faces)
    path = _shortest_path(surface)
    left = _left_of(path, start, end, n)
    twin[twin[left]] = -1
    twin[left] = -1
    return Cut(path, _sheets(start, path, twin, left, n), twin)


def _shortest_path(surface: Surface) -> Ints:
    """Fewest edges from any vertex of loop 0 to any of loop 1, through an extra vertex n tied to loop 0."""
    n, (begin, goal) = len(surface.vertices), surface.loops
    low, high = surface.edge_ends  # in the order of their lower ends, as rows of a matrix want them
    rows = np.concatenate([np.searchsorted(low, np.arange(n + 1)), [len(low) + len(begin)]])
    graph = sparse.csr_matrix(
        (np.ones(rows[-1], dtype=np.int8), np.concatenate([high, begin]), rows), shape=(n + 1, n + 1)
    )
    order, previous = breadth_first_order(graph, n, directed=False)
    rank = np.empty(n + 1, dtype=np.int64)
    rank[order] = np.arange(n + 1)
    path = [int(goal[np.argmin(rank[goal])])]
    while previous[path[-1]] != n:
        path.append(int(previous[path[-1]]))
    return np.array(path[::-1], dtype=np.int64)


def _left_of(path: Ints, start: Ints, end: Ints, n: int) -> Ints:
    """The half-edges that run along the path, in its direction: their faces are on its left."""
    following = np.full(n, -1, dtype=np.int64)
    following[path[:-1]] = path[1:]
    return np.flatnonzero(following[start] == end)


def _sheets(start: Ints, path: Ints, twin: Ints, left: Ints, n: int) -> Ints:
    """1 at the corners to the left of the cut, 0 elsewhere: corners at path vertices, joined around them
    across every edge but those of the cut, fall into a left and a right fan each."""
    on_path = np.zeros(n, dtype=bool)
    on_path[path] = True
    near = np.flatnonzero(on_path[start])  # corners, named by the half-edges that leave them
    place = np.full(len(start), -1, dtype=np.int64)
    place[near] = np.arange(len(near))
    crossed = near[twin[near] >= 0]
    other = next_half_edge(twin[crossed])
    graph = sparse.coo_matrix(
        (np.ones(len(crossed), dtype=np.int8), (place[crossed], place[other])), shape=(len(near), len(near))
    )
    fan = connected_components(graph, directed=False)[1]
    left_fans = np.zeros(len(near), dtype=bool)
    left_fans[fan[place[np.concatenate([left, next_half_edge(left)])]]] = True
    sheet = np.zeros(len(start), dtype=np.int64)
    sheet[near] = left_fans[fan]
    return sheet.reshape(-1, 3)
