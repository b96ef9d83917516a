"""Edges of neighbouring panels that face each other across a joint, and the gap between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints, Ragged
from hexwrap_solver.geometry import angles_between, dot, normalize, plane_axes
from hexwrap_solver.pattern.halfedges import HalfEdges


@dataclass(frozen=True)
class Facing:
    """Pairs of edges, all arrays (k,): those of two panels that came from the same edge of the pattern.

    here, there: half-edges of the pattern, here < there. left, right: their panels. start_left, start_right:
    the corner of the panel at which its edge starts. mean: (k, 3) unit mean of the normals beside it. kink:
    (k,) angle between these.
    """

    here: Ints
    there: Ints
    left: Ints
    right: Ints
    start_left: Ints
    start_right: Ints
    mean: Floats
    kink: Floats

    @cached_property
    def axes(self) -> Floats:
        """(k, 2, 3) orthonormal, right-handed with the mean normals. Not to be written to."""
        return plane_axes(self.mean)


def facing_edges(edges: HalfEdges, panel: Ints, corner: Ints, normal: Floats) -> Facing:
    """panel: (c,) of each cell, −1: none. corner: (h,) of its panel at which each half-edge's own begins, −1
    where it has none. normal: (c, 3) of what lies in the cells."""
    here = edges.pairs()
    there = edges.twin[here]
    left, right = panel[edges.cell[here]], panel[edges.cell[there]]
    both = (left >= 0) & (right >= 0) & (corner[here] >= 0) & (corner[there] >= 0)
    here, there = here[both], there[both]
    one, other = (normal.take(edges.cell.take(side), axis=0) for side in (here, there))
    mean, kink = normalize(one + other), angles_between(one, other)
    return Facing(here, there, left[both], right[both], corner.take(here), corner.take(there), mean, kink)


def edge_ends(polygons: Ragged, panel: Ints, corner: Ints) -> tuple[Floats, Floats]:
    """(k, 3) both ends of the panels' edges that start at the given corners."""
    start, count = polygons.offsets.take(panel), polygons.lengths.take(panel)
    points = np.asarray(polygons.values, dtype=np.float64)
    following = np.where(corner + 1 < count, corner + 1, 0)
    return points.take(start + corner, axis=0), points.take(start + following, axis=0)


def widths(polygons: Ragged, facing: Facing) -> Floats:
    """(k,) least distance of two facing edges, seen along the mean normals; negative where an edge has
    crossed the other."""
    a, b = edge_ends(polygons, facing.left, facing.start_left)
    c, d = edge_ends(polygons, facing.right, facing.start_right)
    x_axis, y_axis = facing.axes.transpose(1, 0, 2)
    p, q, r = (dot(end - a, x_axis) + 1j * dot(end - a, y_axis) for end in (b, c, d))
    o = np.zeros_like(p)
    return np.minimum(_signed_distance(q, r, o, p), _signed_distance(o, p, q, r))


def _signed_distance(one: Complexes, two: Complexes, a: Complexes, b: Complexes) -> Floats:
    """Least distance of two points to segment ab, negative on its left (inside the polygon that runs along
    ab)."""
    along = b - a
    length = np.abs(along)
    back = np.where(length > 0, along, 1.0).conj() / np.where(length > 0, length, 1.0)
    least = np.full(len(a), np.inf)
    for point in (one, two):
        place = (point - a) * back  # along the edge, and to its left
        beyond = np.maximum(-place.real, place.real - length)
        distance = np.hypot(np.maximum(beyond, 0.0), place.imag)
        least = np.minimum(least, np.where((place.imag > 0) & (beyond <= 0), -distance, distance))
    return least
