"""Do neighbouring panels overlap? A test that knows nothing of how the panels were made."""

from __future__ import annotations

import numpy as np
import shapely

from hexwrap_solver.arrays import Floats, Ints, Ragged

#: Two panels overlap when they share more area than this, times the squared edge length.
AREA_TOLERANCE = 1e-9

#: Depth / edge length below which an axis separates. Polygons less than 2 ℓ wide then share <
#: AREA_TOLERANCE ℓ².
DEPTH_TOLERANCE = 1e-10


def overlap_areas(polygons: Ragged, normal: Floats, edge_length: Floats, first: Ints, second: Ints) -> Floats:
    """(k,) area shared by panels first[i] and second[i], projected along the mean of their normals.

    Pairs that an edge direction of either polygon separates (separating-axis theorem) share nothing; the few
    others are intersected as polygons in the plane.
    """
    mean = normal[first] + normal[second]
    mean /= np.linalg.norm(mean, axis=1)[:, None]
    x_axis = _perpendicular(mean)
    y_axis = np.cross(mean, x_axis)
    origin = np.asarray(polygons.values[polygons.offsets[first]], dtype=np.float64)
    a, b = (_project(polygons, which, origin, x_axis, y_axis) for which in (first, second))
    slack = DEPTH_TOLERANCE * np.minimum(edge_length[first], edge_length[second])
    open_pairs = np.flatnonzero(~(_separated(a, b, slack) | _separated(b, a, slack)))
    area = np.zeros(len(first))
    shapes = [shapely.make_valid(shapely.polygons(_closed(side[open_pairs]))) for side in (a, b)]
    area[open_pairs] = shapely.area(shapely.intersection(*shapes))
    return area


def overlapping_pairs(polygons: Ragged, normal: Floats, edge_length: Floats, pairs: Ints) -> Ints:
    """Which of the pairs (k, 2) overlap, as positions in ``pairs``."""
    first, second = pairs.T
    area = overlap_areas(polygons, normal, edge_length, first, second)
    bound = AREA_TOLERANCE * np.minimum(edge_length[first], edge_length[second]) ** 2
    return np.flatnonzero(area > bound)


def _perpendicular(n: Floats) -> Floats:
    axis = np.zeros_like(n)
    axis[np.arange(len(n)), np.abs(n).argmin(axis=1)] = 1.0
    across = np.cross(n, axis)
    return np.asarray(across / np.linalg.norm(across, axis=1)[:, None])


def _project(polygons: Ragged, which: Ints, origin: Floats, x: Floats, y: Floats) -> Floats:
    """(k, most corners, 2); shorter polygons repeat their last corner."""
    most = int(polygons.lengths[which].max(initial=3))
    corner = np.minimum(np.arange(most), polygons.lengths[which][:, None] - 1)
    spoke = polygons.values[polygons.offsets[which][:, None] + corner] - origin[:, None]
    return np.stack([np.einsum("kcd,kd->kc", spoke, x), np.einsum("kcd,kd->kc", spoke, y)], axis=2)


def _separated(a: Floats, b: Floats, slack: Floats) -> np.ndarray:
    """Whether the line of some edge of a has all of a on one side and all of b on the other."""
    edge = np.roll(a, -1, axis=1) - a
    length = np.linalg.norm(edge, axis=2)
    axis = np.stack([edge[..., 1], -edge[..., 0]], axis=2) / np.where(length > 0, length, 1.0)[..., None]
    own = np.einsum("ked,kcd->kec", axis, a)
    other = np.einsum("ked,kcd->kec", axis, b)
    ahead = other.min(axis=2) >= own.max(axis=2) - slack[:, None]
    behind = other.max(axis=2) <= own.min(axis=2) + slack[:, None]
    return np.asarray(np.any((ahead | behind) & (length > 0), axis=1))


def _closed(points: Floats) -> Floats:
    return np.concatenate([points, points[:, :1]], axis=1)
