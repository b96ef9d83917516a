"""Half-edges, boundary loops, components and normals of triangle meshes as plain arrays.

Half-edge h = 3·face + corner runs from that corner to the next one counter-clockwise.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, depth_first_order

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.geometry import face_normals, normalize, stable_order


def next_half_edge(h: Ints) -> Ints:
    """The half-edge that follows h inside its triangle."""
    return np.where(h % 3 == 2, h - 2, h + 1)


def half_edges(faces: Ints) -> tuple[Ints, Ints]:
    """(3m,) start and (3m,) end vertex of every half-edge."""
    return faces.ravel(), faces[:, [1, 2, 0]].ravel()


def edge_groups(faces: Ints, n: int) -> tuple[Ints, Ints]:
    """Half-edges sorted so that those of one undirected edge stand together.

    Returns order (3m,) and first (e + 1,): edge k has the half-edges ``order[first[k]:first[k + 1]]``,
    ascending.
    """
    start, end = half_edges(faces)
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = stable_order(high, n)
    order = order[stable_order(low[order], n)]
    low, high = low[order], high[order]
    new = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    return order, np.flatnonzero(np.concatenate([[True], new, [True]]))


def twins_of(order: Ints, first: Ints) -> Ints:
    """(3m,) the half-edge on the other side, −1 where the edge has not exactly two faces."""
    inner = first[:-1][np.diff(first) == 2]
    twin = np.full(len(order), -1, dtype=np.int64)
    twin[order[inner]] = order[inner + 1]
    twin[order[inner + 1]] = order[inner]
    return twin


def twins(faces: Ints, n: int) -> Ints:
    """(3m,) the half-edge on the other side of the same edge, −1 at the boundary."""
    return twins_of(*edge_groups(faces, n))


def edges(faces: Ints, n: int) -> tuple[Ints, Ints]:
    """(e, 2) edges with the lower vertex first, and (e, 2) their faces, −1 where there is only one."""
    start, end = half_edges(faces)
    order, first = edge_groups(faces, n)
    one = order[first[:-1]]
    two = np.where(np.diff(first) > 1, order[np.minimum(first[:-1] + 1, len(order) - 1)] // 3, -1)
    ends = np.stack([np.minimum(start[one], end[one]), np.maximum(start[one], end[one])], axis=1)
    return ends, np.stack([one // 3, two], axis=1)


def boundary_loops(faces: Ints, twin: Ints) -> list[Ints]:
    """Boundary loops as vertex indices in the direction of their half-edges (surface on the left).

    Each starts at its lowest vertex; loops are sorted by it. The faces must be oriented, and no vertex
    may be passed twice by the boundary.
    """
    h = np.flatnonzero(twin < 0)
    start, end = half_edges(faces)
    vertices = np.sort(start[h])
    k = len(vertices)
    following = np.zeros(k, dtype=np.int64)
    following[np.searchsorted(vertices, start[h])] = np.searchsorted(vertices, end[h])
    graph = csr_array((np.ones(k, dtype=np.int8), following, np.arange(k + 1)), shape=(k, k))
    _, label = connected_components(graph, directed=False)
    _, lowest = np.unique(label, return_index=True)
    loops = [depth_first_order(graph, seed, return_predecessors=False) for seed in np.sort(lowest)]
    return [vertices[loop] for loop in loops]


def face_graph(twin: Ints) -> csr_array:
    """(m, m) adjacency of faces across edges, stored entries in the order of half-edges."""
    m = len(twin) // 3
    inner = twin >= 0
    offsets = np.concatenate([[0], np.cumsum(inner)])[::3]
    return csr_array((np.ones(int(inner.sum()), dtype=np.int8), twin[inner] // 3, offsets), shape=(m, m))


def spanning_tree(twin: Ints, root: int = 0) -> tuple[Ints, Ints]:
    """Faces that can be reached from root across edges, breadth first, and (m,) the face before each
    one (negative at the root and where there is none)."""
    order, before = breadth_first_order(face_graph(twin), root)
    return np.asarray(order, dtype=np.int64), np.asarray(before, dtype=np.int64)


def vertex_normals(vertices: Floats, faces: Ints) -> Floats:
    """(n, 3) unit normals, area-weighted means of the faces around; zero where they cancel."""
    around = np.repeat(face_normals(vertices, faces).T, 3, axis=1)
    return normalize(sum_rows(around.T, faces.ravel(), len(vertices)))


def sum_rows(rows: Floats, where: Ints, n: int) -> Floats:
    """(n, d) sums of the rows (k, d) that go to each place (k,)."""
    return np.stack([np.bincount(where, x, n).astype(float) for x in rows.T], axis=1)


def edge_lengths(vertices: Floats, faces: Ints) -> Floats:
    """(m, 3) lengths of the half-edges, from coordinate differences: a far-away origin costs no digits beyond
    those the data has lost already."""
    square = np.zeros((3, len(faces)))
    corner = np.ascontiguousarray(faces.T)
    for coordinate in np.ascontiguousarray(vertices.T):
        at = coordinate[corner]
        for k in range(3):
            side = at[(k + 1) % 3] - at[k]
            square[k] += side * side
    return np.asarray(np.sqrt(square).T)
