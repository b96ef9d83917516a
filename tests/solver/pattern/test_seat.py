"""Where the lattice lies, and how large its cells are, if neither is asked for."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition, ConformalMap
from hexwrap_solver.panels.polygons import fan_areas
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.place import seat
from hexwrap_solver.pattern.place.choose import PlacementFamily
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from tests.solver.pattern import nets


def court(width: float, height: float, hole: float) -> ConformalMap:
    """A flat rectangle with a hole of that much less each way, its boundary as it is."""
    around = 24
    sides = np.array([1 + 1j, -1 + 1j, -1 - 1j, 1 - 1j])
    share = np.arange(around) / around * 4
    rim = sides[share.astype(int)] * (1 - share % 1) + sides[(share.astype(int) + 1) % 4] * (share % 1)
    rings = [
        rim.real * (width / 2 - hole * t) + 1j * rim.imag * (height / 2 - hole * t) for t in (0.0, 0.5, 1.0)
    ]
    points = np.concatenate(rings)
    i = np.arange(around)
    faces = []
    for k in range(len(rings) - 1):
        a, b = k * around + i, k * around + (i + 1) % around
        faces += [np.stack([a, b, b + around], axis=1), np.stack([a, b + around, a + around], axis=1)]
    vertices = np.stack([points.real, points.imag, np.zeros(len(points))], axis=1)
    surface = nets.surface(vertices, np.concatenate(faces))
    return conformal_map(surface, BoundaryCondition(mode="isometric", quantum="hex"))


MAPS = {"court": court(40.0, 25.0, 7.0), "roof": nets.roof(), "dome": nets.dome()}


def bare(cmap: ConformalMap, pattern: Pattern) -> float:
    return 1 - float(fan_areas(pattern.cells).sum() / cmap.surface.areas.sum())


@pytest.mark.parametrize("kind", ["hex", "trihexagonal"])
@pytest.mark.parametrize("name", MAPS)
def test_what_is_foreseen_of_a_place_is_what_its_cells_cover(name, kind):
    cmap, lattice, asked = MAPS[name], LATTICES[kind], PatternSettings(kind=kind)
    placing = PlacementFamily.of(cmap, lattice, asked)
    lines = placing.loops
    covered = seat._covered(placing.cmap, lattice, placing.at(asked), lattice.basis, (1, 1), lines, 12)
    assert covered[0] == pytest.approx(1 - bare(cmap, lay_pattern(cmap, asked)), abs=0.01)


@pytest.mark.parametrize("name", MAPS)
def test_cells_of_no_size_asked_for_leave_a_narrower_margin(name):
    cmap = MAPS[name]
    default = lay_pattern(cmap, PatternSettings())
    plain = lay_pattern(cmap, PatternSettings(edge_length=default.edge_length))
    assert bare(cmap, default) < 0.95 * bare(cmap, plain)
