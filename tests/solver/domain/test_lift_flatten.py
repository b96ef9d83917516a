"""lift and flatten are inverse to each other, on every sheet, and say what lies outside."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.domain import flatten, lift
from hexwrap_solver.domain.locate import TriangleIndex
from tests.solver.pattern import annuli

CATENOID = annuli.revolution(np.cosh, np.linspace(-1, 1.5, 25), 40, cut=9, turn=1.7 * np.exp(0.4j))
CONES = {k: annuli.flat_cone(k * np.pi / 3, 1.0, 2.0, 60, 12, cut=11) for k in (1, 3, -2, 5)}


def places_in(cmap, rng, count):
    """Random places inside random triangles, in the layout's own sheet."""
    face = rng.integers(len(cmap.surface.faces), size=count)
    weights = rng.dirichlet([1, 1, 1], size=count)
    return (weights * cmap.corners()[face]).sum(axis=1)


@pytest.mark.parametrize("cmap", [CATENOID, *CONES.values()])
@given(seed=st.integers(0, 2**31), sheet=st.integers(-3, 3))
@settings(max_examples=10, deadline=None)
def test_round_trip_from_any_sheet(cmap, seed, sheet):
    z = places_in(cmap, np.random.default_rng(seed), 50)
    up = lift(cmap, cmap.deck.apply(z, sheet))
    assert up.inside.all()
    back = flatten(cmap, up.points)
    assert back.distance.max() < 1e-9
    again = lift(cmap, back.uv)
    np.testing.assert_allclose(again.points, up.points, atol=1e-9)
    turns = [abs(cmap.deck.apply(back.uv, s) - z) for s in range(-8, 9)]
    assert np.min(turns, axis=0).max() < 1e-9


def test_lifted_points_do_not_depend_on_the_sheet():
    z = places_in(CATENOID, np.random.default_rng(5), 200)
    first = lift(CATENOID, z)
    for sheet in (-40, -1, 1, 2, 17):
        np.testing.assert_allclose(
            lift(CATENOID, CATENOID.deck.apply(z, sheet)).points, first.points, atol=1e-9
        )


def test_vertices_lift_to_themselves_with_their_normals():
    up = lift(CATENOID, CATENOID.uv)
    np.testing.assert_allclose(up.points, CATENOID.surface.vertices, atol=1e-9)
    np.testing.assert_allclose(up.normals, CATENOID.surface.normals, atol=1e-7)


@pytest.mark.parametrize("angle", [2e-3, 1e-3, -1e-3, 1e-6, 2e-9])
def test_all_turns_of_a_cone_that_is_nearly_a_cylinder_lead_to_the_same_points(angle, monkeypatch):
    """Also the thousandth, without trying the thousands before, and so for places outside."""
    cone = annuli.flat_cone(angle, 1 / abs(angle), 1 / abs(angle) + 0.5, 40, 8, cut=7)
    z = places_in(cone, np.random.default_rng(3), 100)
    first = lift(cone, z)
    assert first.inside.all()
    searches = []
    find = TriangleIndex.find
    monkeypatch.setattr(TriangleIndex, "find", lambda self, at: (searches.append(at), find(self, at))[1])
    for sheet in (-1, 1, 5, 1000, -1200):
        again = lift(cone, cone.deck.apply(z, sheet))
        np.testing.assert_allclose(again.points, first.points, atol=1e-5)
    assert not lift(cone, cone.deck.apply(z, 3) * (1 + 2 * abs(angle))).inside.any()
    assert len(searches) < 6 * 140


def test_places_outside_are_told():
    beyond = CATENOID.uv[CATENOID.surface.loops[0]] - 0.5j * CATENOID.deck.translation
    mixed = np.concatenate([beyond, CATENOID.uv[:3], [complex(np.nan, 0)]])
    up = lift(CATENOID, mixed)
    assert up.inside.tolist() == [False] * len(beyond) + [True] * 3 + [False]
    assert np.isnan(up.points[~up.inside]).all()
    assert np.isfinite(up.points[up.inside]).all()


@pytest.mark.parametrize("k", CONES)
def test_places_at_any_distance_are_outside(k):
    assert not lift(CONES[k], np.array([1e30, 1e30j, -1e300, complex(0, np.inf)])).inside.any()


@pytest.mark.parametrize("cmap", [CATENOID, *CONES.values()])
def test_places_beyond_all_domains_are_outside(cmap):
    largest = np.finfo(float).max
    far = [complex(x, y) for x in (largest, 0, -1e301) for y in (largest, -largest, 1e155)]
    up = lift(cmap, np.array([*far, cmap.uv[5]]))
    assert up.inside.tolist() == [False] * len(far) + [True]
