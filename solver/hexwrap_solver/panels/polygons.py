"""Measures of polygons in space, for rows of any number of corners."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.geometry import cross_first, dot_first, lengths, normalize

#: Corners this near to a plane, relative to their distance from the middle, lie in it but for rounding.
FLAT = 1e-12
#: Corners whose angle exceeds π by less, radians, are straight.
STRAIGHT = 1e-9


def row_sums(values: Floats, offsets: Ints) -> Floats:
    """Sum of each row; no row may be empty."""
    return np.asarray(np.add.reduceat(values, offsets[:-1], axis=0)) if len(offsets) > 1 else values[:0]


def row_minima(values: Floats, offsets: Ints) -> Floats:
    """Least value of each row; no row may be empty."""
    return np.asarray(np.minimum.reduceat(values, offsets[:-1])) if len(offsets) > 1 else values[:0]


def row_maxima(values: Floats, offsets: Ints) -> Floats:
    """Greatest value of each row; no row may be empty."""
    return np.asarray(np.maximum.reduceat(values, offsets[:-1])) if len(offsets) > 1 else values[:0]


def means(polygons: Ragged) -> Floats:
    """(q, 3) mean of the corners."""
    return (
        row_sums(np.asarray(polygons.values, dtype=np.float64), polygons.offsets) / polygons.lengths[:, None]
    )


def edge_vectors(polygons: Ragged) -> Floats:
    """(·, 3) from each corner to the next."""
    return np.asarray(polygons.values.take(polygons.next(), axis=0) - polygons.values, dtype=np.float64)


def edge_lengths(polygons: Ragged) -> Floats:
    """(·,) length of the edge from each corner to the next."""
    return lengths(edge_vectors(polygons))


def mean_edges(polygons: Ragged) -> Floats:
    """(q,) mean edge length."""
    return row_sums(edge_lengths(polygons), polygons.offsets) / polygons.lengths


def area_vectors(polygons: Ragged) -> Floats:
    """(q, 3) ½ Σ p_k × p_{k+1} about the mean: the area for flat polygons, along the normal."""
    return _of_each(polygons, lambda one: one.fan.sum(axis=1).T / 2, 3)


def fan_areas(polygons: Ragged) -> Floats:
    """(q,) area of the fan of triangles around the mean of the corners."""
    return _of_each(polygons, lambda one: one.area)


def interior_angles(polygons: Ragged, normal: Floats) -> Floats:
    """(·,) angle inside the polygon at each corner, 0…2π, seen along the unit normals (q, 3)."""
    return _of_corners(polygons, lambda one: one.angle, normal)


def convex(polygons: Ragged, angle: Floats) -> Bools:
    """(q,) polygons without a corner of more than π; angle: (·,) their ``interior_angles``."""
    return np.asarray(row_maxima(angle, polygons.offsets) <= np.pi + STRAIGHT)


def best_plane_distances(polygons: Ragged) -> Floats:
    """(·,) signed distance of each corner from its polygon's least-squares plane."""
    return _of_corners(polygons, lambda one: one.off_plane)


@dataclass(frozen=True)
class Outlines:
    """Polygons with n corners each, coordinates first: NumPy runs along the polygons then, not along
    coordinates and corners.

    row: (k,) of the table that they are from. corner: (3, n, k). normal: (3, k) unit, along which angles are
    seen; not numbers where it was not given.
    """

    row: Ints
    corner: Floats
    normal: Floats

    @cached_property
    def edge(self) -> Floats:
        """(3, n, k) from each corner to the next."""
        return np.asarray(np.roll(self.corner, -1, axis=1) - self.corner)

    @cached_property
    def length(self) -> Floats:
        """(n, k) of the edges."""
        return np.sqrt(dot_first(self.edge, self.edge))

    @cached_property
    def turn(self) -> Floats:
        """(3, n, k) product of the edges before and after each corner."""
        return cross_first(np.roll(self.edge, 1, axis=1), self.edge)

    @cached_property
    def twist(self) -> Floats:
        """(n, k) volume that the edge at each corner, the one before and the one after span."""
        return dot_first(self.turn, np.roll(self.edge, -1, axis=1))

    @cached_property
    def spoke(self) -> Floats:
        """(3, n, k) from the mean of the corners to each."""
        return np.asarray(self.corner - self.corner.mean(axis=1)[:, None])

    @cached_property
    def fan(self) -> Floats:
        """(3, n, k) product of each spoke and the next."""
        return cross_first(self.spoke, np.roll(self.spoke, -1, axis=1))

    @property
    def area(self) -> Floats:
        """(k,) of the fan of triangles around the mean of the corners."""
        return np.asarray(np.sqrt(dot_first(self.fan, self.fan)).sum(axis=0) / 2)

    @property
    def off_plane(self) -> Floats:
        """(n, k) signed distance of each corner from its polygon's least-squares plane.

        The area vector stands on the plane of a flat polygon; of the others the moments are needed.
        """
        normal = normalize(self.fan.sum(axis=1).T)
        distance = dot_first(self.spoke, normal.T[:, None])
        reach = np.sqrt(dot_first(self.spoke, self.spoke).max(axis=0))
        flat = (np.abs(distance).max(axis=0) <= FLAT * reach) & normal.any(axis=1)
        bent = self.spoke[:, :, ~flat]
        _, axes = np.linalg.eigh(np.einsum("dnk,enk->kde", bent, bent))
        distance[:, ~flat] = dot_first(bent, axes[:, :, 0].T[:, None])
        return distance

    @cached_property
    def angle(self) -> Floats:
        """(n, k) inside at each corner, 0…2π."""
        cosine = -dot_first(np.roll(self.edge, 1, axis=1), self.edge)
        # The full length of the cross product, not its part along n, gives the angle of bent corners.
        angle = np.arctan2(np.sqrt(dot_first(self.turn, self.turn)), cosine)
        back = dot_first(self.turn, self.normal[:, None]) < 0
        return np.where(back, 2 * np.pi - angle, angle)


def outlines(polygons: Ragged, normal: Floats | None = None) -> list[Outlines]:
    """The polygons by their number of corners; none may have none. normal: (q, 3) unit."""
    count = polygons.lengths
    normal = np.full((len(count), 3), np.nan) if normal is None else normal
    place = np.ascontiguousarray(np.asarray(polygons.values, dtype=np.float64).T)
    found = []
    for n in np.flatnonzero(np.bincount(count)).tolist():
        row = np.flatnonzero(count == n)
        corner = place.take(_corners(polygons, row, n), axis=1)
        found.append(Outlines(row, corner, np.ascontiguousarray(normal.take(row, axis=0).T)))
    return found


def _corners(polygons: Ragged, row: Ints, n: int) -> Ints:
    """(n, k) places of the corners of rows of n."""
    return np.asarray(polygons.offsets.take(row) + np.arange(n)[:, None])


def _of_each(polygons: Ragged, measure: Callable[[Outlines], Floats], *shape: int) -> Floats:
    """(q, …) measured on all polygons."""
    measured = np.zeros((polygons.n_rows, *shape))
    for one in outlines(polygons):
        measured[one.row] = measure(one)
    return measured


def _of_corners(
    polygons: Ragged, measure: Callable[[Outlines], Floats], normal: Floats | None = None
) -> Floats:
    """(·,) measured on all corners, (n, k) of polygons with n corners."""
    measured = np.zeros(len(polygons.values))
    for one in outlines(polygons, normal):
        measured[_corners(polygons, one.row, len(one.corner[0]))] = measure(one)
    return measured
