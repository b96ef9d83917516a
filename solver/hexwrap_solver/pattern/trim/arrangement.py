"""The arrangement of pattern edges and boundary near the boundary, as half-edges between points of both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, positions
from hexwrap_solver.pattern.lay.edges import PatternEdges
from hexwrap_solver.pattern.lay.layout import Layout
from hexwrap_solver.pattern.lay.nodes import Nodes
from hexwrap_solver.pattern.trim.boundary import (
    Boundary,
    BoundaryPoints,
    Chords,
    Exits,
    chords,
    corners_of_boundary,
    exits_of,
    nodes_on_boundary,
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
    """tail, head: points. isometry: (h, 4) from the head's own coordinates to the tail's. key: order around
    the tail. twin: the same edge the other way. outer: runs along the boundary outside of the domain. name:
    number of a pattern edge from a node, −1 for others. on_boundary: of the surface."""

    tail: Ints
    head: Ints
    isometry: Ints
    key: Floats
    twin: Ints
    outer: Bools
    name: Ints
    on_boundary: Bools

    def without(self, gone: Bools) -> HalfEdges:
        keep = ~gone
        renumber = positions(np.flatnonzero(keep), len(keep))
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
    layout: Layout, boundary: Boundary, nodes: Nodes, edges: PatternEdges, used: Bools
) -> tuple[Points, HalfEdges, BoundaryPoints]:
    """Points and half-edges near the boundary, everything that does not bound a whole cell; and the points
    that lie on it."""
    lattice = layout.lattice
    leaving, chord = exits_of(layout, nodes, edges, boundary), chords(layout, boundary)
    at_node = nodes_on_boundary(layout, nodes, boundary)
    on_boundary, new = _points_on_boundary(layout, boundary, nodes.n, at_node, leaving, chord)
    turns = corners_of_boundary(layout, boundary)
    points = Points(
        np.concatenate([nodes.face[nodes.own], boundary.face[new.edge]]),
        np.concatenate([lattice.stand(nodes.point[nodes.own]), new.places(boundary)]),
        np.concatenate([np.zeros(nodes.n, dtype=bool), (new.t > 0) | ~turns[new.edge]]),
    )
    key = _keys(layout, boundary, at_node, edges)
    near = np.zeros(nodes.n, dtype=bool)
    near[np.flatnonzero((edges.head.ravel() >= 0) & ~used) // edges.width] = True
    near[leaving.node] = True
    near[at_node.point] = True
    end = nodes.n + np.arange(len(leaving.node))
    name = edges.number(leaving.node, leaving.slot)
    out_key, no_key = key[leaving.node, leaving.slot], np.zeros(len(end))
    start = nodes.n + len(end) + np.arange(len(chord.edge))
    middle = np.zeros(len(start))
    unnamed = np.full(len(start), -1)
    halves = _join(
        [
            _among_nodes(edges, near, key),
            _pairs(layout, leaving.node, end, leaving.isometry, out_key, no_key, name),
            _pairs(layout, start, start + len(start), chord.isometry, middle, middle, unnamed),
            _along_boundary(layout, boundary, on_boundary),
        ]
    )
    return points, halves, on_boundary


def _points_on_boundary(
    layout: Layout, boundary: Boundary, n: int, at_node: BoundaryPoints, leaving: Exits, chord: Chords
) -> tuple[BoundaryPoints, BoundaryPoints]:
    """All points on the boundary, and those of them that are not nodes, numbered from n on."""
    edge = np.concatenate([leaving.edge, chord.edge, chord.end_edge])
    t = np.concatenate([leaving.t, chord.t, chord.end_t])
    taken = np.zeros(len(boundary.face), dtype=bool)
    taken[np.concatenate([at_node.edge[at_node.t == 0], edge[t == 0]])] = True
    bends = np.flatnonzero(corners_of_boundary(layout, boundary) & ~taken)
    edge, t = np.concatenate([edge, bends]), np.concatenate([t, np.zeros(len(bends))])
    none = np.zeros((len(edge), 4), dtype=np.int64)
    angle = np.concatenate([leaving.angle, chord.angle, chord.end_angle, np.zeros(len(bends))])
    new = BoundaryPoints(n + np.arange(len(edge)), edge, t, none, angle)
    return BoundaryPoints(
        np.concatenate([at_node.point, new.point]),
        np.concatenate([at_node.edge, new.edge]),
        np.concatenate([at_node.t, new.t]),
        np.concatenate([at_node.isometry, new.isometry]),
        np.concatenate([at_node.angle, new.angle]),
    ), new


def _among_nodes(edges: PatternEdges, near: Bools, key: Floats) -> HalfEdges:
    """Pattern edges between nodes near the boundary. Those to other nodes have whole cells on both sides."""
    number = np.flatnonzero((edges.head >= 0).ravel() & np.repeat(near, edges.width))
    tail, slot = number // edges.width, number % edges.width
    kept = near[edges.head[tail, slot]]
    number, tail, slot = number[kept], tail[kept], slot[kept]
    position = positions(number, edges.head.size)
    twin = position[edges.back[tail, slot]]
    no = np.zeros(len(number), dtype=bool)
    isometry = edges.isometry(tail, slot)
    return HalfEdges(tail, edges.head[tail, slot], isometry, key[tail, slot], twin, no, number, no)


def _keys(layout: Layout, boundary: Boundary, at_node: BoundaryPoints, edges: PatternEdges) -> Floats:
    """(n, width) order of edges around each node; on the boundary counted from the boundary's direction."""
    key = np.tile(np.arange(edges.width, dtype=float), (len(edges.head), 1))
    along = (boundary.head - boundary.tail)[at_node.edge]
    along = along * np.exp(1j * layout.lattice.step_angle * at_node.isometry[:, 0])
    heading = layout.lattice.headings[edges.way[at_node.point]]
    angle = np.mod(np.angle(heading / along[:, None]), 2 * np.pi)
    key[at_node.point] = np.where(angle > 2 * np.pi - 1e-6, 0.0, angle)
    return key


def _pairs(
    layout: Layout, tail: Ints, head: Ints, isometry: Ints, key: Floats, back_key: Floats, name: Ints
) -> HalfEdges:
    """Edges as two half-edges each."""
    k = len(tail)
    number = np.arange(k)
    return HalfEdges(
        np.concatenate([tail, head]),
        np.concatenate([head, tail]),
        np.concatenate([isometry, layout.lattice.invert(isometry)]),
        np.concatenate([key, back_key]),
        np.concatenate([number + k, number]),
        np.zeros(2 * k, dtype=bool),
        np.concatenate([name, np.full(k, -1)]),
        np.zeros(2 * k, dtype=bool),
    )


def _along_boundary(layout: Layout, boundary: Boundary, on: BoundaryPoints) -> HalfEdges:
    """The boundary between successive points, inside and outside."""
    lattice = layout.lattice
    order = np.lexsort((-on.angle, on.t, on.edge))  # of lines that meet at a vertex, those from behind first
    point, edge, isometry = on.point[order], on.edge[order], on.isometry[order]
    loop = boundary.loop[edge]
    k = len(order)
    following = np.arange(1, k + 1)
    first = np.unique(loop, return_index=True)[1]
    last = np.append(first[1:], k)[: len(first)] - 1
    following[last] = first
    # What is passed from edge to edge, as a quotient of products from the very first edge on; the last point
    # of a loop is followed by the first one, once around.
    upto = lattice.partial_products(boundary.step)
    passed = lattice.compose(lattice.invert(upto[edge]), upto[edge[following]])
    begin = np.searchsorted(boundary.loop, loop[last], side="left")
    end = np.searchsorted(boundary.loop, loop[last], side="right")
    around = lattice.compose(upto[end], lattice.invert(upto[begin]))
    passed[last] = lattice.compose(
        lattice.invert(upto[edge[last]]), lattice.compose(around, upto[edge[first]])
    )
    halves = _pairs(
        layout,
        point,
        point[following],
        lattice.compose(isometry, lattice.compose(passed, lattice.invert(isometry[following]))),
        np.full(k, ALONG),
        np.full(k, BACK),
        np.full(k, -1),
    )
    return replace(
        halves, outer=np.repeat([False, True], k), on_boundary=np.tile(boundary.surface_loop[edge] >= 0, 2)
    )


def _join(parts: list[HalfEdges]) -> HalfEdges:
    sizes = np.cumsum([0] + [len(p.tail) for p in parts])
    fields = {k: np.concatenate([vars(p)[k] for p in parts]) for k in vars(parts[0]) if k != "twin"}
    return HalfEdges(**fields, twin=np.concatenate([p.twin + s for p, s in zip(parts, sizes, strict=False)]))
