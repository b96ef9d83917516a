"""Buildings that are flat but for corners of quarter turns: there the singularities of quads are already."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.pipeline import Solution, SolveSettings, solve
from hexwrap_solver.singularities.types import SingularitySettings
from hexwrap_solver.surface import Surface, surface_from_mesh
from hexwrap_solver.surface.curvature import angle_defects, cone_points, is_flat_with_cones
from tests.solver.conformal.annuli import bump
from tests.solver.singularities.shapes import dome, setbacks, tube
from tests.solver.surface.shapes import mesh

QUARTER = np.pi / 2
AUTO = SolveSettings(pattern=PatternSettings(kind="quad"), singularities=SingularitySettings("auto"))


def building(sizes: list[tuple[float, float]], heights: list[float]) -> Surface:
    """As it comes from a file, with its folds."""
    shape = setbacks(sizes, heights)
    return surface_from_mesh(mesh(shape.vertices, shape.faces))


TWO = building([(20, 20), (12, 12)], [12, 12])
THREE = building([(30, 24), (22, 16), (14, 10)], [9, 12, 15])
ODD = building([(18.3, 14.1), (11.7, 9.37)], [9.13, 12.4])


def solved(surface, settings: SolveSettings) -> Solution:
    return solve(lambda: surface, settings)


@pytest.mark.parametrize(("surface", "ledges"), [(TWO, 1), (THREE, 2), (ODD, 1)])
def test_ledges_turn_by_quarters_at_their_corners(surface, ledges: int) -> None:
    """Outer corners see three right angles, inner ones five; straight ends leave a sum of nothing."""
    vertex, index = cone_points(surface, QUARTER)
    assert sorted(index.tolist()) == [-1] * 4 * ledges + [1] * 4 * ledges
    assert angle_defects(surface)[vertex] == pytest.approx(index * QUARTER)
    assert is_flat_with_cones(surface, QUARTER)
    assert not is_flat_with_cones(surface, np.pi / 3)


@pytest.mark.parametrize("surface", [tube(np.ones(9), 3.0), dome(), bump(24, 12)])
def test_flat_tubes_and_curved_surfaces_have_no_such_corners(surface) -> None:
    assert not is_flat_with_cones(surface, QUARTER)
    assert not len(cone_points(surface, QUARTER)[0])


@pytest.mark.parametrize(("surface", "edge"), [(TWO, 4 / 3), (THREE, 1.0)])
def test_quads_of_one_size_where_an_edge_divides_all(surface, edge: float) -> None:
    """Nothing is stretched, and only the edge may change: to the nearest that divides all lengths."""
    made = solved(surface, AUTO)
    assert np.ptp(made.map.log_scale) < 1e-9
    assert made.pattern.distortion < 1e-9
    assert made.panels.class_length[0] == pytest.approx(edge)
    assert len(made.panels.class_length) == 4  # whole ones, and three kinds along folds
    assert not (made.panels.size < 0).any()
    assert made.quality.coverage > 0.997


def test_a_size_that_is_asked_for_is_kept() -> None:
    asked = replace(AUTO, pattern=PatternSettings(kind="quad", edge_length=2.0))
    assert solved(TWO, asked).panels.class_length[0] == pytest.approx(2.0)
    asked = replace(AUTO, pattern=PatternSettings(kind="quad", around=78))
    found = solved(TWO, asked)  # as many cells as without singularities: the nearest edge that fits
    assert found.panels.class_length[0] == pytest.approx(0.8)
    assert found.pattern.distortion < 1e-9


def test_corners_stay_where_no_edge_divides_what_is_between_them() -> None:
    made = solved(ODD, AUTO)
    vertex, index = cone_points(ODD, QUARTER)
    at = made.map.surface.vertices[made.map.cones.vertex]
    assert np.abs(at[:, None] - ODD.vertices[vertex]).sum(axis=2).min(axis=1) == pytest.approx(0, abs=1e-12)
    assert sum(made.map.cones.index) == sum(index) == 0
    assert made.pattern.distortion < 0.1
    assert any("divides what lies between them" in note for note in made.map.notes)


@pytest.mark.parametrize("kind", ["hex", "quad"])
@pytest.mark.parametrize("surface", [TWO, THREE])
def test_what_quads_would_bring_is_told_and_true(surface, kind: str) -> None:
    settings = SolveSettings(pattern=PatternSettings(kind=kind), panels=PanelSettings(sizes=11))
    made = solved(surface, settings)
    (note,) = (note for note in made.quality.notes if "corners of quarter turns" in note)
    bound, now, types = re.search(r"less than ([\d.]+)% .* of ([\d.]+)% in (\d+) types", note).groups()
    assert float(now) == pytest.approx(100 * (1 - made.quality.coverage), abs=0.05)
    then = solved(surface, replace(AUTO, panels=settings.panels))
    assert 100 * (1 - then.quality.coverage) < float(bound)
    assert len(then.panels.class_length) < int(types) / 5
