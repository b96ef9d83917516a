"""Size classes: exactly the best, never above a limit, never worse than an even grid."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.panels.sizes import choose_lengths, floor_to, partition_by_area, partition_by_worst

limits = st.lists(st.floats(0.5, 2.0), min_size=1, max_size=9).map(lambda x: np.sort(np.array(x)))
#: Many ties, as after rounding down to an increment.
tied = st.lists(st.integers(1, 6), min_size=1, max_size=9).map(lambda x: np.sort(np.array(x, dtype=float)))


def brute_force(length, floored, classes, loss):
    """Least loss over every way to cut the sorted limits into at most ``classes`` runs."""
    n, best = len(length), np.inf
    for cuts in range(min(classes, n)):
        for inner in combinations(range(1, n), cuts):
            start = np.array([0, *inner])
            chosen = np.repeat(floored[start], np.diff(np.append(start, n)))
            best = min(best, loss(length, chosen))
    return best


def lost_area(length, chosen):
    return float((length**2 - chosen**2).sum())


def greatest_loss(length, chosen):
    return float((length - chosen).max())


@given(limits | tied, st.integers(1, 5))
def test_area_partition_is_optimal(length, classes):
    made = partition_by_area(length, classes)
    for k, start in enumerate(made.start, 1):
        chosen = np.repeat(length[start], np.diff(np.append(start, len(length))))
        best = brute_force(length, length, k, lost_area)
        assert len(start) <= k
        assert lost_area(length, chosen) == pytest.approx(best, abs=1e-11)
        assert made.loss[k - 1] == pytest.approx(best, abs=1e-11)


@given(limits | tied, st.integers(1, 5), st.sampled_from([0.0, 0.2]))
def test_worst_partition_is_optimal(length, classes, increment):
    floored = floor_to(length, increment)
    made = partition_by_worst(length, floored, classes)
    for k, start in enumerate(made.start, 1):
        chosen = np.repeat(floored[start], np.diff(np.append(start, len(length))))
        assert greatest_loss(length, chosen) == pytest.approx(
            brute_force(length, floored, k, greatest_loss), abs=1e-12
        )


def test_classes_go_on_after_one_that_gains_nothing():
    """Three equal gaps: the greatest loss falls with the second class and the fourth, not with the third."""
    length = np.array([1.0, 2.0, 3.0, 4.0])
    assert partition_by_worst(length, length, 4).loss.tolist() == [3.0, 1.0, 1.0, 0.0]


@settings(max_examples=30)
@given(st.integers(0, 10**6), st.integers(2, 20), st.sampled_from(["area", "worst"]))
def test_never_worse_than_an_arithmetic_grid(seed, classes, cost):
    limit = np.random.default_rng(seed).gamma(4.0, 0.1, 500) + 1
    grid = np.linspace(limit.min(), limit.max(), classes + 1)[:-1]
    on_grid = grid[np.searchsorted(grid, limit, side="right") - 1]
    loss = lost_area if cost == "area" else greatest_loss
    assert loss(limit, choose_lengths(limit, classes, cost)) <= loss(limit, on_grid) + 1e-12


@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.0005, 0.05]), st.sampled_from([None, 1, 3, 11]))
def test_lengths_keep_their_promises(seed, increment, classes):
    limit = np.random.default_rng(seed).uniform(1.0, 2.0, 60)
    length = choose_lengths(limit, classes, "area", increment)
    assert (length <= limit + 1e-12).all()
    if classes is not None:
        assert len(np.unique(length)) <= classes
    if increment:
        assert np.allclose(length / increment, np.round(length / increment), atol=1e-9)


def test_panels_below_the_range_share_no_class_with_the_others():
    limit = np.array([1.0, 1.02, 1.2, 1.49, 1.5, 1.6, 1.7, 1.9])
    length = choose_lengths(limit, 3, smallest=1.5)
    assert (length[limit >= 1.5] >= 1.5).all()
    assert len(np.unique(length)) == 3
    best = min(
        lost_area(limit, np.concatenate([choose_lengths(limit[:4], k), choose_lengths(limit[4:], 3 - k)]))
        for k in (1, 2)
    )
    assert lost_area(limit, length) == pytest.approx(best, abs=1e-12)


def test_as_many_classes_as_values_lose_nothing():
    limit = np.array([1.0, 3.0, 2.0, 2.0])
    assert (choose_lengths(limit, 3) == limit).all()
    assert (choose_lengths(limit, 40, "worst") == limit).all()


def test_one_class_takes_the_least_limit():
    assert (choose_lengths(np.array([3.0, 1.5, 2.0]), 1) == 1.5).all()


def test_equal_limits_make_one_class():
    assert (choose_lengths(np.full(100, 1.7), 11) == 1.7).all()


@pytest.mark.parametrize("cost", ["area", "worst"])
def test_limits_that_rounding_tells_apart_share_a_class(cost):
    few = np.array([1.0, 1.3, 1.7])
    limit = np.repeat(few, 50) * (1 + 1e-15 * np.random.default_rng(0).normal(size=150))
    length = choose_lengths(limit, 11, cost)
    assert len(np.unique(length)) == 3
    assert (length <= limit).all()
    np.testing.assert_allclose(length, limit, rtol=1e-13)


def test_large_problems_agree_with_the_quadratic_programme():
    """Monge or not, the recurrence evaluated over all pairs gives the same value."""
    length = np.sort(np.random.default_rng(5).lognormal(size=400))
    n, square = len(length), length**2
    value = np.arange(n + 1) * square[0]
    i, j = np.arange(n)[:, None], np.arange(n + 1)[None]
    for k in range(2, 9):
        value = np.where(i <= j, value[:-1, None] + (j - i) * square[:, None], -np.inf).max(axis=0)
        assert partition_by_area(length, 8).loss[k - 1] == pytest.approx(square.sum() - value[-1], rel=1e-11)
