"""Cutting the pattern along the boundary: the arrangement of links and boundary, traced face by face.

Every vertex of a cut cell is a node, a place where a link meets the boundary, or a corner of the boundary,
and is shared by the cells around it; cells that the boundary cuts into several pieces come out as several.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lay.cells import Cells, reverse_links, whole_cells
from hexwrap_solver.pattern.lay.edges import Links
from hexwrap_solver.pattern.lay.nodes import Layout, Nodes
from hexwrap_solver.pattern.trim.arrangement import HalfEdges, Points, arrangement

#: Pieces smaller than this part of a cell are joined to a cut neighbour, or dropped where there is none.
SLIVER = 0.05

#: Faces thinner than this many times the reach, over the length of an edge, are rounding: a boundary that
#: runs along links.
NOTHING = 4.0


class TooCoarse(Exception):
    """A face of the arrangement goes around the surface: no link separates it from itself."""


@dataclass(frozen=True)
class Trimmed:
    """cells with points as corners; whole: (c,) not cut; points; dropped: area left out, in cells; joined and
    lost: how many pieces were joined to a neighbour or dropped."""

    cells: Cells
    whole: Bools
    points: Points
    dropped: float = 0.0
    joined: int = 0
    lost: int = 0


def trim(cmap: ConformalMap, layout: Layout, nodes: Nodes, links: Links) -> Trimmed:
    """Whole cells and the cells that the boundary cuts."""
    lattice, motion = layout.lattice, layout.motion
    corner, turns, direction = whole_cells(lattice, motion, links)
    used = np.zeros(links.head.size, dtype=bool)
    used[corner * lattice.order + direction] = True
    points, edges = arrangement(cmap, layout, nodes, links, used)
    faces = _trace(edges, used)
    area = _areas(layout, points, faces)
    nothing, sliver = NOTHING * layout.reach * lattice.edge, SLIVER * lattice.cell_area
    gone = _slivers(edges, faces, area, (nothing, sliver), _lengths(layout, points, edges))
    joined = 0
    if gone.any():
        joined = int(((area > nothing) & (area < sliver)).sum())
        edges = edges.without(gone)
        faces = _trace(edges, used)
        linked = np.bincount(edges.tail[~edges.outer], minlength=len(points.face)) > 1
        faces = faces.entries(~points.straight[faces.corner] | linked[faces.corner])
        area = _areas(layout, points, faces)
    small = area < sliver
    lost = int((small & (area > nothing)).sum())
    kept = faces.part(~small)
    cells = _together(corner, turns, direction, kept, edges, links, layout)
    whole = np.arange(cells.n) < len(corner)
    dropped = float(area[small].sum() / lattice.cell_area)
    return Trimmed(cells, whole, points, dropped, max(joined - lost, 0), lost)


@dataclass(frozen=True)
class _Faces:
    """half_edge: per face, in order; turns: aligned, sheets of the tails seen from the first one."""

    half_edge: Ragged
    turns: Ints
    corner: Ints

    def part(self, keep: Bools) -> _Faces:
        """Some of the faces."""
        entry = np.repeat(keep, self.half_edge.lengths)
        offsets = np.concatenate([[0], np.cumsum(self.half_edge.lengths[keep])])
        return _Faces(Ragged(self.half_edge.values[entry], offsets), self.turns[entry], self.corner[entry])

    def entries(self, keep: Bools) -> _Faces:
        """All faces with some of their corners; the side before a corner left out goes on to the next."""
        lengths = np.bincount(self.half_edge.row[keep], minlength=self.half_edge.n_rows)
        offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
        return _Faces(Ragged(self.half_edge.values[keep], offsets), self.turns[keep], self.corner[keep])


def _trace(edges: HalfEdges, used: Bools) -> _Faces:
    """Cycles of half-edges that bound neither a whole cell nor the outside, all walked at once."""
    following = edges.next()
    taken = edges.outer.copy()
    named = edges.name >= 0
    taken[named] |= used[edges.name[named]]
    start = np.flatnonzero(~taken)
    at, turns = start.copy(), np.zeros(len(start), dtype=np.int64)
    walker = np.arange(len(start))
    who, what, sheets, when = [], [], [], []
    step = 0
    finished = np.zeros(len(start), dtype=bool)
    while len(walker):
        who.append(walker)
        what.append(at)
        sheets.append(turns)
        when.append(np.full(len(walker), step))
        turns = turns + edges.sheet[at]
        at = following[at]
        step += 1
        done = at == start[walker]
        finished[walker[done]] = True
        if (turns[done] != 0).any():
            raise TooCoarse
        going = ~done & (at > start[walker])  # each cycle is walked to its end from its lowest half-edge
        walker, at, turns = walker[going], at[going], turns[going]
    all_who = np.concatenate(who) if who else start
    entry = np.flatnonzero(finished[all_who])
    time = np.concatenate(when)[entry] if who else start
    entry = entry[np.lexsort((time, all_who[entry]))]
    lengths = np.bincount(all_who[entry], minlength=len(start))[finished]
    half_edge = np.concatenate(what)[entry] if who else start
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    sheet = np.concatenate(sheets)[entry] if who else start
    return _Faces(Ragged(half_edge, offsets), sheet, edges.tail[half_edge])


def _areas(layout: Layout, points: Points, faces: _Faces) -> Floats:
    """(f,) in lattice units."""
    if not faces.half_edge.n_rows:
        return np.zeros(0)
    place = layout.motion.carry(points.place[faces.corner], faces.turns)
    place = place - place[faces.half_edge.offsets[:-1]][faces.half_edge.row]
    cross = (place.conj() * place[faces.half_edge.next()]).imag / 2
    return np.asarray(np.add.reduceat(cross, faces.half_edge.offsets[:-1]))


def _lengths(layout: Layout, points: Points, edges: HalfEdges) -> Floats:
    """(h,) lengths of half-edges in lattice units."""
    return np.asarray(
        abs(layout.motion.carry(points.place[edges.head], edges.sheet) - points.place[edges.tail])
    )


def _slivers(
    edges: HalfEdges, faces: _Faces, area: Floats, between: tuple[float, float], length: Floats
) -> Bools:
    """Half-edges to take away, so that each small piece joins the cut neighbour with the longest border.

    Of equal ones, the neighbour that follows along the boundary, so that nothing depends on numbering.
    """
    gone = np.zeros(len(edges.tail), dtype=bool)
    face_of = np.full(len(edges.tail), -1, dtype=np.int64)
    face_of[faces.half_edge.values] = faces.half_edge.row
    small = (area > between[0]) & (area < between[1])
    entry = np.flatnonzero(small[faces.half_edge.row])
    half_edge = faces.half_edge.values[entry]
    mine, other = faces.half_edge.row[entry], face_of[edges.twin[half_edge]]
    fits = other >= 0
    fits &= np.where(fits, area[other] >= between[1], False)
    after_rim = np.zeros(len(edges.tail), dtype=bool)
    on_rim = edges.outer[edges.twin[faces.half_edge.values]]
    after_rim[faces.half_edge.values[faces.half_edge.next()]] = on_rim
    mine, other, half_edge = mine[fits], other[fits], half_edge[fits]
    pair, index = np.unique(np.stack([mine, other]), axis=1, return_inverse=True)
    border, follows = (
        np.bincount(index.ravel(), weights=w[half_edge], minlength=pair.shape[1]) for w in (length, after_rim)
    )
    order = np.lexsort((-follows, -np.round(border, 7), pair[0]))
    best = order[np.unique(pair[0][order], return_index=True)[1]]
    away = half_edge[np.isin(index.ravel(), best)]
    gone[away] = True
    gone[edges.twin[away]] = True
    return gone


def _together(
    corner: Ints, turns: Ints, direction: Ints, cut: _Faces, edges: HalfEdges, links: Links, layout: Layout
) -> Cells:
    """Whole and cut cells in one; a side's twin is found by the half-edge or by the link it runs along."""
    order, size = layout.lattice.order, corner.size
    side_of_link = np.full(links.head.size, -1, dtype=np.int64)
    slot = (corner * order + direction).ravel()
    side_of_link[slot] = np.arange(size)
    half_edge = cut.half_edge.values
    side_of_half = np.full(len(edges.tail), -1, dtype=np.int64)
    side_of_half[half_edge] = size + np.arange(len(half_edge))
    name = edges.name[half_edge]
    side_of_link[name[name >= 0]] = side_of_half[half_edge[name >= 0]]
    back = reverse_links(layout.lattice, layout.motion, links, slot // order, slot % order)
    twin_cut = side_of_half[edges.twin[half_edge]]
    twin_name = edges.name[edges.twin[half_edge]]
    twin_cut = np.where((twin_cut < 0) & (twin_name >= 0), side_of_link[twin_name], twin_cut)
    lengths = np.concatenate([np.full(len(corner), layout.lattice.sides), cut.half_edge.lengths])
    return Cells(
        Ragged(
            np.concatenate([corner.ravel(), cut.corner]),
            np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        ),
        np.concatenate([turns.ravel(), cut.turns]),
        np.concatenate([side_of_link[back], twin_cut]),
    )
