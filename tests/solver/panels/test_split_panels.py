"""Individual panels: flat, regular, of few sizes, and never overlapping (contract, ``panels``)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.errors import PanelsError
from hexwrap_solver.panels import fit_panels, measure, quantize, rationalize
from hexwrap_solver.panels.fit import collapsed_note
from hexwrap_solver.panels.limits import inscribed
from hexwrap_solver.panels.regular import nearest_regular
from hexwrap_solver.panels.tangents import surface_normals
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.surface import surface_from_nurbs
from hexwrap_solver.surface.types import NurbsSurface
from tests.solver.panels.cells import (
    catenoid,
    cylinder,
    grid_map,
    hex_pattern,
    inverted,
    normals,
    quad_pattern,
    sphere,
    torus,
    triangle_pattern,
)

SURFACES = {"cylinder": cylinder, "catenoid": catenoid, "sphere": sphere, "torus": torus}


def panelize(chart, around=24, rings=8, make=hex_pattern, **wanted):
    pattern = make(chart, around, rings, -0.6)
    cmap = grid_map(chart, 96, 60, -0.7, 1.8)
    panels = rationalize(cmap, pattern, PanelSettings(**wanted))
    return pattern, panels, measure(cmap, pattern, panels)


@pytest.mark.parametrize("chart", SURFACES.values(), ids=SURFACES)
@pytest.mark.parametrize("target", ["shortest", "inscribed"])
def test_panels_are_flat_regular_of_few_sizes_and_apart(chart, target):
    _, panels, quality = panelize(chart, target=target, sizes=5)
    assert quality.planarity.max() < 1e-12
    assert quality.edge_deviation.max() < 1e-12
    assert quality.angle_deviation.max() < 1e-12
    assert quality.overlaps == 0
    assert quality.convex.all()
    assert len(panels.class_length) <= 5
    assert (panels.edge_length == panels.class_length[panels.size]).all()
    assert (panels.class_count == np.bincount(panels.size)).all()
    assert np.nanmin(quality.gap_tangential) > -1e-12
    assert 0.7 < quality.coverage < 1


@settings(max_examples=25, deadline=None)
@given(
    st.floats(-1.5, 1.5),
    st.floats(-1.5, 1.5),
    st.floats(2.5, 6.0),
    st.sampled_from(list(SURFACES)),
    st.sampled_from(["shortest", "inscribed"]),
    st.sampled_from(["fit", "tangent"]),
    st.sampled_from([hex_pattern, quad_pattern, triangle_pattern]),
)
def test_nothing_overlaps_on_any_surface(x, y, z, name, target, orientation, make):
    chart = inverted(SURFACES[name], (x, y, z))
    _, _, quality = panelize(chart, make=make, target=target, orientation=orientation, sizes=None)
    assert quality.overlaps == 0
    assert quality.planarity.max() < 1e-9


def test_targets_are_ordered():
    """The shortest-edge rule, made safe, is never longer than the largest panel that fits."""
    chart = inverted(catenoid, (0.3, 0.2, 4.0))
    pattern, cmap = hex_pattern(chart, 30, 9, -0.6), grid_map(chart, 60, 40, -0.7, 1.5)
    limit = {
        t: fit_panels(cmap, pattern, PanelSettings(target=t)).limit for t in ("shortest", "inscribed", "mean")
    }
    assert (limit["shortest"] <= limit["inscribed"] * (1 + 1e-12)).all()
    assert limit["shortest"].mean() < limit["inscribed"].mean() < limit["mean"].mean()


def test_watertight_panels_that_lost_an_edge_are_told():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    narrow = square * [1.0, 1e-4, 1.0]
    assert collapsed_note(Ragged.from_table(np.stack([square, square]))) == ()
    (note,) = collapsed_note(Ragged.from_table(np.stack([square, narrow])))
    assert "of their mean edge: 1;" in note


def test_joints_that_mean_panels_cannot_keep_are_told():
    _, told, _ = panelize(catenoid, target="mean", joint=0.01)
    assert any("joints of 0.01 are not kept" in note for note in told.notes)
    _, quiet, _ = panelize(catenoid, target="inscribed", joint=0.01)
    assert not any("joint" in note for note in quiet.notes)


def test_mean_panels_overlap_and_the_measurement_sees_it():
    _, _, quality = panelize(catenoid, target="mean", sizes=None)
    assert quality.overlaps > 100
    assert np.nanmin(quality.gap_tangential) < 0


def test_joint_is_left_open():
    pattern, _, quality = panelize(torus, joint=0.01, sizes=None)
    assert np.nanmin(quality.gap_tangential) >= 0.01 - 1e-12
    assert np.nanmin(quality.gap_tangential) < 0.02 * pattern.edge_length + 0.01


def test_tangent_panels_lie_in_tangent_planes():
    """The normals of a fine mesh differ from the surface's by the square of its edge length."""
    pattern, cmap = hex_pattern(torus, 24, 8, -0.6), grid_map(torus, 192, 120, -0.7, 1.8)
    panels = rationalize(cmap, pattern, PanelSettings(orientation="tangent"))
    middle = pattern.uv[pattern.faces.values].reshape(-1, 6)
    x = np.angle(np.exp(1j * middle.real).mean(axis=1))
    expected = normals(torus, x, middle.imag.mean(axis=1))
    angle = np.degrees(np.arccos(np.clip(np.einsum("qd,qd->q", panels.normal, expected), -1, 1)))
    fitted = rationalize(cmap, pattern, PanelSettings()).normal
    assert angle.max() < 0.5
    assert np.degrees(np.arccos(np.einsum("qd,qd->q", fitted, expected))).max() > 2 * angle.max()


def test_tangents_of_a_nurbs_surface_are_its_own():
    surface = surface_from_nurbs(cylinder_of_radius(3.0))
    rng = np.random.default_rng(0)
    angle = rng.uniform(0, 2 * np.pi, 200)
    points = np.stack([3 * np.cos(angle), 3 * np.sin(angle), rng.uniform(0.5, 3.5, 200)], axis=1)
    found = surface_normals(surface, points * [0.99, 0.99, 1.0])
    radial = points * [1 / 3, 1 / 3, 0]
    assert np.allclose(np.abs(np.einsum("kd,kd->k", found, radial)), 1, atol=1e-9)
    outside = np.einsum("kd,kd->k", surface.normals, surface.vertices * [1, 1, 0]).mean()
    assert (np.einsum("kd,kd->k", found, radial) * outside > 0).all()


def cylinder_of_radius(r: float) -> NurbsSurface:
    """Nine rational control points around, two along the axis."""
    corner = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]]) * r
    weight = np.where(np.arange(9) % 2, np.sqrt(0.5), 1.0)
    points = np.zeros((9, 2, 4))
    points[:, :, :2] = corner[:, None]
    points[:, 1, 2] = 4.0
    points[:, :, 3] = weight[:, None]
    around = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]) / 4.0
    return NurbsSurface((2, 1), (around, np.array([0.0, 0, 1, 1])), points, (True, False))


def test_sizes_follow_a_rigid_motion_and_a_change_of_scale():
    turn = Rotation.from_rotvec([0.5, 1.0, -2.0]).as_matrix()
    moved = lambda x, y: 12.5 * torus(x, y) @ turn.T + [30.0, 4.0, -9.0]  # noqa: E731
    _, here, before = panelize(torus)
    _, there, after = panelize(moved)
    assert np.allclose(there.class_length, 12.5 * here.class_length, rtol=1e-8)
    assert np.allclose(
        there.polygons.values, 12.5 * here.polygons.values @ turn.T + [30.0, 4.0, -9.0], atol=1e-6
    )
    assert after.coverage == pytest.approx(before.coverage, rel=1e-8)
    assert np.allclose(after.surface_distance, 12.5 * before.surface_distance, atol=1e-7)


def test_the_fit_does_not_depend_on_the_sizes():
    pattern, cmap = hex_pattern(torus, 24, 6), grid_map(torus, 48, 30, -0.1, 1.2)
    wanted = PanelSettings(sizes=4)
    fitted = fit_panels(cmap, pattern, wanted)
    again = quantize(fitted, replace(wanted, sizes=7))
    direct = rationalize(cmap, pattern, replace(wanted, sizes=7))
    assert (again.polygons.values == direct.polygons.values).all()


def test_edge_range_is_reported_and_held():
    pattern, cmap = hex_pattern(torus, 24, 6), grid_map(torus, 48, 30, -0.1, 1.2)
    free = rationalize(cmap, pattern, PanelSettings(sizes=None))
    low, high = np.quantile(free.edge_length, [0.3, 0.8])
    panels = rationalize(cmap, pattern, PanelSettings(sizes=6, edge_range=(low, high)))
    assert panels.edge_length.max() <= high
    assert set(panels.outside) == set(np.flatnonzero(free.limit < low))
    assert len(panels.notes) == 2


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.1])
def test_a_panel_that_can_slide_is_put_in_the_middle_whatever_rounding_does(turn):
    """A stretched hexagon is held by two parallel sides only."""
    angle = np.arange(6) * np.pi / 3 + turn
    cell = np.stack([np.cos(angle), np.sin(angle), np.zeros(6)], axis=1)
    direction = cell + np.roll(cell, -1, axis=0)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    offset = np.einsum("kd,kd->k", direction, cell) * np.array([1.0, 1.2, 1.2, 1.0, 1.2, 1.2])
    poses = nearest_regular(cell[None])
    length, center = inscribed(poses, direction[None], offset[None])
    assert length[0] == pytest.approx(1.0, rel=1e-12)
    assert np.allclose(center, 0.0, atol=1e-12)


def test_trade_off_falls_and_ends_where_nothing_more_is_gained():
    _, panels, quality = panelize(torus, sizes=3)
    curve = panels.trade_off
    assert (np.diff(curve.uncovered) <= 1e-12).all()
    assert curve.uncovered[2] == pytest.approx(1 - quality.coverage, abs=1e-12)


def test_distance_to_the_surface_is_that_of_corners_and_centres():
    """On a sphere panels are chords: their centres lie deeper below it than their corners."""
    _, panels, quality = panelize(sphere)
    depth = 1 - np.linalg.norm(panels.center, axis=1)
    assert (depth > 0).all()
    assert np.allclose(quality.surface_distance, depth, atol=2e-3)
    assert (quality.surface_distance > 0.9 * depth - 1e-3).all()


def test_trimmed_cells_stay_flat_and_apart():
    """Cells cut at the boundary keep their own shape, one panel each, and no class."""
    chart = inverted(torus, (0.5, 0.1, 3.0))
    pattern = hex_pattern(chart, 24, 8, -0.6)
    whole = pattern.whole.copy()
    whole[pattern.ring == 0] = False
    whole[5::7] = False
    pattern = replace(pattern, whole=whole)
    cmap = grid_map(chart, 96, 60, -0.7, 1.8)
    panels = rationalize(cmap, pattern, PanelSettings(joint=0.001))
    quality = measure(cmap, pattern, panels)
    assert quality.overlaps == 0
    assert quality.planarity.max() < 1e-12
    assert (panels.size[~panels.whole] == -1).all()
    assert (panels.size[panels.whole] >= 0).all()
    assert np.nanmin(quality.gap_tangential) >= 0.001 - 1e-12
    assert panels.n_panels == pattern.n_cells


def test_a_joint_wider_than_the_cells_is_refused():
    with pytest.raises(PanelsError, match="no room"):
        panelize(torus, joint=10.0)


def test_an_increment_longer_than_the_panels_is_refused():
    with pytest.raises(PanelsError, match="increment") as caught:
        panelize(torus, increment=10.0)
    assert caught.value.field == ("increment",)


def fitted_with(limit):
    pattern, cmap = hex_pattern(cylinder, 24, 8, -0.6), grid_map(cylinder, 96, 60, -0.7, 1.8)
    fitted = fit_panels(cmap, pattern, PanelSettings())
    return replace(fitted, limit=np.resize(np.asarray(limit), len(fitted.limit)))


def test_of_sizes_that_are_all_but_equal_one_is_used_and_told():
    made = quantize(fitted_with(0.01 * (1 + 5e-4 * np.random.default_rng(0).random(50))), PanelSettings())
    assert len(made.class_length) == 1
    assert "Of the 11 sizes allowed 1 is used" in " ".join(made.notes)
    alone = quantize(fitted_with([0.01]), PanelSettings())
    assert len(alone.class_length) == 1
    assert alone.notes == ()


@pytest.mark.parametrize(("cost", "told"), [("area", "size_cost worst"), ("worst", "more sizes, or an edge")])
def test_panels_far_below_what_their_cells_allow_are_told(cost, told):
    limit = np.append(np.linspace(0.009, 0.01, 60), np.geomspace(1e-5, 1e-3, 6))
    made = quantize(fitted_with(limit), PanelSettings(size_cost=cost, sizes=4))
    few = int((made.edge_length < 0.25 * made.limit).sum())
    assert few > 0
    assert f"{few} panels have less than 25%" in made.notes[-1]
    assert told in made.notes[-1]
    apart = quantize(fitted_with(limit), PanelSettings(size_cost=cost, sizes=4, edge_range=(8e-3, 1.0)))
    assert (apart.edge_length[apart.limit > 8e-3] > 8e-3).all()


def test_surface_without_cells_is_told() -> None:
    """Four rows of squares on a cylinder, which they cover, or of which they cover a third."""
    pattern = quad_pattern(cylinder, 40, 4)
    rows = 4 * 2 * np.pi / 40
    for height, told in ((rows, False), (3 * rows, True)):
        cmap = grid_map(cylinder, 120, 30, 0.0, height)
        notes = measure(cmap, pattern, rationalize(cmap, pattern, PanelSettings())).notes
        assert any("cover 33% of the surface" in note for note in notes) == told
        assert any("Cells cover" in note for note in notes) == told
