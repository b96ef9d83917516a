"""The boundary condition that is taken where none is asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryAngle, BoundaryCondition
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.explore import best_boundary_map, boundary, foreseen
from hexwrap_solver.explore.boundary import MARGIN
from hexwrap_solver.panels import fit_panels, measure, quantize
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern import lay_pattern
from hexwrap_solver.pattern.types import PatternSettings
from tests.solver.conformal.annuli import bump, catenoid, irregular, ring

AUTO = BoundaryCondition(quantum="hex")
flat_ring = irregular(48, 16, ring())


@pytest.mark.parametrize("surface", [bump(48, 24), catenoid(48, 24), flat_ring])
def test_straight_unless_isometric_leaves_clearly_less_uncovered(surface):
    found = best_boundary_map(surface, AUTO)
    share = {
        mode: foreseen(conformal_map(surface, replace(AUTO, mode=mode))) for mode in ("straight", "isometric")
    }
    chosen = "straight" if share["straight"] <= share["isometric"] + MARGIN else "isometric"
    assert np.array_equal(found.log_scale, conformal_map(surface, replace(AUTO, mode=chosen)).log_scale)
    assert found.notes[0].startswith(f"Boundary: {chosen}.")
    left = [f"{value:.1%}" if value >= 0.0005 else "nothing" for value in share.values()]
    assert all(words in found.notes[0] for words in left)


def test_a_flat_ring_is_left_as_it_is():
    found = best_boundary_map(flat_ring, AUTO)
    assert found.deck.angle == pytest.approx(2 * np.pi)
    assert foreseen(found) < 1e-3


def test_a_choice_that_had_to_be_made_is_told(monkeypatch):
    def failing(surface, condition, progress):
        if condition.mode == "isometric":
            raise ConvergenceError("It did not converge.")
        return conformal_map(surface, condition, progress)

    monkeypatch.setattr(boundary, "conformal_map", failing)
    found = best_boundary_map(bump(24, 8), AUTO)
    assert found.notes[0] == "Boundary: straight, since it cannot be isometric: It did not converge."


def test_what_is_foreseen_is_what_sizes_alone_leave_uncovered():
    """Panels of their own sizes and those of few sizes differ by about as much."""
    cmap = conformal_map(bump(96, 48), replace(AUTO, mode="straight"))
    pattern = lay_pattern(cmap, PatternSettings(around=60))
    fitted = fit_panels(cmap, pattern, PanelSettings())
    asked = (None, 3, 11)
    covered = [
        measure(cmap, pattern, quantize(fitted, PanelSettings(sizes=sizes))).coverage for sizes in asked
    ]
    for sizes, coverage in zip((3, 11), covered[1:], strict=True):
        assert covered[0] - coverage == pytest.approx(foreseen(cmap, sizes), abs=0.02)


def test_listed_angles_are_meant_where_no_mode_is_given():
    listed = BoundaryCondition(angles=(BoundaryAngle(np.pi, vertex=0),))
    assert listed.adapted("hex").mode == "angles"
    assert BoundaryCondition().adapted("hex").mode == "auto"
