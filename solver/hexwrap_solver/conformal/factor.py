"""Sparse symmetric systems that share one pattern: analysed once, factorised at every Newton step."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from hexwrap_solver.arrays import Floats, Ints


class Factorisation:
    """Solves A x = b for symmetric positive definite A of a fixed pattern.

    rows, columns: (e,) positions of the off-diagonal entries, rows > columns, each pair once.
    """

    def __init__(self, n: int, rows: Ints, columns: Ints) -> None:
        self.n = n
        diagonal = np.arange(n)
        order = sparse.coo_matrix(
            (
                np.arange(1.0, n + 2 * len(rows) + 1),
                (np.concatenate([diagonal, rows, columns]), np.concatenate([diagonal, columns, rows])),
            ),
            shape=(n, n),
        ).tocsc()
        self._matrix = order
        self._source = order.data.astype(np.int64) - 1

    def factorise(self, diagonal: Floats, off_diagonal: Floats) -> None:
        """Takes new values. Raises RuntimeError where the matrix is exactly singular."""
        self._matrix.data = np.concatenate([diagonal, off_diagonal, off_diagonal])[self._source]
        self._lu = splu(
            self._matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )

    def solve(self, right: Floats) -> Floats:
        return np.asarray(self._lu.solve(right))
