"""The paper's functionals: exact derivatives, scale, and the closed form as their optimum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexwrap_solver.panels import fit_panels, measure, quantize, rationalize
from hexwrap_solver.panels.energy.residuals import jacobian, residuals, surface_residuals
from hexwrap_solver.panels.energy.single import minimise_singly
from hexwrap_solver.panels.regular import corners, nearest_regular
from hexwrap_solver.panels.types import PanelSettings, Weights
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import PatternSettings
from tests.solver.panels.cells import (
    catenoid,
    grid_map,
    hex_pattern,
    inverted,
    quad_pattern,
    torus,
    triangle_pattern,
)
from tests.solver.pattern import annuli

WEIGHTS = Weights(planarity=2.0, angle=0.5, edge=3.0)


def bent(p, seed=0, size=1.0):
    """Three polygons near regular ones of the given size."""
    flat = np.concatenate([corners(p), np.zeros((p, 1))], axis=1)
    return size * (flat + np.random.default_rng(seed).normal(size=(3, p, 3)) * 0.1)


@pytest.mark.parametrize("p", [3, 4, 5, 6, 8])
def test_derivatives_agree_with_a_complex_step(p):
    points, length = bent(p, size=1.3), np.array([1.0, 1.2, 1.4])
    exact = jacobian(points, length, WEIGHTS)
    for k in range(p):
        for d in range(3):
            moved = points.astype(complex)
            moved[:, k, d] += 1e-30j
            assert np.allclose(exact[:, :, k, d], residuals(moved, length, WEIGHTS).imag / 1e-30, atol=1e-12)


@pytest.mark.parametrize("p", [3, 4, 6])
def test_derivatives_agree_with_finite_differences(p):
    points, length, step = bent(p), np.ones(3), 1e-6
    exact = jacobian(points, length, WEIGHTS)
    for k in range(p):
        for d in range(3):
            offset = np.zeros_like(points)
            offset[:, k, d] = step
            ahead, behind = (residuals(points + s * offset, length, WEIGHTS) for s in (1, -1))
            assert np.allclose(exact[:, :, k, d], (ahead - behind) / (2 * step), atol=1e-8)


def test_the_distance_to_the_surface_has_the_right_slope():
    surface = grid_map(torus, 40, 20, -0.5, 1.5).surface
    tree = surface.tree
    points = np.random.default_rng(0).normal(size=(50, 3)) * 2
    length = np.full(50, 0.3)
    _, slope = surface_residuals(points, length, tree)
    for d in range(3):
        offset = np.eye(3)[d] * 1e-6
        ahead, behind = (surface_residuals(points + s * offset, length, tree)[0] for s in (1, -1))
        assert np.allclose(slope[:, d], (ahead - behind) / 2e-6, atol=1e-4)


@pytest.mark.parametrize("p", [3, 4, 6])
def test_energies_do_not_see_motions_and_scale(p):
    points, length = bent(p), np.array([1.0, 1.1, 0.9])
    turn = Rotation.from_rotvec([1.0, 2.0, 3.0]).as_matrix()
    moved = 7.0 * points @ turn.T + [1.0, 2.0, 3.0]
    here, there = residuals(points, length, WEIGHTS), residuals(moved, 7.0 * length, WEIGHTS)
    assert np.allclose(here, there, atol=1e-12)


def test_planarity_supplies_what_angles_and_edges_lack_at_a_regular_hexagon():
    """Rank 9 of the 12 non-rigid directions without it, 12 with it."""
    flat = np.concatenate([corners(6), np.zeros((6, 1))], axis=1)[None]
    rank = [
        np.linalg.matrix_rank(jacobian(flat, np.ones(1), Weights(planarity=w)).reshape(-1, 18), tol=1e-9)
        for w in (0.0, 1.0)
    ]
    assert rank == [9, 12]


@pytest.mark.parametrize("make", [hex_pattern, quad_pattern, triangle_pattern])
@pytest.mark.parametrize("target", ["shortest", "inscribed", "mean"])
def test_closed_form_is_the_optimum_of_the_energy(make, target):
    chart = inverted(catenoid, (0.3, 0.2, 4.0))
    pattern, cmap = make(chart, 24, 6, -0.6), grid_map(chart, 60, 40, -0.7, 1.8)
    wanted = PanelSettings(target=target, sizes=None)
    exact = rationalize(cmap, pattern, wanted)
    energetic = rationalize(cmap, pattern, replace(wanted, method="energy"))
    assert np.allclose(energetic.polygons.values, exact.polygons.values, atol=1e-6 * exact.edge_length.min())
    assert (np.diff(energetic.energy) <= 0).all()
    assert energetic.energy[-1] < 1e-12 * energetic.energy[0]
    assert exact.energy is None


def test_with_the_surface_the_energy_falls_below_that_of_the_closed_form():
    pattern, cmap = hex_pattern(torus, 24, 6), grid_map(torus, 96, 60, -0.1, 1.2)
    tree = cmap.surface.tree
    cells = pattern.vertices[pattern.faces.values].reshape(-1, 6, 3)
    length = np.linalg.norm(np.roll(cells, -1, axis=1) - cells, axis=2).mean(axis=1)
    pull = Weights(surface=10.0)
    poses = nearest_regular(cells)
    closed = poses.center[:, None] + length[:, None, None] * poses.spokes(6)
    reached, _ = minimise_singly(cells, length, pull, tree)

    def energy(points):
        away = surface_residuals(points.reshape(-1, 3), np.repeat(length, 6), tree)[0]
        return (residuals(points, length, pull) ** 2).sum() + pull.surface * (away**2).sum()

    assert energy(reached) < energy(closed)


def test_a_pull_to_the_surface_keeps_panels_regular_and_apart():
    pattern, cmap = hex_pattern(torus, 24, 6), grid_map(torus, 48, 30, -0.1, 1.2)
    wanted = PanelSettings(method="energy", sizes=None, weights=Weights(surface=10.0))
    panels = rationalize(cmap, pattern, wanted)
    quality = measure(cmap, pattern, panels)
    assert quality.overlaps == 0
    assert quality.edge_deviation.max() < 1e-9
    assert "nearest to them" in panels.notes[0]


@pytest.mark.parametrize("make", [hex_pattern, quad_pattern])
def test_watertight_faces_become_flat_and_stay_together(make):
    chart = inverted(torus, (0.5, 0.1, 4.0))
    pattern, cmap = make(chart, 20, 6, 0.1), grid_map(chart, 60, 40, 0.0, 2.5)
    wanted = PanelSettings(mode="watertight", method="energy")
    panels = quantize(fit_panels(cmap, pattern, wanted), wanted)
    before = measure(cmap, pattern, rationalize(cmap, pattern, PanelSettings(target="mean", sizes=None)))
    quality = measure(cmap, pattern, panels)
    shared = np.full((len(pattern.vertices), 3), np.nan)
    shared[pattern.faces.values] = panels.polygons.values
    assert (shared[pattern.faces.values] == panels.polygons.values).all()
    assert before.movement == 0
    assert quality.planarity.max() < 1e-3
    assert 0 < quality.movement < pattern.edge_length
    assert (panels.size == -1).all()
    assert np.nanmax(np.abs(quality.gap_tangential)) < 1e-9


def test_quads_of_a_surface_of_revolution_are_flat_already():
    pattern, cmap = quad_pattern(catenoid, 20, 6), grid_map(catenoid, 60, 40, -0.1, 2.0)
    wanted = PanelSettings(mode="watertight", weights=Weights(angle=0.0, edge=0.0))
    quality = measure(cmap, pattern, rationalize(cmap, pattern, wanted))
    assert quality.movement < 1e-9


def moved_by(pattern, cmap, offset):
    """The same pattern and map elsewhere."""
    surface = cmap.surface
    there = replace(surface, vertices=surface.vertices + offset)
    return replace(pattern, vertices=pattern.vertices + offset), replace(cmap, surface=there)


@pytest.mark.parametrize("mode", ["split", "watertight"])
def test_a_tower_far_away_has_the_same_panels(mode):
    """Metres in a national grid. Corners lie on the surface but for rounding, which has no direction."""
    pattern, cmap = hex_pattern(torus, 24, 6), grid_map(torus, 96, 60, -0.1, 1.2)
    on_mesh = cmap.surface.tree.nearest(pattern.vertices)
    corners = cmap.surface.vertices[cmap.surface.faces[on_mesh.face]]
    pattern = replace(pattern, vertices=np.einsum("kc,kcd->kd", on_mesh.barycentric, corners))
    offset = np.array([4e5, 5.8e6, 50.0])
    wanted = PanelSettings(mode=mode, method="energy", weights=Weights(surface=1.0))
    here = rationalize(cmap, pattern, wanted)
    far_pattern, far_map = moved_by(pattern, cmap, offset)
    there = rationalize(far_map, far_pattern, wanted)
    assert there.polygons.values.shape == here.polygons.values.shape
    away = np.abs(there.polygons.values - offset - here.polygons.values).max()
    assert away < 1e-3 * pattern.edge_length
    assert not [note for note in there.notes if "No step" in note]


@pytest.mark.parametrize("which", ["planarity", "angle", "edge", "surface"])
@pytest.mark.parametrize("mode", ["split", "watertight"])
def test_weights_of_any_size_are_weights(which, mode):
    chart = inverted(catenoid, (0.3, 0.2, 4.0))
    pattern, cmap = hex_pattern(chart, 16, 4, -0.6), grid_map(chart, 40, 24, -0.7, 1.8)
    for size in (1e6, 1e12, 1e100, 1e300):
        wanted = PanelSettings(mode=mode, method="energy", weights=Weights(**{which: size}))
        panels = rationalize(cmap, pattern, wanted)
        assert np.isfinite(panels.polygons.values).all()
        assert (panels.energy >= 0).all()


def test_of_large_weights_only_the_ratios_matter():
    """The energy is as many times as large."""
    pattern, cmap = hex_pattern(torus, 24, 2), grid_map(torus, 48, 30, -0.1, 1.2)
    cells = pattern.vertices[pattern.faces.values].reshape(-1, 6, 3)
    length = np.linalg.norm(np.roll(cells, -1, axis=1) - cells, axis=2).mean(axis=1)
    (one, low), (other, high) = (
        minimise_singly(cells, length, Weights(k, k, k, 10 * k), cmap.surface.tree) for k in (10.0, 1e7)
    )
    np.testing.assert_allclose(other, one, atol=1e-9)
    np.testing.assert_allclose(high, 1e6 * low, rtol=1e-9)


@pytest.mark.parametrize("method", ["exact", "energy"])
@pytest.mark.parametrize("target", ["inscribed", "best", "shortest", "mean"])
def test_a_band_too_low_for_a_whole_cell_has_no_whole_panel(method, target):
    """All cells are cut at the boundary."""
    band = annuli.revolution(np.ones_like, np.linspace(0, 0.06, 3), 60)
    pattern = lay_pattern(band, PatternSettings(around=48, boundary="trim"))
    assert not pattern.whole.any()
    panels = rationalize(band, pattern, PanelSettings(method=method, target=target))
    assert np.isfinite(panels.polygons.values).all()
    assert measure(band, pattern, panels).overlaps == 0
