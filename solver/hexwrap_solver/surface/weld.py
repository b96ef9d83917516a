"""Coincident vertices made one, where that closes a seam.

Only vertices on open edges are candidates: an interior vertex has all its neighbours already, and the fine
parts of strongly graded meshes stay as they are.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.geometry import linked
from hexwrap_solver.surface.topology import half_edges
from hexwrap_solver.surface.types import Triangles

#: Relative to the bounding diagonal.
TOLERANCE = 1e-6
#: This many neighbours of a vertex are considered; bounds memory where thousands stand within the tolerance.
NEIGHBOURS = 8
#: Edges shorter than this many units in the last place of the coordinates have no direction.
ULPS = 4


def weldings(mesh: Triangles, tolerance: float) -> list[Ints]:
    """Ways to weld, from the most to the least, no two the same.

    Each is (n,) the lowest vertex with which a vertex becomes one: within the tolerance; only where
    coordinates are equal; only along edges without length.
    """
    collapsed = _collapse(mesh)
    rim = _open_vertices(relabelled(mesh, collapsed))
    equal = _equal(mesh.vertices, rim)
    exact = merged(collapsed, *equal)
    if len(equal[0]):
        rim = _open_vertices(relabelled(mesh, exact))
    near = _undo_collapses(merged(exact, *_close(mesh.vertices, rim, tolerance)), exact, mesh.faces)
    ways = [near]
    for way in (exact, collapsed):
        if not np.array_equal(way, ways[-1]):
            ways.append(way)
    return ways


def relabelled(mesh: Triangles, label: Ints) -> Triangles:
    """The mesh itself where each vertex (n,) keeps its label."""
    if np.array_equal(label, np.arange(len(label))):
        return mesh
    return Triangles(mesh.vertices, label[mesh.faces])


def coincident(vertices: Floats, tolerance: float) -> Ints:
    """(n,) the lowest of the vertices that stand within the tolerance of each other, open or not."""
    every = np.arange(len(vertices), dtype=np.int64)
    return merged(every, *_close(vertices, every, tolerance))


def _collapse(mesh: Triangles) -> Ints:
    resolution = ULPS * np.finfo(float).eps * float(np.abs(mesh.vertices).max())
    none = (mesh.lengths <= resolution).ravel()
    start, end = half_edges(mesh.faces)
    return merged(np.arange(len(mesh.vertices), dtype=np.int64), start[none], end[none])


def merged(label: Ints, a: Ints, b: Ints) -> Ints:
    """Joins the classes of a[k] and b[k]; classes are named by their lowest vertex."""
    if len(a) == 0:
        return label
    n = len(label)
    _, group = linked(label[a], label[b], n)
    _, lowest = np.unique(group, return_index=True)
    return lowest[group][label]


def _open_vertices(mesh: Triangles) -> Ints:
    """Vertices on edges that have one face only, ascending."""
    start, end = half_edges(mesh.faces)
    order, first = mesh.edge_groups
    rim = order[first[:-1][np.diff(first) == 1]]
    mark = np.zeros(len(mesh.vertices), dtype=bool)
    mark[start[rim]] = mark[end[rim]] = True
    return np.flatnonzero(mark)


def _equal(vertices: Floats, among: Ints) -> tuple[Ints, Ints]:
    """Pairs of vertices with the same coordinates, each with the lowest of them."""
    points = vertices[among] + 0.0  # −0 becomes 0
    order = np.lexsort(points.T)
    same = np.all(points[order][1:] == points[order][:-1], axis=1)
    return among[order[1:][same]], among[order[:-1][same]]


def _close(vertices: Floats, among: Ints, tolerance: float) -> tuple[Ints, Ints]:
    """Pairs of different vertices within the tolerance."""
    if len(among) < 2:
        return among[:0], among[:0]
    distance, near = cKDTree(vertices[among]).query(
        vertices[among], k=min(NEIGHBOURS, len(among)), distance_upper_bound=tolerance
    )
    i, k = np.nonzero(np.isfinite(distance))
    a, b = among[i], among[np.asarray(near)[i, k]]
    return a[a < b], b[a < b]


def _undo_collapses(label: Ints, before: Ints, faces: Ints) -> Ints:
    """Takes back the classes in which two corners of one triangle that were apart have met."""
    if label is before:
        return label
    met = (label[faces] == label[faces[:, [1, 2, 0]]]) & (before[faces] != before[faces[:, [1, 2, 0]]])
    if not met.any():
        return label
    spoilt = np.zeros(len(label), dtype=bool)
    spoilt[label[faces[met]]] = True
    return np.where(spoilt[label], before, label)
