"""Normal matrices of residuals that belong to cells over shared corners, summed cell by cell.

A cell's part of JᵀJ is a small dense matrix over its own corners. Adding these up at places found once is
many times faster than the product of sparse matrices, which finds them anew each time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.linalg.factor import Factorisation
from hexwrap_solver.linalg.normal_matrix import RIDGE


class CellMatrix:
    """Solves (Σ JᵀJ + ridge) x = b for three unknowns per vertex and changing J of a fixed pattern."""

    def __init__(self, points: Floats, corners: Sequence[Ints]) -> None:
        """points: (n, 3) steer the elimination order. corners: per group of cells (q, p) vertices, those of
        a cell all different."""
        self._n = len(points)
        pairs = [np.tril_indices(corner.shape[1]) for corner in corners]
        one = [corner[:, i] for corner, (i, _) in zip(corners, pairs, strict=True)]
        other = [corner[:, j] for corner, (_, j) in zip(corners, pairs, strict=True)]
        own = np.arange(self._n)
        # Every vertex has a block of its own, used by a cell or not: the ridge stands there.
        keys = [
            (np.maximum(a, b) * self._n + np.minimum(a, b)).ravel() for a, b in zip(one, other, strict=True)
        ]
        block, at = np.unique(np.concatenate([own * (self._n + 1), *keys]), return_inverse=True)
        ends = np.cumsum([self._n, *(len(key) for key in keys)])
        self._entries = 9 * len(block)
        self._places = [
            _places(at[start:stop].reshape(a.shape), a, b)
            for start, stop, a, b in zip(ends[:-1], ends[1:], one, other, strict=True)
        ]
        row, column = (
            (3 * vertex[:, None] + coordinate).ravel()
            for vertex, coordinate in zip(np.divmod(block, self._n), np.divmod(np.arange(9), 3), strict=True)
        )
        self._below = np.flatnonzero(row > column)
        self._diagonal = np.flatnonzero(row == column)
        self._factor = Factorisation(np.repeat(points, 3, axis=0), row[self._below], column[self._below])

    def factorise(self, slopes: Sequence[Floats], ridge: float) -> None:
        """slopes: J per group, (q, m, 3p)."""
        value = np.zeros(self._entries)
        for slope, places in zip(slopes, self._places, strict=True):
            square = slope.transpose(0, 2, 1) @ slope
            i, j = np.tril_indices(slope.shape[2])
            value += np.bincount(places.ravel(), weights=square[:, i, j].ravel(), minlength=self._entries)
        diagonal = value[self._diagonal].reshape(-1, 3)
        # The same in all directions: a surface of revolution is to keep its symmetry.
        guard = RIDGE * diagonal.mean(axis=1, keepdims=True) + ridge
        self._factor.factorise((diagonal + guard).ravel(), value[self._below])

    def solve(self, right: Floats) -> Floats:
        """b (3n,) → x, with the matrix factorised last."""
        return self._factor.solve(right)


def _places(block: Ints, one: Ints, other: Ints) -> Ints:
    """(q, 3p(3p + 1)/2) where the lower half of a cell's matrix goes among the entries of all blocks.

    block: (q, p(p + 1)/2) of each pair of corners; one, other: the pair's vertices. A block's rows are those
    of its higher vertex.
    """
    p = int(np.sqrt(2 * block.shape[1]))
    i, j = np.tril_indices(3 * p)
    pair = (i // 3) * (i // 3 + 1) // 2 + j // 3
    row, column = i % 3, j % 3
    upright = (one >= other)[:, pair]
    return np.asarray(9 * block[:, pair] + np.where(upright, 3 * row + column, 3 * column + row))
