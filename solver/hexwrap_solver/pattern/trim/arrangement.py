"""The arrangement of links and boundary near the boundary, as half-edges between points of both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern.lay.cells import reverse_links
from hexwrap_solver.pattern.lay.edges import Links
from hexwrap_solver.pattern.lay.nodes import Layout, Nodes
from hexwrap_solver.pattern.trim.boundary import (
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

#: Order of half-edges around a point on the boundary: along it, then into the domain by angle, then back.
ALONG, BACK = -1.0, 100.0


@dataclass(frozen=True)
class Points:
    """Points of the arrangement: nodes first. face: triangle of the map; place: complex in its coordinates,
    which are the point's own. straight: (p,) no node, and on the boundary where that does not turn."""

    face: Ints
    place: Complexes
    straight: Bools


@dataclass(frozen=True)
class HalfEdges:
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

    def without(self, gone: Bools) -> HalfEdges:
        keep = ~gone
        renumber = np.where(keep, np.cumsum(keep) - 1, -1)
        part = {k: v[keep] for k, v in vars(self).items() if k != "twin"}
        return HalfEdges(**part, twin=renumber[self.twin[keep]])

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


def arrangement(
    cmap: ConformalMap, layout: Layout, nodes: Nodes, links: Links, used: Bools
) -> tuple[Points, HalfEdges]:
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


def _among_nodes(layout: Layout, links: Links, near: Bools, key: Floats) -> HalfEdges:
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
    return HalfEdges(tail, links.head[tail, way], links.turns[tail, way], key[tail, way], twin, outer, slot)


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


def _pairs(tail: Ints, head: Ints, sheet: Ints, key: Floats, back_key: Floats, name: Ints) -> HalfEdges:
    """Edges as two half-edges each."""
    k = len(tail)
    number = np.arange(k)
    return HalfEdges(
        np.concatenate([tail, head]),
        np.concatenate([head, tail]),
        np.concatenate([sheet, -sheet]),
        np.concatenate([key, back_key]),
        np.concatenate([number + k, number]),
        np.zeros(2 * k, dtype=bool),
        np.concatenate([name, np.full(k, -1)]),
    )


def _along_rim(rim: Rim, on_rim: RimPoints) -> HalfEdges:
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


def _join(parts: list[HalfEdges]) -> HalfEdges:
    sizes = np.cumsum([0] + [len(p.tail) for p in parts])
    fields = {k: np.concatenate([vars(p)[k] for p in parts]) for k in vars(parts[0]) if k != "twin"}
    return HalfEdges(**fields, twin=np.concatenate([p.twin + s for p, s in zip(parts, sizes, strict=False)]))
