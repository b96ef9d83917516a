"""Edges of the pattern, from node to node, found by tracing them through the domain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Ints
from hexwrap_solver.domain.locate import runs
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.lay.layout import Layout
from hexwrap_solver.pattern.lay.nodes import Nodes, edge_distances
from hexwrap_solver.pattern.lay.trace import trace


@dataclass(frozen=True)
class PatternEdges:
    """Directed edges, from each node in each direction of the lattice.

    head: (n, order) the node at the other end, −1 where there is none. exits: (n, order) 3·face + half-edge
    of the boundary edge at which the edge leaves the domain, −1 elsewhere. gluing: (n, order) row in the
    table isometries (g, 4) of what carries the head's own coordinates, or those of the face at the exit, to
    the tail's own; row 0 is the identity.
    """

    head: Ints
    exits: Ints
    gluing: Ints
    isometries: Ints

    def isometry(self, tail: Ints, direction: Ints) -> Ints:
        """(…, 4) see gluing."""
        return self.isometries[self.gluing[tail, direction]]

    def reverse(self, lattice: Lattice, tail: Ints, direction: Ints) -> Ints:
        """Number order·node + direction of the same edge from its other end."""
        order = lattice.order
        turned = self.isometries[:, 0][self.gluing[tail, direction]]
        return np.asarray(self.head[tail, direction] * order + (direction - turned + order // 2) % order)


class _Found:
    """Edges as they are found; what is found last about one holds."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self.head = np.full(shape, -1, dtype=np.int64)
        self.exits = np.full(shape, -1, dtype=np.int64)
        self._row = np.zeros(shape[0] * shape[1], dtype=np.int64)
        self._rows = [np.zeros((1, 4), dtype=np.int64)]
        self._many = 1

    def glue(self, slot: Ints, isometry: Ints) -> None:
        a, b, c, d = isometry.T
        moved = (a | b | c | d) != 0
        self._row[slot] = 0
        self._row[slot[moved]] = self._many + np.arange(np.count_nonzero(moved))
        self._rows.append(isometry[moved])
        self._many += len(self._rows[-1])

    def edges(self) -> PatternEdges:
        different, row = np.unique(np.concatenate(self._rows), axis=0, return_inverse=True)
        row = row.ravel()
        identity = row[0]  # moves to the front
        order = np.concatenate([[identity], np.delete(np.arange(len(different)), identity)])
        gluing = np.argsort(order)[row][self._row].reshape(self.head.shape)
        return PatternEdges(self.head, self.exits, gluing, different[order])


def find_edges(layout: Layout, nodes: Nodes) -> PatternEdges:
    """Trace every edge once, from one of its ends."""
    lattice, order = layout.lattice, layout.lattice.order
    found = _Found((nodes.n, order))
    has_edge = lattice.has_edge(nodes.point[nodes.own][:, None], np.arange(order))
    half = lattice.has_edge(nodes.point[nodes.own][:, None], np.zeros(1, dtype=np.int64)) & has_edge
    if lattice.kind != "hex":
        half[:, order // 2 :] = False
    _follow(layout, nodes, found, *np.nonzero(half))
    # Edges whose two ends both, or neither, count as the first one because a gluing lies between them.
    _follow(layout, nodes, found, *np.nonzero(has_edge & (found.head < 0) & (found.exits < 0)))
    return found.edges()


def _follow(layout: Layout, nodes: Nodes, edges: _Found, node: Ints, direction: Ints) -> None:
    """Trace from nodes in directions, and enter what was found at both ends."""
    lattice, order = layout.lattice, layout.lattice.order
    seen, way, blocked = _departure(layout, nodes, node, direction)
    start = nodes.point[seen]
    found = trace(layout, nodes.face[seen], lattice.position(start), start + lattice.steps[way])
    arrival = nodes.find(found.face, found.target)
    arrived = (found.exit < 0) & ~blocked & (arrival >= 0)
    isometry = lattice.compose(nodes.isometry[seen], found.isometry)
    out = np.flatnonzero(~arrived)
    edges.glue(node[out] * order + direction[out], isometry[out])
    edges.exits[node[out], direction[out]] = 3 * found.face[out] + np.maximum(found.exit[out], 0)
    node, direction, arrival = node[arrived], direction[arrived], arrival[arrived]
    isometry = lattice.compose(isometry[arrived], lattice.invert(nodes.isometry[arrival]))
    head = nodes.node[arrival]
    edges.head[node, direction] = head
    edges.glue(node * order + direction, isometry)
    back = (direction - isometry[:, 0] + order // 2) % order
    edges.head[head, back] = node
    edges.glue(head * order + back, lattice.invert(isometry))


def _departure(layout: Layout, nodes: Nodes, node: Ints, direction: Ints) -> tuple[Ints, Ints, Bools]:
    """The incidence from which an edge starts into its triangle, the direction there, and whether it leads
    straight out of the domain."""
    seen, way = nodes.own[node], direction.copy()
    blocked = np.zeros(len(node), dtype=bool)
    several = np.flatnonzero(np.diff(nodes.starts)[node] > 1)
    if len(several):
        best = _best_incidence(layout, nodes, node[several], direction[several])
        seen[several], way[several], blocked[several] = best
    return seen, way, blocked


def _best_incidence(layout: Layout, nodes: Nodes, node: Ints, direction: Ints) -> tuple[Ints, Ints, Bools]:
    """For nodes on edges or vertices: the triangle into which a direction leads."""
    lattice, order = layout.lattice, layout.lattice.order
    count = np.diff(nodes.starts)[node]
    line, step = runs(count)
    seen = nodes.incidence[nodes.starts[node[line]] + step]
    way = (direction[line] - nodes.isometry[seen, 0]) % order
    corners = layout.corners[nodes.face[seen]]
    along = np.roll(corners, -1, axis=1) - corners
    inward = 1j * along / np.maximum(abs(along), 1e-300)
    heading = (lattice.position(lattice.steps[way]) / lattice.edge)[:, None]
    into = heading.real * inward.real + heading.imag * inward.imag
    at_edge = abs(edge_distances(corners, lattice.position(nodes.point[seen]))) <= 4 * layout.tolerance
    score = np.where(at_edge, into, 1.0).min(axis=1)
    best = np.lexsort((-score, line))[np.cumsum(count) - count]
    outward = at_edge & (into < -1e-6) & (layout.across[nodes.face[seen]] < 0)
    return seen[best], way[best], outward[best].any(axis=1)
