"""Newton's method on Penner's space: through as many Delaunay triangulations as it takes.

The energy is convex and twice continuously differentiable across flips (Springborn 2020), and it has a
minimum for every annulus and all positive targets that obey Gauss–Bonnet (Gu, Luo, Sun, Wu 2018). Unlike on a
fixed triangulation no triangle inequality is ever violated: each trial point is made Delaunay first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Progress, positions
from hexwrap_solver.conformal import newton
from hexwrap_solver.conformal.energy import Energy, total
from hexwrap_solver.conformal.newton import Rules, largest
from hexwrap_solver.conformal.robust.metric import Metric, angle_sums, edge_weights, measure_delaunay
from hexwrap_solver.conformal.robust.mirror import MirrorMesh
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.linalg.factor import Factorisation

#: Above this residual the answer is not accepted. Needles of 1e-4 degrees have rounding of 1e-9 in their
#: angles.
ACCEPTED = 1e-8
#: No single step may change u along an edge by more than ``leap``: Newton leaps where the Hessian is nearly
#: singular. Over many edges u may change as much as it likes: a long tube becomes a cone in a few steps. What
#: rounding leaves differs from step to step, and boundary angles show the sum of many residuals: hence the
#: ``stalls``. Behind new vertices there is much to do in few places ``at_first``.
RULES = Rules(
    steps=200, leap=5.0, accepted=ACCEPTED, stalls=3, large=0.03, share=0.03, settled=0.0, usual=20,
    at_first=True, words=" with flips",
)  # fmt: skip
#: Added to the diagonal, relative to it and to 1, one after the other until the Hessian is definite: in exact
#: arithmetic it always is.
LIFTS = (0.0, 1e-9, 1e-6)
#: Newton may overshoot, but the answer is of no use with more than this times the span it may have.
RUNAWAY = 2.0


@dataclass(frozen=True)
class Descent:
    """u: (n,) where it ended, with its Delaunay metric. residual: max |angle sum − target|."""

    u: Floats
    metric: Metric
    residual: float
    iterations: int
    flips: int


def descend(energy: FlipEnergy, start: Floats, progress: Progress) -> Descent:
    """Minimises from ``start`` (n,) until rounding stops it; see ``residual`` for how far it got."""
    x = energy.plain.unknowns_of(start)
    found = newton.descend(energy, x, RULES, progress, energy.plain.target)
    point = found.point
    return Descent(
        energy.plain.scale_of(point.x), point.metric, largest(point.gradient), found.iterations, energy.flips
    )


@dataclass(frozen=True)
class FlipPoint:
    """The unknowns, the Delaunay metric there, and the gradient."""

    x: Floats
    metric: Metric
    gradient: Floats


class FlipEnergy:
    """The energy of ``plain``'s problem on the mirrored mesh, which follows u by flips; see ``Convex``.

    span: how far the values of u may lie apart in an answer of any use.
    """

    def __init__(self, plain: Energy, mesh: MirrorMesh, span: float = np.inf) -> None:
        self.plain = plain
        self.mesh = mesh
        self.span = span
        self.flips = 0
        self._system: _Laplacian | None = None

    def at(self, x: Floats) -> FlipPoint:
        metric, flips = measure_delaunay(self.mesh, self.plain.scale_of(x))
        self.flips += flips
        sums = self.plain.reduce(angle_sums(self.mesh, metric))
        return FlipPoint(x, metric, self.plain.target - sums)

    def again(self, point: FlipPoint) -> FlipPoint:
        """Points that were tried since have flipped edges."""
        return self.at(point.x)

    def edges(self) -> tuple[Ints, Ints]:
        ends = self.plain.dof[self.mesh.origin]
        return ends[::2], ends[1::2]

    def change(self, direction: Floats) -> float:
        """The greatest change of u along an edge of the current triangulation."""
        u = self.plain.scale_of(direction)
        return largest(u[self.mesh.origin[::2]] - u[self.mesh.origin[1::2]])

    def direction(self, point: FlipPoint) -> Floats:
        """The symbolic analysis lasts until the next flip."""
        if self._system is None or self._system.flips != self.flips:
            self._system = _Laplacian(self)
        return self._system.solve(point.metric, -point.gradient)

    def local_direction(self, point: FlipPoint, among: Ints) -> Floats:
        direction = np.zeros(len(point.x))
        direction[among] = _Laplacian(self, among).solve(point.metric, -point.gradient[among])
        return direction

    def solve(self, right: Floats) -> Floats:
        """Flips since then do not spoil the Hessian: it is continuous."""
        assert self._system is not None
        return self._system.factorisation.solve(right)

    def is_hopeless(self, point: FlipPoint, iterations: int, settled: bool) -> bool:
        return bool(np.ptp(point.x) > RUNAWAY * self.span)


class _Laplacian:
    """The Hessian on one triangulation: a graph Laplacian of the unknowns, or of some of them."""

    def __init__(self, energy: FlipEnergy, among: Ints | None = None) -> None:
        """among: (k,) the unknowns that may change; all by default."""
        self.flips = energy.flips
        mesh, dof, n = energy.mesh, energy.plain.dof, energy.plain.n_dof
        points = energy.plain.points
        if among is not None:
            local = positions(among, n + 1)
            dof, n, points = local[dof], len(among), points[among]
        ends = dof[mesh.origin]
        low, high = np.minimum(ends[::2], ends[1::2]), np.maximum(ends[::2], ends[1::2])
        # an edge from a vertex to itself, or between vertices that share an unknown, does not change
        self.edges = np.flatnonzero((low != high) & ~mesh.crossing)
        self.low, self.high = low[self.edges], high[self.edges]
        self.inside = self.low >= 0  # both ends free
        pairs, self.pair = np.unique(self.low[self.inside] * n + self.high[self.inside], return_inverse=True)
        self.n, self.n_pairs = n, len(pairs)
        self.factorisation = Factorisation(points, pairs % n, pairs // n)

    def solve(self, metric: Metric, right: Floats) -> Floats:
        """The solution for right (n,). Raises ConvergenceError."""
        weight = edge_weights(metric, self.edges)
        both = np.concatenate([self.low, self.high]) + 1
        diagonal = total(both, np.tile(weight, 2), self.n + 1)[1:]
        off_diagonal = -total(self.pair, weight[self.inside], self.n_pairs)
        for lift in LIFTS:
            try:
                self.factorisation.factorise(diagonal * (1 + lift) + lift, off_diagonal)
            except np.linalg.LinAlgError:
                continue
            return self.factorisation.solve(right)
        raise ConvergenceError(
            "Newton's method with flips met a matrix that double precision cannot solve: the surface has "
            "edges or angles too small for it; remesh it more evenly."
        )
