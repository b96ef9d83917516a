"""Half-edges, boundary loops and normals of triangle meshes as plain arrays.

Half-edge h = 3·face + corner runs from that corner to the next one counter-clockwise.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, depth_first_order

from hexwrap_solver.arrays import Floats, Ints


def next_half_edge(h: Ints) -> Ints:
    """The half-edge that follows h inside its triangle."""
    return np.where(h % 3 == 2, h - 2, h + 1)


def half_edges(faces: Ints) -> tuple[Ints, Ints]:
    """(3m,) start and (3m,) end vertex of every half-edge."""
    return faces.ravel(), faces[:, [1, 2, 0]].ravel()


def edge_groups(faces: Ints, n: int) -> tuple[Ints, Ints]:
    """Half-edges sorted so that those of one undirected edge stand together.

    Returns order (3m,) and first (e + 1,): edge k has the half-edges ``order[first[k]:first[k + 1]]``.
    """
    start, end = half_edges(faces)
    key = np.minimum(start, end) * n + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    sorted_key = key[order]
    first = np.flatnonzero(np.concatenate([[True], sorted_key[1:] != sorted_key[:-1], [True]]))
    return order, first


def twins(faces: Ints, n: int) -> Ints:
    """(3m,) the half-edge on the other side of the same edge, −1 at the boundary.

    The mesh must have at most two faces per edge.
    """
    order, first = edge_groups(faces, n)
    inner = first[:-1][np.diff(first) == 2]
    twin = np.full(faces.size, -1, dtype=np.int64)
    twin[order[inner]] = order[inner + 1]
    twin[order[inner + 1]] = order[inner]
    return twin


def edges(faces: Ints, n: int) -> tuple[Ints, Ints]:
    """(e, 2) edges with the lower vertex first, and (e, 2) their faces, −1 where there is only one."""
    start, end = half_edges(faces)
    order, first = edge_groups(faces, n)
    one = order[first[:-1]]
    two = np.where(np.diff(first) > 1, order[np.minimum(first[:-1] + 1, len(order) - 1)], -3)
    ends = np.stack([np.minimum(start[one], end[one]), np.maximum(start[one], end[one])], axis=1)
    return ends, np.stack([one // 3, two // 3], axis=1)


def boundary_loops(faces: Ints, twin: Ints) -> list[Ints]:
    """Boundary loops as vertex indices in the direction of their half-edges (surface on the left).

    Each starts at its lowest vertex; loops are sorted by it. The faces must be oriented, and no vertex
    may be passed twice by the boundary.
    """
    h = np.flatnonzero(twin < 0)
    start, end = half_edges(faces)
    vertices = np.sort(start[h])
    tail, head = np.searchsorted(vertices, start[h]), np.searchsorted(vertices, end[h])
    k = len(vertices)
    following = np.zeros(k, dtype=np.int64)
    following[tail] = head
    graph = csr_array((np.ones(k, dtype=np.int8), following, np.arange(k + 1)), shape=(k, k))
    left = np.ones(k, dtype=bool)
    loops = []
    while left.any():
        loop = depth_first_order(graph, int(np.argmax(left)), return_predecessors=False)
        left[loop] = False
        loops.append(vertices[loop])
    return loops


def face_component(twin: Ints, seed: int = 0) -> Ints:
    """The faces that can be reached from one face across edges, breadth first."""
    m = len(twin) // 3
    inner = twin >= 0
    offsets = np.concatenate([[0], np.cumsum(inner)])[::3]
    graph = csr_array((np.ones(int(inner.sum()), dtype=np.int8), twin[inner] // 3, offsets), shape=(m, m))
    return np.asarray(breadth_first_order(graph, seed, return_predecessors=False), dtype=np.int64)


def face_areas_normals(vertices: Floats, faces: Ints) -> Floats:
    """(m, 3) normals of length twice the area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def vertex_normals(vertices: Floats, faces: Ints) -> Floats:
    """(n, 3) unit normals, area-weighted means of the faces around."""
    n = len(vertices)
    weighted = face_areas_normals(vertices, faces)
    total = np.stack([np.bincount(faces.ravel(), np.repeat(x, 3), n) for x in weighted.T], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.where(length > 0, length, 1.0)
