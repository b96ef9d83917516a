"""Evaluation and closest points against closed forms and finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface import NurbsSurface, surface_from_nurbs
from hexwrap_solver.surface.brep.surface import surface_from_patch
from hexwrap_solver.surface.errors import PoleError
from hexwrap_solver.surface.normals import with_tangents
from hexwrap_solver.surface.nurbs import domain, evaluate, evaluate_points, wrap
from hexwrap_solver.surface.nurbs_checks import check_pinches
from hexwrap_solver.surface.projection import project, start_parameters
from tests.solver.surface.nurbs_shapes import (
    cylinder,
    random_parameters,
    revolution,
    sample,
    swapped,
    torus_part,
)


def test_rational_circles_are_exact() -> None:
    points = evaluate_points(cylinder(), random_parameters(cylinder(), 300))
    np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), 2.0, rtol=1e-14)
    torus = evaluate(torus_part(), random_parameters(torus_part(), 300))
    x, y, z = torus.point.T
    np.testing.assert_allclose((np.hypot(x, y) - 5) ** 2 + z**2, 4.0, rtol=1e-13)
    centre = torus.point * [1, 1, 0] * (5 / np.hypot(x, y))[:, None]
    np.testing.assert_allclose(
        np.abs(np.einsum("ij,ij->i", torus.normal, torus.point - centre)), 2.0, rtol=1e-12
    )


@pytest.mark.parametrize(
    "surface", [sample("tower"), sample("waist"), torus_part(), swapped(cylinder(shear=1.0))]
)
def test_derivatives_agree_with_finite_differences(surface: NurbsSurface) -> None:
    """Central differences of order two: the error falls to a quarter when the step is halved."""
    at = random_parameters(surface, 40)
    jet = evaluate(surface, at)

    def centred(h: float) -> list[Floats]:
        du, dv = np.array([h, 0.0]), np.array([0.0, h])
        a, b, c, d = (evaluate(surface, at + e) for e in (du, -du, dv, -dv))
        first = [(a.point - b.point), (c.point - d.point)]
        second = [(a.du - b.du), (a.dv - b.dv), (c.dv - d.dv)]
        return [x / (2 * h) for x in first + second]

    width = min(high - low for low, high in (domain(surface, d) for d in (0, 1)))
    knots = np.concatenate([np.abs(at[:, [d]] - np.unique(surface.knots[d])) for d in (0, 1)], axis=1)
    inside = knots.min(axis=1) > 4e-3 * width
    assert inside.sum() > 20
    for exact, coarse, fine in zip(jet[1:], centred(2e-3 * width), centred(1e-3 * width), strict=True):
        scale = np.abs(exact).max() + 1e-3
        assert np.abs(fine - exact)[inside].max() < 3e-4 * scale
        assert np.abs(fine - exact)[inside].max() < 0.3 * np.abs(coarse - exact)[inside].max() + 1e-9 * scale


def test_periodic_and_clamped_forms_wrap_around() -> None:
    for surface in (sample("tower"), cylinder(), swapped(sample("tower"))):
        around = surface.closed.index(True)
        low, high = domain(surface, around)
        period = np.zeros(2)
        period[around] = high - low
        at = random_parameters(surface, 20)
        for a, b in zip(evaluate(surface, at), evaluate(surface, at - 3 * period), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-8 * np.abs(a).max() + 1e-12)
        assert wrap(surface, at + period)[:, around] == pytest.approx(at[:, around])
        assert (
            wrap(surface, np.array([[1e9, 1e9], [-1e9, -1e9]]))
            <= [domain(surface, 0)[1], domain(surface, 1)[1]]
        ).all()


@pytest.mark.parametrize(
    "surface", [sample("tower"), sample("facade"), torus_part(), swapped(sample("waist"))]
)
def test_projection_is_orthogonal_and_near(surface: NurbsSurface) -> None:
    at = random_parameters(surface, 200, seed=2)
    jet = evaluate(surface, at)
    size = np.ptp(jet.point, axis=0).max()
    lifted = jet.point + jet.normal * np.random.default_rng(3).uniform(-0.02, 0.02, (200, 1)) * size
    width = np.array([high - low for low, high in (domain(surface, d) for d in (0, 1))])
    start = at + np.random.default_rng(4).uniform(-0.02, 0.02, (200, 2)) * width
    points, parameters, normals = project(surface, lifted, start)
    np.testing.assert_allclose(points, evaluate_points(surface, parameters), atol=1e-9 * size)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    assert (
        np.linalg.norm(points - lifted, axis=1) <= np.linalg.norm(jet.point - lifted, axis=1) + 1e-9 * size
    ).all()
    open_way = surface.closed.index(False)
    low, high = domain(surface, open_way)
    inner = (parameters[:, open_way] > low) & (parameters[:, open_way] < high)
    assert inner.sum() > 150
    foot = evaluate(surface, parameters)
    for tangent in (foot.du, foot.dv):
        along = np.einsum(
            "ij,ij->i", lifted - points, tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
        )
        assert np.abs(along[inner]).max() < 1e-8 * size


def test_projection_stops_at_the_open_ends() -> None:
    surface = cylinder()
    above = np.array([[2.5, 0.0, 9.0], [0.0, -1.5, -4.0]])
    points, parameters, _ = project(surface, above, np.array([[0.1, 4.5], [3.0, 0.5]]))
    np.testing.assert_allclose(points, [[2, 0, 5], [0, -2, 0]], atol=1e-9)
    np.testing.assert_allclose(parameters[:, 1], [5, 0])


@pytest.mark.parametrize("before", [0.0, 1e-16, 1e-9, 1e-3])
def test_beyond_an_open_end_the_nearest_point_is_that_of_the_end_curve(before: float) -> None:
    """From a start a rounding error before the end, too, where it used to stay, 4e-5 of the size off."""
    surface = sample("tower")
    low, high = domain(surface, 1)
    rng = np.random.default_rng(5)
    at = np.stack([rng.uniform(*domain(surface, 0), 200), np.full(200, high)], axis=1)
    jet = evaluate(surface, at)
    size = np.ptp(jet.point, axis=0).max()
    beyond = jet.point + 1e-3 * size * (jet.normal + jet.dv / np.linalg.norm(jet.dv, axis=1, keepdims=True))
    start = at + rng.uniform(-0.02, 0.02, (200, 1)) * [1, 0] - [0, before * (high - low)]
    points, parameters, _ = project(surface, beyond, start)
    np.testing.assert_array_equal(parameters[:, 1], high)
    foot = evaluate(surface, parameters)
    along = np.einsum("ij,ij->i", beyond - points, foot.du / np.linalg.norm(foot.du, axis=1, keepdims=True))
    assert np.abs(along).max() < 1e-13 * size


def test_points_in_triangles_find_their_parameters_across_the_seam() -> None:
    surface = surface_from_nurbs(sample("tower"))
    count = len(surface.faces)
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], count)
    start = start_parameters(surface, np.arange(count), weights)
    flat = np.einsum("kc,kcd->kd", weights, surface.vertices[surface.faces])
    assert surface.nurbs is not None
    points, _, normals = project(surface.nurbs, flat, start)
    assert np.linalg.norm(points - flat, axis=1).max() < 0.03
    assert np.linalg.norm(evaluate_points(surface.nurbs, start) - flat, axis=1).max() < 0.2
    faces = surface.normals[surface.faces].mean(axis=1)
    assert np.einsum("ij,ij->i", normals, faces).min() > 0.9


def test_start_parameters_need_a_nurbs_surface() -> None:
    with pytest.raises(ValueError, match="NURBS"):
        start_parameters(
            replace(surface_from_nurbs(cylinder()), nurbs=None), np.array([0]), np.ones((1, 3)) / 3
        )


def test_where_tangents_vanish_the_mesh_normal_stands_in():
    """Everywhere else it only tells the side; all are of length one."""
    exact = np.array([[0.0, 0, 1], [0, 0, -1], [0, 0, 0], [1, 0, 0]])
    mesh = np.array([[0.0, 0.6, 0.8], [0, 0.6, 0.8], [0, 0, 2], [0, 0, 2]])
    expected = [[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 1]]
    np.testing.assert_array_equal(with_tangents(exact, mesh), expected)


@pytest.mark.parametrize(
    ("middle", "knots", "degree"),
    [(0.0, [0, 0, 1, 2, 2], 1), (-2.0, [0, 0, 0, 1, 1, 1], 2)],
    ids=["a kink at a knot", "the vertex of r = 2(1 − 2t)² between knots"],
)
def test_a_pinch_is_refused_with_its_place(middle: float, knots: list[float], degree: int) -> None:
    profile = np.array([[2.0, 0.0], [middle, 3.0], [2.0, 6.0]])
    pinched = revolution(profile, np.ones(3), np.array(knots, dtype=float), degree)
    with pytest.raises(PoleError, match=r"pinched to a point at \(.*, 3\)"):
        surface_from_patch(pinched)


def test_a_narrow_waist_is_no_pinch() -> None:
    profile = np.array([[2.0, 0.0], [0.02, 3.0], [2.0, 6.0]])
    check_pinches(revolution(profile, np.ones(3), np.array([0.0, 0, 1, 2, 2]), 1))
