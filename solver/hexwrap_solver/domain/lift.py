"""Drawings in the unrolled domain, carried onto the surface (paper, definition 1: Φ: D → M)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.interpolate import surface_weights
from hexwrap_solver.domain.locate import find_places
from hexwrap_solver.geometry import weighted

#: No domain reaches so far; larger coordinates would overflow on the way.
BEYOND = 1e300


@dataclass(frozen=True)
class Lifted:
    """points, normals: (k, 3) on the surface, NaN where a place is outside the domain. inside: (k,).
    face: (k,) triangle of cmap.surface, −1 outside; barycentric: (k, 3) there, on the surface."""

    points: Floats
    normals: Floats
    inside: Bools
    face: Ints
    barycentric: Floats


def lift(cmap: ConformalMap, places: Complexes) -> Lifted:
    """Carry (k,) complex places of the unrolled domain, on any sheet, onto the surface.

    z and g(z) go to the same point. Where the unrolled domain overlaps itself, the sheet nearest to 0 is
    meant; a net has one image, and where that overlaps itself the deepest place counts. Never raises: what
    lies outside is marked in ``inside``.
    """
    places = np.asarray(places, dtype=complex).ravel()
    known = (np.abs(places.real) <= BEYOND) & (np.abs(places.imag) <= BEYOND)  # NaN is not
    face = np.full(len(places), -1, dtype=np.int64)
    weights = np.zeros((len(places), 3))
    face[known], weights[known] = find_places(cmap, places[known])
    inside = face >= 0
    on_surface = np.full((len(places), 3), np.nan)
    on_surface[inside] = surface_weights(cmap, face[inside], weights[inside])
    points, normals = np.full((2, len(places), 3), np.nan)
    points[inside], normals[inside] = points_at(cmap, face[inside], on_surface[inside])
    return Lifted(points, normals, inside, face, on_surface)


def points_at(cmap: ConformalMap, face: Ints, weights: Floats) -> tuple[Floats, Floats]:
    """Points and unit normals (k, 3) of the mesh at barycentric coordinates (k, 3) on the surface."""
    surface = cmap.surface
    points = weighted(surface.vertices, surface.faces[face], weights)
    return points, surface.normals_at(face, weights)
