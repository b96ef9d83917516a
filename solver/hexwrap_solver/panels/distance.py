"""Distances of points to a triangle mesh, exact."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface.types import Surface

#: How many triangles are tried first around each point; doubled for points that need more.
FIRST_TRIED = 6


def distance_to_surface(points: Floats, surface: Surface) -> Floats:
    """(k,) distance of each point to the mesh itself.

    Every triangle lies within its circumscribing ball around its centroid. Triangles are sorted into
    classes by the radius of that ball (powers of two), and looked at in the order of their centroids'
    distance: once that exceeds the distance found plus the class's radius, no further triangle of the class
    can be nearer.
    """
    corners = surface.vertices[surface.faces]
    centroid = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centroid[:, None], axis=2).max(axis=1)
    octave = np.ceil(np.log2(np.maximum(radius, radius.max() * 2.0**-20)))
    best = np.full(len(points), np.inf)
    for level in np.unique(octave):
        members = np.flatnonzero(octave == level)
        _improve(points, best, corners[members], centroid[members], float(radius[members].max()))
    return best


def _improve(points: Floats, best: Floats, corners: Floats, centroid: Floats, radius: float) -> None:
    """Lowers ``best`` (k,) to the distance to these triangles where they are nearer."""
    tree = KDTree(centroid)
    todo = np.arange(len(points))
    tried, count = 0, FIRST_TRIED
    while len(todo):
        count = min(count, len(centroid))
        query = tree.query(points[todo], k=np.arange(tried + 1, count + 1))
        reached, index = np.asarray(query[0]), np.asarray(query[1])
        found = triangle_distance(points[todo][:, None], corners[index]).min(axis=1)
        best[todo] = np.minimum(best[todo], found)
        if count == len(centroid):
            return
        todo = todo[reached[:, -1] - radius < best[todo]]
        tried, count = count, 2 * count


def triangle_distance(points: Floats, corners: Floats) -> Floats:
    """(…,) distance of points (…, 3) to triangles (…, 3 corners, 3), broadcast against each other."""
    a, b, c = (corners[..., k, :] for k in range(3))
    normal = np.cross(b - a, c - a)
    squared = np.einsum("...d,...d->...", normal, normal)
    inside = squared > 0
    nearest = np.full(np.broadcast_shapes(points.shape[:-1], corners.shape[:-2]), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        inside = inside & (np.einsum("...d,...d->...", np.cross(q - p, points - p), normal) >= 0)
        nearest = np.minimum(nearest, _segment_distance(points, p, q))
    height = np.abs(np.einsum("...d,...d->...", points - a, normal)) / np.sqrt(
        np.where(squared > 0, squared, 1.0)
    )
    return np.where(inside, height, nearest)


def _segment_distance(points: Floats, p: Floats, q: Floats) -> Floats:
    along, spoke = q - p, points - p
    squared = np.einsum("...d,...d->...", along, along)
    t = np.einsum("...d,...d->...", spoke, along) / np.where(squared > 0, squared, 1.0)
    return np.asarray(np.linalg.norm(spoke - np.clip(t, 0.0, 1.0)[..., None] * along, axis=-1))
