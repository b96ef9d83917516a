"""Which panels have the same shape: congruent up to rotation, mirror images distinguished."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.geometry import cross, dot
from hexwrap_solver.panels.polygons import edge_vectors, row_maxima, row_minima

#: Figures (relative to the mean edge, or radians) that differ by less are the same.
TOLERANCE = 1e-7
#: Numbers made of several stay below.
LARGEST = 2**62


def congruence_classes(polygons: Ragged, angle: Floats) -> Ints:
    """(q,) class of each polygon, numbered by first appearance; angle: (·,) their ``interior_angles``.

    Edge length, interior angle and twist (signed volume of four successive corners) at every corner, read
    around the polygon, determine it up to a motion. They are made integers by merging figures closer than the
    tolerance, and read from the corner at which the sequence is lexicographically least.
    """
    letter = _letters(polygons, angle)
    key = np.full(polygons.n_rows, -1, dtype=np.int64)
    used = 0
    for n in np.unique(polygons.lengths):
        rows = np.flatnonzero(polygons.lengths == n)
        words = letter[polygons.offsets[rows][:, None] + np.arange(n)]
        regular = (words == words[:, :1]).all(axis=1)  # and turned as they are
        for some, word in ((regular, words[regular][:, :1]), (~regular, _least_rotation(words[~regular]))):
            key[rows[some]] = used + _numbered(word)
            used = int(key.max()) + 1
    _, first, member = np.unique(key, return_index=True, return_inverse=True)
    rank = np.zeros(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.asarray(rank[member])


def _letters(polygons: Ragged, angle: Floats) -> Ints:
    """(·,) an integer per corner for its edge length, angle and twist."""
    following = polygons.next()
    edge = edge_vectors(polygons)
    length = np.sqrt(dot(edge, edge))
    unit = float(length.mean()) if len(length) else 1.0
    ahead = edge.take(following, axis=0)
    twist = dot(cross(edge, ahead), ahead.take(following, axis=0)) / unit**3
    merged = [_merge(figure, polygons) for figure in (length / unit, angle, twist)]
    return _joined(np.stack(merged, axis=1))


def _numbered(words: Ints) -> Ints:
    """(q,) number of each row (q, n) of integers ≥ 0, in lexicographic order."""
    return np.asarray(np.unique(_joined(words), return_inverse=True)[1], dtype=np.int64)


def _joined(words: Ints) -> Ints:
    """(q,) an integer for each row (q, n) of integers ≥ 0, in lexicographic order.

    Column by column two numbers become one; sorting whole rows takes many times as long.
    """
    number, span = np.zeros(len(words), dtype=np.int64), 1
    for letter in words.T:
        size = int(letter.max(initial=0)) + 1
        if span * size > LARGEST:
            number, letter = (np.unique(part, return_inverse=True)[1] for part in (number, letter))
            span, size = (int(part.max(initial=0)) + 1 for part in (number, letter))
        number, span = number * size + letter, span * size
    return number


def _merge(values: Floats, polygons: Ragged) -> Ints:
    """Integers in the order of the values; neighbours in that order closer than the tolerance share one.

    Polygons whose values all lie within the tolerance, as the regular ones' do, are sorted as one.
    """
    low, high = row_minima(values, polygons.offsets), row_maxima(values, polygons.offsets)
    alike = high - low <= TOLERANCE
    others = ~alike[polygons.row]
    start = np.concatenate([low[alike], values[others]])
    end = np.concatenate([high[alike], values[others]])
    order = np.argsort(start, kind="stable")
    label = np.zeros(len(start), dtype=np.int64)
    label[order[1:]] = np.cumsum(start[order[1:]] - np.maximum.accumulate(end[order])[:-1] > TOLERANCE)
    of_row = np.zeros(len(low), dtype=np.int64)
    of_row[alike] = label[: int(alike.sum())]
    merged = of_row[polygons.row]
    merged[others] = label[int(alike.sum()) :]
    return merged


def _least_rotation(words: Ints) -> Ints:
    """(q, n) words turned to begin where they are lexicographically least."""
    q, n = words.shape
    possible = np.ones((q, n), dtype=bool)
    for step in range(n):
        letter = np.where(possible, np.roll(words, -step, axis=1), np.iinfo(np.int64).max)
        possible &= letter == letter.min(axis=1, keepdims=True)
    start = possible.argmax(axis=1)
    return np.asarray(words[np.arange(q)[:, None], (start[:, None] + np.arange(n)) % n])
