"""Cutting the pattern along the boundary: the arrangement of links and boundary, traced face by face.

Every vertex of a cut cell is a node, a place where a link meets the boundary, or a corner of the boundary,
and is shared by the cells around it; cells that the boundary cuts into several pieces come out as several.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, Ragged
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.cells import Cells, reverse_links, whole_cells
from hexwrap_solver.pattern.links import Links
from hexwrap_solver.pattern.nodes import Layout, Nodes
from hexwrap_solver.pattern.rim import (
    Chords,
    Crossings,
    Rim,
    RimPoints,
    chords,
    corners_of_rim,
    crossings,
    nodes_on_rim,
    rim_of,
)

#: Pieces smaller than this part of a cell are joined to a cut neighbour, or dropped where there is none.
SLIVER = 0.05

#: Faces thinner than this many times the reach, over the length of an edge, are rounding: a boundary that
#: runs along links.
NOTHING = 4.0

#: Order of half-edges around a point on the boundary: along it, then into the domain by angle, then back.
ALONG, BACK = -1.0, 100.0


class TooCoarse(Exception):
    """A face of the arrangement goes around the surface: no link separates it from itself."""


@dataclass(frozen=True)
class Points:
    """Points of the arrangement: nodes first. face: triangle of the map; place: complex in its coordinates,
    which are the point's own. straight: (p,) no node, and on the boundary where that does not turn."""

    face: Ints
    place: Complexes
    straight: Bools


@dataclass(frozen=True)
class _HalfEdges:
    """tail, head: points. sheet: of the head's own coordinates, seen from the tail's. key: order around the
    tail. twin: the same edge the other way. outer: runs along the boundary outside of the domain. name: slot
    order·node + direction of a link from a node, −1 for others."""

    tail: Ints
    head: Ints
    sheet: Ints
    key: Floats
    twin: Ints
    outer: Bools
    name: Ints

    def without(self, gone: Bools) -> _HalfEdges:
        keep = ~gone
        renumber = np.where(keep, np.cumsum(keep) - 1, -1)
        part = {k: v[keep] for k, v in vars(self).items() if k != "twin"}
        return _HalfEdges(**part, twin=renumber[self.twin[keep]])

    def next(self) -> Ints:
        """The half-edge that follows with the same face on its left: the first clockwise from the twin."""
        order = np.lexsort((self.key, self.tail))
        tail = self.tail[order]
        first = np.flatnonzero(np.concatenate([[True], tail[1:] != tail[:-1]]))
        before = np.arange(len(order)) - 1
        before[first] = np.concatenate([first[1:], [len(order)]]) - 1
        clockwise = np.zeros(len(order), dtype=np.int64)
        clockwise[order] = order[before]
        return np.asarray(clockwise[self.twin])


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
    points, edges = _arrangement(cmap, layout, nodes, links, used)
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


def _trace(edges: _HalfEdges, used: Bools) -> _Faces:
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


def _lengths(layout: Layout, points: Points, edges: _HalfEdges) -> Floats:
    """(h,) lengths of half-edges in lattice units."""
    return np.asarray(
        abs(layout.motion.carry(points.place[edges.head], edges.sheet) - points.place[edges.tail])
    )


def _slivers(
    edges: _HalfEdges, faces: _Faces, area: Floats, between: tuple[float, float], length: Floats
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


def _arrangement(
    cmap: ConformalMap, layout: Layout, nodes: Nodes, links: Links, used: Bools
) -> tuple[Points, _HalfEdges]:
    """Points and half-edges near the boundary: everything that does not bound a whole cell."""
    lattice, order = layout.lattice, layout.lattice.order
    rim = rim_of(cmap, layout)
    cross, chord = crossings(layout, nodes, links, rim), chords(layout, rim)
    at_node = nodes_on_rim(layout, nodes, rim)
    on_rim, new = _points_on_rim(layout, rim, nodes.n, at_node, cross, chord)
    points = Points(
        np.concatenate([nodes.face[nodes.own], rim.face[new.edge]]),
        np.concatenate([lattice.position(nodes.point[nodes.own]), new.places(rim)]),
        np.concatenate([np.zeros(nodes.n, dtype=bool), (new.t > 0) | ~corners_of_rim(layout, rim)[new.edge]]),
    )
    key = _keys(layout, rim, at_node, nodes.n)
    near = np.zeros(nodes.n, dtype=bool)
    near[np.flatnonzero((links.head.ravel() >= 0) & ~used) // order] = True
    near[cross.node] = True
    near[at_node.point] = True
    crossing = nodes.n + np.arange(len(cross.node))
    name = cross.node * order + cross.direction
    out_key, no_key = key[cross.node, cross.direction], np.zeros(len(crossing))
    start = nodes.n + len(crossing) + np.arange(len(chord.edge))
    middle = np.zeros(len(start))
    return points, _join(
        [
            _among_nodes(layout, links, near, key),
            _pairs(cross.node, crossing, cross.sheet, out_key, no_key, name),
            _pairs(start, start + len(start), chord.sheet, middle, middle, np.full(len(start), -1)),
            _along_rim(rim, on_rim),
        ]
    )


def _points_on_rim(
    layout: Layout, rim: Rim, n: int, at_node: RimPoints, cross: Crossings, chord: Chords
) -> tuple[RimPoints, RimPoints]:
    """All points on the boundary, and those of them that are no nodes, numbered from n on."""
    edge = np.concatenate([cross.edge, chord.edge, chord.end_edge])
    t = np.concatenate([cross.t, chord.t, chord.end_t])
    taken = np.zeros(len(rim.face), dtype=bool)
    taken[np.concatenate([at_node.edge[at_node.t == 0], edge[t == 0]])] = True
    bends = np.flatnonzero(corners_of_rim(layout, rim) & ~taken)
    edge, t = np.concatenate([edge, bends]), np.concatenate([t, np.zeros(len(bends))])
    new = RimPoints(n + np.arange(len(edge)), edge, t, np.zeros(len(edge), dtype=np.int64))
    return RimPoints(
        np.concatenate([at_node.point, new.point]),
        np.concatenate([at_node.edge, new.edge]),
        np.concatenate([at_node.t, new.t]),
        np.concatenate([at_node.sheet, new.sheet]),
    ), new


def _among_nodes(layout: Layout, links: Links, near: Bools, key: Floats) -> _HalfEdges:
    """Links between nodes near the boundary. Links to other nodes have whole cells on both sides."""
    order = layout.lattice.order
    slot = np.flatnonzero((links.head >= 0).ravel() & np.repeat(near, order))
    tail, way = slot // order, slot % order
    kept = near[links.head[tail, way]]
    slot, tail, way = slot[kept], tail[kept], way[kept]
    position = np.full(links.head.size, -1, dtype=np.int64)
    position[slot] = np.arange(len(slot))
    twin = position[reverse_links(layout.lattice, layout.motion, links, tail, way)]
    outer = np.zeros(len(slot), dtype=bool)
    return _HalfEdges(tail, links.head[tail, way], links.turns[tail, way], key[tail, way], twin, outer, slot)


def _keys(layout: Layout, rim: Rim, at_node: RimPoints, n: int) -> Floats:
    """(n, order) order of directions around each node; on the boundary counted from the boundary's own."""
    order = layout.lattice.order
    key = np.tile(np.arange(order, dtype=float), (n, 1))
    along = (rim.head - rim.tail)[at_node.edge]
    along = along * np.exp(1j * layout.lattice.quantum * layout.motion.rotation(at_node.sheet))
    heading = layout.lattice.position(layout.lattice.steps)
    angle = np.mod(np.angle(heading[None] / along[:, None]), 2 * np.pi)
    key[at_node.point] = np.where(angle > 2 * np.pi - 1e-6, 0.0, angle)
    return key


def _pairs(tail: Ints, head: Ints, sheet: Ints, key: Floats, back_key: Floats, name: Ints) -> _HalfEdges:
    """Edges as two half-edges each."""
    k = len(tail)
    number = np.arange(k)
    return _HalfEdges(
        np.concatenate([tail, head]),
        np.concatenate([head, tail]),
        np.concatenate([sheet, -sheet]),
        np.concatenate([key, back_key]),
        np.concatenate([number + k, number]),
        np.zeros(2 * k, dtype=bool),
        np.concatenate([name, np.full(k, -1)]),
    )


def _along_rim(rim: Rim, on_rim: RimPoints) -> _HalfEdges:
    """The boundary between successive points, inside and outside."""
    order = np.lexsort((on_rim.t, on_rim.edge))
    point, edge, sheet = on_rim.point[order], on_rim.edge[order], on_rim.sheet[order]
    loop = rim.loop[edge]
    k = len(order)
    following = np.arange(1, k + 1)
    first = np.unique(loop, return_index=True)[1]
    last = np.append(first[1:], k)[: len(first)] - 1
    following[last] = first
    reached = np.concatenate([[0], np.cumsum(rim.sheet)])
    total = np.array([rim.sheet[rim.loop == which].sum() for which in (0, 1)])
    passed = reached[edge[following]] - reached[edge]
    passed[last] += total[loop[last]]
    halves = _pairs(
        point,
        point[following],
        sheet + passed - sheet[following],
        np.full(k, ALONG),
        np.full(k, BACK),
        np.full(k, -1),
    )
    return replace(halves, outer=np.repeat([False, True], k))


def _join(parts: list[_HalfEdges]) -> _HalfEdges:
    sizes = np.cumsum([0] + [len(p.tail) for p in parts])
    fields = {k: np.concatenate([vars(p)[k] for p in parts]) for k in vars(parts[0]) if k != "twin"}
    return _HalfEdges(**fields, twin=np.concatenate([p.twin + s for p, s in zip(parts, sizes, strict=False)]))


def _together(
    corner: Ints, turns: Ints, direction: Ints, cut: _Faces, edges: _HalfEdges, links: Links, layout: Layout
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
