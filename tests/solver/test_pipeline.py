"""The whole way on real stages: from a mesh to panels, components and support."""

from __future__ import annotations

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.panels.types import ComponentSettings, PanelSettings
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.pipeline import PlainRunner, solve
from hexwrap_solver.surface import surface_from_mesh
from hexwrap_solver.surface.types import SentMesh
from tests.solver.panels.cells import catenoid, grid_map, inverted


def take_in():
    surface = grid_map(inverted(catenoid, (0.4, 0.3, 4.0)), 60, 24, -0.8, 0.9).surface
    return surface_from_mesh(SentMesh(10 * surface.vertices, Ragged.from_table(surface.faces)))


def run(pattern=None, panels=None, **options):
    runner = PlainRunner()
    pattern = PatternSettings(around=24) if pattern is None else pattern
    return solve(take_in, BoundaryCondition(), pattern, panels, runner, **options), runner


def test_hexagons_close_up_and_panels_keep_the_contract():
    solution, runner = run(panels=PanelSettings())
    pattern, panels, quality = solution.pattern, solution.panels, solution.quality
    neighbours = pattern.neighbours.values.reshape(-1, 6)
    inner = (pattern.ring > 0) & (pattern.ring < pattern.rings - 1)
    assert (neighbours[inner] >= 0).all()
    assert quality.planarity.max() < 1e-9
    assert quality.edge_deviation.max() < 1e-9
    assert quality.angle_deviation.max() < 1e-9
    assert quality.overlaps == 0
    assert len(panels.class_length) == 11
    assert list(runner.timings) == ["surface", "map", "pattern", "fit", "panels", "quality"]


@pytest.mark.parametrize("kind", ["hex", "quad", "triangle"])
@pytest.mark.parametrize("boundary", ["whole", "trim"])
@pytest.mark.parametrize("align", ["none", "both"])
def test_no_kind_of_pattern_overlaps(kind, boundary, align):
    pattern = PatternSettings(kind=kind, around=24, boundary=boundary, align=align)
    solution, _ = run(pattern, PanelSettings(joint=0.002))
    assert solution.quality.overlaps == 0
    assert solution.quality.planarity.max() < 1e-9
    assert (solution.panels.whole | (solution.panels.size == -1)).all()
    assert np.nanmin(solution.quality.gap_tangential) >= 0.002 - 1e-9


def test_components_and_support_come_where_asked_for():
    with_parts, _ = run(
        panels=PanelSettings(components=ComponentSettings(inset=0.01, thickness=0.02, depth=0.1))
    )
    assert with_parts.components.solid_vertices is not None
    assert np.degrees(with_parts.support.torsion.max()) < 1e-9
    alone, runner = run(panels=None, with_support=True)
    assert alone.components is None
    assert len(alone.support.axes) == len(alone.pattern.vertices)
    assert "fit" not in runner.timings
    assert run(panels=PanelSettings())[0].support is None


def test_stages_run_with_one_blas_thread_and_leave_the_callers_setting_alone():
    def threads():
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    seen = []

    class Runner(PlainRunner):
        def __call__(self, stage, settings, compute):
            seen.append(threads())
            return super().__call__(stage, settings, compute)

    with threadpool_limits(2, user_api="blas"):
        before = threads()
        solve(take_in, BoundaryCondition(), None, None, Runner())
        assert threads() == before
    assert seen == [{1} if before else set()] * 3  # Accelerate on macOS has no threads to set
