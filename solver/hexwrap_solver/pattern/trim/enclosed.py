"""Boundary loops that no edge of the pattern meets: each lies inside one cell, as a hole in it."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Ints
from hexwrap_solver.geometry import linked
from hexwrap_solver.pattern.lattice import Lattice
from hexwrap_solver.pattern.lay.edges import PatternEdges
from hexwrap_solver.pattern.lay.layout import Layout
from hexwrap_solver.pattern.lay.nodes import Nodes
from hexwrap_solver.pattern.lay.trace import trace
from hexwrap_solver.pattern.trim.boundary import Boundary


def met_by_pattern(layout: Layout, nodes: Nodes, edges: PatternEdges, boundary: Boundary) -> Bools:
    """(loops,) whether a node lies on a loop, or an edge from a node ends there."""
    met = np.zeros(int(boundary.loop.max(initial=-1)) + 1, dtype=bool)
    exits = edges.exits[(edges.exits >= 0) & (edges.head < 0)]
    at = boundary.number[exits // 3, exits % 3]
    met[boundary.loop[at[at >= 0]]] = True
    if not met.all():
        incidence, c = np.nonzero(nodes.near_edges(layout, layout.tolerance))
        at = boundary.number[nodes.face[incidence], c]
        met[boundary.loop[at[at >= 0]]] = True
    return met


def around_enclosed(
    layout: Layout, boundary: Boundary, nodes: Nodes, edges: PatternEdges, met: Bools
) -> Ints:
    """Numbers of pattern edges with the cell on their left that holds a loop not met.

    From a place of the loop, the straight line to the nearest lattice node stays inside the cell of the
    tiling that holds the place. It ends at that node, a corner of the cell, or at another loop, which then
    lies in the same cell.
    """
    lattice, loops = layout.lattice, len(met)
    edge = np.flatnonzero(~met[boundary.loop])
    if not len(edge):
        return np.zeros(0, dtype=np.int64)
    edge = np.concatenate([edge, edge])
    t = np.repeat([0.0, 0.5], len(edge) // 2)
    place = boundary.tail[edge] + t * (boundary.head - boundary.tail)[edge]
    found = trace(layout, boundary.face[edge], place, nearest_node(lattice, place))
    arrival = nodes.find(found.face, found.target)
    arrived = (found.exit < 0) & (arrival >= 0)
    stopped = found.exit >= 0
    hit = boundary.loop[boundary.number[found.face[stopped], found.exit[stopped]]]
    mine = boundary.loop[edge]
    _, group = linked(mine[stopped], hit, loops)
    near = lattice.carry(lattice.invert(found.isometry), place)[arrived]
    arrival, mine = arrival[arrived], mine[arrived]
    heading = np.angle(near - lattice.stand(found.target[arrived]))
    heading = heading + lattice.step_angle * nodes.isometry[arrival, 0] - np.angle(lattice.headings[0])
    node = nodes.node[arrival]
    slot = edges.slot_before(node, heading / (2 * np.pi) * lattice.directions)
    _, once = np.unique(group[mine], return_index=True)
    return edges.number(node[once], slot[once])


def nearest_node(lattice: Lattice, place: Complexes) -> Ints:
    """(k, 2) the node of the tiling nearest to each place."""
    start = np.floor(lattice.coordinates(place)).astype(np.int64)
    largest = max(float(abs(outline - outline.mean()).max()) for outline in lattice.outlines.values())
    far = int(np.ceil(largest * lattice.edge / lattice.unit.imag))
    window = np.arange(-far, far + 2)
    near = start[:, None] + np.stack(np.meshgrid(window, window), axis=-1).reshape(-1, 2)
    distance = abs(lattice.stand(near) - place[:, None])
    distance[~lattice.is_node(near)] = np.inf
    return np.asarray(np.take_along_axis(near, distance.argmin(axis=1)[:, None, None], axis=1)[:, 0])
