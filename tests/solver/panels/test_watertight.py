"""The watertight mesh: its matrix, its derivatives and its symmetry."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.panels import fit, fit_panels, rationalize
from hexwrap_solver.panels.energy.cell_matrix import CellMatrix
from hexwrap_solver.panels.energy.residuals import plane_distances, plane_slopes
from hexwrap_solver.panels.energy.watertight import minimise_watertight
from hexwrap_solver.panels.planar import crossing_themselves
from hexwrap_solver.panels.polygons import edge_lengths, mean_edges, means
from hexwrap_solver.panels.regular import corners
from hexwrap_solver.panels.types import PanelSettings, Weights
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import PatternSettings
from tests.solver.conformal.annuli import bump
from tests.solver.panels.cells import catenoid, grid_map, hex_pattern, inverted, quad_pattern, torus


def test_cells_sum_up_to_the_normal_matrix():
    """Hexagons, and single vertices of their own, as with the pull to the surface."""
    chance = np.random.default_rng(0)
    pattern = hex_pattern(torus, 8, 3)
    n = len(pattern.vertices)
    tables = [pattern.faces.values.reshape(-1, 6), np.arange(n)[:, None]]
    slopes = [chance.normal(size=(len(table), 7, 3 * table.shape[1])) for table in tables]
    matrix = CellMatrix(pattern.vertices, tables)
    matrix.factorise(slopes, 0.5)
    dense = 0.5 * np.eye(3 * n)
    for table, slope in zip(tables, slopes, strict=True):
        unknown = (3 * table[..., None] + np.arange(3)).reshape(len(table), -1)
        for at, j in zip(unknown, slope, strict=True):
            dense[np.ix_(at, at)] += j.T @ j
    right = chance.normal(size=3 * n)
    assert np.allclose(matrix.solve(right), np.linalg.solve(dense, right), rtol=1e-9)


@pytest.mark.parametrize("p", [3, 4, 5, 6])
def test_plane_distances_of_flat_polygons_have_exact_derivatives(p):
    """Of bent ones the part that a motion of the plane makes up for is left out."""
    turn = np.linalg.qr(np.random.default_rng(p).normal(size=(3, 3)))[0]
    irregular = corners(p) * np.linspace(1.0, 1.3, p)[:, None]
    flat = (np.concatenate([irregular, np.zeros((p, 1))], axis=1) @ turn)[None]
    length, step = np.array([1.5]), 1e-6
    slope = plane_slopes(flat, length)
    for k in range(p):
        for d in range(3):
            offset = np.zeros_like(flat)
            offset[:, k, d] = step
            ahead, behind = (plane_distances(flat + s * offset, length) for s in (1, -1))
            # The normal's side is arbitrary.
            numeric = (ahead - behind) / (2 * step)
            other = (ahead + behind) / (2 * step)
            exact = slope[:, :, k, d]
            assert min(np.abs(x - exact).max() for x in (numeric, -numeric, other, -other)) < 1e-5


def test_a_surface_of_revolution_keeps_its_symmetry():
    """However hexagons on a saddle become flat, they do so alike all around (they tip over from a balance,
    which magnifies rounding)."""
    pattern, cmap = hex_pattern(catenoid, 20, 5, -0.6), grid_map(catenoid, 60, 40, -0.7, 1.8)
    fitted = fit_panels(cmap, pattern, PanelSettings(mode="watertight"))
    length = (edge_lengths(fitted.shapes) / mean_edges(fitted.shapes)[fitted.shapes.row]).reshape(5, 20, 6)
    assert np.ptp(length, axis=1).max() < 1e-3
    assert np.ptp(length, axis=2).min() > 1e-2


@pytest.mark.parametrize("make", [hex_pattern, quad_pattern])
def test_flatness_is_not_bought_with_more_than_it_costs(make):
    """Without planarity the asked energies alone can only fall, from step to step."""
    chart = inverted(torus, (0.5, 0.1, 4.0))
    pattern = make(chart, 20, 6, 0.1)
    length = np.full(pattern.n_cells, pattern.edge_length)
    _, curve = minimise_watertight(pattern, length, Weights(planarity=0.0), None)
    assert len(curve) > 1
    assert (np.diff(curve) < 0).all()


@pytest.mark.parametrize(("chart", "center"), [(torus, (0.5, 0.1, 4.0)), (catenoid, (0.7, 0.2, 3.0))])
def test_quads_become_flat_without_waves(chart, center):
    """Where lines of the net are no conjugate directions, flat quads are nearest in waves like bellows: there
    neighbours move as far apart as they move at all."""
    pattern = quad_pattern(inverted(chart, center), 40, 12, 0.1)
    length = np.full(pattern.n_cells, pattern.edge_length)
    moved, _ = minimise_watertight(pattern, length, Weights(), None)
    face = pattern.faces.values.reshape(-1, 4)
    movement = moved - pattern.vertices
    apart = np.linalg.norm(np.roll(movement[face], -1, axis=1) - movement[face], axis=2)
    assert np.abs(plane_distances(moved[face], length)).max() < 1e-9
    assert apart.max() < 0.5 * np.linalg.norm(movement, axis=1).max()


def test_a_mesh_that_no_step_improves_is_told(monkeypatch):
    pattern, cmap = hex_pattern(torus, 16, 4), grid_map(torus, 40, 24, -0.1, 1.2)
    for curve, told in (([1.0, 1.0], True), ([1.0, 0.5, 0.4], False), ([0.0, 0.0], False)):
        monkeypatch.setattr(fit, "minimise_watertight", lambda *_, c=curve: (pattern.vertices, np.array(c)))
        notes = fit_panels(cmap, pattern, PanelSettings(mode="watertight")).notes
        assert any("No step" in note for note in notes) == told


def test_panels_that_leave_the_surface_are_told_and_held_nearer_by_its_weight():
    pattern, cmap = hex_pattern(catenoid, 20, 5, -0.6), grid_map(catenoid, 96, 60, -0.7, 1.8)
    away = {}
    for surface in (0.0, 50.0):
        wanted = PanelSettings(mode="watertight", weights=Weights(surface=surface))
        panels = rationalize(cmap, pattern, wanted)
        distance = cmap.surface.tree.nearest(panels.polygons.values).distance.max()
        away[surface] = distance / panels.edge_length.mean()
        told = [note for note in panels.notes if "leave the surface" in note]
        assert len(told) == (away[surface] > 0.1)
        if told:
            assert f"up to {away[surface]:.0%} of" in told[0]
            assert ("a weight of 50" in told[0]) == (surface == 0)
    assert away[0.0] > 0.1
    assert away[50.0] < away[0.0] / 2


def test_flat_quads_are_told_how_to_follow_the_surface():
    """What the note promises is true."""
    cmap = conformal_map(bump(48, 24), BoundaryCondition())
    pattern = lay_pattern(cmap, PatternSettings(kind="quad", around=40))

    def away(weights: Weights) -> tuple[float, bool, bool]:
        panels = rationalize(cmap, pattern, PanelSettings(mode="watertight", weights=weights))
        distance = cmap.surface.tree.nearest(panels.polygons.values).distance.max()
        told = " ".join(note for note in panels.notes if "leave the surface" in note)
        return distance / panels.edge_length.mean(), "weight of 50" in told, "planarity 0, surface 1" in told

    flat, held, smooth = map(away, (Weights(), Weights(surface=50.0), Weights(planarity=0.0, surface=1.0)))
    assert flat[1:] == (True, True)
    assert held[1:] == (False, True)
    assert smooth[1:] == (False, False)
    assert smooth[0] < 0.02 < held[0] < flat[0] / 2


def test_panels_that_cross_themselves_are_counted():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    bow_tie = square[[0, 2, 1, 3]] + [0, 0, 5.0]
    tables = Ragged.from_table(np.stack([square, bow_tie, square + 1.0]))
    up = np.tile([0.0, 0, 1], (3, 1))
    assert crossing_themselves(tables, means(tables), up).tolist() == [False, True, False]
