"""Edges of neighbouring panels that face each other across a joint, and the gap between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.geometry import angles_between, dot_first, normalize, plane_axes
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
    def frame(self) -> Floats:
        """(3, 3, k) two axes and the mean normal, right-handed, coordinates first. Not to be written to."""
        axes = np.concatenate([plane_axes(self.mean), self.mean[:, None]], axis=1)
        return np.ascontiguousarray(axes.transpose(1, 2, 0))


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


def sides(polygons: Ragged, facing: Facing) -> Floats:
    """(3, 3, k) from where the left panel's edge starts: to its end, and to the right panel's start and end,
    coordinates first."""
    points = np.ascontiguousarray(np.asarray(polygons.values, dtype=np.float64).T)
    ends = []
    for panel, corner in ((facing.left, facing.start_left), (facing.right, facing.start_right)):
        start, count = polygons.offsets.take(panel), polygons.lengths.take(panel)
        following = np.where(corner + 1 < count, corner + 1, 0)
        ends += [points.take(start + corner, axis=1), points.take(start + following, axis=1)]
    return np.stack(ends[1:]) - ends[0]


def widths(polygons: Ragged, facing: Facing) -> Floats:
    """(k,) least distance of two facing edges, seen along the mean normals; negative where an edge has
    crossed the other."""
    return least_distances(sides(polygons, facing), facing)


def least_distances(ends: Floats, facing: Facing) -> Floats:
    """The same of ``sides``."""
    p, q, r = np.stack([dot_first(ends.swapaxes(0, 1), axis[:, None]) for axis in facing.frame[:2]], axis=1)
    return np.minimum(_signed_distance((q, r), p), _signed_distance((-q, p - q), r - q))


def _signed_distance(points: tuple[Floats, ...], end: Floats) -> Floats:
    """(k,) least distance of the points, (2, k) each, to the segment from 0 to end (2, k), negative on its
    left (inside the polygon that runs along it)."""
    length = np.sqrt(end[0] ** 2 + end[1] ** 2)
    u, v = end / np.where(length > 0, length, 1.0)
    u = np.where(length > 0, u, 1.0)
    least = np.full(len(length), np.inf)
    for x, y in points:
        along, left = x * u + y * v, y * u - x * v
        beyond = np.maximum(np.maximum(-along, along - length), 0.0)
        distance = np.sqrt(beyond**2 + left**2)
        least = np.minimum(least, np.where((left > 0) & (beyond <= 0), -distance, distance))
    return least
