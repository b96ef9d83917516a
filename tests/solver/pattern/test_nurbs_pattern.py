"""Patterns on NURBS surfaces: vertices on the surface itself, directions that follow its tangents."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.surface import MeshSettings, NurbsSurface, surface_from_nurbs


@pytest.fixture(scope="module")
def cylinder() -> ConformalMap:
    """An exact round cylinder, radius 2, height 5: u runs around, v along the axis."""
    w = np.sqrt(0.5)
    ring = [
        (1, 0, 1),
        (1, 1, w),
        (0, 1, 1),
        (-1, 1, w),
        (-1, 0, 1),
        (-1, -1, w),
        (0, -1, 1),
        (1, -1, w),
        (1, 0, 1),
    ]
    points = np.array([[(2 * x, 2 * y, z, weight) for z in (0.0, 5.0)] for x, y, weight in ring])
    knots = (np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4.0]), np.array([0, 0, 1, 1.0]))
    nurbs = NurbsSurface((2, 1), knots, points, (True, False))
    return conformal_map(surface_from_nurbs(nurbs, MeshSettings(max_edge=0.5)), BoundaryCondition())


def test_vertices_lie_on_the_nurbs_surface_with_its_normals(cylinder):
    pattern = lay_pattern(cylinder, PatternSettings(around=40, boundary="trim"))
    radial = pattern.vertices[:, :2]
    np.testing.assert_allclose(np.linalg.norm(radial, axis=1), 2, atol=1e-9)
    outward = pattern.normals[:, :2] * radial / 2
    np.testing.assert_allclose(abs(outward.sum(axis=1)), 1, atol=1e-9)
    mesh = cylinder.surface
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    side = np.sign((np.cross(b - a, c - a) * a * [1, 1, 0]).sum())
    assert (np.sign(outward.sum(axis=1)) == side).all()


def test_edges_follow_u_and_v(cylinder):
    along_u = lay_pattern(cylinder, PatternSettings(around=40, rotation="u"))
    assert along_u.rotation == pytest.approx(0, abs=1e-9)
    along_v = lay_pattern(cylinder, PatternSettings(around=40, rotation="v"))
    assert abs(along_v.rotation) == pytest.approx(np.pi / 6, abs=1e-9)
    assert any("follow" in note for note in along_v.notes)
