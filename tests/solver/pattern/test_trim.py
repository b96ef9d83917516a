"""Cutting at the boundary: the cells cover the domain exactly, with shared vertices."""

from __future__ import annotations

import numpy as np
import pytest

from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from tests.solver.pattern import annuli


def cell_areas(cmap: ConformalMap, pattern: Pattern) -> np.ndarray:
    """Areas of the unrolled cells, from positions and sheets."""
    faces = pattern.faces
    z = cmap.deck.apply(pattern.uv[faces.values], pattern.sheet)
    z = z - z[faces.offsets[:-1]][faces.row]
    return np.add.reduceat((z.conj() * z[faces.next()]).imag / 2, faces.offsets[:-1])


def domain_area(cmap: ConformalMap) -> float:
    a, b, c = cmap.corners().T
    return float(((b - a).conj() * (c - a)).imag.sum() / 2)


def euler(pattern: Pattern) -> int:
    edges = (len(pattern.faces.values) + np.count_nonzero(pattern.neighbours.values < 0)) // 2
    return int(len(pattern.vertices) - edges + pattern.n_cells)


@pytest.mark.parametrize("kind", ["hex", "triangle", "quad"])
@pytest.mark.parametrize("rotation", ["edge", "vertex", 10.0])
@pytest.mark.parametrize("align", ["none", "both"])
def test_cut_cells_fill_a_cylinder(kind, rotation, align):
    cmap = annuli.revolution(np.cosh, np.linspace(-1, 1.5, 25), 40)
    pattern = lay_pattern(cmap, PatternSettings(kind=kind, rotation=rotation, align=align, boundary="trim"))
    area = cell_areas(cmap, pattern)
    assert area.min() > 0
    assert area.sum() == pytest.approx(domain_area(cmap), rel=1e-9)
    assert euler(pattern) == 0


@pytest.mark.parametrize("k", [1, 2, 3, 5, 7, 11, -1, -4, -9])
def test_cut_cells_fill_cones(k):
    cmap = annuli.flat_cone(k * np.pi / 3, 1.0, 2.0, 60, 12, cut=11)
    pattern = lay_pattern(cmap, PatternSettings(around=36 + 6 * abs(k), boundary="trim"))
    assert cell_areas(cmap, pattern).sum() == pytest.approx(domain_area(cmap), rel=1e-9)
    assert euler(pattern) == 0


def test_aligned_boundary_halves_hexagons_into_trapezoids():
    cmap = annuli.revolution(np.cosh, np.linspace(-1, 1.5, 25), 40)
    pattern = lay_pattern(cmap, PatternSettings(around=48, boundary="trim"))
    cut = ~pattern.whole
    assert (pattern.faces.lengths[cut] == 4).all()
    area = cell_areas(cmap, pattern)
    np.testing.assert_allclose(area[cut], area[~cut].mean() / 2, rtol=1e-9)
    assert cut.sum() == 48
