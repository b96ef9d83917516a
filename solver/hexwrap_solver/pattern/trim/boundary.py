"""The boundary loops of the domain, and the points of the pattern that lie on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.locate import runs
from hexwrap_solver.pattern.lay.edges import Links
from hexwrap_solver.pattern.lay.nodes import Layout, Nodes
from hexwrap_solver.pattern.lay.trace import walk

#: A boundary vertex at which the boundary turns by less (radians) is no corner of a cut cell.
STRAIGHT = 1e-7


@dataclass(frozen=True)
class Rim:
    """Boundary edges, loop after loop in their order, the domain on the left.

    face, edge: (b,) where each lies. number: (m, 3) the boundary edge at a face's edge, −1 inside.
    loop: (b,) 0 or 1. following: (b,) the next boundary edge. sheet: (b,) sheet of the next edge's face, seen
    from this one's. tail, head: (b,) complex, in the face's coordinates.
    """

    face: Ints
    edge: Ints
    number: Ints
    loop: Ints
    following: Ints
    sheet: Ints
    tail: Complexes
    head: Complexes


def rim_of(cmap: ConformalMap, layout: Layout) -> Rim:
    """The boundary of the layout."""
    faces = cmap.surface.faces
    face, edge = np.nonzero(layout.cover.across < 0)
    by_tail = np.full(len(cmap.uv), -1, dtype=np.int64)
    by_tail[faces[face, edge]] = np.arange(len(face))
    order = by_tail[np.concatenate(cmap.surface.loops)]
    face, edge = face[order], edge[order]
    lengths = [len(loop) for loop in cmap.surface.loops]
    b = len(face)
    following = np.arange(1, b + 1)
    following[[lengths[0] - 1, b - 1]] = [0, lengths[0]]
    number = np.full(faces.shape, -1, dtype=np.int64)
    number[face, edge] = np.arange(b)
    sheet = cmap.sheet[face, (edge + 1) % 3] - cmap.sheet[face, edge][following]
    tail, head = layout.corners[face, edge], layout.corners[face, (edge + 1) % 3]
    return Rim(face, edge, number, np.repeat([0, 1], lengths), following, sheet, tail, head)


@dataclass(frozen=True)
class RimPoints:
    """Points of the pattern on the boundary, in their order along it.

    point: (k,) number. edge, t: (k,) boundary edge and place on it, 0 ≤ t < 1. sheet: (k,) sheet of that
    edge's face, seen from the point's own coordinates.
    """

    point: Ints
    edge: Ints
    t: Floats
    sheet: Ints

    def places(self, rim: Rim) -> Complexes:
        """In the coordinates of the edge's face."""
        return np.asarray(rim.tail[self.edge] + self.t * (rim.head - rim.tail)[self.edge])


def snap(rim: Rim, edge: Ints, t: Floats, sheet: Ints, reach: float) -> tuple[Ints, Floats, Ints]:
    """Points within reach of a boundary vertex are put there, at the start of the edge that follows."""
    length = abs(rim.head - rim.tail)[edge]
    t = np.where(t * length <= reach, 0.0, t)
    at_end = (1 - t) * length <= reach
    sheet = sheet + np.where(at_end, rim.sheet[edge], 0)
    return np.where(at_end, rim.following[edge], edge), np.where(at_end, 0.0, t), sheet


def nodes_on_rim(layout: Layout, nodes: Nodes, rim: Rim) -> RimPoints:
    """Nodes that lie on the boundary, each at one place of it."""
    near = nodes.near_edges(layout, layout.reach) & (rim.number[nodes.face] >= 0)
    sighting, c = np.nonzero(near)
    edge = rim.number[nodes.face[sighting], c]
    along = (rim.head - rim.tail)[edge]
    offset = layout.lattice.position(nodes.point[sighting]) - rim.tail[edge]
    t = np.clip((offset * along.conj()).real / abs(along) ** 2, 0, 1)
    edge, t, sheet = snap(rim, edge, t, nodes.turns[sighting], 4 * layout.reach)
    node, first = np.unique(nodes.node[sighting], return_index=True)
    return RimPoints(node, edge[first], t[first], sheet[first])


def corners_of_rim(layout: Layout, rim: Rim) -> Bools:
    """(b,) whether the boundary turns at the tail of each boundary edge."""
    along = rim.head - rim.tail
    turned = along[rim.following] * np.exp(
        1j * layout.lattice.quantum * layout.motion.rotation(rim.sheet)
    )  # the next edge in this one's coordinates
    bend = np.zeros(len(along), dtype=bool)
    bend[rim.following] = abs(np.angle(turned / along)) > STRAIGHT
    return bend


@dataclass(frozen=True)
class Crossings:
    """Links that leave the domain: from a node in a direction to a place (edge, t) on the boundary, whose
    face stands on a sheet seen from the node's own coordinates."""

    node: Ints
    direction: Ints
    edge: Ints
    t: Floats
    sheet: Ints


def crossings(layout: Layout, nodes: Nodes, links: Links, rim: Rim) -> Crossings:
    """Where links that start at a node inside meet the boundary."""
    lattice, motion = layout.lattice, layout.motion
    node, direction = np.nonzero((links.exits >= 0) & (links.head < 0))
    exits, sheet = links.exits[node, direction], links.turns[node, direction]
    edge = rim.number[exits // 3, exits % 3]
    own = nodes.point[nodes.own[node]]
    start = lattice.position(motion.apply(own, -sheet))
    heading = lattice.position(motion.apply(own + lattice.steps[direction], -sheet)) - start
    t = _meeting(rim, edge, start, heading)
    away = abs(rim.tail[edge] + t * (rim.head - rim.tail)[edge] - start)
    kept = (edge >= 0) & (away > 16 * layout.reach)
    place = snap(rim, edge[kept], t[kept], sheet[kept], 4 * layout.reach)
    return Crossings(node[kept], direction[kept], *place)


def _meeting(rim: Rim, edge: Ints, start: Complexes, heading: Complexes) -> Floats:
    along = (rim.head - rim.tail)[edge]
    offset = start - rim.tail[edge]
    cross = along.real * heading.imag - along.imag * heading.real
    t = (offset.real * heading.imag - offset.imag * heading.real) / np.where(cross == 0, 1.0, cross)
    return np.asarray(np.clip(t, 0, 1))


@dataclass(frozen=True)
class Chords:
    """Pieces of links whose both ends lie outside: from (edge, t) to (end_edge, end_t), the end's face on a
    sheet seen from the first one's."""

    edge: Ints
    t: Floats
    end_edge: Ints
    end_t: Floats
    sheet: Ints


def chords(layout: Layout, rim: Rim) -> Chords:
    """Links that come in through the boundary and go out again without reaching a node."""
    lattice, motion, reach = layout.lattice, layout.motion, layout.reach
    edge, start, direction = _links_across(layout, rim)
    found = walk(layout, rim.face[edge], start, start + lattice.steps[direction])
    out = found.exit >= 0
    edge, start, direction = edge[out], start[out], direction[out]
    sheet = found.sheet[out]
    end_edge = rim.number[found.face[out], found.exit[out]]
    here, way = lattice.position(start), lattice.position(lattice.steps[direction])
    t = _meeting(rim, edge, here, way)
    there = lattice.position(motion.apply(start, -sheet))
    way_there = lattice.position(motion.apply(start + lattice.steps[direction], -sheet)) - there
    end_t = _meeting(rim, end_edge, there, way_there)
    came = abs(rim.tail[edge] + t * (rim.head - rim.tail)[edge] - here)
    went = abs(rim.tail[end_edge] + end_t * (rim.head - rim.tail)[end_edge] - there)
    edge, t, none = snap(rim, edge, t, np.zeros(len(edge), dtype=np.int64), 4 * reach)
    end_edge, end_t, sheet = snap(rim, end_edge, end_t, sheet, 4 * reach)
    sheet = sheet - none
    # Each is found from both of its ends: keep one.
    once = (went - came > 16 * reach) & ((edge < end_edge) | ((edge == end_edge) & (t < end_t)))
    return Chords(edge[once], t[once], end_edge[once], end_t[once], sheet[once])


def _links_across(layout: Layout, rim: Rim) -> tuple[Ints, Ints, Ints]:
    """(boundary edge, node outside, direction) of all links that enter through a boundary edge."""
    lattice = layout.lattice
    ends = lattice.coordinates(np.stack([rim.tail, rim.head], axis=1))
    margin = int(np.ceil(lattice.edge)) + 1
    low = np.floor(ends.min(axis=1)).astype(np.int64) - margin
    wide = np.ceil(ends.max(axis=1)).astype(np.int64) + margin - low + 1
    edge, step = runs(wide.prod(axis=1))
    start = low[edge] + np.stack([step % wide[edge, 0], step // wide[edge, 0]], axis=1)
    along = (rim.head - rim.tail)[edge]
    along = along / abs(along)
    depth = ((lattice.position(start) - rim.tail[edge]) * along.conj()).imag
    near = lattice.is_node(start) & (depth < -layout.reach) & (depth > -lattice.edge - layout.reach)
    edge, start, depth = edge[near], start[near], depth[near]
    direction = np.tile(np.arange(lattice.order), len(edge))
    edge, start, depth = (np.repeat(x, lattice.order, axis=0) for x in (edge, start, depth))
    heading = lattice.position(lattice.steps[direction])
    along = (rim.head - rim.tail)[edge]
    length = abs(along)
    rise = (heading * along.conj()).imag / length
    crosses = lattice.has_edge(start, direction) & (depth + rise > layout.reach)
    foot = ((lattice.position(start) - rim.tail[edge]) * along.conj()).real / length
    at = foot - depth * (heading * along.conj()).real / length / np.where(rise == 0, 1.0, rise)
    crosses &= (at > -4 * layout.reach) & (at < length + 4 * layout.reach)
    return edge[crosses], start[crosses], direction[crosses]
