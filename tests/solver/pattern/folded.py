"""Surfaces with creases."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.surface import surface_from_mesh
from hexwrap_solver.surface.types import SentMesh, Surface, SurfaceSettings

RECTANGLE = ((0.0, 0.0), (30.0, 0.0), (30.0, 20.0), (0.0, 20.0))
ELL = ((0.0, 0.0), (30.0, 0.0), (30.0, 12.0), (14.0, 12.0), (14.0, 30.0), (0.0, 30.0))


def plan(corners: tuple[tuple[float, float], ...], edge: float) -> Floats:
    """(k, 2) points along a closed polygon, about an edge apart, each corner one of them."""
    points = []
    turned = np.roll(np.array(corners), -1, axis=0)
    for a, b in zip(np.array(corners), turned, strict=True):
        pieces = max(2, round(float(np.linalg.norm(b - a)) / edge))
        points.append(a + np.linspace(0, 1, pieces, endpoint=False)[:, None] * (b - a))
    return np.concatenate(points)


def grid(rings: Floats) -> SentMesh:
    """Triangles between closed rings of points, (rows, around, 3)."""
    rows, around, _ = rings.shape
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(around), indexing="ij")
    a, b = (i * around + j).ravel(), (i * around + (j + 1) % around).ravel()
    faces: Ints = np.concatenate(
        [np.stack([a, b, b + around]), np.stack([a, b + around, a + around])], axis=1
    )
    return SentMesh(rings.reshape(-1, 3), Ragged.from_table(faces.T))


def prism(
    corners: tuple[tuple[float, float], ...] = RECTANGLE,
    height: float = 60.0,
    edge: float = 1.25,
    twist: float = 0.0,
) -> Surface:
    """An upright prism without floor and roof, or one that turns by ``twist`` radians on its way up."""
    base = plan(corners, edge)
    t = np.linspace(0, 1, round(height / edge) + 1)[:, None]
    middle = base.mean(axis=0)
    x, y = (base - middle).T
    c, s = np.cos(twist * t), np.sin(twist * t)
    rings = np.stack([c * x - s * y, s * x + c * y, np.broadcast_to(height * t, (len(t), len(x)))], axis=2)
    return surface_from_mesh(grid(rings), SurfaceSettings(caps="keep"))
