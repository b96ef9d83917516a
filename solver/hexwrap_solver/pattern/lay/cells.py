"""Cells: closed walks along the edges of the pattern that always turn left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Bools, Ints, Ragged
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.lay.edges import PatternEdges

#: A cell at a singularity has at most so many sides more than others.
MOST_EXTRA_SIDES = 6


@dataclass(frozen=True)
class Cells:
    """Sides are numbered through all cells; side k runs from the corner k to the next one of its cell.

    corner: points per cell, counter-clockwise. isometry: (sides, 4) carry the corners' own coordinates to
    those of the cell's first one. twin: (sides,) the same side of the neighbouring cell, −1 where there is
    none.
    """

    corner: Ragged
    isometry: Ints
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
        if keep.all():
            return self
        side = np.repeat(keep, self.corner.lengths)
        renumber = np.where(side, np.cumsum(side) - 1, -1)
        twin = self.twin[side]
        offsets = np.concatenate([[0], np.cumsum(self.corner.lengths[keep])])
        return Cells(
            Ragged(self.corner.values[side], offsets),
            self.isometry[side],
            np.where(twin >= 0, renumber[twin], -1),
        )


@dataclass(frozen=True)
class WholeCells:
    """Cells whose edges all run inside the domain: corner: nodes per cell. direction, isometry: (sides,) and
    (sides, 4) of each side in its corner's own coordinates, and of these to the cell's first corner's."""

    corner: Ragged
    direction: Ints
    isometry: Ints

    @property
    def n(self) -> int:
        return self.corner.n_rows

    def part(self, keep: Bools) -> WholeCells:
        if keep.all():
            return self
        side = np.repeat(keep, self.corner.lengths)
        offsets = np.concatenate([[0], np.cumsum(self.corner.lengths[keep])])
        corner = Ragged(self.corner.values[side], offsets)
        return WholeCells(corner, self.direction[side], self.isometry[side])


def whole_cells(lattice: Lattice, edges: PatternEdges) -> WholeCells:
    """Walks that come back after as many sides as a cell has, or fewer or more around a singularity.

    A walk that has gone around the surface (w of its isometry) bounds no cell. Otherwise it bounds a disk, or
    a disk with boundary loops inside that no edge of the pattern meets; see ``enclosed_loops``.
    """
    order, turned = lattice.order, edges.isometries[:, 0]
    start = np.flatnonzero(edges.head.ravel() >= 0)
    node, way = start // order, start % order
    products = np.zeros((1, 4), dtype=np.int64)  # of the gluings met: few walks meet any
    product = np.zeros(len(start), dtype=np.int64)  # which of them each walk has met, 0: none
    walk = np.arange(len(start))
    first, visits = start, []
    closed = np.zeros(len(start), dtype=bool)
    for _ in range(lattice.sides + MOST_EXTRA_SIDES):
        visits.append((walk, node, way, product))
        gluing = edges.gluing[node, way]
        node = edges.head[node, way]
        way = (way - turned[gluing] + lattice.turn) % order
        glued = np.flatnonzero(gluing)
        if len(glued):
            met = lattice.compose(products[product[glued]], edges.isometries[gluing[glued]])
            product = product.copy()
            product[glued] = len(products) + np.arange(len(glued))
            products = np.concatenate([products, met])
        slot = node * order + way
        back = (node >= 0) & (slot == first)
        closed[walk[back]] = products[product[back], 3] == 0
        # Each cell once, from its lowest side on; a walk that comes to a lower one is another's, or none.
        going = (node >= 0) & (slot > first)
        walk, first, node, way, product = (x[going] for x in (walk, first, node, way, product))
        if not len(walk):
            break
    kept = [closed[walk] for walk, *_ in visits]
    walk, node, way, product = (
        np.concatenate([visit[i][keep] for visit, keep in zip(visits, kept, strict=True)]) for i in range(4)
    )
    sorted_by_walk = np.argsort(walk, kind="stable")
    lengths = np.bincount(walk, minlength=len(start))[closed]
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    isometry = products[product[sorted_by_walk]]
    return WholeCells(Ragged(node[sorted_by_walk], offsets), way[sorted_by_walk], isometry)


def sides_by_edge(lattice: Lattice, edges: PatternEdges, cells: WholeCells) -> Ints:
    """(n·order,) the side that runs along each directed edge, −1 where there is none."""
    side = np.full(edges.head.size, -1, dtype=np.int64)
    side[cells.corner.values * lattice.order + cells.direction] = np.arange(len(cells.direction))
    return side


def only_whole_cells(lattice: Lattice, edges: PatternEdges, cells: WholeCells) -> Cells:
    reverse = edges.reverse(lattice, cells.corner.values.astype(np.int64), cells.direction)
    return Cells(cells.corner, cells.isometry, sides_by_edge(lattice, edges, cells)[reverse])


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
