"""Ring and place of every cell: rings count rows from loop 0, places run the same way round in each."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.conformal.types import ConformalMap
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


def rows_from(neighbours: Ragged, first: Bools) -> Ints:
    """(c,) number of steps from cell to cell across edges to the nearest of the first cells, −1: none."""
    row = np.where(first, 0, -1)
    frontier = np.flatnonzero(first)
    level = 0
    while len(frontier):
        level += 1
        starts, lengths = neighbours.offsets[frontier], neighbours.lengths[frontier]
        entry = np.repeat(starts - np.cumsum(lengths) + lengths, lengths) + np.arange(lengths.sum())
        reached = np.unique(neighbours.values[entry].astype(np.int64))
        frontier = reached[(reached >= 0) & (row[reached] < 0)]
        row[frontier] = level
    return row


def places(ring: Ints, turn: Floats) -> Ints:
    """(c,) rank of each cell in its ring by its turn in [0, 1)."""
    turn = np.mod(np.round(turn % 1.0, 12), 1.0)
    order = np.lexsort((turn, ring))
    counts = np.bincount(ring)
    place = np.zeros(len(ring), dtype=np.int64)
    place[order] = np.arange(len(ring)) - np.repeat(np.cumsum(counts) - counts, counts)
    return place
