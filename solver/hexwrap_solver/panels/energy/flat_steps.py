"""Steps of vertices shared by cells that are to become flat, by the planes' equations alone.

    min over x   ½ xᵀG x + gᵀx + ½ w ‖A x + r‖²

G has a block of three unknowns for each vertex, A the p − 3 rows by which a cell of p corners leaves a plane.
With the forces λ = w (A x + r) that hold the planes, x = −G⁻¹(g + Aᵀλ), and so (A G⁻¹Aᵀ + 1/w) λ = r − A G⁻¹g
(the range-space method; Nocedal and Wright 2006, section 16.2). Cells share vertices with their neighbours
alone, and there are fewer such rows than unknowns: of hexagons half as many, and separators of half the size,
so that the factorisation takes an eighth of the arithmetic that one in the vertices would take. However heavy
the planes, no digits are lost.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, runs
from hexwrap_solver.linalg.factor import Factorisation


class FlatSteps:
    def __init__(self, points: Floats, corners: Sequence[Ints]) -> None:
        """points: (n, 3) steer the elimination order. corners: per group of cells (q, p) vertices, those of
        a cell all different."""
        self._n = len(points)
        self._corners = [corner for corner in corners if corner.shape[1] > 3]
        sides = np.repeat([c.shape[1] for c in self._corners], [len(c) for c in self._corners])
        count = np.maximum(sides - 3, 0)  # rows of each cell
        self._rows = int(count.sum())
        if not self._rows:
            return
        rows = np.repeat(count, sides)  # of the cell at each corner
        first: Ints = np.repeat(np.cumsum(count) - count, sides)
        vertex = np.concatenate([corner.ravel() for corner in self._corners])
        center = np.concatenate([points[corner].mean(axis=1) for corner in self._corners])
        self._vertex = vertex
        self._one, self._other = _meeting(vertex)
        high = first[self._one] < first[self._other]
        self._one, self._other = np.where(high, [self._other, self._one], [self._one, self._other])
        # One product for each pair of rows of two cells, at each vertex that they share.
        size = rows[self._one] * rows[self._other]
        self._pair, within = runs(size)
        i, j = np.divmod(within, rows[self._other][self._pair])
        start = np.cumsum(rows) - rows
        one, other = self._one[self._pair], self._other[self._pair]
        row, column = first[one] + i, first[other] + j
        below = row >= column  # of a cell with itself, half
        self._pair = self._pair[below]
        self._left, self._right = (start[one] + i)[below], (start[other] + j)[below]
        key, self._at = np.unique(row[below] * self._rows + column[below], return_inverse=True)
        row, column = np.divmod(key, self._rows)
        self._below, self._diagonal = np.flatnonzero(row > column), np.flatnonzero(row == column)
        self._factor = Factorisation(np.repeat(center, count, axis=0), row[self._below], column[self._below])

    def factorise(
        self, blocks: Floats, normals: Sequence[Floats], bases: Sequence[Floats], weight: float
    ) -> None:
        """blocks: (n, 3, 3) of G. Of each group of cells with more than three corners: normals (q, 3), and
        bases (q, p, p − 3), so that row k of a cell is Σ bases[i, k] normal · x_i over its corners i."""
        self._inverse = np.asarray(np.linalg.inv(blocks), dtype=np.float64)
        self._normals, self._bases = normals, bases
        if not self._rows:
            return
        normal = np.concatenate(
            [np.repeat(v, c.shape[1], axis=0) for v, c in zip(normals, self._corners, strict=True)]
        )
        moved = np.einsum("kde,ke->kd", self._inverse[self._vertex], normal)
        share = np.einsum("kd,kd->k", normal[self._one], moved[self._other])
        basis = np.concatenate([basis.ravel() for basis in bases])
        product = share[self._pair] * basis[self._left] * basis[self._right]
        value = np.asarray(np.bincount(self._at, weights=product), dtype=np.float64)
        self._factor.factorise(value[self._diagonal] + 1 / weight, value[self._below])

    def solve(self, gradient: Floats, heights: Sequence[Floats] | None = None) -> Floats:
        """g (n, 3) → x; heights: r of each group, (q, p − 3), none for 0."""
        moved: Floats = np.einsum("nde,ne->nd", self._inverse, gradient)
        if not self._rows:
            return np.asarray(-moved)
        right = -self._leaving(moved)
        if heights is not None:
            right += np.concatenate([height.ravel() for height in heights])
        forces = self._holding(self._factor.solve(right))
        return np.asarray(-moved - np.einsum("nde,ne->nd", self._inverse, forces))

    def _leaving(self, moved: Floats) -> Floats:
        """A x."""
        groups = zip(self._corners, self._normals, self._bases, strict=True)
        return np.concatenate(
            [(((moved[at] @ v[:, :, None])[:, None, :, 0]) @ basis).ravel() for at, v, basis in groups]
        )

    def _holding(self, forces: Floats) -> Floats:
        """(n, 3) Aᵀλ."""
        parts, begin = [], 0
        for v, basis in zip(self._normals, self._bases, strict=True):
            q, p, k = basis.shape
            along = (basis @ forces[begin : begin + q * k].reshape(q, k, 1))[..., 0]
            parts.append((along[..., None] * v[:, None]).reshape(q * p, 3))
            begin += q * k
        return summed(np.concatenate(parts), self._vertex, self._n)


def summed(values: Floats, at: Ints, n: int) -> Floats:
    """(n, d) sums of values (k, d) at places (k,)."""
    return np.stack([np.bincount(at, weights=column, minlength=n) for column in values.T], axis=1)


def _meeting(vertex: Ints) -> tuple[Ints, Ints]:
    """All pairs of corners (k,) at the same vertex, each pair once and each corner with itself."""
    order = np.argsort(vertex, kind="stable")
    one, other, step = [order], [order], 1
    while True:
        met = np.flatnonzero(vertex[order[step:]] == vertex[order[: len(order) - step]])
        if not len(met):
            return np.concatenate(one), np.concatenate(other)
        one.append(order[met + step])
        other.append(order[met])
        step += 1
