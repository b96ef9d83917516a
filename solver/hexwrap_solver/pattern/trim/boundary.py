"""The boundary loops of the domain, and the points of the pattern that lie on them.

Where the surface is folded, the domain is cut open along the folds: these are boundary, too, with an edge on
either side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, runs
from hexwrap_solver.geometry import orbits
from hexwrap_solver.pattern.lay.edges import PatternEdges
from hexwrap_solver.pattern.lay.layout import Layout
from hexwrap_solver.pattern.lay.nodes import Nodes
from hexwrap_solver.pattern.lay.trace import trace
from hexwrap_solver.surface.types import Surface

#: A boundary vertex at which the boundary turns by less (radians) is not a corner of a cut cell.
STRAIGHT = 1e-7


@dataclass(frozen=True)
class Boundary:
    """Boundary edges, loop after loop in their order, the domain on the left.

    face, edge: (b,) where each lies. number: (m, 3) the boundary edge at a face's edge, −1 inside.
    loop: (b,) number of its loop. surface_loop: (b,) that of the surface, −1 along a fold. following: (b,)
    the next boundary edge. step: (b, 4) isometry from the coordinates of the next edge's face to those
    of this one's. tail, head: (b,) complex, in the face's coordinates.
    """

    face: Ints
    edge: Ints
    number: Ints
    loop: Ints
    surface_loop: Ints
    following: Ints
    step: Ints
    tail: Complexes
    head: Complexes


def boundary_of(surface: Surface, layout: Layout) -> Boundary:
    """The boundary of the layout of a surface; along folds, where the layout is cut open, of both sides.

    Loops begin, and are sorted, as those of the surface; loops of folds alone come last.
    """
    faces, m = surface.faces, len(surface.faces)
    face, edge = np.nonzero(layout.across < 0)
    b = len(face)
    number = np.full(3 * m, -1, dtype=np.int64)
    number[3 * face + edge] = np.arange(b)
    inner = surface.twin[3 * face + edge] >= 0
    place = np.full(len(surface.vertices), -1, dtype=np.int64)
    of_vertex = np.zeros(len(surface.vertices), dtype=np.int64)
    place[surface.boundary] = np.arange(len(surface.boundary))
    of_vertex[surface.boundary] = np.repeat(
        np.arange(len(surface.loops)), [len(loop) for loop in surface.loops]
    )
    tail = faces[face, edge]
    step, reached = _around_heads(layout, face, edge)
    following = number[reached]
    order, loop = _in_cycles(following, np.where(inner, len(place) + np.arange(b), place[tail]))
    renumber = np.argsort(order)
    face, edge = face[order], edge[order]
    number = np.full(faces.shape, -1, dtype=np.int64)
    number[face, edge] = np.arange(b)
    return Boundary(
        face,
        edge,
        number,
        loop,
        np.where(inner, -1, of_vertex[tail])[order],
        renumber[following[order]],
        step[order],
        layout.corners[face, edge],
        layout.corners[face, (edge + 1) % 3],
    )


def _in_cycles(following: Ints, priority: Ints) -> tuple[Ints, Ints]:
    """Order of the elements of a permutation, cycle after cycle, each from its element of least priority on
    and sorted by that; and (b,) which cycle each element then is of."""
    cycle, n = orbits(following)
    least = np.full(n, np.iinfo(np.int64).max)
    np.minimum.at(least, cycle, priority)
    first = priority == least[cycle]
    # Steps back to the first element, by pointers that reach twice as far in each round.
    before = np.argsort(following)
    before[first] = np.flatnonzero(first)
    steps = (~first).astype(np.int64)
    while not first[before].all():
        steps, before = steps + steps[before], before[before]
    order = np.lexsort((steps, least[cycle]))
    return order, np.unique(least[cycle][order], return_inverse=True)[1]


def _around_heads(layout: Layout, face: Ints, edge: Ints) -> tuple[Ints, Ints]:
    """(b, 4) the isometries met on the way from each boundary edge around its head to the next one, and (b,)
    that one, as 3·face + edge."""
    step = np.zeros((len(face), 4), dtype=np.int64)
    at = 3 * face + (edge + 1) % 3
    turning = np.arange(len(face))
    while len(turning):
        inner = layout.across.ravel()[at[turning]] >= 0
        turning = turning[inner]
        crossing = layout.crossing.ravel()[at[turning]]
        glued = turning[crossing != 0]
        step[glued] = layout.lattice.compose(step[glued], layout.isometries[crossing[crossing != 0]])
        beyond = layout.twin[at[turning]]
        at[turning] = beyond - beyond % 3 + (beyond + 1) % 3
    return step, at


@dataclass(frozen=True)
class BoundaryPoints:
    """Points of the pattern on the boundary, in their order along it.

    point: (k,) number. edge, t: (k,) boundary edge and place on it, 0 ≤ t < 1. isometry: (k, 4)
    from the coordinates of that edge's face to the point's own. angle: (k,) from the edge to what comes
    there, in which order points at one vertex stand; radians.
    """

    point: Ints
    edge: Ints
    t: Floats
    isometry: Ints
    angle: Floats

    def places(self, boundary: Boundary) -> Complexes:
        """In the coordinates of the edge's face."""
        return np.asarray(boundary.tail[self.edge] + self.t * (boundary.head - boundary.tail)[self.edge])


def snap(
    layout: Layout, boundary: Boundary, edge: Ints, t: Floats, isometry: Ints, distance: float
) -> tuple[Ints, Floats, Ints]:
    """Points within a distance of a boundary vertex are put there, at the start of the edge that follows.

    isometry: (k, 4) from the coordinates of the edge's face to any; given back for the edge put."""
    length = abs(boundary.head - boundary.tail)[edge]
    t = np.where(t * length <= distance, 0.0, t)
    at_end = (1 - t) * length <= distance
    moved = layout.lattice.compose(isometry[at_end], boundary.step[edge[at_end]])
    isometry = isometry.copy()
    isometry[at_end] = moved
    return np.where(at_end, boundary.following[edge], edge), np.where(at_end, 0.0, t), isometry


def nodes_on_boundary(layout: Layout, nodes: Nodes, boundary: Boundary) -> BoundaryPoints:
    """Nodes that lie on the boundary, each at one place of it."""
    near = nodes.near_edges(layout, layout.tolerance) & (boundary.number[nodes.face] >= 0)
    incidence, c = np.nonzero(near)
    edge = boundary.number[nodes.face[incidence], c]
    along = (boundary.head - boundary.tail)[edge]
    offset = layout.lattice.position(nodes.point[incidence]) - boundary.tail[edge]
    t = np.clip((offset * along.conj()).real / abs(along) ** 2, 0, 1)
    own = nodes.isometry[incidence]
    edge, t, isometry = snap(layout, boundary, edge, t, own, 4 * layout.tolerance)
    node, first = np.unique(nodes.node[incidence], return_index=True)
    return BoundaryPoints(node, edge[first], t[first], isometry[first], np.zeros(len(node)))


def corners_of_boundary(layout: Layout, boundary: Boundary) -> Bools:
    """(b,) whether the boundary turns at the tail of each boundary edge."""
    along = boundary.head - boundary.tail
    turned = along[boundary.following] * np.exp(
        1j * layout.lattice.step_angle * boundary.step[:, 0]
    )  # the next edge in this one's coordinates
    bend = np.zeros(len(along), dtype=bool)
    bend[boundary.following] = abs(np.angle(turned / along)) > STRAIGHT
    return bend


@dataclass(frozen=True)
class Exits:
    """Edges of the pattern that leave the domain: from a node by a slot to a place (edge, t) on the
    boundary. isometry: (k, 4) from the coordinates of the face there to the node's own. angle: (k,) there,
    back to the node."""

    node: Ints
    slot: Ints
    edge: Ints
    t: Floats
    isometry: Ints
    angle: Floats


def exits_of(layout: Layout, nodes: Nodes, edges: PatternEdges, boundary: Boundary) -> Exits:
    """Where edges that start at a node inside meet the boundary."""
    lattice = layout.lattice
    node, slot = np.nonzero((edges.exits >= 0) & (edges.head < 0))
    exits, isometry = edges.exits[node, slot], edges.isometry(node, slot)
    edge = boundary.number[exits // 3, exits % 3]
    own, into = nodes.point[nodes.own[node]], lattice.invert(isometry)
    start = lattice.stand(lattice.apply(into, own))
    way = edges.way[node, slot] - isometry[:, 0] * lattice.steps_per_turn
    heading = lattice.edge * lattice.headings[way % lattice.directions]
    t = _meeting(boundary, edge, start, heading)
    t = np.where(_is_ahead(boundary, edge, start, heading, 4 * layout.tolerance), 0.0, t)
    away = abs(boundary.tail[edge] + t * (boundary.head - boundary.tail)[edge] - start)
    kept = (edge >= 0) & (away > 16 * layout.tolerance)
    place = snap(layout, boundary, edge[kept], t[kept], isometry[kept], 4 * layout.tolerance)
    way = edges.way[node, slot][kept] + lattice.directions // 2
    return Exits(node[kept], slot[kept], *place, _angle(layout, boundary, place[0], way, place[2]))


def _angle(layout: Layout, boundary: Boundary, edge: Ints, way: Ints, isometry: Ints) -> Floats:
    """(k,) from boundary edges to directions into the domain. isometry: (k, 4) from the coordinates of the
    edge's face to those of the direction."""
    lattice = layout.lattice
    way = (way - isometry[:, 0] * lattice.steps_per_turn) % lattice.directions
    along = (boundary.head - boundary.tail)[edge]
    return np.asarray(np.mod(np.angle(lattice.headings[way] / along), 2 * np.pi))


def _is_ahead(boundary: Boundary, edge: Ints, start: Complexes, heading: Complexes, near: float) -> Bools:
    """(k,) whether lines meet a boundary edge that runs on along them: at its tail."""
    unit = heading / abs(heading)
    tail, head = ((p[edge] - start) * unit.conj() for p in (boundary.tail, boundary.head))
    return np.asarray((abs(tail.imag) <= near) & (abs(head.imag) <= near) & (head.real > tail.real))


def _meeting(boundary: Boundary, edge: Ints, start: Complexes, heading: Complexes) -> Floats:
    """(k,) where lines from a start along a heading meet boundary edges, as a part of the edge, in 0 … 1.

    start + s·heading = tail + t·along; the cross product with the heading leaves t alone."""
    along = (boundary.head - boundary.tail)[edge]
    offset = start - boundary.tail[edge]
    cross = along.real * heading.imag - along.imag * heading.real
    t = (offset.real * heading.imag - offset.imag * heading.real) / np.where(cross == 0, 1.0, cross)
    return np.asarray(np.clip(t, 0, 1))


@dataclass(frozen=True)
class Chords:
    """Pieces of pattern edges whose both ends lie outside: from (edge, t) to (end_edge, end_t). isometry:
    (k, 4) from the coordinates of the end's face to those of the first one's. angle, end_angle: (k,) at
    either end, to the other one."""

    edge: Ints
    t: Floats
    end_edge: Ints
    end_t: Floats
    isometry: Ints
    angle: Floats
    end_angle: Floats


def chords(layout: Layout, boundary: Boundary) -> Chords:
    """Pattern edges that come in through the boundary and go out again without reaching a node."""
    lattice, tolerance = layout.lattice, layout.tolerance
    edge, start, direction = _edges_across(layout, boundary)
    found = trace(layout, boundary.face[edge], lattice.stand(start), start + lattice.steps[direction])
    out = found.exit >= 0
    edge, start, direction = edge[out], start[out], direction[out]
    isometry = found.isometry[out]
    end_edge = boundary.number[found.face[out], found.exit[out]]
    here, way = lattice.stand(start), lattice.edge * lattice.headings[direction]
    t = _meeting(boundary, edge, here, way)
    into = lattice.invert(isometry)
    there = lattice.stand(lattice.apply(into, start))
    way_there = way * lattice.roots_of_unity[into[:, 0]]
    end_t = _meeting(boundary, end_edge, there, way_there)
    came = abs(boundary.tail[edge] + t * (boundary.head - boundary.tail)[edge] - here)
    went = abs(boundary.tail[end_edge] + end_t * (boundary.head - boundary.tail)[end_edge] - there)
    none = np.zeros((len(edge), 4), dtype=np.int64)
    edge, t, first = snap(layout, boundary, edge, t, none, 4 * tolerance)
    end_edge, end_t, isometry = snap(layout, boundary, end_edge, end_t, isometry, 4 * tolerance)
    angle = _angle(layout, boundary, edge, direction, first)
    end_angle = _angle(layout, boundary, end_edge, direction + lattice.directions // 2, isometry)
    isometry = lattice.compose(lattice.invert(first), isometry)
    # Each is found from both of its ends: keep one.
    once = (went - came > 16 * tolerance) & ((edge < end_edge) | ((edge == end_edge) & (t < end_t)))
    found_once = Chords(*(x[once] for x in (edge, t, end_edge, end_t, isometry, angle, end_angle)))
    edge, t, end_edge = found_once.edge, found_once.t, found_once.end_edge
    # One through a boundary vertex is found at both edges that meet there.
    order = np.lexsort((t, end_edge, edge))
    apart = np.diff(t[order]) * abs(boundary.head - boundary.tail)[edge[order[1:]]] > 16 * tolerance
    apart |= (np.diff(edge[order]) != 0) | (np.diff(end_edge[order]) != 0)
    order = order[np.concatenate([[True], apart])] if len(order) else order
    return Chords(**{k: v[order] for k, v in vars(found_once).items()})


def met_by_chords(met: Bools, layout: Layout, boundary: Boundary) -> Bools:
    """(loops,) those met, and those that a pattern edge passes without reaching a node."""
    if met.all():
        return met
    chord = chords(layout, boundary)
    met = met.copy()
    met[boundary.loop[np.concatenate([chord.edge, chord.end_edge])]] = True
    return met


def _edges_across(layout: Layout, boundary: Boundary) -> tuple[Ints, Ints, Ints]:
    """(boundary edge, node outside, direction) of all pattern edges that enter through a boundary edge."""
    lattice = layout.lattice
    ends = lattice.coordinates(np.stack([boundary.tail, boundary.head], axis=1))
    margin = int(np.ceil(lattice.edge)) + 1
    low = np.floor(ends.min(axis=1)).astype(np.int64) - margin
    wide = np.ceil(ends.max(axis=1)).astype(np.int64) + margin - low + 1
    edge, step = runs(wide.prod(axis=1))
    start = low[edge] + np.stack([step % wide[edge, 0], step // wide[edge, 0]], axis=1)
    along = (boundary.head - boundary.tail)[edge]
    along = along / abs(along)
    depth = ((lattice.stand(start) - boundary.tail[edge]) * along.conj()).imag
    near = lattice.is_node(start) & (depth < -layout.tolerance) & (depth > -lattice.edge - layout.tolerance)
    edge, start, depth = edge[near], start[near], depth[near]
    ways = lattice.ways[lattice.residue(start)]
    node, slot = np.nonzero(ways >= 0)
    direction = ways[node, slot]
    edge, start, depth = edge[node], start[node], depth[node]
    heading = lattice.edge * lattice.headings[direction]
    along = (boundary.head - boundary.tail)[edge]
    length = abs(along)
    rise = (heading * along.conj()).imag / length
    crosses = depth + rise > layout.tolerance
    foot = ((lattice.stand(start) - boundary.tail[edge]) * along.conj()).real / length
    at = foot - depth * (heading * along.conj()).real / length / np.where(rise == 0, 1.0, rise)
    crosses &= (at > -4 * layout.tolerance) & (at < length + 4 * layout.tolerance)
    return edge[crosses], start[crosses], direction[crosses]
