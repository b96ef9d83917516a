"""Which panels have the same shape: congruent up to rotation, mirror images distinguished."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, positions
from hexwrap_solver.panels.polygons import Outlines

#: Figures (relative to the mean edge, or radians) that differ by less are the same.
TOLERANCE = 1e-7
#: Numbers made of several stay below.
LARGEST = 2**62


def congruence_classes(shapes: list[Outlines]) -> Ints:
    """(q,) class of each polygon, numbered by first appearance.

    Edge length, interior angle and twist (signed volume of three successive edges) at every corner, read
    around the polygon, determine it up to a motion. They are made integers by merging figures closer than the
    tolerance, and read from the corner at which the sequence is lexicographically least.
    """
    key = np.full(sum(len(one.row) for one in shapes), -1, dtype=np.int64)
    corners = sum(one.length.size for one in shapes)
    unit = sum(float(one.length.sum()) for one in shapes) / max(corners, 1)
    used = 0
    for one in shapes:
        letter = _letters([one.length / unit, one.angle, one.twist / unit**3])
        alike = (letter == letter[0]).all(axis=0)  # and turned as they are
        key[one.row[alike]] = used + _numbered(letter[:1, alike])
        used = int(key.max()) + 1
        key[one.row[~alike]] = used + _numbered(_least_rotation(letter[:, ~alike]))
        used = int(key.max()) + 1
    _, first, member = np.unique(key, return_index=True, return_inverse=True)
    return positions(np.argsort(first), len(first))[member]


def _letters(figures: list[Floats]) -> Ints:
    """(n, k) an integer for each corner, of its figures, (n, k) each."""
    return _joined(np.stack([_merge(figure) for figure in figures]))


def _numbered(words: Ints) -> Ints:
    """(k,) number of each column (n, k) of integers ≥ 0, in lexicographic order."""
    return np.asarray(np.unique(_joined(words), return_inverse=True)[1], dtype=np.int64)


def _joined(words: Ints) -> Ints:
    """(…,) an integer for each column (n, …) of integers ≥ 0, in lexicographic order.

    Row by row two numbers become one; sorting whole columns takes many times as long.
    """
    number, span = np.zeros(words.shape[1:], dtype=np.int64), 1
    for letter in words:
        size = int(letter.max(initial=0)) + 1
        if span * size > LARGEST:
            number, letter = (
                np.unique(part, return_inverse=True)[1].reshape(part.shape) for part in (number, letter)
            )
            span, size = (int(part.max(initial=0)) + 1 for part in (number, letter))
        number, span = number * size + letter, span * size
    return number


def _merge(values: Floats) -> Ints:
    """(n, k) integers in the order of the values; neighbours in that order closer than the tolerance share
    one.

    Polygons whose values all lie within the tolerance, as the regular ones' do, are sorted as one.
    """
    low, high = values.min(axis=0), values.max(axis=0)
    alike = high - low <= TOLERANCE
    others = values[:, ~alike].ravel()
    start, end = np.concatenate([low[alike], others]), np.concatenate([high[alike], others])
    order = np.argsort(start)
    label = np.zeros(len(start), dtype=np.int64)
    label[order[1:]] = np.cumsum(start[order[1:]] - np.maximum.accumulate(end[order])[:-1] > TOLERANCE)
    merged = np.empty(values.shape, dtype=np.int64)
    merged[:, alike] = label[: len(label) - len(others)]
    merged[:, ~alike] = label[len(label) - len(others) :].reshape(len(values), -1)
    return merged


def _least_rotation(words: Ints) -> Ints:
    """(n, k) words, a column each, turned to begin where they are lexicographically least."""
    n, k = words.shape
    possible = np.ones((n, k), dtype=bool)
    for step in range(n):
        letter = np.where(possible, np.roll(words, -step, axis=0), np.iinfo(np.int64).max)
        possible &= letter == letter.min(axis=0)
    start = possible.argmax(axis=0)
    return np.asarray(words[(start + np.arange(n)[:, None]) % n, np.arange(k)])
