"""Residuals of the paper's functionals and their exact derivatives, dimensionless.

For a polygon with corners v_k, target length ℓ_P and E = ½ Σ r²:
    planarity   E_pl   det(v_{k+1} − v_k, v_{k+2} − v_k, v_{k+3} − v_k) / ℓ_P³   (tetrahedra)
    angles      E_α    α_k − (p−2)π/p
    edges       E_ℓ    ‖v_{k+1} − v_k‖ / ℓ_P − 1
    surface            distance(v_k, reference surface) / ℓ_P
Divided by ℓ_P, weights mean the same at every scale. All polygons of a call have the same number of corners.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexwrap_solver.arrays import Floats
from hexwrap_solver.panels.types import Weights
from hexwrap_solver.surface.closest import TriangleTree

#: Weight of the squared movement / ℓ² beside energies that leave positions free: enough to keep panels from
#: sliding along the surface, too little to be seen in what the energies ask for.
ANCHOR = 1e-2

#: Weights above this are brought down to it, all in the same ratio: beyond, rounding of what they weigh would
#: drown the damping that keeps free directions in place.
MOST_WEIGHT = 100.0

#: Real corners, or complex ones where derivatives are taken by a complex step.
Points = NDArray[Any]


def bounded(weights: Weights) -> tuple[Weights, float]:
    """Weights in the same ratios, none above MOST_WEIGHT, and the factor by which they are smaller."""
    parts = (weights.planarity, weights.angle, weights.edge, weights.surface)
    factor = max(1.0, max(parts) / MOST_WEIGHT)
    return Weights(*(part / factor for part in parts)), factor


def residuals(points: Points, length: Floats, weights: Weights, *, angles: bool = True) -> Points:
    """points: (q, p, 3), length: (q,) → (q, m), each scaled by the root of its weight, none where
    that is 0; without the surface's.

    angles: False leaves them out (cells of irregular shape).
    """
    q, p, _ = points.shape
    parts = [np.zeros((q, 0))]
    if weights.planarity:
        parts.append(np.sqrt(weights.planarity) * planarity(points, length))
    if angles and weights.angle:
        parts.append(np.sqrt(weights.angle) * (corner_angles(points) - np.pi * (p - 2) / p))
    if weights.edge:
        parts.append(np.sqrt(weights.edge) * (_norm(edges_of(points)) / length[:, None] - 1))
    return np.concatenate(parts, axis=1)


def jacobian(points: Floats, length: Floats, weights: Weights, *, angles: bool = True) -> Floats:
    """(q, m, p, 3) derivatives of ``residuals`` by the corners."""
    q, p, _ = points.shape
    parts = [np.zeros((q, 0, p, 3))]
    if weights.planarity:
        parts.append(np.sqrt(weights.planarity) * _planarity_derivative(points, length))
    if angles and weights.angle:
        parts.append(np.sqrt(weights.angle) * _angle_derivative(points))
    if weights.edge:
        parts.append(np.sqrt(weights.edge) * _edge_derivative(points, length))
    return np.concatenate(parts, axis=1)


def surface_residuals(points: Floats, length: Floats, tree: TriangleTree) -> tuple[Floats, Floats]:
    """points (k, 3), length (k,) → residuals (k,) and their derivatives (k, 3): unit vectors from the foot,
    / ℓ.

    On the surface itself, where the distance has a kink, the derivative is that along the face's normal.
    Differences of coordinates come first: far from the origin their digits are all there is.
    """
    nearest = tree.nearest(points)
    corners = tree.corners[nearest.face]
    spoke = np.einsum("kc,kcd->kd", nearest.barycentric, points[:, None] - corners)
    distance = np.linalg.norm(spoke, axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    touching = distance <= 1e-12 * length + 4 * np.finfo(float).eps * np.abs(points).max(axis=1)
    direction = np.where(touching[:, None], normal, spoke)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    return distance / length, direction / length[:, None]


def planarity(points: Points, length: Floats) -> Points:
    """(q, t) volumes of the tetrahedra of four successive corners: t = p, 1 for quads, 0 for triangles."""
    a, b, c = _tetrahedra(points)
    return np.asarray(np.einsum("qtd,qtd->qt", a, np.cross(b, c)) / (length**3)[:, None])


def corner_angles(points: Points) -> Points:
    """(q, p) angle between the two edges at each corner, 0…π."""
    u, v = -_behind(points), edges_of(points)
    cross, dot = np.cross(u, v), np.einsum("qkd,qkd->qk", u, v)
    return np.asarray(2 * np.arctan(_norm(cross) / (_norm(u) * _norm(v) + dot)))


def _planarity_derivative(points: Floats, length: Floats) -> Floats:
    q, p, _ = points.shape
    a, b, c = _tetrahedra(points)
    t = a.shape[1]
    scale = 1 / (length**3)[:, None, None]
    by = [np.cross(b, c) * scale, np.cross(c, a) * scale, np.cross(a, b) * scale]
    derivative = np.zeros((q, t, p, 3))
    rows = np.arange(t)
    derivative[:, rows, rows] = -(by[0] + by[1] + by[2])
    for step, part in enumerate(by, 1):
        derivative[:, rows, (rows + step) % p] = part
    return derivative


def _angle_derivative(points: Floats) -> Floats:
    q, p, _ = points.shape
    u, v = -_behind(points), edges_of(points)
    lu, lv = _norm(u)[..., None], _norm(v)[..., None]
    u, v = u / lu, v / lv
    cosine = np.einsum("qkd,qkd->qk", u, v)[..., None]
    sine = np.maximum(_norm(np.cross(u, v))[..., None], 1e-12)
    by_u, by_v = (cosine * u - v) / (lu * sine), (cosine * v - u) / (lv * sine)
    derivative = np.zeros((q, p, p, 3))
    rows = np.arange(p)
    derivative[:, rows, (rows - 1) % p] = by_u
    derivative[:, rows, (rows + 1) % p] = by_v
    derivative[:, rows, rows] = -(by_u + by_v)
    return derivative


def _edge_derivative(points: Floats, length: Floats) -> Floats:
    q, p, _ = points.shape
    edge = edges_of(points)
    along = edge / (_norm(edge) * length[:, None])[..., None]
    derivative = np.zeros((q, p, p, 3))
    rows = np.arange(p)
    derivative[:, rows, rows] = -along
    derivative[:, rows, (rows + 1) % p] = along
    return derivative


def _tetrahedra(points: Points) -> tuple[Points, Points, Points]:
    p = points.shape[1]
    t = {3: 0, 4: 1}.get(p, p)
    a, b, c = (np.roll(points, -step, axis=1)[:, :t] - points[:, :t] for step in (1, 2, 3))
    return a, b, c


def edges_of(points: Points) -> Points:
    """(q, p, 3) from each corner to the next."""
    return np.roll(points, -1, axis=1) - points


def _behind(points: Points) -> Points:
    return points - np.roll(points, 1, axis=1)


def _norm(vectors: Points) -> Points:
    """Holds for complex steps, too, unlike the absolute value."""
    return np.asarray(np.sqrt(np.einsum("...d,...d->...", vectors, vectors)))
