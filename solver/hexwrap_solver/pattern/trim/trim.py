"""Cutting the pattern along the boundary.

Near the boundary the edges of the pattern and the boundary itself are a plane graph, the *arrangement*: its
points are nodes, places where an edge of the pattern meets the boundary, and corners of the boundary; its
half-edges run along pattern edges, along pieces of them that lie between two places of the boundary
("chords"), and along the boundary, inside and outside of it.

Around each point the half-edges have an order. The half-edge that follows h, with the same face on its left,
is the first one clockwise from the twin of h around the head of h:

                    \\  next(h)
                     \\
        ---- h ----->  •          turning clockwise from twin(h), the first half-edge met is next(h)
        <- twin(h) --  |

so that faces are the cycles of h ↦ next(h). Those bounded by whole cells are known already, and the outside
is not a face; what remains are the cut cells. A cell that the boundary cuts into several pieces comes out as
several. No place is ever compared with another: the order around points, the twins and the lattice isometries
along half-edges are all that is needed, so that this works on nets that overlap themselves.

Pieces smaller than SLIVER of a cell would be no panels. Taking away the half-edges that part such a piece
from a cut neighbour joins the two, as it merges two faces of any plane graph. The corner at which the edge
taken away met a straight piece of boundary then goes, too.

A boundary loop that no edge of the pattern meets lies inside one cell, as a hole. Then that cell is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.pattern.lay.cells import Cells, WholeCells, sides_by_edge
from hexwrap_solver.pattern.lay.edges import PatternEdges
from hexwrap_solver.pattern.lay.layout import Layout
from hexwrap_solver.pattern.lay.nodes import Nodes
from hexwrap_solver.pattern.place.glued import Glued
from hexwrap_solver.pattern.trim.arrangement import HalfEdges, Points, arrangement
from hexwrap_solver.pattern.trim.boundary import Boundary, met_by_chords
from hexwrap_solver.pattern.trim.enclosed import around_enclosed
from hexwrap_solver.pattern.trim.folds import Seams, seams, sewn, without_ends
from hexwrap_solver.surface.features import FeatureEdges

#: Pieces smaller than this part of a cell are joined to a cut neighbour, or dropped where there is none.
SLIVER = 0.05

#: Faces thinner than this many times the tolerance, over the length of an edge, are rounding: a boundary that
#: runs along pattern edges.
NOTHING = 4.0


class TooCoarse(Exception):
    """A face of the arrangement goes around the surface: no edge of the pattern separates it from itself."""


@dataclass(frozen=True)
class Trimmed:
    """cells with points as corners; whole: (c,) not cut; points; dropped: area left out, in cells; joined and
    lost: how many pieces were joined to a neighbour or dropped; holed: how many cells were left out because
    an opening lies inside them. seams: which of the points on folds are one, None where there is no fold."""

    cells: Cells
    whole: Bools
    points: Points
    dropped: float = 0.0
    joined: int = 0
    lost: int = 0
    holed: int = 0
    seams: Seams | None = None


@dataclass(frozen=True)
class Folded:
    """Of a layout that is cut open along features. faces: (m, 3) of the surface."""

    faces: Ints
    glued: Glued
    features: FeatureEdges


def trim(
    layout: Layout,
    boundary: Boundary,
    met: Bools,
    nodes: Nodes,
    edges: PatternEdges,
    cells: WholeCells,
    folded: Folded | None = None,
    *,
    keep_cut: bool = True,
) -> Trimmed:
    """Whole cells and the cells that the boundary cuts.

    met: (loops,) those that the pattern meets, or that no cell may enclose. folded: with features. keep_cut:
    whether cells that the boundary of the surface cuts are kept, too, and not only those along folds.

    Raises TooCoarse where a face goes around the surface.
    """
    lattice = layout.lattice
    side_of_edge = sides_by_edge(edges, cells)
    used = side_of_edge >= 0
    points, half_edges, on = arrangement(layout, boundary, nodes, edges, used)
    seam = None
    if folded is not None:
        seam = seams(layout, folded.faces, folded.glued, folded.features, boundary, on, len(points.face))
    faces = _trace(layout, half_edges, used)
    if not keep_cut:
        faces = faces.without_cut(half_edges)
    area = _areas(layout, points, faces)
    nothing, sliver = NOTHING * layout.tolerance * lattice.edge, SLIVER * lattice.cell_area
    gone = _slivers(half_edges, faces, area, (nothing, sliver), _lengths(layout, points, half_edges))
    joined = 0
    if gone.any():
        joined = int(((area > nothing) & (area < sliver)).sum())
        half_edges = half_edges.without(gone)
        faces = _trace(layout, half_edges, used)
        if not keep_cut:
            faces = faces.without_cut(half_edges)
        linked = np.bincount(half_edges.tail[~half_edges.outer], minlength=len(points.face)) > 1
        if seam is not None:
            linked = seam.any_of(linked)
        faces = faces.entries(~points.straight[faces.corner] | linked[faces.corner])
        area = _areas(layout, points, faces)
    small = area < sliver
    # Small pieces that folds cut off, with no neighbour on their own side: dropped, they would leave holes.
    small &= ~(faces.along_folds(half_edges) & (area > nothing))
    lost = int((small & (area > nothing)).sum())
    kept = faces.part(~small)
    together = _together(cells, side_of_edge, kept, half_edges, edges)
    whole = np.arange(together.n) < cells.n
    dropped = float(area[small & (area > 0)].sum() / lattice.cell_area)
    holed = around_enclosed(layout, boundary, nodes, edges, met_by_chords(met, layout, boundary))
    keep = ~_left_of(holed, cells, side_of_edge, kept, half_edges)
    together = together.part(keep)
    if seam is not None:
        together, had = without_ends(lattice, sewn(lattice, together, seam))
        # What only a fold's end had reached into is whole again.
        on_node = np.add.reduceat(together.corner.values < nodes.n, together.corner.offsets[:-1])
        full = (on_node == lattice.sides) & (together.corner.lengths == lattice.sides)
        whole[keep] |= had & full
    return Trimmed(
        together, whole[keep], points, dropped, max(joined - lost, 0), lost, int((~keep).sum()), seam
    )


def _left_of(slots: Ints, cells: WholeCells, side_of_edge: Ints, cut: _Faces, half_edges: HalfEdges) -> Bools:
    """(cells,) those, whole or cut, that have one of the pattern edges as a side."""
    found = np.zeros(cells.n + cut.half_edge.n_rows, dtype=bool)
    side = side_of_edge[slots]
    found[cells.corner.row[side[side >= 0]]] = True
    named = np.isin(half_edges.name[cut.half_edge.values], slots)
    found[cells.n + cut.half_edge.row[named]] = True
    return found


@dataclass(frozen=True)
class _Faces:
    """half_edge: per face, in order; isometry: aligned, (h, 4), from the tails' own coordinates to those of
    the first one."""

    half_edge: Ragged
    isometry: Ints
    corner: Ints

    def part(self, keep: Bools) -> _Faces:
        """Some of the faces."""
        entry = np.repeat(keep, self.half_edge.lengths)
        return _Faces(self.half_edge.take(keep), self.isometry[entry], self.corner[entry])

    def without_cut(self, edges: HalfEdges) -> _Faces:
        """Those that do not come to the boundary of the surface."""
        at_boundary = np.zeros(self.half_edge.n_rows, dtype=bool)
        at_boundary[self.half_edge.row[edges.on_boundary[self.half_edge.values]]] = True
        return self.part(~at_boundary)

    def along_folds(self, edges: HalfEdges) -> Bools:
        """(f,) faces with a side along a fold."""
        outside = edges.twin[self.half_edge.values]
        on_fold = edges.outer[outside] & ~edges.on_boundary[outside]
        return np.bincount(self.half_edge.row[on_fold], minlength=self.half_edge.n_rows) > 0

    def entries(self, keep: Bools) -> _Faces:
        """All faces with some of their corners; the side before a corner left out goes on to the next."""
        lengths = np.bincount(self.half_edge.row[keep], minlength=self.half_edge.n_rows)
        return _Faces(Ragged.of(self.half_edge.values[keep], lengths), self.isometry[keep], self.corner[keep])


def _trace(layout: Layout, edges: HalfEdges, used: Bools) -> _Faces:
    """Cycles of half-edges that bound neither a whole cell nor the outside, all walked at once."""
    following = edges.next()
    taken = edges.outer.copy()
    named = edges.name >= 0
    taken[named] |= used[edges.name[named]]
    start = np.flatnonzero(~taken)
    at, isometry = start.copy(), np.zeros((len(start), 4), dtype=np.int64)
    walker = np.arange(len(start))
    nothing = np.zeros(0, dtype=np.int64)
    who, what, where = [nothing], [nothing], [np.zeros((0, 4), dtype=np.int64)]
    finished = np.zeros(len(start), dtype=bool)
    while len(walker):
        if len(who) > len(following) + 1:
            raise RuntimeError("half-edges that follow each other come to no end")
        who.append(walker)
        what.append(at)
        where.append(isometry)
        isometry = layout.lattice.compose(isometry, edges.isometry[at])
        at = following[at]
        done = at == start[walker]
        finished[walker[done]] = True
        if (isometry[done, 3] != 0).any():
            raise TooCoarse
        going = ~done & (at > start[walker])  # each cycle is walked to its end from its lowest half-edge
        walker, at, isometry = walker[going], at[going], isometry[going]
    all_who = np.concatenate(who)
    entry = np.flatnonzero(finished[all_who])
    entry = entry[np.argsort(all_who[entry], kind="stable")]
    lengths = np.bincount(all_who[entry], minlength=len(start))[finished]
    half_edge = np.concatenate(what)[entry]
    return _Faces(Ragged.of(half_edge, lengths), np.concatenate(where)[entry], edges.tail[half_edge])


def _areas(layout: Layout, points: Points, faces: _Faces) -> Floats:
    """(f,) in lattice units."""
    if not faces.half_edge.n_rows:
        return np.zeros(0)
    place = layout.lattice.carry(faces.isometry, points.place[faces.corner])
    place = place - place[faces.half_edge.offsets[:-1]][faces.half_edge.row]
    cross = (place.conj() * place[faces.half_edge.next()]).imag / 2
    return np.asarray(np.add.reduceat(cross, faces.half_edge.offsets[:-1]))


def _lengths(layout: Layout, points: Points, edges: HalfEdges) -> Floats:
    """(h,) lengths of half-edges in lattice units."""
    head = layout.lattice.carry(edges.isometry, points.place[edges.head])
    return np.asarray(abs(head - points.place[edges.tail]))


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
    after_boundary = np.zeros(len(edges.tail), dtype=bool)
    on_boundary = edges.outer[edges.twin[faces.half_edge.values]]
    after_boundary[faces.half_edge.values[faces.half_edge.next()]] = on_boundary
    mine, other, half_edge = mine[fits], other[fits], half_edge[fits]
    pair, index = np.unique(np.stack([mine, other]), axis=1, return_inverse=True)
    border, follows = (
        np.bincount(index.ravel(), weights=w[half_edge], minlength=pair.shape[1])
        for w in (length, after_boundary)
    )
    order = np.lexsort((-follows, -np.round(border, 7), pair[0]))
    best = order[np.unique(pair[0][order], return_index=True)[1]]
    away = half_edge[np.isin(index.ravel(), best)]
    gone[away] = True
    gone[edges.twin[away]] = True
    return gone


def _together(
    whole: WholeCells,
    side_of_edge: Ints,
    cut: _Faces,
    half_edges: HalfEdges,
    edges: PatternEdges,
) -> Cells:
    """Whole and cut cells in one; twins are found by half-edges, or by the pattern edges they run along."""
    size = len(whole.slot)
    half_edge = cut.half_edge.values
    side_of_half = np.full(len(half_edges.tail), -1, dtype=np.int64)
    side_of_half[half_edge] = size + np.arange(len(half_edge))
    side_of_edge = side_of_edge.copy()
    name = half_edges.name[half_edge]
    side_of_edge[name[name >= 0]] = side_of_half[half_edge[name >= 0]]
    reverse = edges.back[whole.corner.values, whole.slot]
    twin_cut = side_of_half[half_edges.twin[half_edge]]
    twin_name = half_edges.name[half_edges.twin[half_edge]]
    twin_cut = np.where((twin_cut < 0) & (twin_name >= 0), side_of_edge[twin_name], twin_cut)
    lengths = np.concatenate([whole.corner.lengths, cut.half_edge.lengths])
    return Cells(
        Ragged.of(np.concatenate([whole.corner.values, cut.corner]), lengths),
        np.concatenate([whole.isometry, cut.isometry]),
        np.concatenate([side_of_edge[reverse], twin_cut]),
        np.concatenate([whole.index, np.zeros(cut.half_edge.n_rows, dtype=np.int64)]),
    )
