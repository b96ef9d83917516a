"""Panels of patterns with several kinds of cells: regular, of a size class of their kind, no overlap."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hexwrap_solver.panels import fit_panels, measure, quantize
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.lattice import LATTICES
from hexwrap_solver.pattern.types import Pattern, PatternSettings
from tests.solver.pattern import annuli

KINDS = list(LATTICES)


@cache
def laid(kind: str, boundary: str = "whole") -> Pattern:
    return lay_pattern(bulb(), PatternSettings(kind=kind, around=20, boundary=boundary))


@cache
def bulb():
    return annuli.revolution(lambda s: 1 + 0.3 * np.sin(2 * s), np.linspace(0, 2.2, 16), 40)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("target", ["inscribed", "best", "shortest", "mean"])
def test_every_kind_has_its_own_classes_and_none_overlap(kind, target):
    settings = PanelSettings(sizes=3, target=target)
    pattern = laid(kind)
    panels = quantize(fit_panels(bulb(), pattern, settings), settings)
    quality = measure(bulb(), pattern, panels)
    corners = {4: 6}.get if kind == "brick" else (lambda sides: sides)
    sides = panels.class_sides
    assert {corners(s) for s in sides.tolist()} == set(LATTICES[kind].outlines)
    assert np.bincount(sides).max() <= 3
    assert panels.n_sizes == len(sides)
    assert panels.class_count.sum() == panels.n_panels == pattern.n_cells
    of_panel = panels.class_length[panels.size]
    assert (of_panel == panels.edge_length).all()
    assert (of_panel <= panels.limit * (1 + 1e-12)).all()
    assert quality.planarity.max() < 1e-9
    assert quality.edge_deviation.max() < 1e-9
    assert quality.angle_deviation.max() < 1e-9
    assert quality.convex.all()
    assert target == "mean" or quality.overlaps == 0


@pytest.mark.parametrize("kind", KINDS)
def test_best_covers_no_less_than_inscribed(kind):
    covered = []
    for target in ("inscribed", "best"):
        settings = PanelSettings(sizes=None, target=target)
        panels = quantize(fit_panels(bulb(), laid(kind), settings), settings)
        covered.append(measure(bulb(), laid(kind), panels).coverage)
    assert covered[1] >= covered[0] - 1e-6


@pytest.mark.parametrize("kind", ["hex", "trihexagonal", "rhombitrihexagonal", "brick"])
def test_fewest_keeps_the_joints_narrow(kind):
    own = PanelSettings(sizes=None)
    fitted = fit_panels(bulb(), laid(kind), own)
    widest = np.nanmax(measure(bulb(), laid(kind), quantize(fitted, own)).gap_tangential)
    settings = PanelSettings(sizes="fewest", max_gap=2 * float(widest))
    panels = quantize(fitted, settings)
    assert np.nanmax(measure(bulb(), laid(kind), panels).gap_tangential) <= settings.max_gap * (1 + 1e-6)
    assert len(panels.class_length) < len(quantize(fitted, own).class_length)


@pytest.mark.parametrize("kind", ["trihexagonal", "truncated-square"])
def test_more_classes_leave_less_uncovered(kind):
    settings = PanelSettings(sizes=5)
    panels = quantize(fit_panels(bulb(), laid(kind, "trim"), settings), settings)
    curve = panels.trade_off
    assert (np.diff(curve.uncovered) <= 1e-12).all()
    assert curve.uncovered[0] > curve.uncovered[-1]
    assert curve.taken == 5 < panels.n_sizes  # for each kind of cell
