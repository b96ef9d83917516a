"""All sizes in one programme: an optimum that a general solver confirms, and no overlap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import csr_array, random_array

from hexwrap_solver.errors import ConvergenceError, PanelsError
from hexwrap_solver.panels import fit_panels, measure, quantize
from hexwrap_solver.panels import linear_programme as lp
from hexwrap_solver.panels.types import PanelSettings
from tests.solver.panels.cells import catenoid, grid_map, hex_pattern, inverted, quad_pattern, sphere, torus

CHARTS = {
    "torus": torus,
    "inverted catenoid": inverted(catenoid, (0.4, 0.2, 4.0)),
    "inverted sphere": inverted(sphere, (1.8, 0.2, 1.5)),
}


def bounded_programme(seed, rows=80, columns=30):
    rng = np.random.default_rng(seed)
    a = random_array((rows, columns), density=0.2, rng=rng, data_sampler=rng.standard_normal).toarray()
    a = np.concatenate([a, np.eye(columns), -np.eye(columns)])
    return rng.normal(size=columns), a, rng.uniform(0.5, 2.0, len(a))


@pytest.mark.parametrize("seed", range(5))
def test_interior_point_agrees_with_a_general_solver(seed):
    weight, a, b = bounded_programme(seed)
    points = np.random.default_rng(seed).normal(size=(len(weight), 3))
    x = lp.maximise(weight, np.zeros(len(weight)), csr_array(a), b, np.zeros(len(weight)), points)
    reference = linprog(-weight, A_ub=a, b_ub=b, bounds=(None, None))
    assert weight @ x == pytest.approx(-reference.fun, abs=1e-5)
    assert (a @ x <= b + 1e-6).all()


def test_an_unbounded_programme_is_refused():
    with pytest.raises(ConvergenceError, match="target inscribed"):
        lp.maximise(np.ones(3), np.zeros(3), csr_array(-np.eye(3)), np.ones(3), np.zeros(3), np.eye(3))


@pytest.mark.parametrize("chart", CHARTS.values(), ids=CHARTS)
@pytest.mark.parametrize("make", [hex_pattern, quad_pattern])
@pytest.mark.parametrize("joint", [0.0, 0.002])
def test_best_sizes_gain_on_the_inscribed_ones_without_overlap(chart, make, joint):
    pattern, cmap = make(chart, 24, 8, -0.6), grid_map(chart, 60, 40, -0.7, 1.8)
    wanted = PanelSettings(target="best", sizes=None, joint=joint)
    fitted = fit_panels(cmap, pattern, wanted)
    quality = measure(cmap, pattern, quantize(fitted, wanted))
    inscribed = fit_panels(cmap, pattern, PanelSettings(target="inscribed", joint=joint)).limit
    assert quality.overlaps == 0
    assert np.nanmin(quality.gap_tangential) >= joint - 1e-12
    # The inscribed panels are feasible for the programme, whose weights they are.
    assert inscribed @ fitted.limit >= inscribed @ inscribed * (1 - 1e-6)
    assert (fitted.limit >= inscribed * (1 - 2e-3)).all()


@pytest.mark.parametrize("chart", CHARTS.values(), ids=CHARTS)
@pytest.mark.parametrize("cost", ["area", "worst"])
@pytest.mark.parametrize("edges", [None, (0.9, 1.02)])
def test_few_classes_never_cover_less_than_those_of_the_inscribed_panels(chart, cost, edges):
    pattern, cmap = hex_pattern(chart, 24, 8, -0.6), grid_map(chart, 60, 40, -0.7, 1.8)
    fitted = {
        target: fit_panels(cmap, pattern, PanelSettings(target=target)) for target in ("best", "inscribed")
    }
    middle = float(np.median(fitted["inscribed"].limit))
    allowed = None if edges is None else (edges[0] * middle, edges[1] * middle)
    for classes in (1, 2, 3, 5, 11, 40, None):
        wanted = PanelSettings(sizes=classes, size_cost=cost, edge_range=allowed)
        best, inscribed = (quantize(fitted[target], wanted) for target in ("best", "inscribed"))
        assert len(best.outside) <= len(inscribed.outside)
        if len(best.outside) == len(inscribed.outside) and cost == "area":
            assert (best.edge_length**2).sum() >= (inscribed.edge_length**2).sum() * (1 - 1e-12)
        curves = [
            made.trade_off.uncovered if cost == "area" else made.trade_off.worst_gap
            for made in (best, inscribed)
        ]
        shared = min(map(len, curves))
        assert (curves[0][:shared] <= curves[1][:shared] + 1e-12).all()
        assert measure(cmap, pattern, best).overlaps == 0


def test_an_increment_that_only_the_inscribed_panels_reach_is_kept():
    """All sizes together may cost the smallest panel up to a thousandth, which must not refuse what the
    inscribed panels allow."""
    chart = CHARTS["inverted catenoid"]
    pattern, cmap = hex_pattern(chart, 18, 5, -0.6), grid_map(chart, 48, 30, -0.7, 1.8)
    wanted = PanelSettings(target="best", joint=0.003)
    fitted = fit_panels(cmap, pattern, wanted)
    smallest = fitted.limit.min(), fitted.spare_limit.min()
    assert smallest[0] < smallest[1]
    made = quantize(fitted, replace(wanted, sizes=3, increment=float(np.mean(smallest))))
    assert made.class_length[0] == pytest.approx(np.mean(smallest))
    assert measure(cmap, pattern, made).overlaps == 0
    with pytest.raises(PanelsError, match="increment"):
        quantize(fitted, replace(wanted, increment=1.001 * float(smallest[1])))


def test_a_programme_without_an_answer_leaves_the_inscribed_sizes(monkeypatch):
    """As rounding does to it where panels have all but no room; the job need not fail for that."""
    monkeypatch.setattr(lp, "MOST_STEPS", 1)
    pattern, cmap = hex_pattern(torus, 24, 8), grid_map(torus, 60, 40, -0.1, 1.8)
    fitted = fit_panels(cmap, pattern, PanelSettings(target="best"))
    inscribed = fit_panels(cmap, pattern, PanelSettings(target="inscribed"))
    assert any("did not converge" in note for note in fitted.notes)
    assert (fitted.limit == inscribed.limit).all()
    assert (fitted.center == inscribed.center).all()
