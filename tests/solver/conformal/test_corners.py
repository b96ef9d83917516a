"""Listed boundary angles: met to rounding where equation (1) allows, refused with a way out elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.corners import GAUSS_BONNET_TOLERANCE, boundary_angles
from hexwrap_solver.conformal.types import ANGLE_UNITS, AngleUnit, BoundaryAngle, BoundaryCondition, Quantum
from hexwrap_solver.errors import BoundaryError, GaussBonnetError, SettingError
from hexwrap_solver.surface.types import Surface
from tests.solver.conformal.annuli import bump, corners_at
from tests.solver.conformal.test_conformal_map import assert_honest

SURFACE = bump(36, 12)
TOP = SURFACE.loops[1]


def listed(*pairs: tuple[int, float], quantum: Quantum = "none") -> BoundaryCondition:
    vertices, angles = zip(*pairs, strict=True)
    return corners_at(np.array(vertices), np.array(angles, dtype=float), quantum=quantum)


def test_an_entrance_on_a_cylinder() -> None:
    """Figure 7: 4π/3, π/3, 4π/3 on the lower loop bend it inwards, and the domain stays a cylinder."""
    wanted = {10: 4 * np.pi / 3, 14: np.pi / 3, 18: 4 * np.pi / 3}
    cmap = conformal_map(SURFACE, listed(*wanted.items()))
    assert_honest(cmap)
    assert cmap.kind == "cylinder"
    straight = np.full(36, np.pi)
    straight[list(wanted)] = list(wanted.values())
    np.testing.assert_allclose(cmap.boundary_angles[0], straight, atol=1e-9)
    np.testing.assert_allclose(cmap.boundary_angles[1], np.pi, atol=1e-9)


def test_corners_on_both_loops_make_a_cone() -> None:
    """Figure 5, middle: three corners on one loop and their counterparts on the other."""
    bottom = [(v, np.pi - np.pi / 3) for v in (0, 12, 24)]
    top = [(int(TOP[k]), np.pi + np.pi / 3) for k in (0, 12, 24)]
    cmap = conformal_map(SURFACE, listed(*bottom, *top, quantum="hex"))
    assert_honest(cmap)
    assert cmap.deck.angle == pytest.approx(np.pi, abs=1e-14)


def test_points_mean_their_nearest_boundary_vertex() -> None:
    near = SURFACE.vertices[[5, int(TOP[3])]] * 1.001
    angles = (2.0, 2 * np.pi - 2.0)
    entries = (BoundaryAngle(a, point=tuple(p)) for a, p in zip(angles, near.tolist(), strict=True))
    condition = BoundaryCondition("angles", tuple(entries))
    bottom, top = boundary_angles(SURFACE, condition)
    assert bottom[5] == pytest.approx(2.0)
    assert top[3] == pytest.approx(2 * np.pi - 2.0)


@settings(max_examples=30, deadline=None)
@given(st.floats(-0.99e-3, 0.99e-3), st.sampled_from(["none", "hex", "quad"]))
def test_a_small_rest_goes_to_the_vertices_left_at_pi(rest: float, quantum: Quantum) -> None:
    condition = listed((4, 2 * np.pi / 3), (int(TOP[4]), 4 * np.pi / 3 + rest), quantum=quantum)
    bottom, top = boundary_angles(SURFACE, condition)
    assert (np.pi - bottom).sum() + (np.pi - top).sum() == pytest.approx(0, abs=1e-12)
    assert bottom[4] == 2 * np.pi / 3
    assert top[4] == 4 * np.pi / 3 + rest
    others = np.concatenate([np.delete(bottom, 4), np.delete(top, 4)])
    assert np.abs(others - np.pi).max() <= abs(rest) / 30 + 1e-15
    if quantum == "hex":
        assert (np.pi - bottom).sum() == pytest.approx(np.pi / 3, abs=1e-13)


def test_gauss_bonnet_names_both_sums_what_is_missing_and_an_example_that_closes() -> None:
    with pytest.raises(GaussBonnetError) as caught:
        boundary_angles(SURFACE, listed((3, 4 * np.pi / 3), (int(TOP[0]), np.pi / 2)))
    data = caught.value.data
    assert data["loop_sums"] == pytest.approx([-np.pi / 3, np.pi / 2])
    assert data["missing"] == pytest.approx(np.pi / 6)
    for figure in ("-1.0472", "1.5708", "0.523599", "more"):
        assert figure in caught.value.detail
    assert_closes(SURFACE, data["example"])


@pytest.mark.parametrize(
    ("unit", "told"), [("deg", ("-60°", "90°", "30°")), ("pi", ("-0.333333 π", "0.5 π"))]
)
def test_gauss_bonnet_speaks_the_unit_of_the_request(unit: AngleUnit, told: tuple[str, ...]) -> None:
    asked = listed((3, 4 * np.pi / 3), (int(TOP[0]), np.pi / 2))
    with pytest.raises(GaussBonnetError) as caught:
        boundary_angles(SURFACE, replace(asked, angle_unit=unit))
    assert all(figure in caught.value.detail for figure in told)
    assert " rad" not in caught.value.detail
    example, data = caught.value.data["example"], caught.value.data
    assert data["example_unit"] == unit
    scaled = [{**entry, "angle": entry["angle"] * ANGLE_UNITS[unit]} for entry in example]
    assert_closes(SURFACE, scaled)


@pytest.mark.parametrize(
    "pairs",
    [[(3, 30.0)], [(v, 0.01) for v in range(30)], [(v, 0.2) for v in range(36)], [(0, 1.0), (1, 5.0)]],
)
def test_the_example_always_closes(pairs: list[tuple[int, float]]) -> None:
    with pytest.raises(GaussBonnetError) as caught:
        boundary_angles(SURFACE, listed(*pairs))
    assert_closes(SURFACE, caught.value.data["example"])


def test_the_example_closes_where_every_vertex_is_listed() -> None:
    with pytest.raises(GaussBonnetError) as caught:
        boundary_angles(SURFACE, listed(*((int(v), 0.2) for v in np.concatenate(SURFACE.loops))))
    assert_closes(SURFACE, caught.value.data["example"])


def assert_closes(surface: Surface, example: object) -> None:
    assert isinstance(example, list)
    angles = boundary_angles(surface, listed(*((e["vertex"], e["angle"]) for e in example)))
    assert np.concatenate(angles).min() > 0
    assert abs(sum((np.pi - a).sum() for a in angles)) < GAUSS_BONNET_TOLERANCE


@pytest.mark.parametrize("angle", [0.0, -1.0, np.nan, np.inf])
def test_angles_that_no_vertex_can_have(angle: float) -> None:
    with pytest.raises(BoundaryError, match="positive") as caught:
        boundary_angles(SURFACE, listed((0, 3.0), (1, angle)))
    assert caught.value.field == ("angles", 1, "angle")


def test_angles_too_large_for_any_surface() -> None:
    with pytest.raises(BoundaryError, match=r"too large.*set angle_unit to") as caught:
        boundary_angles(SURFACE, listed((7, 300.0)))
    assert caught.value.vertices == [7]


def test_vertices_inside_are_refused_with_the_nearest_boundary_vertex() -> None:
    with pytest.raises(BoundaryError, match="nearest to 40 is 4,") as caught:
        boundary_angles(SURFACE, listed((0, 3.0), (40, 3.2)))
    assert caught.value.vertices == [40]
    assert caught.value.field == ("angles", 1, "vertex")


def test_vertices_that_were_never_sent() -> None:
    for vertex in (10_000, -1):
        with pytest.raises(BoundaryError, match="only vertices 0 to"):
            boundary_angles(SURFACE, listed((vertex, 3.0)))


def test_one_vertex_listed_twice() -> None:
    with pytest.raises(BoundaryError, match="0 and 2 mean the same vertex") as caught:
        boundary_angles(SURFACE, listed((4, 3.0), (5, 3.0), (4, 3.3)))
    assert caught.value.vertices == [4]


def test_an_entry_names_a_vertex_or_a_point() -> None:
    for place in ({}, {"vertex": 3, "point": (0.0, 0.0, 0.0)}):
        with pytest.raises(SettingError, match="either 'vertex' or 'point'"):
            BoundaryAngle(3.0, **place)


def test_a_point_that_is_nowhere() -> None:
    with pytest.raises(BoundaryError, match="not finite numbers"):
        boundary_angles(SURFACE, BoundaryCondition("angles", (BoundaryAngle(3.0, point=(0.0, np.nan, 0.0)),)))


@pytest.mark.parametrize("all_of", [(0,), (1,), (0, 1)])
def test_a_loop_whose_vertices_are_all_listed_gives_way_to_the_quantum(all_of: tuple[int, ...]) -> None:
    """Angles typed with four digits: K must still be a multiple, or no pattern closes up."""
    surface = bump(24, 8)
    vertices = np.concatenate([loop if k in all_of else loop[:3] for k, loop in enumerate(surface.loops)])
    loop_of = np.isin(vertices, surface.loops[1]).astype(int)
    counts = np.bincount(loop_of)
    angles = np.round(np.pi + np.array([-1, 1])[loop_of] * np.pi / 3 / counts[loop_of], 5)
    condition = corners_at(vertices, angles, quantum="hex")
    first, second = boundary_angles(surface, condition)
    assert (np.pi - first).sum() == pytest.approx(np.pi / 3, abs=1e-12)
    assert (np.pi - second).sum() == pytest.approx(-np.pi / 3, abs=1e-12)


def test_a_list_without_angles_is_straight_and_says_so() -> None:
    empty = conformal_map(SURFACE, BoundaryCondition("angles"))
    straight = conformal_map(SURFACE, BoundaryCondition())
    assert np.array_equal(empty.uv, straight.uv)
    assert any("list of angles is empty" in note for note in empty.notes)
    assert straight.notes == ()
