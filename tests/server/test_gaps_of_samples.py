"""What the issue on rationalization promises of the bundled samples, under each boundary condition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexwrap_server import samples
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import take_in
from hexwrap_solver.conformal import conformal_map
from hexwrap_solver.conformal.types import BoundaryCondition
from hexwrap_solver.panels import measure, rationalize
from hexwrap_solver.panels.types import PanelSettings
from hexwrap_solver.pattern import lay_pattern

NAMES = ("tower", "facade", "waist", pytest.param("entrance", marks=pytest.mark.long))


@pytest.mark.parametrize("name", NAMES)
def test_inscribed_panels_leave_half_the_gap_of_the_shortest_edge_rule(name):
    """Mean gap at most half, worst at most 60 % of the paper's rule, each panel at its own length."""
    request = parse_request(samples.load(name), 10**7, 10**6)
    surface, wanted = take_in(request.surface, request.wanted.surface), request.wanted
    conditions = [BoundaryCondition("straight"), BoundaryCondition("isometric", quantum="hex")]
    if wanted.boundary.mode == "angles":
        conditions.append(wanted.boundary)
    for condition in conditions:
        align = "none" if condition.mode == "isometric" else wanted.pattern.align
        cmap = conformal_map(surface, condition)
        pattern = lay_pattern(cmap, replace(wanted.pattern, align=align))
        gaps = {}
        for target in ("shortest", "inscribed"):
            settings = PanelSettings(target=target, sizes=None)
            quality = measure(cmap, pattern, rationalize(cmap, pattern, settings))
            assert quality.overlaps == 0
            gaps[target] = quality.gap_tangential
        assert np.nanmean(gaps["inscribed"]) <= 0.5 * np.nanmean(gaps["shortest"])
        assert np.nanmax(gaps["inscribed"]) <= 0.6 * np.nanmax(gaps["shortest"])
