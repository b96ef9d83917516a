"""The integer vector nearest to a real one in a quadratic norm: reduced by Lenstra, Lenstra, Lovász (1982),
then enumerated by Schnorr and Euchner (1994)."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.tolerances import TINY

#: Lovász' constant.
DELTA = 0.99
#: Nodes of the enumeration; it is exact long before in the dimensions that occur (below 40).
MOST_NODES = 20_000
#: Added to the diagonal, relative to its mean.
RIDGE = 1e-12


class NearestIntegers:
    """z minimising (z − centre)ᵀ gram (z − centre) for any number of centres. gram: (n, n) positive definite,
    or so but for rounding."""

    def __init__(self, gram: Floats) -> None:
        n = len(gram)
        self._gram = gram + RIDGE * max(float(np.trace(gram)), TINY) / max(n, 1) * np.eye(n)
        root = np.asarray(np.linalg.cholesky(self._gram).T, dtype=np.float64)
        self._change = _reduced(root)
        self._upper = _triangular(root @ self._change)

    def solve(self, right: Floats) -> Floats:
        """gram⁻¹ right, (n, k)."""
        return np.asarray(np.linalg.solve(self._gram, right))

    def nearest(self, centre: Floats) -> tuple[Ints, float]:
        """z for a centre (n,), and the value there."""
        if not len(centre):
            return np.zeros(0, dtype=np.int64), 0.0
        found, value = _enumerate(self._upper, np.linalg.solve(self._change.astype(float), centre))
        return self._change @ found, value

    def near(self, centres: Floats) -> Ints:
        """(k, n) nearly nearest to centres (k, n), by rounding one coordinate after the other (Babai)."""
        middle = np.linalg.solve(self._change.astype(float), centres.T)
        z = middle.copy()
        for level in range(len(z) - 1, -1, -1):
            beyond = self._upper[level, level + 1 :] @ (z - middle)[level + 1 :]
            z[level] = np.rint(middle[level] - beyond / self._upper[level, level])
        return np.asarray((self._change @ z.astype(np.int64)).T)


def nearest_integers(gram: Floats, centre: Floats) -> tuple[Ints, float]:
    """See ``NearestIntegers``, for one centre."""
    return NearestIntegers(gram).nearest(centre)


def integer_solutions(matrix: Ints, right: Ints) -> tuple[Ints, Ints] | None:
    """(n,) one integer solution of matrix · x = right and (n, d) what spans all differences between them;
    None where there is none. By the column style Hermite normal form, in integers of any length."""
    a, n = matrix.astype(object), matrix.shape[1]
    change = np.eye(n, dtype=object)
    pivots: list[int] = []
    for row in range(len(a)):
        low = len(pivots)
        while True:
            live = [c for c in range(low, n) if a[row, c]]
            if len(live) <= 1:
                break
            least = min(live, key=lambda c: abs(a[row, c]))
            for other in live:
                if other != least:
                    times = a[row, other] // a[row, least]
                    a[:, other] -= times * a[:, least]
                    change[:, other] -= times * change[:, least]
        if live:
            for table in (a, change):
                table[:, [low, live[0]]] = table[:, [live[0], low]]
            pivots.append(row)
    z = np.zeros(n, dtype=object)
    for i, row in enumerate(pivots):
        rest = int(right[row]) - sum(a[row, j] * z[j] for j in range(i))
        if rest % a[row, i]:
            return None
        z[i] = rest // a[row, i]
    if any(sum(a[row, j] * z[j] for j in range(n)) != right[row] for row in range(len(a))):
        return None
    return (change @ z).astype(np.int64), change[:, len(pivots) :].astype(np.int64)


def _reduced(basis: Floats) -> Ints:
    """Unimodular (n, n) that makes the columns of the basis short and nearly orthogonal."""
    n = basis.shape[1]
    change, upper = np.eye(n, dtype=np.int64), _triangular(basis)
    k = 1
    for _ in range(200 * n):
        if k >= n:
            break
        for j in range(k - 1, -1, -1):
            q = int(np.rint(upper[j, k] / upper[j, j]))
            if q:
                change[:, k] -= q * change[:, j]
                upper[:, k] -= q * upper[:, j]
        if upper[k, k] ** 2 + upper[k - 1, k] ** 2 >= DELTA * upper[k - 1, k - 1] ** 2:
            k += 1
        else:
            change[:, [k - 1, k]] = change[:, [k, k - 1]]
            upper[:, [k - 1, k]] = upper[:, [k, k - 1]]
            cosine, sine = upper[k - 1 : k + 1, k - 1] / np.hypot(upper[k - 1, k - 1], upper[k, k - 1])
            turned = np.array([[cosine, sine], [-sine, cosine]]) @ upper[k - 1 : k + 1]  # Givens rotation
            turned[1, k - 1] = 0.0
            upper[k - 1 : k + 1] = turned
            k = max(k - 1, 1)
    return change


def _triangular(matrix: Floats) -> Floats:
    """R of its QR decomposition."""
    return np.asarray(np.linalg.qr(matrix)[1], dtype=np.float64)


def _enumerate(upper: Floats, middle: Floats) -> tuple[Ints, float]:
    """Depth first, the nearest value of each coordinate first, pruned by the best so far."""
    n = len(middle)
    z = np.zeros(n)
    best, least, nodes = np.rint(middle), np.inf, 0

    def visit(level: int, cost: float) -> None:
        nonlocal best, least, nodes
        diagonal = upper[level, level]
        target = middle[level] - float(upper[level, level + 1 :] @ (z - middle)[level + 1 :]) / diagonal
        value, step = float(np.rint(target)), 0
        sign = 1.0 if target >= value else -1.0
        while nodes < MOST_NODES or not np.isfinite(least):
            nodes += 1
            here = cost + (diagonal * (value - target)) ** 2
            if here >= least:
                return
            z[level] = value
            if level == 0:
                best, least = z.copy(), here
            else:
                visit(level - 1, here)
            step += 1
            value += sign * step if step % 2 else -sign * step

    visit(n - 1, 0.0)
    return best.astype(np.int64), float(least)
