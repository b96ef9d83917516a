"""Points near the surface, laid out in the unrolled domain: the inverse of lifting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.interpolate import domain_weights
from hexwrap_solver.domain.locate import runs


@dataclass(frozen=True)
class Flattened:
    """uv: (k,) complex places in the unrolled domain, in one sheet. distance: (k,) of each point from the
    surface, model units. face: (k,) triangle with the nearest point; barycentric: (k, 3) there."""

    uv: Complexes
    distance: Floats
    face: Ints
    barycentric: Floats


def flatten(cmap: ConformalMap, points: Floats) -> Flattened:
    """Carry the surface points nearest to (k, 3) points into the domain."""
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    surface = cmap.surface
    face, weights, distance = nearest_on_mesh(surface.vertices, surface.faces, points)
    in_domain = domain_weights(cmap, face, weights)
    uv = (in_domain * cmap.deck.apply(cmap.uv[surface.faces[face]], cmap.sheet[face])).sum(axis=1)
    return Flattened(uv, distance, face, weights)


def nearest_on_mesh(vertices: Floats, faces: Ints, points: Floats) -> tuple[Ints, Floats, Floats]:
    """(face, barycentric (k, 3), distance) of the point of a mesh nearest to each of (k, 3) points. Exact.

    The nearest vertex bounds the distance; triangles are sought by their centres in classes of about equal
    radius, so that no triangle within the bound is missed on uneven meshes.
    """
    if not len(points):
        return np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros(0)
    bound, _ = cKDTree(vertices).query(points)
    corners = vertices[faces]
    centre = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    level = np.ceil(np.log2(np.maximum(radius, 1e-9 * radius.max()))).astype(np.int64)
    owners, candidates = [], []
    for e in np.unique(level):
        members = np.flatnonzero(level == e)
        near = cKDTree(centre[members]).query_ball_point(points, bound * (1 + 1e-12) + 2.0**e)
        owner, _ = runs(np.fromiter(map(len, near), dtype=np.int64, count=len(near)))
        owners.append(owner)
        candidates.append(members[np.concatenate([np.asarray(c, dtype=np.int64) for c in near])])
    owner, face = np.concatenate(owners), np.concatenate(candidates)
    weights = nearest_in_triangle(corners[face], points[owner])
    offset = np.einsum("kc,kcd->kd", weights, corners[face]) - points[owner]
    distance = np.linalg.norm(offset, axis=1)
    order = np.lexsort((face, distance, owner))
    best = order[np.unique(owner[order], return_index=True)[1]]
    return face[best], weights[best], distance[best]


def nearest_in_triangle(corners: Floats, points: Floats) -> Floats:
    """(k, 3) barycentric coordinates of the point of each triangle (k, 3, 3) nearest to a point (k, 3)."""
    edge = np.roll(corners, -1, axis=1) - corners
    offset = points[:, None] - corners
    normal = np.cross(edge[:, 0], edge[:, 1])
    square = np.maximum((normal**2).sum(axis=1, keepdims=True), 1e-300)
    # Weight of corner c: the triangle of the opposite edge with the point, as seen along the normal.
    opposite = np.einsum("kcd,kd->kc", np.cross(edge, offset), normal) / square
    weights = np.roll(opposite, -1, axis=1)
    along = (edge * offset).sum(axis=2) / np.maximum((edge**2).sum(axis=2), 1e-300)
    t = np.clip(along, 0, 1)
    on_edge = np.linalg.norm(offset - t[..., None] * edge, axis=2)
    side = np.argmin(on_edge, axis=1)
    rows = np.arange(len(points))
    at_edge = np.zeros_like(weights)
    at_edge[rows, side] = 1 - t[rows, side]
    at_edge[rows, (side + 1) % 3] = t[rows, side]
    return np.asarray(np.where((weights >= 0).all(axis=1, keepdims=True), weights, at_edge))
