"""A few edge lengths for many panels, none longer than a panel's limit.

The best classes are intervals of the sorted limits, and a class takes the least limit of its members. What is
lost is then an exact dynamic programme over the number of classes.

Two things are not left to what is lost alone. Sizes that nobody could distinguish are not wanted: fewer are
used then (``unlike``). And panels may not vanish for nothing: a few tiny cells lose so little area that the
least loss lets dozens of larger panels shrink to them. Where panels would become shorter than a quarter of
their limit, relative losses count beside the area, as far as a bounded share of the area allows
(``_sparing``).
"""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock
from typing import Literal

import numpy as np
import scipy

from hexwrap_solver.arrays import Bools, Floats, Ints

#: A limit this close below a multiple of the increment (relative to the increment) counts as the multiple.
INCREMENT_SLACK = 1e-9
#: Neighbouring limits that differ by less than this (relatively) are equal but for rounding.
ROUNDING = 1e-11

#: Sizes whose lengths differ by less than this (relatively) are one size to everybody who builds, and fewer
#: are used as long as that loses no more than this part of the median limit, or of the area what so much
#: shorter edges lose.
ALIKE = 1e-3
ALIKE_AREA = 2 * ALIKE

#: A panel shorter than this part of its limit, a sixteenth in area, has as good as vanished.
SHRUNK = 0.25
#: So much of the area may be given up for fewer such panels.
PRICE = 0.02
#: Relative losses beside the area, tried in this order; and the limit, relative to the median, below which
#: they count no more than there, for the sums to keep their digits.
RELATIVE, COUNTS_FROM = (0.1, 0.2, 0.4, 0.8, 1.6, 3.2), 0.01

#: So many numbers (8 bytes each) are remembered of the programmes used last, OBJECTS more for each: another
#: number of classes over the same limits needs no more than the layers that are not there yet.
REMEMBERED, OBJECTS = 1 << 21, 128


@dataclass(frozen=True)
class Partition:
    """Best classes for every number 1…K over limits sorted ascending.

    start: per number of classes, the indices (into the sorted limits) at which its classes begin.
    loss: (K,) what that number of classes loses: Σ(limit² − length²), or the greatest limit − length.
    """

    start: list[Ints]
    loss: Floats


def floor_to(length: Floats, increment: float) -> Floats:
    """Rounded down to a multiple of the increment, 0: unchanged."""
    if increment <= 0:
        return length
    return np.asarray(np.floor(length / increment + INCREMENT_SLACK) * increment)


def level(length: Floats) -> Floats:
    """Ascending lengths, those that differ by rounding only (on symmetric surfaces) made the least of
    them: they need no size of their own."""
    new = np.append(True, np.diff(length) > ROUNDING * length[:-1])
    return np.asarray(length[np.flatnonzero(new)[np.cumsum(new) - 1]])


def partition_by_area(length: Floats, classes: int, weight: Floats | None = None) -> Partition:
    """Least lost area, exactly, for 1…classes classes; length: (n,) ascending. weight: (n,) of the panels,
    1 unless given, which j then counts.

    With k classes over the first j limits, the greatest Σ length² is
        V_k(j) = max_i V_{k−1}(i) + (j − i)·ℓ_{i+1}²,
    for each i a straight line in j with slope ℓ_{i+1}². Lines sorted by slope have their upper envelope at
    the corners of the least concave majorant of (slope, intercept), which isotonic regression of the
    difference quotients finds in linear time; a layer costs O(n). Lines with i > j need no exclusion: their
    value at j never exceeds V_{k−1}(j). Equal limits are one line.
    """
    key = (length.tobytes(), None if weight is None else weight.tobytes())
    layers = _more_layers(_memory.taken(key) or _Layers(), classes, length, weight)
    _memory.keep(key, layers)
    return Partition(list(layers.start[:classes]), np.array(layers.loss[:classes]))


@dataclass(frozen=True)
class _Layers:
    """Of the programme for 1, 2, … classes over m different limits.

    choice: (m + 1,) each, where the last class of the best for the first j limits begins. value: (m + 1,) V
    of the last layer. start, loss: as in ``Partition``.
    """

    choice: tuple[Ints, ...] = ()
    value: Floats | None = None
    start: tuple[Ints, ...] = ()
    loss: tuple[float, ...] = ()

    @property
    def size(self) -> int:
        return sum(map(len, (*self.choice, *self.start)))


_Key = tuple[bytes, bytes | None]


class _Memory:
    """Layers by their limits and weights; threads may share it."""

    def __init__(self) -> None:
        self._kept: OrderedDict[_Key, _Layers] = OrderedDict()
        self._size = 0
        self._lock = Lock()

    def taken(self, key: _Key) -> _Layers | None:
        with self._lock:
            return self._pop(key)

    def keep(self, key: _Key, layers: _Layers) -> None:
        with self._lock:
            self._pop(key)  # of another thread
            self._kept[key] = layers
            self._size += _size(key, layers)
            while self._size > REMEMBERED:
                self._pop(next(iter(self._kept)))

    def _pop(self, key: _Key) -> _Layers | None:
        known = self._kept.pop(key, None)
        self._size -= _size(key, known) if known else 0
        return known


def _size(key: _Key, layers: _Layers) -> int:
    return OBJECTS + layers.size + (len(key[0]) + len(key[1] or b"")) // 8


_memory = _Memory()


def _more_layers(known: _Layers, classes: int, length: Floats, weight: Floats | None) -> _Layers:
    """With those up to this many classes, as far as there are different limits."""
    if len(known.choice) >= classes:
        return known
    square, first = np.unique(length**2, return_index=True)
    m = len(square)
    counted = np.arange(len(length) + 1.0) if weight is None else np.append(0.0, np.cumsum(weight))
    begin = counted[np.append(first, len(length))]
    total = float(np.sum(length**2 if weight is None else weight * length**2))
    choice, loss, value = list(known.choice), list(known.loss), known.value
    for _ in range(len(choice), min(classes, m)):
        if value is None:
            chosen, before = np.zeros(m + 1, dtype=np.int64), np.zeros(m + 1)
        else:
            chosen = _upper_envelope(square, value[:-1] - begin[:-1] * square, begin)
            before = value.take(chosen)
        value = before + (begin - begin.take(chosen)) * square.take(chosen)
        value[0] = 0.0
        choice.append(chosen)
        loss.append(max(total - float(value[-1]), 0.0))
    start = [first[which] for which in _traces(choice, len(known.start), m)]
    for one in start:
        one.flags.writeable = False  # what is remembered is shared
    return _Layers(tuple(choice), value, (*known.start, *start), tuple(loss))


def _upper_envelope(slope: Floats, intercept: Floats, at: Floats) -> Ints:
    """For each ascending abscissa the index of the highest of the lines, slopes strictly ascending."""
    run = slope[1:] - slope[:-1]
    quotient = (intercept[1:] - intercept[:-1]) / run
    # Blocks of the decreasing fit are the edges of the concave majorant; their ends are its corners.
    fit = scipy.optimize.isotonic_regression(quotient, weights=run, increasing=False)
    corner = np.asarray(fit.blocks)
    height, place = intercept.take(corner), slope.take(corner)
    edge_slope = (height[1:] - height[:-1]) / (place[1:] - place[:-1])
    # Line corner[t+1] overtakes corner[t] where the abscissa passes −edge_slope[t], ascending in t but for
    # rounding. There are few corners, so that each is looked up among the abscissas.
    from_there = np.concatenate([[0], np.searchsorted(at, -edge_slope), [len(at)]])
    return np.repeat(corner, np.diff(np.maximum.accumulate(from_there)))


def _traces(choice: list[Ints], known: int, m: int) -> list[Ints]:
    """Indices of the distinct values at which the classes begin, for known + 1 … len(choice) classes."""
    begins = np.full((len(choice) + 1, len(choice) - known), m, dtype=np.int64)
    for layer in range(len(choice) - 1, -1, -1):
        late = max(layer - known, 0)  # fewer classes have no such layer
        begins[layer, late:] = choice[layer].take(begins[layer + 1, late:])
    return [np.array(sorted(set(column) - {m}), dtype=np.int64) for column in begins.T.tolist()]


def partition_by_worst(length: Floats, floored: Floats, classes: int) -> Partition:
    """Least greatest loss limit − length over all panels, exactly; both (n,) ascending, floored ≤ length.

    A loss t suffices when the classes drawn greedily from below (each as long as t allows) are few enough.
    The least sufficient t is some panel's loss; bisection jumps from one such loss to the next.
    """
    length_list, floored_list = length.tolist(), floored.tolist()
    starts: list[Ints] = []
    loss: list[float] = []
    found, high, least = [0], length_list[-1] - floored_list[0], float((length - floored).max())
    for k in range(1, classes + 1):
        if len(found) < k - 1 and high <= least:  # with equal losses, one class more may gain nothing yet
            break
        found, high = _least_worst(length_list, floored_list, k, found, high)
        starts.append(np.array(found, dtype=np.int64))
        loss.append(high)
    return Partition(starts, np.array(loss))


def _least_worst(
    length: list[float], floored: list[float], classes: int, found: list[int], high: float
) -> tuple[list[int], float]:
    """Starts of the classes with the least greatest loss, and that loss; found, high: any that will do."""
    low = 0.0
    while low < high:
        middle = low if low == 0 else (low + high) / 2
        if low and not low < middle < high:  # neighbouring floating-point numbers
            break
        starts, reached, more = _greedy(length, floored, middle, classes)
        if starts is None:
            low = max(more, middle)  # more may be rounded down
        else:
            found, high = starts, reached
    return found, high


def _greedy(
    length: list[float], floored: list[float], loss: float, classes: int
) -> tuple[list[int] | None, float, float]:
    """Starts of the fewest classes whose loss stays within the given one, None if more than ``classes``; the
    greatest loss among them; and the least greater loss that would lengthen a class.

    Plain numbers: a few dozen searches of a list take less time than one array operation each.
    """
    starts: list[int] = []
    reached, more = 0.0, np.inf
    n, at = len(length), 0
    while at < n:
        if len(starts) == classes:
            return None, reached, more
        starts.append(at)
        base = floored[at]
        after = bisect_right(length, base + loss, at)
        # The sum is rounded, the difference decides.
        while after < n and length[after] - base <= loss:
            after += 1
        while after > at and length[after - 1] - base > loss:
            after -= 1
        if after < n:
            more = min(more, length[after] - base)
        if after == at:
            return None, reached, more
        reached = max(reached, length[after - 1] - base)
        at = after
    return starts, reached, more


def partition(
    limit: Floats, classes: int, cost: Literal["area", "worst"], increment: float
) -> tuple[Partition, Floats]:
    """Partition of limits sorted ascending, and the floored limits that the lengths are taken from."""
    floored = level(floor_to(limit, increment))
    made = (
        partition_by_area(floored, classes) if cost == "area" else partition_by_worst(limit, floored, classes)
    )
    return made, floored


def lengths_of(start: Ints, floored: Floats) -> Floats:
    """(n,) every class as long as its first, shortest member."""
    return np.repeat(floored[start], np.diff(np.append(start, len(floored))))


def unlike(made: Partition, floored: Floats, classes: int, cost: str) -> int:
    """How many of the classes are worth while.

    One after the other is given up as long as two of the remaining best lengths are ``ALIKE``, unless that
    loses more than ``ALIKE_AREA`` (``ALIKE``) of the whole against ``classes`` of them.
    """
    lost = ALIKE_AREA * float(floored @ floored) if cost == "area" else ALIKE * float(np.median(floored))
    most = made.loss[classes - 1] + lost
    while classes > 1 and made.loss[classes - 2] <= most:
        used = floored[made.start[classes - 1]]
        if not (np.diff(used) < ALIKE * used[:-1]).any():
            break
        classes -= 1
    return classes


def _sparing(floored: Floats, classes: int, plain: Floats) -> Floats:
    """Lengths that leave fewer panels ``SHRUNK`` than the plain ones, with the least lost area, for no more
    than ``PRICE`` of the area more.

    Each that is tried is exactly the best for Σ (1 + μ·median²/limit²)·(limit² − length²): every panel's
    area, and μ times what it loses of itself.
    """

    def shrunk(length: Floats) -> int:
        return int((length < SHRUNK * floored).sum())

    if not shrunk(plain):
        return plain
    relative = 1 / np.maximum(floored / np.median(floored), COUNTS_FROM) ** 2
    least = plain @ plain - PRICE * (floored @ floored)
    tried = [plain]
    for share in RELATIVE:
        made = partition_by_area(floored, classes, 1 + share * relative)
        tried.append(lengths_of(made.start[-1], floored))
    return min((one for one in tried if one @ one >= least), key=lambda one: (shrunk(one), -(one @ one)))


def choose_lengths(
    limit: Floats,
    classes: int | None,
    cost: Literal["area", "worst"] = "area",
    increment: float = 0.0,
    smallest: float = 0.0,
) -> Floats:
    """(q,) the length of each panel: at most its limit, a multiple of the increment, one of at most
    ``classes`` values, fewer where some would be ``ALIKE``.

    limit: (q,) positive, any order. classes: None leaves every panel its own (floored) limit.
    smallest: panels whose limit is below cannot reach the allowed range; they share no class with panels
    that can, and the number of classes (from 2) is divided between the two groups with the least total loss.
    """
    if classes is None or not len(limit):
        return floor_to(limit, increment)
    length = np.zeros_like(limit)
    low: Bools = floor_to(limit, increment) < smallest
    if classes == 1:
        low[:] = False
    groups = [group for group in (np.flatnonzero(low), np.flatnonzero(~low)) if len(group)]
    ordered = [group[np.argsort(limit[group], kind="stable")] for group in groups]
    parts = [partition(limit[group], classes, cost, increment) for group in ordered]
    for group, (made, floored), k in zip(ordered, parts, divide(parts, classes, cost), strict=True):
        chosen = lengths_of(made.start[unlike(made, floored, k, cost) - 1], floored)
        if cost == "area":
            chosen = _sparing(floored, k, chosen)
        length[group] = chosen
    return length


def divide(parts: list[tuple[Partition, Floats]], classes: int, cost: str) -> list[int]:
    """Number of classes for each of one or two groups (at least one each)."""
    if len(parts) == 1:
        return [len(parts[0][0].start)]
    first, second = parts[0][0].loss, parts[1][0].loss
    options = [(k, min(classes - k, len(second))) for k in range(1, min(len(first), classes - 1) + 1)]
    a, b = np.array(options).T - 1
    losses = np.maximum(first[a], second[b]) if cost == "worst" else first[a] + second[b]
    return list(options[int(losses.argmin())])
