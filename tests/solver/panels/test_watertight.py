"""The watertight mesh: flat, convex where that can be, near the surface, and symmetric where it is."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.panels import fit, fit_panels, measure, rationalize
from hexwrap_solver.panels.energy import NEAREST, functionals, minimise_watertight
from hexwrap_solver.panels.energy.flat_steps import FlatSteps
from hexwrap_solver.panels.energy.guard import Guard, triangle_slopes
from hexwrap_solver.panels.energy.seen import Seen
from hexwrap_solver.panels.planar import crossing_themselves
from hexwrap_solver.panels.polygons import edge_lengths, fan_areas, mean_edges, means
from hexwrap_solver.panels.regular import corners
from hexwrap_solver.panels.types import PanelSettings, Weights
from tests.solver.panels.cells import (
    brick_pattern,
    catenoid,
    grid_map,
    hex_pattern,
    inverted,
    quad_pattern,
    sphere,
    torus,
    triangle_pattern,
    trihexagonal_pattern,
)


def measured(pattern, cmap):
    return measure(cmap, pattern, rationalize(cmap, pattern, PanelSettings(mode="watertight")))


def test_flat_steps_solve_the_equations_of_all_vertices():
    """Hexagons beside quads, and triangles, which are always flat."""
    chance = np.random.default_rng(0)
    pattern = hex_pattern(torus, 8, 3)
    hexagons = pattern.faces.values.reshape(-1, 6).astype(np.int64)
    tables = [hexagons, hexagons[:, :3], hexagons[:, [0, 1, 3, 4]]]
    n, weight = len(pattern.vertices), 1e3
    steps = FlatSteps(pattern.vertices, tables)
    blocks = chance.normal(size=(n, 3, 3))
    blocks = blocks @ blocks.transpose(0, 2, 1) + np.eye(3)
    bent = [tables[0], tables[2]]
    normals = [chance.normal(size=(len(table), 3)) for table in bent]
    bases = [chance.normal(size=(len(table), table.shape[1], table.shape[1] - 3)) for table in bent]
    heights = [chance.normal(size=(len(table), table.shape[1] - 3)) for table in bent]
    gradient = chance.normal(size=(n, 3))
    dense, right = np.zeros((3 * n, 3 * n)), gradient.ravel().copy()
    for vertex in range(n):
        dense[3 * vertex : 3 * vertex + 3, 3 * vertex : 3 * vertex + 3] = blocks[vertex]
    for table, normal, basis, height in zip(bent, normals, bases, heights, strict=True):
        for cell, v, columns, r in zip(table, normal, basis, height, strict=True):
            at = (3 * cell[:, None] + np.arange(3)).ravel()
            rows = np.einsum("pk,d->kpd", columns, v).reshape(-1, len(at))
            dense[np.ix_(at, at)] += weight * rows.T @ rows
            right[at] += weight * rows.T @ r
    steps.factorise(blocks, normals, bases, weight)
    assert np.allclose(steps.solve(gradient, heights).ravel(), -np.linalg.solve(dense, right), rtol=1e-8)


@pytest.mark.parametrize("p", [4, 5, 6])
def test_heights_of_flat_polygons_have_exact_derivatives(p):
    """Of bent ones the part that a motion of the plane makes up for is left out."""
    turn = np.linalg.qr(np.random.default_rng(p).normal(size=(3, 3)))[0]
    irregular = corners(p) * np.linspace(1.0, 1.3, p)[:, None]
    flat = (np.concatenate([irregular, np.zeros((p, 1))], axis=1) @ turn)[None]
    seen, step = Seen.of(flat), 1e-6
    basis = seen.basis()[0]
    slope = (basis @ basis.T)[:, :, None] * seen.normal[0]
    for k in range(p):
        for d in range(3):
            offset = np.zeros_like(flat)
            offset[:, k, d] = step
            ahead, behind = (Seen.of(flat + s * offset).heights()[0] for s in (1, -1))
            assert np.abs((ahead - behind) / (2 * step) - slope[:, k, d]).max() < 1e-5


@pytest.mark.parametrize("p", [3, 4, 6, 12])
def test_fan_and_ears_of_flat_polygons_have_exact_derivatives(p):
    """The fan sums up to the polygon."""
    chance = np.random.default_rng(p)
    turn = np.linalg.qr(chance.normal(size=(3, 3)))[0]
    flat = (np.concatenate([corners(p) * np.linspace(1.0, 1.2, p)[:, None], np.zeros((p, 1))], 1) @ turn)[
        None
    ]
    step, way = 1e-6, chance.normal(size=(p, 3))
    seen = Seen.of(flat)
    assert np.isclose(seen.fan().sum(), fan_areas(Ragged.from_table(flat))[0])
    ahead, behind = (Seen.of(flat + s * step * way) for s in (1, -1))
    change = np.concatenate([ahead.fan() - behind.fan(), ahead.ears() - behind.ears()], axis=1)
    exact = np.einsum("qtpd,pd->qt", triangle_slopes(seen), way)
    assert np.abs(change / (2 * step) - exact).max() < 1e-8
    guard = Guard.of(flat, np.ones((1, p), dtype=bool))
    assert (guard.residuals(seen) == 0).all()
    assert np.isinf(guard.residuals(Seen.of(flat[:, ::-1]))[:, :p]).sum() == 0  # its normal turns along
    crossing = flat[:, [1, 0, *range(2, p)]]
    assert p == 3 or np.isinf(guard.residuals(Seen.of(crossing))).any()


@pytest.mark.parametrize("make", [hex_pattern, brick_pattern, quad_pattern, trihexagonal_pattern])
@pytest.mark.parametrize(("chart", "low"), [(catenoid, -0.6), (torus, 0.3), (sphere, -0.6)])
def test_no_panel_collapses_or_crosses_itself(make, chart, low):
    """Bricks twice as long as wide are at the limit on any surface: undisturbed, the joints of a row would
    vanish on a sphere and meet those of the next row on a minimal surface."""
    pattern, cmap = make(chart, 24, 6, low), grid_map(chart, 72, 48, low - 0.1, low + 2.0)
    panels = rationalize(cmap, pattern, PanelSettings(mode="watertight"))
    polygons = panels.polygons
    assert not crossing_themselves(polygons, panels.center, panels.normal).any()
    assert (edge_lengths(polygons) > 0.15 * mean_edges(polygons)[polygons.row]).all()
    assert measure(cmap, pattern, panels).planarity.max() < 1e-9
    assert not any("cross" in note or "shorter" in note for note in panels.notes)


def test_flat_faces_are_convex_on_a_saddle_where_four_meet():
    """320 hexagons. Three cannot: the honeycomb is flat, too, but hardly a cell of it is convex."""
    cmap = grid_map(catenoid, 96, 60, -1.2, 2.2)
    pattern = trihexagonal_pattern(catenoid, 32, 10, -0.8)
    quality = measured(pattern, cmap)
    assert quality.planarity.max() < 1e-9
    assert quality.convex.all()
    assert quality.surface_distance.max() < 0.05 * pattern.edge_length  # of corners and centres
    assert quality.movement < 0.1 * pattern.edge_length
    honeycomb = measured(hex_pattern(catenoid, 32, 10, -0.8), cmap)
    assert honeycomb.planarity.max() < 1e-9
    assert honeycomb.convex.mean() < 0.1


@pytest.mark.parametrize("make", [hex_pattern, trihexagonal_pattern, quad_pattern])
def test_corners_stay_beside_the_surface(make):
    """Where the pattern allows flat convex faces; hexagons on a sphere, for one."""
    for chart, low in ((catenoid, -0.6), (sphere, -0.6)):
        if make is hex_pattern and chart is catenoid:
            continue
        pattern, cmap = make(chart, 32, 8, low), grid_map(chart, 96, 72, -1.0, 2.0)
        moved, _ = minimise_watertight(pattern, mean_edges(pattern.cells), NEAREST, cmap.surface)
        away = cmap.surface.tree.nearest(moved).distance
        quality = measured(pattern, cmap)
        assert quality.planarity.max() < 1e-9
        assert quality.convex.all()
        assert away.max() < 0.08 * pattern.edge_length


@pytest.mark.parametrize("make", [hex_pattern, brick_pattern, quad_pattern, trihexagonal_pattern])
def test_a_surface_of_revolution_keeps_its_symmetry(make):
    """However hexagons on a saddle become flat, they do so alike all around."""
    pattern, cmap = make(catenoid, 20, 5, -0.6), grid_map(catenoid, 60, 40, -0.7, 1.8)
    moved, _ = minimise_watertight(pattern, mean_edges(pattern.cells), NEAREST, cmap.surface)
    movement = moved - pattern.vertices
    phase = np.exp(1j * pattern.uv.real)
    radial = (movement[:, 0] + 1j * movement[:, 1]) / phase
    seen = np.stack([radial.real, radial.imag, movement[:, 2]], axis=1) / pattern.edge_length
    orbit = np.stack([(phase**20).real, (phase**20).imag, pattern.uv.imag], axis=1).round(6) + 0.0
    _, alike = np.unique(orbit, axis=0, return_inverse=True)
    for k in range(alike.max() + 1):
        assert (alike == k).sum() == 20
        assert np.ptp(seen[alike == k], axis=0).max() < 1e-7


def test_triangles_stay_where_they_are():
    pattern, cmap = triangle_pattern(catenoid, 20, 5), grid_map(catenoid, 200, 120, -0.2, 2.0)
    quality = measured(pattern, cmap)
    assert quality.movement < 1e-2 * pattern.edge_length
    assert quality.convex.all()


@pytest.mark.parametrize("make", [hex_pattern, quad_pattern])
def test_flatness_is_not_bought_with_more_than_it_costs(make):
    """Without planarity the asked energies alone can only fall, from step to step."""
    chart = inverted(torus, (0.5, 0.1, 4.0))
    pattern, cmap = make(chart, 20, 6, 0.1), grid_map(chart, 60, 40, 0.0, 2.5)
    length = np.full(pattern.n_cells, pattern.edge_length)
    aims = functionals(Weights(planarity=0.0))
    _, curve = minimise_watertight(pattern, length, aims, cmap.surface)
    assert len(curve) > 1
    assert (np.diff(curve) < 0).all()


@pytest.mark.parametrize(("chart", "center"), [(torus, (0.5, 0.1, 4.0)), (catenoid, (0.7, 0.2, 3.0))])
def test_quads_become_flat_without_waves(chart, center):
    """Where lines of the net are no conjugate directions, flat quads are nearest in waves like bellows: there
    neighbours move twice as far apart as they move."""
    chart = inverted(chart, center)
    pattern, cmap = quad_pattern(chart, 40, 12, 0.1), grid_map(chart, 80, 60, -0.2, 2.5)
    moved, _ = minimise_watertight(pattern, mean_edges(pattern.cells), NEAREST, cmap.surface)
    face = pattern.faces.values.reshape(-1, 4)
    movement = moved - pattern.vertices
    apart = np.linalg.norm(np.roll(movement[face], -1, axis=1) - movement[face], axis=2)
    assert np.abs(Seen.of(moved[face]).heights()).max() < 1e-9 * pattern.edge_length
    assert apart.max() < 0.7 * np.linalg.norm(movement, axis=1).max()


def test_a_mesh_that_no_step_improves_is_told(monkeypatch):
    pattern, cmap = hex_pattern(torus, 16, 4), grid_map(torus, 40, 24, -0.1, 1.2)
    for curve, told in (([1.0, 1.0], True), ([1.0, 0.5, 0.4], False), ([0.0, 0.0], False)):
        monkeypatch.setattr(fit, "minimise_watertight", lambda *_, c=curve: (pattern.vertices, np.array(c)))
        notes = fit_panels(cmap, pattern, PanelSettings(mode="watertight", method="energy")).notes
        assert any("No step" in note for note in notes) == told


def test_panels_that_leave_the_surface_are_told_and_held_nearer_by_its_weight():
    pattern, cmap = hex_pattern(catenoid, 20, 5, -0.6), grid_map(catenoid, 96, 60, -0.7, 1.8)
    away = {}
    for surface in (0.0, 50.0):
        wanted = PanelSettings(mode="watertight", method="energy", weights=Weights(surface=surface))
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


def test_weights_alone_ask_for_the_energies():
    """As they did before there was another way."""
    pattern, cmap = hex_pattern(torus, 16, 4), grid_map(torus, 40, 24, -0.1, 1.2)
    weights = Weights(planarity=0.0, surface=1.0)
    silent, said, plain = (
        rationalize(cmap, pattern, PanelSettings(mode="watertight", **asked))
        for asked in ({"weights": weights}, {"weights": weights, "method": "energy"}, {})
    )
    assert np.array_equal(silent.polygons.values, said.polygons.values)
    assert not np.allclose(silent.polygons.values, plain.polygons.values)
    assert any("Weights were given" in note for note in silent.notes)


@pytest.mark.parametrize(
    ("make", "chart", "better"),
    [
        (hex_pattern, catenoid, "kind trihexagonal"),
        (hex_pattern, torus, "kind trihexagonal"),
        (hex_pattern, sphere, None),
        (triangle_pattern, catenoid, None),
    ],
)
def test_panels_that_are_not_convex_are_told_with_the_pattern_that_would_be(make, chart, better):
    pattern, cmap = make(chart, 24, 6, 0.4), grid_map(chart, 60, 48, 0.0, 3.0)
    panels = rationalize(cmap, pattern, PanelSettings(mode="watertight"))
    told = [note for note in panels.notes if "not convex" in note]
    assert len(told) == (better is not None)
    if told:
        count = (~measure(cmap, pattern, panels).convex).sum()
        assert f"not convex: {count} of {pattern.n_cells}" in told[0]
        assert better in told[0]


def test_panels_that_cross_themselves_are_counted():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    bow_tie = square[[0, 2, 1, 3]] + [0, 0, 5.0]
    tables = Ragged.from_table(np.stack([square, bow_tie, square + 1.0]))
    up = np.tile([0.0, 0, 1], (3, 1))
    assert crossing_themselves(tables, means(tables), up).tolist() == [False, True, False]
