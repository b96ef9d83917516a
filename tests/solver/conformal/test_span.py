"""Cones whose parts differ in scale by far more than the digits of a coordinate."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.arrays import Floats
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.errors import ConvergenceError, PatternError
from hexwrap_solver.panels import measure
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import PatternSettings
from hexwrap_solver.surface.types import Surface
from tests.solver.conformal.annuli import corners_at, grid, revolution
from tests.solver.conformal.checks import asked_angles, faults
from tests.solver.conformal.torture import MODES

AROUND = 6
#: Rows are so many times as high as quads are wide.
HIGH = 20.0
#: Vertices around, rows, height (over a circumference of 2π), boundary angles: no double holds these maps.
BANDS = [(15, 5, 0.005, "entrance"), (7, 21, 0.003, "entrance")]
#: The same, where double precision just suffices or does not.
AT_THE_LIMIT = [
    (7, 5, 0.005, "densified"),
    (7, 11, 0.004, "densified"),
    (7, 21, 0.0073, "entrance"),
    (11, 5, 0.003, "entrance"),
    (15, 5, 0.02, "entrance"),
]


def tube(rows: int) -> Surface:
    """A prism over a regular hexagon of side 1."""

    def place(phi: Floats, s: Floats) -> Floats:
        return np.stack([np.cos(phi), np.sin(phi), HIGH * rows * s], axis=1)

    return grid(AROUND, rows, place)


def cone(surface: Surface, angle: float) -> BoundaryCondition:
    """The cone angle spread evenly over all vertices of both loops."""
    each = np.repeat([np.pi - angle / AROUND, np.pi + angle / AROUND], AROUND)
    vertices = surface.input_vertex[np.concatenate(surface.loops)]
    return corners_at(vertices, each)


def growth(angle: float) -> float:
    """log(outer / inner radius) of one row: rectangles 1 × HIGH become isosceles trapezoids p, q = ρp with
    legs HIGH √(pq), as u is constant on rings, so √ρ − 1/√ρ = 2 HIGH sin(K / 2n)."""
    return float(2 * np.arcsinh(HIGH * np.sin(angle / (2 * AROUND))))


@pytest.mark.parametrize(("angle", "rows"), [(np.pi / 3, 200), (-np.pi / 3, 200), (3.0, 80)])
def test_radii_of_a_tubes_rings_are_in_geometric_progression(angle: float, rows: int) -> None:
    surface = tube(rows)
    found = conformal_map(surface, cone(surface, angle))
    assert faults(found) == []
    assert np.ptp(found.log_scale) > 300
    rings = surface.vertices[:, 2] / HIGH
    radii = np.log(np.abs(found.uv[: len(rings)]))
    slope, _ = np.polyfit(rings, radii, 1)
    assert abs(slope) == pytest.approx(abs(growth(angle)), rel=1e-9)
    np.testing.assert_allclose(radii - radii[0], slope * (rings - rings[0]), atol=1e-6)
    assert found.closing_error < 1e-6
    assert 0 < found.circumference < np.inf
    assert np.log(measure(found, None, None).scale_ratio) == pytest.approx(np.ptp(found.log_scale))


def test_patterns_on_them_are_refused_for_what_the_map_does() -> None:
    surface = tube(200)
    found = conformal_map(surface, cone(surface, np.pi / 3))
    for settings in (PatternSettings(), PatternSettings(around=6), PatternSettings(edge_length=5.0)):
        with pytest.raises(PatternError, match="smaller cone angle"):
            lay_pattern(found, settings)


def test_beyond_the_doubles_and_without_an_apex_the_limits_are_named() -> None:
    surface = tube(300)
    with pytest.raises(ConvergenceError, match="range of double precision"):
        conformal_map(surface, cone(surface, np.pi / 3))
    surface = tube(40)
    with pytest.raises(ConvergenceError, match="16 digits"):
        conformal_map(surface, cone(surface, 2 * np.pi))


@pytest.mark.parametrize(("around", "rows", "height", "kind"), BANDS)
def test_bands_far_too_wide_for_their_corners_are_refused_for_the_span(
    around: int, rows: int, height: float, kind: str
) -> None:
    """A corner shrinks what lies beyond it without end. That is told, whether Newton's method stalls or the
    drawing is not exact."""
    surface = grid(around, rows, revolution(lambda s: 1 + 0 * s, lambda s: height * s))
    with pytest.raises(ConvergenceError, match=r"10\^\d+ times as much as others.*ask for boundary angles"):
        conformal_map(surface, MODES[kind](surface, np.random.default_rng(1039)))


def test_bands_at_the_limit_are_right_or_refused() -> None:
    """Each angle may be within 1e-9 while their sum is not, and the layout in one piece less exact than that
    of single triangles."""
    solved = 0
    for around, rows, height, kind in AT_THE_LIMIT:
        surface = grid(around, rows, revolution(lambda s: 1 + 0 * s, lambda s, height=height: height * s))
        condition = MODES[kind](surface, np.random.default_rng(1039))
        try:
            found = conformal_map(surface, condition)
        except ConvergenceError:
            continue
        assert faults(found, asked_angles(found, surface, condition)) == [], (around, rows, height, kind)
        solved += 1
    assert solved  # how many depends on rounding


@pytest.mark.parametrize("height", [0.025, 0.01])
def test_corners_of_bands_get_as_many_vertices_as_they_need(height: float) -> None:
    surface = grid(11, 21, revolution(lambda s: 1 + 0 * s, lambda s: height * s))
    condition = MODES["densified"](surface, np.random.default_rng(1039))
    found = conformal_map(surface, condition)
    assert np.ptp(found.log_scale) > 13
    assert faults(found, asked_angles(found, surface, condition)) == []
