"""From where a picture is taken, so that towers, facades, entrances, flat rings and
singularities show themselves."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.conformal.types import ConformalMap

#: Degrees from the x axis, unless the surface has something to show: a front corner.
AZIMUTH = -58.0
#: Degrees above the horizon of a very slender and of a flat model.
LOW, HIGH = 13.0, 52.0
#: How far beside what is shown, in degrees, the viewer stands.
ASIDE = 24.0
#: Degrees between the directions in which one looks for singularities.
STEP = 5.0
#: A boundary angle this far from π, radians, is a corner made on purpose.
CORNER = np.pi / 6
#: Above this length of the mean unit normal the surface has a front (a dome, a ring), not only an outside.
FRONT = 0.4


def viewpoint(cmap: ConformalMap) -> Floats:
    """Unit vector from the model towards the viewer; z is up."""
    front = _front(cmap)
    elevation = np.radians(_elevation(cmap.surface.vertices))
    azimuth = np.radians(AZIMUTH)
    flat = float(np.hypot(front[0], front[1]))
    entrance = _entrance(cmap)
    if entrance is not None:
        azimuth = np.arctan2(entrance[1], entrance[0]) + np.radians(ASIDE)
    elif flat > FRONT:
        azimuth = np.arctan2(front[1], front[0]) + np.radians(ASIDE)
    elif len(cmap.cones):
        azimuth = _facing(cmap.surface.normals[cmap.cones.vertex]) + np.radians(ASIDE)
    if front[2] < -FRONT:
        elevation = -elevation
    return np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )


def _facing(normals: Floats) -> float:
    """Azimuth from where most of them are seen, and as steeply as can be, radians."""
    azimuth = np.radians(np.arange(AZIMUTH, AZIMUTH + 360, STEP))
    towards = np.stack([np.cos(azimuth), np.sin(azimuth)])
    return float(azimuth[np.argmax(np.maximum(normals[:, :2] @ towards, 0).sum(axis=0))])


def corners(cmap: ConformalMap) -> list[tuple[int, float]]:
    """Boundary vertices that are corners of the domain, with their angles there."""
    found: list[tuple[int, float]] = []
    for loop, angles in zip(cmap.surface.loops, cmap.boundary_angles, strict=True):
        marked = np.flatnonzero(np.abs(angles - np.pi) > CORNER)
        found += list(zip(loop[marked].tolist(), angles[marked].tolist(), strict=True))
    return found


def _front(cmap: ConformalMap) -> Floats:
    """Mean unit normal, weighted with area."""
    p = cmap.surface.vertices[cmap.surface.faces]
    normals = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    return np.asarray(normals.sum(axis=0) / np.linalg.norm(normals, axis=1).sum())


def _elevation(vertices: Floats) -> float:
    extent = np.ptp(vertices, axis=0)
    slenderness = extent[2] / max(np.hypot(extent[0], extent[1]), 1e-300)
    return float(LOW + (HIGH - LOW) / (1 + 4 * slenderness) ** 1.5)


def _entrance(cmap: ConformalMap) -> Floats | None:
    """Horizontal direction of the sharp corners of the boundary from the middle, if there are any."""
    sharp = [vertex for vertex, angle in corners(cmap) if angle < np.pi]
    if not sharp:
        return None
    points = cmap.surface.vertices
    middle = (points.max(axis=0) + points.min(axis=0)) / 2
    away = points[sharp[0]] - middle
    return np.asarray(away) if np.hypot(away[0], away[1]) > 1e-6 * np.ptp(points, axis=0).max() else None
