"""Factorised normal matrices Aᵀ D A whose pattern stays the same from step to step."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, diags_array

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.linalg.factor import Factorisation

#: Added to the diagonal, relative to it, so that rounding cannot make the matrix indefinite.
RIDGE = 1e-13


class NormalMatrix:
    """Solves (Aᵀ D A + R) x = b for changing values of A and of the positive diagonals D and R."""

    def __init__(self, points: Floats) -> None:
        """points: (columns of A, 3) where each unknown lies in space; steers the elimination order."""
        self._points = points
        self._factor: Factorisation | None = None
        self._keys: Ints = np.zeros(0, dtype=np.int64)
        self._below: Bools = np.zeros(0, dtype=bool)
        self._diagonal: Bools = np.zeros(0, dtype=bool)

    def factorise(self, a: csr_array, weight: Floats, ridge: Floats | float = 0.0) -> None:
        """a: always with the same pattern of entries. weight: (rows,). ridge: added to the diagonal."""
        factor = self._factor or self._analyse(a)
        product = csr_array(a.T.tocsr() @ diags_array(weight) @ a)
        value = np.zeros(len(self._keys))
        # SciPy leaves out sums that happen to be zero, so entries are found by row and column.
        value[np.searchsorted(self._keys, _keys(product))] = product.data
        factor.factorise(value[self._diagonal] * (1 + RIDGE) + ridge, value[self._below])

    def _analyse(self, a: csr_array) -> Factorisation:
        pattern = csr_array((np.ones(a.nnz), a.indices, a.indptr), shape=a.shape)
        self._keys = np.sort(_keys(csr_array(pattern.T.tocsr() @ pattern)))
        row, column = np.divmod(self._keys, a.shape[1])
        self._below, self._diagonal = row > column, row == column
        self._factor = Factorisation(self._points, row[self._below], column[self._below])
        return self._factor

    def solve(self, right: Floats) -> Floats:
        """b (n,) or (n, k) → x, with the matrix factorised last."""
        if self._factor is None:
            raise RuntimeError("factorise first")
        return self._factor.solve(right)


def _keys(matrix: csr_array) -> Ints:
    """row · n + column of every stored entry."""
    row = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    return np.asarray(row * matrix.shape[1] + matrix.indices, dtype=np.int64)
