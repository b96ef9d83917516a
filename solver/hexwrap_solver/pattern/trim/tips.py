"""Where a fold ends inside the surface, on a line of the pattern that runs along it.

Cut open there, the domain has the fold twice, and both sides meet at its tip. An edge of the pattern that
passes the tip would run along both, and is found from both:

                   left
        ═══════════════•─────────── ahead      The one that is ahead of the tip ends there, as at any other
                   right                       boundary; along the fold the boundary itself takes its place.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Ints
from hexwrap_solver.pattern.lay.edges import PatternEdges
from hexwrap_solver.pattern.lay.layout import Layout
from hexwrap_solver.pattern.lay.nodes import Nodes
from hexwrap_solver.pattern.lay.trace import trace
from hexwrap_solver.pattern.trim.boundary import Boundary


@dataclass(frozen=True)
class Tips:
    """Ends of folds that lie on edges of the pattern along them. edge: (t,) of the boundary, away from the
    tip, and before: (t,) the one to it, on the other side. start: (t, 2) the node ahead, or at the tip, in
    the coordinates of the face of ``edge``; way: (t,) direction of the pattern edge from there."""

    edge: Ints
    before: Ints
    start: Ints
    way: Ints
    place: Complexes
    at_node: Bools


def tips_of(layout: Layout, boundary: Boundary) -> Tips:
    lattice, near = layout.lattice, 4 * layout.tolerance
    before = np.argsort(boundary.following)
    half_edge = 3 * boundary.face + boundary.edge
    edge = np.flatnonzero((boundary.surface_loop < 0) & (layout.twin[half_edge] == half_edge[before]))
    place, along = boundary.tail[edge], (boundary.head - boundary.tail)[edge]
    # Nodes about each tip, with the edges that leave them.
    margin = int(np.ceil(lattice.edge / lattice.unit.imag + lattice.largest_offset)) + 2
    window = np.stack(np.meshgrid(np.arange(-margin, margin + 1), np.arange(-margin, margin + 1)), axis=-1)
    start = np.rint(lattice.coordinates(place)).astype(np.int64)[:, None] + window.reshape(-1, 2)
    ways = np.where(lattice.is_node(start)[..., None], lattice.ways[lattice.residue(start)], -1)
    tip, which, slot = np.nonzero(ways >= 0)
    start, way = start[tip, which], ways[tip, which, slot]
    heading = lattice.headings[way]
    off = (place[tip] - lattice.stand(start)) * heading.conj()
    beside = along[tip] * heading.conj()
    length = abs(along[tip])
    on = (abs(off.imag) <= near) & (off.real >= -near) & (off.real < lattice.edge - near)
    on &= (beside.real > 0) & (abs(beside.imag) / length * np.minimum(length, lattice.edge) <= near)
    tip, start, way, off = tip[on], start[on], way[on], off[on]
    return Tips(edge[tip], before[edge[tip]], start, way, place[tip], off.real <= near)


def ending_at_tips(layout: Layout, nodes: Nodes, edges: PatternEdges, boundary: Boundary) -> PatternEdges:
    """Pattern edges none of which passes the tip of a fold along it."""
    tips = tips_of(layout, boundary)
    if not len(tips.edge):
        return edges
    lattice = layout.lattice
    head, exits = edges.head.copy(), edges.exits.copy()
    end = tips.start + lattice.steps[tips.way]
    over = boundary.step[tips.before]
    back = (tips.way + lattice.directions // 2) % lattice.directions
    sides = (
        (tips.edge, tips.place, end, back),
        (
            tips.before,
            lattice.carry(over, tips.place),
            lattice.apply(over, end),
            (back + over[:, 0] * lattice.steps_per_turn) % lattice.directions,
        ),
    )
    seen = [
        _node_at(layout, nodes, edges, boundary.face[edge], place, end, back)
        for edge, place, end, back in sides
    ]
    apart = seen[0][0] != seen[1][0]  # otherwise the fold is shorter than the edge, and has a tip there, too
    for node, slot, _ in seen:
        there = (node >= 0) & (slot >= 0) & apart
        head[node[there], slot[there]] = exits[node[there], slot[there]] = -1
    face = boundary.face[tips.edge]
    node, slot, isometry = _node_at(layout, nodes, edges, face, tips.place, tips.start, tips.way)
    there = (node >= 0) & (slot >= 0)
    node, slot, isometry = node[there], slot[there], isometry[there]
    ends = ~tips.at_node[there]
    head[node, slot] = -1
    exits[node, slot] = np.where(ends, (3 * face + boundary.edge[tips.edge])[there], -1)
    gluing = edges.gluing.copy()
    gluing[node, slot] = len(edges.isometries) + np.arange(len(node))
    return replace(
        edges,
        head=head,
        exits=exits,
        gluing=gluing,
        isometries=np.concatenate([edges.isometries, isometry]),
    )


def _node_at(
    layout: Layout, nodes: Nodes, edges: PatternEdges, face: Ints, place: Complexes, point: Ints, way: Ints
) -> tuple[Ints, Ints, Ints]:
    """The node that a straight line from a place in a face comes to, −1 where the boundary is nearer; its
    slot in a direction, −1: none; and (t, 4) the isometries from the face's coordinates to its own. point,
    way: in the face's coordinates."""
    lattice = layout.lattice
    found = trace(layout, face, place, point)
    arrival = np.where(found.exit < 0, nodes.find(found.face, found.target), -1)
    node = np.where(arrival >= 0, nodes.node[arrival], -1)
    isometry = lattice.compose(nodes.isometry[arrival], lattice.invert(found.isometry))
    own = (way + isometry[:, 0] * lattice.steps_per_turn) % lattice.directions
    same = (edges.way[node] >= 0) & (edges.way[node] % lattice.directions == own[:, None])
    slot = np.where(same.any(axis=1), same.argmax(axis=1), -1)
    return node, slot, isometry
