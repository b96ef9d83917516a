"""Cells: closed walks along the edges of the pattern that always turn left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from hexwrap_solver.arrays import Bools, Ints, Ragged
from hexwrap_solver.geometry import orbits
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
        across = np.where(self.twin >= 0, self.corner.row.take(self.twin, mode="wrap"), -1)
        return Ragged(across, self.corner.offsets)

    def part(self, keep: Bools) -> Cells:
        """Some of the cells."""
        if keep.all():
            return self
        side = np.repeat(keep, self.corner.lengths)
        renumber = np.where(side, np.cumsum(side) - 1, -1)
        twin = self.twin[side]
        return Cells(
            self.corner.take(keep),
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
        return WholeCells(self.corner.take(keep), self.slot[side], self.isometry[side], self.index[keep])


def whole_cells(lattice: Lattice, edges: PatternEdges) -> WholeCells:
    """Walks that come back after as many sides as a cell has, or fewer or more around a singularity.

    A walk that has gone around the surface (w of its isometry) bounds no cell. Otherwise it bounds a disk, or
    a disk with boundary loops inside that no edge of the pattern meets; see ``enclosed_loops``. By how much
    it turns altogether tells the index of what it encloses: (order − k)/order of a full turn.
    """
    following, turn, glued = _following(lattice, edges)
    heads = edges.head.ravel()
    start = np.flatnonzero(following >= 0)
    walk, first, at, visits = np.arange(len(start)), start, start, []
    lengths = np.zeros(len(start), dtype=np.int64)
    for step in range(lattice.sides + lattice.sides // lattice.order * MOST_EXTRA):
        visits.append((walk, at))
        at = following.take(at)
        lengths[walk.compress(at == first)] = step + 1
        # Each cell once, from its lowest side on; a walk that comes to a lower one is another's, or none.
        going = (heads.take(at) >= 0) & (at > first)
        walk, first, at = (x.compress(going) for x in (walk, first, at))
        if not len(walk):
            break
    closed, begin = lengths > 0, np.cumsum(lengths) - lengths
    side = np.empty(int(lengths.sum()), dtype=np.int64)
    for step, (walk, at) in enumerate(visits):
        kept = closed.take(walk)
        side[begin.take(walk.compress(kept)) + step] = at.compress(kept)
    corner = Ragged(side // edges.width, np.append(begin[closed], len(side)))
    isometry, around = _beside_first(lattice, edges, side, corner, glued.take(side))
    turned = np.add.reduceat(turn.take(side), corner.offsets[:-1])
    index = (lattice.directions - turned) // lattice.steps_per_turn
    cells = WholeCells(corner, side % edges.width, isometry, index)
    return cells.part(around == 0)


def _beside_first(
    lattice: Lattice, edges: PatternEdges, side: Ints, corner: Ragged, glued: Bools
) -> tuple[Ints, Ints]:
    """(sides, 4) from the corner of each side to that of the first one of its cell, and (cells,) how often
    the walk goes around the surface. side: their edges; glued: whether a gluing or a seam comes after."""
    isometry, around = np.zeros((len(side), 4), dtype=np.int64), np.zeros(corner.n_rows, dtype=np.int64)
    cells = np.unique(corner.row[glued])  # few
    at, end = corner.offsets[cells], corner.offsets[cells + 1]
    product = np.zeros((len(cells), 4), dtype=np.int64)
    while len(cells):
        isometry[at] = product
        tail, slot = side[at] // edges.width, side[at] % edges.width
        product = lattice.compose(product, edges.isometry(tail, slot))
        node = edges.head[tail, slot]
        seam = (edges.back[tail, slot] % edges.width == 0) & (edges.around[node] != lattice.directions)
        product[seam] = lattice.compose(product[seam], edges.seam[node[seam]])
        at = at + 1
        done = at == end
        around[cells[done]] = product[done, 3]
        cells, at, end, product = cells[~done], at[~done], end[~done], product[~done]
    return isometry, around


def _following(lattice: Lattice, edges: PatternEdges) -> tuple[Ints, Ints, Bools]:
    """By number of a directed edge: (n·width,) the next one around the cell on its left, −1 without a head;
    by how many directions that turns left; and whether a gluing, or a singularity's seam, lies between."""
    at = np.flatnonzero(edges.head.ravel() >= 0)
    node, back = edges.head.ravel().take(at), edges.back.ravel().take(at) % edges.width
    slot, inner, passed = edges.clockwise(node, back)
    following, turn = np.full(edges.head.size, -1, dtype=np.int64), np.zeros(edges.head.size, dtype=np.int64)
    following[at], turn[at] = edges.number(node, slot), lattice.directions // 2 - inner
    seam = passed & (edges.around.take(node) != lattice.directions)
    glued = np.zeros(edges.head.size, dtype=bool)
    glued[at] = seam | (edges.gluing.ravel().take(at) > 0)
    return following, turn, glued


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
    graph = graph_of(cells.neighbours())
    if len(breadth_first_order(graph, 0, return_predecessors=False)) == cells.n:
        return np.ones(cells.n, dtype=bool)  # as nearly always
    _, part = connected_components(graph, directed=False)
    return np.asarray(part == np.argmax(np.bincount(part)))


def graph_of(neighbours: Ragged) -> csr_array:
    """Of the cells, joined across edges, both ways. neighbours: as of ``Cells``."""
    inner, n = neighbours.values >= 0, neighbours.n_rows
    offsets = np.append(0, np.cumsum(inner))[neighbours.offsets]
    return csr_array((np.ones(offsets[-1]), neighbours.values[inner], offsets), shape=(n, n))


def manifold_corners(cells: Cells) -> tuple[Ints, Ints]:
    """(sides,) vertex of every corner, and (v,) the point at which it stands.

    Cells that touch at a point, but at no edge there, get a vertex each, so that boundaries are simple loops.
    """
    vertex, n = orbits(np.where(cells.twin >= 0, cells.corner.next().take(cells.twin, mode="wrap"), -1))
    point = np.zeros(n, dtype=np.int64)
    point[vertex] = cells.corner.values
    return vertex, point


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
