"""The circumcircle-preserving projective map (Springborn, Schröder, Pinkall 2008) against its theorems."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.arrays import Complexes, Floats
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.domain.interpolate import domain_weights, surface_weights
from tests.solver.conformal.annuli import bump, catenoid


@pytest.fixture(scope="module")
def coarse() -> ConformalMap:
    return conformal_map(bump(24, 8), BoundaryCondition())


def test_the_two_directions_are_inverse(coarse: ConformalMap) -> None:
    face = np.arange(len(coarse.surface.faces))
    given = np.random.default_rng(0).dirichlet([1, 1, 1], size=len(face))
    back = domain_weights(coarse, face, surface_weights(coarse, face, given))
    np.testing.assert_allclose(back, given, atol=1e-14)


def test_neighbours_agree_along_their_common_edge(coarse: ConformalMap) -> None:
    """On an edge the weights depend on its two ends alone, so the map is continuous."""
    faces = coarse.surface.faces
    face = np.arange(len(faces))
    on_edge = surface_weights(coarse, face, np.tile([0.3, 0.7, 0.0], (len(face), 1)))
    u = coarse.log_scale
    expected = 0.7 * np.exp(u[faces[:, 1]]) / (0.3 * np.exp(u[faces[:, 0]]))
    np.testing.assert_allclose(on_edge[:, 1] / on_edge[:, 0], expected, rtol=1e-12)
    assert not on_edge[:, 2].any()


def test_circumcircles_go_to_circumcircles(coarse: ConformalMap) -> None:
    face = np.arange(len(coarse.surface.faces))
    corners = coarse.corners()
    center = _circumcenter(corners)
    on_circle = 2 * center - corners[:, 0]  # opposite to corner 0
    image = _combine(
        surface_weights(coarse, face, _barycentric(corners, on_circle)),
        coarse.surface.vertices[coarse.surface.faces],
    )
    points = coarse.surface.vertices[coarse.surface.faces]
    origin, x, y = _frame(points)
    flat = np.einsum("fcd,fd->fc", points - origin[:, None], x) + 1j * np.einsum(
        "fcd,fd->fc", points - origin[:, None], y
    )
    landed = np.einsum("fd,fd->f", image - origin, x) + 1j * np.einsum("fd,fd->f", image - origin, y)
    radius = np.abs(flat[:, 0] - _circumcenter(flat))
    np.testing.assert_allclose(np.abs(landed - _circumcenter(flat)), radius, rtol=1e-8)


def test_projective_interpolation_is_nearer_to_the_smooth_map_of_the_catenoid() -> None:
    assert _catenoid_error(projective=True) < 0.7 * _catenoid_error(projective=False)


def _catenoid_error(projective: bool) -> float:
    """Root mean square distance along the surface between the interpolated and the smooth map."""
    cmap = conformal_map(catenoid(24, 6), BoundaryCondition())
    random = np.random.default_rng(0)
    face = random.integers(len(cmap.surface.faces), size=4000)
    given = random.dirichlet([1, 1, 1], size=len(face))
    z = (cmap.corners()[face] * given).sum(axis=1) - cmap.uv[0].real
    phi, height = 2 * np.pi * z.real / cmap.circumference, 2 * np.pi * z.imag / cmap.circumference - 0.5
    weights = surface_weights(cmap, face, given) if projective else given
    x, y, landed = _combine(weights, cmap.surface.vertices[cmap.surface.faces[face]]).T
    across = np.cosh(height) * np.angle(np.exp(1j * (np.arctan2(y, x) - phi)))
    along = np.tanh(height) * (np.hypot(x, y) - np.cosh(height)) + (landed - height) / np.cosh(height)
    return float(np.sqrt((across**2 + along**2).mean()))


def _combine(weights: Floats, points: Floats) -> Floats:
    return np.asarray(np.einsum("fc,fcd->fd", weights, points))


def _circumcenter(z: Complexes) -> Complexes:
    b, c = z[:, 1] - z[:, 0], z[:, 2] - z[:, 0]
    return np.asarray(z[:, 0] + (np.abs(b) ** 2 * c - np.abs(c) ** 2 * b) / (b.conj() * c - c.conj() * b))


def _barycentric(z: Complexes, point: Complexes) -> Floats:
    area = ((z[:, 1] - z[:, 0]).conj() * (z[:, 2] - z[:, 0])).imag
    second = ((point - z[:, 0]).conj() * (z[:, 2] - z[:, 0])).imag / area
    third = ((z[:, 1] - z[:, 0]).conj() * (point - z[:, 0])).imag / area
    return np.stack([1 - second - third, second, third], axis=1)


def _frame(points: Floats) -> tuple[Floats, Floats, Floats]:
    x = points[:, 1] - points[:, 0]
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = points[:, 2] - points[:, 0]
    y = y - np.einsum("fd,fd->f", x, y)[:, None] * x
    return points[:, 0], x, y / np.linalg.norm(y, axis=1, keepdims=True)
