"""Whether an unrolled map, as drawn, is what its metric says, beyond the rounding of its corners."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes
from hexwrap_solver.conformal.types import ConformalMap

#: Corners are good to a few roundings of their distance from the origin.
ROUNDINGS = 32 * np.finfo(np.float64).eps
#: Boundary angles are promised to 1e-9.
ANGLE = 5e-10


def positive(corners: Complexes) -> Bools:
    """(m,) whether the area of each triangle, corners (m, 3), is certainly above zero."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = (np.conj(a) * b).imag
    longest = np.maximum(np.maximum(np.abs(a), np.abs(b)), np.abs(b - a))
    far = np.abs(corners)
    farthest = np.maximum(np.maximum(far[:, 0], far[:, 1]), far[:, 2])
    return np.asarray(area > ROUNDINGS * farthest * longest)


def misdrawn(found: ConformalMap) -> Bools:
    """(m,) triangles that are turned over; if there are none, those around vertices that they go around too
    often or too seldom: one whose corner opens by more than 2π looks positive in the plane."""
    faces, corners = found.surface.faces, found.corners()
    turned = ~positive(corners)
    if turned.any():
        return np.asarray(turned)
    told = np.full(len(found.surface.vertices), 2 * np.pi)
    for loop, angles in zip(found.surface.loops, found.boundary_angles, strict=True):
        told[loop] = angles
    here, one, two = corners, np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)
    angle = np.angle(np.conj(one - here) * (two - here))
    sums = np.bincount(faces.ravel(), angle.ravel(), len(told))
    wound = np.abs(sums - told) > np.pi
    return np.asarray(wound[faces].any(axis=1))


def faithful(found: ConformalMap) -> bool:
    """Whether the angles drawn at the boundary add up to ``boundary_angles``."""
    faces = found.surface.faces
    inner = np.ones(len(found.surface.vertices), dtype=bool)
    inner[np.concatenate(found.surface.loops)] = False
    face, c = np.nonzero(~inner[faces])
    corners = found.corners()[face]
    k = np.arange(len(face))
    here = corners[k, c]
    a, b = corners[k, (c + 1) % 3] - here, corners[k, (c + 2) % 3] - here
    sums = np.bincount(faces[face, c], np.angle(np.conj(a) * b), len(inner))
    return all(
        bool((np.abs(sums[loop] - told) <= ANGLE).all())
        for loop, told in zip(found.surface.loops, found.boundary_angles, strict=True)
    )
