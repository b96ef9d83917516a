"""Whether an unrolled map, as drawn, is what its metric says, beyond the rounding of its corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats
from hexwrap_solver.conformal.net import Net
from hexwrap_solver.conformal.types import ConformalMap

#: Corners are good to a few roundings of their distance from the origin.
ROUNDINGS = 32 * np.finfo(np.float64).eps
#: What the rounding of corners does to an angle, times their distance over its shorter side.
CORNER = 16 * np.finfo(np.float64).eps
#: Boundary angles are promised to 1e-9, and so is their sum, per √n of n angles.
ANGLE, TURN = 5e-10, 1e-9


def positively_oriented(corners: Complexes) -> Bools:
    """(m,) whether the area of each triangle, corners (m, 3), is certainly above zero."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = (np.conj(a) * b).imag
    longest = np.maximum(np.maximum(np.abs(a), np.abs(b)), np.abs(b - a))
    far = np.abs(corners)
    farthest = np.maximum(np.maximum(far[:, 0], far[:, 1]), far[:, 2])
    return np.asarray(area > ROUNDINGS * farthest * longest)


def inverted(found: ConformalMap) -> Bools:
    """(m,) triangles that are turned over; if there are none, those around vertices that they go around too
    often or too seldom: one whose corner opens by more than 2π looks positive in the plane."""
    faces, corners = found.surface.faces, found.corners()
    turned = ~positively_oriented(corners)
    if turned.any():
        return np.asarray(turned)
    expected = np.full(len(found.surface.vertices), 2 * np.pi)
    expected[found.cones.vertex] -= found.cones.curvature
    for loop, angles in zip(found.surface.loops, found.boundary_angles, strict=True):
        expected[loop] = angles
    here, one, two = corners, np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)
    angle = np.angle(np.conj(one - here) * (two - here))
    sums = np.bincount(faces.ravel(), angle.ravel(), len(expected))
    wound = np.abs(sums - expected) > np.pi
    return np.asarray(wound[faces].any(axis=1))


def faithful(found: ConformalMap) -> bool:
    """Whether the angles drawn at the boundary add up to ``boundary_angles``, those at cones to their
    angle, and these to the curvatures of loops."""
    sums, _ = _drawn(found)
    return bool(_angle_errors(found, sums).max(initial=0.0) <= ANGLE and _closing_error(found, sums) <= TURN)


@dataclass(frozen=True)
class LayoutErrors:
    """angle: how far the angles drawn at the boundary are off ``boundary_angles``, beyond the rounding of
    corners, which short edges far from the origin cannot do without. turn: how far the first loop of an
    annulus is from turning by the cone angle, per √n of its n vertices, as single roundings add up; of other
    nets, how far the edges across the cut are from closing, over the diameter."""

    angle: float
    turn: float


def layout_errors(found: ConformalMap) -> LayoutErrors:
    """Of a map as drawn, radians."""
    sums, rounding = _drawn(found)
    angle = float((_angle_errors(found, sums) - rounding).max(initial=0.0))
    return LayoutErrors(angle, _closing_error(found, sums))


def _angle_errors(found: ConformalMap, sums: Floats) -> Floats:
    expected = np.concatenate([*found.boundary_angles, 2 * np.pi - found.cones.curvature])
    return np.asarray(np.abs(sums - expected))


def _closing_error(found: ConformalMap, sums: Floats) -> float:
    """Of annuli, how far loop 0 is from turning by the cone angle; of other nets, how far the edges across
    the cut are from closing."""
    if isinstance(found.domain, Net):
        return found.domain.gap(found.surface.twin)
    n = len(found.surface.loops[0])
    return abs(float((np.pi - sums[:n]).sum()) - found.deck.angle) / float(np.sqrt(n))


def _drawn(found: ConformalMap) -> tuple[Floats, Floats]:
    """(b,) angle sums of the vertices on all loops, and of the cones, as drawn, and (b,) what the rounding of
    corners may do to them."""
    faces, some = found.surface.faces, np.concatenate([*found.surface.loops, found.cones.vertex])
    inner = np.ones(len(found.surface.vertices), dtype=bool)
    inner[some] = False
    face, c = np.nonzero(~inner[faces])
    corners = found.corners()[face]
    k = np.arange(len(face))
    here = corners[k, c]
    a, b = corners[k, (c + 1) % 3] - here, corners[k, (c + 2) % 3] - here
    sums = np.bincount(faces[face, c], np.angle(np.conj(a) * b), len(inner)).astype(np.float64)
    rounding = np.zeros(len(inner))
    shortest = np.maximum(np.minimum(np.abs(a), np.abs(b)), np.finfo(float).tiny)
    np.maximum.at(rounding, faces[face, c], CORNER * np.abs(here) / shortest)
    return sums[some], rounding[some]
