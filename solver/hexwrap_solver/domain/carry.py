"""From a place in a triangle of the domain to the point on the surface (paper, definition 1)."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap


def barycentric(corners: Complexes, place: Complexes) -> Floats:
    """(k, 3) barycentric coordinates of places in triangles with corners (k, 3) in the plane."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = place - corners[:, 0]
    area = a.real * b.imag - a.imag * b.real
    second = (p.real * b.imag - p.imag * b.real) / area
    third = (a.real * p.imag - a.imag * p.real) / area
    return np.stack([1 - second - third, second, third], axis=1)


def surface_weights(cmap: ConformalMap, face: Ints, weights: Floats) -> Floats:
    """Barycentric coordinates on the surface of places with given ones in the domain."""
    return weights


def carry(cmap: ConformalMap, face: Ints, weights: Floats) -> tuple[Floats, Floats]:
    """Points and unit normals (k, 3) on the surface at barycentric coordinates (k, 3)."""
    surface = cmap.surface
    points = np.einsum("kc,kcd->kd", weights, surface.vertices[surface.faces[face]])
    normals = np.einsum("kc,kcd->kd", weights, surface.normals[surface.faces[face]])
    return points, normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
