"""Do neighbouring panels overlap? A test that knows nothing of how the panels were made."""

from __future__ import annotations

import numpy as np
import shapely

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.geometry import dot_first, normalize, plane_axes

#: Two panels overlap when they share more area than this, times the squared edge length.
AREA_TOLERANCE = 1e-9

#: Depth / edge length below which an axis separates. Polygons less than 2 ℓ wide then share <
#: AREA_TOLERANCE ℓ².
DEPTH_TOLERANCE = 1e-10


def overlap_areas(
    polygons: Ragged,
    normal: Floats,
    edge_length: Floats,
    first: Ints,
    second: Ints,
    across: Floats | None = None,
) -> Floats:
    """(k,) area shared by panels first[i] and second[i], projected along the mean of their normals.

    Pairs that an edge direction of either polygon separates (separating-axis theorem) share nothing; the few
    others are intersected as polygons in the plane. across: (k, 3) directions along which the pairs are
    believed to lie one behind the other: whether they do is seen first, in a fraction of the time.
    """
    area = np.zeros(len(first))
    if not len(first):
        return area
    if across is not None:
        slack = DEPTH_TOLERANCE * np.minimum(edge_length[first], edge_length[second])
        left = np.flatnonzero(~_lie_apart(polygons, normal, first, second, across, slack))
        area[left] = overlap_areas(polygons, normal, edge_length, first[left], second[left])
        return area
    mean = normalize(normal[first] + normal[second])
    x_axis, y_axis = plane_axes(mean).transpose(1, 0, 2)
    origin = np.asarray(polygons.values[polygons.offsets[first]], dtype=np.float64)
    a, b = (_project(polygons, which, origin, x_axis, y_axis) for which in (first, second))
    slack = DEPTH_TOLERANCE * np.minimum(edge_length[first], edge_length[second])
    # Nearly always the edges that face each other separate; only where they do not all others are tried.
    open_pairs = np.flatnonzero(~(_facing_edge_separates(a, b, slack) | _facing_edge_separates(b, a, slack)))
    a, b, slack = a[..., open_pairs], b[..., open_pairs], slack[open_pairs]
    still = ~(_any_edge_separates(a, b, slack) | _any_edge_separates(b, a, slack))
    shapes = [shapely.make_valid(shapely.polygons(_closed(side[..., still].T))) for side in (a, b)]
    area[open_pairs[still]] = shapely.area(shapely.intersection(*shapes))
    return area


def overlapping_pairs(
    polygons: Ragged, normal: Floats, edge_length: Floats, pairs: Ints, across: Floats | None = None
) -> Ints:
    """Which of the pairs (k, 2) overlap, as positions in ``pairs``. across: see ``overlap_areas``."""
    first, second = pairs.T
    area = overlap_areas(polygons, normal, edge_length, first, second, across)
    bound = AREA_TOLERANCE * np.minimum(edge_length[first], edge_length[second]) ** 2
    return np.flatnonzero(area > bound)


def _lie_apart(
    polygons: Ragged, normal: Floats, first: Ints, second: Ints, across: Floats, slack: Floats
) -> Bools:
    """(k,) whether the shadows of the panels on the directions (3, k), made square to the mean of the
    normals, are apart."""
    upright = np.ascontiguousarray(normal.T)
    mean = upright.take(first, axis=1) + upright.take(second, axis=1)
    flat = across - dot_first(across, mean) / dot_first(mean, mean) * mean
    length = np.sqrt(dot_first(flat, flat))
    axis = flat / np.where(length > 0, length, 1.0)
    start = polygons.offsets[:-1].take(first)
    place = np.ascontiguousarray(polygons.values.T)
    origin = place.take(start, axis=1)

    def shadow(which: Ints) -> Floats:
        corner = _corners(polygons, which)
        return np.asarray(sum((place[d].take(corner) - origin[d]) * axis[d] for d in range(3)))

    ahead = shadow(second).min(axis=0) >= shadow(first).max(axis=0) - slack
    return np.asarray(ahead & (length > 0))


def _corners(polygons: Ragged, which: Ints) -> Ints:
    """(most corners, k) places of the corners of each panel; the last again where there are fewer."""
    last = polygons.lengths.take(which) - 1
    corner = np.arange(int(last.max(initial=2)) + 1)[:, None]
    return np.asarray(polygons.offsets.take(which) + np.minimum(corner, last))


def _project(polygons: Ragged, which: Ints, origin: Floats, x: Floats, y: Floats) -> Floats:
    """(2, most corners, k), so that NumPy runs along the pairs; shorter polygons repeat their last corner."""
    place = np.ascontiguousarray(polygons.values.T)[:, _corners(polygons, which)]
    spoke = place - origin.T[:, None]
    return np.stack([(spoke * axis.T[:, None]).sum(axis=0) for axis in (x, y)])


def _edge_normals(a: Floats) -> tuple[Floats, Bools]:
    """(2, corners, k) unit normals of the edges, and which edges have a length."""
    edge = np.roll(a, -1, axis=1) - a
    length = np.hypot(*edge)
    return np.stack([edge[1], -edge[0]]) / np.where(length > 0, length, 1.0), length > 0


def _facing_edge_separates(a: Floats, b: Floats, slack: Floats) -> Bools:
    """(k,) whether the line of that edge of a does which looks most towards b."""
    normal, there = _edge_normals(a)
    towards = b.mean(axis=1) - a.mean(axis=1)
    facing = np.where(there, normal[0] * towards[0] + normal[1] * towards[1], -np.inf).argmax(axis=0)
    at = facing, np.arange(len(facing))
    return np.asarray(_separates(normal[:, *at], a, b, slack) & there[at])


def _any_edge_separates(a: Floats, b: Floats, slack: Floats) -> Bools:
    """(k,) whether the line of some edge of a has all of a on one side and all of b on the other."""
    normal, there = _edge_normals(a)
    found = np.zeros(a.shape[2], dtype=bool)
    for k in range(a.shape[1]):
        found |= _separates(normal[:, k], a, b, slack) & there[k]
    return found


def _separates(axis: Floats, a: Floats, b: Floats, slack: Floats) -> Bools:
    """(k,) whether the shadows of a and b on the axes (2, k) are apart."""
    own, other = (axis[0] * side[0] + axis[1] * side[1] for side in (a, b))
    ahead = other.min(axis=0) >= own.max(axis=0) - slack
    behind = other.max(axis=0) <= own.min(axis=0) + slack
    return np.asarray(ahead | behind)


def _closed(points: Floats) -> Floats:
    """(k, corners, 2), the first corner again at the end."""
    return np.concatenate([points, points[:, :1]], axis=1)
