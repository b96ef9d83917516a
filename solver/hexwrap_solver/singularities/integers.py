"""The integer vector nearest to a real one in a quadratic norm: reduced by Lenstra, Lenstra, Lovász (1982),
then enumerated by Schnorr and Euchner (1994)."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints

#: Lovász' constant.
DELTA = 0.99
#: Nodes of the enumeration; it is exact long before in the dimensions that occur (below 40).
MOST_NODES = 20_000


def nearest_integers(gram: Floats, centre: Floats) -> tuple[Ints, float]:
    """z minimising (z − centre)ᵀ gram (z − centre), and that value. gram: (n, n) positive definite."""
    n = len(centre)
    if not n:
        return np.zeros(0, dtype=np.int64), 0.0
    root = np.asarray(np.linalg.cholesky(gram).T, dtype=np.float64)
    change = _reduced(root)
    upper = _triangular(root @ change)
    middle = np.linalg.solve(change.astype(float), centre)
    found, value = _enumerate(upper, middle)
    return change @ found, value


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
