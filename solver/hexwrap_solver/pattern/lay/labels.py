"""Ring and place of every cell: rings count rows from loop 0, places run the same way round in each."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged, runs
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.geometry import sums_to_root
from hexwrap_solver.pattern.lay.cells import graph_of
from hexwrap_solver.pattern.lay.layout import Layout


def turns_around(cmap: ConformalMap) -> Floats:
    """(n,) how many turns around the surface each vertex stands, in its own sheet.

    On a cylinder along the translation, else by the angle about the apex (or about the middle of the
    vertices where a flat ring has none), carried from vertex to vertex.
    """
    deck = cmap.deck
    if cmap.kind == "cylinder":
        return np.asarray((cmap.uv * np.conj(deck.translation)).real / abs(deck.translation) ** 2)
    apex = deck.apex
    if apex is None:
        apex = complex(cmap.uv[cmap.surface.loops[0]].mean() + cmap.uv[cmap.surface.loops[1]].mean()) / 2
    faces, sheet = cmap.surface.faces, cmap.sheet
    place = cmap.corners() - apex
    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    swept = np.angle(np.roll(place, -1, axis=1) / place) - deck.angle * (np.roll(sheet, -1, axis=1) - sheet)
    n = len(cmap.uv)
    # Each directed edge once: its position in a sparse matrix leads back to what was swept along it.
    step = coo_array((np.arange(1, len(tail) + 1), (tail, head)), shape=(n, n)).tocsr()
    _, before = breadth_first_order(step, 0, directed=False)
    before[0] = 0
    forward = np.asarray(step[before, np.arange(n)]).ravel() - 1
    backward = np.asarray(step[np.arange(n), before]).ravel() - 1
    flat = swept.ravel()
    angle = np.where(forward >= 0, flat[forward], np.where(backward >= 0, -flat[backward], 0.0))
    while (before != 0).any():
        angle = angle + angle[before]
        before = before[before]
    return np.asarray((angle + np.angle(cmap.uv[0] - apex)) / deck.angle)


def winding(cmap: ConformalMap, layout: Layout) -> int:
    """+1 or −1: the sheets gained by following loop 0 once."""
    face, edge = np.nonzero(layout.across < 0)
    tail = cmap.surface.faces[face, edge]
    gained = cmap.sheet[face, (edge + 1) % 3] - cmap.sheet[face, edge]
    return int(gained[np.isin(tail, cmap.surface.loops[0])].sum())


def first_on_net(cmap: ConformalMap, centers: Floats, neighbours: Ragged) -> Bools:
    """(c,) where rows begin on a net: cells at the boundary nearest to loop 0 of the surface, or, where there
    is none, the lowest cell. centers: (c, 3)."""
    first = np.zeros(len(centers), dtype=bool)
    at_edge = np.unique(neighbours.row[neighbours.values < 0])
    if not cmap.surface.loops or not len(at_edge):
        x, y, z = np.round(centers, 9).T
        first[np.lexsort((x, y, z))[0]] = True
        return first
    _, part = connected_components(_touching(neighbours, at_edge), directed=False)
    near, _ = cKDTree(cmap.surface.vertices[cmap.surface.loops[0]]).query(centers[at_edge])
    distance = np.bincount(part, weights=near) / np.bincount(part)
    first[at_edge[part == np.argmin(np.round(distance, 9))]] = True
    return first


def _touching(neighbours: Ragged, members: Ints) -> csr_array:
    """Graph of some of the cells, joined across edges, directly or through one other cell."""
    n = neighbours.n_rows
    inner = neighbours.values >= 0
    pairs = (neighbours.row[inner], neighbours.values[inner].astype(np.int64))
    rows = csr_array((np.ones(len(pairs[0])), pairs), shape=(n, n))[members]
    return rows @ rows.T + rows[:, members]


def azimuth(cmap: ConformalMap, centers: Floats) -> Floats:
    """(c,) turns of cells about the axis of loop 0, of a closed surface about the vertical, in [0, 1)."""
    points = cmap.surface.vertices
    axis, middle = np.array([0.0, 0.0, 1.0]), points.mean(axis=0)
    if cmap.surface.loops:
        rim = points[cmap.surface.loops[0]]
        middle = rim.mean(axis=0)
        area = np.cross(rim - middle, np.roll(rim, -1, axis=0) - middle).sum(axis=0)
        length = float(np.linalg.norm(area))
        axis = area / length if length > 0 else axis
    across = np.eye(3)[np.argmin(abs(axis))]
    east = np.cross(axis, across)
    east /= np.linalg.norm(east)
    north = np.cross(axis, east)
    away = centers - middle
    return np.asarray(np.arctan2(away @ north, away @ east) / (2 * np.pi) % 1.0)


def rows_from(neighbours: Ragged, first: Bools) -> Ints:
    """(c,) number of steps from cell to cell across edges to the nearest of the first cells, −1: none."""
    n, begin = len(first), np.flatnonzero(first)
    graph = graph_of(neighbours)
    # From one more cell, a step before the first ones.
    indices, offsets = np.append(graph.indices, begin), np.append(graph.indptr, graph.nnz + len(begin))
    before = csr_array((np.ones(len(indices)), indices, offsets), shape=(n + 1, n + 1))
    up = breadth_first_order(before, n)[1].astype(np.int64)
    up[up < 0] = n  # not reached
    steps = np.append(up[:-1] < n, False).astype(np.int64)
    steps[begin] = 1
    return sums_to_root(steps, up, n)[:-1] - 1


def places(ring: Ints, turn: Floats) -> Ints:
    """(c,) rank of each cell in its ring by its turn in [0, 1)."""
    turn = np.mod(np.round(turn % 1.0, 12), 1.0)
    order = np.lexsort((turn, ring))
    place = np.zeros(len(ring), dtype=np.int64)
    place[order] = runs(np.bincount(ring))[1]
    return place
