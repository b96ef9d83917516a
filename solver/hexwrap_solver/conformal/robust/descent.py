"""Newton's method on Penner's space: through as many Delaunay triangulations as it takes.

The energy is convex and twice continuously differentiable across flips (Springborn 2020), and it has a
minimum for every annulus and all positive targets that obey Gauss–Bonnet (Gu, Luo, Sun, Wu 2018). Unlike on a
fixed triangulation there are no broken triangles: each trial point is made Delaunay first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Progress
from hexwrap_solver.conformal.energy import Energy
from hexwrap_solver.conformal.newton import (
    CHORD_GAIN,
    CHORDS,
    FEW,
    LAST_ROUNDINGS,
    LOCAL_STEPS,
    ROUNDING,
    STAGNATION,
    around,
    chords_left,
    largest,
)
from hexwrap_solver.conformal.robust.metric import Metric, angle_sums, edge_weights, measure_delaunay
from hexwrap_solver.conformal.robust.mirror import MirrorMesh
from hexwrap_solver.errors import ConvergenceError
from hexwrap_solver.linalg.factor import Factorisation

MAX_STEPS = 200
#: No single step may change u along an edge by more than this: Newton leaps where the Hessian is nearly
#: singular. Over many edges u may change as much as it likes: a long tube becomes a cone in a few steps.
MAX_CHANGE = 5.0
#: Acceptable overshoot φ'(t) / |φ'(0)| of a step along its direction.
OVERSHOOT = 0.1
MAX_TRIALS = 40
#: Added to the diagonal, relative to it and to 1, one after the other until the Hessian is definite: in exact
#: arithmetic it always is.
LIFTS = (0.0, 1e-9, 1e-6)
#: At first, and after a step that was cut short: where the residual is above LOCAL and the share SHARE of the
#: largest, these unknowns and their neighbours are brought near the solution by themselves, as in ``newton``.
LOCAL, SHARE = 0.03, 0.03
#: Newton may overshoot, but not by so much, where the answer is of use.
RUNAWAY = 2.0
#: Above this the answer is not accepted. Needles of 1e-4 degrees have rounding of 1e-9 in their angles.
ACCEPTED = 1e-8
#: So many steps that do not halve an accepted residual are tried before it counts as rounding: what rounding
#: leaves differs from step to step, and boundary angles show the sum of many residuals.
STALLS = 3


@dataclass(frozen=True)
class Descent:
    """u: (n,) where it ended, with its Delaunay metric. residual: max |angle sum − target|."""

    u: Floats
    metric: Metric
    residual: float
    iterations: int
    flips: int


class FlipEnergy:
    """The energy of ``plain``'s problem on the mirrored mesh, which follows u by flips."""

    def __init__(self, plain: Energy, mesh: MirrorMesh) -> None:
        self.plain = plain
        self.mesh = mesh
        self.flips = 0
        self._system: _Laplacian | None = None

    def at(self, x: Floats) -> tuple[Metric, Floats]:
        """The Delaunay metric at the unknowns x, and the gradient."""
        u = self.plain.scale_of(x)
        metric, flips = measure_delaunay(self.mesh, u)
        self.flips += flips
        return metric, self.plain.target - self.plain.reduce(angle_sums(self.mesh, metric))

    def newton_direction(self, metric: Metric, gradient: Floats) -> Floats:
        """−H⁻¹∇E. The symbolic analysis lasts until the next flip."""
        if self._system is None or self._system.flips != self.flips:
            self._system = _Laplacian(self)
        return self._system.solve(metric, -gradient)

    def chord_direction(self, gradient: Floats) -> Floats:
        """The same with the Hessian of an earlier step, which flips since then do not spoil: it is
        continuous."""
        assert self._system is not None
        return self._system.factorisation.solve(-gradient)

    def change(self, direction: Floats) -> float:
        """The greatest change of u along an edge of the current triangulation."""
        u = self.plain.scale_of(direction)
        return largest(u[self.mesh.origin[::2]] - u[self.mesh.origin[1::2]])


class _Laplacian:
    """The Hessian on one triangulation: a graph Laplacian of the unknowns, or of some of them."""

    def __init__(self, energy: FlipEnergy, among: Ints | None = None) -> None:
        """among: (k,) the unknowns that may change; all by default."""
        self.flips = energy.flips
        mesh, dof, n = energy.mesh, energy.plain.dof, energy.plain.n_dof
        points = energy.plain.points
        if among is not None:
            local = np.full(n + 1, -1)
            local[among] = np.arange(len(among))
            dof, n, points = local[dof], len(among), points[among]
        ends = dof[mesh.origin]
        low, high = np.minimum(ends[::2], ends[1::2]), np.maximum(ends[::2], ends[1::2])
        # an edge from a vertex to itself, or inside one tie, does not change
        self.edges = np.flatnonzero((low != high) & ~mesh.crossing)
        self.low, self.high = low[self.edges], high[self.edges]
        self.inside = self.low >= 0  # both ends free
        pairs, self.pair = np.unique(self.low[self.inside] * n + self.high[self.inside], return_inverse=True)
        self.n, self.n_pairs = n, len(pairs)
        self.factorisation = Factorisation(points, pairs % n, pairs // n)

    def solve(self, metric: Metric, right: Floats) -> Floats:
        """The solution for right (n,)."""
        weight = edge_weights(metric, self.edges)
        both = np.concatenate([self.low, self.high]) + 1
        diagonal = _sums(both, np.tile(weight, 2), self.n + 1)[1:]
        off_diagonal = -_sums(self.pair, weight[self.inside], self.n_pairs)
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


def _relaxed(energy: FlipEnergy, x: Floats, metric: Metric, gradient: Floats) -> _Step:
    """Newton's method among the unknowns where the residual is large, and their neighbours, if these are few.

    Behind new vertices and broken triangles there is much to do in few places; steps of all unknowns would
    be cut short for their sake (nonlinear elimination; Cai, Keyes 2002).
    """
    at = _Step(x, metric, gradient, False)
    for _ in range(LOCAL_STEPS):
        ends = energy.plain.dof[energy.mesh.origin]  # flips change them
        large = np.abs(at.gradient) > max(LOCAL, SHARE * largest(at.gradient))
        among = around(large, ends[::2], ends[1::2])
        if not 0 < len(among) <= FEW * len(x):
            break
        direction = np.zeros(len(x))
        direction[among] = _Laplacian(energy, among).solve(at.metric, -at.gradient[among])
        step = _line_search(energy, at.x, direction, at.gradient)
        if step is None:
            return _Step(at.x, *energy.at(at.x), False)
        at = step
    return at


def descend(energy: FlipEnergy, start: Floats, span: float, progress: Progress) -> Descent:
    """Minimises from ``start`` (n,) until rounding stops it; see ``residual`` for how far it got.

    span: how far the values of u may lie apart in an answer of any use.
    """
    x = energy.plain.unknowns_of(start)
    metric, gradient = energy.at(x)
    tolerance = max(ROUNDING, float(np.finfo(float).eps) * largest(energy.plain.target))
    x, metric, gradient, _ = _relaxed(energy, x, metric, gradient)
    iterations, stalls, chord = 0, 0, False
    while iterations < MAX_STEPS and largest(gradient) > tolerance:
        residual = largest(gradient)
        progress(
            min(0.9, iterations / 20), f"Newton step {iterations + 1} with flips, residual {residual:.1e}"
        )
        step = _chord(energy, x, gradient) if chord else None
        if step is None:
            if chord:
                metric, gradient = energy.at(x)  # the step that was tried has flipped edges
            step = _line_search(energy, x, energy.newton_direction(metric, gradient), gradient)
        if step is None:
            metric, gradient = energy.at(x)
            break
        iterations += 1
        if not step.full:
            step = _relaxed(energy, *step[:3])
        gain = largest(step.gradient) / residual
        if gain < 1 or residual > ACCEPTED:
            x, metric, gradient = step.x, step.metric, step.gradient
        else:
            metric, gradient = energy.at(x)
        stalls += gain > STAGNATION and residual <= ACCEPTED
        if stalls and (stalls == STALLS or residual <= LAST_ROUNDINGS):
            break  # nothing but rounding is left
        if np.ptp(x) > RUNAWAY * span:
            break  # no use to follow it further
        chord = step.full and chords_left(largest(gradient), gain, tolerance) <= CHORDS
    return Descent(energy.plain.scale_of(x), metric, largest(gradient), iterations, energy.flips)


def _sums(index: Ints, weights: Floats, n: int) -> Floats:
    return np.bincount(index, weights=weights, minlength=n).astype(np.float64)


class _Step(NamedTuple):
    """Where a step led: the unknowns, the metric and gradient there, and whether it was a full one."""

    x: Floats
    metric: Metric
    gradient: Floats
    full: bool


def _chord(energy: FlipEnergy, x: Floats, gradient: Floats) -> _Step | None:
    """A step with the Hessian of an earlier one; None where that is not good enough."""
    x = x + energy.chord_direction(gradient)
    metric, new = energy.at(x)
    residual = largest(gradient)
    enough = residual <= LAST_ROUNDINGS or largest(new) <= CHORD_GAIN * residual
    return _Step(x, metric, new, True) if enough else None


def _line_search(energy: FlipEnergy, x: Floats, direction: Floats, gradient: Floats) -> _Step | None:
    """The first point along the direction where φ' is at most a little above zero; φ is convex, so secants
    on φ' bracket its minimum."""
    slope = float(gradient @ direction)
    if not slope < 0:
        return None
    low, low_slope = 0.0, slope
    t = min(1.0, MAX_CHANGE / max(energy.change(direction), 1e-300))
    for _ in range(MAX_TRIALS):
        trial = x + t * direction
        metric, new = energy.at(trial)
        new_slope = float(new @ direction)
        if new_slope <= OVERSHOOT * abs(slope) or largest(new) <= 0.5 * largest(gradient):
            return _Step(trial, metric, new, t == 1.0)
        secant = low + (t - low) * low_slope / (low_slope - new_slope)
        t = min(max(secant, low + 0.1 * (t - low)), low + 0.7 * (t - low))
    return None
