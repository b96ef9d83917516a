"""Edges of the pattern between nodes, found by walking along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Ints
from hexwrap_solver.domain.locate import runs
from hexwrap_solver.pattern.lay.nodes import Layout, Nodes, edge_distances
from hexwrap_solver.pattern.lay.trace import walk


@dataclass(frozen=True)
class Links:
    """Directed edges of the pattern: from each node in each direction of the lattice.

    head: (n, order) the node at the other end, −1 where there is none. turns: (n, order) the sheet of the
    head's own coordinates, seen from the tail's. exits: (n, order) 3·face + edge of the boundary edge at
    which the edge leaves the domain, −1 elsewhere; turns is the sheet of that face then.
    """

    head: Ints
    turns: Ints
    exits: Ints


def link_nodes(layout: Layout, nodes: Nodes) -> Links:
    """Walk along every edge once, from one of its ends."""
    lattice, order = layout.lattice, layout.lattice.order
    head = np.full((nodes.n, order), -1, dtype=np.int64)
    turns = np.zeros((nodes.n, order), dtype=np.int64)
    exits = np.full((nodes.n, order), -1, dtype=np.int64)
    links = Links(head, turns, exits)
    has_edge = lattice.has_edge(nodes.point[nodes.own][:, None], np.arange(order))
    half = lattice.has_edge(nodes.point[nodes.own][:, None], np.zeros(1, dtype=np.int64)) & has_edge
    if lattice.kind != "hex":
        half[:, order // 2 :] = False
    _follow(layout, nodes, links, *np.nonzero(half))
    # Edges whose two ends both, or neither, count as the first one because a sheet lies between them.
    _follow(layout, nodes, links, *np.nonzero(has_edge & (head < 0) & (exits < 0)))
    return links


def _follow(layout: Layout, nodes: Nodes, links: Links, node: Ints, direction: Ints) -> None:
    """Walk from nodes in directions, and enter what was found at both ends."""
    lattice, motion, order = layout.lattice, layout.motion, layout.lattice.order
    seen, way, blocked = _departure(layout, nodes, node, direction)
    start = nodes.point[seen]
    found = walk(layout, nodes.face[seen], start, start + lattice.steps[way])
    arrival = nodes.find(found.face, found.target)
    arrived = (found.exit < 0) & ~blocked & (arrival >= 0)
    out = np.flatnonzero(~arrived)
    links.turns[node[out], direction[out]] = nodes.turns[seen[out]] + found.sheet[out]
    links.exits[node[out], direction[out]] = 3 * found.face[out] + np.maximum(found.exit[out], 0)
    node, direction, seen, arrival = node[arrived], direction[arrived], seen[arrived], arrival[arrived]
    turns = nodes.turns[seen] + found.sheet[arrived] - nodes.turns[arrival]
    head = nodes.node[arrival]
    links.head[node, direction] = head
    links.turns[node, direction] = turns
    back = (direction - motion.rotation(turns) + order // 2) % order
    links.head[head, back] = node
    links.turns[head, back] = -turns


def _departure(layout: Layout, nodes: Nodes, node: Ints, direction: Ints) -> tuple[Ints, Ints, Bools]:
    """The sighting from which a walk starts into its triangle, the direction there, and whether it leads
    straight out of the domain."""
    seen, way = nodes.own[node], direction.copy()
    blocked = np.zeros(len(node), dtype=bool)
    several = np.flatnonzero(np.diff(nodes.starts)[node] > 1)
    if len(several):
        best = _best_sighting(layout, nodes, node[several], direction[several])
        seen[several], way[several], blocked[several] = best
    return seen, way, blocked


def _best_sighting(layout: Layout, nodes: Nodes, node: Ints, direction: Ints) -> tuple[Ints, Ints, Bools]:
    """For nodes on edges or vertices: the triangle into which a direction leads."""
    lattice, motion, order = layout.lattice, layout.motion, layout.lattice.order
    count = np.diff(nodes.starts)[node]
    walker, step = runs(count)
    seen = nodes.sighting[nodes.starts[node[walker]] + step]
    way = (direction[walker] - motion.rotation(nodes.turns[seen])) % order
    corners = layout.corners[nodes.face[seen]]
    along = np.roll(corners, -1, axis=1) - corners
    inward = 1j * along / np.maximum(abs(along), 1e-300)
    heading = (lattice.position(lattice.steps[way]) / lattice.edge)[:, None]
    into = heading.real * inward.real + heading.imag * inward.imag
    at_edge = abs(edge_distances(corners, lattice.position(nodes.point[seen]))) <= 4 * layout.reach
    score = np.where(at_edge, into, 1.0).min(axis=1)
    best = np.lexsort((-score, walker))[np.cumsum(count) - count]
    outward = at_edge & (into < -1e-6) & (layout.cover.across[nodes.face[seen]] < 0)
    return seen[best], way[best], outward[best].any(axis=1)
