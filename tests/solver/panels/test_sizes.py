"""Size classes: exactly the best, never above a limit, never worse than an even grid."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_solver.panels import sizes
from hexwrap_solver.panels.sizes import (
    ALIKE,
    ALIKE_AREA,
    PRICE,
    SHRUNK,
    choose_lengths,
    floor_to,
    lengths_of,
    partition_by_area,
    partition_by_worst,
)

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


@settings(deadline=None)
@given(limits | tied, st.integers(1, 5))
def test_area_partition_is_optimal(length, classes):
    made = partition_by_area(length, classes)
    for k, start in enumerate(made.start, 1):
        chosen = np.repeat(length[start], np.diff(np.append(start, len(length))))
        best = brute_force(length, length, k, lost_area)
        assert len(start) <= k
        assert lost_area(length, chosen) == pytest.approx(best, abs=1e-11)
        assert made.loss[k - 1] == pytest.approx(best, abs=1e-11)


@settings(deadline=None)
@given(limits | tied, st.lists(st.integers(1, 9), min_size=1, max_size=4), st.booleans())
def test_what_is_remembered_of_the_partition_changes_nothing(length, asked, weighted):
    weight = 1 / length if weighted else None
    for classes in asked:
        made = partition_by_area(length, classes, weight)
    sizes._memory = sizes._Memory()
    fresh = partition_by_area(length, asked[-1], weight)
    assert made.loss.tobytes() == fresh.loss.tobytes()
    assert [start.tolist() for start in made.start] == [start.tolist() for start in fresh.start]


def test_no_more_is_remembered_of_partitions_than_a_bound(monkeypatch):
    monkeypatch.setattr(sizes, "REMEMBERED", 5000)
    monkeypatch.setattr(sizes, "_memory", sizes._Memory())
    kept = sizes._memory._kept
    for seed in range(20):
        partition_by_area(np.sort(np.random.default_rng(seed).uniform(1, 2, 200)), 8)
        partition_by_area(np.full(1000, 1.0 + seed), 8)  # all alike: one choice, but a thousand limits
        partition_by_area(np.full(1, 1.0 + seed), 1)
        assert 0 < sum(len(limits) for limits, _ in kept) <= 8 * 5000
        assert sizes._memory._size == sum(sizes._size(*one) for one in kept.items()) <= 5000
    partition_by_area(np.linspace(1, 2, 6000), 8)
    assert not kept
    assert sizes._memory._size == 0


@given(limits | tied, st.integers(1, 5), st.integers(0, 10**6))
def test_partition_of_weighted_area_is_optimal(length, classes, seed):
    weight = np.random.default_rng(seed).uniform(0.1, 10.0, len(length))

    def lost(length, chosen):
        return float(weight @ (length**2 - chosen**2))

    made = partition_by_area(length, classes, weight)
    for k, start in enumerate(made.start, 1):
        best = brute_force(length, length, k, lost)
        assert lost(length, lengths_of(start, length)) == pytest.approx(best, abs=1e-10)
        assert made.loss[k - 1] == pytest.approx(best, abs=1e-10)


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


@settings(max_examples=50)
@given(st.integers(0, 10**6), st.floats(1e-6, 0.2), st.integers(1, 15), st.sampled_from(["area", "worst"]))
def test_sizes_that_nobody_can_tell_apart_are_not_used(seed, spread, classes, cost):
    """The classes used are the best so many; they lose next to nothing against all that are allowed; and
    where two of them are alike, one fewer would lose more."""
    limit = np.sort(1 + spread * np.random.default_rng(seed).random(200))
    length = choose_lengths(limit, classes, cost)
    used = np.unique(length)
    made = partition_by_area(limit, classes) if cost == "area" else partition_by_worst(limit, limit, classes)
    loss = lost_area(limit, length) if cost == "area" else greatest_loss(limit, length)
    allowed = ALIKE_AREA * float(limit @ limit) if cost == "area" else ALIKE * float(np.median(limit))
    assert loss == pytest.approx(made.loss[len(used) - 1], abs=1e-9)
    assert loss <= made.loss[-1] + allowed + 1e-9
    if (np.diff(used) < ALIKE * used[:-1]).any():
        assert made.loss[len(used) - 2] > made.loss[-1] + allowed - 1e-9
    if spread < 0.5 * ALIKE:
        assert len(used) == 1


def test_different_sizes_are_all_used():
    limit = 1 + np.arange(1000) / 5000
    for classes in (2, 11, 20):
        assert len(np.unique(choose_lengths(limit, classes))) == classes


@settings(max_examples=50)
@given(st.integers(0, 10**6), st.integers(1, 30), st.integers(2, 12))
def test_a_few_tiny_cells_do_not_make_others_vanish(seed, tiny, classes):
    """Fewer panels far below their limit than at the least lost area, for a bounded part of the area; the
    least lost area itself where there are none."""
    rng = np.random.default_rng(seed)
    limit = np.sort(np.concatenate([rng.uniform(0.7, 1.3, 500), rng.uniform(0, 1, tiny) ** 3 + 1e-6]))
    length = choose_lengths(limit, classes)
    made = partition_by_area(limit, classes)
    least = lengths_of(made.start[-1], limit)
    area = float(limit @ limit)
    shrunk, before = (int((chosen < SHRUNK * limit).sum()) for chosen in (length, least))
    assert shrunk <= before
    assert (length <= limit).all()
    assert len(np.unique(length)) <= classes
    assert lost_area(limit, length) <= made.loss[-1] + max(PRICE, ALIKE_AREA) * area + 1e-9
    if not before:
        assert lost_area(limit, length) <= made.loss[-1] + ALIKE_AREA * area + 1e-9


def test_one_tiny_cell_keeps_to_itself():
    limit = np.concatenate([[1e-4], np.geomspace(0.05, 0.7, 40), np.linspace(0.7, 1.3, 400)])
    least = lengths_of(partition_by_area(limit, 11).start[-1], limit)
    length = choose_lengths(limit, 11)
    assert (least < SHRUNK * limit).sum() > 20
    assert (length < SHRUNK * limit).sum() < 10
    assert choose_lengths(1000 * limit, 11) == pytest.approx(1000 * length, rel=1e-12)


def test_panels_within_an_allowed_range_do_not_vanish_either():
    limit = np.concatenate([[1e-4], np.geomspace(0.05, 0.7, 40), np.linspace(0.7, 1.3, 400)])
    length = choose_lengths(limit, 11, smallest=0.01)
    within = limit >= 0.01
    assert (length[within] >= 0.05).all()
    assert (length < SHRUNK * limit).sum() < 10
