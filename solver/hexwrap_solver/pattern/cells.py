"""Whole cells: closed walks along the edges of the pattern that always turn left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Ints
from hexwrap_solver.pattern.lattice import Lattice, Motion
from hexwrap_solver.pattern.links import Links


@dataclass(frozen=True)
class Cells:
    """corner: (c, p) nodes counter-clockwise; turns: (c, p) sheets of the corners, seen from the first one's
    own coordinates; direction: (c, p) of the edge that leaves each corner, in the corner's own coordinates;
    across: (c, p) neighbouring cell, −1 where there is none."""

    corner: Ints
    turns: Ints
    direction: Ints
    across: Ints


def whole_cells(lattice: Lattice, motion: Motion, links: Links) -> Cells:
    """Cells whose edges all run inside the domain and close up without going around it.

    Such a closed line bounds a disk of the universal cover, so that no boundary can hide inside a cell.
    """
    order, sides = lattice.order, lattice.sides
    n = len(links.head)
    half_edge = np.flatnonzero(links.head.ravel() >= 0)
    corner, turns, way = [half_edge // order], [np.zeros(len(half_edge), dtype=np.int64)], [half_edge % order]
    lowest = half_edge
    alive = np.ones(len(half_edge), dtype=bool)
    for k in range(sides):
        node, direction = corner[-1], way[-1]
        head, across = links.head[node, direction], links.turns[node, direction]
        alive &= head >= 0
        corner.append(head)
        turns.append(turns[-1] + across)
        way.append((direction - motion.rotation(across) + lattice.turn) % order)
        if k < sides - 1:
            lowest = np.minimum(lowest, head * order + way[-1])
    closed = alive & (corner[-1] == corner[0]) & (way[-1] == way[0]) & (turns[-1] == 0)
    chosen = closed & (lowest == half_edge)
    table = np.stack(corner[:-1], axis=1)[chosen], np.stack(turns[:-1], axis=1)[chosen]
    direction_of = np.stack(way[:-1], axis=1)[chosen]
    return Cells(*table, direction_of, _across(lattice, motion, links, table[0], direction_of, n))


def _across(lattice: Lattice, motion: Motion, links: Links, corner: Ints, way: Ints, n: int) -> Ints:
    order = lattice.order
    cell_of = np.full(n * order, -1, dtype=np.int64)
    cell_of[corner * order + way] = np.arange(len(corner))[:, None]
    back = (way - motion.rotation(links.turns[corner, way]) + order // 2) % order
    return np.asarray(cell_of[links.head[corner, way] * order + back])


def largest_part(cells: Cells) -> tuple[Cells, int]:
    """The largest edge-connected part, and how many cells were left out."""
    c = len(cells.corner)
    a, k = np.nonzero(cells.across >= 0)
    graph = coo_array((np.ones(len(a)), (a, cells.across[a, k])), shape=(c, c))
    parts, part = connected_components(graph, directed=False)
    if parts <= 1:
        return cells, 0
    keep = part == np.argmax(np.bincount(part))
    renumber = np.where(keep, np.cumsum(keep) - 1, -1)
    across = cells.across[keep]
    return Cells(
        cells.corner[keep],
        cells.turns[keep],
        cells.direction[keep],
        np.where(across >= 0, renumber[across], -1),
    ), int(c - keep.sum())
