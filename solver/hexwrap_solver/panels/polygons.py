"""Measures of polygons in space, for rows of any number of corners."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.geometry import cross, dot, lengths, normalize

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


def _spokes(polygons: Ragged) -> Floats:
    """(·, 3) from the mean of the corners to each."""
    return np.asarray(polygons.values - means(polygons).take(polygons.row, axis=0))


def area_vectors(polygons: Ragged) -> Floats:
    """(q, 3) ½ Σ p_k × p_{k+1} about the mean: the area for flat polygons, along the normal."""
    spoke = _spokes(polygons)
    return row_sums(cross(spoke, spoke.take(polygons.next(), axis=0)) / 2, polygons.offsets)


def fan_areas(polygons: Ragged) -> Floats:
    """(q,) area of the fan of triangles around the mean of the corners."""
    spoke = _spokes(polygons)
    triangle = lengths(cross(spoke, spoke.take(polygons.next(), axis=0))) / 2
    return row_sums(triangle, polygons.offsets)


def interior_angles(polygons: Ragged, normal: Floats) -> Floats:
    """(·,) angle inside the polygon at each corner, 0…2π, seen along the unit normals (q, 3)."""
    ahead = edge_vectors(polygons)
    back = np.empty_like(ahead)
    back[polygons.next()] = -ahead
    n = normal.take(polygons.row, axis=0)
    turn = cross(ahead, back)
    sine, cosine = dot(turn, n), dot(ahead, back)
    # The full length of the cross product, not its part along n, gives the angle of bent corners.
    angle = np.arctan2(lengths(turn), cosine)
    return np.asarray(np.where(sine >= 0, angle, 2 * np.pi - angle))


def convex(polygons: Ragged, angle: Floats) -> Bools:
    """(q,) polygons without a corner of more than π; angle: (·,) their ``interior_angles``."""
    return np.asarray(row_maxima(angle, polygons.offsets) <= np.pi + STRAIGHT)


def best_plane_distances(polygons: Ragged) -> Floats:
    """(·,) signed distance of each corner from its polygon's least-squares plane.

    The area vector stands on the plane of a flat polygon; of the others the moments are needed.
    """
    row = polygons.row
    spoke = _spokes(polygons)
    normal = normalize(row_sums(cross(spoke, spoke.take(polygons.next(), axis=0)), polygons.offsets))
    distance = dot(spoke, normal.take(row, axis=0))
    reach = row_maxima(dot(spoke, spoke), polygons.offsets)
    bent = np.flatnonzero(
        ~(row_maxima(np.abs(distance), polygons.offsets) <= FLAT * np.sqrt(reach)) | ~normal.any(axis=1)
    )
    some, at = take_rows(Ragged(spoke, polygons.offsets), bent)
    outer = np.einsum("hd,he->hde", some.values, some.values)
    _, axes = np.linalg.eigh(row_sums(outer, some.offsets))
    distance[at] = dot(spoke[at], axes[:, :, 0][some.row])
    return distance


def take_rows(table: Ragged, rows: Ints) -> tuple[Ragged, Ints]:
    """The given rows, and the positions of their values in the table."""
    count = table.lengths[rows]
    offsets = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    at = np.arange(offsets[-1]) + np.repeat(table.offsets[rows] - offsets[:-1], count)
    return Ragged(table.values[at], offsets), at
