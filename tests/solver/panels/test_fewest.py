"""The fewest sizes that leave no joint wider than asked."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.errors import PanelsError
from hexwrap_solver.panels import fit_panels, measure, quantize
from hexwrap_solver.panels.fewest import Joints, fewest_lengths, stab
from hexwrap_solver.panels.types import PanelSettings
from tests.solver.panels.cells import catenoid, grid_map, hex_pattern, inverted

intervals = st.lists(
    st.tuples(st.integers(0, 20), st.integers(0, 6)).map(lambda pair: (pair[0], pair[0] + pair[1])),
    min_size=1,
    max_size=7,
)


@settings(deadline=None)
@given(intervals)
def test_stabbing_meets_every_interval_with_the_fewest_values(pairs):
    low, high = np.array(pairs, dtype=float).T
    value = stab(high, low)
    assert ((low <= value) & (value <= high)).all()
    fewest = next(
        k
        for k in range(1, len(pairs) + 1)
        for chosen in combinations(np.unique(high), k)
        if all(any(a <= v <= b for v in chosen) for a, b in pairs)
    )
    assert len(np.unique(value)) == fewest


@settings(deadline=None)
@given(
    st.lists(st.floats(1.0, 2.0), min_size=2, max_size=40),
    st.lists(st.floats(0.0, 0.1), min_size=39, max_size=39),
    st.floats(0.0, 0.5),
)
def test_joints_of_a_row_of_panels_stay_within_the_bound(limits, own, max_gap):
    limit, own = np.array(limits), np.array(own[: len(limits) - 1])
    left, right = np.arange(len(limit) - 1), np.arange(1, len(limit))

    def width(length):
        lost = limit - length
        return own + 0.9 * (lost[left] + lost[right])

    found = fewest_lengths(
        limit, Joints(left, right, width, np.full(len(limit), 0.9)), max_gap, np.zeros(len(limit))
    )
    assert (found.length <= limit).all()
    assert (found.over == (own > max_gap * (1 + 1e-9))).all()
    assert (width(found.length)[~found.over] <= max_gap * (1 + 1e-9)).all()


@pytest.fixture(scope="module")
def fitted():
    chart = inverted(catenoid, (0.3, 0.2, 4.0))
    pattern, cmap = hex_pattern(chart, 30, 9, -0.6), grid_map(chart, 60, 40, -0.7, 1.5)
    return cmap, pattern, fit_panels(cmap, pattern, PanelSettings())


def widest(fitted, **asked):
    cmap, pattern, fit = fitted
    panels = quantize(fit, PanelSettings(**asked))
    quality = measure(cmap, pattern, panels)
    assert quality.overlaps == 0
    return len(panels.class_length), float(np.nanmax(quality.gap_tangential)), panels


@pytest.mark.parametrize("increment", [0.0, 1e-3])
def test_measured_joints_keep_the_bound_with_no_more_sizes_than_classes_by_area_need(fitted, increment):
    _, own, _ = widest(fitted, sizes=None, increment=increment)
    for factor in (1.2, 2.0, 4.0, 8.0):
        count, gap, _ = widest(fitted, sizes="fewest", max_gap=factor * own, increment=increment)
        assert gap <= factor * own * (1 + 1e-9)
        if count > 1:
            assert widest(fitted, sizes=count - 1, increment=increment)[1] > factor * own


def test_joints_that_no_sizes_can_close_are_told_with_their_place(fitted):
    _, own, _ = widest(fitted, sizes=None)
    _, gap, panels = widest(fitted, sizes="fewest", max_gap=own / 2)
    assert gap <= own * (1 + 1e-6)  # the others are no reason to let them become wider
    assert any("even where every panel has a length of its own" in note for note in panels.notes)
    assert any(f"{own:.4g}, between panels" in note for note in panels.notes)


def test_fewest_sizes_need_a_greatest_joint(fitted):
    with pytest.raises(PanelsError, match="no greatest joint is given") as refused:
        quantize(fitted[2], PanelSettings(sizes="fewest"))
    assert refused.value.field == ("max_gap",)


def test_predicted_joints_are_those_measured(fitted):
    """Facing edges are nearly parallel, so that joints are nearly linear in the lengths."""
    curve = quantize(fitted[2], PanelSettings()).trade_off
    for k in (1, 3, 6, 11):
        cmap, pattern, fit = fitted
        quality = measure(cmap, pattern, quantize(fit, PanelSettings(sizes=k)))
        gap = quality.gap_tangential[~np.isnan(quality.gap_tangential)]
        assert curve.joint_mean[k - 1] == pytest.approx(gap.mean(), rel=0.1)
        assert curve.joint_max[k - 1] == pytest.approx(gap.max(), rel=0.15)
