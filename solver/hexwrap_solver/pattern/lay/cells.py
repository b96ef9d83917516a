"""Cells: closed walks along the edges of the pattern that always turn left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hexwrap_solver.arrays import Bools, Ints, Ragged
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.lay.edges import PatternEdges

#: Around a singularity there are at most this many sectors more than elsewhere.
MOST_EXTRA = 6


@dataclass(frozen=True)
class Cells:
    """Sides are numbered through all cells; side k runs from the corner k to the next one of its cell.

    corner: points per cell, counter-clockwise. isometry: (sides, 4) carry the corners' own coordinates to
    those of the cell's first one. twin: (sides,) the same side of the neighbouring cell, −1 where there is
    none. index: (cells,) k around a singularity, else 0.
    """

    corner: Ragged
    isometry: Ints
    twin: Ints
    index: Ints

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
            self.index[keep],
        )


@dataclass(frozen=True)
class WholeCells:
    """Cells whose edges all run inside the domain: corner: nodes per cell. slot: (sides,) of each side at its
    corner; isometry: (sides, 4) from the corner's own coordinates to the first corner's. index: (cells,) k
    where a singularity of that index lies inside, else 0."""

    corner: Ragged
    slot: Ints
    isometry: Ints
    index: Ints

    @property
    def n(self) -> int:
        return self.corner.n_rows

    def part(self, keep: Bools) -> WholeCells:
        if keep.all():
            return self
        side = np.repeat(keep, self.corner.lengths)
        offsets = np.concatenate([[0], np.cumsum(self.corner.lengths[keep])])
        corner = Ragged(self.corner.values[side], offsets)
        return WholeCells(corner, self.slot[side], self.isometry[side], self.index[keep])


def whole_cells(lattice: Lattice, edges: PatternEdges) -> WholeCells:
    """Walks that come back after as many sides as a cell has, or fewer or more around a singularity.

    A walk that has gone around the surface (w of its isometry) bounds no cell. Otherwise it bounds a disk, or
    a disk with boundary loops inside that no edge of the pattern meets; see ``enclosed_loops``. By how much
    it turns altogether tells the index of what it encloses: (order − k)/order of a full turn.
    """
    heads, gluings, backs = edges.head.ravel(), edges.gluing.ravel(), edges.back.ravel()
    start = np.flatnonzero(heads >= 0)
    node, slot = start // edges.width, start % edges.width
    products = np.zeros((1, 4), dtype=np.int64)  # of the gluings met: few walks meet any
    product = np.zeros(len(start), dtype=np.int64)  # which of them each walk has met, 0: none
    walk, turned = np.arange(len(start)), np.zeros(len(start), dtype=np.int64)
    first, visits = start, []
    closed, total = np.zeros(len(start), dtype=bool), np.zeros(len(start), dtype=np.int64)

    def meet(which: Ints, isometry: Ints) -> None:
        nonlocal products, product
        if len(which):
            met = lattice.compose(products[product[which]], isometry)
            product = product.copy()
            product[which] = len(products) + np.arange(len(which))
            products = np.concatenate([products, met])

    for _ in range(lattice.sides + lattice.sides // lattice.order * MOST_EXTRA):
        visits.append((walk, node, slot, product))
        at = edges.number(node, slot)
        gluing, back, node = gluings.take(at), backs.take(at), heads.take(at)
        glued = np.flatnonzero(gluing)
        meet(glued, edges.isometries[gluing[glued]])
        slot, inner, passed = edges.clockwise(node, back % edges.width)
        seam = np.flatnonzero(passed & (edges.around.take(node) != lattice.directions))
        meet(seam, edges.seam[node[seam]])
        turned = turned + lattice.directions // 2 - inner
        number = edges.number(node, slot)
        at_first = number == first
        closed[walk[at_first]] = products[:, 3].take(product[at_first]) == 0
        total[walk[at_first]] = turned[at_first]
        # Each cell once, from its lowest side on; a walk that comes to a lower one is another's, or none.
        going = (heads.take(number) >= 0) & (number > first)
        walk, first, node, slot, product, turned = (
            x[going] for x in (walk, first, node, slot, product, turned)
        )
        if not len(walk):
            break
    kept = [closed[walk] for walk, *_ in visits]
    walk, node, slot, product = (
        np.concatenate([visit[i][keep] for visit, keep in zip(visits, kept, strict=True)]) for i in range(4)
    )
    sorted_by_walk = np.argsort(walk, kind="stable")
    lengths = np.bincount(walk, minlength=len(start))[closed]
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    index = (lattice.directions - total[closed]) // lattice.steps_per_turn
    isometry = products[product[sorted_by_walk]]
    return WholeCells(Ragged(node[sorted_by_walk], offsets), slot[sorted_by_walk], isometry, index)


def sides_by_edge(edges: PatternEdges, cells: WholeCells) -> Ints:
    """(n·width,) the side that runs along each directed edge, −1 where there is none."""
    side = np.full(edges.head.size, -1, dtype=np.int64)
    side[edges.number(cells.corner.values.astype(np.int64), cells.slot)] = np.arange(len(cells.slot))
    return side


def only_whole_cells(edges: PatternEdges, cells: WholeCells) -> Cells:
    reverse = edges.back[cells.corner.values, cells.slot]
    return Cells(cells.corner, cells.isometry, sides_by_edge(edges, cells)[reverse], cells.index)


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
    values = corner.values.astype(np.int64)
    n, following = int(values.max()) + 1, values.take(corner.next())
    at, pairs = corner.row * n + values, np.minimum(values, following) * n + np.maximum(values, following)
    if _different(at) == len(at) and 2 * _different(pairs) == len(twin) + np.count_nonzero(twin < 0):
        return np.zeros(corner.n_rows, dtype=bool)  # as nearly always, and seen in a quarter of the time
    _, visit, visits = np.unique(at, return_inverse=True, return_counts=True)
    _, pair, sides = np.unique(pairs, return_inverse=True, return_counts=True)
    own = np.where(twin >= 0, 2, 1)  # sides of the one edge that should join them
    awkward = (visits[visit] > 1) | (sides[pair] > own)
    return np.bincount(corner.row[awkward], minlength=corner.n_rows) > 0


def _different(values: Ints) -> int:
    """How many different ones there are."""
    ordered = np.sort(values)
    return len(values[:1]) + int(np.count_nonzero(ordered[1:] != ordered[:-1]))
