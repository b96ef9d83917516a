"""The convex energy of discretely conformal metrics (Springborn, Schröder, Pinkall 2008, section 3).

New lengths are l̃_ij = e^{(u_i+u_j)/2} l_ij. Its gradient is Θ_i − Σ angles at i, its Hessian half the
cotangent Laplacian of the *new* metric. Only gradient and Hessian are needed: see ``newton``.

All arrays per corner are (3, m): row k belongs to corner k of every face, and the edge opposite to it.
That keeps each operation contiguous in memory.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Complexes, Floats, Ints, positions
from hexwrap_solver.conformal.types import Targets
from hexwrap_solver.surface.topology import edge_lengths
from hexwrap_solver.surface.types import Surface


def total(index: Ints, values: Floats, n: int) -> Floats:
    """(n,) sums of the values that share an index."""
    return np.asarray(np.bincount(index, weights=values, minlength=n), dtype=np.float64)


def opposite_lengths(vertices: Floats, faces: Ints) -> Floats:
    """(3, m) length of the edge opposite to each corner."""
    return np.ascontiguousarray(edge_lengths(vertices, faces).T[[1, 2, 0]])


@dataclass(frozen=True)
class Corners:
    """Angles of every triangle of a metric, and what the Hessian needs.

    angle: (3, m). excess: (3, m) s = b + c − a, and radius: (m,) r, of which tan(α/2) = r/s. violating: (m,)
    where the triangle inequality fails.
    """

    angle: Floats
    excess: Floats
    radius: Floats
    violating: Bools

    def directions(self) -> Complexes:
        """(m,) e^{iα} at corner 0, from tan(α/2) = r/s."""
        half = np.empty(self.angle.shape[1], dtype=complex)
        half.real, half.imag = self.excess[0], self.radius
        return np.asarray(half / np.conj(half))

    def cotangent(self) -> Floats:
        """(3, m) cot α = (s² − r²) / (2 r s), from tan(α/2) = r/s; no cancellation beyond that in s itself. 0
        where they violate it."""
        with np.errstate(divide="ignore", invalid="ignore"):
            cot = (self.excess - self.radius) * (self.excess + self.radius) / (2 * self.radius * self.excess)
        if self.violating.any():
            cot[:, self.violating] = 0.0
        return np.asarray(cot)


def corner_angles(lengths: Floats) -> Corners:
    """Angles from (3, m) lengths, continued by (π, 0, 0) where the triangle inequality fails.

    Half-angle form tan(α/2) = r/s_a with s_a = b + c − a and r² = s_a s_b s_c/(a + b + c): accurate for
    needles and caps alike. The three angles add up to π exactly, as Gauss–Bonnet wants it.
    """
    a, b, c = lengths
    # b + c − a in an order in which close lengths are subtracted first
    excess = np.stack([c + (b - a), a + (c - b), b + (a - c)])
    violating = np.asarray((excess <= 0).any(axis=0))
    square = excess[0] * excess[1] * excess[2] / (a + b + c)
    radius = np.sqrt(np.maximum(square, 0.0, where=~violating, out=np.zeros_like(square)))
    angle = np.zeros_like(lengths)
    angle[:2] = 2 * np.arctan2(radius, excess[:2])
    if violating.any():
        angle[:2, violating] = np.where(excess[:2, violating] <= 0, np.pi, 0.0)
    angle[2] = np.pi - angle[0] - angle[1]
    return Corners(angle, excess, radius, violating)


class Energy:
    """Gradient and Hessian in the unknowns that are left after pinning and tying (see ``Targets``).

    dof: (n,) unknown of each vertex, −1 where u = 0 is fixed. With nothing pinned, u is only defined up to
    a constant: then a vertex in the middle of the numbering is pinned (its equation follows from
    Gauss–Bonnet): on most meshes it is none at an end, where u would become twice as large and lose a digit.
    rows, columns: (e,) the off-diagonal pattern of the Hessian, rows > columns, each pair once.
    """

    def __init__(self, surface: Surface, targets: Targets) -> None:
        self.targets = targets
        self.n = len(surface.vertices)
        self._vertices = surface.vertices
        self.corner = np.ascontiguousarray(surface.faces.T)
        self.lengths = np.ascontiguousarray(surface.lengths.T[[1, 2, 0]])
        self.dof, self.n_dof = _unknowns(targets)
        self.target = self._reduced(targets)
        self._pair: Ints | None = None
        self._find_pattern(surface)

    def aimed_at(self, targets: Targets) -> Energy:
        """The same with other target angles; what is pinned and tied must stay."""
        other = copy(self)
        other.targets, other.target = targets, self._reduced(targets)
        return other

    def _reduced(self, targets: Targets) -> Floats:
        """(n_dof,) target of each unknown."""
        target = self.reduce(np.where(targets.shared < 0, targets.angle, 0.0))
        for shared in range(1, len(targets.shared_angle)):
            target[self.dof[np.argmax(targets.shared == shared)]] = targets.shared_angle[shared]
        return target

    @property
    def points(self) -> Floats:
        """(n_dof, 3) where each unknown stands, NaN for unknowns that many vertices share."""
        points = np.full((self.n_dof, 3), np.nan)
        alone = np.flatnonzero((self.dof >= 0) & (self.targets.shared < 0))
        points[self.dof[alone]] = self._vertices[alone]
        return points

    def _find_pattern(self, surface: Surface) -> None:
        """Edges between unknowns, each once, and the corners whose cotangents they take."""
        order, first = surface.edge_groups
        face = order // 3
        corner = order - 3 * face
        self._opposite = (corner + 2) % 3 * len(surface.faces) + face
        self._first = first[:-1]
        unknown = self.dof + 1  # 0: pinned
        start, end = (unknown[side] for side in surface.edge_ends)
        low, high = np.minimum(start, end), np.maximum(start, end)
        self._apart = np.flatnonzero(
            low != high
        )  # an edge between vertices of one shared unknown does not change
        self._low, self._high = low[self._apart], high[self._apart]
        self._inner = np.flatnonzero(self._low > 0)
        rows, columns = self._high[self._inner] - 1, self._low[self._inner] - 1
        if len(self.targets.shared_angle) > 1:  # several edges join one vertex and one shared
            pairs, self._pair = np.unique(rows * self.n_dof + columns, return_inverse=True)
            rows, columns = pairs // self.n_dof, pairs % self.n_dof
        self.rows, self.columns = rows, columns

    def reduce(self, per_vertex: Floats) -> Floats:
        """Sums over the vertices that share an unknown; pinned ones fall away."""
        return total(self.dof + 1, per_vertex, self.n_dof + 1)[1:]

    def scale_of(self, x: Floats) -> Floats:
        """(n,) u from the unknowns."""
        u = np.concatenate([[0.0], x])[self.dof + 1]
        return u if self.targets.offset is None else u + self.targets.offset

    def unknowns_of(self, u: Floats) -> Floats:
        """(n_dof,) the unknowns from u, which is shifted to vanish where it is pinned."""
        if self.targets.offset is not None:
            u = u - self.targets.offset
        pinned = np.flatnonzero(self.dof < 0)
        x = np.zeros(self.n_dof + 1)
        x[self.dof + 1] = u - u[pinned].mean()
        return x[1:]

    def corners(self, u: Floats) -> Corners:
        """Angles of the new metric. Each triangle is scaled by e^{−(u_i+u_j+u_k)/2}, which leaves them as
        they are and makes one exponential per vertex do."""
        return corner_angles(self.lengths * np.exp((u.mean() - u) / 2)[self.corner])

    def scaled_lengths(self, u: Floats) -> Floats:
        """(3, m) e^{(u_i+u_j)/2} l_ij."""
        half = np.exp(u / 2)[self.corner]
        return np.asarray(self.lengths * half[[1, 2, 0]] * half[[2, 0, 1]])

    def angle_sums(self, corners: Corners) -> Floats:
        """(n,) angle sum at each vertex."""
        return total(self.corner.ravel(), corners.angle.ravel(), self.n)

    def gradient(self, corners: Corners) -> Floats:
        """(n_dof,) Θ − Σ angles."""
        return self.target - self.reduce(self.angle_sums(corners))

    def hessian(self, corners: Corners) -> tuple[Floats, Floats]:
        """(n_dof,) diagonal and (e,) off-diagonal values of half the cotangent Laplacian."""
        weight = 0.5 * corners.cotangent().ravel()[self._opposite]
        edge = np.add.reduceat(weight, self._first)[self._apart]
        diagonal = total(self._low, edge, self.n_dof + 1) + total(self._high, edge, self.n_dof + 1)
        off_diagonal = -edge[self._inner]
        if self._pair is not None:
            off_diagonal = total(self._pair, off_diagonal, len(self.rows))
        return diagonal[1:], off_diagonal


def _unknowns(targets: Targets) -> tuple[Ints, int]:
    """(n,) unknown of each vertex (−1: pinned) and their number; shared unknowns come last."""
    free = targets.shared < 0
    if not (targets.shared == 0).any():
        free = free.copy()
        free[np.flatnonzero(free)[int(free.sum()) // 2]] = False
    n_free = int(free.sum())
    dof = positions(np.flatnonzero(free), len(free))
    tied = targets.shared > 0
    dof[tied] = n_free + targets.shared[tied] - 1
    return dof, n_free + max(len(targets.shared_angle) - 1, 0)
