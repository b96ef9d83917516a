"""Cells: closed walks along the edges of the pattern that always turn left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Bools, Ints, Ragged
from hexwrap_solver.pattern.lattice import Lattice, Motion
from hexwrap_solver.pattern.lay.edges import Links


@dataclass(frozen=True)
class Cells:
    """Sides are numbered through all cells; side k runs from the corner k to the next one of its cell.

    corner: points per cell, counter-clockwise. turns: (sides,) sheets of the corners' own coordinates, seen
    from the cell's first one. twin: (sides,) the same side of the neighbouring cell, −1 where there is none.
    """

    corner: Ragged
    turns: Ints
    twin: Ints

    @property
    def n(self) -> int:
        return self.corner.n_rows

    def neighbours(self) -> Ragged:
        """The cell across each side, −1 where there is none."""
        across = np.where(self.twin >= 0, self.corner.row[self.twin], -1)
        return Ragged(across, self.corner.offsets)

    def part(self, keep: Bools) -> Cells:
        """Some of the cells."""
        side = np.repeat(keep, self.corner.lengths)
        renumber = np.where(side, np.cumsum(side) - 1, -1)
        twin = self.twin[side]
        offsets = np.concatenate([[0], np.cumsum(self.corner.lengths[keep])])
        return Cells(
            Ragged(self.corner.values[side], offsets),
            self.turns[side],
            np.where(twin >= 0, renumber[twin], -1),
        )


def whole_cells(lattice: Lattice, motion: Motion, links: Links) -> tuple[Ints, Ints, Ints]:
    """(c, p) corners, sheets and directions of the cells whose edges all run inside the domain.

    Each closes up without going around the surface. Such a closed line bounds a disk of the universal
    cover, so that no boundary can hide inside a cell.
    """
    order = lattice.order
    start = np.flatnonzero(links.head.ravel() >= 0)
    node, way, turns = start // order, start % order, np.zeros(len(start), dtype=np.int64)
    corner_of, way_of, turns_of = [], [], []
    for _ in range(lattice.sides):
        corner_of.append(node)
        way_of.append(way)
        turns_of.append(turns)
        across = links.turns[node, way]
        node = links.head[node, way]
        way = (way - motion.rotation(across) + lattice.turn) % order
        turns = turns + across
        # Each cell once, from its lowest side on; a walk that comes to a lower one is another's, or none.
        going = (node >= 0) & (node * order + way >= start)
        start, node, way, turns = start[going], node[going], way[going], turns[going]
        for past in (corner_of, way_of, turns_of):
            past[:] = [x[going] for x in past]
    closed = (node * order + way == start) & (turns == 0)
    corner, sheet, direction = (np.stack(x, axis=1)[closed] for x in (corner_of, turns_of, way_of))
    return corner, sheet, direction


def link_twins(lattice: Lattice, motion: Motion, links: Links, corner: Ints, direction: Ints) -> Ints:
    """(c·p,) the side that runs the other way along the same link."""
    order = lattice.order
    side_of = np.full(links.head.size, -1, dtype=np.int64)
    side_of[corner * order + direction] = np.arange(corner.size).reshape(corner.shape)
    return np.asarray(side_of[reverse_links(lattice, motion, links, corner, direction)].ravel())


def reverse_links(lattice: Lattice, motion: Motion, links: Links, tail: Ints, direction: Ints) -> Ints:
    """Number order·node + direction of the link back."""
    order = lattice.order
    back = (direction - motion.rotation(links.turns[tail, direction]) + order // 2) % order
    return np.asarray(links.head[tail, direction] * order + back)


def only_whole_cells(lattice: Lattice, motion: Motion, links: Links) -> Cells:
    corner, turns, direction = whole_cells(lattice, motion, links)
    twin = link_twins(lattice, motion, links, corner, direction)
    return Cells(Ragged.from_table(corner), turns.ravel(), twin)


def largest_part(cells: Cells) -> Bools:
    """(c,) the largest edge-connected part."""
    row = cells.corner.row
    side = np.flatnonzero(cells.twin >= 0)
    graph = coo_array((np.ones(len(side)), (row[side], row[cells.twin[side]])), shape=(cells.n, cells.n))
    parts, part = connected_components(graph, directed=False)
    if parts <= 1:
        return np.ones(cells.n, dtype=bool)
    return np.asarray(part == np.argmax(np.bincount(part)))


def manifold_corners(cells: Cells) -> tuple[Ints, Ints]:
    """(sides,) vertex of every corner, and (v,) the point at which it stands.

    Cells that touch at a point, but at no edge there, get a vertex each, so that boundaries are simple loops.
    """
    size = len(cells.twin)
    side = np.flatnonzero(cells.twin >= 0)
    after = cells.corner.next()[cells.twin[side]]
    graph = coo_array((np.ones(len(side)), (side, after)), shape=(size, size))
    n, vertex = connected_components(graph, directed=False)
    point = np.zeros(n, dtype=np.int64)
    point[vertex] = cells.corner.values
    return vertex.astype(np.int64), point


def awkward_cells(corner: Ragged, twin: Ints) -> Bools:
    """(c,) cells that shared vertices cannot tell apart: those that come to a vertex twice, and those with
    one of several edges that join the same two vertices. Where very few cells go around, all are.
    """
    n = int(corner.values.max()) + 1
    _, visit, visits = np.unique(corner.row * n + corner.values, return_inverse=True, return_counts=True)
    following = corner.values[corner.next()]
    pairs = np.minimum(corner.values, following) * n + np.maximum(corner.values, following)
    _, pair, sides = np.unique(pairs, return_inverse=True, return_counts=True)
    own = np.where(twin >= 0, 2, 1)  # sides of the one edge that should join them
    awkward = (visits[visit] > 1) | (sides[pair] > own)
    return np.bincount(corner.row[awkward], minlength=corner.n_rows) > 0
