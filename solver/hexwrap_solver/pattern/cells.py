"""Whole cells: closed walks along the edges of the pattern that always turn left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Bools, Ints
from hexwrap_solver.pattern.lattice import Lattice, Motion
from hexwrap_solver.pattern.links import Links


@dataclass(frozen=True)
class Cells:
    """Side k of a cell runs from its corner k to corner k + 1, counter-clockwise.

    corner: (c, p) nodes. turns: (c, p) sheets of the corners' own coordinates, seen from the first one's.
    twin: (c, p) the same side in the neighbouring cell as p·cell + side, −1 where there is none.
    """

    corner: Ints
    turns: Ints
    twin: Ints

    def part(self, keep: Bools) -> Cells:
        """Some of the cells."""
        sides = self.corner.shape[1]
        renumber = np.where(keep, np.cumsum(keep) - 1, -1)
        twin = self.twin[keep]
        cell = renumber[twin // sides]
        return Cells(
            self.corner[keep],
            self.turns[keep],
            np.where((twin >= 0) & (cell >= 0), sides * cell + twin % sides, -1),
        )


def whole_cells(lattice: Lattice, motion: Motion, links: Links) -> Cells:
    """Cells whose edges all run inside the domain and close up without going around it.

    Such a closed line bounds a disk of the universal cover, so that no boundary can hide inside a cell.
    """
    order, sides = lattice.order, lattice.sides
    start = np.flatnonzero(links.head.ravel() >= 0)
    lowest = start
    node, way, turns = start // order, start % order, np.zeros(len(start), dtype=np.int64)
    alive = np.ones(len(start), dtype=bool)
    corner_of, way_of, turns_of = [], [], []
    for _ in range(sides):
        corner_of.append(node)
        way_of.append(way)
        turns_of.append(turns)
        lowest = np.minimum(lowest, node * order + way)
        across = links.turns[node, way]
        node = links.head[node, way]
        way = (way - motion.rotation(across) + lattice.turn) % order
        turns = turns + across
        alive &= node >= 0
    closed = alive & (node * order + way == start) & (turns == 0)
    chosen = closed & (lowest == start)
    corner = np.stack(corner_of, axis=1)[chosen]
    direction = np.stack(way_of, axis=1)[chosen]
    twin = _twins(lattice, motion, links, corner, direction)
    return Cells(corner, np.stack(turns_of, axis=1)[chosen], twin)


def _twins(lattice: Lattice, motion: Motion, links: Links, corner: Ints, direction: Ints) -> Ints:
    order = lattice.order
    side_of = np.full(links.head.size, -1, dtype=np.int64)
    side_of[corner * order + direction] = np.arange(corner.size).reshape(corner.shape)
    back = (direction - motion.rotation(links.turns[corner, direction]) + order // 2) % order
    return np.asarray(side_of[links.head[corner, direction] * order + back])


def largest_part(cells: Cells) -> tuple[Cells, int]:
    """The largest edge-connected part, and how many cells were left out."""
    c, sides = cells.corner.shape
    a, k = np.nonzero(cells.twin >= 0)
    graph = coo_array((np.ones(len(a)), (a, cells.twin[a, k] // sides)), shape=(c, c))
    parts, part = connected_components(graph, directed=False)
    if parts <= 1:
        return cells, 0
    keep = part == np.argmax(np.bincount(part))
    return cells.part(keep), int(c - keep.sum())


def manifold_corners(cells: Cells) -> tuple[Ints, Ints]:
    """(c, p) vertex of every corner, and (v,) its node.

    Cells that touch at a node, but at no edge there, get a vertex each, so that boundaries are simple loops.
    """
    c, sides = cells.corner.shape
    side = np.flatnonzero(cells.twin.ravel() >= 0)
    twin = cells.twin.ravel()[side]
    after = twin - twin % sides + (twin + 1) % sides
    graph = coo_array((np.ones(len(side)), (side, after)), shape=(c * sides, c * sides))
    n, vertex = connected_components(graph, directed=False)
    node = np.zeros(n, dtype=np.int64)
    node[vertex] = cells.corner.ravel()
    return vertex.astype(np.int64).reshape(c, sides), node
